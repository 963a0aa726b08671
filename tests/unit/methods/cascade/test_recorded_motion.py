"""Motion from recorded positions: velocities, where a recording begins in motion, a reference that stands."""

import numpy as np
import pytest
from tests.planned_jobs import plan_job

from detent.methods.cascade.replay import recorded_profile, smooth_velocity, starting_velocity
from detent.methods.moves.job import Move, MoveJob
from detent.planning.profile import MotionLimits, plan_move


def test_a_reference_that_stands_has_no_derivatives():
    profile, _ = plan_job(
        MoveJob("m", "moves", (Move(number=1, row=1, target=0.1, dwell=0.2), Move(number=2, row=2, target=0.0))),
        0.0, MotionLimits(0.5, 5.0), 1e-3,
    )  # fmt: skip
    again = recorded_profile(profile.t, profile.position, 1e-3)
    assert again.position == pytest.approx(profile.position, abs=1e-12)
    stands = np.flatnonzero(profile.velocity == 0.0)[8:-8]
    rests = stands[(np.diff(profile.position)[stands - 6] == 0) & (np.diff(profile.position)[stands + 5] == 0)]
    assert len(rests) > 100
    assert (again.velocity[rests] == 0.0).all()
    assert (again.acceleration[rests] == 0.0).all()
    moving = np.abs(profile.velocity) > 0.1
    assert again.velocity[moving] == pytest.approx(profile.velocity[moving], abs=5e-3)


def test_velocity_of_positions_is_that_of_the_motion_below_the_cutoff():
    t = np.arange(4000) * 1e-3
    position = 0.1 * np.sin(2 * np.pi * 2 * t)
    velocity = smooth_velocity(t, position)
    assert velocity[500:-500] == pytest.approx((0.4 * np.pi * np.cos(2 * np.pi * 2 * t))[500:-500], abs=2e-4)
    few = smooth_velocity(t[:5], position[:5])
    assert few == pytest.approx(np.gradient(position[:5], t[:5]))


def test_an_axis_that_sets_off_with_its_recording_begins_at_rest():
    move = plan_move(0.0, 0.1, MotionLimits(0.2, 2.0, 80.0), 1e-3)
    assert starting_velocity(move.t, move.position) == 0.0
    counts = np.round(move.position / 1e-6) * 1e-6
    assert starting_velocity(move.t, counts) == 0.0


def test_an_axis_at_rest_has_no_velocity_from_the_scatter_of_its_encoder():
    t, random = np.arange(100) * 1e-3, np.random.default_rng(3)
    found = [starting_velocity(t, 1e-6 * random.standard_normal(100)) for _ in range(200)]
    assert np.count_nonzero(found) <= 6
    assert starting_velocity(t, np.full(100, 0.3)) == 0.0
    assert starting_velocity(t[:5], t[:5]) == 0.0


@pytest.mark.parametrize("begin", [60, 150, 300])
def test_a_recording_that_begins_in_motion_has_its_velocity(begin):
    move = plan_move(0.0, 0.1, MotionLimits(0.2, 2.0, 80.0), 1e-3)
    found = starting_velocity(3.0 + move.t[begin:], np.round(move.position[begin:] / 1e-7) * 1e-7)
    assert found == pytest.approx(move.velocity[begin], rel=0.02)
