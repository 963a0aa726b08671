import math

import pytest

from detent.plant.rotary_motor import (
    FULL_TURN,
    LoadTorque,
    RotaryMotor,
    RotaryMotorParams,
    fill_motor,
    load_torque,
    rotate,
    stand_at,
)

J, STIFFNESS, TICK = 1e-3, 0.05, 1e-4


def machine(stiffness: float = STIFFNESS, **changes: float) -> RotaryMotorParams:
    p = RotaryMotorParams(inertia=J, period=TICK)
    for name, value in changes.items():
        setattr(p, name, value)
    fill_motor(p, stiffness)
    return p


def way(r: RotaryMotor) -> float:
    return r.turns * FULL_TURN + r.angle


def test_within_its_limit_the_amplifier_makes_a_first_order_lag():
    p, r = machine(), RotaryMotor()
    travel = 0.0
    for n in range(1, 1001):
        travel += rotate(p, r, STIFFNESS * 100.0, True)
        t = n * TICK
        assert r.velocity == pytest.approx(100.0 * (1 - math.exp(-t / 0.02)), rel=1e-11)
        assert way(r) == pytest.approx(100.0 * (t - 0.02 * (1 - math.exp(-t / 0.02))), rel=1e-9)
    assert travel == pytest.approx(way(r), rel=1e-12)


def test_viscous_friction_makes_it_droop():
    p, r = machine(0.95 * STIFFNESS, viscous=0.05 * STIFFNESS), RotaryMotor()
    for _ in range(10_000):
        rotate(p, r, 0.95 * STIFFNESS * 100.0, True)
    assert r.velocity == pytest.approx(95.0, rel=1e-12)


@pytest.mark.parametrize("viscous", [0.0, 1e-9, 1e-3, 0.2])
def test_at_its_limit_the_torque_is_constant(viscous):
    p, r = machine(viscous=viscous), RotaryMotor()
    for n in range(1, 501):
        rotate(p, r, -0.4, False)
        t, k = n * TICK, viscous / J
        lag = k * t
        speed = -0.4 / J * (t if lag < 1e-3 else -math.expm1(-lag) / k)
        assert r.velocity == pytest.approx(speed, rel=1e-3 if 0 < lag < 1e-3 else 1e-10)
    assert way(r) == pytest.approx(-0.4 / J * 0.05**2 / 2, rel=1e-7) or viscous > 1e-6


@pytest.mark.parametrize("lag", [0.0099, 0.0101, 1e-6, 3.0])
def test_responses_keep_their_digits_at_any_lag(lag):
    p = machine(0.0, viscous=lag * J / TICK)
    # x_t = (h - v_t J) / viscous cancels; by the series of (lag - 1 + exp(-lag)) / lag^2 in high precision:
    series = sum((-lag) ** n / math.factorial(n + 2) for n in range(60))
    assert p.free.x_t == pytest.approx(TICK * TICK / J * series, rel=1e-11)
    assert p.free.x_v == pytest.approx(TICK * -math.expm1(-lag) / lag, rel=1e-14)


def test_static_friction_holds_and_coulomb_friction_brakes():
    p, r = machine(0.0, static=0.3, coulomb=0.2), RotaryMotor()
    assert rotate(p, r, 0.3, False) == 0.0
    assert (r.velocity, r.sense) == (0.0, 0)
    rotate(p, r, -0.31, False)
    assert r.velocity == pytest.approx(-0.11 / J * TICK)
    r.velocity = 1.0
    ticks = 0
    while r.velocity > 0.0:
        rotate(p, r, 0.0, False)
        ticks += 1
    assert r.velocity == 0.0  # reversed by friction is rest
    assert ticks == math.ceil(1.0 / (0.2 / J * TICK))


def test_motion_reversed_by_the_drive_goes_on():
    p, r = machine(0.0, static=0.3, coulomb=0.2), RotaryMotor(velocity=0.001)
    rotate(p, r, -1.0, False)
    assert r.velocity < 0.0


def test_without_friction_it_passes_through_zero_speed():
    p, r = machine(0.0), RotaryMotor(velocity=0.01)
    rotate(p, r, -0.5, False)
    assert r.velocity == pytest.approx(0.01 - 0.5 / J * TICK)


@pytest.mark.parametrize("sign", [1, -1])
def test_whole_turns_are_counted_apart(sign):
    p, r = machine(0.0), RotaryMotor()
    stand_at(r, sign * 1e15)
    start = r.turns
    r.velocity = sign * 3 * FULL_TURN / TICK  # several turns in a tick
    for _ in range(7):
        rotate(p, r, 0.0, False)
        assert 0.0 <= r.angle < FULL_TURN
    assert (r.turns - start) + r.angle / FULL_TURN == pytest.approx(sign * 21, abs=1e-9)


@pytest.mark.parametrize("turns", [0.0, 0.25, -0.25, -3.0, 12.75])
def test_standing_at_an_angle(turns):
    r = RotaryMotor(velocity=3.0)
    stand_at(r, turns)
    assert r.turns + r.angle / FULL_TURN == turns
    assert 0 <= r.angle < FULL_TURN
    assert r.velocity == 0.0


def test_the_load_acts_in_its_ticks():
    p = LoadTorque(torque=-0.5, begin=3, end=5)
    assert [load_torque(p, tick) for tick in range(6)] == [0.0, 0.0, 0.0, -0.5, -0.5, 0.0]
