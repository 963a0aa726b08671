"""Derived figures of a cascade axis, worked out by hand or met by the axis itself."""

import math

import numpy as np
import pytest
from tests.cascade_rig import Rig

from detent.methods.cascade.build import build_cascade, motion_limits
from detent.methods.cascade.derive import CascadeFigures, derive
from detent.planning.profile import plan_move

PID = ("method.structure=pid", "method.proportional=4 kV/m", "method.derivative=100 V*s/m")
WIDE = "method.velocity_limit=5 m/s"
UNFED = "method.feed_forward.viscous=0.5"
SINGLE = ("method.velocity_integral=0 V/m",)


def figures(spec):
    return {figure.name: figure for figure in derive(spec)}


def test_figures_of_the_example(load_text, good_text):
    found = figures(load_text(good_text).spec)
    m1, m2, k = 8 + 600e-7 / (0.01 / (2 * math.pi)) ** 2, 30.0, 60e6
    assert found["moving mass m"].value == pytest.approx(m1 + m2)
    assert found["motor-side mass m1"].value == pytest.approx(m1)
    assert found["anti-resonance"].value == pytest.approx(math.sqrt(k / m2) / (2 * math.pi))
    assert found["resonance"].value == pytest.approx(math.sqrt(k * (1 / m1 + 1 / m2)) / (2 * math.pi))
    assert found["damping ratio of the resonance"].value == pytest.approx(
        2000 * (1 / m1 + 1 / m2) / 2 / (2 * math.pi * 314), 1e-3
    )
    assert found["dead time of the velocity loop"].value == pytest.approx(0.25e-3 * 2 + 0.3e-3)
    assert found["velocity resolution"].value == pytest.approx(1e-6 / 0.25e-3)
    assert found["motor speed at limits.speed"].text == "3000 rpm"
    assert found["largest force"].value == pytest.approx(600)
    assert found["acceleration force"].value == pytest.approx(5 * (m1 + m2) + 14 + 8 + 60)
    per_volt = 0.8 * 0.35 / (0.01 / (2 * math.pi))
    assert found["acceleration command"].value == pytest.approx((5 * (m1 + m2) + 82) / per_volt)
    current = (5 * (m1 + m2) + 82) / (per_volt / 0.8)
    assert found["motor voltage"].value == pytest.approx(1.2 * current + 0.35 * 100 * math.pi)
    assert found["acceleration time"].value == pytest.approx(0.1)
    assert found["acceleration distance"].value == pytest.approx(0.025)
    assert found["following error at limits.speed"].value == 0.0
    assert "error at rest" not in found
    assert 40 < found["bandwidth of the velocity loop"].value < 50
    assert found["gain margin"].value > 1.5


def test_a_rotary_axis_speaks_of_torque_and_inertia(load_text, rotary_text):
    found = figures(load_text(rotary_text).spec)
    assert found["moving moment of inertia m"].unit == "kg*m^2"
    assert found["largest torque"].text == "3 N*m"
    assert found["velocity resolution"].text == "1 deg/s"
    assert found["acceleration distance"].text == "45 deg"
    assert "motor voltage" not in found


def test_a_force_drive_has_no_motor_figures(load_text, short_text):
    found = figures(load_text(short_text, "mechanics.weight=3 N").spec)
    assert not {"motor speed at limits.speed", "motor voltage", "resonance"} & set(found)
    assert found["moving mass m"].formula == "motor_mass + load_mass"
    assert found["command that holds the weight"].text == "3 V"
    assert found["error at rest"].value == pytest.approx(3 / (60 * 500))


