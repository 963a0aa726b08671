"""The tools of the physics checks: grain, windows, likeness, correlation over shifts, runs, parabolas."""

import numpy as np
import pytest
from scipy import ndimage, signal

from detent.logs.differences import (
    MOST_ROWS,
    correlate,
    equal_runs,
    fill_holes,
    grain,
    integral,
    likeness,
    median_of_nine,
    paired_changes,
    parabolas,
    products_near,
    products_of,
    quick_length,
    resolution,
    runs_of,
    spread,
    window_rows,
)

RNG = np.random.default_rng(1)
T = np.arange(500) * 0.01
X = np.sin(T)


def test_resolution_and_grain():
    assert resolution(np.round(X / 1e-3) * 1e-3) == pytest.approx(1e-3)
    assert resolution(np.full(5, 3.0)) == 0.0
    assert resolution(np.array([0.0, 1e-17, 1.0])) == 1.0
    assert grain(np.round(X / 1e-2) * 1e-2) == pytest.approx(1e-2)
    assert grain(X + RNG.normal(0, 0.01, 500)) == pytest.approx(0.01, rel=0.15)
    assert grain(np.array([1.0, 2.0])) == 1.0


def test_windows_grow_with_the_grain():
    assert window_rows(X) == 4
    assert window_rows(np.round(X / 0.05) * 0.05) == 25
    assert window_rows(np.zeros(500)) == 4
    rows = window_rows(np.round(X / 0.004) * 0.004)
    assert 4 < rows < 25


def test_changes_over_windows_agree_whatever_the_stamps():
    t = np.cumsum(RNG.uniform(0.005, 0.02, 800))
    by_velocity, by_position = paired_changes(np.sin(t), np.cos(t), t)
    assert by_velocity == pytest.approx(by_position, abs=1e-4)
    gap = np.r_[t[:400], t[400:] + 50]
    by_velocity, by_position = paired_changes(np.r_[np.sin(t[:400]), np.sin(t[400:]) + 9], np.cos(t), gap)
    assert by_velocity == pytest.approx(by_position, abs=1e-4)
    assert len(by_position) == pytest.approx(800 / 2, abs=10)


def test_integral():
    assert integral(np.cos(T), T) == pytest.approx(np.sin(T), abs=1e-4)


def test_likeness():
    assert likeness(3 * X, X) == pytest.approx((1.0, 3.0))
    assert likeness(-0.5 * X, X) == pytest.approx((-1.0, -0.5))
    assert likeness(X + 5, X, is_centred=True) == pytest.approx((1.0, 1.0))
    assert likeness(X, np.zeros(500)) == likeness(X[:1], X[:1]) == (0.0, 0.0)
    noisy = likeness(X + RNG.normal(0, 0.2, 500), X + RNG.normal(0, 0.2, 500))
    assert noisy.factor == pytest.approx(1.0, abs=0.05)
    assert noisy.correlation < 0.97


def test_correlation_over_shifts():
    series = np.convolve(RNG.normal(size=600), np.hanning(30), "same")
    curve = correlate(np.roll(series, 11), series)
    assert (len(curve), int(np.argmax(curve))) == (301, 161)
    assert curve.max() == pytest.approx(1.0)
    assert (np.abs(curve) <= 1 + 1e-9).all()
    ours, theirs = np.roll(series, 11)[150 + 5 : 450 + 5], series[150:450]
    slow = np.corrcoef(ours, theirs)[0, 1]
    assert curve[155] == pytest.approx(slow, abs=0.02)


def test_runs():
    mask = np.array([1, 1, 0, 1, 0, 0, 1], dtype=bool)
    assert runs_of(mask).tolist() == [[0, 2], [3, 4], [6, 7]]
    assert runs_of(~np.ones(3, dtype=bool)).tolist() == []
    assert equal_runs(np.array([1.0, 1, 1, 2, 3, 3, 4, 4, 4]), 3).tolist() == [[0, 3], [6, 9]]
    assert equal_runs(np.array([1.0, 1, 1, 2, 3, 3]), 2).tolist() == [[0, 3], [4, 6]]


