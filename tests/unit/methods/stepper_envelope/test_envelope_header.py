"""The step rule in C and the one that runs here: the same bits in every register after every call."""

import ctypes
import re
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.bench.race import COMPILER, compile_c
from tests.stepper_rig import COARSE_FINE, MAX_HZ, RAMP, N, turn_envelopes

from detent.control.step_rule import (
    ACCEL,
    CRUISE,
    DECEL,
    FAULT,
    IDLE,
    INFEASIBLE,
    OUT_OF_RANGE,
    PAUSE,
    REST,
    STEP,
    TURN,
    StepRule,
    deflect,
    next_entry,
    place_motor,
    start_move,
)
from detent.control.step_timer import StepTimer
from detent.methods.stepper_envelope.controller import (
    NOWHERE,
    StepperController,
    StepperControllerParams,
    load_rule,
    step_once,
)
from detent.methods.stepper_envelope.envelope_files import EnvelopeTables, paged, register_types, write_envelope_header
from detent.planning.step_envelope import INDEX_BITS, SENTINEL, StepEnvelope, Zone, ZoneMap
from detent.planning.step_ramp import StepRamp

pytestmark = [
    pytest.mark.process,
    pytest.mark.skipif(COMPILER is None, reason="no C compiler (cc) here to compile the header with"),
]

STRICT = ("-Wpedantic", "-Wconversion", "-Wsign-conversion", "-Wshadow", "-Wundef", "-Wcast-qual")
CLOCK_HZ = 1_000_000

CALLS = """
unsigned long @_size(void);
int @_call(@_registers *m);
void @_set(@_registers *m, int32_t position);
void @_go(@_registers *m, int8_t heading, uint16_t turns);
void @_lever(@_registers *m, int32_t word, int8_t heading);
void @_table(int up, int16_t *entries);
unsigned long @_size(void) { return (unsigned long)sizeof(@_registers); }
int @_call(@_registers *m) { return @_next(m); }
void @_set(@_registers *m, int32_t position) { @_place(m, position); }
void @_go(@_registers *m, int8_t heading, uint16_t turns) { @_start(m, heading, turns); }
void @_lever(@_registers *m, int32_t word, int8_t heading) { @_deflect(m, word, heading); }
void @_table(int up, int16_t *entries)
{
    for (int32_t p = 0; p <= NAME_STEPS; p++) {
        entries[p] = @_read(up ? @_up : @_down, (uint16_t)p);
    }
}
#ifdef NAME_STOPS_MOVE
int32_t @_stop_at(const @_registers *m, int8_t heading, int32_t position);
int32_t @_stop_at(const @_registers *m, int8_t heading, int32_t position) { return @_move_stop(m, heading, position); }
#elif NAME_OWN > 0
void @_edit(int up, const int16_t *entries);
void @_edit(int up, const int16_t *entries)
{
    for (int32_t p = 0; p <= NAME_STEPS; p++) {
        @_own[(up ? 0 : NAME_ORDER_LENGTH * 256) + p] = entries[p];
    }
    for (int k = 0; k < NAME_ORDER_LENGTH; k++) {
        (up ? @_up : @_down)[k] = (uint8_t)(NAME_PAGES + (up ? 0 : NAME_ORDER_LENGTH) + k);
    }
}
#endif
"""
"""What a shared library exports of a header's functions, all of them static; @ and NAME stand for the motor."""


def firmware_registers(tables: EnvelopeTables) -> type[ctypes.Structure]:
    """Registers of the header, as wide as it makes them."""
    parts = []
    for name, registers in (("rule", StepRule), ("timer", StepTimer)):
        types = register_types(tables, registers)
        fields = [(n, getattr(ctypes, f"c_{kind.removesuffix('_t')}")) for n, kind in types.items()]
        parts.append((name, type(name, (ctypes.Structure,), {"_fields_": fields})))
    return type("Registers", (ctypes.Structure,), {"_fields_": parts})


