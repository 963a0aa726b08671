"""What multiplies each constant, and which windows may speak."""

from dataclasses import replace

import numpy as np
import pytest
from tests.identify_rig import Recorder

from detent.identify.fit.equations import (
    LOSS,
    LOST,
    TERMS,
    fine_kernel,
    is_bent,
    make_kernel,
    make_motion,
    model_columns,
    standstill_velocity,
    terms_of,
    usable_rows,
)

KERNEL = make_kernel(10, 2e-3)


@pytest.fixture(scope="module")
def run():
    return Recorder().run()


@pytest.fixture(scope="module")
def motion(run):
    return make_motion(run.position, run.effort, KERNEL, usable_rows(run, KERNEL))


def test_windows_know_position_velocity_and_acceleration(run, motion):
    q, v, a = Recorder().motion(run.t[motion.rows])
    assert motion.position == pytest.approx(q, abs=2e-5)
    assert motion.velocity == pytest.approx(v, abs=5e-4)
    assert motion.acceleration == pytest.approx(a, abs=0.01 * np.abs(a).max())


def test_constants_times_terms_are_the_force(motion):
    truth = Recorder().truth
    made = sum(truth[name] * TERMS[name](motion, 1.0) for name in truth)
    assert made == pytest.approx(KERNEL.held(Recorder(force_noise=0.0).run().effort, motion.rows), abs=1e-3)


def test_terms_of_both_directions_add_up_to_those_of_one(motion):
    for name in ("coulomb", "viscous"):
        both = TERMS[f"{name}.positive"](motion, 1.0) + TERMS[f"{name}.negative"](motion, 1.0)
        assert both == pytest.approx(TERMS[name](motion, 1.0), abs=1e-12)


def test_friction_terms_point_along_the_motion(motion):
    right = motion.velocity > 0
    assert TERMS["coulomb"](motion, 1.0) == pytest.approx(np.where(right, 1.0, -1.0))
    assert (TERMS["coulomb.negative"](motion, 1.0)[right] == 0).all()
    assert (TERMS["viscous.positive"](motion, 1.0)[~right] == 0).all()


def test_low_speed_friction_fades_with_speed(run, motion):
    v = motion.velocity
    found = TERMS["excess.positive"](motion, 0.05)
    assert found[v > 0] == pytest.approx(np.exp(-((v[v > 0] / 0.05) ** 2)), abs=0.02)
    assert (found[v < 0] == 0).all()
    assert (TERMS["excess.negative"](motion, 0.05)[v < 0] < 0).any()
    mirrored = make_motion(-run.position, -run.effort, KERNEL, motion.rows)
    assert TERMS["excess.negative"](mirrored, 0.05) == pytest.approx(-found)


def test_weights_by_angle(motion):
    assert TERMS["pendulum"](motion, 1.0) == pytest.approx(np.sin(motion.position), abs=1e-4)
    assert TERMS["pendulum.across"](motion, 1.0) == pytest.approx(np.cos(motion.position), abs=1e-4)
    assert TERMS["spring"](motion, 1.0) is motion.position
    assert (TERMS["offset"](motion, 1.0) == 1).all()


def test_a_lossy_transmission_bends_every_column(run, motion):
    names = ("mass", "coulomb", LOSS)
    assert terms_of(names) == ("mass", "coulomb")
    assert is_bent(names)
    assert is_bent(("mass", "excess.positive"))
    assert not is_bent(("mass", "coulomb"))
    plain = model_columns(motion, ("mass", "coulomb"), 1.0)
    assert model_columns(motion, names, 0.0) == pytest.approx(plain)
    found = model_columns(motion, names, 0.2) / plain
    # Effort along the motion loses a fifth, effort that brakes gains it: F (1 - 0.2 sign(F v)) is what moves.
    along = np.sign(run.effort)[motion.rows] * np.sign(motion.velocity)
    clear = np.abs(KERNEL.held(run.effort, motion.rows)) > 0.5
    assert found[clear & (along > 0)] == pytest.approx(1 / 0.8)
    assert found[clear & (along < 0)] == pytest.approx(1 / 1.2)


