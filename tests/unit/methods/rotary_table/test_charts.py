import json
import math
import re
from dataclasses import replace
from importlib import resources

import numpy as np
import pytest
from tests.unit.methods.rotary_table.samples import deg, result, table_report, turn_detail

from detent.methods.rotary_table import charts
from detent.methods.rotary_table.page import all_charts
from detent.methods.rotary_table.page_data import Signal


def curves_of(chart: dict) -> dict:
    return {series["label"]: series["y"] for series in chart["series"]}


def lanes_of(chart: dict) -> dict:
    return {lane["label"]: lane["bars"] for lane in chart["lanes"]}


def test_the_time_line_has_a_lane_per_kind_of_step_and_per_signal() -> None:
    steps = charts.line_charts(table_report())[0]
    assert lanes_of(steps) == {
        "go to": [[0.0, 2.0, "1", "step 1: go to position 1 (90 deg, <shortest>)"]],
        "jog": [[6.0, 10.0, '+ at 60 deg/s while "feed"', 'step 5: jog + at 60 deg/s while "feed"']],
        "wait": [[2.0, 6.0, "4 s", "step 3: wait 4 s"]],
        "out clamp": [[2.0, 6.0, "on", "output clamp is on"]],
        "in feed": [[8.0, 9.5, "on", "input feed is on"]],
    }
    assert [lane["colour"] for lane in steps["lanes"]] == ["right", "left", "muted", "good", "drive"]


def test_kinds_of_steps_that_do_not_occur_have_no_lane() -> None:
    only = table_report(steps=[result(1)], outputs=(), inputs=())
    assert list(lanes_of(charts.line_charts(only)[0])) == ["go to"]


def test_angle_and_speed_stand_below_over_the_same_time() -> None:
    steps, turns, detected, speed = charts.line_charts(table_report())
    assert [chart["id"] for chart in (steps, turns, detected, speed)] == [
        "line-steps", "line-turns", "line-detected", "line-speed",
    ]  # fmt: skip
    assert {chart["sync"] for chart in (steps, turns, detected, speed)} == {"line"}
    assert (steps["x"][0], steps["x"][-1]) == (turns["x"][0], turns["x"][-1]) == (0.0, 9.99)
    at = turns["x"].index(1.0)
    assert curves_of(turns)["true angle"][at] == 0.125
    assert curves_of(turns)["target of a positioning"][at] == 0.25
    assert curves_of(turns)["target of a positioning"][-1] is None
    assert curves_of(turns)["true angle"][-1] == pytest.approx(1.245)
    assert curves_of(detected)["detected angle D"][-1] == pytest.approx(88.2)
    assert curves_of(speed)["true speed"][at] == pytest.approx(45.0)
    assert curves_of(speed)["commanded"][at] == 45.0
    assert [chart.get("foot", True) for chart in (steps, turns, detected, speed)] == [False, False, False, True]


def test_without_a_trace_the_lanes_stand_alone() -> None:
    (steps,) = charts.line_charts(table_report(path=None))
    assert (steps["x"][0], steps["x"][-1]) == (0.0, 10.0)
    assert steps["xLabel"] == "time since the sequence began [s]"
    assert "foot" not in steps


def test_a_long_sequence_shows_its_beginning() -> None:
    report = table_report()
    long = replace(report, figures=replace(report.figures, seconds=5000.0), path=None)
    assert charts.line_end(long) == charts.LINE_SECONDS
    assert charts.line_charts(long)[0]["x"][-1] == charts.LINE_SECONDS
    # What was not recorded cannot be drawn.
    assert charts.line_end(replace(long, path=report.path)) == pytest.approx(9.99)


def test_of_many_signals_the_first_are_drawn_and_the_others_counted() -> None:
    many = table_report(
        outputs=[Signal(f"o{n}", []) for n in range(10)], inputs=[Signal(f"i{n}", []) for n in range(5)]
    )
    lanes = lanes_of(charts.line_charts(many)[0])
    assert sum(label.startswith(("in ", "out ")) for label in lanes) == charts.MOST_SIGNALS
    assert charts.left_out_signals(many) == 3
    assert charts.left_out_signals(table_report()) == 0


def test_the_step_shows_the_angles_of_the_positioner() -> None:
    angles, counters, deviation, speed = charts.turn_charts(turn_detail())
    drawn = curves_of(angles)
    assert list(drawn) == ["M target", "M \u2212 one turn: rollover", "D detected", "R present", "C commanded"]
    at = angles["x"].index(2.0)
    assert [round(curve[at], 6) for curve in drawn.values()] == [1020.0, 660.0, 60.0, 420.0, 422.0]
    assert drawn["M target"][0] is None  # before the button was seen: a gap, not a zero
    after = angles["x"].index(6.5)
    assert drawn["R present"][after] == pytest.approx(330.0)
    assert curves_of(counters)["turns n"][at] == curves_of(counters)["FLG"][at] == 1
    assert set(curves_of(deviation)["deviation dR: how far the table lags"]) == {2.0}
    assert curves_of(speed)["speed signal S4, as told to the drive"][at] == 63.0
    assert curves_of(speed)["true speed"][at] == 60.0
    assert angles["events"] == [0.0, 1.0, 6.0, 7.0]
    assert [[round(x, 2) for x in span] for span in angles["bands"][0]["spans"]] == [[1.0, 6.0], [7.0, 7.98]]
    assert speed["xLabel"] == "time since the button was seen [s]"


def test_a_positioning_has_no_rollover_threshold() -> None:
    detail = turn_detail(kind="go", threshold=np.full(len(turn_detail().t), np.nan))
    *_, speed = drawn = charts.turn_charts(detail)
    assert "M \u2212 one turn: rollover" not in curves_of(drawn[0])
    assert speed["xLabel"] == "time since the position was taken [s]"


def test_a_long_recording_is_thinned_and_keeps_the_jumps() -> None:
    t = np.linspace(0, 99, 50_000)
    angle = t * deg(36)
    path = replace(
        table_report().path, t=t, angle=angle, detected=angle % math.tau, target=np.full(len(t), np.nan),
        velocity=np.zeros(len(t)), velocity_ref=np.zeros(len(t)),
    )  # fmt: skip
    report = table_report(path=path)
    long = replace(report, figures=replace(report.figures, seconds=100.0))
    _, turns, detected, _ = charts.line_charts(long)
    assert len(turns["x"]) <= 5 * (charts.POINTS + 2)
    drawn = np.array(curves_of(detected)["detected angle D"])
    assert np.count_nonzero(np.diff(drawn) < -300) == 9  # nine of ten turns come to their end
    assert drawn.max() > 359.0


def test_charts_are_plain_json_in_colours_that_the_style_has() -> None:
    drawn = all_charts(table_report())
    assert json.loads(json.dumps(drawn, allow_nan=False)) == drawn
    style = resources.files("detent.page").joinpath("template/report.css").read_text(encoding="utf-8")
    light, dark = re.findall(r":root[^{]*\{(.*?)\}", style, flags=re.DOTALL)[:2]
    for chart in drawn:
        for series in chart["series"]:
            assert len(series["y"]) == len(chart["x"])
        for coloured in [*chart["series"], *chart.get("lanes", [])]:
            assert f"--{coloured['colour']}:" in light
            assert f"--{coloured['colour']}:" in dark
