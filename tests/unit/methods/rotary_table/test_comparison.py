import doctest
import json
from dataclasses import replace

import numpy as np
import pytest
from tests.unit.methods.rotary_table.samples import angle_comparison, crossing, deg

from detent.methods.rotary_table import comparison
from detent.methods.rotary_table.comparison import AngleComparison, Feed
from detent.page.figure import Figure
from detent.page.table import Cell


def test_the_examples_in_the_docstrings_hold() -> None:
    assert doctest.testmod(comparison).failed == 0


@pytest.fixture
def never() -> AngleComparison:
    """Neither came as far as the end of the turn."""
    nowhere = {"time": np.nan, "deviation_before": np.nan, "deviation_after": np.nan}
    return angle_comparison(crossings=(crossing("conventional", 2, **nowhere), crossing("endless", 2, **nowhere)))


def cells_of(figure: Figure) -> list[list[Cell]]:
    assert figure.table is not None
    return [[cell for cell, _ in figure.table.cells(row)] for row in figure.table.rows]


def texts_of(figure: Figure) -> list[list[str]]:
    return [[cell.text for cell in row] for row in cells_of(figure)]


# -- on the page ------------------------------------------------------------------------------------------------------
def test_both_crossings_share_the_charts() -> None:
    figure, *_ = angle_comparison().figures()
    way, lag, signal = figure.charts
    assert [chart["id"] for chart in (way, lag, signal)] == ["cross-way", "cross-deviation", "cross-speed"]
    assert json.loads(json.dumps(figure.charts, allow_nan=False)) == figure.charts
    curves = {series["label"]: series["y"] for series in lag["series"]}
    before, after = lag["x"].index(4.99), lag["x"].index(5.0)
    assert (curves["conventional"][before], curves["conventional"][after]) == (2.0, 362.0)
    assert set(curves["endless"]) == {2.0}
    assert way["series"][0]["y"][way["x"].index(5.0)] == pytest.approx(300.0)
    assert set(signal["series"][1]["y"]) == {60.0}
    assert way["events"] == [5.0]


def test_a_crossing_at_the_same_moment_is_one_event_and_tells_of_both() -> None:
    (event,) = angle_comparison().figures()[0].events
    assert event.t == 5.0
    assert "from 2 to 362\u202fdeg; " in event.text
    assert "stays 2\u202fdeg" in event.text
    apart = angle_comparison(crossings=(crossing("conventional", 362, time=6.0), crossing("endless", 2)))
    assert [one.t for one in apart.figures()[0].events] == [5.0, 6.0]


def test_what_never_came_to_the_end_of_the_turn_has_no_event(never: AngleComparison) -> None:
    figure, *_ = never.figures()
    assert figure.events == []
    assert figure.charts[0]["events"] == []


def test_the_runaway_is_told_with_where_it_came_to() -> None:
    caption = angle_comparison().figures()[0].caption
    for told in ("9.99\u202fs", "1200 deg", "127 deg/s"):
        assert told in caption


def test_every_speed_of_the_feed_is_a_row_and_what_is_coarse_stands_out() -> None:
    figure = angle_comparison().figures()[1]
    assert texts_of(figure) == [["1", "+0.0010", "−7"], ["60", "0", "−5"]]  # a billionth is nothing
    assert [[cell.over for cell in row] for row in cells_of(figure)] == [[False, False, True]] * 2
    assert cells_of(figure)[0][2].bar == pytest.approx(1.0)
    failed = angle_comparison(feeds=(Feed(speed=deg(1), closed=np.nan, opened=np.nan),))
    assert texts_of(failed.figures()[1]) == [["1", "–", "–"]]


def test_every_start_is_a_row_and_what_is_thrown_back_stands_out() -> None:
    figure = angle_comparison().figures()[2]
    assert figure.table is not None
    assert [title for title, _ in figure.table.heads[2:]] == ["flag, way [deg]", "turn counter, way [deg]"]
    assert texts_of(figure) == [["1.000", "0.50", "thrown back: −30", "830"], ["100.000", "50.00", "830", "830"]]
    assert [[cell.over for cell in row] for row in cells_of(figure)] == [[False, False, True, False], [False] * 4]
    assert "2 deg" in figure.caption.replace("\u202f", " ")


# -- in the terminal --------------------------------------------------------------------------------------------------
def test_the_table_holds_the_method_beside_what_it_betters() -> None:
    title, heads, rows = angle_comparison().table
    assert title == "Endless angle at 60 deg/s, beside its alternatives"
    assert heads == ("", "turn counter, position control", "raw angle; no position control; other forms")
    assert rows == [
        ("deviation across the end of the turn", "2 to 2 deg", "2 to 362 deg"),
        ("way after 9.99 s", "600 deg, at 60 deg/s", "1200 deg, at 127 deg/s"),
        ("mean speed of manual feed at 1 deg/s", "+0.0010 %", "−7 %"),
        ("mean speed of manual feed at 60 deg/s", "0 %", "−5 %"),
        ("jog from 1.000 deg", "830 deg", "flag −30 deg (thrown back)"),
        ("jog from 100.000 deg", "830 deg", "flag 830 deg"),
    ]


def test_what_is_not_known_is_a_dash(never: AngleComparison) -> None:
    _, _, rows = replace(never, feeds=(Feed(speed=deg(1), closed=np.nan, opened=-0.07),)).table
    assert rows[0][1:] == ("– to – deg", "– to – deg")
    assert rows[2][1:] == ("– %", "−7 %")
