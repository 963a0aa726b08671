"""Brent's methods: each step is the one that SciPy makes."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy import optimize

from detent.identify.fit.search import least_within, root_within

WAVES = [
    lambda x: math.sin(3.0 * x) + 0.3 * x,
    lambda x: abs(x - 0.1),
    lambda x: (x - 0.4) ** 4,
    lambda x: math.exp(x) - 2.0 * x,
    lambda x: -x,
    lambda _: 1.0,
]


def noting(f: Callable[[float], float]) -> tuple[Callable[[float], float], list[float]]:
    places: list[float] = []

    def noted(x: float) -> float:
        places.append(float(x))
        return f(float(x))

    return noted, places


@pytest.mark.parametrize("number", range(len(WAVES)))
@pytest.mark.parametrize("accuracy", [1e-2, 1e-5, 1e-9])
def test_the_least_is_looked_for_where_scipy_looks(number: int, accuracy: float) -> None:
    rng = np.random.default_rng(number)
    for _ in range(20):
        low, high = sorted(rng.uniform(-2.0, 2.0, 2).tolist())
        (ours, own), (theirs, other) = noting(WAVES[number]), noting(WAVES[number])
        found = least_within(ours, low, high, accuracy)
        known = optimize.minimize_scalar(theirs, bounds=(low, high), method="bounded", options={"xatol": accuracy})
        assert own == other
        assert found == known.x


@pytest.mark.parametrize(
    "f", [lambda x: x**3 - 0.2, lambda x: math.tanh(9.0 * x) + 0.1, lambda x: math.exp(x) - 1.5, lambda x: x - 0.25]
)
@pytest.mark.parametrize("accuracy", [1e-3, 2e-12])
def test_the_root_is_looked_for_where_scipy_looks(f: Callable[[float], float], accuracy: float) -> None:
    rng = np.random.default_rng(5)
    for _ in range(20):
        low, high = float(rng.uniform(-2.0, -0.3)), float(rng.uniform(0.7, 3.0))
        (ours, own), (theirs, other) = noting(f), noting(f)
        assert root_within(ours, low, high, accuracy) == optimize.brentq(theirs, low, high, xtol=accuracy)
        assert own == other
        assert root_within(ours, high, low, accuracy) == optimize.brentq(theirs, high, low, xtol=accuracy)
        assert own == other


def test_a_root_at_an_end_is_that_end() -> None:
    assert root_within(lambda x: x, 0.0, 1.0) == 0.0
    assert root_within(lambda x: x - 1.0, 0.0, 1.0) == 1.0
