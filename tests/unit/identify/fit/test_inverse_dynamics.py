"""The benchmark's figures from its own record, and constants that are known from records made here."""

import numpy as np
import pytest
from tests.places import DATA

from detent.errors import DetentError
from detent.identify.fit.inverse_dynamics import (
    FOUR_CONSTANTS,
    PER_DIRECTION,
    Recipe,
    central_differences,
    decimate,
    fit_inverse_dynamics,
)

EMPS = DATA / "emps/DATA_EMPS.mat"


@pytest.fixture(scope="module")
def emps():
    if not EMPS.exists():
        pytest.skip("the recording shared/data/emps is not beside this clone")
    from scipy.io import loadmat

    data = loadmat(EMPS)
    t, position, voltage = (data[name][:, 0] for name in ("t", "qm", "vir"))
    return t, position, float(data["gtau"][0, 0]) * voltage


def test_the_benchmark_with_four_constants(emps):
    """Janot, Gautier, Brunot 2019: values, standard errors and relative error of their least squares, as printed."""
    found = fit_inverse_dynamics(*emps)
    assert list(found.values) == ["mass", "viscous", "coulomb", "offset"]
    assert [round(v, 4) for v in found.values.values()] == [95.1089, 203.5034, 20.3935, -3.1648]
    assert [round(e, 4) for e in found.standard_errors.values()] == [0.1085, 1.146, 0.1012, 0.0444]
    assert round(100 * found.relative_error, 4) == 4.0834


def test_the_benchmark_with_friction_per_direction(emps):
    found = fit_inverse_dynamics(*emps, columns=PER_DIRECTION)
    assert round(100 * found.relative_error, 4) == 3.1117
    assert found.values["viscous left"] > 1.4 * found.values["viscous right"]


TRUE = {"mass": 2.0, "viscous": 5.0, "coulomb": 1.5, "offset": -0.4}


def record(noise: float = 0.0, seconds: float = 12.0, seed: int = 1):
    """A smooth run to and fro at several speeds, with its exact force."""
    t = np.arange(0.0, seconds, 1e-3)
    w = 2 * np.pi * np.array([0.4, 1.1])
    size = np.array([[0.05], [0.01]])
    angle = np.outer(w, t)
    position = (size * np.sin(angle)).sum(0)
    velocity = (size * w[:, None] * np.cos(angle)).sum(0)
    acceleration = -(size * w[:, None] ** 2 * np.sin(angle)).sum(0)
    force = (
        TRUE["mass"] * acceleration + TRUE["viscous"] * velocity + TRUE["coulomb"] * np.sign(velocity) + TRUE["offset"]
    )
    return t, position, force + noise * np.random.default_rng(seed).standard_normal(len(t))


def test_known_constants_come_back():
    found = fit_inverse_dynamics(*record())
    assert found.values == pytest.approx(TRUE, rel=2e-3)
    assert found.relative_error < 0.01


def test_standard_errors_are_those_of_independent_errors():
    """Without decimation and with white noise the errors of many records scatter as each of them says."""
    recipe = Recipe(decimation=1)
    found = [fit_inverse_dynamics(*record(0.3, 6.0, seed), recipe=recipe) for seed in range(60)]
    for name in TRUE:
        scatter = np.std([one.values[name] for one in found], ddof=1)
        assert scatter == pytest.approx(found[0].standard_errors[name], rel=0.35)


def test_friction_per_direction_comes_back():
    t, position, force = record()
    velocity = np.gradient(position, t)
    uneven = force + np.where(velocity > 0, 3.0 * velocity, 0.0)
    found = fit_inverse_dynamics(t, position, uneven, PER_DIRECTION)
    assert found.values["viscous right"] == pytest.approx(8.0, rel=0.02)
    assert found.values["viscous left"] == pytest.approx(5.0, rel=0.02)
    # A constant force is part of both: 1.5 - 0.4 one way, 1.5 + 0.4 the other.
    assert found.values["coulomb right"] == pytest.approx(1.1, rel=0.02)
    assert found.values["coulomb left"] == pytest.approx(1.9, rel=0.02)


def test_the_correlation_is_that_of_the_constants():
    found = fit_inverse_dynamics(*record())
    assert np.diag(found.correlation) == pytest.approx(1.0)
    assert found.correlation == pytest.approx(found.correlation.T)
    assert 1 < found.condition < 100


def test_decimation_keeps_the_last_sample_and_what_is_slow():
    t = np.arange(2000) * 1e-3
    slow = np.sin(2 * np.pi * 2.0 * t)
    kept = decimate(slow + 0.5 * np.sin(2 * np.pi * 310.0 * t), 10)
    assert len(kept) == 200
    # The ripple of the pass band is 0.05 dB both ways.
    assert kept[20:-20] == pytest.approx(slow[9::10][20:-20], abs=0.013)
    assert len(decimate(slow[:1995], 10)) == 200
    assert decimate(slow, 1) is slow


def test_central_differences_are_one_sided_at_the_ends():
    assert central_differences(np.array([0.0, 1.0, 4.0, 9.0]), 0.5).tolist() == [2.0, 4.0, 8.0, 10.0]


def refused(change, columns=FOUR_CONSTANTS) -> str:
    with pytest.raises(DetentError) as error:
        fit_inverse_dynamics(*change(*record()), columns=columns)
    return str(error.value)


def test_what_cannot_be_fitted_is_refused_with_what_to_do():
    assert "as many of each" in refused(lambda t, x, f: (t, x[1:], f))
    assert "record longer" in refused(lambda t, x, f: (t[:300], x[:300], f[:300]))
    assert "even grid" in refused(lambda t, x, f: (np.where(t > 1, t + 0.1, t), x, f))
    assert "lower its corner" in refused(lambda t, x, f: (10 * t, x, f))
    assert "cannot tell" in refused(lambda t, _, f: (t, 0.1 * t, f))
    assert "nothing in this log excites" in refused(lambda t, x, f: (t, 0.0 * x, f))
