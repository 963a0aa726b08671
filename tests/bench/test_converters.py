"""The phase servo's converters alone, against the same logic by hand in C and against the circuit in Verilog.

The stimulus is a phase that advances evenly: comparator, carrier counter, both converters and the count of the pulses
are in the loop, on every side.
"""

import ctypes
import os
import shlex
import shutil
import subprocess
from pathlib import Path
from typing import NamedTuple

import pytest
from tests.bench.race import COMPILER, OPTIMISED, Race, compile_c, first_line, needs_c, timed
from tests.c_struct import c_struct
from tests.phase_servo_rig import make_spec

from detent.methods.phase_servo.build import build_phase_servo
from detent.sensing.phase_converters import ConverterParams, Converters, reset_carrier, run_converters

C_BAR = 2.0
"""The composed steps may take this much longer than C."""

VERILATOR_BAR = 4.0
"""The circuit compiled by Verilator takes at least this much longer than the composed steps."""

HERE = Path(__file__).parent
TURN = 1 << 32
TICKS = 1_000_000
ROUNDS = 60

TOOLS = [shutil.which(name) for name in ("verilator", "g++", "make")]
needs_verilator = pytest.mark.skipif(
    None in TOOLS, reason="no Verilator with g++ and make here (Debian: apt install verilator g++ make)"
)
CIRCUITS = {"converters": 1, "from_oscillator": 2}
"""Top module, and periods of its clock per tick."""


class Motion(NamedTuple):
    """Where the secondary's phase begins [steps], and how many steps it advances per carrier cycle."""

    offset: float
    speed: float

    @property
    def stimulus(self):
        """Phase at the start and its change per tick [2^-32 turn]."""
        return round(self.offset * TURN / 64), round(self.speed * TURN / 64 / 64)


FORWARD = Motion(0.3, 0.9)
MOTIONS = {
    "aligned": Motion(0, 0),
    "31 steps ahead": Motion(31, 0),
    "16 steps behind": Motion(-16, 0),
    "antiphase": Motion(32, 0),
    "forward": FORWARD,
    "backward": Motion(-0.4, -0.9),
    "slow": Motion(7.5, 0.013),
    "too fast forward": Motion(0, 1.05),
    "too fast backward": Motion(0, -1.02),
}
LENGTHS = (1, 2, 32, 33, 64, 977, 20_011)


def params(*overrides):
    p = build_phase_servo(make_spec(overrides))
    return p.controller.converters


def cleared():
    r = Converters()
    reset_carrier(r.carrier)
    return r


def compiled(p, stimulus, ticks):
    """Net pulses and end state from power-on."""
    r = cleared()
    return run_converters(p, r, *stimulus, ticks), r.snapshot()


def declare(folder):
    (folder / "converters_registers.h").write_text(c_struct(ConverterParams, Converters))


@pytest.fixture(scope="module")
def in_c(tmp_path_factory):
    folder = tmp_path_factory.mktemp("c")
    declare(folder)

    def engine(flags):
        function = compile_c(HERE / "converters.c", folder, *flags.split()).run_converters
        function.argtypes, function.restype = [ctypes.c_void_p] * 2 + [ctypes.c_int64] * 3, ctypes.c_int64

        def run(p, stimulus, ticks):
            r = cleared()
            return function(ctypes.addressof(p), ctypes.addressof(r), *stimulus, ticks), r.snapshot()

        return run

    return {f"C {flags}": engine(flags) for flags in OPTIMISED}