def compile_headers(folder: Path, *motors: EnvelopeTables, stops: bool = False) -> ctypes.CDLL:
    """One source file that includes the headers of all motors; their stops move, or every entry can be edited."""
    source = folder / "firmware.c"
    names = [tables.motor for tables in motors]
    lines = []
    for name, tables in zip(names, motors, strict=True):
        write_envelope_header(tables, folder / f"{name}.h")
        own = "STOPS_MOVE" if stops else f"OWN {2 * len(paged(tables).up)}"
        lines += [f"#define {name.upper()}_{own}", f'#include "{name}.h"']
    lines += [CALLS.replace("@", name).replace("NAME_", f"{name.upper()}_") for name in names]
    source.write_text("\n".join(lines), encoding="utf-8")
    return compile_c(source, folder, *STRICT)


class Twins:
    """One motor twice, in Python and in C, given the same orders; every call compares all their registers."""

    def __init__(self, tables: EnvelopeTables, library: ctypes.CDLL, at: int = 0) -> None:
        self.tables, self.library, self.name = tables, library, tables.motor
        self.p, self.r = StepperControllerParams(pause=tables.pause), StepperController(stop_at=NOWHERE)
        load_rule(self.p, tables.up.ramp, tables.up.zones.limits, tables.clock_hz, reload=tables.reload)
        narrow = firmware_registers(tables)
        self.c, self.wanted = narrow(), narrow()
        self.place(at)
        assert self._function("size")() == ctypes.sizeof(narrow)
        self.compare_tables()
        self.periods: list[int] = []
        self.seen: set[tuple[str, int]] = set()

    def _function(self, verb: str):
        return getattr(self.library, f"{self.name}_{verb}")

    def _c(self, verb: str, *arguments) -> int:
        return self._function(verb)(ctypes.byref(self.c), *arguments)

    def copy_tables(self) -> None:
        """Bring an edit to the firmware's own pages."""
        for up, table in ((1, self.tables.up), (0, self.tables.down)):
            self._function("edit")(up, ctypes.c_void_p(table.entries.ctypes.data))
        self.compare_tables()

    def compare_tables(self) -> None:
        """Entry by entry."""
        for up, table in ((1, self.tables.up), (0, self.tables.down)):
            found = np.empty_like(table.entries)
            self._function("table")(up, ctypes.c_void_p(found.ctypes.data))
            assert found.tolist() == table.entries.tolist()

    def place(self, position: int) -> None:
        place_motor(self.r.rule, position)
        self._c("set", ctypes.c_int32(position))

    def move_stop(self, heading: int, position: int) -> None:
        """Move the stop of a direction, of a motor that may be running in it."""
        rule, table = self.r.rule, self.tables.up if heading > 0 else self.tables.down
        running = (rule.position, rule.index) if rule.direction == heading else ()
        found = self._c("stop_at", ctypes.c_int8(heading), ctypes.c_int32(position))
        assert found == table.move_stop(position, *running).stop
        self.compare_tables()

    def start(self, heading: int, turns: int = 0) -> None:
        start_move(self.r.rule, heading, turns)
        self._c("go", ctypes.c_int8(heading), ctypes.c_uint16(turns))

    def deflect(self, word: int, heading: int) -> None:
        deflect(self.p.rule, self.r.rule, word, len(self.tables.up.ramp) - 1, heading)
        self._c("lever", ctypes.c_int32(word), ctypes.c_int8(heading))

    def lever(self, hz: float, heading: int) -> None:
        """Deflect by a frequency, whatever the words are; 0 releases."""
        self.deflect(round(self.tables.clock_hz / hz if self.tables.reload and hz else hz), heading)

    def write(self, register: str, value: int) -> None:
        for rule in (self.r.rule, self.c.rule):
            setattr(rule, register, value)

    def call(self) -> int:
        """One period is over."""
        entry = next_entry(self.r.rule, self.tables.up.entries, self.tables.down.entries)
        found = step_once(self.p, self.r, entry)
        assert self._c("call") == found
        self.compare()
        rule = self.r.rule
        self.seen |= {("outcome", found), ("state", rule.state), ("cause", rule.cause)}
        if found == STEP:
            self.periods.append(self.r.timer.period)
        return found

    def compare(self) -> None:
        """All registers, as wide as the firmware has them."""
        for ours, wanted, theirs in (
            (self.r.rule, self.wanted.rule, self.c.rule), (self.r.timer, self.wanted.timer, self.c.timer),
        ):  # fmt: skip
            for name, _ in wanted._fields_:
                setattr(wanted, name, getattr(ours, name))
                assert (name, getattr(theirs, name)) == (name, getattr(wanted, name))

    def run(self, steps: int = 10**6) -> None:
        """So many steps, or to rest."""
        done = 0
        while done < steps:
            found = self.call()
            if found == IDLE:
                return
            done += found == STEP

    @property
    def at_rest(self) -> tuple[int, int]:
        """Where it stands, and the state there."""
        assert self.c.rule.index == -1
        return self.c.rule.position, self.c.rule.state


