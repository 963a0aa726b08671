"""The window: exact where mathematics says so, and the same equation of motion on both of its sides."""

import numpy as np
import pytest

from detent.identify.fit.equations import make_kernel

STEP = 1e-3
ROWS = np.arange(40, 260)


@pytest.fixture(scope="module")
def kernel():
    return make_kernel(12, STEP)


def powers(power):
    t = (np.arange(300) - 150) * STEP
    return t, t**power


def test_polynomials_come_out_exactly(kernel):
    t, line = powers(1)
    _, parabola = powers(2)
    _, cubic = powers(3)
    one = np.ones(300)
    assert kernel.mean(one, ROWS) == pytest.approx(1.0, abs=1e-12)
    assert kernel.mean(line, ROWS) == pytest.approx(t[ROWS], abs=1e-12)
    assert kernel.velocity(one, ROWS) == pytest.approx(0.0, abs=1e-9)
    assert kernel.velocity(line, ROWS) == pytest.approx(1.0, rel=1e-9)
    assert kernel.velocity(parabola, ROWS) == pytest.approx(2 * t[ROWS], abs=1e-9)
    assert kernel.acceleration(one, ROWS) == pytest.approx(0.0, abs=1e-6)
    assert kernel.acceleration(line, ROWS) == pytest.approx(0.0, abs=1e-6)
    assert kernel.acceleration(parabola, ROWS) == pytest.approx(2.0, rel=1e-9)
    assert kernel.acceleration(cubic, ROWS) == pytest.approx(6 * t[ROWS], abs=1e-6)
    assert kernel.jerk(parabola, ROWS) == pytest.approx(0.0, abs=1e-4)
    assert kernel.jerk(cubic, ROWS) == pytest.approx(6.0, rel=1e-6)


def test_a_held_signal_is_half_a_step_later_than_its_samples(kernel):
    t, line = powers(1)
    assert kernel.held(line, ROWS) == pytest.approx(t[ROWS] - 0.5 * STEP, abs=1e-9)
    assert kernel.held(np.ones(300), ROWS) == pytest.approx(1.0, abs=1e-12)
    assert kernel.held_slope(line, ROWS) == pytest.approx(1.0, rel=1e-6)


@pytest.mark.parametrize("late", [0.0, 0.31, 1.0, 2.75, -0.4])
def test_a_signal_that_acts_later_is_seen_later(kernel, late):
    t, line = powers(1)
    assert kernel.held(line, ROWS, late) == pytest.approx(t[ROWS] - (0.5 + late) * STEP, abs=1e-9)


def test_whole_samples_of_delay_are_a_shift(kernel):
    signal = np.random.default_rng(1).standard_normal(300)
    for late in (1, 3):
        assert kernel.held(signal, ROWS, float(late)) == pytest.approx(kernel.held(signal, ROWS - late), abs=1e-12)
        assert kernel.held_slope(signal, ROWS, float(late)) == pytest.approx(
            kernel.held_slope(signal, ROWS - late), abs=1e-9
        )


@pytest.mark.parametrize("late", [0.0, 0.4, 1.7])
def test_a_held_mean_is_the_integral_over_what_stands(kernel, late):
    """Compared with an integral in steps of a hundredth of a sample."""
    signal = np.random.default_rng(2).standard_normal(300)
    fine = (np.arange(-1300, 1300) + 0.5) / 100
    window = np.where(np.abs(fine) < 12, (1 - (fine / 12) ** 2) ** 4, 0.0)
    window /= window.sum()
    row = 150
    standing = signal[np.floor(row + fine - late).astype(int)]
    assert kernel.held(signal, np.array([row]), late)[0] == pytest.approx(float(window @ standing), abs=1e-5)


def test_the_slope_is_how_a_held_mean_changes_with_the_delay(kernel):
    signal = np.random.default_rng(3).standard_normal(300)
    little = 1e-4
    change = kernel.held(signal, ROWS, 0.6 - little) - kernel.held(signal, ROWS, 0.6 + little)
    assert kernel.held_slope(signal, ROWS, 0.6) == pytest.approx(change / (2 * little * STEP), rel=1e-5, abs=1e-3)


def test_a_held_force_and_the_motion_that_it_makes_agree(kernel):
    """A free mass under white force, moved exactly from sample to sample: the worst case for sums over samples."""
    force = np.random.default_rng(4).standard_normal(300)
    velocity = np.concatenate([[0.0], np.cumsum(force)[:-1]]) * STEP
    position = np.concatenate([[0.0], np.cumsum(velocity * STEP + 0.5 * STEP**2 * force)[:-1]])
    assert kernel.acceleration(position, ROWS) == pytest.approx(kernel.held(force, ROWS), abs=5e-4)


def test_velocities_at_every_sample(kernel):
    position = np.sin(np.arange(300) * 0.03)
    assert kernel.velocities(position)[ROWS] == pytest.approx(kernel.velocity(position, ROWS), abs=1e-9)
    assert len(kernel.velocities(position)) == 300


def test_the_corner_is_where_a_sine_loses_three_decibels():
    kernel = make_kernel(40, STEP)
    wave = np.sin(2 * np.pi * 0.40 / 40 * np.arange(3000))
    assert np.abs(kernel.mean(wave, np.arange(100, 2900))).max() == pytest.approx(0.7, abs=0.05)


def test_the_step_is_the_unit_of_time():
    ours, theirs = make_kernel(9, 1.0), make_kernel(9, 0.5)
    assert theirs.value == pytest.approx(ours.value)
    assert theirs.first == pytest.approx(2 * ours.first)
    assert theirs.second == pytest.approx(4 * ours.second)
    assert theirs.third == pytest.approx(8 * ours.third)
