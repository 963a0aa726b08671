import math

import numpy as np
import pytest
from tests.print_head_rig import Rig

from detent.plant.drive_train import (
    DriveTrain,
    DriveTrainParams,
    Transition,
    account,
    fill_period,
    flow,
    friction_force,
    move_averaged,
    move_with_current,
    sense_of_motion,
    settle_contacts,
)

K = 19.87


def machine(**changes: float) -> DriveTrainParams:
    """The default plant's train with friction 7.55 N right and 5.87 N left, on a metre of guide."""
    p = DriveTrainParams(resistance=12.0, inductance=12e-3, force_constant=K, emf_constant=K, mass=1.3212)
    p.left_end, p.right_end, p.period, p.substep = 0.0, 1.0, 40e-6, 0.2e-3
    f = p.friction
    f.coulomb_right, f.coulomb_left, f.static_right, f.static_left = 7.55, 5.87, 8.68, 6.75
    for name, value in changes.items():
        setattr(f if hasattr(f, name) else p, name, value)
    fill_period(p)
    return p


@pytest.mark.parametrize(
    ("velocity", "current", "force", "position", "sense"),
    [
        (0.1, 0.0, 0.0, 0.5, 1),
        (-0.1, 5.0, 0.0, 0.5, -1),  # what moves has the sense of its motion, whatever pushes
        (0.0, 0.0, 0.0, 0.5, 0),
        (0.0, 8.6 / K, 0.0, 0.5, 0),  # static friction holds
        (0.0, 8.7 / K, 0.0, 0.5, 1),
        (0.0, -6.7 / K, 0.0, 0.5, 0),
        (0.0, -6.8 / K, 0.0, 0.5, -1),
        (0.0, 0.0, 8.7, 0.5, 1),
        (0.0, 4.4 / K, 4.4, 0.5, 1),
        (0.0, 1.0, 0.0, 1.0, 0),  # pressed against the frame
        (0.0, -1.0, 0.0, 1.0, -1),
        (0.0, -1.0, 0.0, 0.0, 0),
        (0.0, 1.0, 0.0, 0.0, 1),
    ],
)
def test_sense_of_motion(velocity, current, force, position, sense):
    p, r = machine(), DriveTrain(velocity=velocity, current=current, force=force, position=position)
    sense_of_motion(p, r)
    assert r.sense == sense


def test_friction_opposes_the_sense_of_motion():
    p = machine()
    assert friction_force(p, DriveTrain(sense=1, force=1.0)) == 1.0 - 7.55
    assert friction_force(p, DriveTrain(sense=-1, force=1.0)) == 1.0 + 5.87
    assert friction_force(p, DriveTrain(sense=0, force=1.0)) == 0.0


def test_motion_reversed_by_friction_is_rest_and_frames_stop_without_rebound():
    p = machine()
    reversed_ = DriveTrain(velocity=-1e-6, sense=1, position=0.5)
    settle_contacts(p, reversed_)
    assert reversed_.velocity == 0.0
    for position, velocity, end in ((1.001, 0.4, 1.0), (-0.001, -0.4, 0.0)):
        r = DriveTrain(velocity=velocity, sense=1 if velocity > 0 else -1, position=position)
        settle_contacts(p, r)
        assert (r.position, r.velocity) == (end, 0.0)


def test_leaving_a_frame_is_free():
    p, r = machine(), DriveTrain(velocity=-0.1, sense=-1, position=1.0)
    settle_contacts(p, r)
    assert r.velocity == -0.1


def test_current_rises_with_the_electrical_time_constant_at_standstill():
    p, r = machine(), DriveTrain(position=0.5)
    for n in range(1, 51):
        move_averaged(p, r, 3.0, 3.0)  # 0.25 A x 19.87 N/A = 4.97 N: friction holds
        assert r.current == pytest.approx(0.25 * (1 - math.exp(-n * 0.04)), rel=1e-12)
    assert (r.velocity, r.position, r.ticks_held) == (0.0, 0.5, 50)


def test_steady_speed_is_what_voltage_is_left_after_friction():
    p, r = machine(right_end=100.0), DriveTrain()
    for _ in range(30_000):
        move_averaged(p, r, 24.7, 24.7)
    assert r.current == pytest.approx(7.55 / K, rel=1e-9)
    assert r.velocity == pytest.approx((24.7 - 12 * 7.55 / K) / K, rel=1e-9)


def test_viscous_friction_of_each_direction():
    p = machine(viscous_right=3.0, viscous_left=5.0, left_end=-100.0, right_end=100.0)
    for volts, sense, coulomb, viscous in ((20.0, 1, 7.55, 3.0), (-20.0, -1, 5.87, 5.0)):
        r = DriveTrain()
        for _ in range(20_000):
            move_averaged(p, r, volts, volts)
        speed = (abs(volts) * K / 12 - coulomb) / (viscous + K * K / 12)
        assert r.velocity == pytest.approx(sense * speed, rel=1e-9)