def default_tables(zones=(), *, motor="zoom_a", reload=True, turn=N, stop=0, pause=1, clock_hz=CLOCK_HZ):
    up, down = turn_envelopes(RAMP, ZoneMap(N, MAX_HZ, zones), 0, turn, stop)
    return EnvelopeTables(
        motor=motor, axis="microscope", up=up, down=down, clock_hz=clock_hz, reload=reload, travel_per_step=5e-6,
        pause=pause,
    )  # fmt: skip


@pytest.fixture(
    params=[(True, CLOCK_HZ, 1), (False, CLOCK_HZ, 0), (True, 72_000_000, 2), (False, 2**31 - 1, 1)],
    ids=["reload", "frequency", "32-bit reload", "fastest clock"],
)
def motor(request, tmp_path):
    """A motor with coarse and fine zones, turn at 6000 and stop at 1500."""
    reload, clock_hz, pause = request.param
    tables = default_tables(COARSE_FINE, reload=reload, turn=6000, stop=1500, pause=pause, clock_hz=clock_hz)
    return Twins(tables, compile_headers(tmp_path, tables))


def test_a_move_with_a_turn(motor):
    motor.start(1, turns=1)
    motor.run()
    assert motor.at_rest == (1500, REST)
    up, down = motor.tables.periods(motor.tables.up), motor.tables.periods(motor.tables.down)
    assert motor.periods == [*up[:6000].tolist(), *down[1500:6000][::-1].tolist()]
    assert {("state", s) for s in (REST, ACCEL, CRUISE, DECEL, TURN)} <= motor.seen
    assert {("outcome", o) for o in (IDLE, STEP, PAUSE)} <= motor.seen


def test_a_stop_moved_while_running(motor):
    motor.start(1)
    motor.run(3500)
    rule = motor.r.rule
    assert not motor.tables.up.move_stop(4800, rule.position, rule.index).overrun
    motor.copy_tables()
    motor.run(500)
    edit = motor.tables.up.move_stop(4010, rule.position, rule.index)
    assert edit.overrun
    motor.copy_tables()
    motor.run()
    assert motor.at_rest == (edit.stop, REST)
    motor.tables.down.move_stop(0)
    motor.copy_tables()
    motor.start(-1)
    motor.run()
    assert motor.at_rest == (0, REST)


def test_a_stop_moved_by_the_firmware_is_moved_as_here(tmp_path):
    """Whole tables, stops anywhere, at rest and while the motor runs towards them or away."""
    tables, random = default_tables(COARSE_FINE), np.random.default_rng(12)
    motor = Twins(tables, compile_headers(tmp_path, tables, stops=True))
    overruns = 0
    for _ in range(40):
        heading, place = int(random.choice((1, -1))), int(random.integers(0, N + 1))
        motor.move_stop(heading, place)
        motor.start(heading)
        motor.run(int(random.integers(1, 1500)))
        place = motor.r.rule.position + heading * int(random.integers(0, 300))  # near, also nearer than it can stop
        motor.move_stop(heading, min(max(place, 0), N))
        overruns += abs(place - motor.r.rule.position) < motor.r.rule.index
        motor.run()
        assert motor.at_rest[1] == REST
    assert overruns > 5


def test_stops_move_in_whole_tables_only(tmp_path):
    with pytest.raises(AssertionError, match=r"leave \[stepper.zoom_a.extremes\] out of the axis file"):
        compile_headers(tmp_path, default_tables(turn=6000), stops=True)