class Circuit:
    """A process that simulates the circuit on request."""

    def __init__(self, program):
        self.process = subprocess.Popen([program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def run(self, stimulus, ticks):
        """Nanoseconds of processor time, net pulses and end state from power-on."""
        self.process.stdin.write(f"{stimulus[0]} {stimulus[1]} {ticks}\n")
        self.process.stdin.flush()
        taken, net, state = self.process.stdout.readline().split()
        return int(taken), int(net), bytes.fromhex(state)

    def close(self):
        self.process.stdin.close()
        assert self.process.wait(10) == 0
        self.process.stdout.close()


def compile_circuit(folder, top, clocks):
    """What Verilator and the compiler offer for speed; no trace, no assertion, no thread."""
    bits = params().tracking.top + 1
    driver = f"-DBITS={bits} -DCLOCKS={clocks} -I{shlex.quote(str(folder))}"
    words = [
        "verilator", "--cc", "--exe", "--build", "-j", str(os.cpu_count()), "-O3", "--x-assign", "fast",
        "--x-initial", "fast", "--no-assert", "--top-module", top, f"-GBITS={bits}", "--prefix", "Vcircuit",
        "--Mdir", folder / top, "-o", "circuit", "-CFLAGS", driver,
        "-MAKEFLAGS", "OPT_FAST='-O3 -march=native'",
        HERE / "converters.v", HERE / "converters_main.cpp",
    ]  # fmt: skip
    done = subprocess.run(words, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder / top / "circuit"


@pytest.fixture(scope="module")
def circuits(tmp_path_factory):
    folder = tmp_path_factory.mktemp("verilator")
    declare(folder)
    running = {top: Circuit(compile_circuit(folder, top, clocks)) for top, clocks in CIRCUITS.items()}
    yield running
    for circuit in running.values():
        circuit.close()


@needs_c
@pytest.mark.parametrize("overrides", [(), ("method.leave_antiphase=true",)], ids=["as shipped", "leave antiphase"])
@pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS)
def test_c_ends_on_the_same_bits(in_c, motion, overrides):
    p = params(*overrides)
    for ticks in LENGTHS:
        expected = compiled(p, motion.stimulus, ticks)
        assert {name: run(p, motion.stimulus, ticks) for name, run in in_c.items()} == dict.fromkeys(in_c, expected)


@needs_verilator
@pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS)
def test_circuit_ends_on_the_same_bits(circuits, motion):
    p = params()
    for ticks in LENGTHS:
        expected = compiled(p, motion.stimulus, ticks)
        for top, circuit in circuits.items():
            _, *end = circuit.run(motion.stimulus, ticks)
            assert tuple(end) == expected, (top, ticks)


def test_the_stimulus_moves_the_converters():
    p = params()
    nets = {name: compiled(p, motion.stimulus, 64 * 1000)[0] for name, motion in MOTIONS.items()}
    assert nets["31 steps ahead"] == 31
    assert nets["antiphase"] == 0
    assert nets["forward"] == pytest.approx(900, abs=1)
    assert nets["backward"] == pytest.approx(-900, abs=1)
    assert nets["too fast forward"] < 1040  # lock is lost


def in_process(engine):
    """A million ticks forward."""
    p = params()

    def run():
        engine(p, FORWARD.stimulus, TICKS)
        return TICKS

    return timed(run)


@needs_c
def test_converters_against_c(benchmark, in_c):
    race = Race({name: in_process(engine) for name, engine in {"compiled steps": compiled, **in_c}.items()})
    if race.hold(benchmark, "compiled steps", ROUNDS):
        benchmark.extra_info["C compiler"] = first_line(str(COMPILER), "--version")
        assert race.ratio("compiled steps", list(in_c)) <= C_BAR, race.nanoseconds()


@needs_verilator
def test_converters_against_verilator(benchmark, circuits):
    simulated = {
        f"Verilator, {top}": lambda circuit=circuit: circuit.run(FORWARD.stimulus, TICKS)[0] / TICKS
        for top, circuit in circuits.items()
    }
    race = Race({"compiled steps": in_process(compiled), **simulated})
    if race.hold(benchmark, "compiled steps", ROUNDS):
        benchmark.extra_info.update(verilator=first_line("verilator", "--version"))
        assert 1 / race.ratio("compiled steps", list(simulated)) >= VERILATOR_BAR, race.nanoseconds()