def test_a_carriage_without_current_is_stopped_by_friction_after_the_textbook_way():
    p, r = machine(), DriveTrain(velocity=0.5, position=0.1)
    r.current = 0.0
    ticks = 0
    while r.velocity > 0.0:
        move_averaged(p, r, 0.0, 38.0)  # neither voltage lets a current start: between 0 and the supply
        ticks += 1
        assert ticks < 10_000
    deceleration = 7.55 / 1.3212
    assert r.current == 0.0
    assert r.position - 0.1 == pytest.approx(0.5**2 / 2 / deceleration, rel=1e-4)
    assert ticks * 40e-6 == pytest.approx(0.5 / deceleration, abs=41e-6)


def test_a_one_way_current_ends_at_zero_and_does_not_come_back():
    p, r = machine(), DriveTrain(velocity=1.0, position=0.1, current=0.5)
    currents = []
    for _ in range(200):
        move_averaged(p, r, 0.0, 38.0)  # drive right with count 0: forward current free-wheels against the back-EMF
        currents.append(r.current)
    assert (np.diff(currents) <= 0).all()
    assert currents[-1] == 0.0
    assert r.velocity < 1.0


def test_a_push_moves_the_carriage_against_friction():
    p, r = machine(), DriveTrain(position=0.5, force=20.0)
    for _ in range(1000):
        move_averaged(p, r, 0.0, 0.0)
    assert r.velocity > 0.0
    assert r.current < 0.0  # shorted motor brakes


def test_account_books_energy_and_the_largest_current():
    p, r = machine(), DriveTrain(current=-2.0)
    account(p, r, 10.0, 0.5)
    r.current = 1.0
    account(p, r, -4.0, 1.0)
    assert r.energy == pytest.approx((10.0 * 0.5 - 4.0) * 40e-6)
    assert (r.peak_current, r.voltage, r.mean_current) == (2.0, -4.0, 1.0)


def test_flow_without_conduction_keeps_the_current_at_zero():
    p, r = machine(), DriveTrain(velocity=0.5, sense=1)
    flow(p, r, 38.0, False, 1e-3)
    assert r.current == 0.0
    assert r.velocity == pytest.approx(0.5 - 7.55 / 1.3212 * 1e-3)


def test_flow_agrees_with_the_matrix_exponential():
    p = machine(viscous_right=4.0)
    a = np.array([[-12 / 12e-3, -K / 12e-3, 0], [K / 1.3212, -4.0 / 1.3212, 0], [0, 1, 0]])
    constant = np.array([15.0 / 12e-3, (2.0 - 7.55) / 1.3212, 0])
    # exp of the augmented matrix by repeated squaring of a long Taylor series: an independent way
    augmented = np.zeros((4, 4))
    augmented[:3, :3], augmented[:3, 3] = a, constant
    scaled, term, total = augmented * 1.7e-3 / 1024, np.eye(4), np.eye(4)
    for n in range(1, 20):
        term = term @ scaled / n
        total = total + term
    for _ in range(10):
        total = total @ total
    r = DriveTrain(current=0.2, velocity=0.3, position=0.1, force=2.0, sense=1)
    flow(p, r, 15.0, True, 1.7e-3)
    assert [r.current, r.velocity, r.position, 1.0] == pytest.approx(total @ [0.2, 0.3, 0.1, 1.0], rel=1e-11)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_current_driven_against_itself_passes_through_zero_where_both_voltages_are_equal(sign):
    p, r = machine(left_end=-1.0), DriveTrain(current=sign * 0.05, velocity=sign * 0.5)
    free = r.copy()
    for _ in range(3):
        move_averaged(p, r, -sign * 38.0, -sign * 38.0)  # a transistor conducts either way
        free.sense = sign  # the exact solution without an event
        flow(p, free, -sign * 38.0, True, p.period)
        assert r.current == pytest.approx(free.current, rel=1e-9)
        assert r.velocity == pytest.approx(free.velocity, rel=1e-9)
        assert sign * r.current < 0.0


@pytest.mark.parametrize("sign", [1, -1])
def test_a_current_that_only_a_diode_carries_does_not_pass_through_zero(sign):
    p, r = machine(left_end=-1.0), DriveTrain(current=sign * 0.05, velocity=sign * 0.5)
    move_averaged(p, r, -38.0, 38.0)
    assert r.current == 0.0
    assert sign * r.velocity < 0.5


def test_without_inductance_the_current_follows_voltage_and_velocity_at_once():
    p, r = machine(inductance=0.0, right_end=100.0), DriveTrain()
    speed = (24.0 - 12 * 7.55 / K) / K  # v(t) = speed (1 - exp(-t / time_constant)), from rest
    time_constant = 1.3212 * 12 / K**2
    r.current = 2.0  # what broke it loose
    for n in range(1, 501):
        move_averaged(p, r, 24.0, 24.0)
        decay = math.exp(-n * p.period / time_constant)
        assert r.velocity == pytest.approx(speed * (1 - decay), rel=1e-11)
        assert r.current == pytest.approx((24.0 - K * r.velocity) / 12, rel=1e-12)
        way = speed * (n * p.period - time_constant * (1 - decay))
        assert r.position == pytest.approx(way, rel=1e-9)


