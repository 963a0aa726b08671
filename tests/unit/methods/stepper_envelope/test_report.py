"""From real runs of the example stages to what their report shows."""

from dataclasses import replace

import numpy as np
import pytest
from tests.page_reader import Reader

import detent
from detent.methods.load import load_spec
from detent.methods.stepper_envelope.build import instant
from detent.methods.stepper_envelope.machine import stage_registers
from detent.methods.stepper_envelope.page import make_stage_page
from detent.methods.stepper_envelope.report import NEEDED_PATH, stage_report
from detent.methods.stepper_envelope.run import MOTOR_SIGNALS, StageRun, run_stage, stage_signals
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec
from detent.methods.stepper_envelope.stage_detail import NEEDED_ROTOR
from detent.methods.stepper_envelope.stage_file import load_stage_job
from detent.methods.stepper_envelope.stage_job import Change, StageJob, StageJog, StageMove
from detent.methods.stepper_envelope.stage_trace import NEEDED_STEPS
from detent.page.page import render_page
from detent.record.recorder import Recorder
from detent.record.trace import Trace

pytestmark = pytest.mark.compiled

MM = 1e-3
Played = tuple[StepperEnvelopeSpec, StageRun, Trace]


def play(example: str, job: StageJob, *overrides: str, every: int = 50) -> Played:
    spec = load_spec(detent.example(example), overrides)
    recorder = Recorder(stage_registers(spec), stage_signals(spec), every=every, period=instant(spec))
    return spec, run_stage(spec, job, recorder=recorder), recorder.trace()


def moves(*made: StageMove | StageJog) -> StageJob:
    return StageJob("moves.toml", "moves", made, ("group_a", "group_b"), ("read so",))


@pytest.fixture(scope="module")
def zoom() -> Played:
    together = StageMove(1, 1, targets={"group_a": 12 * MM, "group_b": 2 * MM}, label="in")
    return play("zoom.toml", moves(
        together,
        StageMove(2, 2, targets={"group_a": 5 * MM}, turn=14 * MM, label="back"),
        StageJog(3, 3, "group_b", 5 * MM, 0.1),
        StageMove(4, 4, by={"group_b": 0.25 * MM}, dwell=0.05),
    ))  # fmt: skip


@pytest.fixture(scope="module")
def tiles() -> Played:
    return play("stage.toml", load_stage_job(detent.example("tiles.csv"), ("x", "y")))


@pytest.fixture(scope="module")
def torn() -> Played:
    """Too fast for the motor: the first move loses steps, the second starts from there."""
    fast = (
        "stepper.x.limits.acceleration=8 m/s^2",
        "stepper.x.limits.speed=60 mm/s",
        "stepper.x.drive.torque_safety=1",
    )
    job = StageJob("t.csv", "tiles", (
        StageMove(1, 1, targets={"x": 20 * MM, "y": 1 * MM}, label="A"),
        StageMove(2, 2, targets={"y": 2 * MM}, label="B"),
    ), ("x", "y"))  # fmt: skip
    return play("stage.toml", job, *fast)


def test_what_is_drawn_is_what_is_recorded() -> None:
    assert {*NEEDED_PATH, *NEEDED_STEPS, *NEEDED_ROTOR, "rule.index", "rule.state"} <= set(MOTOR_SIGNALS)


def test_the_head_of_the_report_is_the_run(zoom: Played) -> None:
    spec, run, trace = zoom
    data = stage_report(spec, run, trace, steps=(), jerk=None, settings={"file": "zoom.toml"})
    assert (data.axis_name, data.job_name, data.kind, data.done) == ("zoom", "moves.toml", "moves", True)
    assert (data.steps, data.jerk, data.settings, data.plan) == ((), None, {"file": "zoom.toml"}, None)
    assert (data.figures.asked, data.figures.placed, data.figures.all_lost) == (4, 4, 0)
    assert [note.text for note in data.notes] == ["how moves.toml was read: read so"]
    for move, shown in zip(run.moves, data.moves, strict=True):
        assert (shown.number, shown.label, shown.begin, shown.seconds) == (
            move.number, move.label, move.begin, move.seconds,
        )  # fmt: skip
        assert [motion.motor for motion in shown.motions] == list(move.motors)
        for motion in shown.motions:
            made = move.motors[motion.motor]
            assert (motion.start, motion.target, motion.stop) == (made.start, made.target, made.stop)
            assert (motion.seconds, motion.steps, motion.off) == (made.arrived - move.begin, made.steps, 0)


