"""Friction versus speed with its limits, and its chart."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.identify.page.samples import constants, windows

from detent.identify.fit.estimate import quantile
from detent.identify.page.compared import friction_at, friction_chart, friction_limits
from detent.identify.page.words import Ways


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


def test_rings_of_the_friction_map_are_curve_plus_residual() -> None:
    one = replace(windows(count=3), velocity=np.array([0.1, -0.1, 0.2]), residual=np.array([1.0, 2.0, -1.0]))
    chart = friction_chart(constants(), [one], "N", Ways("m"))
    rings, line, above, below = (np.array(s["y"], dtype=float) for s in chart["series"])
    x = np.array(chart["x"])
    assert np.all(np.diff(x) > 0)
    at = [int(np.flatnonzero(np.isclose(x, mm))[0]) for mm in (100.0, -100.0, 200.0)]
    assert rings[at] == pytest.approx([10.5 + 1.0, -8.4 + 2.0, 11.0 - 1.0], abs=1e-3)
    assert line[at] == pytest.approx([10.5, -8.4, 11.0], abs=1e-3)
    assert np.count_nonzero(np.isfinite(rings)) == 3
    assert np.isnan(line[x == 0.0]).all()
    assert np.nanmin(above - line) > 0
    assert above[at] + below[at] == pytest.approx(2 * line[at], abs=1e-3)


def test_limits_that_say_nothing_are_not_drawn() -> None:
    wild = replace(constants(), covariance=constants().covariance * 1e12)
    chart = friction_chart(wild, [windows()], "N", Ways("m"))
    assert set(chart["series"][2]["y"]) == {None}
