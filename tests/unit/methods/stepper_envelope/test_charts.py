from dataclasses import replace

import numpy as np
import pytest
from tests.unit.methods.stepper_envelope.samples import (
    MM,
    arc,
    detail,
    envelope,
    motion,
    motor_runs,
    rotor_path,
    stage_path,
    torques,
)

from detent.methods.stepper_envelope import charts
from detent.page.parts import Event


def curves_of(chart: dict) -> dict:
    return {series["label"]: series["y"] for series in chart["series"]}


# ---- places over time


def test_each_motor_has_a_chart_of_its_place_in_millimetres() -> None:
    x, y = charts.path_charts(stage_path())
    assert (x["id"], y["id"]) == ("path-0", "path-1")
    assert (x["yLabel"], y["xLabel"]) == ("x [mm]", "time since the job began [s]")
    assert x["x"] == y["x"]
    at = x["x"].index(0.2)
    assert {name: y[at] for name, y in curves_of(x).items()} == {"target": 1.0, "true position": 0.995}
    # Only where steps are lost does the counted position say anything of its own.
    assert curves_of(y)["counted position"][at] == 1.0
    assert curves_of(y)["true position"][at] == 0.98
    assert curves_of(y)["target"][at] is None


def test_without_the_rotor_the_counted_position_is_drawn() -> None:
    path = stage_path()
    bare = replace(path, motors=[replace(path.motors[0], rotor=None)])
    (chart,) = charts.path_charts(bare)
    assert list(curves_of(chart)) == ["target", "counted position"]


def test_a_long_job_and_many_motors_are_drawn_in_part() -> None:
    path = stage_path(seconds=80.0)
    many = replace(path, motors=[path.motors[0]] * 9)
    drawn = charts.path_charts(many)
    assert len(drawn) == charts.MOST_MOTORS
    assert 29.5 < drawn[0]["x"][-1] <= 30.0
    assert charts.path_end(path) == 30.0
    assert charts.path_end(stage_path()) == pytest.approx(0.399)


# ---- frequency against position


def test_up_is_above_zero_and_down_below_it() -> None:
    chart = charts.runs_chart(motor_runs(), "runs-0")
    drawn = curves_of(chart)
    at = chart["x"].index(10.0)
    assert (drawn["permissible, up"][at], drawn["permissible, down"][at]) == (1000.0, -4000.0)
    assert (chart["x"][0], chart["x"][-1]) == (0.0, 40.0)
    up, down = chart["loops"]
    assert (up["colour"], up["y"]) == ("right", [0.0, 2000.0, 2000.0, 0.0])
    assert (down["colour"], down["y"]) == ("left", [0.0, -2000.0, -2000.0, 0.0])
    assert down["x"] == up["x"][::-1]
    assert [series["label"] for series in chart["series"][2:]] == ["steps made, up", "steps made, down"]
    assert chart["yRange"] == [-5000.0, 5000.0]
    assert [level["y"] for level in chart["levels"]] == [4000.0, -4000.0]
    assert chart["levels"][0]["label"].replace("\u202f", " ") == "limit 4 000 Hz, 20 mm/s"
    assert all(series.get("fill") for series in chart["series"][:2])


def test_zones_are_shaded_where_they_are_and_say_for_which_direction() -> None:
    (band,) = charts.runs_chart(motor_runs(), "a")["bands"]
    assert band == {"spans": [[10.0, 13.0]], "colour": "brake", "label": "near: 5 mm/s, up only"}
    far = motor_runs(arcs=[arc(low=20 * MM, high=21 * MM)])
    assert charts.shown_zones(far) == []
    assert charts.runs_chart(far, "a")["bands"] == []


def test_short_runs_are_drawn_with_their_neighbourhood_only() -> None:
    runs = motor_runs(arcs=[arc(low=20 * MM, high=30 * MM)])
    low, high = charts.shown_window(runs)
    assert (low, high) == (pytest.approx(18.8 * MM), pytest.approx(31.2 * MM))
    chart = charts.runs_chart(runs, "a")
    assert (chart["x"][0], chart["x"][-1]) == (18.8, 31.2)
    assert curves_of(chart)["permissible, up"] == [4000.0, 4000.0]
    assert charts.shown_window(motor_runs(arcs=[arc(high=10 * MM)])) == (0.0, pytest.approx(11.2 * MM))
    assert charts.shown_window(motor_runs()) == (0.0, 40 * MM)


def test_a_direction_without_steps_has_little_room() -> None:
    one_way = replace(envelope(), down=np.zeros(6))
    chart = charts.runs_chart(motor_runs(envelope=one_way, arcs=[arc()]), "a")
    assert chart["yRange"] == [-500.0, 5000.0]
    assert list(curves_of(chart)) == ["permissible, up", "steps made, up"]
    other_way = replace(envelope(), up=np.zeros(6))
    chart = charts.runs_chart(motor_runs(envelope=other_way, arcs=[arc(-1)]), "a")
    assert chart["yRange"] == [-5000.0, 500.0]
    assert chart["levels"][1]["label"].startswith("limit")