def test_the_operator(motor):
    motor.place(1000)
    for hz, heading, steps in (
        (MAX_HZ, 1, 700), (1500.0, 1, 600), (1501.0, 1, 30), (60.0, 1, 300), (70_000.0, 1, 900), (MAX_HZ, -1, 600),
        (0.0, -1, 40), (800.0, 1, 60), (800.0, -1, 60),
    ):  # fmt: skip
        motor.lever(hz, heading)
        motor.run(steps)
        motor.compare()
    motor.write("manual", 0)
    motor.run()
    assert motor.at_rest[1] == REST
    assert ("state", TURN) in motor.seen
    motor.lever(MAX_HZ, 1)
    motor.run()
    assert motor.at_rest == (6000, REST)  # held into the end
    motor.run()
    assert ("state", FAULT) not in motor.seen


def test_the_operator_interrupts_a_move_and_a_move_the_operator(motor):
    motor.start(1)
    motor.run(100)
    motor.lever(500.0, -1)
    motor.run(150)
    motor.start(1)
    motor.run(3000)
    motor.start(-1, turns=1)  # reversal at speed
    motor.run()
    assert motor.at_rest == (6000, REST)


def test_a_fault_and_what_follows(motor):
    motor.start(1)
    motor.run(1200)
    motor.tables.up.entries[1250:1300] = 3
    motor.copy_tables()
    motor.run()
    position, state = motor.at_rest
    assert (state, motor.c.rule.cause) == (FAULT, INFEASIBLE)
    motor.start(1)
    motor.run()
    assert motor.at_rest == (position, FAULT)
    motor.write("reset", 1)
    motor.run()
    assert motor.at_rest == (position, REST)
    for place in (-1, N + 1):
        motor.place(place)
        motor.start(-1)
        motor.run()
        assert motor.at_rest == (place, FAULT)
        motor.write("reset", 1)
        motor.run()
    assert ("cause", OUT_OF_RANGE) in motor.seen
    motor.place(N)
    motor.write("event", 0)
    motor.start(-1)
    motor.run()
    assert motor.at_rest == (1500, REST)


def test_in_fault_the_motor_comes_down_whatever_it_is_told(motor):
    motor.start(1)
    motor.run(1940)
    motor.tables.up.entries[1950] = 3  # one bad entry, shortly before a fine zone
    motor.copy_tables()
    motor.run(15)
    assert (motor.r.rule.state, motor.r.rule.index > 0) == (FAULT, True)
    motor.write("reset", 1)  # too early
    motor.lever(MAX_HZ, -1)
    motor.run()
    assert motor.at_rest[1] == FAULT
    assert motor.c.rule.direction == 1
    assert motor.c.rule.position > COARSE_FINE[0].begin  # in fault its limit is not looked at
    motor.write("reset", 1)
    motor.run(50)
    assert motor.c.rule.direction == -1


def test_a_start_under_the_operators_hand_is_forgotten(motor):
    motor.start(1)
    motor.lever(0.0, 1)
    motor.run()
    motor.write("manual", 0)
    motor.run()
    assert (motor.at_rest, motor.periods) == ((0, REST), [])
    motor.start(-1)  # nothing to do: the move has ended, which is an event
    motor.run()
    assert (motor.at_rest, motor.c.rule.event) == ((0, REST), 1)


def test_several_motors_in_one_firmware_do_not_know_of_each_other(tmp_path):
    tables = [default_tables(COARSE_FINE, motor="zoom_a"), default_tables(motor="zoom_b", reload=False, pause=0)]
    library = compile_headers(tmp_path, *tables)
    pair = [Twins(each, library) for each in tables]
    for motor in pair:
        motor.start(1, turns=1)
    running = list(pair)
    while running:
        running = [motor for motor in running if motor.call() != IDLE]
    alone = [Twins(each, library) for each in tables]
    for motor in alone:
        motor.start(1, turns=1)
        motor.run()
    assert [motor.periods for motor in pair] == [motor.periods for motor in alone]
    assert pair[0].periods != pair[1].periods


