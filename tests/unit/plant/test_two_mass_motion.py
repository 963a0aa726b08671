"""Rest, backlash and the order of a tick of motor and load."""

import math

import numpy as np
import pytest
from tests.cascade_rig import set_friction
from tests.two_mass_rig import M1, H, K, M, coupled, energy, machine, motor, moving, run, state

from detent.plant.linear_two_mass import fastest_rate
from detent.plant.two_mass import TwoMass, TwoMassParams
from detent.plant.two_mass_motion import move_masses

# -- friction ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("velocity", [0.5, 0.123456, 1e-4, 1e-9])
def test_coulomb_friction_stops_after_the_distance_of_the_energy(velocity, sign):
    p, r = machine(), moving(sign * velocity, position=0.25)
    set_friction(p.motor.friction, coulomb=3.0)
    set_friction(p.load.friction, coulomb=2.0)
    run(p, r, math.ceil(velocity * M / 5.0 / H) + 3)
    assert (r.load.velocity, r.motor.velocity, r.motor.sense) == (0.0, 0.0, 0)
    assert r.load.position - 0.25 == pytest.approx(sign * velocity**2 * M / (2 * 5.0), rel=1e-9, abs=1e-16)


def test_each_direction_has_its_own_friction():
    p = machine()
    p.motor.friction.positive.coulomb, p.motor.friction.negative.coulomb = 2.0, 8.0
    ways = [run(p, moving(v), 5000).load.position for v in (0.5, -0.5)]
    assert ways == pytest.approx([0.25 * M / 4.0, -0.25 * M / 16.0], rel=1e-9)


@pytest.mark.parametrize("offset", [0.0, 1.5, -2.5])
def test_the_offset_shifts_the_forces_that_hold(offset):
    p = machine()
    set_friction(p.motor.friction, coulomb=2.0, static=3.0, stribeck=0.01, offset=offset)
    set_friction(p.load.friction, coulomb=1.0)
    for force, holds in ((3.99, True), (-3.99, True), (4.01, False), (-4.01, False)):
        r = run(p, moving(effort=force + offset, position=0.1), 100)
        assert (r.load.position == 0.1) == holds
        assert (r.motor.sense == 0) == holds
        if not holds:
            assert r.load.velocity * force > 0.0


def test_what_has_broken_loose_accelerates_along_the_stribeck_curve():
    p = machine(period=1e-5)
    set_friction(p.motor.friction, coulomb=2.0, static=3.0, stribeck=0.01)
    r = run(p, moving(effort=3.0 + 1e-9), 1)
    assert 0.0 < r.motor.velocity < 1e-9 / M * 2e-5
    r = moving(0.05, effort=3.0)
    move_masses(p, r)
    assert r.motor.velocity - 0.05 == pytest.approx(1.0 / M * 1e-5, rel=1e-6)


@pytest.mark.parametrize("coupling", [machine, coupled], ids=["rigid", "coupled"])
def test_within_static_friction_nothing_moves_however_long(coupling):
    p = coupling()
    set_friction(p.motor.friction, coulomb=2.0, static=3.0, stribeck=0.01)
    set_friction(p.load.friction, coulomb=1.0)
    r = moving(position=0.1)
    stands = state(r)
    for k in range(2000):
        r.effort, r.external = 2.9 * math.sin(0.1 * k), 0.9 * math.cos(0.23 * k)
        move_masses(p, r)
        assert (r.motor.sense, r.load.sense) == (0, 0)
    assert np.array_equal(state(r), stands)


def test_a_mass_comes_to_rest_once_and_does_not_chatter():
    p, r = machine(), moving(0.05, effort=1.0)
    set_friction(p.motor.friction, coulomb=2.0, static=3.0, stribeck=0.01)
    senses = []
    for _ in range(2000):
        move_masses(p, r)
        senses.append(r.motor.sense)
    stop = senses.index(0)
    assert 500 < stop < 1500
    assert set(senses[:stop]) == {1}
    assert set(senses[stop:]) == {0}


