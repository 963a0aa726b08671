"""The endless angle beside a conventional one: rotary-table tests 11, 12 and 19 on an axis of its own."""

import doctest
import json
import math
from dataclasses import replace
from math import degrees

import numpy as np
import pytest
from tests.unit.methods.rotary_table.samples import angle_comparison, crossing, deg

import detent
from detent.errors import DetentError
from detent.methods.load import load_spec
from detent.methods.rotary_table import comparison
from detent.methods.rotary_table.comparison import FORMS, AngleComparison, Feed, compare_angle, crossing_speed
from detent.page.figure import Figure
from detent.page.table import Cell

FORM_NAMES = ("flag", "guarded flag", "turn counter")


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
    assert [title for title, _ in figure.table.heads[2:]] == ["flag, distance [deg]", "turn counter, distance [deg]"]
    assert texts_of(figure) == [["1.000", "0.50", "thrown back: −30", "830"], ["100.000", "50.00", "830", "830"]]
    assert [[cell.over for cell in row] for row in cells_of(figure)] == [[False, False, True, False], [False] * 4]
    assert "2 deg" in figure.caption.replace("\u202f", " ")


# -- in the terminal --------------------------------------------------------------------------------------------------
def test_the_table_holds_the_method_beside_what_it_betters() -> None:
    title, heads, rows = angle_comparison().table
    assert title == "Endless angle at 60 deg/s, compared with the alternatives"
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


# -- runs --------------------------------------------------------------------------------------------------------------


def table(*overrides: str):
    return load_spec(detent.example("rotary_table.toml"), overrides)


@pytest.fixture(scope="module")
def ideal():
    """The model: no droop, no limit of torque, 16 bits up to 180 deg/s."""
    model = ("drive.droop=0 %", "drive.word_bits=16", "motor.max_speed=2700 rpm", "limits.effort=1000 N*m")
    return compare_angle(table(*model))


@pytest.fixture(scope="module")
def usual():
    return compare_angle(table())


@pytest.mark.compiled
def test_the_conventional_unit_runs_away_at_the_end_of_the_turn(ideal):
    """Test 11."""
    crossing = ideal.crossings[0]
    assert crossing.name == "conventional"
    assert crossing.time == pytest.approx(4.464 + 0.02, abs=0.02)  # up to a pass later
    assert degrees(crossing.deviation_before) == pytest.approx(2.0, abs=0.01)
    assert degrees(crossing.deviation_after) == pytest.approx(362.0, abs=0.01)
    after = crossing.t > crossing.time
    assert np.degrees(crossing.s4[after]) == pytest.approx(180, abs=0.01)
    assert degrees(crossing.speed) == pytest.approx(180, abs=0.01)
    # 260 deg to the boundary, then 180 deg/s, reached with a lag of 20 ms.
    assert degrees(crossing.travel) == pytest.approx(260 + 180 * (crossing.t[-1] - crossing.time) - 2.4, abs=1)
    assert crossing.t[-1] == pytest.approx(12.2, abs=0.01)


@pytest.mark.compiled
def test_the_endless_one_passes_it_with_the_same_deviation(ideal):
    crossing = ideal.crossings[1]
    assert crossing.name == "endless"
    assert crossing.time == pytest.approx(ideal.crossings[0].time, abs=1e-9)
    assert degrees(crossing.deviation_before) == pytest.approx(2.0, abs=0.002)
    assert degrees(crossing.deviation_after) == pytest.approx(2.0, abs=0.002)
    assert degrees(crossing.speed) == pytest.approx(60, abs=0.02)
    steady = crossing.t > 0.5
    assert np.degrees(crossing.deviation[steady]) == pytest.approx(2.0, abs=0.002)
    assert np.degrees(crossing.s4[steady]) == pytest.approx(60.0, abs=0.05)


@pytest.mark.compiled
def test_the_curves_begin_with_the_start_and_run_to_the_end(ideal):
    for case in ideal.crossings:
        assert len({len(curve) for curve in (case.t, case.angle, case.deviation, case.s4)}) == 1
        assert 0 < case.t[0] <= 2e-3
        assert np.diff(case.t) == pytest.approx(2e-3)
        assert case.angle[0] == pytest.approx(0.0, abs=1e-9)
        assert case.angle[-1] == case.travel
    steady = ideal.crossings[1].t > 0.5
    slope = np.polyfit(ideal.crossings[1].t[steady], ideal.crossings[1].angle[steady], 1)[0]
    assert degrees(slope) == pytest.approx(60, abs=1e-3)


