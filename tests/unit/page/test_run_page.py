import math
from dataclasses import dataclass

import numpy as np
import pytest

from detent.page.run_page import (
    FEWEST_ROWS,
    happened,
    made_card,
    median_of,
    page_title,
    recorded_whole,
    run_headline,
    stretch,
    whole_or_first,
    worst,
)
from detent.record.trace import Trace


@dataclass(frozen=True)
class Job:
    name: str = "moves.csv"


@dataclass(frozen=True)
class SampleRun:
    done: bool = True
    failure: str = ""
    job: Job = Job()
    warnings: tuple[str, ...] = ()
    level: str = "good"
    doubt: str = ""


@dataclass(frozen=True)
class Record:
    begin: float
    end: float


@pytest.fixture
def trace() -> Trace:
    """A hundred rows of 10 ms from 1 s on."""
    t = 1.0 + np.arange(100) / 100
    return Trace(columns={"t": t, "x": np.arange(100.0)})


def test_the_headline_says_what_became_of_the_run() -> None:
    good = run_headline("a", SampleRun(), "All of it.")
    assert (good.level, good.verdict, good.name, good.lead) == ("good", "Done", "moves.csv", "All of it.")
    warned = SampleRun(warnings=("it stood; wait",), level="warn", doubt="it stood")
    doubted = run_headline("a", warned, "All of it.")
    assert (doubted.level, doubted.verdict, doubted.lead) == ("warn", "Done, with 1 warning", "It stood. All of it.")
    assert run_headline("a", warned, "All.", doubt="Done, but").verdict == "Done, but"
    failed = run_headline(
        "a", SampleRun(done=False, failure="it stood.", level="bad"), "Half of it.", words=("Printed", "Not printed")
    )
    assert (failed.level, failed.verdict, failed.lead) == ("bad", "Not printed", "Half of it. It stood.")
    assert page_title("a", SampleRun(done=False)) == "moves.csv on a: not done"
    assert page_title("a", SampleRun(), done="printed") == "moves.csv on a: printed"


def test_a_card_of_what_was_made_is_bad_if_it_is_not_all() -> None:
    assert not made_card("Moves", 3, 3, "").bad
    assert made_card("Moves", 2, 3, "").bad


def test_the_worst_is_the_record_with_the_largest_figure() -> None:
    records = [Record(0.0, 1.0), Record(1.0, 4.0), Record(4.0, 7.0)]
    found = worst(records, lambda one: one.end - one.begin)
    assert found is not None
    assert (found.value, found.of) == (3.0, records[1])
    assert worst([], lambda one: one.end) is None
    assert median_of(records, lambda one: one.end - one.begin) == 3.0
    assert math.isnan(median_of([], lambda one: one.end))


def test_a_stretch_has_a_clock_of_its_own(trace: Trace) -> None:
    part = stretch(trace, ["x"], 1.2, 1.5)
    assert part is not None
    np.testing.assert_allclose(part.t, np.arange(31) / 100, atol=1e-12)
    np.testing.assert_array_equal(part["x"], np.arange(20.0, 51.0))
    assert part.first(part["x"] >= 30) == pytest.approx(0.1)
    assert math.isnan(part.first(part["x"] > 99))
    inner = part.between(0.095, 0.205)
    np.testing.assert_array_equal(inner["x"], np.arange(30.0, 42.0))
    np.testing.assert_allclose(inner.t, part.t[10:22])
    assert part.between(0.25, 9.0)["x"][-1] == 50


def test_without_signals_or_rows_there_is_no_stretch(trace: Trace) -> None:
    assert stretch(None, ["x"], 1.0) is None
    assert stretch(trace, ["x", "y"], 1.0) is None
    assert stretch(trace, ["x"], 1.0, 1.0 + (FEWEST_ROWS - 2) / 100) is None
    assert stretch(trace, ["x"], 1.0, 1.0 + (FEWEST_ROWS - 1) / 100) is not None


def test_records_are_recorded_whole_or_left_out(trace: Trace) -> None:
    whole, last, beyond, short = Record(1.0, 1.5), Record(1.5, 2.0), Record(1.5, 2.5), Record(1.0, 1.01)
    assert recorded_whole(trace, [whole, last, beyond, short]) == [whole, last]
    nothing = Trace(columns={"t": np.empty(0), "x": np.empty(0)})
    assert recorded_whole(nothing, [whole]) == []


def test_events_that_never_happened_are_left_out_and_the_others_sorted() -> None:
    found = happened({"late": 0.8, "never": math.nan, "first": 0.0, "after": 1.1}, 1.0)
    assert [(event.text, event.t) for event in found] == [("first", 0.0), ("late", 0.8)]


def test_a_figure_of_a_part_says_so() -> None:
    assert whole_or_first(30.0, 30.1, "The whole job") == "The whole job"
    assert "30" in whole_or_first(30.0, 120.0, "The whole job")