def test_the_path_follows_its_targets_and_a_manual_run_has_none(zoom: Played) -> None:
    spec, run, trace = zoom
    path = stage_report(spec, run, trace).path
    assert path
    a, b = path.motors
    assert (a.motor, b.motor, a.astray, b.astray) == ("group_a", "group_b", False, False)
    for move in run.moves:
        row = int(np.searchsorted(path.t, move.end)) - 1
        for motor in path.motors:
            if motor.motor in move.motors:
                assert motor.counted[row] == motor.target[row] == pytest.approx(move.motors[motor.motor].stop)
    manual = (path.t > run.moves[2].begin + 1e-3) & (path.t < run.moves[2].motors["group_b"].arrived - 1e-3)
    assert np.isnan(b.target[manual]).all()
    assert not np.isnan(a.target).any()
    # The rotor lags by less than two steps of 5 um.
    assert a.rotor is not None
    assert 2e-6 < np.abs(a.rotor - a.counted).max() < 10e-6


def test_every_run_lies_under_the_envelope(zoom: Played) -> None:
    spec, run, trace = zoom
    data = stage_report(spec, run, trace)
    a, b = data.runs
    assert [arc.direction for arc in a.arcs] == [1, 1, -1]
    assert [arc.direction for arc in b.arcs] == [1, 1, 1]
    assert (a.motor, a.step, a.travel, a.max_hz, a.left_out) == ("group_a", 5e-6, (0.0, pytest.approx(0.04)), 4000.0, 0)
    for runs in (a, b):
        for arc in runs.arcs:
            half = runs.envelope.up if arc.direction > 0 else runs.envelope.down
            rows = np.searchsorted(runs.envelope.position, arc.position[1:-1], side="right") - 1
            assert (arc.hz[1:-1] <= half[rows] * 1.002 + 1e-9).all()  # periods are whole microseconds
    assert a.arcs[1].position[-1] == pytest.approx(14 * MM)
    assert max(arc.hz.max() for arc in a.arcs) == 4000.0


def test_the_move_in_detail_has_the_least_margin_and_its_own_table(zoom: Played) -> None:
    spec, run, trace = zoom
    detail = stage_report(spec, run, trace).detail
    assert detail
    assert (detail.number, detail.label, detail.motion.motor) == (1, "in", "group_a")
    assert detail.why == "the motion with the least torque margin, the longest of several"
    assert len(detail.runs.arcs) == 1
    assert not detail.runs.envelope.down.any()
    assert detail.runs.envelope.position[np.flatnonzero(detail.runs.envelope.up)[-1] + 1] == pytest.approx(12 * MM)
    assert detail.torques
    assert len(detail.torques.hz) == detail.motion.steps == 2400
    assert detail.torques.margin.min() == pytest.approx(detail.motion.margin, rel=0.01)
    assert detail.rotor
    assert np.abs(detail.rotor.lag).max() == pytest.approx(detail.motion.lag, abs=0.05)
    assert detail.rotor.velocity_ref.max() == pytest.approx(20 * MM)
    texts = [event.text for event in detail.rotor.events]
    assert texts[0] == "start signal, at the same time for group_b"
    assert set(texts[1:]) == {
        "the last step is over", "the rotor is within ±0.5 steps of its place for good",
        "the time to settle is over: the host takes the move for done",
    }  # fmt: skip


def test_tiles_lie_where_they_were_asked_for(tiles: Played) -> None:
    spec, run, trace = tiles
    plan = stage_report(spec, run, trace).plan
    assert plan
    assert (plan.motors, plan.start) == (("x", "y"), (0.0, 0.0))
    assert [tile.label for tile in plan.tiles] == [str(n) for n in range(1, 13)]
    assert plan.tiles[4].target == (pytest.approx(0.705 * MM), 0.0)  # only y moved: x is where it was
    assert all(tile.place == pytest.approx(tile.target) for tile in plan.tiles)
    assert not any(tile.off for tile in plan.tiles)
    assert plan.tiles[0].seconds == run.moves[0].seconds


def test_a_list_of_tiles_for_one_motor_has_no_plan(tiles: Played) -> None:
    spec, run, trace = tiles
    one = replace(run.job, motors=("x",))
    assert stage_report(spec, replace(run, job=one), trace).plan is None


def test_lost_steps_move_all_later_tiles_and_are_shown(torn: Played) -> None:
    spec, run, trace = torn
    data = stage_report(spec, run, trace)
    lost = run.moves[0].motors["x"].lost
    assert lost
    assert not data.done
    assert data.figures.placed == 0
    assert data.plan
    assert [tile.off for tile in data.plan.tiles] == [True, True]
    assert data.plan.tiles[1].place[0] == pytest.approx(20 * MM - lost * 5e-6)
    assert data.path
    assert [motor.astray for motor in data.path.motors] == [True, False]
    assert data.detail
    assert (data.detail.number, data.detail.why) == (1, "the motion that lost steps first")
    text = Reader(render_page(make_stage_page(data))).text
    assert "0 of 2 tiles in place. Move 1: motor x lost" in text
    assert "tile A, x lost" in text


