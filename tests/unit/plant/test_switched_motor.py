import numpy as np
import pytest

from detent.plant.drive_train import DriveTrain, DriveTrainParams, fill_period, flow
from detent.plant.switched_motor import (
    CLOCKS,
    Scratch,
    SwitchedParams,
    fill_pulse_table,
    move_switched,
    part_of_period,
    time_of_zero,
    whole_period,
)

K = 19.87
SUPPLY = 38.0
RIGHT = (SUPPLY, SUPPLY, 0.0, SUPPLY)
"""Drive right: terminal voltage while PWM is high (current positive, negative), while it is low."""
BRAKE = (-SUPPLY, 0.0, -SUPPLY, SUPPLY)
"""Transition moving right: Q3 pulsed."""


def machine() -> tuple[DriveTrainParams, SwitchedParams]:
    """The default plant's train and its pulse responses."""
    p = DriveTrainParams(resistance=12.0, inductance=12e-3, force_constant=K, emf_constant=K, mass=1.3212)
    p.left_end, p.right_end, p.period, p.substep = 0.0, 1.0, 40e-6, 0.2e-3
    f = p.friction
    f.coulomb_right, f.coulomb_left, f.static_right, f.static_left = 7.55, 5.87, 8.68, 6.75
    f.viscous_right, f.viscous_left = 1.0, 2.0
    fill_period(p)
    q = SwitchedParams()
    fill_pulse_table(p, q)
    return p, q


def by_parts(p: DriveTrainParams, r: DriveTrain, pulse: int, u_on: float, u_off: float) -> None:
    """A period whose current keeps its sign, by the power series."""
    on_time = p.period * pulse / CLOCKS
    flow(p, r, u_on, True, on_time)
    flow(p, r, u_off, True, p.period - on_time)


@pytest.mark.parametrize("pulse", [1, 37, 150, 299])
@pytest.mark.parametrize(("current", "velocity", "u_on", "u_off"), [(0.5, 0.8, 38.0, 0.0), (-0.6, -0.9, -38.0, 0.0)])
def test_the_table_gives_what_the_parts_give(pulse, current, velocity, u_on, u_off):
    p, q = machine()
    sense = 1 if velocity > 0 else -1
    table = DriveTrain(current=current, velocity=velocity, position=0.5, sense=sense, force=0.7)
    parts = table.copy()
    w = Scratch()
    assert whole_period(p, q, table, w, pulse, u_on, u_off)
    by_parts(p, parts, pulse, u_on, u_off)
    for name in ("current", "velocity", "position"):
        assert getattr(table, name) == pytest.approx(getattr(parts, name), rel=1e-12)
    assert w.volt_seconds == pytest.approx(p.period * (u_on * pulse + u_off * (CLOCKS - pulse)) / CLOCKS)


def test_a_period_in_which_the_current_ends_is_left_to_the_parts():
    p, q = machine()
    r = DriveTrain(current=0.001, velocity=1.0, position=0.5, sense=1)
    before = r.snapshot()
    assert not whole_period(p, q, r, Scratch(), 10, 0.0, 0.0)
    assert r.snapshot() == before


def test_a_current_that_only_dips_through_zero_is_left_to_the_parts_too():
    p, q = machine()
    r = DriveTrain(current=0.005, velocity=0.1, position=0.5, sense=1)
    assert not whole_period(p, q, r, Scratch(), 100, -SUPPLY, SUPPLY)
    alone = r.copy()
    by_parts(p, alone, 100, -SUPPLY, SUPPLY)
    assert alone.current > 0.0  # its end alone does not show the dip


def test_zero_of_the_current_is_found_to_rounding():
    p, _ = machine()
    r = DriveTrain(current=0.02, velocity=0.9, sense=1)
    w = Scratch(trial=r.copy())
    flow(p, w.trial, 0.0, True, 40e-6)
    assert w.trial.current < 0
    t = time_of_zero(p, r, w, 0.0, 40e-6)
    assert 0 < t < 40e-6
    check = r.copy()
    flow(p, check, 0.0, True, t)
    assert abs(check.current) < 1e-12


def test_current_that_reaches_zero_rests_there():
    p, _ = machine()
    r, w = DriveTrain(current=0.01, velocity=0.9, position=0.5, sense=1), Scratch()
    part_of_period(p, r, w, 0.0, SUPPLY, 40e-6)
    assert r.current == 0.0
    # Terminal voltage: 0 until the current ends, then the back-EMF.
    assert 0 < w.volt_seconds < 0.9 * K * 40e-6


def test_discontinuous_current_repeats_its_triangle_each_period():
    p, q = machine()
    p.mass, p.friction.coulomb_right = 1e12, 0.0
    fill_period(p)
    fill_pulse_table(p, q)
    emf, pulse = 20.19, 99
    r, w = DriveTrain(velocity=emf / K, position=0.5), Scratch()
    for _ in range(10):
        r.peak_current = 0.0
        move_switched(p, q, r, w, pulse, *RIGHT)
        assert r.current == 0.0
    on = 40e-6 * pulse / 300
    peak = (SUPPLY - emf) / 12 * (1 - np.exp(-on / 1e-3))
    assert r.peak_current == pytest.approx(peak, rel=1e-9)


def test_charge_and_mean_current_agree():
    p, q = machine()
    fine = p.copy()
    r, w = DriveTrain(current=0.3, velocity=0.5, position=0.5), Scratch()
    reference = r.copy()
    reference.sense = 1
    charge = 0.0
    pieces = 4000
    for n in range(pieces):
        before = reference.current
        flow(fine, reference, SUPPLY if n < pieces * 0.4 else 0.0, True, p.period / pieces)
        charge += 0.5 * (before + reference.current) * p.period / pieces
    move_switched(p, q, r, w, 120, *RIGHT)
    assert r.mean_current * p.period == pytest.approx(charge, rel=1e-7)
    assert r.voltage == pytest.approx(SUPPLY * 0.4)


def test_a_braking_current_flows_backward_only():
    p, q = machine()
    r, w = DriveTrain(velocity=1.0, position=0.2), Scratch()
    currents = []
    for _ in range(500):
        move_switched(p, q, r, w, 201, *BRAKE)
        currents.append(r.current)
    assert max(currents) <= 0.0
    assert min(currents) < -0.4
    assert r.velocity < 0.9


def test_standstill_without_drive_stays_exactly_still():
    p, q = machine()
    r, w = DriveTrain(position=0.5), Scratch()
    for _ in range(100):
        move_switched(p, q, r, w, 0, *RIGHT)
    assert (r.current, r.velocity, r.position, r.energy, r.ticks_held) == (0.0, 0.0, 0.5, 0.0, 100)


def test_a_full_pulse_is_a_constant_voltage():
    p, q = machine()
    switched, constant = DriveTrain(position=0.1, current=0.01), DriveTrain(position=0.1, current=0.01, sense=0)
    move_switched(p, q, switched, Scratch(), CLOCKS, *RIGHT)
    flow(p, constant, SUPPLY, True, p.period)
    assert switched.current == pytest.approx(constant.current, rel=1e-12)
