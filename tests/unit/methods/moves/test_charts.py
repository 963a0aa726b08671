import json
import re
from dataclasses import replace
from importlib import resources

import numpy as np
import pytest
from tests.unit.methods.moves.samples import (
    STEP,
    TOLERANCE,
    feedback_comparison,
    filtered_move,
    filtered_report,
    hold_comparison,
    noise_comparison,
    phase_move,
    phase_report,
    result,
)

from detent.methods.moves import charts
from detent.methods.moves.page import all_charts
from detent.methods.moves.page_data import CountUnit, JobPath
from detent.page.chart import POINTS

UNIT = CountUnit(STEP, "step")


def curves_of(chart: dict) -> dict:
    return {series["label"]: series["y"] for series in chart["series"]}


def test_the_job_is_position_over_target_in_millimetres() -> None:
    t = np.arange(0, 2, 1e-2)
    target = np.where(t < 1, 0.01, 0.02)
    chart = charts.job_chart(JobPath(t=t, position=target - 5e-6, target=target))
    drawn = curves_of(chart)
    at = chart["x"].index(1.5)
    assert (drawn["target"][at], drawn["true position"][at]) == (20.0, 19.995)
    assert (chart["xLabel"], chart["yLabel"]) == ("time since the axis was ready [s]", "position [mm]")


def test_a_long_job_shows_its_first_stretch_thinned() -> None:
    t = np.linspace(0, 100, 500_000)
    chart = charts.job_chart(JobPath(t=t, position=np.sin(t * 7), target=np.sign(np.sin(t * 7))))
    assert 29.99 < chart["x"][-1] <= 30.0
    assert POINTS / 2 < len(chart["x"]) <= 2 * POINTS + 4
    assert max(curves_of(chart)["true position"]) == pytest.approx(1000, abs=1e-3)


def test_each_rest_is_counted_on_its_side_once() -> None:
    moves = [result(1, 0.0, 0.1, offset=3e-6), result(2, 0.0, 0.1, offset=3e-6), result(3, 0.1, 0.0, offset=-6e-6)]
    chart = charts.rest_chart(moves, 5e-6)
    drawn = {name: dict(zip(chart["x"], y, strict=True)) for name, y in curves_of(chart).items()}
    assert {x: y for x, y in drawn["moved to the right"].items() if y} == {3.0: 2}
    assert {x: y for x, y in drawn["moved to the left"].items() if y} == {-6.0: 1}
    assert [mark["x"] for mark in chart["marks"]] == [-5.0, 5.0]
    assert charts.rest_chart(moves, 50e-6)["marks"] == []


def test_a_phase_move_shows_speed_way_and_drive_over_one_time() -> None:
    speed, to_go, drive = charts.move_charts(phase_move())
    assert [chart["id"] for chart in (speed, to_go, drive)] == ["move-speed", "move-to-go", "move-drive"]
    assert speed["x"] == to_go["x"] == drive["x"]
    drawn = curves_of(speed)
    at = speed["x"].index(40.0)
    assert (drawn["true speed"][at], drawn["demanded by the table"][at]) == (300.0, 300.0)
    assert drawn["demanded by the table"][-1] is None  # no demand in position mode: a gap, not a zero
    assert curves_of(to_go)["way to go"][0] == 20.0
    assert curves_of(drive)["drive word"][:2] == [127, 127]
    assert speed["bands"] == [{"label": "position mode", "colour": "good", "spans": [[80.0, 100.0]]}]
    assert speed["events"] == [0.0, 80.0, 83.0]


def test_the_command_is_marked_though_it_comes_before_the_first_row() -> None:
    moved = phase_move()
    late = replace(moved, path=replace(moved.path, t=moved.path.t + 6e-5))
    speed = charts.move_charts(late)[0]
    assert speed["events"][0] == speed["x"][0] == 0.06


def test_a_filtered_move_shows_what_is_counted_and_what_is_left_of_it() -> None:
    speed, counted, deviation, drive = charts.move_charts(filtered_move())
    assert [chart["yLabel"] for chart in (speed, counted, deviation, drive)] == [
        "speed [mm/s]", "speed word [pulse]", "error [pulse]", "drive [count]",
    ]  # fmt: skip
    words = curves_of(counted)
    at = counted["x"].index(40.0)
    assert (words["counted × B"][at], words["after the filter"][at]) == (120.0, 120.0)
    assert curves_of(deviation)["following error"][at] == 135
    assert speed["bands"] == []


