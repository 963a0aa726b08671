"""Nanoseconds per tick of the print head, against the same arithmetic by hand in C and against its own alternatives."""

import platform

import numba
import pytest
from tests.bench.print_lines import COMPILER, LINES, Race, Stretch, compile_c, compiler_version
from tests.print_head_rig import NO_TRACE

from detent.control.head_computer import IDLE
from detent.systems.print_head import advance, advance_plain

ROUNDS = 150
C_BAR = 1.3
"""The composed steps may take this much longer than C."""

SWITCH_BAR = 3.0
"""The switch-level fidelity may take this much longer than the averaged one."""

needs_c = pytest.mark.skipif(COMPILER is None, reason="no C compiler here to measure against (Debian: apt install gcc)")
FAULTS = [(), ("encoder.jitter=3 deg",), ("encoder.jitter=2 deg", "encoder.missing_edges=0.0005")]


def compiled(p, r, ticks):
    return advance(p, r, ticks, *NO_TRACE)


@pytest.fixture(scope="module")
def in_c(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tick")
    return {flags: compile_c(folder, *flags.split()) for flags in ("-O3", "-O3 -march=native")}


def hold(benchmark, race, name):
    """Run the race round by round and note its figures beside the benchmark's own of `name`; False in a smoke run."""
    stretch, engine = race.runs[name]
    benchmark.pedantic(stretch.run, args=(engine,), setup=race.round, rounds=ROUNDS)
    benchmark.extra_info.update({f"ns per tick, {key}": round(ns, 2) for key, ns in race.nanoseconds().items()})
    benchmark.extra_info.update(numba=numba.__version__, machine=platform.machine())
    return not benchmark.disabled


def to_the_end(stretch, engine):
    """The stretch and the line after it, to rest."""
    stretch.run(engine)
    engine(stretch.p, stretch.r, 100_000)
    return stretch.r.snapshot()


@needs_c
@pytest.mark.parametrize("overrides", FAULTS, ids=["clean", "jitter", "jitter and missing"])
def test_c_ends_on_the_same_bits(in_c, overrides):
    stretch = Stretch(*overrides)
    end = to_the_end(stretch, compiled)
    assert stretch.r.head.state == IDLE
    assert stretch.r.head.turn_arounds == len(LINES)
    assert stretch.r.head.columns.fired > 5000
    for flags, engine in in_c.items():
        assert to_the_end(stretch, engine) == end, (flags, stretch.r.diff(end))


@needs_c
def test_averaged_tick_against_c(benchmark, in_c):
    stretch = Stretch()
    race = Race({"compiled steps": (stretch, compiled), **{f"C {key}": (stretch, run) for key, run in in_c.items()}})
    if hold(benchmark, race, "compiled steps"):
        benchmark.extra_info["C compiler"] = compiler_version()
        assert race.ratio("compiled steps", ["C -O3", "C -O3 -march=native"]) <= C_BAR, race.nanoseconds()


def test_local_copy_pays(benchmark):
    stretch = Stretch()
    race = Race({"advance": (stretch, compiled), "advance_plain": (stretch, advance_plain)})
    if hold(benchmark, race, "advance"):
        assert race.ratio("advance", ["advance_plain"]) < 1.0, race.nanoseconds()


def test_switch_level_tick(benchmark):
    race = Race({"switch level": (Stretch("axis.fidelity=switch-level"), compiled), "averaged": (Stretch(), compiled)})
    if hold(benchmark, race, "switch level"):
        assert race.ratio("switch level", ["averaged"]) <= SWITCH_BAR, race.nanoseconds()
