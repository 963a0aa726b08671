import math

import pytest
from tests.stepper_rig import rotor_params

from detent.plant.stepper_rotor import (
    INTERVALS,
    StepperRotor,
    fill_curve,
    hold_field,
    lost_steps,
    step_field,
    strength_at,
    turn_rotor,
)

P = rotor_params()


def rotor(angle_steps: float = 0.0) -> StepperRotor:
    r = StepperRotor(angle=angle_steps * P.step_angle)
    hold_field(r)
    return r


def turn(p, r, instants: int) -> None:
    for _ in range(instants):
        turn_rotor(p, r)


def test_in_the_middle_of_its_field_the_rotor_rests():
    r = rotor()
    turn(P, r, 100)
    assert (r.angle, r.velocity, r.peak_lag) == (0.0, 0.0, 0.0)


def test_friction_holds_a_rotor_that_the_field_pulls_less():
    # 0.06 N m sin(50 x) < 0.006 N m up to x = 0.0064 of a radian of the teeth: 0.0638 steps.
    inside, outside = rotor(-0.0637), rotor(-0.0639)
    turn(P, inside, 500)
    turn(P, outside, 500)
    assert inside.velocity == 0.0
    assert inside.angle == -0.0637 * P.step_angle
    assert outside.angle > -0.0639 * P.step_angle


def test_first_instant_of_a_step_is_the_equation_of_motion():
    r = rotor()
    hz = 4000 * 26 / INTERVALS  # on a point of the torque curve
    step_field(P, r, 1, hz)
    turn_rotor(P, r)
    fall = 1 / math.hypot(1, hz / 1200)
    torque = fall * (0.06 * math.sin(math.pi / 2) + P.damping * hz * P.step_angle)
    assert r.velocity == pytest.approx(P.dt * (torque - 0.006) / P.inertia, rel=1e-12)
    assert r.angle == pytest.approx(P.dt * r.velocity, rel=1e-12)
    assert r.peak_lag == pytest.approx(1.0, abs=1e-5)
    assert r.commanded == 1


def test_small_swings_have_the_natural_frequency_of_field_and_inertia():
    p = P.copy()
    p.friction = p.damping = 0.0
    r = rotor(-0.05)
    period = 2 * math.pi / math.sqrt(p.teeth * p.torque / p.inertia)
    turn(p, r, round(period / 2 / p.dt))
    assert r.angle / p.step_angle == pytest.approx(0.05, rel=1e-3)
    assert abs(r.velocity) < 0.02 * 0.05 * p.step_angle * 2 * math.pi / period


def test_damping_is_a_fifth_of_the_critical_one():
    critical = 2 * math.sqrt(P.teeth * P.torque * P.inertia)
    assert P.damping / critical == pytest.approx(0.2)


@pytest.mark.parametrize(("angle", "lost"), [(0, 0), (0.4, 0), (-0.4, 0), (4, -4), (-4.05, 4), (-0.5, 1), (0.51, -1)])
def test_lost_steps_are_counted_to_the_nearest(angle, lost):
    assert lost_steps(P, rotor(angle)) == lost


def test_a_rotor_beyond_half_a_tooth_falls_into_the_next():
    r = rotor(2.5)
    turn(P, r, 20_000)
    assert lost_steps(P, r) == -4
    assert r.velocity == 0.0


@pytest.mark.parametrize("hz", [0.0, 1.0, 777.0, 1200.0, 3999.0, 4000.0])
def test_the_torque_curve_is_that_of_the_motor(hz):
    assert strength_at(P, hz) == pytest.approx(1 / math.hypot(1, hz / 1200), abs=3e-5)


def test_beyond_its_end_the_torque_curve_stays():
    assert strength_at(P, 9000.0) == strength_at(P, 4000.0)


def test_a_torque_curve_can_have_any_form():
    p = P.copy()
    fill_curve(p, lambda hz: 2.0 if hz <= 500 else 0.0, 1000.0)
    assert (strength_at(p, 250.0), strength_at(p, 750.0)) == (1.0, 0.0)
