"""Covariance with a known noise: it is that of the noise, whatever the residual says."""

import numpy as np
import pytest
from tests.log_rig import coloured

from detent.identify.fit.estimate import coloured_covariance, known_noise_covariance


def test_a_mean_of_a_few_rows_has_the_error_of_the_noise():
    rng = np.random.default_rng(1)
    noise = coloured(rng, 4000, 2.0, 0.7)
    ones = np.ones((12, 1))
    covariance, degrees = known_noise_covariance(ones, np.zeros(12), noise)
    lags = np.abs(np.subtract.outer(np.arange(12), np.arange(12)))
    assert covariance[0, 0] == pytest.approx(4.0 * (0.7**lags).sum() / 144, rel=0.1)
    assert degrees > 400
    with_counts, _ = known_noise_covariance(ones, np.zeros(12), noise, floor=3.0)
    assert with_counts[0, 0] - covariance[0, 0] == pytest.approx(9.0 / 12)


def test_a_residual_that_is_larger_than_the_noise_counts():
    rng = np.random.default_rng(2)
    columns = np.column_stack([np.ones(400), np.linspace(-1, 1, 400)])
    residual = coloured(rng, 400, 1.0, 0.5)
    found = known_noise_covariance(columns, residual, 0.01 * residual)
    assert found[0] == pytest.approx(coloured_covariance(columns, residual)[0])
    assert found[1] == coloured_covariance(columns, residual)[1]


def test_instruments_and_a_series_without_noise():
    rng = np.random.default_rng(3)
    columns, instruments = rng.standard_normal((300, 1)) + 2, rng.standard_normal((300, 1)) + 2
    noise = rng.standard_normal(5000)
    covariance, _ = known_noise_covariance(columns, np.zeros(300), noise, instruments)
    wanted = float((instruments.T @ instruments)[0, 0]) / float((instruments.T @ columns)[0, 0]) ** 2
    assert covariance[0, 0] == pytest.approx(wanted, rel=0.1)
    assert known_noise_covariance(columns, np.zeros(300), np.zeros(50))[0][0, 0] == 0.0
    short, _ = known_noise_covariance(columns, np.zeros(300), noise[:10])
    assert short[0, 0] == pytest.approx(np.var(noise[:10]) / float((columns.T @ columns)[0, 0]))
