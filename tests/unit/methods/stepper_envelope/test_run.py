"""Jobs on a stage: what the host commands, what the rotors do, and what is refused before anything moves."""

import json
import math

import pytest

from detent import examples
from detent.control.step_rule import INFEASIBLE, acknowledge
from detent.errors import STEP_FAULT_TEXT, AxisError, InputError
from detent.methods.load import load_spec, read_axis
from detent.methods.stepper_envelope.host import Leg, StageHost
from detent.methods.stepper_envelope.run import run_stage, stage_signals
from detent.methods.stepper_envelope.stage_job import StageJob, StageJog, StageMove, StopChange

pytestmark = pytest.mark.compiled

MM = 1e-3
B = "stepper.group_b"
ZOOM = next(path for path in examples() if path.name == "zoom.toml")


@pytest.fixture(scope="module")
def spec():
    return read_axis(ZOOM).spec


def job(*moves) -> StageJob:
    named = tuple(dict.fromkeys(name for move in moves for name in move.motors))
    return StageJob("try.toml", "moves", moves, named, ())


def test_both_motors_start_together_and_the_move_is_done_when_both_rest(spec):
    move = StageMove(1, 1, targets={"group_a": 2 * MM, "group_b": 1 * MM}, dwell=0.02, label="one")
    run = run_stage(spec, job(move))
    assert run.done
    (made,) = run.moves
    a, b = made.motors["group_a"], made.motors["group_b"]
    assert (a.stop, b.stop) == (pytest.approx(2 * MM), pytest.approx(1 * MM))
    assert (a.steps, b.steps, a.lost, b.lost) == (400, 200, 0, 0)
    assert b.arrived < a.arrived < made.ready <= made.end
    # 400 steps take 183.7 ms (acceptance test 5).
    assert a.arrived == pytest.approx(0.1837, abs=1e-3)
    assert made.ready == pytest.approx(a.arrived + spec.controller.settle_time, abs=1e-4)
    assert made.end == pytest.approx(made.ready + 0.02, abs=1e-5)
    assert made.seconds == pytest.approx(max(a.settled, a.arrived), abs=1e-9)
    assert a.settled < made.ready


def test_a_way_from_the_place_before(spec):
    run = run_stage(spec, job(*(StageMove(n, n, by={"group_b": 0.1 * MM}) for n in (1, 2, 3))))
    assert [made.motors["group_b"].stop for made in run.moves] == pytest.approx([0.1 * MM, 0.2 * MM, 0.3 * MM])
    assert "group_a" not in run.moves[0].motors


def test_a_way_that_is_no_whole_step_adds_up_without_loss(spec):
    """0.3 steps ten times are three steps: the host keeps what was asked for, not what was made of it."""
    run = run_stage(spec, job(*(StageMove(n, n, by={"group_a": 0.3 * 5e-6}) for n in range(1, 11))))
    assert sum(made.motors["group_a"].steps for made in run.moves if made.motors) == 3
    assert run.done


def test_a_move_to_where_the_motor_stands_is_done_at_once(spec):
    run = run_stage(spec, job(StageMove(1, 1, targets={"group_a": 0.0})))
    assert run.done
    assert run.moves[0].motors == {}
    assert run.moves[0].seconds == 0.0


def test_a_turn_on_the_way_is_one_run(spec):
    run = run_stage(spec, job(StageMove(1, 1, targets={"group_a": 0.5 * MM}, turn=3 * MM)))
    motor = run.moves[0].motors["group_a"]
    assert run.done
    assert motor.steps == 600 + 500
    assert motor.stop == pytest.approx(0.5 * MM)


def test_a_stop_changed_on_the_way(spec):
    moves = (
        StageMove(1, 1, targets={"group_a": 4 * MM}, change=StopChange(1 * MM, 3 * MM)),
        StageMove(2, 2, targets={"group_a": 0.0}, change=StopChange(2 * MM, 3.5 * MM)),
        StageMove(3, 3, targets={"group_a": 0.0}),
    )
    run = run_stage(spec, job(*moves))
    assert run.done, run.failure
    assert [made.motors["group_a"].stop for made in run.moves] == pytest.approx([3 * MM, 3.5 * MM, 0.0])
    assert [made.motors["group_a"].overrun for made in run.moves] == [False, True, False]
    # Downwards at speed it cannot stop behind itself: it passes, stops and comes back.
    assert run.moves[1].motors["group_a"].steps > 100 + 300


