"""What of a sample its inputs explain, held to functions of which that is known."""

import numpy as np
import pytest

from detent.analysis.sensitivity import clopper_pearson, ranks_of, sensitivity


def sample(count: int, seed: int = 3):
    x, y, z = np.random.default_rng(seed).random((3, count))
    return {"x": x, "y": y, "z": z}


@pytest.mark.parametrize("count", [500, 5000])
def test_shares_of_a_sum_are_those_of_the_variances(count):
    inputs = sample(count)
    found = sensitivity(inputs, 3.0 * inputs["x"] - 2.0 * inputs["y"])
    assert found is not None
    assert found.order == ["x", "y", "z"]
    for key, share in {"x": 9 / 13, "y": 4 / 13, "z": 0.0}.items():
        one = found.share[key]
        assert one.low - 0.02 <= share <= one.high + 0.02
        assert one.value == pytest.approx(share, abs=2.0 / count**0.5)
    assert found.together.value == pytest.approx(0.0, abs=2.0 / count**0.5)
    assert found.rank["x"].value > 0.7
    assert found.rank["y"].value < -0.4


def test_what_inputs_do_together_only_is_no_share_of_one():
    """A product of two that are centred: alone each explains nothing."""
    inputs = sample(20_000)
    found = sensitivity(inputs, (inputs["x"] - 0.5) * (inputs["y"] - 0.5))
    assert found is not None
    assert max(one.value for one in found.share.values()) < 0.01
    assert found.together.low > 0.95


def test_intervals_hold_the_true_share_about_as_often_as_they_say():
    inside = 0
    for seed in range(100):
        inputs = sample(1000, seed)
        found = sensitivity(inputs, 3.0 * inputs["x"] - 2.0 * inputs["y"])
        assert found is not None
        inside += found.share["x"].low <= 9 / 13 <= found.share["x"].high
    assert 80 <= inside <= 100


def test_a_whole_number_has_a_bin_for_each_value():
    whole = np.random.default_rng(1).integers(1, 3, 4000).astype(float)
    found = sensitivity({"delay": whole}, 5.0 * whole)
    assert found is not None
    assert found.share["delay"].value == pytest.approx(1.0, abs=1e-9)
    assert found.rank["delay"].value == pytest.approx(1.0, abs=1e-9)


def test_cases_without_a_value_are_left_out():
    inputs = sample(2000)
    outcome = inputs["x"].copy()
    outcome[::2] = np.nan
    found = sensitivity(inputs, outcome)
    assert found is not None
    assert found.cases == 1000
    assert found.share["x"].value == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("outcome", [np.full(100, 2.0), np.full(100, np.nan), np.arange(19.0)])
def test_what_says_nothing_has_no_shares(outcome):
    assert sensitivity({"x": np.arange(float(len(outcome)))}, outcome) is None


def test_ranks_share_their_places():
    assert ranks_of(np.array([2.0, 1.0, 2.0, 5.0])).tolist() == [1.5, 0.0, 1.5, 3.0]


@pytest.mark.parametrize(("good", "of", "low", "high"), [(0, 10, 0.0, 0.308497), (10, 10, 0.691503, 1.0)])
def test_the_ends_of_a_share(good, of, low, high):
    assert clopper_pearson(good, of) == (pytest.approx(low, abs=1e-6), pytest.approx(high, abs=1e-6))