def test_high_frequencies_are_written_in_kilohertz() -> None:
    chart = charts.runs_chart(motor_runs(max_hz=20e3), "a")
    assert "[kHz]" in chart["yLabel"]
    assert chart["loops"][0]["y"] == [0.0, 2.0, 2.0, 0.0]
    assert curves_of(chart)["permissible, up"][1] == 4.0
    assert chart["levels"][0]["y"] == 20.0


# ---- one move


def test_torque_is_drawn_over_the_steps_of_the_move() -> None:
    _, torque, margin, *_ = charts.detail_charts(detail())
    assert torque["x"] == margin["x"] == [1.0, 2.0, 3.0]
    assert curves_of(torque) == {
        "pull-out torque": [40.0, 15.0, 40.0],
        "planned with a reserve of 2": [20.0, 7.5, 20.0],
        "torque needed": [10.0, 6.0, 0.0],
    }
    # A step that needs nothing has no margin that could be drawn.
    assert curves_of(margin) == {
        "planned with a reserve of 2": [2.0, 2.0, 2.0],
        "pull-out torque / torque needed": [4.0, 2.5, None],
    }
    assert [level["y"] for level in margin["levels"]] == [1.0]
    assert torque["sync"] == margin["sync"]
    assert margin["yRange"][1] == pytest.approx(1.15 * 4.0)


def test_what_is_far_above_the_least_margin_is_cut_off() -> None:
    far = torques(margin=np.array([300.0, 2.5, 60.0]))
    margin = charts.detail_charts(detail(torques=far))[2]
    assert margin["yRange"][1] == pytest.approx(1.15 * 2.5 * 2.5, abs=1e-3)


def test_without_a_reserve_there_is_no_line_for_it() -> None:
    _, torque, margin, *_ = charts.detail_charts(detail(torques=torques(safety=1.0)))
    assert list(curves_of(torque)) == ["pull-out torque", "torque needed"]
    assert list(curves_of(margin)) == ["pull-out torque / torque needed"]


def test_steps_that_need_no_torque_at_all_can_be_drawn() -> None:
    nothing = torques(needed=np.zeros(3), margin=np.full(3, np.inf))
    margin = charts.detail_charts(detail(torques=nothing))[2]
    assert curves_of(margin)["pull-out torque / torque needed"] == [None, None, None]
    assert margin["yRange"][1] > 0


def test_many_steps_are_thinned_and_keep_the_least_margin() -> None:
    margin = np.full(22_000, 3.0)
    margin[12_345] = 1.1
    long = torques(hz=margin, available=3e-3 * margin, needed=np.full(22_000, 3e-3), margin=margin)
    chart = charts.detail_charts(detail(torques=long))[2]
    assert len(chart["x"]) < 3 * charts.POINTS + 6
    assert curves_of(chart)["pull-out torque / torque needed"][chart["x"].index(12_346.0)] == 1.1


def test_the_rotor_is_drawn_with_its_events_and_the_bounds_of_its_lag() -> None:
    speed, lag, rest = charts.detail_charts(detail())[3:]
    assert [chart["id"] for chart in (speed, lag, rest)] == ["detail-speed", "detail-lag", "rest-lag"]
    at = speed["x"].index(50.0)
    assert (curves_of(speed)["rotor"][at], curves_of(speed)["field: what is commanded"][at]) == (9.9, 10.0)
    assert speed["events"] == [0.0, 100.0]
    assert [level["y"] for level in lag["levels"]] == [2.0, -2.0]
    assert lag["yRange"] == [-2.6, 2.6]


def test_a_rotor_out_of_step_has_the_scale_of_its_lag() -> None:
    lost = rotor_path(lag=np.linspace(0, -500, 150))
    shown = charts.detail_charts(detail(rotor=lost, motion=motion(lost=-500)))
    assert [chart["id"] for chart in shown[3:]] == ["detail-speed", "detail-lag"]  # it came to no rest of its own
    assert "levels" not in shown[4]
    assert shown[4]["yRange"] == [-650.0, 650.0]


def test_long_moves_are_told_in_seconds() -> None:
    t = np.arange(0, 3.2, 1e-2)
    long = rotor_path(t=t, velocity=t, velocity_ref=t, lag=np.zeros(len(t)), events=[Event(3.1, "late")])
    speed = charts.detail_charts(detail(rotor=long, motion=motion(seconds=3.1)))[3]
    assert speed["events"] == [3.1]


def test_coming_to_rest_is_magnified_around_the_last_step() -> None:
    (rest,) = charts.rest_charts(detail())
    assert rest["x"][0] == pytest.approx(100.0 - 0.4 * 49.0, abs=1.0)
    assert rest["x"][-1] == pytest.approx(149.0)
    assert rest["bands"][0]["spans"] == [[100.0, 149.0]]
    assert [level["y"] for level in rest["levels"]] == [0.5, -0.5]


def test_without_torque_or_rotor_their_charts_are_left_out() -> None:
    bare = charts.detail_charts(detail(torques=None, rotor=None))
    assert [chart["id"] for chart in bare] == ["detail-runs"]
    ended = rotor_path()
    assert charts.rest_charts(detail(rotor=ended, motion=motion(seconds=0.2))) == []
