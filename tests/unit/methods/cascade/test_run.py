"""Lists of moves on a cascade axis: what arrives, what its drive goes off for, and what cannot be commanded."""

import math

import numpy as np
import pytest

import detent
from detent.errors import DetentError, InputError
from detent.methods.cascade.host import cascade_registers
from detent.methods.cascade.run import (
    CASCADE_SIGNALS,
    COAST,
    check_cascade_job,
    run_cascade_moves,
)
from detent.methods.load import load_spec
from detent.methods.moves.job import Move, MoveJob, load_moves
from detent.record.recorder import Recorder, choose_leaves

pytestmark = pytest.mark.compiled


def linear(*overrides):
    return load_spec(detent.example("cascade.toml"), overrides)


def rotary(*overrides):
    return load_spec(detent.example("turntable.toml"), overrides)


def job(*moves):
    return MoveJob("job", "moves", tuple(Move(number=n, row=n, **move) for n, move in enumerate(moves, 1)))


THERE_AND_BACK = job({"target": 0.12, "dwell": 0.1}, {"by": -0.1})


@pytest.fixture(scope="module")
def slide():
    return run_cascade_moves(linear(), load_moves(detent.example("slide_moves.toml")))


def test_every_move_is_in_position_and_the_load_stands_at_its_target(slide):
    assert slide.done
    assert slide.failure == ""
    assert slide.warnings == []
    assert len(slide.moves) == 24
    assert math.isnan(slide.time_off)
    for move in slide.moves:
        assert move.in_position
        assert abs(move.error) < slide.tolerance
        assert move.begin < move.arrived < move.ready <= move.end
        assert move.approach >= 0.0
        assert move.settling == pytest.approx(move.settled - move.begin)
        assert move.approach == pytest.approx(max(0.0, move.settling - (move.arrived - move.begin)))
        assert move.peak_command < slide.max_command
        assert move.limited == 0.0
    assert slide.moves[-1].target == pytest.approx(0.01)
    assert slide.worst_following == max(move.peak_following for move in slide.moves) < 1e-4


def test_a_move_takes_the_time_of_its_profile_and_waits_for_its_dwell(slide):
    first, second = slide.moves[:2]
    # 100 mm at 80 mm/s with 5 m/s^2 and 200 m/s^3: way / v + v / a + a / j, in whole samples.
    assert first.arrived - first.begin == pytest.approx(1.25 + 0.016 + 0.025, abs=2e-3)
    assert first.ready - first.arrived == pytest.approx(0.05, abs=1e-3)
    assert first.end - first.ready == pytest.approx(0.2, abs=1e-3)
    assert second.begin == first.end


def test_a_move_has_its_own_speed_else_that_of_the_axis(slide):
    peaks = [move.peak_speed for move in slide.moves]
    assert peaks[0] == pytest.approx(0.08, rel=0.02)
    assert peaks[22] == pytest.approx(0.5, rel=0.01)


def test_the_same_axis_gives_the_same_bytes_recorded_or_not():
    spec = linear()

    def recorded():
        blocks = []
        recorder = Recorder(cascade_registers(spec), CASCADE_SIGNALS, every=3, period=spec.method.sample_period)
        recorder.pass_on(blocks.append, 0)
        run = run_cascade_moves(spec, THERE_AND_BACK, recorder=recorder)
        return run.to_dict(), np.concatenate(blocks).tobytes()

    first, second = recorded(), recorded()
    assert first[1] == second[1]
    assert repr(first[0]) == repr(second[0]) == repr(run_cascade_moves(spec, THERE_AND_BACK).to_dict())


def test_every_signal_is_a_register():
    assert len(choose_leaves(cascade_registers(linear()), CASCADE_SIGNALS)) == len(CASCADE_SIGNALS)


def test_a_rotary_axis_goes_to_its_angles_by_the_encoder_of_its_load():
    run = run_cascade_moves(rotary(), load_moves(detent.example("turn_moves.csv"), rotary=True))
    assert run.done, run.failure
    assert [round(math.degrees(move.target)) for move in run.moves] == [90, 180, 270, 275, 0]
    assert run.worst_error < run.tolerance


def test_a_rotary_file_is_read_in_degrees_and_a_length_refused():
    found = load_moves(detent.example("turn_moves.csv"), rotary=True)
    assert found.moves[3].by == pytest.approx(math.radians(5))
    assert found.moves[3].speed == pytest.approx(math.radians(10))
    with pytest.raises(InputError, match="an angle"):
        load_moves(detent.example("slide_moves.toml"), rotary=True)
    with pytest.raises(InputError, match="a length"):
        load_moves(detent.example("turn_moves.csv"))


def failed(spec, *moves):
    run = run_cascade_moves(spec, job(*moves) if moves else THERE_AND_BACK)
    assert not run.done
    assert run.time_end == pytest.approx(run.time_off + COAST, abs=1e-3)
    return run