def names_of(tables: EnvelopeTables, folder: Path) -> set[str]:
    """What a header defines for the whole program, without the motor in front."""
    write_envelope_header(tables, folder / "any.h")
    text = (folder / "any.h").read_text(encoding="utf-8")
    declared = r"^#define (\w+)|^\} (\w+);|^(?:static|\w+_ORDER) (?:const |inline )*\w+ \*?(\w+)[\[(]"
    found = re.findall(declared, text, re.MULTILINE)
    motor = re.compile(f"{tables.motor}_", re.IGNORECASE)
    assert all(motor.match("".join(name)) for name in found)
    return {"".join(name)[len(tables.motor) :] for name in found}


def test_no_name_of_a_motor_can_be_one_of_another(tmp_path):
    """Motors a and a_x meet only where what is added to one ends in what is added to the other."""
    added = names_of(default_tables(), tmp_path)
    assert len(added) > 40
    assert {"_ENVELOPE_H", "_registers", "_up", "_next", "_STEP"} <= added
    assert [(one, other) for one in added for other in added if one != other and one.endswith(other)] == []


ALIKE = ("a", "a_", "a_b", "a__b", "a_up", "r", "static", "int32")


def test_motors_of_names_that_are_alike_are_all_there(tmp_path):
    """Names that differ by an underscore, or that are keywords, types and locals of the header."""
    tables = [default_tables(motor=name, turn=400 + 10 * k) for k, name in enumerate(ALIKE)]
    library = compile_headers(tmp_path, *tables)
    for k, each in enumerate(tables):
        motor = Twins(each, library)
        motor.start(1)
        motor.run()
        assert motor.at_rest == (400 + 10 * k, REST)


def test_two_headers_of_one_motor_are_told(tmp_path):
    """The second one vanished behind the guard of the first, and the compiler said nothing."""
    for folder, turn in (("one", 5000), ("other", 6000), ("copy", 5000)):
        (tmp_path / folder).mkdir()
        write_envelope_header(default_tables(turn=turn), tmp_path / folder / "zoom_a.h")
    source = tmp_path / "firmware.c"
    source.write_text('#include "one/zoom_a.h"\n#include "copy/zoom_a.h"\n', encoding="utf-8")
    compile_c(source, tmp_path, *STRICT)
    source.write_text('#include "one/zoom_a.h"\n#include "other/zoom_a.h"\n', encoding="utf-8")
    done = subprocess.run(
        [str(COMPILER), "-std=c99", "-fsyntax-only", source], capture_output=True, text=True, check=False
    )
    assert done.returncode != 0
    assert "Two headers of a motor zoom_a" in done.stderr


@st.composite
def random_tables(draw: st.DrawFn) -> EnvelopeTables:
    """Any ramp, extremes, zones of each direction, words, clock and pause."""
    hz = sorted(draw(st.sets(st.floats(1.0, 65535.0), min_size=1, max_size=30)))
    steps = draw(st.integers(1, 120))
    limit = st.floats(1.0, 65535.0)
    places, top = st.integers(0, steps), draw(limit)

    def zones() -> list[Zone]:
        edges = sorted(draw(st.sets(places, max_size=6)))
        return [Zone(b, e, draw(limit)) for b, e in zip(edges[::2], edges[1::2], strict=False)]

    upwards, downwards = zones(), zones()
    both = ZoneMap(steps, top, downwards, ZoneMap(steps, top, upwards).limits)
    up = StepEnvelope(StepRamp(np.array(hz)), ZoneMap(steps, top, upwards, both.limits), 1, draw(places), draw(places))
    down = StepEnvelope(up.ramp, both, -1, draw(places), draw(places))
    clock = st.integers(int(np.ceil(hz[-1])), 2**31 - 1) | st.sampled_from((10**6, 72 * 10**6, 2**31 - 1))
    return EnvelopeTables(
        motor="any", axis="any", up=up, down=down, clock_hz=draw(clock), reload=draw(st.booleans()),
        travel_per_step=1e-6, pause=draw(st.sampled_from((0, 1, 7, 255))),
    )  # fmt: skip


