"""Nanoseconds per tick of the print head, against the same arithmetic by hand in C and against its own alternatives."""

from functools import partial

import pytest
from tests.bench.print_lines import LINES, Stretch, tick_in_c
from tests.bench.race import COMPILER, OPTIMISED, Race, first_line, needs_c, timed
from tests.difference import diff
from tests.print_head_rig import NO_TRACE

from detent.control.head_computer import IDLE
from detent.kernel.loop import advance

C_BAR = 1.3
"""The composed steps may take this much longer than C."""

SWITCH_BAR = 3.0
"""The switch-level fidelity may take this much longer than the averaged one."""

FAULTS = [(), ("encoder.jitter=3 deg",), ("encoder.jitter=2 deg", "encoder.missing_edges=0.0005")]


def compiled(p, r, ticks):
    return advance(p, r, ticks, *NO_TRACE)


def printing(stretch, engine):
    return timed(partial(stretch.run, engine))


@pytest.fixture(scope="module")
def in_c(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tick")
    return {f"C {flags}": tick_in_c(folder, *flags.split()) for flags in OPTIMISED}


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
    assert stretch.r.controller.head.state == IDLE
    assert stretch.r.controller.head.turn_arounds == len(LINES)
    assert stretch.r.controller.head.columns.fired > 5000
    for name, engine in in_c.items():
        assert to_the_end(stretch, engine) == end, (name, diff(stretch.r, end))


@needs_c
def test_averaged_tick_against_c(benchmark, in_c):
    stretch = Stretch()
    race = Race({name: printing(stretch, run) for name, run in {"compiled steps": compiled, **in_c}.items()})
    if race.hold(benchmark, "compiled steps"):
        benchmark.extra_info["C compiler"] = first_line(str(COMPILER), "--version")
        assert race.ratio("compiled steps", list(in_c)) <= C_BAR, race.nanoseconds()


def test_switch_level_tick(benchmark):
    switched = Stretch("axis.fidelity=switch-level")
    race = Race({"switch level": printing(switched, compiled), "averaged": printing(Stretch(), compiled)})
    if race.hold(benchmark, "switch level"):
        assert race.ratio("switch level", ["averaged"]) <= SWITCH_BAR, race.nanoseconds()
