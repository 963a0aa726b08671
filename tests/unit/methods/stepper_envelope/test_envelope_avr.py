"""The C header on an 8-bit controller, an ATmega1284P as simavr has it: every step as here, and what it costs."""

import re
import shutil
import subprocess
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from tests.stepper_rig import COARSE_FINE, MAX_HZ, RAMP, turn_envelopes
from tests.unit.methods.stepper_envelope.test_envelope_header import default_tables

import detent
from detent.control.step_rule import IDLE, PAUSE, STEP, next_entry, place_motor, start_move
from detent.methods.stepper_envelope.controller import (
    NOWHERE,
    StepperController,
    StepperControllerParams,
    load_rule,
    step_once,
)
from detent.methods.stepper_envelope.envelope_files import PAGE, EnvelopeTables, paged, write_envelope_header
from detent.planning.step_envelope import INDEX_BITS, ZoneMap

TOOLS = ("avr-gcc", "simavr")
pytestmark = [
    pytest.mark.process,
    pytest.mark.wide,
    pytest.mark.skipif(
        not all(map(shutil.which, TOOLS)),
        reason="no AVR compiler or simulator here (Debian: apt install gcc-avr avr-libc simavr)",
    ),
]

SOURCE = Path(__file__).with_name("step_rule_avr.c")
FLAGS = ("-std=gnu99", "-Wall", "-Wextra", "-Werror", "-Wconversion", "-Wno-unused-function")
CALL = re.compile(r"^([012]) (-?\d+) (\d+) (\d+)\.?$", re.MULTILINE)


@dataclass(frozen=True)
class Order:
    """A move by its direction, to the end of its table or to a stop."""

    heading: int
    stop: int | None = None
    turns: int = 0

    def in_c(self) -> str:
        moved = "" if self.stop is None else f"M(move_stop)(&motor, {self.heading}, {self.stop}); "
        return f"{moved}M(start)(&motor, {self.heading}, {self.turns}); while (call(empty)) {{}}"


def compiled(tables: EnvelopeTables, folder: Path, orders: tuple[Order, ...], *flags: str, mcu: str = "atmega1284p"):
    """What the compiler says to a firmware that drives the motor; firmware.elf."""
    write_envelope_header(tables, folder / "motor.h")
    moves = any(order.stop is not None for order in orders)
    defined = [f"-D{tables.motor.upper()}_STOPS_MOVE"] if moves else []
    words = [
        "avr-gcc", f"-mmcu={mcu}", *FLAGS, *flags, *defined, f"-I{folder}", '-DHEADER="motor.h"',
        f"-DM(x)={tables.motor}_##x", f"-DORDERS={' '.join(order.in_c() for order in orders)}", str(SOURCE),
        "-o", str(folder / "firmware.elf"),
    ]  # fmt: skip
    return subprocess.run(words, check=False, capture_output=True, text=True)


def on_avr(tables: EnvelopeTables, folder: Path, orders: tuple[Order, ...], flag: str = "-Os") -> list[list[int]]:
    """What every call of the rule returns, where the motor is then, its period, and the cycles that it took."""
    done = compiled(tables, folder, orders, flag)
    assert done.returncode == 0, done.stderr
    simavr = ["simavr", "-m", "atmega1284p", "-f", "16000000", str(folder / "firmware.elf")]
    done = subprocess.run(simavr, check=True, capture_output=True, text=True, timeout=300)
    told = re.sub(r"\x1b\[[\d;]*m", "", done.stderr + done.stdout)  # simavr prints what it hears in green
    return [[int(number) for number in call] for call in CALL.findall(told)]


def in_python(tables: EnvelopeTables, orders: tuple[Order, ...]) -> list[list[int]]:
    """The same of the rule here, without the cycles."""
    p, c = StepperControllerParams(pause=tables.pause), StepperController(stop_at=NOWHERE)
    load_rule(p, tables.up.ramp, tables.up.zones.limits, tables.clock_hz, reload=tables.reload)
    place_motor(c.rule, 0)
    calls: list[list[int]] = []
    for order in orders:
        if order.stop is not None:
            (tables.up if order.heading > 0 else tables.down).move_stop(order.stop)
        start_move(c.rule, order.heading, order.turns)
        outcome = STEP
        while outcome != IDLE:
            outcome = step_once(p, c, next_entry(c.rule, tables.up.entries, tables.down.entries))
            calls.append([outcome, c.rule.position, c.timer.period])
    return calls


