"""The motion that is shown in detail, of real runs of the example stages; torques made up."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.methods.stepper_envelope.players import MM, Played, chart_of, curve_of, moves, play

from detent.methods.stepper_envelope import detail
from detent.methods.stepper_envelope.detail import NEEDED_ROTOR, ShownMotion, telling, torque_charts
from detent.methods.stepper_envelope.page import stage_page
from detent.methods.stepper_envelope.run import MOTOR_SIGNALS
from detent.methods.stepper_envelope.stage_job import StageJog, StageMove, StopChange
from detent.methods.stepper_envelope.stage_trace import recorded_steps
from detent.methods.stepper_envelope.summary import StageFigures
from detent.page.draw import plain
from detent.page.figure import Figure
from detent.page.frame import Page, Section

pytestmark = pytest.mark.compiled


def shown_of(played: Played) -> ShownMotion:
    spec, run, trace = played
    figures = StageFigures(spec, run)
    shown = telling(figures, trace, recorded_steps(figures, trace))
    assert shown is not None
    return shown


def section_of(page: Page) -> Section:
    return next(section for section in page.sections if section.title.endswith("step by step"))


def events_of(page: Page) -> Figure:
    return next(figure for figure in page.figures if figure.events)


# ---- which motion


def test_what_is_drawn_is_what_is_recorded() -> None:
    assert set(NEEDED_ROTOR) <= set(MOTOR_SIGNALS)


def test_the_motion_with_the_least_margin_is_shown_under_its_own_table(zoom: Played) -> None:
    shown = shown_of(zoom)
    assert (shown.motion.move.number, shown.motion.name) == (1, "group_a")
    assert shown.why == "the motion with the least torque margin, the longest of several"
    page = stage_page(*zoom)
    assert section_of(page).title == "Move 1 “in”, step by step"
    assert "motor group_a, 12 mm up. " in plain(section_of(page).shown[0].caption)
    chart = chart_of(page, "detail-runs")
    assert len(chart["loops"]) == 1
    assert [series["label"] for series in chart["series"]] == ["permissible, up", "steps made, up"]
    permitted = curve_of(page, "detail-runs", "permissible, up")
    assert chart["x"][int(np.flatnonzero(permitted)[-1]) + 1] == pytest.approx(12.0)


def test_torque_and_rotor_are_those_of_the_motion(zoom: Played) -> None:
    motor, page = shown_of(zoom).motion.motor, stage_page(*zoom)
    margin = curve_of(page, "detail-margin", "pull-out torque / torque needed")
    assert chart_of(page, "detail-margin")["x"][-1] == motor.steps == 2400
    assert np.nanmin(margin) == pytest.approx(motor.margin, rel=0.01)
    lag = curve_of(page, "detail-lag", "field less rotor")
    assert np.abs(lag).max() == pytest.approx(motor.peak_lag, abs=0.05)
    assert curve_of(page, "detail-speed", "field: what is commanded").max() == pytest.approx(20.0)
    assert [level["y"] for level in chart_of(page, "detail-lag")["levels"]] == [2.0, -2.0]


def test_what_happens_is_told_in_its_order(zoom: Played) -> None:
    spec, run, _ = zoom
    move = run.moves[0]
    motor = move.motors["group_a"]
    events = {event.text: event.t for event in events_of(stage_page(*zoom)).events}
    assert events == {
        "start signal, at the same time for group_b": 0.0,
        "the last step is over": motor.arrived - move.begin,
        "the rotor is within ±0.5 steps of its place for good": motor.settled - move.begin,
        "the time to settle is over: the host takes the move for done": move.ready - move.begin,
    }
    assert list(events.values()) == sorted(events.values())
    assert move.ready - motor.arrived >= spec.controller.settle_time


def test_coming_to_rest_is_magnified_around_the_last_step(zoom: Played) -> None:
    shown, chart = shown_of(zoom), chart_of(stage_page(*zoom), "rest-lag")
    over, end = shown.motion.seconds * 1e3, (shown.motion.move.ready - shown.motion.move.begin) * 1e3
    assert chart["x"][0] == pytest.approx(over - 0.4 * (end - over), abs=0.3)
    assert chart["x"][-1] == pytest.approx(end, abs=0.3)
    assert chart["bands"][0]["spans"] == [[pytest.approx(over, abs=0.01), pytest.approx(end, abs=0.3)]]
    assert [level["y"] for level in chart["levels"]] == [0.5, -0.5]


def test_lost_steps_are_shown_first_and_such_a_rotor_comes_to_no_rest() -> None:
    fast = (
        "stepper.x.limits.acceleration=8 m/s^2",
        "stepper.x.limits.speed=60 mm/s",
        "stepper.x.drive.torque_safety=1",
    )
    job = replace(
        moves(StageMove(1, 1, targets={"y": 1 * MM}), StageMove(2, 2, targets={"x": 20 * MM}, label="A")),
        kind="tiles", motors=("x", "y"),
    )  # fmt: skip
    played = play("stage.toml", job, *fast)
    assert shown_of(played).why == "the motion that lost steps first"
    page = stage_page(*played)
    assert section_of(page).title == "Tile A, step by step"
    assert "rest-lag" not in [chart["id"] for chart in page.charts]
    lag = chart_of(page, "detail-lag")
    assert "levels" not in lag  # on this scale they are one line
    lost = played[1].moves[1].motors["x"].lost
    assert lag["yRange"][1] >= 1.3 * abs(lost) - 1
    # Without a reserve there is no line for it.
    assert [series["label"] for series in chart_of(page, "detail-torque")["series"]] == [
        "pull-out torque", "torque needed",
    ]  # fmt: skip


def test_a_stop_that_was_passed_is_shown_with_its_turn() -> None:
    late = StageMove(1, 1, targets={"group_a": 20 * MM}, change=StopChange(8 * MM, 8.2 * MM), label="late")
    played = play("zoom.toml", moves(late, StageMove(2, 2, targets={"group_a": 0.0})))
    shown, page = shown_of(played), stage_page(*played)
    assert (shown.motion.move.number, shown.why) == (1, "the motion that had to pass its stop")
    assert [leg.direction for leg in shown.legs] == [1, -1]
    assert "with 1 turn on the way" in plain(section_of(page).shown[0].caption)
    texts = {plain(event.text): event.t for event in events_of(page).events}
    changed, turned = texts["at 8 mm the stop is changed to 8.2 mm"], texts["turns, down from here"]
    assert 0 < changed < turned < shown.motion.seconds
    assert chart_of(page, "detail-runs")["loops"][0]["x"][-1] > 8.2


def test_a_manual_run_is_bounded_by_the_travel_and_told_as_one() -> None:
    played = play(
        "zoom.toml", moves(StageJog(1, 1, "group_b", -5 * MM, 0.2)), "stepper.group_b.mechanics.start_position=5 mm"
    )
    page = stage_page(*played)
    both = [np.abs(curve_of(page, "detail-runs", f"permissible, {way}")).max() for way in ("up", "down")]
    assert both == [4000.0, 4000.0]
    assert min(chart_of(page, "detail-runs")["loops"][0]["y"]) == pytest.approx(-1000.0)
    events = events_of(page).events
    assert [plain(event.text) for event in events][:2] == ["the joystick asks for −5 mm/s", "the joystick is let go"]
    assert events[1].t == 0.2
    assert curve_of(page, "detail-speed", "field: what is commanded").min() == pytest.approx(-5.0)


def test_a_rotor_still_away_is_not_said_to_be_at_rest() -> None:
    hasty = ("controller.settle_time=0 s", "controller.tolerance=0.07")
    played = play("zoom.toml", moves(StageMove(1, 1, targets={"group_a": 1 * MM})), *hasty)
    assert not played[1].done
    assert shown_of(played).why == "the motion that did not end in its place"
    assert not any("for good" in event.text for event in events_of(stage_page(*played)).events)


def test_long_moves_are_told_in_seconds() -> None:
    page = stage_page(*play("zoom.toml", moves(StageJog(1, 1, "group_a", 5 * MM, 1.2))))
    assert chart_of(page, "detail-speed")["xLabel"].endswith("[s]")
    assert chart_of(page, "detail-speed")["events"][1] == 1.2


# ---- torque


AVAILABLE, NEEDED = np.array([40.0, 15.0, 40.0]), np.array([10.0, 6.0, 0.0])
"""Three steps [mN m]; the second has the least margin, the third needs nothing."""


def curves_of(chart: dict) -> dict:
    return {series["label"]: series["y"] for series in chart["series"]}


def test_torque_is_drawn_over_the_steps_of_the_move() -> None:
    torque, margin = torque_charts(AVAILABLE, NEEDED, 2.0)
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
    _, margin = torque_charts(6.0 * np.array([300.0, 2.5, 60.0]), np.full(3, 6.0), 2.0)
    assert margin["yRange"][1] == pytest.approx(1.15 * 2.5 * 2.5, abs=1e-3)


def test_steps_that_need_no_torque_at_all_can_be_drawn() -> None:
    _, margin = torque_charts(AVAILABLE, np.zeros(3), 2.0)
    assert curves_of(margin)["pull-out torque / torque needed"] == [None, None, None]
    assert margin["yRange"][1] > 0


def test_many_steps_are_thinned_and_keep_the_least_margin() -> None:
    margin = np.full(22_000, 3.0)
    margin[12_345] = 1.1
    _, chart = torque_charts(3.0 * margin, np.full(22_000, 3.0), 2.0)
    assert len(chart["x"]) < 3 * detail.POINTS + 6
    assert curves_of(chart)["pull-out torque / torque needed"][chart["x"].index(12_346.0)] == 1.1
