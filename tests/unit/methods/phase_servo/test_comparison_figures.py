"""What the comparisons of the phase servo show: their figures, and their tables for the terminal."""

from dataclasses import replace

import pytest
from tests.unit.methods.phase_servo.samples import hold_comparison, noise_comparison

from detent.page.frame import comparison_page


def curves_of(chart: dict) -> dict:
    return {series["label"]: series["y"] for series in chart["series"]}


def test_rest_points_lie_over_signed_pulses_and_are_magnified() -> None:
    (figure,) = noise_comparison().figures()
    chart, near = figure.charts
    # A ring at either end needs room beside it.
    assert chart["x"] == near["x"] == [-31.5, -30, -8, 0, 8, 30, 31.5]
    drawn = curves_of(chart)
    assert drawn["only incremental, moving right"][1:-1] == [30, 8, 0, -8, -30]
    assert drawn["only incremental, moving left"][1:-1] == [30, 8, 0, -8, -30]
    assert drawn["this servo, moving right"] == [None, -64, 0, 0, 0, -64, None]
    assert drawn["this servo, moving left"] == [None, 64, 0, 0, 0, 64, None]
    assert [mark["x"] for mark in chart["marks"]] == [-24, 24]
    assert list(curves_of(near)) == ["this servo, moving right", "this servo, moving left"]
    assert [level["y"] for level in near["levels"]] == [-0.6, 0.6]
    assert "6 pitches" in figure.caption
    assert "24 pulses" in figure.caption
    assert "1 pitch." in replace(noise_comparison(), pitches=1).figures()[0].caption


def test_the_terminal_has_rest_points_right_and_left() -> None:
    title, heads, rows = noise_comparison().table
    assert "24" in title
    assert len(heads) == 5
    assert rows[0] == ("0", "+0.00 / +0.00", "+0.00 / +0.00", "-0.00 / -0.00", "+0.00 / +0.00")
    assert rows[2] == ("30", "-64 / +64", "-64 / +64", "-30 / -30", "+30 / +30")


def test_the_carriage_at_rest_is_drawn_on_one_scale_and_without_its_arrival() -> None:
    still, _ = hold_comparison().figures()
    assert [chart["id"] for chart in still.charts] == ["still-0", "still-1", "still-2"]
    assert still.charts[0]["title"] == "for ever: what is <special> in for ever"
    assert [chart["yRange"] for chart in still.charts] == [[-0.44, 0.44]] * 3
    # From halfway between the arrival and the stop.
    assert [chart["x"][0] for chart in still.charts] == [pytest.approx(31.0, abs=0.2)] * 3
    assert {abs(value) for value in still.charts[1]["series"][0]["y"][-100:]} == {0.1}
    assert "for ever 0.80, as is 0, D = 0 0.80." in still.caption


def test_under_load_both_cases_share_the_charts() -> None:
    _, loaded = hold_comparison().figures()
    place, integral = loaded.charts
    assert place["x"][0] == pytest.approx(25.5, abs=0.2)  # halfway from the arrival to the push
    assert curves_of(place)["with it"][-1] == 0.7
    assert curves_of(place)["without it"][-1] == 2.0
    assert curves_of(integral)["with it"][-1] == -6
    assert place["events"] == [30.0, 41.0]
    assert [event.t for event in loaded.events] == [0.03, 0.041]
    assert "with it 0.70, without it 2." in loaded.caption


def test_the_terminal_has_how_every_case_stands() -> None:
    rows = hold_comparison().table.rows
    assert [row[0] for row in rows] == ["for ever", "as is", "D = 0", "with it", "without it"]
    assert rows[0][1] == "0.80"
    assert rows[3][1:] == ("0.00", "+0.70", "-6")


def test_both_stand_on_one_page() -> None:
    assert len(comparison_page("a", [noise_comparison(), hold_comparison()]).charts) == 7
