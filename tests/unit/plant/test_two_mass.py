"""The equations of motor and load against their closed forms."""

import math

import numpy as np
import pytest
from scipy.linalg import expm
from tests.cascade_rig import set_friction
from tests.two_mass_rig import M1, M2, D, H, K, M, coupled, energy, machine, motor, moving, run, state

from detent.plant.linear_two_mass import fastest_rate
from detent.plant.two_mass_motion import move_masses

# -- one mass ----------------------------------------------------------------------------------------------------------


def test_a_force_accelerates_motor_and_load_as_one():
    r = run(machine(), moving(effort=3.0, external=1.0), 1000)
    t = 1000 * H
    assert r.load.velocity == r.motor.velocity == pytest.approx(4.0 / M * t, rel=1e-11)
    assert r.load.position == r.motor.position == pytest.approx(2.0 / M * t**2, rel=1e-11)


def test_viscous_friction_of_both_makes_a_first_order_lag():
    p, r = machine(), moving(effort=3.0)
    set_friction(p.motor.friction, viscous=30.0)
    set_friction(p.load.friction, viscous=10.0)
    tau = M / 40.0
    for n in range(1, 2001):
        move_masses(p, r)
        t = n * H
        lag = -math.expm1(-t / tau)
        assert r.load.velocity == pytest.approx(3.0 / 40.0 * lag, rel=1e-9)
        assert r.load.position == pytest.approx(3.0 / 40.0 * (t - tau * lag), rel=1e-8, abs=1e-15)


def test_back_emf_makes_a_first_order_lag():
    p, r = motor(machine()), moving(effort=24.0)
    tau, top = M * 2.0 / 90.0, 24.0 / 9.0
    for n in range(1, 1001):
        move_masses(p, r)
        assert r.load.velocity == pytest.approx(-top * math.expm1(-n * H / tau), rel=1e-10)
        assert r.current == pytest.approx((24.0 - 9.0 * r.load.velocity) / 2.0, rel=1e-12)


def test_the_winding_is_a_second_lag():
    p, r = motor(machine(), inductance=4e-3), moving(effort=24.0)
    set_friction(p.load.friction, viscous=5.0)
    a = np.array([[-2.0 / 4e-3, -9.0 / 4e-3, 24.0 / 4e-3], [10.0 / M, -5.0 / M, 0.0], [0.0, 0.0, 0.0]])
    for n in range(1, 301):
        move_masses(p, r)
        current, velocity, _ = expm(a * n * H) @ [0.0, 0.0, 1.0]
        assert r.current == pytest.approx(current, rel=2e-7)
        assert r.motor.velocity == pytest.approx(velocity, rel=5e-6)


def test_the_current_stays_at_its_limit():
    p, r = motor(machine(), inductance=4e-3), moving(effort=24.0)
    p.winding.max_current = 3.0
    run(p, r, 50)
    assert r.current == 3.0
    begin = r.motor.velocity
    run(p, r, 100)
    assert r.motor.velocity - begin == pytest.approx(100 * H * 30.0 / M, rel=1e-12)


@pytest.mark.parametrize(("position", "pull"), [(0.3, math.sin(0.3)), (-math.pi / 2, -1.0), (math.pi, 0.0)])
def test_weight_and_pendulum_pull(position, pull):
    r = run(machine(weight=2.0, pendulum=6.0, period=1e-6), moving(position=position), 1)
    assert r.load.velocity == pytest.approx(-(2.0 + 6.0 * pull) / M * 1e-6, rel=1e-9, abs=1e-20)


