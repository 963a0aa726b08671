"""Friction over the speed with its limits, and the response of a rigid axis."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.identify.page.samples import constants

from detent.identify.fit.estimate import quantile
from detent.identify.page.identify_model import friction_at, friction_limits, respond


def test_friction_is_that_of_each_direction() -> None:
    c = constants()
    found = friction_at(c, c.values, np.array([-1.0, 0.0, 2.0]))
    assert found == pytest.approx([-(8.0 + 4.0), 0.0, 10.0 + 5.0 * 2.0])


def test_friction_rises_towards_standstill() -> None:
    c = constants()
    found = friction_at(c, c.values, np.array([-1e-9, 0.01, 1e-9]))
    assert found == pytest.approx([-9.0, 10.0 + 3.0 * np.exp(-1.0) + 0.05, 13.0])


def test_a_model_without_low_speed_friction_has_none() -> None:
    c = constants()
    plain = replace(c, names=c.names[:5], values=c.values[:5], covariance=c.covariance[:5, :5])
    assert friction_at(plain, plain.values, np.array([1e-9])) == pytest.approx([10.0])


def test_limits_come_from_the_covariance() -> None:
    c = constants()
    covariance = np.zeros((9, 9))
    covariance[1, 1], covariance[3, 3], covariance[1, 3], covariance[3, 1] = 0.04, 0.01, -0.018, -0.018
    v = np.array([0.5, 1.0, 2.0, -1.0])
    found = friction_limits(replace(c, covariance=covariance), v)
    expected = quantile(1000.0) * np.sqrt(0.04 + 2 * v * -0.018 + 0.01 * v**2)
    assert found[:3] == pytest.approx(expected[:3], rel=1e-6)
    assert found[3] == 0.0


def test_a_rigid_axis_answers_by_its_mass() -> None:
    c = constants()
    (high,) = respond(c, np.array([100.0]))
    assert abs(high) == pytest.approx(1.0 / (2.0 * (2 * np.pi * 100.0) ** 2), rel=1e-4)
    late = np.degrees(np.angle(high)) % 360.0
    assert late == pytest.approx(180.0 - 360.0 * 100.0 * 1e-3 + np.degrees(4.5 / (2.0 * 2 * np.pi * 100.0)), abs=0.01)


def test_without_a_mass_there_is_no_response() -> None:
    c = constants()
    assert respond(replace(c, values=-c.values), np.array([1.0])) is None
