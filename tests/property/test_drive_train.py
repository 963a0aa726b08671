"""The drive train for every state: energy, exactness, and the agreement of its two fidelities."""

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from detent.drive.h_bridge import Bridge, BridgeLines, decode, steer, terminal_voltage
from detent.plant.drive_train import (
    DriveTrain,
    DriveTrainParams,
    apply_transition,
    fill_period,
    flow,
    friction_force,
    move_averaged,
)
from detent.plant.switched_motor import Scratch, SwitchedParams, fill_pulse_table, move_switched

K = 19.87
SUPPLY = 38.0

currents = st.floats(-3, 3)
velocities = st.floats(-1.5, 1.5)
viscosities = st.sampled_from([0.0, 2.0])


@cache
def machine(viscous: float = 0.0) -> tuple[DriveTrainParams, SwitchedParams]:
    """The default plant's train on a guide too long to reach its ends."""
    p = DriveTrainParams(resistance=12.0, inductance=12e-3, force_constant=K, emf_constant=K, mass=1.3212)
    p.left_end, p.right_end, p.period, p.substep = -1e3, 1e3, 40e-6, 0.2e-3
    f = p.friction
    f.coulomb_right, f.coulomb_left, f.static_right, f.static_left = 7.55, 5.87, 8.68, 6.75
    f.viscous_right = f.viscous_left = viscous
    fill_period(p)
    q = SwitchedParams()
    fill_pulse_table(p, q)
    return p, q


def energy(p: DriveTrainParams, r: DriveTrain) -> float:
    """Magnetic and kinetic energy [J]."""
    return 0.5 * p.inductance * r.current**2 + 0.5 * p.mass * r.velocity**2


def end_of_motion(p: DriveTrainParams, r: DriveTrain, last_current: float) -> float:
    """Energy [J] that the tick in which motion ends may be wrong by; 0 while the carriage moves on.

    The end is known to a tick: until it, friction drives the carriage backward by at most F T / m, whose back-EMF
    changes the current. Nothing of it stays but that current.
    """
    if r.velocity != 0.0:
        return 0.0
    backward = (K * abs(last_current) + 7.55) * p.period / p.mass
    change = K * backward * p.period / p.inductance
    return p.inductance * (abs(last_current) + change) * change


@given(current=currents, velocity=velocities, viscous=viscosities)
def test_energy_of_a_shorted_motor_never_grows(current, velocity, viscous):
    p, _ = machine(viscous)
    r = DriveTrain(current=current, velocity=velocity)
    for _ in range(50):
        before, last = energy(p, r), r.current
        move_averaged(p, r, 0.0, 0.0)
        assert energy(p, r) <= before * (1 + 1e-12) + end_of_motion(p, r, last)


@given(
    current=currents,
    velocity=velocities,
    viscous=viscosities,
    lines=st.sampled_from([(1, 0), (0, 0), (1, 1), (0, 1)]),
    pulse=st.integers(0, 300),
)
def test_switches_that_do_not_drive_never_add_energy(current, velocity, viscous, lines, pulse):
    right, transition = lines
    p, q = machine(viscous)
    pulse = pulse if transition else 0
    r, w = DriveTrain(current=current, velocity=velocity), Scratch()
    bridge = Bridge()
    steer(bridge, BridgeLines(right_left=right, transition=transition), pulse, SUPPLY)
    voltages = (bridge.on_positive, bridge.on_negative, bridge.off_positive, bridge.off_negative)
    # Only the lower switches: no current can flow out of the supply, whatever the diodes carry. Drive with count 0
    # holds one lower switch on, so its pulse is never on; transition pulses one.
    for _ in range(50):
        before, last = energy(p, r), r.current
        move_switched(p, q, r, w, pulse, *voltages)
        assert energy(p, r) <= before * (1 + 1e-12) + end_of_motion(p, r, last)


@given(current=currents, velocity=velocities, right=st.booleans(), count=st.integers(0, 300))
def test_averaged_braking_adds_no_more_than_a_tick_of_the_last_current(current, velocity, right, count):
    p, _ = machine()
    r, bridge = DriveTrain(current=current, velocity=velocity), Bridge()
    steer(bridge, BridgeLines(right_left=right, transition=1), count, SUPPLY)
    for _ in range(50):
        before, last = energy(p, r), r.current
        move_averaged(p, r, bridge.mean_positive, bridge.mean_negative)
        # Where a one-way current ends is known to a tick: in that tick, and only there, the wrong sign counts.
        ended = last != 0.0 and r.current == 0.0
        slack = SUPPLY * (abs(last) + 0.2) * p.period if ended else 0.0
        assert energy(p, r) <= before * (1 + 1e-12) + slack + end_of_motion(p, r, last)