def test_a_pendulum_swings_with_its_frequency():
    p, r = machine(pendulum=50.0), moving(position=1e-3)
    n = round(2 * math.pi * math.sqrt(M / 50.0) / H)
    run(p, r, n)
    assert r.load.position == pytest.approx(1e-3, rel=1e-5)
    run(p, r, n // 2)
    assert r.load.position == pytest.approx(-1e-3, rel=1e-5)


# -- two masses --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("damping", [0.0, D, 200.0])
def test_two_masses_swing_and_decay_as_their_eigenvalues_say(damping):
    p, r = coupled(period=2e-5, damping=damping), moving()
    r.motor.position, r.load.position = 1e-4 * M2 / M, -1e-4 * M1 / M
    reduced = M1 * M2 / M
    decay = damping / (2 * reduced)
    omega = math.sqrt(K / reduced - decay**2)
    for n in range(1, 2001):
        move_masses(p, r)
        t = n * 2e-5
        swing = math.exp(-decay * t) * (math.cos(omega * t) + decay / omega * math.sin(omega * t))
        assert r.motor.position - r.load.position == pytest.approx(1e-4 * swing, abs=1e-10)
    assert M1 * r.motor.position + M2 * r.load.position == pytest.approx(0.0, abs=1e-16)


def test_motor_winding_coupling_and_load_as_the_matrix_exponential_says():
    p, r = motor(coupled(period=2e-5), inductance=4e-3), moving(effort=24.0, external=-3.0)
    set_friction(p.motor.friction, viscous=7.0)
    set_friction(p.load.friction, viscous=11.0)
    a = np.zeros((6, 6))
    a[0] = [-500.0, 0.0, -9.0 / 4e-3, 0.0, 0.0, 24.0 / 4e-3]
    a[1, 2] = a[3, 4] = 1.0
    a[2, :5] = np.array([10.0, -K, -D - 7.0, K, D]) / M1
    a[4] = np.array([0.0, K, D, -K, -D - 11.0, -3.0]) / M2
    run(p, r, 1500)
    assert state(r) == pytest.approx((expm(a * 1500 * 2e-5) @ [0.0, 0.0, 0.0, 0.0, 0.0, 1.0])[:5], rel=1e-6)


def test_a_stiff_coupling_is_nearly_rigid():
    rigid, stiff = machine(period=2e-6), coupled(period=2e-6, stiffness=1e9, damping=2e4)
    for p in (rigid, stiff):
        p.weight = 2.0
        set_friction(p.motor.friction, coulomb=3.0, static=3.0, viscous=4.0)
        set_friction(p.load.friction, coulomb=2.0, static=2.5, stribeck=0.01)
    ends = [run(p, moving(0.2, effort=4.0), 5000) for p in (rigid, stiff)]
    assert ends[0].load.position > 1e-3
    assert ends[1].load.position == pytest.approx(ends[0].load.position, rel=1e-4)
    assert ends[1].load.velocity == pytest.approx(ends[0].load.velocity, rel=1e-4)


def test_without_losses_energy_stays_through_many_impacts():
    p, r = coupled(period=2e-5, damping=0.0, half_gap=1e-4, pendulum=300.0), moving(0.5)
    begin = energy(p, r)
    impacts = 0
    for _ in range(20_000):
        side = r.side
        move_masses(p, r)
        impacts += r.side != 0 and side == 0
    assert impacts > 20
    assert energy(p, r) == pytest.approx(begin, rel=1e-7)


def test_work_is_kinetic_energy_strain_height_and_heat():
    p, r = coupled(period=1e-5, weight=2.0), moving(effort=6.0)
    set_friction(p.motor.friction, coulomb=0.5, static=0.7, stribeck=0.01, viscous=3.0)
    set_friction(p.load.friction, coulomb=0.25, viscous=2.0)
    heat = 0.0

    def loss() -> float:
        v, w = r.motor.velocity, r.load.velocity
        dry = (0.5 + 0.2 * math.exp(-((v / 0.01) ** 2))) * abs(v) + 0.25 * abs(w)
        return dry + 3.0 * v**2 + 2.0 * w**2 + D * (v - w) ** 2

    before = 0.0
    for _ in range(20_000):
        move_masses(p, r)
        now = loss()
        heat += 0.5e-5 * (before + now)
        before = now
    assert heat > 0.04
    assert energy(p, r) + heat == pytest.approx(6.0 * r.motor.position, rel=1e-6)


# -- how fast they are ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("p", "rate"),
    [
        (coupled(damping=0.0), math.sqrt(K * M / (M1 * M2))),
        (machine(pendulum=50.0), math.sqrt(50.0 / M)),
        (motor(machine()), 90.0 / 2.0 / M),
    ],
    ids=["coupling", "pendulum", "back-EMF"],
)
def test_the_fastest_rate_is_that_of_the_eigenvalues(p, rate):
    assert fastest_rate(p) == pytest.approx(rate, rel=1e-9)


def test_the_fastest_rate_knows_winding_and_friction():
    p = motor(machine(), inductance=1e-3)
    assert 1900.0 < fastest_rate(p) < 2000.0
    p = machine()
    set_friction(p.motor.friction, viscous=400.0)
    assert fastest_rate(p) == pytest.approx(400.0 / M)
    set_friction(p.motor.friction, coulomb=1.0, static=3.0, stribeck=1e-3)
    assert fastest_rate(p) == pytest.approx((2.0 / 1e-3 * math.sqrt(2 / math.e) - 400.0) / M)