@pytest.mark.parametrize(("at", "to"), [(0.5, 39), (1, 6)])  # on the way, and at its end
def test_a_stop_moved_far_outwards_is_waited_for(spec, at, to):
    """The wait was timed by the way to the stop of before."""
    run = run_stage(spec, job(StageMove(1, 1, targets={"group_a": 1 * MM}, change=StopChange(at * MM, to * MM))))
    assert run.done, run.failure
    motor = run.moves[0].motors["group_a"]
    assert (motor.stop, motor.steps, motor.overrun) == (pytest.approx(to * MM), to * 200, False)


def test_a_reversal_is_waited_for_however_long_its_pause(spec):
    table = spec.stepper["group_b"]
    slow = table.model_copy(
        update={
            "drive": table.drive.model_copy(update={"reversal_pause": 255}),
            "motor": table.motor.model_copy(update={"start_frequency": 150.0}),  # 66 Hz with load and reserve
            "zone": {},
        }
    )
    run = run_stage(
        spec.model_copy(update={"stepper": {"group_b": slow}}),
        job(StageMove(1, 1, targets={"group_b": 0.0}, turn=0.05 * MM)),
    )
    assert run.done, run.failure
    assert run.moves[0].motors["group_b"].arrived > 255 / 68


AFTER_A_JOG = {
    "outside the travel": (StageMove(2, 2, by={"group_a": -10.7 * MM}), ["-10.17 mm", "from 0 m to 40 mm"]),
    "turn short of the target": (StageMove(2, 2, targets={"group_a": 20 * MM}, turn=15 * MM), ["turn", "15 mm"]),
    "not passed": (StageMove(2, 2, targets={"group_a": 9 * MM}, change=StopChange(0.1 * MM, 20 * MM)), ["changed_at"]),
}


@pytest.mark.parametrize(("move", "words"), AFTER_A_JOG.values(), ids=AFTER_A_JOG)
def test_what_cannot_be_done_from_where_a_jog_ended_fails_before_the_motor_moves(spec, move, words):
    run = run_stage(spec, job(StageJog(1, 1, "group_a", 5 * MM, 0.1), move))
    place = run.moves[0].motors["group_a"].stop
    assert not run.done
    assert len(run.moves) == 1
    assert 0 < place < 1 * MM
    assert all(word in run.failure for word in ["move 2: motor group_a at", *words]), run.failure


def test_a_way_after_a_jog_that_stays_inside_is_made_also_with_turn_and_change(spec):
    moves = (
        StageJog(1, 1, "group_a", 5 * MM, 0.1),
        StageMove(2, 2, targets={"group_a": 3 * MM}, turn=4 * MM),
        StageMove(3, 3, by={"group_a": -2 * MM}, change=StopChange(2 * MM, 0.0)),
    )
    run = run_stage(spec, job(*moves))
    assert run.done, run.failure
    assert [made.motors["group_a"].stop for made in run.moves[1:]] == pytest.approx([3 * MM, 0.0])


def test_a_manual_run_into_the_end_that_the_motor_stands_at_moves_nothing(spec):
    """Its record had the arrival of the move before: -50 ms."""
    run = run_stage(spec, job(StageMove(1, 1, targets={"group_b": 0.1 * MM}), StageJog(2, 2, "group_a", -5 * MM, 0.1)))
    assert run.done
    assert run.moves[1].motors == {}
    assert run.moves[1].seconds == 0.0
    assert run.warnings == ["move 2: motor group_a made no step: it stands at the end of its travel"]


