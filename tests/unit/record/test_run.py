"""What a run is judged by: levels of its verdict, and what the guard of a controller has seen."""

from types import SimpleNamespace
from typing import Any

import pytest

from detent.control.guard import Guard, GuardParams, watch
from detent.record.run import Evidence, RunRecord

JOB = SimpleNamespace(name="moves.csv", kind="moves")


def evidence() -> Evidence:
    """Looks of a millisecond, counts of a micrometre, a window of 10 um."""
    return Evidence(Guard(), look=1e-3, count=1e-6, window=10e-6)


def see(made: Evidence, *moved: int, limited: int = 0) -> None:
    for one in moved:
        watch(GuardParams(), made.guard, 0, 0, limited, 0, one)


@pytest.mark.parametrize(
    ("run", "level", "colour"),
    [
        (RunRecord(JOB, done=True), "good", "green"),
        (RunRecord(JOB, done=True, warnings=["it swung; wait"]), "warn", "amber"),
        (RunRecord(JOB, failure="it stood", warnings=["it swung; wait"]), "bad", "red"),
    ],
)
def test_a_verdict_is_green_only_where_nothing_looks_wrong(run: RunRecord[Any], level: str, colour: str) -> None:
    assert (run.level, run.to_dict()["level"]) == (level, colour)
    assert run.doubt == ("it swung" if run.warnings else "")


def test_a_command_at_its_limit_for_more_than_half_of_a_run_is_told() -> None:
    made = evidence()
    see(made, *[5] * 50)
    made.take()
    see(made, *[5] * 49, limited=1)
    made.take()
    assert made.warnings() == []
    see(made, *[5] * 3, limited=1)
    made.take()
    (text,) = made.warnings()
    assert text.startswith("the command was at its limit for 52 ms of 102 ms; ")


def test_an_axis_that_goes_to_and_fro_does_not_stand() -> None:
    made = evidence()
    see(made, *[6, -6, 5, -5] * 5)  # within half the window on both sides
    made.take("after move 1", rest=True)
    see(made, *[12, -12] * 10)
    made.take("in move 2")  # and a move may go as it likes
    assert made.warnings() == []
    see(made, *[12, -12] * 10)
    made.take("after move 3", rest=True)
    see(made, *[20, -20] * 2)
    made.take("after move 4", rest=True)  # a few turns are the end of a move
    (text,) = made.warnings()
    assert text.startswith("at rest after move 3 the axis oscillated over 12 um, 19 turns in 20 ms; ")


def test_a_standing_axis_needs_no_command_at_its_limit() -> None:
    made = evidence()
    see(made, *[0] * 100)
    see(made, *[0] * 6, limited=1)
    made.take("after move 1", rest=True)
    (text,) = made.warnings()
    assert text.startswith("at rest after move 1 the command was at its limit for 6 ms of 106 ms; ")


@pytest.mark.parametrize(("error", "told"), [(8.9e-6, False), (-9.5e-6, True), (12e-6, False)])
def test_an_error_at_the_edge_of_its_window_is_told(error: float, told: bool) -> None:
    made = evidence()
    made.take_error("move 1", 1e-6)
    made.take_error("move 2", error)
    assert [text.partition(" of its")[0] for text in made.warnings()] == ["move 2 ended at 95 %"] * told


def test_an_axis_without_a_guard_is_judged_by_its_errors() -> None:
    made = Evidence(None, 0.0, 1e-6, 10e-6)
    made.take("after move 1", rest=True)
    made.take_error("move 1", 9.9e-6)
    assert len(made.warnings()) == 1
