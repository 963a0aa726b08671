"""Margins of many loops at once, against grids so fine that nothing is missed, and their parts against SciPy."""

import math
import random

import numpy as np
import pytest
import scipy.linalg
from tests.acceptance.test_tune import CASCADE, random_axis

from detent.analysis.margins import around, crossing, largest_level, usual_frequencies
from detent.analysis.sampled_plant import fraction, held, polynomial
from detent.methods.cascade.loop import LinearLoop
from detent.methods.load import load_spec

FINEST = 400_000  # frequencies


@pytest.mark.parametrize(
    "axes", [6, pytest.param(60, marks=pytest.mark.wide), pytest.param(300, marks=pytest.mark.long)]
)
def test_nothing_lies_between_the_points_of_the_grid(axes):
    chance = random.Random(7)
    for _ in range(axes):
        loop = LinearLoop(load_spec(CASCADE, random_axis(chance)))
        half = math.log10(0.5 / loop.period)
        frequencies = np.logspace(half - 6, half, FINEST)
        for cut, m in loop.margins.items():
            found = loop.open_loop(cut).response(frequencies)
            distance, gain = np.abs(1.0 + found), np.abs(found)
            k = int(np.argmin(distance))
            near = np.linspace(frequencies[max(k - 1, 0)], frequencies[min(k + 1, FINEST - 1)], 2001)
            closest = min(np.min(distance), np.min(np.abs(1.0 + loop.open_loop(cut).response(near))))
            assert 1.0 / closest <= m.sensitivity * (1 + 1e-9)
            assert 1.0 / closest == pytest.approx(m.sensitivity, rel=1e-3)
            cross = np.flatnonzero((gain[1:] >= 1.0) != (gain[:-1] >= 1.0))
            part = (1.0 - gain[cross]) / (gain[cross + 1] - gain[cross])  # a resonance turns far from point to point
            phases = np.angle(-(found[cross] + part * (found[cross + 1] - found[cross])))
            if m.crossover:
                first = cross[gain[cross] >= 1.0][0]
                assert frequencies[first] <= m.crossover <= frequencies[first + 1]
                assert abs(m.phase) == pytest.approx(np.min(np.abs(phases)), abs=2e-3)
            turn = np.flatnonzero((found.imag[1:] >= 0) != (found.imag[:-1] >= 0))
            turn = turn[found.real[turn] < 0.0]
            step = found[turn + 1] - found[turn]
            crossed = found.real[turn] - found.imag[turn] * step.real / step.imag
            factors = np.append(-1.0 / crossed, -1.0 / min(found.real[-1], -1e-300))
            assert m.gain == pytest.approx(np.min(factors[(factors > 1) & (factors < 1e299)], initial=np.inf), rel=1e-3)
            assert m.least == pytest.approx(np.max(factors[factors < 1], initial=0.0), rel=1e-3)


def plants(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Two masses on a spring behind a winding, from soft to stiff."""
    rng = np.random.default_rng(3)
    a, b = np.zeros((count, 5, 5)), np.zeros((count, 5))
    m, load, k, d = (10 ** rng.uniform(low, high, count) for low, high in ((0, 2), (0, 2), (3, 8), (0, 4)))
    a[:, 0, 0], a[:, 0, 2], b[:, 0] = -(10 ** rng.uniform(1, 4, count)), -1e4, 1e3
    a[:, 1, 2] = a[:, 3, 4] = 1.0
    a[:, 2] = np.stack([10 / m, -k / m, -d / m - 1.0, k / m, d / m], axis=1)
    a[:, 4] = np.stack([0 * m, k / load, d / load, -k / load, -d / load], axis=1)
    return a, b


def test_a_plant_held_is_that_of_scipy_and_the_same_alone():
    a, b = plants(30)
    moved, driven = held(a, b, 2.5e-4)
    for k in range(30):
        whole = np.zeros((6, 6))
        whole[:5, :5], whole[:5, 5] = a[k], b[k]
        wanted = scipy.linalg.expm(2.5e-4 * whole)
        scale = np.abs(wanted).max()
        assert moved[k] + np.eye(5) == pytest.approx(wanted[:5, :5], abs=1e-12 * scale)
        assert driven[k] == pytest.approx(wanted[:5, 5], abs=1e-12 * scale)
        alone = held(a[k], b[k], 2.5e-4)
        assert np.array_equal(alone[0], moved[k])
        assert np.array_equal(alone[1], driven[k])


def test_a_fraction_of_polynomials_is_the_response_of_the_matrices():
    rng = np.random.default_rng(4)
    moved, driven = 0.3 * rng.normal(size=(20, 4, 4)), rng.normal(size=(20, 4))
    found, out = fraction(moved, driven, np.eye(4)[[1, 3]]), np.exp(0.3j * np.arange(1, 9)) - 1.0
    powers = [out**k for k in range(5)]
    below = polynomial(found.below, powers)
    for k in range(20):
        wanted = np.linalg.solve(out[:, None, None] * np.eye(4) - moved[k], driven[k][:, None] + 0j)[:, [1, 3], 0]
        for place in (0, 1):
            assert polynomial(found.above[k, place], powers) / below[k] == pytest.approx(wanted[:, place], rel=1e-9)


def test_a_peak_and_a_crossing_are_found_between_points():
    def level(at):
        return 1.0 / (1e-3 + np.abs(np.log(at / 37.123)))

    grid = usual_frequencies(1e-3)
    best, at = largest_level(lambda at: np.exp(-(np.log(at / 37.123) ** 2)), grid)
    assert (best, at) == (pytest.approx(1.0, rel=1e-12), pytest.approx(37.123, rel=1e-6))
    assert largest_level(level, grid)[1] == pytest.approx(37.123, rel=1e-6)
    assert crossing(lambda at: at**3 - 8.0, 1.0, 300.0) == pytest.approx(2.0, rel=1e-8)


def test_a_resonance_has_points_inside_and_around():
    near = around(np.array([complex(-1.0, 628.3), complex(-3.0, 0.0)]), 1e-3)
    inside = near[np.abs(near - 100.0) < 4.0 / math.tau]
    assert len(inside) >= 15
    assert near.min() < 91.0
    assert np.all(near[60:] == near[60])  # no resonance: all at the edge