def test_a_stop_that_was_passed_is_shown_and_told() -> None:
    late = StageMove(1, 1, targets={"group_a": 20 * MM}, change=Change(8 * MM, 8.2 * MM), label="late")
    spec, run, trace = play("zoom.toml", moves(late, StageMove(2, 2, targets={"group_a": 0.0})))
    data = stage_report(spec, run, trace)
    assert data.done
    assert data.notes[0].level == "warning"
    assert data.notes[0].text.startswith("move 1: the stop of group_a was changed to 8.2\u202fmm when the motor was")
    assert data.detail
    assert (data.detail.number, data.detail.why) == (1, "the motion that had to pass its stop")
    assert [arc.direction for arc in data.detail.runs.arcs] == [1, -1]
    assert data.detail.rotor
    texts = {event.text: event.t for event in data.detail.rotor.events}
    changed, turned = texts["at 8\u202fmm the stop is changed to 8.2\u202fmm"], texts["turns, down from here"]
    assert 0 < changed < turned < data.detail.motion.seconds
    assert data.detail.runs.arcs[0].position[-1] > 8.2 * MM


def test_a_manual_run_is_bounded_by_the_travel_and_told_as_one() -> None:
    spec, run, trace = play("zoom.toml", moves(StageJog(1, 1, "group_b", -5 * MM, 0.2)), "stepper.group_b.mechanics."
                            "start_position=5 mm")  # fmt: skip
    detail = stage_report(spec, run, trace).detail
    assert detail
    assert detail.runs.envelope.up.max() == detail.runs.envelope.down.max() == 4000.0
    assert detail.torques
    assert detail.torques.hz.max() == pytest.approx(1000.0)
    assert detail.rotor
    assert [event.text for event in detail.rotor.events][:2] == [
        "the joystick asks for −5\u202fmm/s", "the joystick is let go",
    ]  # fmt: skip
    assert detail.rotor.events[1].t == 0.2
    assert detail.rotor.velocity_ref.min() == pytest.approx(-5 * MM)


def test_a_rotor_still_away_is_not_said_to_be_at_rest() -> None:
    hasty = ("controller.settle_time=0 s", "controller.tolerance=0.07")
    spec, run, trace = play("zoom.toml", moves(StageMove(1, 1, targets={"group_a": 1 * MM})), *hasty)
    detail = stage_report(spec, run, trace).detail
    assert not run.done
    assert detail
    assert detail.why == "the motion that did not end in its place"
    assert detail.rotor
    assert not any("for good" in event.text for event in detail.rotor.events)


def test_without_a_trace_or_its_signals_figures_are_left_out(zoom: Played) -> None:
    spec, run, trace = zoom
    for given in (None, trace.between(0.0, 5e-4)):
        data = stage_report(spec, run, given)
        assert (data.path, data.runs, data.detail) == (None, [], None)
        assert len(data.moves) == 4
    no_rotor = Trace(columns={name: values for name, values in trace.columns.items() if "rotor" not in name})
    data = stage_report(spec, run, no_rotor)
    assert data.path
    assert all(motor.rotor is None for motor in data.path.motors)
    assert data.detail
    assert data.detail.rotor is None
    assert data.detail.torques
    only_lag = Trace(columns={name: trace.columns[name] for name in ("t", "group_a.rotor.lag")})
    data = stage_report(spec, run, only_lag)
    assert (data.path, data.runs, data.detail) == (None, [], None)


def test_moves_that_the_trace_does_not_reach_are_left_out(zoom: Played) -> None:
    spec, run, trace = zoom
    data = stage_report(spec, run, trace.between(0.0, run.moves[1].begin + 0.1))
    assert [runs.left_out for runs in data.runs] == [1, 2]
    assert [len(runs.arcs) for runs in data.runs] == [1, 1]
    assert data.detail
    assert data.detail.number == 1
    short = stage_report(spec, run, trace.between(0.0, 0.2))
    assert short.detail is None


def test_of_very_many_moves_the_first_are_drawn(zoom: Played, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("detent.methods.stepper_envelope.report.MOST_ARCS", 1)
    spec, run, trace = zoom
    assert [runs.left_out for runs in stage_report(spec, run, trace).runs] == [1, 2]


def test_a_job_in_which_nothing_moves_has_a_report() -> None:
    spec, run, trace = play("zoom.toml", moves(StageMove(1, 1, targets={"group_a": 0.0})))
    data = stage_report(spec, run, trace)
    assert (data.path, data.runs, data.detail) == (None, [], None)
    assert "1 move in" in Reader(render_page(make_stage_page(data))).text