def test_a_reversal_by_the_drive_is_passed_within_the_tick():
    """Deceleration (F + Fc) / m until rest, acceleration (F - Fc) / m from there, both to rounding."""
    p, r = machine(period=1e-2), moving(0.1, effort=-20.0)
    set_friction(p.motor.friction, coulomb=4.0)
    rest = 0.1 * M / 24.0
    way = 0.1 * rest / 2
    left = 1e-2 - rest
    assert left > 0.0
    move_masses(p, r)
    assert r.motor.velocity == pytest.approx(-16.0 / M * left, rel=1e-12)
    assert r.motor.position == pytest.approx(way - 8.0 / M * left**2, rel=1e-10)
    assert r.motor.sense == -1


def test_without_dry_friction_standstill_is_no_event():
    p = machine(period=1e-2)
    set_friction(p.motor.friction, viscous=1e-9)
    r = run(p, moving(0.1, effort=-40.0), 1)
    assert r.motor.velocity == pytest.approx(0.1 - 20.0 * 1e-2, rel=1e-9)
    assert run(p, moving(), 1).motor.velocity == 0.0


def test_a_mass_pushed_back_as_it_breaks_loose_has_not_moved():
    """A current that turns round within the tick."""
    p, r = motor(machine(period=4e-3), inductance=4e-3), moving(position=0.1)
    set_friction(p.motor.friction, coulomb=2.0)
    r.current, r.effort = 0.21, -2.0
    move_masses(p, r)
    assert (r.motor.position, r.motor.velocity, r.motor.sense, r.load.sense) == (0.1, 0.0, 0, 0)
    assert r.current < 0.0
    run(p, r, 1)
    assert r.motor.velocity < 0.0


def test_a_load_pulled_back_as_it_breaks_loose_has_not_moved():
    """A motor that flies away from it: the coupling turns round within the tick."""
    p, r = coupled(), moving(position=0.1)
    set_friction(p.load.friction, coulomb=5.0)
    p.damping, r.motor.position, r.motor.velocity = 0.0, 0.1 + 5.02 / K, -1.0
    move_masses(p, r)
    assert (r.load.position, r.load.velocity, r.load.sense, r.motor.sense) == (0.1, 0.0, 0, -1)
    move_masses(p, r)
    assert r.load.velocity < 0.0


def test_the_load_sticks_while_the_motor_swings_on_the_coupling():
    p, r = coupled(damping=0.0), moving(position=0.1)
    set_friction(p.load.friction, coulomb=5.0, static=30.0, stribeck=0.001)
    r.motor.position = 0.1 + 29.0 / K
    omega = math.sqrt(K / M1)
    for n in range(1, 501):
        move_masses(p, r)
        assert r.load.position == 0.1
        assert r.motor.position - 0.1 == pytest.approx(29.0 / K * math.cos(omega * n * H), abs=2e-4 * 29.0 / K)
    r.effort = 35.0
    run(p, r, 200)
    assert r.load.position > 0.1


@pytest.mark.parametrize("sign", [pytest.param(1, marks=pytest.mark.compiled), -1])
def test_backlash_lets_the_motor_cross_the_gap_before_the_load_moves(sign):
    gap = 2e-4
    p = coupled(half_gap=gap / 2)
    set_friction(p.load.friction, coulomb=1.0)
    set_friction(p.motor.friction, viscous=100.0)
    r = run(p, moving(effort=sign * 5.0), 3000)
    assert r.side == sign
    assert sign * (r.motor.position - r.load.position) == pytest.approx(gap / 2 + 1.0 / K, rel=1e-6)
    r.effort = 0.0
    run(p, r, 5000)
    place = r.load.position
    assert r.load.velocity == 0.0
    r.effort = -sign * 2.0
    sides = set()
    while r.load.position == place:
        twist = sign * (r.motor.position - r.load.position)
        assert twist >= -gap / 2 - 1.001 / K
        move_masses(p, r)
        sides.add(r.side)
    # It has crossed the whole gap, and strained the coupling up to the friction of the load.
    assert sign * (r.motor.position - place) < -gap / 2 - 0.95 / K
    assert sides == {0, -sign}
    run(p, r, 3000)
    assert sign * (r.motor.position - r.load.position) == pytest.approx(-gap / 2 - 1.0 / K, rel=1e-6)


