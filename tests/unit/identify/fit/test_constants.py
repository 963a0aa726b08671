"""Constants of each direction from whatever model was fitted, with the errors that belong to them."""

from dataclasses import replace

import numpy as np
import pytest

from detent.identify.fit.constants import Constants, constants_of, hanging_position
from detent.identify.fit.equations import Run
from detent.identify.fit.regression import Fit

RNG = np.random.default_rng(1)


def covariance_of(count):
    root = RNG.standard_normal((count, count))
    return root @ root.T


def fit_of(model, values, covariance=None, *, instruments="position"):
    """A fit of a model with a delay of 2 ms, and a Stribeck velocity of 0.03 m/s where it has one."""
    names, values = [*model, "delay"], [*values, 0.002]
    if any(name.startswith("excess") for name in model):
        names, values = [*names, "stribeck"], [*values, 0.03]
    covariance = covariance_of(len(values)) if covariance is None else covariance
    degrees = np.full(len(values), 12.0)
    return Fit(
        *(tuple(names), np.array(values), covariance, degrees, np.zeros(5), np.ones(5), tuple(model), 2.0),
        instruments=instruments,
    )


def test_a_constant_force_is_part_of_both_directions():
    fit = fit_of(("mass", "coulomb", "offset", "viscous"), (2.0, 1.5, -0.4, 5.0))
    found = constants_of(fit)
    assert dict(zip(found.names, found.values.tolist(), strict=True)) == pytest.approx({
        "mass": 2.0,
        "coulomb.positive": 1.1,
        "coulomb.negative": 1.9,
        "viscous.positive": 5.0,
        "viscous.negative": 5.0,
        "delay": 0.002,
    })  # fmt: skip


def test_its_error_goes_into_both_with_its_sign():
    fit = fit_of(("mass", "coulomb", "offset"), (2.0, 1.5, -0.4))
    found = constants_of(fit)
    c = fit.covariance
    place = {name: k for k, name in enumerate(found.names)}
    plus, minus = place["coulomb.positive"], place["coulomb.negative"]
    assert found.covariance[plus, plus] == pytest.approx(c[1, 1] + c[2, 2] + 2 * c[1, 2])
    assert found.covariance[minus, minus] == pytest.approx(c[1, 1] + c[2, 2] - 2 * c[1, 2])
    assert found.covariance[plus, minus] == pytest.approx(c[1, 1] - c[2, 2])
    assert found.covariance[plus, place["delay"]] == pytest.approx(c[1, 3] + c[2, 3])
    assert found.covariance[0, 0] == pytest.approx(c[0, 0])
    assert found.errors == pytest.approx(np.sqrt(np.diag(found.covariance)))


def test_one_viscous_constant_is_that_of_both_directions():
    found = constants_of(fit_of(("mass", "coulomb", "offset", "viscous"), (2.0, 1.5, 0.0, 5.0)))
    k, j = found.names.index("viscous.positive"), found.names.index("viscous.negative")
    assert found.correlation[k, j] == pytest.approx(1.0)


STRIBECK = (
    "mass",
    "coulomb.positive",
    "coulomb.negative",
    "viscous.positive",
    "viscous.negative",
    "excess.positive",
    "excess.negative",
)


def test_static_friction_is_what_stands_over_coulomb_friction():
    fit = fit_of(STRIBECK, (2.0, 1.5, 1.2, 5.0, 6.0, 0.5, 0.3))
    found = constants_of(fit)
    assert found.value("static.positive") == pytest.approx(2.0)
    assert found.value("static.negative") == pytest.approx(1.5)
    assert found.value("stribeck") == 0.03
    k, c = found.names.index("static.positive"), fit.covariance
    assert found.covariance[k, k] == pytest.approx(c[1, 1] + c[5, 5] + 2 * c[1, 5])


def test_a_model_without_low_speed_friction_has_none():
    found = constants_of(fit_of(STRIBECK[:5], (2.0, 1.5, 1.2, 5.0, 6.0)))
    assert found.value("stribeck") == 0.0
    assert not any(name.startswith("static") for name in found.names)
    assert found.value("static.positive") == 0.0


def test_the_method_is_named():
    fit = fit_of(("mass", "coulomb", "offset"), (2.0, 1.5, -0.4))
    assert constants_of(fit).method == "instrumental variables of wider windows"
    fit = fit_of(("mass", "coulomb", "offset"), (2.0, 1.5, -0.4), instruments="none")
    assert constants_of(fit).method == "least squares"
    fit = fit_of(("mass", "coulomb", "offset"), (2.0, 1.5, -0.4), instruments="reference")
    assert constants_of(fit).method == "instrumental variables"


