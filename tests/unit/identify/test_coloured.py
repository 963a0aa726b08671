"""Limits under coloured residuals: they hold as often as they say, where those of independent residuals do not."""

import numpy as np
import pytest
from scipy.signal import lfilter
from tests.identify_rig import binomial_bounds

from detent.identify.coloured import (
    coloured_covariance,
    count_cosines,
    fallen_density,
    independent_rows,
    long_run_variance,
)
from detent.identify.estimate import quantile


def autoregressive(rng, shape, memory):
    """Noise of a variance of 1 along the last axis, each value remembering its neighbour."""
    white = rng.standard_normal((*shape[:-1], shape[-1] + 200))
    return lfilter([np.sqrt(1 - memory**2)], [1.0, -memory], white)[..., 200:]


@pytest.mark.parametrize("memory", [0.0, 0.5, 0.9])
def test_independent_rows_of_coloured_noise(memory):
    rng = np.random.default_rng(2)
    found = np.median([independent_rows(row) for row in autoregressive(rng, (50, 4000), memory)])
    assert found == pytest.approx(4000 * (1 - memory) / (1 + memory), rel=0.05)


def test_independent_rows_have_their_limits():
    assert independent_rows(np.ones(500)) == pytest.approx(500 * 0.01 / 1.99)
    assert independent_rows(np.tile([1.0, -1.0], 250)) == 500
    assert independent_rows(np.zeros(50)) == 50


def test_strongly_coloured_residuals_leave_few_degrees_of_freedom():
    assert count_cosines(1000, 1000) == round(0.41 * 100)
    assert count_cosines(1000, 20) == 6
    assert count_cosines(1000, 1) == 4


def test_the_density_falls_over_the_cosines_that_are_used():
    """Against the mean of the density itself, taken cosine by cosine."""
    r, rows, cosines = 0.9, 2000, 40
    angles = np.pi * np.arange(1, cosines + 1) / rows
    density = (1 - r) ** 2 / np.abs(1 - r * np.exp(-1j * angles)) ** 2
    assert fallen_density(r, rows, cosines) == pytest.approx(density.mean(), rel=0.02)
    assert fallen_density(0.0, rows, cosines) == 1.0


@pytest.mark.parametrize("memory", [0.0, 0.7])
def test_the_long_run_variance_of_coloured_noise(memory):
    """That of an autoregression is its variance times (1 + r) / (1 - r)."""
    rng = np.random.default_rng(3)
    rows = autoregressive(rng, (200, 1500), memory)
    found = np.mean([long_run_variance(row[:, None], 20)[0, 0] for row in rows])
    assert found == pytest.approx((1 + memory) / (1 - memory), rel=0.08)


def regressions(rng, count, memory):
    """Fits of an axis that goes to and fro under coloured noise: whether each interval holds, by both ways."""
    n = 600
    phase = np.linspace(0.0, 2 * np.pi, n)
    columns = np.column_stack([np.sin(7 * phase), np.cos(7 * phase), np.sign(np.cos(7 * phase + 0.3))])
    noise = autoregressive(rng, (count, n), memory)
    found = noise @ np.linalg.pinv(columns).T
    held, plain = [], []
    inverse = np.linalg.inv(columns.T @ columns)
    for theta, row in zip(found, noise, strict=True):
        residual = row - columns @ theta
        covariance, degrees = coloured_covariance(columns, residual)
        held.append(np.abs(theta) < quantile(degrees) * np.sqrt(np.diag(covariance)))
        plain.append(np.abs(theta) < 1.96 * np.sqrt(np.diag(inverse) * np.var(residual)))
    return np.array(held), np.array(plain)


@pytest.mark.parametrize("memory", [0.0, 0.6, 0.9])
def test_intervals_hold_as_often_as_they_say(memory):
    held, plain = regressions(np.random.default_rng(4), 300, memory)
    low, _ = binomial_bounds(300)
    assert held.mean(axis=0).min() >= low
    # The larger of two looks at the variance is taken: where residuals are worth few independent ones, it is cautious.
    assert held.mean(axis=0).max() <= 0.99
    # Limits for independent residuals promise too much.
    assert plain.mean() < {0.0: 1.0, 0.6: 0.8, 0.9: 0.7}[memory]


def test_instruments_widen_the_limits_of_a_weak_one():
    rng = np.random.default_rng(5)
    x = rng.standard_normal((500, 1))
    weak = 0.5 * x + np.sqrt(0.75) * rng.standard_normal((500, 1))
    noise = rng.standard_normal(500)
    own, _ = coloured_covariance(x, noise)
    by_weak, _ = coloured_covariance(x, noise, weak)
    # The variance of an instrument's estimate is that of least squares over the square of the correlation.
    assert by_weak[0, 0] / own[0, 0] == pytest.approx(4.0, rel=0.6)


def test_the_unit_of_a_column_is_of_no_matter():
    rng = np.random.default_rng(6)
    columns, noise = rng.standard_normal((400, 3)), autoregressive(rng, (400,), 0.6)
    scale = np.array([1.0, 1e-6, 1e4])
    ours, _ = coloured_covariance(columns, noise)
    theirs, _ = coloured_covariance(columns * scale, noise)
    assert theirs * np.outer(scale, scale) == pytest.approx(ours, rel=1e-6)


def test_residuals_of_uneven_size_count_where_they_are():
    """Noise only where a column is large makes that constant worse than noise everywhere of the same power."""
    rng = np.random.default_rng(7)
    n = 2000
    column = np.where(np.arange(n) < n // 4, 1.0, 0.1)[:, None]
    white = rng.standard_normal(n)
    there = np.where(np.arange(n) < n // 4, 2.0, 0.0) * white
    everywhere, _ = coloured_covariance(column, white)
    uneven, _ = coloured_covariance(column, there)
    assert uneven[0, 0] > 2.5 * everywhere[0, 0]


def test_a_column_of_zeros_does_no_harm_to_the_others():
    rng = np.random.default_rng(8)
    column, noise = rng.standard_normal((300, 1)), rng.standard_normal(300)
    both, _ = coloured_covariance(np.hstack([column, np.zeros((300, 1))]), noise)
    alone, _ = coloured_covariance(column, noise)
    assert np.isfinite(both).all()
    assert both[0, 0] == pytest.approx(alone[0, 0], rel=0.02)
