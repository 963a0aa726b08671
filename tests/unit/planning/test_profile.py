import math

import numpy as np
import pytest
from tests.planned_jobs import plan_job

from detent.errors import DetentError
from detent.methods.moves.job import Move, MoveJob
from detent.planning import profile as profile_module
from detent.planning.profile import MotionLimits, plan_move, profile_of_recording

T = 1e-3
LIMITS = MotionLimits(speed=0.5, acceleration=5.0, jerk=100.0)


def joblist(*moves: Move) -> MoveJob:
    return MoveJob("moves.csv", "moves", moves)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_long_move_takes_the_time_of_its_seven_stretches(sign):
    """Way / speed + speed / acceleration + acceleration / jerk."""
    move = plan_move(0.25, 0.25 + sign * 0.2, LIMITS, T)
    assert move.count - 1 == math.ceil((0.2 / 0.5 + 0.5 / 5.0 + 5.0 / 100.0) / T - 1e-9)
    assert (move.position[0], move.velocity[0], move.acceleration[0]) == (0.25, 0.0, 0.0)
    assert (move.position[-1], move.velocity[-1], move.acceleration[-1]) == (0.25 + sign * 0.2, 0.0, 0.0)
    assert sign * move.velocity.max() if sign > 0 else -move.velocity.min() == pytest.approx(0.5, rel=1e-12)
    assert np.abs(move.acceleration).max() == pytest.approx(5.0, rel=1e-9)


@pytest.mark.parametrize("jerk", [100.0, math.inf])
@pytest.mark.parametrize("way", [0.2, 0.013, 1e-4, 1e-9])
def test_samples_are_those_of_ruckig(way, jerk):
    import ruckig

    asked, found = ruckig.InputParameter(1), ruckig.Trajectory(1)
    asked.current_position, asked.target_position = [-0.1], [-0.1 + way]
    asked.max_velocity, asked.max_acceleration, asked.max_jerk = [0.5], [5.0], [jerk]
    assert ruckig.Ruckig(1).calculate(asked, found) == ruckig.Result.Working
    move = plan_move(-0.1, -0.1 + way, MotionLimits(0.5, 5.0, jerk), T)
    assert (move.count - 2) * T < found.duration <= (move.count - 1) * T + 1e-12
    states = np.array([[part[0] for part in found.at_time(k * T)] for k in range(move.count - 1)])
    assert move.position[:-1] == pytest.approx(states[:, 0], abs=1e-14)
    assert move.velocity[:-1] == pytest.approx(states[:, 1], abs=1e-13)
    assert move.acceleration[:-1] == pytest.approx(states[:, 2], abs=1e-11)


def test_an_infinite_jerk_makes_a_trapezoid():
    move = plan_move(0.0, 0.2, MotionLimits(0.5, 5.0), T)
    assert move.count - 1 == 500  # 0.2 / 0.5 + 0.5 / 5
    t = move.t
    speed = np.minimum(np.minimum(5.0 * t, 0.5), 5.0 * (0.5 - t))
    assert move.velocity == pytest.approx(speed, abs=1e-12)
    assert set(np.round(move.acceleration, 9)) == {-5.0, 0.0, 5.0}
    assert move.position == pytest.approx(
        np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) * T / 2)]), abs=1e-12
    )


def test_a_short_move_is_a_triangle():
    move = plan_move(0.0, 0.02, MotionLimits(0.5, 5.0), T)
    assert move.count - 1 == math.ceil(2 * math.sqrt(0.02 / 5.0) / T)
    assert move.velocity.max() == pytest.approx(math.sqrt(0.02 * 5.0), rel=0.02)


def test_a_move_to_where_it_is_is_one_sample():
    move = plan_move(0.3, 0.3, LIMITS, T)
    assert (move.count, move.position[0], move.velocity[0], move.acceleration[0]) == (1, 0.3, 0.0, 0.0)


def test_moves_of_a_job_follow_one_another_with_their_dwells():
    job = joblist(Move(1, 2, target=0.1, dwell=0.0205), Move(2, 3, by=-0.05), Move(3, 4, target=0.05, dwell=0.01))
    whole, planned = plan_job(job, 0.0, LIMITS, T)
    first, second = plan_move(0.0, 0.1, LIMITS, T), plan_move(0.1, 0.05, LIMITS, T)
    assert [(m.number, m.start, m.target) for m in planned] == [(1, 0.0, 0.1), (2, 0.1, 0.05), (3, 0.05, 0.05)]
    assert [(m.begin, m.end, m.until) for m in planned] == [
        (0, first.count - 1, first.count + 20),
        (first.count + 20, first.count + 20 + second.count - 1, first.count + 20 + second.count - 1),
        (planned[1].until, planned[1].until, planned[1].until + 10),
    ]
    assert whole.count == planned[-1].until + 1
    assert np.array_equal(whole.position[: first.count - 1], first.position[:-1])
    assert np.array_equal(whole.position[planned[0].end : planned[0].until], np.full(21, 0.1))
    moving = slice(planned[1].begin, planned[1].end)
    for name in ("position", "velocity", "acceleration"):
        assert np.array_equal(getattr(whole, name)[moving], getattr(second, name)[:-1])
        assert getattr(whole, name).shape == (whole.count,)
    resting = np.r_[planned[0].end : planned[0].until, planned[1].end : whole.count]
    assert not whole.velocity[resting].any()
    assert not whole.acceleration[resting].any()
    assert whole.position[-1] == 0.05