def test_the_moment_of_contact_is_found_to_rounding():
    """Free flight, then a swing on the coupling: a mass of 1.2 kg that cannot move (its friction holds it)."""
    p = coupled(period=1e-3, half_gap=1e-3, damping=0.0)
    set_friction(p.load.friction, coulomb=1e6)
    r = moving()
    r.motor.velocity = 3.0
    hit = 1e-3 / 3.0
    omega = math.sqrt(K / M1)
    move_masses(p, r)
    rest = 1e-3 - hit
    exact = 3.0 / omega * math.sin(omega * rest)
    step_error = exact * (omega * rest) ** 4 / 120
    assert r.side == 1
    assert r.motor.position - 1e-3 == pytest.approx(exact, abs=1.1 * step_error)


def test_flanks_push_but_do_not_pull():
    """Strong damping would hold parting flanks together."""
    p, r = coupled(half_gap=1e-4, damping=2000.0), moving()
    r.motor.position = 1e-4 + 1e-5
    r.side = 1
    r.motor.velocity = -0.1
    move_masses(p, r)
    assert r.load.velocity >= 0.0
    run(p, r, 3)
    assert r.load.velocity >= 0.0
    assert r.side == 0


@pytest.mark.parametrize("sign", [1, -1])
def test_a_tick_that_leaves_one_flank_and_meets_the_other_ends_in_contact(sign):
    """Found by the property that energy never grows: both flanks were one event, and the tick went through the second.

    Out after 0.5 %, on the other flank after 91 % of the tick.
    """
    p = coupled(period=1.0, half_gap=1e-4, damping=0.0)
    p.period = 0.25 / fastest_rate(p)
    slip = sign * 1.1 * 2.0 * p.half_gap / p.period
    r = moving()
    r.motor.position, r.motor.velocity, r.side = -sign * (p.half_gap + 0.01 * p.half_gap), slip, -sign
    begin = energy(p, r)
    move_masses(p, r)
    twist = r.motor.position - r.load.position
    assert r.side == sign
    assert twist * sign > p.half_gap
    assert energy(p, r) == pytest.approx(begin, rel=1e-6)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_mass_that_stops_and_is_pushed_on_in_one_tick_does_not_turn_round(sign):
    """Found by the property that energy never grows: friction drove the motor back until the coupling caught it."""
    p = coupled(period=1.0, damping=0.0)
    p.period = 0.25 / fastest_rate(p)
    set_friction(p.motor.friction, coulomb=5.0, static=7.5, stribeck=0.02)
    r = moving()
    r.motor.velocity, r.load.velocity = sign * 1e-7, sign * 0.2
    begin = energy(p, r)
    move_masses(p, r)
    assert r.motor.position * sign >= 0.0
    assert energy(p, r) < begin


@pytest.mark.parametrize("sign", [1, -1])
def test_a_mass_held_in_a_tick_is_held_over_the_flank_that_is_left_in_it(sign):
    """The flank pushes it a little harder than its friction, but not for long; the rest was one step across a kink."""
    p = coupled(period=1.0, damping=0.0, half_gap=1e-3)
    p.period = 0.25 / fastest_rate(p)
    set_friction(p.load.friction, coulomb=5.0)
    r = moving()
    r.motor.position, r.motor.velocity, r.side = -sign * (p.half_gap + 5.5 / K), sign * 0.2, -sign
    begin = energy(p, r)
    move_masses(p, r)
    assert (r.load.velocity, r.side) == (0.0, 0)
    assert energy(p, r) == pytest.approx(begin, rel=2e-5)