def test_a_manual_run_keeps_to_the_table_and_ends_at_the_travel(spec):
    moves = (StageJog(1, 1, "group_a", 5 * MM, 0.1), StageJog(2, 2, "group_a", -20 * MM, 2.0))
    run = run_stage(spec, job(*moves))
    first, second = (made.motors["group_a"] for made in run.moves)
    assert run.done
    assert first.peak_hz <= 1000.0
    assert 0 < first.stop < 1 * MM
    assert second.stop == 0.0
    # It stood at the end of the travel long before the joystick was let go.
    assert 0.08 < second.arrived - run.moves[1].begin < 0.1


def test_after_a_manual_run_ways_count_from_where_it_ended(spec):
    moves = (StageJog(1, 1, "group_a", 5 * MM, 0.1), StageMove(2, 2, by={"group_a": 0.5 * MM}))
    run = run_stage(spec, job(*moves))
    assert run.moves[1].motors["group_a"].stop == pytest.approx(run.moves[0].motors["group_a"].stop + 0.5 * MM)


@pytest.mark.parametrize("words", ["frequency", "reload"])
def test_no_step_is_faster_than_a_limit_however_coarse_the_timer(words):
    """With frequency words it ran at 19.23 mm/s."""
    slow = load_spec(ZOOM, (f"controller.words={words}", "controller.timer=250 kHz", f"{B}.limits.speed=19.1 mm/s"))
    moves = (StageMove(1, 1, targets={"group_b": 6 * MM}), StageJog(2, 2, "group_b", -19.1 * MM, 0.25))
    run = run_stage(slow, job(*moves))
    assert run.done, run.failure
    for made in run.moves:
        assert made.motors["group_b"].peak_hz == pytest.approx(250e3 / 66)


def test_zones_hold_in_a_run(spec):
    run = run_stage(spec, job(StageMove(1, 1, targets={"group_b": 10.5 * MM}), StageMove(2, 2, by={"group_b": 1 * MM})))
    assert run.moves[1].motors["group_b"].peak_hz <= 1000.0


def test_margin_and_time_against_the_start_frequency(spec):
    run = run_stage(spec, job(StageMove(1, 1, targets={"group_a": 4 * MM})))
    motor = run.moves[0].motors["group_a"]
    # The ramp divides the pull-out torque by 2 where torque is the limit.
    assert motor.margin == pytest.approx(2.0, rel=0.01)
    assert motor.naive == pytest.approx(800 / 400, rel=2e-4)
    assert run.least_margin == motor.margin


def test_lost_steps_are_told_and_do_not_end_the_job(spec):
    table = spec.stepper["group_a"]
    motor = table.motor.model_copy(update={"start_frequency": 8000.0})
    drive = table.drive.model_copy(update={"start_safety": 1.0})
    table = table.model_copy(update={"motor": motor, "drive": drive})
    bold = spec.model_copy(update={"stepper": spec.stepper | {"group_a": table}})
    run = run_stage(
        bold, job(StageMove(1, 1, targets={"group_a": 2 * MM}), StageMove(2, 2, targets={"group_b": 1 * MM}))
    )
    assert not run.done
    assert run.lost["group_a"] != 0
    assert "move 1: motor group_a lost" in run.failure
    assert len(run.moves) == 2


def test_a_rotor_that_is_not_at_rest_in_time_is_told(spec):
    hasty = spec.model_copy(
        update={"controller": spec.controller.model_copy(update={"settle_time": 0.0, "tolerance": 0.01})}
    )
    run = run_stage(hasty, job(StageMove(1, 1, targets={"group_a": 1 * MM})))
    assert not run.done
    assert "raise controller.settle_time" in run.failure


def test_a_fault_of_the_rule_ends_the_job(spec):
    host = StageHost(spec)
    motor = host.stage.motors["group_a"]
    legs = {"group_a": Leg(0, 400)}
    host.start(legs)
    motor.controller.stop_at = 150
    host.stage.wait_for(["group_a"], 1.0)
    acknowledge(motor.controller.rule)
    motor.tables.up.entries[150:] = -1  # a table that was cut off
    with pytest.raises(AxisError, match=STEP_FAULT_TEXT[INFEASIBLE][:40]):
        host.wait(legs)