def test_a_move_may_have_its_own_speed():
    whole, planned = plan_job(joblist(Move(1, 2, target=0.1, speed=0.05), Move(2, 3, target=0.0)), 0.0, LIMITS, T)
    assert whole.velocity[: planned[0].end].max() == pytest.approx(0.05)
    assert whole.velocity[planned[1].begin :].min() == pytest.approx(-0.5)


def test_a_sample_period_of_a_move_is_refused():
    with pytest.raises(DetentError, match=r"move 1: got a sample period of 0\.002 s"):
        plan_job(joblist(Move(1, 2, target=0.1, sample_period=2e-3)), 0.0, LIMITS, T)


def test_what_ruckig_does_not_find_is_said():
    with pytest.raises(DetentError, match=r"no profile from 0 m to 1 m within 0\.5 m/s"):
        plan_move(0.0, 1.0, MotionLimits(0.5, 1e-300, 1e300), T)


def test_a_profile_too_long_is_refused_before_it_is_made(monkeypatch):
    with pytest.raises(DetentError, match=r"2e\+07 samples, must be 10000000 or fewer"):
        plan_move(0.0, 1e4, LIMITS, T)
    monkeypatch.setattr(profile_module, "MOST_SAMPLES", 1000)
    with pytest.raises(DetentError, match="1e\\+07 samples, must be 1000"):
        plan_job(joblist(Move(1, 2, target=0.0, dwell=1e4)), 0.0, LIMITS, T)
    with pytest.raises(DetentError, match="1200 samples"):
        plan_job(joblist(*(Move(k, k, target=0.0, dwell=0.6) for k in (1, 2))), 0.0, LIMITS, T)


# -- recordings --------------------------------------------------------------------------------------------------------


def test_a_recording_at_the_period_of_the_loops_is_taken_as_it_is():
    t = 3.0 + np.arange(500) * T
    q = 0.1 * np.sin(20.0 * t)
    ref = profile_of_recording(t, q, T)
    assert ref.count == 500
    assert ref.position == pytest.approx(q, abs=1e-14)
    inside = slice(20, -20)
    assert ref.velocity[inside] == pytest.approx(2.0 * np.cos(20.0 * t)[inside], abs=1e-6)
    assert ref.acceleration[inside] == pytest.approx(-40.0 * np.sin(20.0 * t)[inside], abs=1e-2)


def test_a_recording_at_another_period_is_interpolated_within_its_time():
    t = np.arange(51) * 0.01
    ref = profile_of_recording(t, t**3, 3e-3)
    assert ref.count == 167
    assert ref.t[-1] == pytest.approx(0.498)
    assert ref.position == pytest.approx(ref.t**3, abs=1e-12)
    assert ref.velocity == pytest.approx(3 * ref.t**2, abs=1e-9)
    assert ref.acceleration == pytest.approx(6 * ref.t, abs=1e-7)


def test_recorded_derivatives_are_used():
    t = np.arange(200) * T
    q = np.round(0.0537 * t / 1e-5) * 1e-5
    steady, nothing = np.full(200, 0.0537), np.zeros(200)
    rough, with_v = profile_of_recording(t, q, T), profile_of_recording(t, q, T, steady)
    both = profile_of_recording(t, q, T, steady, nothing + 1.5)
    assert np.abs(rough.acceleration).max() > 1.0
    assert with_v.velocity == pytest.approx(steady, abs=1e-12)
    assert with_v.acceleration == pytest.approx(nothing, abs=1e-9)
    assert both.acceleration == pytest.approx(nothing + 1.5, abs=1e-9)


@pytest.mark.parametrize(
    ("t", "q", "text"),
    [
        ([0.0, 1.0, 1.0], [0.0, 0.0, 0.0], "does not increase"),
        ([0.0, 1.0], [0.0, math.nan], "not finite"),
        ([0.0, math.inf], [0.0, 1.0], "not finite"),
        ([0.0, 1.0, 2.0], [0.0, 1.0], r"shapes \(3,\), \(2,\)"),
        ([0.0], [0.0], "n 2 or more"),
        ([0.0, 1e9], [0.0, 1.0], "samples, must be"),
    ],
)
def test_recordings_that_are_none_are_refused(t, q, text):
    with pytest.raises(DetentError, match=text):
        profile_of_recording(np.array(t), np.array(q), T)


def test_a_way_of_a_rounding_error_begins_at_its_start():
    move = plan_move(0.0, 1.0581191106155033e-12, MotionLimits(1.0, 1.0, 19062.0), 1e-3)
    assert move.position.tolist() == [0.0, 1.0581191106155033e-12]
    assert move.velocity.tolist() == [0.0, 0.0]