def test_what_rivals_say_otherwise_widens_the_limits():
    fit = fit_of(("mass", "coulomb", "offset", "viscous"), (2.0, 1.5, 0.0, 5.0))
    alone = constants_of(fit)
    near = fit_of(STRIBECK[:5], (2.2, 1.5, 1.4, 5.0, 7.0))
    far = fit_of(STRIBECK[:5], (1.6, 1.5, 1.5, 5.0, 5.0))
    found = constants_of(fit, [near, far])
    assert found.values == pytest.approx(alone.values)
    wider = np.diag(found.covariance - alone.covariance)
    expected = {"mass": (0.04 + 0.16) / 2, "coulomb.negative": 0.005, "viscous.negative": 2.0}
    assert dict(zip(found.names, wider.tolist(), strict=True)) == pytest.approx(
        dict.fromkeys(found.names, 0.0) | expected, abs=1e-9
    )


def test_a_rival_without_a_constant_says_nothing_about_it():
    fit = fit_of(STRIBECK, (2.0, 1.5, 1.2, 5.0, 6.0, 0.5, 0.3))
    found = constants_of(fit, [fit_of(STRIBECK[:5], (2.0, 1.5, 1.2, 5.0, 6.0))])
    assert np.diag(found.covariance) == pytest.approx(np.diag(constants_of(fit).covariance))


def test_correlations_are_those_of_the_errors():
    found = constants_of(fit_of(STRIBECK, (2.0, 1.5, 1.2, 5.0, 6.0, 0.5, 0.3)))
    assert np.diag(found.correlation) == pytest.approx(1.0)
    assert np.abs(found.correlation).max() <= 1.0
    scale = np.outer(found.errors, found.errors)
    assert found.correlation * scale == pytest.approx(found.covariance)


def test_estimates_carry_units_degrees_and_method():
    covariance = np.diag([0.01, 0.04, 0.0, 1e-6])
    fit = fit_of(("mass", "coulomb", "offset"), (2.0, 1.5, -0.4), covariance, instruments="reference")
    run = Run("r", 1e-3, np.zeros(3), np.zeros(3), np.ones(3, bool), "torque", "N*m", "rad")
    found = {e.name: e for e in constants_of(fit).estimates(run)}
    assert {name: e.unit for name, e in found.items()} == {
        "mass": "kg*m^2",
        "coulomb.positive": "N*m",
        "coulomb.negative": "N*m",
        "delay": "s",
    }
    assert found["mass"].error == pytest.approx(0.1)
    assert found["mass"].high - 2.0 == pytest.approx(0.1 * 2.1788, rel=1e-4)  # Student, 12 degrees of freedom
    assert found["mass"].method == "instrumental variables"


def test_a_sum_is_known_no_better_than_the_least_known_of_its_terms():
    fit = replace(fit_of(("mass", "coulomb", "offset"), (2.0, 1.5, -0.4)), degrees=np.array([9.0, 30.0, 20.0, 3.0]))
    found = constants_of(fit)
    assert found.names == ("mass", "coulomb.positive", "coulomb.negative", "delay")
    assert found.degrees.tolist() == [9.0, 20.0, 20.0, 3.0]


def test_the_delay_of_least_squares_is_no_estimate():
    """It is what fits best, and the simulation uses it; but in a loop nobody knows its error."""
    run = Run("r", 1e-3, np.zeros(3), np.zeros(3), np.ones(3, bool))
    found = constants_of(fit_of(("mass", "coulomb", "offset"), (2.0, 1.5, -0.4)))
    assert found.value("delay") == 0.002
    assert [e.name for e in found.estimates(run)] == ["mass", "coulomb.positive", "coulomb.negative"]


def test_where_a_pendulum_hangs():
    def pendulum(sine, cosine):
        names = ("pendulum", "pendulum.across")
        return hanging_position(Constants(names, np.array([sine, cosine]), np.eye(2), np.full(2, 5.0), ""))

    for angle in (-2.0, 0.0, 0.7, 3.0):
        # m g l sin(q - angle) = m g l (cos(angle) sin q - sin(angle) cos q)
        assert pendulum(1.4 * np.cos(angle), -1.4 * np.sin(angle)) == pytest.approx(angle)
    assert hanging_position(constants_of(fit_of(("mass", "coulomb", "offset"), (2.0, 1.5, 0.0)))) == 0.0