def act(draw: st.DataObject, motor: Twins) -> None:
    """One thing that a host may do between two calls."""
    tables, rule = motor.tables, motor.r.rule
    heading, places = st.sampled_from((1, -1)), st.integers(0, tables.steps)
    verb = draw.draw(
        st.sampled_from(("start", "deflect", "hz", "edit", "start", "poke", "write", "place")), label="verb"
    )
    if verb == "start":
        motor.start(draw.draw(heading), draw.draw(st.sampled_from((0, 1, 2, 65535))))
    elif verb == "deflect":
        words = st.sampled_from(list(motor.p.rule.ramp[: len(tables.up.ramp)])) | st.integers(0, 2**31 - 1)
        motor.deflect(draw.draw(words), draw.draw(heading))
    elif verb == "hz":
        motor.lever(draw.draw(st.sampled_from([0.0, *tables.up.ramp.hz.tolist()])), draw.draw(heading))
    elif verb == "edit":
        table = tables.up if draw.draw(st.booleans()) else tables.down
        runs_here = rule.direction == table.direction and rule.index >= 0 and 0 <= rule.position <= tables.steps
        table.move_stop(draw.draw(places), *((rule.position, rule.index) if runs_here else ()))
        motor.copy_tables()
    elif verb == "poke":  # a table as no builder makes it
        table, last = (tables.up, tables.steps) if draw.draw(st.booleans()) else (tables.down, 0)
        ahead = rule.position + rule.direction * draw.draw(st.integers(0, 3))  # where it matters soonest
        near = draw.draw(st.booleans()) and 0 <= ahead <= tables.steps and ahead != last
        place = ahead if near else draw.draw(places.filter(lambda one: one != last))
        index = draw.draw(st.integers(0, len(tables.up.ramp) - 1))
        zone = draw.draw(st.integers(0, len(tables.up.zones.limits) - 1))
        table.entries[place] = draw.draw(st.sampled_from((SENTINEL, zone << INDEX_BITS | index)))
        motor.copy_tables()
    elif verb == "write":
        motor.write(*draw.draw(st.sampled_from((("manual", 0), ("reset", 1), ("event", 0), ("turns", 3)))))
    else:
        motor.place(draw.draw(st.integers(-1, tables.steps + 1)))


@settings(max_examples=12)
@given(st.data())
def test_whatever_the_host_does_the_bits_are_the_same(data):
    tables = data.draw(random_tables())
    with tempfile.TemporaryDirectory() as folder:
        library = compile_headers(Path(folder), tables)
    motor = Twins(tables, library, data.draw(st.integers(0, tables.steps), label="at"))
    for _ in range(data.draw(st.integers(1, 25), label="orders")):
        act(data, motor)
        motor.compare()
        for _ in range(data.draw(st.integers(1, 4) | st.integers(1, 40), label="calls")):
            motor.call()


GUIDE = Path(__file__).parents[4] / "docs/how-to/hand-an-envelope-to-firmware.md"


@pytest.mark.parametrize("pause", [0, 1, 2])
def test_the_guides_program_turns_whatever_the_pause(tmp_path, pause):
    write_envelope_header(default_tables(COARSE_FINE, motor="group_a", pause=pause), tmp_path / "group_a.h")
    program = re.findall(r"<!-- file: move.c -->\n```text\n(.*?)```", GUIDE.read_text(encoding="utf-8"), re.DOTALL)[0]
    orders = "group_a_place(&motor, 0); go_to(6000); group_a_move_stop(&motor, -1, 1500); motor.rule.turns = 1;"
    turn = f'{orders} wait("there and back"); return 0;'
    begin, end = program.index("    group_a_place(&motor, 0);"), program.rindex("}")
    (tmp_path / "turn.c").write_text(program[:begin] + turn + program[end:], encoding="utf-8")
    subprocess.run([str(COMPILER), "-std=c99", "-o", "turn", "turn.c"], cwd=tmp_path, check=True)
    told = subprocess.run(["./turn"], cwd=tmp_path, check=True, capture_output=True, text=True).stdout
    assert told.startswith("there and back    at step 1500")