@given(
    current=currents,
    velocity=st.floats(0.01, 1.5),
    u=st.floats(-SUPPLY, SUPPLY),
    force=st.floats(-20, 20),
    left=st.booleans(),
    viscous=viscosities,
    conducting=st.booleans(),
)
def test_whole_period_matrix_is_the_sum_of_many_small_flows(current, velocity, u, force, left, viscous, conducting):
    p, _ = machine(viscous)
    sense = -1 if left else 1
    matrix = DriveTrain(current=current if conducting else 0.0, velocity=sense * velocity, force=force, sense=sense)
    parts = matrix.copy()
    moving, coasting = (p.left, p.coast_left) if left else (p.right, p.coast_right)
    transition = moving if conducting else coasting
    apply_transition(transition, matrix, u if conducting else 0.0, friction_force(p, matrix))
    for _ in range(64):
        flow(p, parts, u, conducting, p.period / 64)
    scale = (3.0, 1.5, 1.5 * p.period)
    for name, size in zip(("current", "velocity", "position"), scale, strict=True):
        assert math.isclose(getattr(matrix, name), getattr(parts, name), rel_tol=1e-11, abs_tol=1e-12 * size)


@given(current=currents, velocity=velocities, split=st.floats(0.01, 0.99), u=st.floats(-SUPPLY, SUPPLY))
def test_a_flow_may_be_split_anywhere(current, velocity, split, u):
    p, _ = machine(2.0)
    whole = DriveTrain(current=current, velocity=velocity, sense=1)
    parts = whole.copy()
    flow(p, whole, u, True, 1e-3)
    flow(p, parts, u, True, 1e-3 * split)
    flow(p, parts, u, True, 1e-3 * (1 - split))
    assert [parts.current, parts.velocity, parts.position] == pytest.approx(
        [whole.current, whole.velocity, whole.position], rel=1e-10, abs=1e-12
    )


@given(
    current=st.floats(-1, 1),
    velocity=velocities,
    pulse=st.integers(0, 300),
    gates=st.tuples(st.booleans(), st.booleans()),
)
def test_mean_voltage_of_a_period_is_within_the_supply_and_its_current_flows_as_the_diodes_let_it(
    current, velocity, pulse, gates
):
    right, transition = gates
    p, q = machine()
    r, w = DriveTrain(current=current, velocity=velocity), Scratch()
    on, off = (decode(pwm, right, transition) for pwm in (1, 0))
    voltages = [terminal_voltage(g, SUPPLY, sign) for g in (on, off) for sign in (1, -1)]
    for _ in range(5):
        move_switched(p, q, r, w, pulse, *voltages)
        assert abs(r.voltage) <= max(SUPPLY, K * 1.6) * (1 + 1e-9)
        assert math.isfinite(r.current)
        assert math.isfinite(r.velocity)
        assert r.peak_current >= abs(r.current)


@settings(max_examples=30)
@given(count=st.integers(60, 300), right=st.booleans())
def test_both_fidelities_agree_on_a_start_and_the_steady_speed(count, right):
    p, q = machine()
    averaged, switched, w, bridge = DriveTrain(), DriveTrain(), Scratch(), Bridge()
    steer(bridge, BridgeLines(right_left=right), count, SUPPLY)
    voltages = (bridge.on_positive, bridge.on_negative, bridge.off_positive, bridge.off_negative)
    for n in range(8000):
        move_averaged(p, averaged, bridge.mean_positive, bridge.mean_negative)
        move_switched(p, q, switched, w, count, *voltages)
        if n in (1000, 3000, 7999):
            # The ripple is in the state at the trigger (at most 16 mA); velocity and travel hardly see it.
            assert switched.velocity == pytest.approx(averaged.velocity, rel=2e-3)
            assert switched.position == pytest.approx(averaged.position, rel=5e-3)
            assert switched.mean_current == pytest.approx(averaged.mean_current, abs=2e-3)


@given(velocity=velocities, ticks=st.integers(1, 60))
def test_friction_stops_but_never_reverses(velocity, ticks):
    p, _ = machine()
    r = DriveTrain(velocity=velocity)
    for _ in range(ticks):
        move_averaged(p, r, -SUPPLY, SUPPLY)  # all switches open, no current: the carriage coasts
        assert r.velocity * velocity >= 0.0
        assert abs(r.velocity) <= abs(velocity)
    friction = 7.55 if velocity > 0 else 5.87
    expected = max(0.0, abs(velocity) - friction / p.mass * ticks * p.period)
    assert abs(r.velocity) == pytest.approx(expected, rel=1e-9, abs=friction / p.mass * p.period)
    # The tick in which it stops may take it back by F T^2 / 2 m: 5 nm.
    assert r.position * np.sign(velocity) >= -0.5 * friction / p.mass * p.period**2 * (1 + 1e-9)
