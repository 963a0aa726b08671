"""A brake: when it rubs after its line has changed, and what it does to the motor that it holds."""

import math

import numpy as np
import pytest
from tests.cascade_rig import set_friction
from tests.two_mass_rig import M1, H, M, coupled, machine, moving, run, state

from detent.plant.brake import Brake, BrakeParams, brake_force
from detent.plant.two_mass_motion import move_masses


def course(p, r, line, ticks):
    return [brake_force(p, r, line) for _ in range(ticks)]


@pytest.mark.parametrize(("opening", "closing"), [(3, 2), (0, 0), (1, 5)])
def test_it_follows_its_line_after_its_times(opening, closing):
    p, r = BrakeParams(force=7.0, open=opening, close=closing), Brake(closed=1)
    assert course(p, r, 0, 4) == [7.0] * 4
    assert course(p, r, 1, opening + 3) == [7.0] * opening + [0.0] * 3
    assert course(p, r, 0, closing + 3) == [0.0] * closing + [7.0] * 3


def test_a_line_that_comes_back_before_its_time_begins_anew():
    p, r = BrakeParams(force=7.0, open=3, close=3), Brake(closed=1)
    for _ in range(5):
        assert course(p, r, 1, 2) + course(p, r, 0, 1) == [7.0] * 3
    assert course(p, r, 1, 4) == [7.0, 7.0, 7.0, 0.0]
    for _ in range(5):
        assert course(p, r, 0, 2) + course(p, r, 1, 1) == [0.0] * 3


@pytest.mark.parametrize("coupling", [machine, coupled], ids=["rigid", "coupled"])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_load_below_its_force_moves_nothing_and_one_above_breaks_it_loose(coupling, sign):
    p, r = coupling(), moving(position=0.1)
    r.brake, stands = 5.0, state(r)
    for k in range(500):
        r.effort = 4.99 * sign * math.cos(0.01 * k)
        move_masses(p, r)
        assert (r.motor.sense, r.motor.velocity) == (0, 0.0)
    assert r.motor.position == stands[1]
    r.effort = sign * 5.01
    run(p, r, 200)
    assert r.motor.velocity * sign > 0.0


def test_behind_a_coupling_it_holds_what_pushes_the_load():
    p, r = coupled(), moving(external=2.4)
    r.brake = 5.0
    # The load swings on its coupling about the twist of the force, so that the brake bears twice that.
    peak = max(abs(run(p, r, 1).load.position) for _ in range(4000))
    assert r.motor.position == 0.0
    assert 1.5 * 2.4 < peak * p.stiffness < 2.0 * 2.4
    r.external = 5.1
    run(p, r, 4000)
    assert r.motor.position > 1e-5


@pytest.mark.parametrize("velocity", [0.5, -0.5, 1e-6])
def test_it_stops_a_mass_after_the_distance_of_the_energy(velocity):
    p, r = machine(), moving(velocity)
    r.brake = 5.0
    run(p, r, math.ceil(abs(velocity) * M / 5.0 / H) + 3)
    assert (r.motor.velocity, r.motor.sense) == (0.0, 0)
    assert r.load.position == pytest.approx(math.copysign(velocity**2, velocity) * M / 10.0, rel=1e-9)


def test_on_a_coupling_it_stops_the_motor_alone():
    p, r = coupled(stiffness=1e-3, damping=0.0), moving(0.1)
    r.brake = 5.0
    run(p, r, math.ceil(0.1 * M1 / 5.0 / H) + 3)
    assert r.motor.velocity == 0.0
    assert r.load.velocity == pytest.approx(0.1, rel=1e-3)


@pytest.mark.parametrize("coupling", [machine, coupled], ids=["rigid", "coupled"])
def test_it_is_a_coulomb_friction_of_the_motor(coupling):
    def course(brake, coulomb):
        p, r = coupling(loss=0.1), moving(0.05)
        set_friction(p.motor.friction, coulomb=2.0 + coulomb, static=2.0 + coulomb, viscous=3.0)
        set_friction(p.load.friction, coulomb=1.0)
        found = []
        for k in range(1500):
            r.effort, r.external, r.brake = 20.0 * math.sin(0.02 * k), 3.0 * math.sin(0.13 * k), brake
            move_masses(p, r)
            found.append(state(r))
        return np.array(found)

    one, other, free = course(4.0, 0.0), course(0.0, 4.0), course(0.0, 0.0)
    assert np.abs(one - other).max() < 1e-9 * np.abs(other).max()
    assert np.abs(one - free).max() > 1e-2 * np.abs(free).max()