@pytest.mark.compiled
def test_manual_feed_keeps_its_speed_only_with_position_control(usual):
    """Test 19: a drive with 5 % droop and 12 bits."""
    assert [degrees(feed.speed) for feed in usual.feeds] == pytest.approx([0.1, 1, 60])
    assert max(abs(feed.closed) for feed in usual.feeds) < 1e-4
    assert [100 * feed.opened for feed in usual.feeds] == pytest.approx([24, -7, -5], abs=0.5)


@pytest.mark.compiled
def test_the_literal_form_is_thrown_back_from_starts_just_after_the_boundary(ideal):
    """Test 12."""
    assert degrees(ideal.following_error) == pytest.approx(2.0)
    by_form = {form: [start for start in ideal.starts if start.form == form] for form in FORMS}
    assert tuple(by_form) == FORM_NAMES
    for starts in by_form.values():
        assert [degrees(start.angle) for start in starts] == pytest.approx([0, 360 / 368640, 0.5, 1, 2, 3, 100])
        assert {round(degrees(start.asked), 6) for start in starts} == {834}
    assert [start.thrown_back for start in by_form["flag"]] == 4 * [True] + 3 * [False]
    for start in by_form["flag"][:4]:
        assert degrees(start.travel) == pytest.approx(112, abs=1.5)  # the button is seen in the first pass, 20 ms late
    for form in ("guarded flag", "turn counter"):
        assert not any(start.thrown_back for start in by_form[form])
        assert [degrees(start.travel) for start in by_form[form]] == pytest.approx(7 * [832], abs=1.5)


@pytest.mark.compiled
def test_the_droop_adds_to_what_the_table_lags_by(usual):
    assert degrees(usual.following_error) == pytest.approx(2 / 0.95)
    assert degrees(usual.crossings[1].deviation_after) == pytest.approx(2 / 0.95, abs=0.002)
    assert [start.thrown_back for start in usual.starts if start.form == "flag"] == 4 * [True] + 3 * [False]


@pytest.mark.compiled
def test_the_axis_is_compared_by_what_it_is_not_by_its_method(usual):
    changed = (
        "method.judge=actual", "method.inclusive=true", "method.guarded=true", "method.position_control=false",
        "mechanics.start_angle=200 deg", "disturbance.load.torque=100 N*m", "disturbance.load.at=0 s",
        "disturbance.load.duration=50 s",
    )  # fmt: skip
    assert compare_angle(table(*changed)).to_dict() == usual.to_dict()


@pytest.mark.compiled
def test_speeds_are_those_the_axis_can_run_at():
    slow = table("limits.speed=10 deg/s", "position.1.speed=10 deg/s")
    found = compare_angle(slow)
    assert degrees(found.speed) == pytest.approx(10)
    assert [degrees(feed.speed) for feed in found.feeds] == pytest.approx([0.1, 1, 10])
    assert degrees(found.crossings[0].deviation_after - found.crossings[0].deviation_before) == pytest.approx(
        360, abs=0.01
    )
    assert np.diff(found.crossings[0].t) == pytest.approx(2e-3)


@pytest.mark.compiled
def test_a_table_that_stops_slowly_crosses_slowly():
    spec = table("limits.acceleration=10 deg/s^2")
    assert degrees(crossing_speed(spec)) == pytest.approx(math.sqrt(2 * 10 * 90))
    assert crossing_speed(table()) == table().limits.speed


@pytest.mark.compiled
def test_a_table_that_hardly_moves_is_not_compared():
    spec = table("limits.speed=0.05 deg/s", "position.1.speed=0.05 deg/s")
    with pytest.raises(DetentError, match=r"got a table that turns at 0\.05 deg/s; expected: 0\.1 deg/s or more"):
        compare_angle(spec)


@pytest.mark.compiled
def test_it_is_plain_data_and_progress_is_told():
    told = []
    spec = table("method.fraction_bits=0")  # at 0.1 deg/s the dial is at 0 (test 20)
    found = compare_angle(spec, progress=lambda share, what: told.append((share, what)))
    data = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert set(data) == {"speed", "following_error", "crossings", "feeds", "starts"}
    assert data["feeds"][0]["closed"] == pytest.approx(-1, abs=1e-9)
    assert "angle" not in data["crossings"][0]
    shares = [share for share, _ in told]
    assert shares == sorted(shares)
    assert len(told) == 2 + len(data["feeds"]) + len(data["starts"])
    assert told[-1] == (1.0, "start with turn counter")