def test_spread_and_holes():
    assert spread(np.array([0.0, 1, 5, 5, 5, 5]), 3).tolist() == [1, 5, 4, 0, 0, 0]
    mask = np.array([1, 0, 0, 1, 0, 0, 0, 0, 1, 0], dtype=bool)
    assert fill_holes(mask, 3).tolist() == [True] * 4 + [False] * 4 + [True, False]


def test_parabolas_are_exact_for_parabolas():
    value, slope, bend = parabolas(2 + 3 * T - 4 * T**2, 0.01, 7)
    middle = T[3:-3]
    assert value == pytest.approx(2 + 3 * middle - 4 * middle**2)
    assert slope == pytest.approx(3 - 8 * middle)
    assert bend == pytest.approx(np.full(len(middle), -8.0), rel=1e-6)


@pytest.mark.parametrize(("n", "m"), [(400, 300), (401, 401), (37, 5), (1000, 999)])
def test_products_at_all_shifts_are_those_of_a_correlation(n: int, m: int) -> None:
    a, b = RNG.normal(size=n), RNG.normal(size=m)
    assert products_of(a, b) == pytest.approx(signal.correlate(a, b, mode="full", method="direct"), abs=1e-10)


def test_quick_lengths_are_the_least_products_of_2_3_and_5():
    products = {2**a * 3**b * 5**c for a in range(12) for b in range(8) for c in range(6)}
    for count in range(1, 2000):
        assert quick_length(count) == min(n for n in products if n >= count)


@pytest.mark.parametrize("rows", [1, 2, 3, 8, 30])
def test_holes_are_filled_as_a_closing_does(rows: int) -> None:
    """The closing of images: dilated, then eroded by a line of one more than the longest hole."""
    for share in (0.0, 0.1, 0.5, 0.9, 1.0):
        mask = RNG.random(300) < share
        padded = np.pad(mask, rows)
        assert (fill_holes(mask, rows) == ndimage.binary_closing(padded, np.ones(rows + 1))[rows:-rows]).all()


@pytest.mark.parametrize("rows", [3, 4, 5, 12, 81])
def test_parabolas_are_those_of_savitzky_and_golay(rows: int) -> None:
    x = RNG.normal(size=200)
    for order, found in enumerate(parabolas(x, 0.02, rows)):
        kernel = signal.savgol_coeffs(rows, 2, deriv=order, delta=0.02, use="dot")
        assert found == pytest.approx(np.correlate(x, kernel, mode="valid"), rel=1e-9, abs=1e-9 * np.abs(found).max())
    assert (parabolas(x, 0.02, rows, 1) == parabolas(x, 0.02, rows)[:1]).all()


def test_a_part_of_a_long_recording_tells_its_resolution() -> None:
    """It rests at its begin: the values of later rows count, too."""
    t = np.arange(5 * MOST_ROWS) * 1e-4
    for step in (1e-3, 1e-6):
        values = np.where(t < 25.0, 0.0, np.round(np.sin(0.3 * (t - 25.0)) / step) * step)
        assert resolution(values) == pytest.approx(step, rel=1e-6)


@pytest.mark.parametrize("count", [9, 10, 57, 4096, 4097, 9001])
def test_medians_and_spreads_over_windows_are_those_of_image_filters(count):
    values = np.random.default_rng(count).normal(size=count).round(1)
    assert np.array_equal(median_of_nine(values), ndimage.median_filter(values, 9, mode="nearest"))
    for rows in (1, 2, 3, 7, 8):
        expected = ndimage.maximum_filter1d(values, rows) - ndimage.minimum_filter1d(values, rows)
        assert np.array_equal(spread(values, rows), expected)


@pytest.mark.parametrize(("rows", "more"), [(50, 7), (31_000, 400), (95_000, 400)])
def test_products_near_are_those_of_the_whole_transform(rows, more):
    rng = np.random.default_rng(rows)
    a, b = rng.normal(size=rows + more), rng.normal(size=rows)
    whole = products_of(a, b)[rows - 1 : rows + more]
    assert products_near(a, b) == pytest.approx(whole, rel=1e-9, abs=1e-9 * np.sqrt(rows))