TO_AND_FRO = (Order(1), Order(-1))
SHORT = (Order(1, stop=3000), Order(-1, stop=1000), Order(1, stop=1700))


@pytest.mark.parametrize("flag", ["-Os", "-O2"])
@pytest.mark.parametrize(
    ("file", "motor", "orders"),
    [
        ("zoom", "group_a", TO_AND_FRO), ("zoom", "group_b", SHORT), ("stage", "x", SHORT), ("stage", "y", TO_AND_FRO),
        ("photo_table", "table", SHORT), ("photo_table", "lift", SHORT),
    ],
)  # fmt: skip
def test_the_packaged_steppers_step_as_here_within_240_cycles(tmp_path, file, motor, orders, flag):
    tables = detent.load(detent.example(f"{file}.toml")).envelopes()[motor].tables
    found = on_avr(tables, tmp_path, orders, flag)
    assert [call[:3] for call in found] == in_python(tables, orders)
    cycles = np.array([call[3] for call in found if call[0] == STEP])
    assert len(cycles) > 4000
    assert 150 < cycles.mean() <= 240
    assert cycles.min() > 150
    assert cycles.max() <= 300


@pytest.mark.parametrize("pause", [0, 3])
def test_a_turn_with_and_without_a_pause(tmp_path, pause):
    tables = default_tables(COARSE_FINE, turn=6000, stop=1500, pause=pause)
    orders = (Order(1, turns=1),)
    found = on_avr(tables, tmp_path, orders)
    assert [call[:3] for call in found] == in_python(tables, orders)
    assert [call[0] for call in found].count(PAUSE) == 1
    assert found[-1][:3] == [IDLE, 1500, 0]


def tables_without_equal_pages(pages: int) -> EnvelopeTables:
    """Tables in which any step may be one of a fine zone: no page is like another."""
    random, steps = np.random.default_rng(5), pages // 2 * PAGE - 1
    up, down = turn_envelopes(RAMP, ZoneMap(steps, MAX_HZ, COARSE_FINE), 0, steps, 0)
    for table in (up, down):
        table.entries[table.entries >= 0] ^= random.integers(0, 2, steps, np.int16) << INDEX_BITS
    return replace(default_tables(motor="m"), up=up, down=down)


def test_tables_beyond_64_kb_are_read_where_they_are(tmp_path):
    tables = tables_without_equal_pages(200)
    assert (paged(tables).bytes, len(paged(tables).objects)) == (102_400, 4)
    found = on_avr(tables, tmp_path, TO_AND_FRO)
    assert [call[:3] for call in found] == in_python(tables, TO_AND_FRO)


def test_a_device_that_is_too_small_is_told_how_much_is_needed(tmp_path):
    done = compiled(tables_without_equal_pages(70), tmp_path, TO_AND_FRO, mcu="atmega328p")
    assert "Motor m: its tables take 35840 bytes of flash, and this device has less" in done.stderr
    up, down = turn_envelopes(RAMP, ZoneMap(400_000, MAX_HZ), 0, 400_000, 0)
    done = compiled(replace(default_tables(motor="m"), up=up, down=down), tmp_path, TO_AND_FRO, mcu="atmega328p")
    assert "Motor m: the order of its pages takes 3126 bytes of RAM, and this device has less" in done.stderr


def test_a_word_of_a_frequency_costs_a_division(tmp_path):
    tables = default_tables(COARSE_FINE, reload=False, clock_hz=20_000_000)
    orders = (Order(1, stop=900),)
    found = on_avr(tables, tmp_path, orders)
    assert [call[:3] for call in found] == in_python(tables, orders)
    assert 600 < np.mean([call[3] for call in found if call[0] == STEP]) < 1000
