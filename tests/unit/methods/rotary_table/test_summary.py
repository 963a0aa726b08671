import doctest
import math

import pytest
from tests.unit.methods.rotary_table.samples import COUNT, axis, deg, record, run_of

from detent.methods.rotary_table import summary as table_summary
from detent.methods.rotary_table.schema import RotaryTableSpec
from detent.methods.rotary_table.summary import SequenceFigures, sequence_summary_rows
from detent.page.run_page import Worst


@pytest.fixture
def spec() -> RotaryTableSpec:
    return axis()


def test_the_examples_in_the_docstrings_hold() -> None:
    assert doctest.testmod(table_summary).failed == 0


def test_a_sequence_shows_every_figure_with_its_unit_and_whose_it_is(spec: RotaryTableSpec) -> None:
    run = run_of(
        record(1),
        record(2, "output", 90, 90, peak_speed=0.0),
        record(3, "jog", 90, 810, error=9 * COUNT, peak_deviation=deg(2.17), crossings=2, rollovers=1),
        record(4, "go", 90, 0, error=-1.5 * spec.count, peak_speed=deg(61.23), crossings=1),
    )
    assert dict(sequence_summary_rows(spec, run)) == {
        "steps": "4 of 4: 2 positionings, 1 jog",
        "time": "8 s",
        "error at rest": "worst 1.5 counts, 5.3 arcsec (step 4)",
        "travel": "2.50 turns; end of the turn crossed 3 times, 1 rollover",
        "deviation": "up to 2.17 deg (step 3)",
        "peak speed": "61.2 deg/s (step 4)",
    }


def test_a_sequence_within_the_turn_says_nothing_of_its_end(spec: RotaryTableSpec) -> None:
    assert dict(sequence_summary_rows(spec, run_of(record(1))))["travel"] == "0.25 turns"


def test_refused_starts_are_told(spec: RotaryTableSpec) -> None:
    assert dict(sequence_summary_rows(spec, run_of(record(1), refused=1)))["refused"] == "1 start"
    assert "refused" not in dict(sequence_summary_rows(spec, run_of(record(1))))


def test_a_sequence_that_moves_nothing_shows_no_figures_of_motion(spec: RotaryTableSpec) -> None:
    # A table that is held dithers, but that is not what was asked.
    waited = run_of(record(1, "wait", 0, 0, peak_speed=deg(0.1)))
    assert dict(sequence_summary_rows(spec, waited)) == {"steps": "1 of 1", "time": "2 s"}


def test_of_a_run_that_never_began_only_what_happened_is_shown(spec: RotaryTableSpec) -> None:
    assert sequence_summary_rows(spec, run_of(asked=3)) == [("steps", "0 of 3")]


def test_the_step_that_failed_is_not_made_and_has_no_error_at_rest() -> None:
    failed = run_of(record(1), record(2, error=deg(170), peak_deviation=deg(360)), asked=4, failure="step 2")
    figures = SequenceFigures(failed)
    assert ([step.number for step in figures.made], figures.kinds) == ([1], "2 positionings")
    assert figures.error == Worst(0.5 * COUNT, failed.steps[0])
    assert figures.deviation == Worst(deg(360), failed.steps[1])


def test_only_positionings_count_for_the_error_at_rest() -> None:
    assert SequenceFigures(run_of(record(1, "jog"))).error is None
    assert SequenceFigures(run_of(record(1, error=math.nan))).error is None
    mixed = run_of(record(1, error=-3 * COUNT), record(2, "jog", error=9 * COUNT))
    assert SequenceFigures(mixed).error == Worst(3 * COUNT, mixed.steps[0])
