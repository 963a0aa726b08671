"""The benchmark's figures from its own record, by the recipe of its authors that other tests compare with."""

import numpy as np
import pytest
from tests.places import DATA
from tests.published_recipe import fit_inverse_dynamics

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
    found = fit_inverse_dynamics(*emps, per_direction=True)
    assert round(100 * found.relative_error, 4) == 3.1117
    assert found.values["viscous left"] > 1.4 * found.values["viscous right"]


def test_known_constants_come_back():
    t = np.arange(0.0, 12.0, 1e-3)
    w, size = 2 * np.pi * np.array([[0.4], [1.1]]), np.array([[0.05], [0.01]])
    position = (size * np.sin(w * t)).sum(0)
    velocity, acceleration = (size * w * np.cos(w * t)).sum(0), -(size * w**2 * np.sin(w * t)).sum(0)
    true = {"mass": 2.0, "viscous": 5.0, "coulomb": 1.5, "offset": -0.4}
    found = fit_inverse_dynamics(t, position, 2.0 * acceleration + 5.0 * velocity + 1.5 * np.sign(velocity) - 0.4)
    assert found.values == pytest.approx(true, rel=2e-3)
    assert found.relative_error < 0.01
