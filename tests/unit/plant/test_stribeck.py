import math

import pytest

from detent.plant.stribeck import StribeckFriction, friction_force, holding_force, is_dry, resistance


def friction() -> StribeckFriction:
    p = StribeckFriction(offset=0.25)
    d = p.positive
    d.coulomb, d.static, d.stribeck, d.viscous = 4.0, 6.0, 0.01, 30.0
    d = p.negative
    d.coulomb, d.static, d.stribeck, d.viscous = 3.0, 5.0, 0.02, 20.0
    return p


@pytest.mark.parametrize("speed", [1e-9, 1e-3, 0.005, 0.01, 0.02, 0.05, 0.0632, 0.0633, 1.0])
def test_the_curve_is_that_of_the_formula_in_both_directions(speed):
    p = friction()
    up = 0.25 + 4.0 + 2.0 * math.exp(-((speed / 0.01) ** 2)) + 30.0 * speed
    down = 0.25 - 3.0 - 2.0 * math.exp(-((speed / 0.02) ** 2)) - 20.0 * speed
    assert friction_force(p, 1, speed) == pytest.approx(up, rel=1e-15)
    assert friction_force(p, -1, -speed) == pytest.approx(down, rel=1e-15)


def test_as_motion_begins_it_is_the_force_that_breaks_loose():
    p = friction()
    assert friction_force(p, 1, 0.0) - p.offset == holding_force(p.positive) == 6.0
    assert friction_force(p, -1, 0.0) - p.offset == -holding_force(p.negative) == -5.0


def test_it_has_a_minimum_between_static_and_viscous_friction():
    p = friction().positive
    curve = [resistance(p, k * 1e-3) for k in range(200)]
    least = curve.index(min(curve))
    assert 15 <= least <= 25
    assert curve[0] == 6.0 > curve[-1] * 0.5 > min(curve) * 0.5
    assert min(curve) == pytest.approx(4.6, abs=0.1)


def test_without_a_stribeck_velocity_static_friction_ends_as_motion_begins():
    p = friction()
    p.positive.stribeck = 0.0
    assert friction_force(p, 1, 0.0) == 0.25 + 4.0
    assert holding_force(p.positive) == 6.0


def test_static_friction_below_coulomb_friction_is_coulomb_friction():
    p = friction()
    p.positive.static = 0.0
    assert holding_force(p.positive) == 4.0
    assert friction_force(p, 1, 1e-6) == pytest.approx(0.25 + 4.0 + 30e-6, rel=1e-14)


def test_in_a_stage_that_has_passed_standstill_the_branch_goes_on_smoothly():
    p = friction()
    slope = (friction_force(p, 1, 1e-9) - friction_force(p, 1, -1e-9)) / 2e-9
    assert slope == pytest.approx(30.0, rel=1e-4)


@pytest.mark.parametrize(
    ("side", "name", "dry"),
    [("positive", "coulomb", True), ("negative", "static", True), ("positive", "viscous", False)],
)
def test_only_dry_friction_can_hold(side, name, dry):
    p = StribeckFriction(offset=1.0)
    assert not is_dry(p)
    setattr(getattr(p, side), name, 1.0)
    assert is_dry(p) == dry


def test_units_are_those_of_a_linear_axis():
    units = {leaf.path: leaf.unit for leaf in StribeckFriction.leaves()}
    assert units["positive.stribeck"] == "m/s"
    assert units["negative.viscous"] == "N.s/m"
    assert {units[name] for name in ("offset", "positive.coulomb", "negative.static")} == {"N"}