def test_without_inductance_a_held_motor_has_the_current_of_its_resistance():
    p, r = machine(inductance=0.0), DriveTrain(position=0.5)
    for volts in (3.0, -2.0, 0.0):
        move_averaged(p, r, volts, volts)
        assert (r.current, r.velocity, r.sense) == (volts / 12, 0.0, 0)


@pytest.mark.parametrize(("name", "sense"), [("right", 1), ("left", -1)])
def test_without_inductance_the_transition_is_the_limit_of_a_small_one(name, sense):
    faults = {"viscous_right": 3.0, "viscous_left": 5.0, "mass": 0.05}  # so light that a period of 40 us shows the drag
    none = getattr(machine(inductance=0.0, **faults), name)
    velocity, u, force = 0.7 * sense, 20.0 * sense, -4.0
    expected = responses(none, velocity, u, force)
    distances = []
    for inductance in (1e-5, 1e-6):
        small = getattr(machine(inductance=inductance, substep=0.02 * inductance, **faults), name)
        found = responses(small, velocity, u, force)
        assert found == pytest.approx(expected, rel=1e3 * inductance)
        distances.append(abs(found[1] / expected[1] - 1))
    assert distances[1] == pytest.approx(0.1 * distances[0], rel=0.1)  # ever nearer, in proportion
    assert none.i_i == none.v_i == none.x_i == 0.0  # the current is no state


def responses(m: Transition, velocity: float, u: float, force: float) -> list[float]:
    """Current, velocity and travel after a period."""
    return [
        getattr(m, f"{kind}_v") * velocity + getattr(m, f"{kind}_u") * u + getattr(m, f"{kind}_f") * force
        for kind in "ivx"
    ]


@pytest.mark.parametrize(("current", "sense", "coulomb"), [(1.5, 1, 7.55), (-1.5, -1, 5.87)])
def test_an_imposed_current_accelerates_as_its_force_less_friction(current, sense, coulomb):
    p, r = machine(left_end=-10.0, right_end=10.0), DriveTrain(force=2.0)
    acceleration = (K * current + 2.0 - sense * coulomb) / 1.3212
    for n in range(1, 201):
        before = r.velocity
        move_with_current(p, r, current)
        t = n * p.period
        assert r.velocity == pytest.approx(acceleration * t, rel=1e-10)
        assert r.position == pytest.approx(acceleration * t**2 / 2, rel=1e-9)
        assert (r.current, r.mean_current, r.sense) == (current, current, sense)
        assert r.voltage == pytest.approx(12 * current + K * r.velocity, rel=1e-12)
        assert abs(r.velocity) > abs(before)
    assert r.peak_current == 1.5


def test_an_imposed_current_below_friction_holds():
    p, r = machine(), DriveTrain(position=0.5)
    for _ in range(10):
        move_with_current(p, r, 0.4)  # 7.9 N of 8.68 N
    assert (r.velocity, r.position, r.ticks_held, r.current) == (0.0, 0.5, 10, 0.4)
    assert r.energy == pytest.approx(10 * 12 * 0.4**2 * p.period)


def test_an_imposed_current_meets_viscous_friction_and_the_frames():
    p, r = machine(viscous_right=10.0, right_end=0.02), DriveTrain()
    top = (K * 2.0 - 7.55) / 10.0
    for n in range(1, 300):
        move_with_current(p, r, 2.0)
        assert r.velocity == pytest.approx(top * (1 - math.exp(-10.0 / 1.3212 * n * p.period)), rel=1e-9)
        assert r.position < 0.02
    for _ in range(2000):
        move_with_current(p, r, 2.0)
    assert (r.position, r.velocity) == (0.02, 0.0)
    move_with_current(p, r, 2.0)
    assert (r.position, r.velocity, r.sense) == (0.02, 0.0, 0)


def test_a_current_against_the_motion_brakes_to_rest_and_not_beyond():
    p, r = machine(), DriveTrain(velocity=1e-6, position=0.5)
    move_with_current(p, r, -0.2)  # 4 N: with friction it brakes, alone it holds
    assert r.velocity == 0.0
    move_with_current(p, r, -0.2)
    assert (r.velocity, r.sense) == (0.0, 0)


def test_default_plant_accelerates_at_600_in_s2_with_96_counts_of_ir():
    t = Rig().p.plant.train
    assert 96 * 38 / 300 / t.resistance * t.force_constant / t.mass == pytest.approx(600 * 0.0254, rel=1e-3)


def test_default_plant_is_that_of_the_specification():
    p = Rig().p.plant.train
    assert p.emf_constant == p.force_constant == pytest.approx(19.870, rel=1e-4)
    assert p.mass == pytest.approx(1.3212, rel=1e-3)
    assert p.friction.coulomb_right == pytest.approx(7.55, rel=1e-3)
    assert p.friction.coulomb_left == pytest.approx(5.87, rel=1e-3)
    assert p.right_end / (0.0254 / 300) == pytest.approx(4350)