def test_a_following_error_beyond_its_limit_switches_the_drive_off():
    run = failed(linear("method.following_error=15 um", "method.in_position=5 um"))
    assert run.failure.startswith("move 1 to 120 mm: the following error exceeded 15 um, method.following_error, and")
    (move,) = run.moves
    assert not move.in_position
    # In the first sample beyond it, not one later.
    assert 15e-6 < move.peak_following < 17e-6
    assert math.isnan(move.arrived)
    assert math.isnan(move.ready)
    assert math.isnan(move.settling)
    assert math.isnan(move.approach)
    assert run.worst_error == 0.0


def test_a_load_beyond_its_way_switches_the_drive_off():
    push = ("disturbance.push.force=-2000 N", "disturbance.push.at=0.2 s", "disturbance.push.duration=1 s")
    spec = linear(*push, "mechanics.start_position=1 mm")
    run = failed(spec, {"target": 0.0, "dwell": 1.0})
    assert "overran the lower end of travel, 0 m, limits.lowest, and the drive is off" in run.failure


@pytest.mark.parametrize(
    ("axis", "force", "cause"),
    [
        (linear, "-700 N", "following error"),
        (linear, "900 N", "following error"),
        (linear, "-2000 N", "ran faster than"),
        (rotary, "3.6 N*m", "following error"),
        (rotary, "6 N*m", "ran faster than"),
        (rotary, "-4.5 N*m", "ran faster than"),
    ],
)
def test_a_push_beyond_the_force_of_the_drive_ends_with_what_comes_of_it(axis, force, cause):
    push = (f"disturbance.push.force={force}", "disturbance.push.at=0.6 s", "disturbance.push.duration=2 s")
    assert cause in failed(axis(*push), {"target": 0.12, "dwell": 3.0}).failure


def test_an_axis_that_does_not_come_into_its_window_in_time_has_failed():
    spec = linear(
        "method.velocity_integral=0 V/m", "method.in_position=1 um", "method.timeout=0.3 s", "encoder.resolution=0.1 um"
    )
    run = failed(spec, {"target": 0.12})
    assert "not in position within 300 ms of the end of the reference (method.timeout): its error is" in run.failure
    assert run.moves[0].arrived == pytest.approx(run.time_off - 0.3, abs=1e-3)


def test_an_axis_that_is_not_in_position_after_power_on_makes_no_move():
    spec = linear("mechanics.weight=300 N", "method.velocity_integral=0 V/m", "method.timeout=0.3 s")
    run = failed(spec)
    assert run.failure.startswith("after power-on: not in position within 300 ms")
    assert run.moves == []


def test_a_force_beyond_that_of_the_drive_moves_the_axis_over_its_end():
    run = failed(linear("mechanics.weight=900 N", "method.following_error=100 m"))
    assert run.failure.startswith("after power-on: the axis overran the lower end")


def test_a_command_that_stays_at_its_limit_switches_the_drive_off():
    far = ("method.following_error=100 m", "limits.lowest=-1000 m", "limits.travel=2000 m")
    spec = linear("mechanics.weight=900 N", *far, "protection.overspeed=0", "protection.jump=0")
    run = failed(spec)
    assert "the command stayed at its limit for 1 s, and the drive is off" in run.failure
    assert run.time_off == pytest.approx(spec.protection.saturation_time, abs=0.05)


def test_a_load_that_the_loop_does_not_see_is_warned_about():
    spec = linear("mechanics.coupling.backlash=0.4 mm", "disturbance.push.force=-60 N", "disturbance.push.at=0 s",
                  "disturbance.push.duration=60 s")  # fmt: skip
    run = run_cascade_moves(spec, THERE_AND_BACK)
    assert run.done
    assert run.worst_error > run.tolerance
    (text,) = run.warnings
    assert "2 of 2 moves were in position while the load was off target, move" in text


def test_moves_that_the_axis_cannot_make_are_refused_with_their_lines():
    wrong = job({"target": 0.6}, {"by": 0.2, "speed": 0.7}, {"target": 0.1, "sample_period": 1e-3})
    with pytest.raises(InputError) as caught:
        run_cascade_moves(linear(), wrong)
    told = [(problem.line, problem.key, problem.got) for problem in caught.value.problems]
    assert told == [
        (1, "target", "600 mm"), (2, "by", "800 mm"), (2, "speed", "700 mm/s"), (3, "sample_period", "1 ms"),
    ]  # fmt: skip
    with pytest.raises(InputError, match=r"got 400 deg; expected: a position .* -360 deg to 360 deg"):
        check_cascade_job(rotary(), job({"target": math.radians(400)}))


def test_a_move_too_slow_for_any_profile_is_refused():
    with pytest.raises(DetentError, match="a profile of"):
        run_cascade_moves(linear(), job({"target": 0.4, "speed": 1e-6}))


def test_progress_is_told_to_the_end():
    told = []
    run_cascade_moves(linear(), THERE_AND_BACK, progress=lambda share, text: told.append((share, text)))
    assert told == [(0.5, "move 1 of 2"), (1.0, "move 2 of 2")]


def test_a_run_of_an_unstable_loop_is_not_green(slide):
    unstable = run_cascade_moves(linear("method.velocity_gain=3000 V*s/m"), THERE_AND_BACK)
    assert (slide.level, unstable.level, unstable.done) == ("good", "warn", True)
    assert unstable.doubt.startswith("the command was at its limit for ")