def test_no_window_holds_a_reversal(run):
    rows = usable_rows(run, KERNEL)
    assert len(rows) > 800
    v = Recorder().motion(run.t)[1]
    for row in rows.tolist():
        inside = v[row - KERNEL.half : row + KERNEL.half + 1]
        assert (inside > 0).all() or (inside < 0).all()


def test_no_window_holds_a_sample_that_means_nothing(run):
    bad = run.usable.copy()
    bad[1234:1240] = False
    rows = usable_rows(replace(run, usable=bad), KERNEL)
    near = np.abs(rows - 1236.5) < KERNEL.half + 3
    assert not near.any()
    assert set(rows.tolist()) < set(usable_rows(run, KERNEL).tolist())


def test_no_window_stands_still():
    run = Recorder(count=1e-6).run()
    stands = run.position.copy()
    stands[1000:2000] = stands[1000]
    rows = usable_rows(replace(run, position=stands), KERNEL)
    # The short window tells standstill once all of it stands.
    reach = KERNEL.half - fine_kernel(KERNEL).half
    assert not ((rows > 1000 - reach) & (rows < 2000 + reach)).any()
    assert (rows > 2000).any()


def test_noise_makes_slow_motion_look_like_standstill(run):
    fine = fine_kernel(KERNEL)
    assert standstill_velocity(run, fine) == 0.0
    noisy = replace(run, noise=1e-5)
    limit = standstill_velocity(noisy, fine)
    scatter = fine.velocities(1e-5 * np.random.default_rng(1).standard_normal(5000))
    assert limit == pytest.approx(5 * scatter[50:-50].std(), rel=0.1)
    coarse = replace(run, resolution=1e-3)
    assert standstill_velocity(coarse, fine) == pytest.approx(0.5 * 1e-3 / (2 * fine.half * fine.step))
    assert len(usable_rows(noisy, KERNEL)) < len(usable_rows(run, KERNEL))


def test_the_short_window_is_never_longer_than_the_long_one():
    assert fine_kernel(make_kernel(4, 1e-3)).half == 4
    assert fine_kernel(make_kernel(40, 1e-3)).half == 6
    assert fine_kernel(make_kernel(40, 1e-4)).half == 40


@pytest.mark.parametrize("share", [1e-3, 0.02, 0.3, 3.0])
@pytest.mark.parametrize(("way", "sense"), [("positive", 1), ("negative", -1)])
def test_low_speed_friction_of_windows_is_that_of_all_samples(motion, way, sense, share):
    """Windows that see nothing slow are not added up."""
    stribeck, speed = share * float(np.abs(motion.quick).max()), sense * motion.quick
    left = np.where(speed > 0.0, np.exp(-np.minimum((speed / stribeck) ** 2, LOST)), 0.0)
    found = TERMS[f"excess.{way}"](motion, stribeck)
    assert found == pytest.approx(sense * motion.kernel.mean(left, motion.rows), rel=1e-12, abs=1e-21)


def test_a_loss_lets_columns_grow_where_the_effort_drives(run, motion):
    loss, with_motion = 0.3, np.sign(run.effort) * np.sign(motion.quick)
    grown = motion.kernel.mean(1.0 / (1.0 - loss * with_motion), motion.rows)
    assert model_columns(motion, ("mass", LOSS), loss)[:, 0] == pytest.approx(motion.acceleration * grown, rel=1e-12)


def test_sums_near_the_ends_are_those_of_a_signal_that_goes_on(run):
    n, wide = len(run.position), make_kernel(10, 2e-3)
    rows = np.array([0, 5, 10, n // 2, n - 11, n - 1])
    padded = np.r_[np.full(50, run.effort[0]), run.effort, np.full(50, run.effort[-1])]
    assert wide.mean(run.effort, rows).tolist() == wide.mean(padded, rows + 50).tolist()
    still = np.r_[np.full(50, run.position[0]), run.position, np.full(50, run.position[-1])]
    for of in (wide.velocity, wide.acceleration, wide.jerk):
        assert of(run.position, rows).tolist() == of(still, rows + 50).tolist()