# -- integration -------------------------------------------------------------------------------------------------------


def smooth(period: float) -> tuple[TwoMassParams, TwoMass]:
    """Everything that is smooth: coupling, winding, pendulum, Stribeck curve."""
    p = motor(coupled(period=period, stiffness=4e4, pendulum=7.0), inductance=4e-3)
    for mass in (p.motor, p.load):
        set_friction(mass.friction, coulomb=1.0, static=1.5, stribeck=0.05, viscous=2.0)
    return p, moving(0.5, effort=20.0)


def test_the_order_is_four():
    ends = [state(run(*smooth(h), round(0.1 / h))) for h in (1e-3, 5e-4, 2.5e-4, 1.25e-4, 1.5625e-5)]
    errors = [np.abs(end - ends[-1]).max() for end in ends[:-1]]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx([4.0, 4.0, 4.0], abs=0.35)


@pytest.mark.compiled
def test_reversals_and_impacts_cost_no_more_than_their_order():
    """Break-away is asked at a tick's begin, a delay that costs order 2; so four times the ticks, 1/8 the error."""
    errors = []
    for ratio in (1, 4, 16):
        p, r = smooth(4e-4 / ratio)
        p.half_gap, p.pendulum, p.winding.used = 1e-3, 300.0, 0
        r.effort = 0.0
        errors.append(state(run(p, r, 2000 * ratio)))
    coarse, fine = np.abs(errors[0] - errors[2]).max(), np.abs(errors[1] - errors[2]).max()
    assert fine < coarse / 8
    assert coarse < 1e-5


def test_more_events_than_a_tick_has_pieces_end_in_a_state_that_is_possible():
    """A tick of many swings, as no axis has it: the flanks meet again and again."""
    p, r = coupled(period=1.0, half_gap=1e-7, damping=0.0, stiffness=1e6), moving()
    set_friction(p.motor.friction, coulomb=1.0)
    set_friction(p.load.friction, coulomb=1.0)
    r.motor.velocity, r.load.velocity = 1e-3, -1e-3
    for _ in range(20):
        move_masses(p, r)
        assert np.isfinite(state(r)).all()
        assert r.side in {-1, 0, 1}


# -- loss of the transmission ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sign", [1, -1])
def test_the_transmission_loses_a_share_of_the_force_driving_and_adds_it_braking(sign):
    p = machine(loss=0.25)
    driven = run(p, moving(sign * 1.0, effort=sign * 8.0), 1)
    braked = run(p, moving(sign * 1.0, effort=-sign * 8.0), 1)
    assert sign * driven.load.velocity - 1.0 == pytest.approx(0.75 * 8.0 / M * H, rel=1e-9)
    assert sign * braked.load.velocity - 1.0 == pytest.approx(-1.25 * 8.0 / M * H, rel=1e-9)
    free = run(p, moving(sign * 1.0), 1)
    assert free.load.velocity == sign * 1.0


@pytest.mark.parametrize("coupling", [machine, coupled], ids=["rigid", "coupled"])
@pytest.mark.parametrize(("force", "holds"), [(9.0, True), (14.0, True), (15.5, False), (5.5, False)])
def test_a_lossy_transmission_holds_a_weight_over_a_band_of_forces(coupling, force, holds):
    """It holds while ``|F - W| <= Fc + l F``: from 6 to 15 N, for the weight of 9 N, 1.5 N and a loss of a quarter."""
    p = coupling(loss=0.25, weight=9.0)
    set_friction(p.motor.friction, coulomb=1.5)
    r = moving(effort=force)
    if coupling is coupled:
        r.motor.position = 9.0 / K
    run(p, r, 200)
    assert (r.motor.velocity == 0.0) == holds
    if not holds:
        assert r.motor.velocity * (force - 9.0) > 0.0
