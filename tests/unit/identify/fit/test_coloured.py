"""Limits under coloured residuals: they hold as often as they say, where those of independent residuals do not."""

import numpy as np
import pytest
from scipy import fft
from scipy.signal import lfilter
from tests.identify_rig import binomial_bounds

from detent.identify.fit.estimate import (
    _lagged_variance,
    carried_degrees,
    coloured_covariance,
    count_cosines,
    fallen_density,
    independent_rows,
    long_run_variance,
    quantile,
)


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


def test_the_same_weight_in_all_rows_leaves_the_degrees_of_the_cosines():
    ones, white = np.ones((4000, 1)), autoregressive(np.random.default_rng(6), (4000,), 0.0)
    assert carried_degrees(ones, white, ones, 40).tolist() == [40.0]


def test_degrees_are_those_of_the_rows_that_carry_a_constant():
    """Three rows out of a thousand carry the second constant, thirty the third; a column of zeros has one degree."""
    columns = np.column_stack([np.ones(1000), np.zeros(1000), np.zeros(1000), np.zeros(1000)])
    columns[[100, 400, 800], 1] = 1.0, -1.0, 1.0
    columns[20::33, 2] = np.resize([1.0, -1.0], 30)
    white = np.random.default_rng(6).standard_normal(1000)
    found = carried_degrees(columns, white, columns, 40)
    assert found == pytest.approx([40.0, 3.0, 30.0, 1.0], rel=0.05)
    coloured = autoregressive(np.random.default_rng(6), (1000,), 0.8)
    assert carried_degrees(columns, coloured, columns, 40)[2] == pytest.approx(30 * 0.36 / 1.64, rel=0.2)


def test_intervals_hold_for_a_constant_that_few_rows_carry():
    """As a jerk that is large in few windows: with the degrees of the cosines alone they are too short."""
    rng = np.random.default_rng(7)
    columns = np.column_stack([np.sin(np.linspace(0.0, 40.0, 800)), np.zeros(800)])
    columns[rng.choice(800, 8, replace=False), 1] = 1.0
    held, short = [], []
    for noise in rng.standard_normal((1000, 800)):
        theta = np.linalg.pinv(columns) @ noise
        residual = noise - columns @ theta
        covariance, cosines = coloured_covariance(columns, residual)
        error = np.sqrt(np.diag(covariance))
        held.append(
            np.abs(theta)
            < np.array([quantile(d) for d in carried_degrees(columns, residual, columns, cosines)]) * error
        )
        short.append(np.abs(theta) < quantile(cosines) * error)
    low, _ = binomial_bounds(1000, doubt=1e-3)
    assert np.mean(held, axis=0).min() > low
    assert np.mean(short, axis=0)[1] < low


@pytest.mark.parametrize("rows", [4, 5, 24, 25, 2452])
def test_its_cosines_are_scipys(rows):
    scores = np.random.default_rng(rows).normal(size=(rows, 3))
    cosines = min(40, rows)
    projected = fft.dct(scores, axis=0, norm="ortho")[1 : cosines + 1]
    expected = projected.T @ projected / len(projected)
    assert long_run_variance(scores, cosines) == pytest.approx(expected, rel=1e-11, abs=1e-13)


@pytest.mark.parametrize(("rows", "memory"), [(12, 1.0), (300, 20.0), (2452, 2.0)])
def test_its_lags_are_those_added_up_one_by_one(rows, memory):
    scores = autoregressive(np.random.default_rng(rows), (2, rows), 0.8).T
    lags = min(round(max(4.0, 0.75 * rows ** (1.0 / 3.0), 3.0 * memory)), rows - 1)
    expected = scores.T @ scores
    for lag in range(1, lags + 1):
        product = scores[lag:].T @ scores[:-lag]
        expected += (1.0 - lag / (lags + 1.0)) * (product + product.T)
    assert _lagged_variance(scores, memory) == pytest.approx(expected / rows, rel=1e-10, abs=1e-12)
