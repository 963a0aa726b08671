"""Periods are found to a fraction of a row, and what does not repeat has none."""

import numpy as np
import pytest

from detent.identify.analyse.measure_response import autocorrelation, cut_periods, find_period


def multisine(moments, period, lines=60, seed=1):
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, lines)
    return np.cos(2 * np.pi * np.outer(moments / period, np.arange(1, lines + 1)) + phases).sum(axis=1)


ROWS = np.arange(8000.0)


@pytest.mark.parametrize("period", [500.0, 500.37, 777.5, 2600.0])
def test_a_period_comes_back_with_its_fraction(period):
    assert find_period(multisine(ROWS, period)) == pytest.approx(period, abs=2e-3)


def test_noise_of_a_third_of_the_power_costs_little():
    values = multisine(ROWS, 500.0)
    noise = np.random.default_rng(2).normal(size=len(values)) * 0.25 * values.std()
    assert find_period(values + noise) == pytest.approx(500.0, abs=0.02)


@pytest.mark.parametrize(
    "values",
    [
        np.random.default_rng(1).normal(size=5000),
        np.cumsum(np.random.default_rng(1).normal(size=5000)),
        np.ones(500),
        np.linspace(0.0, 1.0, 500),
        multisine(ROWS[:1400], 500.0),  # less than three periods
    ],
    ids=["noise", "walk", "constant", "ramp", "too short"],
)
def test_what_does_not_repeat_has_no_period(values):
    assert find_period(values) is None


def test_the_autocorrelation_is_that_of_the_overlap():
    values = np.random.default_rng(3).normal(size=200)
    centred = values - values.mean()
    early, late = centred[:-30], centred[30:]
    expected = early @ late / np.sqrt(early @ early * (late @ late))
    found = autocorrelation(values)
    assert (found[0], found[30]) == pytest.approx((1.0, expected))


def test_samples_on_a_whole_period_stay_as_they_are():
    t = 1e-3 * ROWS
    values, other = multisine(ROWS, 500.0), np.random.default_rng(1).normal(size=len(t))
    cut = cut_periods(t, values, [other])
    assert cut.signals[0].shape == cut.signals[1].shape == (16, 500)
    assert np.abs(cut.signals[1].ravel() - other).max() < 1e-9
    assert (cut.mismatch < 1e-9, cut.grid, round(cut.duration, 9)) == (True, "", 0.5)


def test_a_period_with_a_fraction_is_put_on_whole_samples():
    cut = cut_periods(1e-3 * ROWS, multisine(ROWS, 500.37, lines=30))
    assert cut.signals[0].shape[1] == 500
    assert cut.duration == pytest.approx(0.50037, rel=1e-5)
    assert "500.37" in cut.grid
    assert cut.mismatch < 0.02


def test_stamps_count_where_the_excitation_follows_them():
    """Samples taken late are late: then the stamps say where the excitation was."""
    rng = np.random.default_rng(4)
    moments = ROWS + rng.uniform(-0.2, 0.2, len(ROWS))
    cut = cut_periods(1e-3 * moments, multisine(moments, 500.0, lines=20))
    assert "resampled to an even grid by linear interpolation" in cut.grid
    assert cut.mismatch < 0.01


def test_stamps_do_not_count_where_the_excitation_goes_by_rows():
    stamps = 1e-3 * (ROWS + np.random.default_rng(4).uniform(-0.2, 0.2, len(ROWS)))
    cut = cut_periods(stamps, multisine(ROWS, 500.0))
    assert "treated as even" in cut.grid
    assert cut.mismatch < 1e-9


def test_noise_has_no_periods():
    assert cut_periods(1e-3 * ROWS, np.random.default_rng(1).normal(size=len(ROWS))) is None