@pytest.mark.parametrize(
    ("move", "words"),
    [
        (StageMove(1, 7, targets={"group_a": 41 * MM}), ["try.toml:7:1", "41 mm", "0 m to 40 mm", "go to 40 mm"]),
        (StageMove(1, 7, targets={"group_a": -1 * MM}), ["-1 mm", "go to 0 m"]),
        (StageMove(1, 7, by={"group_b": 31 * MM}), ["group_b", "31 mm", "30 mm"]),
        (StageMove(1, 7, targets={"group_a": 1 * MM}, turn=50 * MM), ["50 mm"]),
        (StageMove(1, 7, targets={"group_a": 20 * MM}, turn=15 * MM), ["turn", "15 mm", "beyond"]),
        (StageMove(1, 7, targets={"group_a": 20 * MM}, turn=20 * MM), ["turn", "beyond"]),
        (StageMove(1, 7, targets={"group_a": 20 * MM}, turn=0.0), ["turn", "beyond"]),
        (StageMove(1, 7, targets={"group_a": 1 * MM}, change=StopChange(2 * MM, 3 * MM)), ["changed_at", "2 mm"]),
        (StageMove(1, 7, targets={"group_a": 1 * MM}, change=StopChange(0.0, 3 * MM)), ["changed_at", "0 m"]),
        (StageMove(1, 7, targets={"group_a": 1 * MM}, change=StopChange(0.5 * MM, 50 * MM)), ["50 mm"]),
        (StageMove(1, 7, targets={"z": 1 * MM}), ["the motor z", "group_a, group_b"]),
        (StageJog(1, 7, "group_a", 30 * MM, 1.0), ["speed", "30 mm/s", "write 20 mm/s"]),
        (StageJog(1, 7, "group_a", 1e-9, 1.0), ["speed", "to 20 mm/s"]),
    ],
)
def test_what_the_axis_cannot_be_told_to_do_is_refused_before_it_moves(spec, move, words):
    with pytest.raises(InputError) as refused:
        run_stage(spec, job(move))
    assert all(word in str(refused.value) for word in words), refused.value


def test_a_nearest_place_that_is_offered_is_accepted(spec):
    assert run_stage(spec, job(StageMove(1, 1, targets={"group_b": 0.03}))).done


def test_plain_data(spec):
    run = run_stage(spec, job(StageMove(1, 1, targets={"group_a": 1 * MM})))
    data = json.loads(json.dumps(run.to_dict()))
    assert data["done"] is True
    assert data["moves"][0]["motors"]["group_a"]["steps"] == 200
    assert data["lost"] == {"group_a": 0, "group_b": 0}


def test_an_empty_run_has_no_worst():
    from detent.methods.stepper_envelope.run import StageRun

    run = StageRun(job())
    assert (run.worst_lag, run.least_margin, run.moves_per_second) == (0.0, math.inf, 0.0)


def test_the_usual_signals_are_those_of_every_motor(spec):
    assert {"group_a.plant.rotor.lag", "group_b.controller.rule.position"} <= set(stage_signals(spec))


def test_progress_is_told(spec):
    told: list[float] = []
    moves = (StageMove(1, 1, by={"group_a": 0.1 * MM}), StageMove(2, 2, by={"group_a": 0.1 * MM}))
    run_stage(spec, job(*moves), progress=lambda share, _: told.append(share))
    assert told == [0.5, 1.0]


def test_the_end_of_a_travel_that_is_no_whole_number_of_steps_is_its_last_step(spec):
    """A target at limits.travel was refused where the last whole step lies before it."""
    table = spec.stepper["group_b"]
    limits = table.limits.model_copy(update={"travel": 30 * MM + 4e-6})
    odd = spec.model_copy(update={"stepper": spec.stepper | {"group_b": table.model_copy(update={"limits": limits})}})
    run = run_stage(odd, job(StageMove(1, 1, targets={"group_b": 30 * MM + 4e-6})))
    assert run.done, run.failure
    assert run.moves[0].motors["group_b"].stop == pytest.approx(30 * MM)
    with pytest.raises(InputError, match=r"30\.02 mm"):
        run_stage(odd, job(StageMove(1, 1, targets={"group_b": 30.02 * MM})))
