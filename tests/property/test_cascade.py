"""The plant and the profiles of the cascade axis for every state and every move."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.cascade_rig import set_friction

from detent.planning.profile import MotionLimits, plan_move
from detent.plant.linear_two_mass import fastest_rate
from detent.plant.two_mass import TwoMass, TwoMassParams, stand_masses
from detent.plant.two_mass_motion import move_masses

masses = st.floats(0.1, 10.0)
forces = st.sampled_from([0.0, 0.5, 5.0])


@st.composite
def plants(draw):
    """Rigid or coupled, with or without gap and friction, a tick at most a quarter of the fastest rate's."""
    p = TwoMassParams()
    p.motor.mass, p.load.mass, p.winding.max_current = draw(masses), draw(masses), math.inf
    p.stiffness = draw(st.sampled_from([0.0, 1e3, 1e5]))
    if p.stiffness:
        p.damping, p.half_gap = draw(st.sampled_from([0.0, 5.0])), draw(st.sampled_from([0.0, 1e-4, 1e-3]))
    for mass in (p.motor, p.load):
        coulomb = draw(forces)
        set_friction(mass.friction, coulomb=coulomb, static=coulomb * draw(st.sampled_from([1.0, 1.5])))
        set_friction(mass.friction, stribeck=0.02, viscous=draw(st.sampled_from([0.0, 3.0])))
    p.period = min(1e-3, 0.25 / max(fastest_rate(p), 1e-9))
    return p


def energy(p: TwoMassParams, r: TwoMass) -> float:
    """Kinetic energy and strain [J]."""
    strain = max(abs(r.motor.position - r.load.position) - p.half_gap, 0.0) if p.stiffness else 0.0
    kinetic = 0.5 * (p.motor.mass * r.motor.velocity**2 + p.load.mass * r.load.velocity**2)
    return kinetic + 0.5 * p.stiffness * strain**2


def in_motion(p: TwoMassParams, velocity: float, relative: float, brake: float = 0.0) -> TwoMass:
    r = TwoMass(brake=brake)
    stand_masses(r, 0.0)
    r.motor.velocity = velocity
    r.load.velocity = velocity + relative if p.stiffness else velocity
    return r


@settings(max_examples=150)
@given(plants(), st.floats(-1, 1), st.floats(-0.3, 0.3), forces)
def test_without_a_drive_energy_never_grows(p, velocity, relative, brake):
    r = in_motion(p, velocity, relative, brake)
    begin = now = energy(p, r)
    for _ in range(400):
        move_masses(p, r)
        after = energy(p, r)
        # A step of order 4 errs by (rate x tick)^5 / 120, which is 8e-6 at this tick.
        assert after <= now + 2e-5 * begin + 1e-18
        now = after
    assert now <= begin * (1 + 1e-4) + 1e-18


@settings(max_examples=150)
@given(plants(), st.floats(-1, 1), st.floats(-0.3, 0.3), st.floats(-8, 8))
def test_the_mirrored_plant_does_the_mirrored_thing(p, velocity, relative, effort):
    one, two = in_motion(p, velocity, relative), in_motion(p, -velocity, -relative)
    one.effort, two.effort = effort, -effort
    for _ in range(300):
        move_masses(p, one)
        move_masses(p, two)
    states = [(r.motor.position, r.motor.velocity, r.load.position, r.load.velocity, r.side) for r in (one, two)]
    assert states[0] == tuple(-value for value in states[1])


@settings(max_examples=150)
@given(plants(), st.floats(-0.2, 0.2))
def test_what_friction_has_stopped_stays(p, velocity):
    set_friction(p.motor.friction, coulomb=5.0, static=6.0)
    set_friction(p.load.friction, coulomb=4.0, static=4.0)
    r = in_motion(p, velocity, 0.0)
    for _ in range(20_000):
        move_masses(p, r)
        if r.motor.sense == 0 and r.load.sense == 0:
            break
    assert (r.motor.velocity, r.load.velocity) == (0.0, 0.0)
    stopped = r.snapshot()
    for _ in range(100):
        move_masses(p, r)
    assert r.snapshot() == stopped


@settings(max_examples=300)
@given(
    start=st.floats(-10, 10),
    way=st.floats(-10, 10),
    speed=st.floats(0.1, 10),
    acceleration=st.floats(0.1, 100),
    jerk=st.one_of(st.just(math.inf), st.floats(1.0, 1e5)),
)
def test_a_profile_keeps_its_limits_and_agrees_with_itself(start, way, speed, acceleration, jerk):
    period = 1e-3
    limits = MotionLimits(speed, acceleration, jerk)
    target = start + way
    move = plan_move(start, target, limits, period)
    assert move.position[0] == pytest.approx(start, abs=1e-12)
    assert (move.position[-1], move.velocity[-1], move.acceleration[-1]) == (target, 0.0, 0.0)
    assert np.abs(move.velocity).max() <= speed * (1 + 1e-9) + 1e-12
    assert np.abs(move.acceleration).max() <= acceleration * (1 + 1e-9) + 1e-12
    low, high = min(start, target) - 1e-9, max(start, target) + 1e-9
    assert ((move.position >= low) & (move.position <= high)).all()
    # Between two samples: position from the velocities, velocity from the accelerations.
    sixth = min(jerk * period, 2 * acceleration) * period**2
    assert np.abs(np.diff(move.position) - (move.velocity[1:] + move.velocity[:-1]) * period / 2).max(initial=0.0) <= (
        sixth + 1e-11
    )
    change = np.abs(np.diff(move.velocity)).max(initial=0.0)
    assert change <= acceleration * period * (1 + 1e-9) + 1e-12
    if jerk < math.inf:
        assert np.abs(np.diff(move.acceleration)).max(initial=0.0) <= jerk * period * (1 + 1e-9) + 1e-9