def steady_error(spec, sense):
    """Following error of the axis at limits.speed [m], the mean of the last tenth before it slows down."""
    p = build_cascade(spec)
    start = spec.mechanics.start_position
    limits = motion_limits(spec)
    move = plan_move(start, start + sense * 0.2, limits, spec.method.sample_period)
    rig = Rig(p, start)
    run = rig.record(
        move.count * p.controller.sample_ticks,
        ["controller.law.position_error"],
        p.controller.sample_ticks,
        profile=move,
    )
    fast = np.flatnonzero(np.abs(move.velocity) > limits.speed * (1 - 1e-9))
    chosen = fast[-len(fast) // 10 :]
    return float(run["controller.law.position_error"][chosen].mean())


@pytest.mark.compiled
@pytest.mark.parametrize(
    "overrides",
    [
        ("method.feed_forward.velocity=0.5",),
        (*SINGLE, "method.feed_forward.velocity=0"),
        (*SINGLE, "method.feed_forward.viscous=0", "method.feed_forward.coulomb=0"),
        (*SINGLE, "mechanics.weight=60 N", "mechanics.friction.offset=12 N"),
        (*SINGLE, "drive.input=voltage", "drive.voltage_gain=30", "method.velocity_gain=3 V*s/m", WIDE, UNFED),
        (*PID, "method.feed_forward.velocity=0.9", "method.feed_forward.viscous=0"),
    ],
)
def test_the_following_error_is_met_by_the_axis(load_text, good_text, overrides):
    spec = load_text(good_text, "mechanics.start_position=250 mm", "limits.effort=1.7 kN", *overrides).spec
    found = max(abs(steady_error(spec, sense)) for sense in (1, -1))
    expected = figures(spec)["following error at limits.speed"].value
    assert expected > 5e-5
    # The command keeps to the steps of its converter, and the velocity has counts.
    assert found == pytest.approx(expected, rel=0.04, abs=4e-6)


@pytest.mark.compiled
@pytest.mark.parametrize("overrides", [SINGLE, PID])
def test_the_axis_rests_within_the_error_at_rest(load_text, rigid_text, overrides):
    spec = load_text(rigid_text, "mechanics.start_position=250 mm", "drive.command_step=0 V", *overrides).spec
    allowed = figures(spec)["error at rest"].value
    assert allowed > 2e-6
    # The negative direction breaks loose later.
    for share, moves in ((-0.95, False), (-1.05, True)):
        p = build_cascade(spec)
        rig = Rig(p, 0.25)
        rig.r.controller.reference.position = 0.25 + share * allowed
        rig.run(400 * p.controller.sample_ticks)
        assert (rig.x != 0.25) == moves


def test_weight_that_is_fed_forward_causes_no_error(load_text, good_text):
    none, fed, left = (
        figures(load_text(good_text, *SINGLE, *weight).spec)["error at rest"].value
        for weight in ((), ("mechanics.weight=9 N", "method.feed_forward.weight=1"), ("mechanics.weight=9 N",))
    )
    assert fed == pytest.approx(none)
    stiffness = 40 * 100 * 0.8 * 0.35 / (0.01 / (2 * math.pi))
    assert left == pytest.approx((18 + 9.2 + 9) / stiffness)
    assert none == pytest.approx((20 + 9.2) / stiffness)


def test_pid_with_integral_follows_without_error(load_text, good_text):
    spec = load_text(good_text, *PID, "method.integral=20 kV/(m*s)", "method.feed_forward.velocity=0").spec
    assert CascadeFigures(spec).following_error == 0.0
    assert CascadeFigures(spec).velocity_demand == 0.0


def test_feed_forward_of_coulomb_ends_at_its_dead_band(load_text, good_text):
    without = CascadeFigures(load_text(good_text, *SINGLE, "method.feed_forward.coulomb=0").spec).following_error
    banded = CascadeFigures(load_text(good_text, *SINGLE, "method.feed_forward.dead_band=1 m/s").spec).following_error
    assert banded == pytest.approx(without)
    assert without > CascadeFigures(load_text(good_text, *SINGLE).spec).following_error > 0


def test_forces_of_the_harder_direction(load_text, good_text):
    up = CascadeFigures(load_text(good_text, "mechanics.weight=50 N", "mechanics.friction.offset=4 N").spec)
    assert up.needed(0.0) == pytest.approx(14 + 8 + 4 + 50)
    assert up.breaking() == pytest.approx(18 + 9.2 + 4 + 50)
    assert up.breaking(-1.0) == pytest.approx(20 + 9.2 - 4 + 50)
    down = CascadeFigures(load_text(good_text, "mechanics.weight=-50 N").spec)
    assert down.needed(0.0) == pytest.approx(16 + 8 + 50)


def test_a_voltage_drive_loses_force_with_speed(load_text, rotary_text):
    machine = CascadeFigures(load_text(rotary_text, "drive.voltage_gain=1").spec)
    spec = machine.spec
    stalled = 10 * spec.effort_per_command
    assert machine.available(0.0) == pytest.approx(min(stalled, 3.0))
    assert machine.available(5.0) == pytest.approx(max(0.0, min(stalled - 5 * spec.back_emf_drag, 3.0)))
    assert machine.available(1e3) == 0.0