def test_the_approach_is_magnified_in_counts_and_keeps_the_numbers_of_the_events() -> None:
    place, words = charts.approach_charts(phase_move(), UNIT, TOLERANCE)
    assert (place["x"][0], place["x"][-1]) == (70.0, 95.0)
    drawn = curves_of(place)["true position"]
    assert drawn[place["x"].index(80.0)] == pytest.approx(-10.0)
    assert drawn[-1] == pytest.approx(0.5)
    assert [level["y"] for level in place["levels"]] == [2.0, -2.0]
    assert place["events"] == [0.0, 80.0, 83.0]  # number 1 is out of sight, the others keep theirs
    assert place["bands"][0]["spans"] == [[82.0, 100.0]]
    assert place["yRange"][0] < min(drawn)
    assert place["yRange"][1] > 2.0
    assert list(curves_of(words)) == ["absolute error word", "integral", "drive word"]
    assert list(curves_of(charts.approach_charts(filtered_move(), UNIT, TOLERANCE)[1])) == [
        "following error", "filtered speed", "drive word",
    ]  # fmt: skip


def test_a_move_that_ended_outside_has_no_stretch_within_the_tolerance() -> None:
    place, _ = charts.approach_charts(phase_move(settled=float("nan")), UNIT, TOLERANCE)
    assert place["bands"][0]["spans"] == []
    assert charts.approach_charts(phase_move(approach=None), UNIT, TOLERANCE) == []


def test_rest_points_lie_over_signed_pulses() -> None:
    chart = charts.noise_chart(noise_comparison())
    # A ring at either end needs room beside it.
    assert chart["x"] == [-31.5, -30, -8, 0, 8, 30, 31.5]
    drawn = curves_of(chart)
    assert drawn["only incremental, moving right"][1:-1] == [30, 8, 0, -8, -30]
    assert drawn["only incremental, moving left"][1:-1] == [30, 8, 0, -8, -30]
    assert drawn["this servo, moving right"] == [None, -64, 0, 0, 0, -64, None]
    assert drawn["this servo, moving left"] == [None, 64, 0, 0, 0, 64, None]
    assert [mark["x"] for mark in chart["marks"]] == [-24, 24]


def test_the_carriage_at_rest_is_drawn_on_one_scale_and_without_its_arrival() -> None:
    *still, _, _ = charts.hold_charts(hold_comparison())
    assert [chart["id"] for chart in still] == ["still-0", "still-1", "still-2"]
    assert [chart["yRange"] for chart in still] == [[-0.44, 0.44]] * 3
    # From halfway between the arrival and the stop.
    assert [chart["x"][0] for chart in still] == [pytest.approx(31.0, abs=0.2)] * 3
    assert {abs(value) for value in still[1]["series"][0]["y"][-100:]} == {0.1}


def test_under_load_both_cases_share_the_charts() -> None:
    place, integral = charts.hold_charts(hold_comparison())[-2:]
    assert place["x"][0] == pytest.approx(25.5, abs=0.2)  # halfway from the arrival to the push
    assert curves_of(place)["with it"][-1] == 0.7
    assert curves_of(place)["without it"][-1] == 2.0
    assert curves_of(integral)["with it"][-1] == -6
    assert place["events"] == [30.0, 41.0]
    assert [event.t for event in charts.hold_events(hold_comparison())] == [0.03, 0.041]


def test_filtered_and_unfiltered_words_share_the_charts() -> None:
    speed, drive = charts.feedback_charts(feedback_comparison())
    assert list(curves_of(speed)) == ["without the filter", "with the filter"]
    assert speed["x"][0] == 0.0
    assert set(map(abs, curves_of(drive)["with the filter"])) <= {0.0, 0.6}
    assert max(curves_of(drive)["without the filter"]) == 1.8
    assert max(curves_of(speed)["with the filter"]) == 20.6


def test_a_case_that_failed_before_it_was_steady_is_not_drawn() -> None:
    found = feedback_comparison()
    object.__setattr__(found.cases[1], "t", np.empty(0))
    assert charts.feedback_charts(found) == []


@pytest.mark.parametrize("report", [phase_report(), filtered_report()], ids=["phase", "filtered"])
def test_charts_are_plain_json_in_colours_that_the_style_has(report) -> None:
    drawn = all_charts(report)
    assert json.loads(json.dumps(drawn, allow_nan=False)) == drawn
    style = resources.files("detent.page").joinpath("template/report.css").read_text(encoding="utf-8")
    light, dark = re.findall(r":root[^{]*\{(.*?)\}", style, flags=re.DOTALL)[:2]
    for chart in drawn:
        for series in chart["series"]:
            assert len(series["y"]) == len(chart["x"])
            assert f"--{series['colour']}:" in light
            assert f"--{series['colour']}:" in dark
