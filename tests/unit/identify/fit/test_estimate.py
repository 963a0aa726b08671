"""Intervals: as wide as Student's distribution says, and holding the truth as often as they claim."""

import json

import numpy as np
import pytest
from tests.identify_rig import binomial_bounds

from detent.identify.fit.estimate import estimate, quantile


def test_quantiles_are_those_of_the_tables():
    assert quantile(np.inf) == pytest.approx(1.959964, abs=1e-6)
    assert [round(quantile(n), 3) for n in (1, 4, 30)] == [12.706, 2.776, 2.042]


def test_less_than_one_degree_of_freedom_counts_as_one():
    assert quantile(0.0) == quantile(1)


def test_an_interval_reaches_as_far_to_both_sides_and_knows_its_ends():
    found = estimate("mass", 3.0, "kg", 0.1, "least squares", 10)
    assert (found.low, found.high) == pytest.approx((3.0 - 0.22281, 3.0 + 0.22281), abs=1e-5)
    assert found.holds(found.low)
    assert found.holds(found.high)
    assert not found.holds(3.23)
    assert not found.holds(2.77)


def test_the_relative_error_of_nothing_is_infinite():
    assert estimate("offset", 0.0, "N", 0.1, "x").relative_error == np.inf
    assert estimate("offset", -2.0, "N", 0.1, "x").relative_error == pytest.approx(0.05)


def test_plain_data():
    plain = json.loads(json.dumps(estimate("mass", 3.0, "kg", 0.1, "x").to_dict()))
    assert {name: plain[name] for name in ("name", "value", "unit", "error", "method")} == {
        "name": "mass",
        "value": 3.0,
        "unit": "kg",
        "error": 0.1,
        "method": "x",
    }


def test_intervals_of_a_mean_of_five_hold_as_often_as_they_say():
    rng = np.random.default_rng(1)
    looks = rng.standard_normal((2000, 5))
    errors = looks.std(axis=1, ddof=1) / np.sqrt(5)
    held = [estimate("m", m, "", e, "", 4).holds(0.0) for m, e in zip(looks.mean(axis=1), errors, strict=True)]
    low, high = binomial_bounds(2000)
    assert low <= np.mean(held) <= high
