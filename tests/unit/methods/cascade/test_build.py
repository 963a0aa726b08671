"""Every key of the axis file does something: no option that is read and then forgotten.

For each key a value is given that the axis must notice. "Notice" means more than another parameter: the axis makes a
move there and back twice, without and with the value, and its registers must come out different.
"""

import math
from functools import cache

import pytest
from tests.bad_files import example_text
from tests.cascade_rig import Rig
from tests.difference import diff
from tests.face_rig import FACE_KEYS
from tests.reference import reference_rows

from detent.files.source import parse_source
from detent.methods.cascade.build import (
    LARGEST_ANGLE,
    LONGEST_TICK,
    build_cascade,
    homing_params,
    motion_limits,
    sample_ticks,
)
from detent.methods.cascade.checks import find_cautions
from detent.methods.cascade.derive import derive
from detent.methods.cascade.system import MAX_RATE
from detent.methods.load import axis_of
from detent.planning.profile import MotionLimits, plan_move
from detent.plant.linear_two_mass import fastest_rate

pytestmark = pytest.mark.compiled

VOLTAGE = ("drive.input=voltage", "drive.voltage_gain=15", "method.velocity_gain=5 V*s/m")
FORCE = ("drive.input=force", "drive.effort_per_volt=100 N/V")
BARE = "without [motor]"
PID = ("method.structure=pid", "method.proportional=4 kV/m", "method.derivative=100 V*s/m")
LOAD = ("method.feedback.position=load", "method.feedback.velocity=load", "load_encoder.resolution=2 um")
PUSH = ("disturbance.push.force=80 N", "disturbance.push.at=50 ms", "disturbance.push.duration=0.2 s")
# Key: the value, and what must hold for it to matter.
CHANGES: dict[str, tuple[str, tuple[str, ...]]] = {
    "limits.speed": ("0.3 m/s", ()),
    "limits.acceleration": ("3 m/s^2", ()),
    "limits.jerk": ("100 m/s^3", ()),
    "limits.effort": ("200 N", ()),
    "motor.catalogue": ("maxon RE 40 148867", (BARE, *VOLTAGE)),
    "motor.torque_constant": ("0.36 N*m/A", ()),
    "motor.back_emf_constant": ("0.3 V*s/rad", VOLTAGE),
    "motor.resistance": ("1.3 ohm", VOLTAGE),
    "motor.inductance": ("2 mH", VOLTAGE),
    "motor.rotor_inertia": ("650 g*cm^2", ()),
    "drive.input": ("voltage", ()),
    "drive.effort_per_volt": ("120 N/V", (BARE, *FORCE)),
    "drive.current_per_volt": ("0.9 A/V", ()),
    "drive.voltage_gain": ("12", VOLTAGE),
    "drive.command_limit": ("1 V", ()),
    "drive.command_step": ("20 mV", ()),
    "drive.delay": ("2", ()),
    "drive.max_current": ("1 A", ()),
    "mechanics.travel_per_revolution": ("12 mm", ()),
    "mechanics.motor_mass": ("9 kg", ()),
    "mechanics.load_mass": ("31 kg", ()),
    "mechanics.weight": ("10 N", ()),
    "mechanics.transmission_loss": ("0.1", ()),
    "mechanics.start_position": ("21 mm", ()),
    "mechanics.friction.offset": ("3 N", ()),
    "mechanics.friction.positive.coulomb": ("13 N", ()),
    "mechanics.friction.positive.static": ("30 N", ()),
    "mechanics.friction.positive.stribeck": ("1 mm/s", ()),
    "mechanics.friction.positive.viscous": ("130 N*s/m", ()),
    "mechanics.friction.negative.coulomb": ("13 N", ()),
    "mechanics.friction.negative.static": ("30 N", ()),
    "mechanics.friction.negative.stribeck": ("1 mm/s", ()),
    "mechanics.friction.negative.viscous": ("130 N*s/m", ()),
    "mechanics.load_friction.offset": ("3 N", ()),
    "mechanics.load_friction.positive.coulomb": ("9 N", ()),
    "mechanics.load_friction.positive.static": ("15 N", ()),
    "mechanics.load_friction.positive.stribeck": ("5 mm/s", ("mechanics.load_friction.positive.static=20 N",)),
    "mechanics.load_friction.positive.viscous": ("5 N*s/m", ()),
    "mechanics.load_friction.negative.coulomb": ("9 N", ()),
    "mechanics.load_friction.negative.static": ("15 N", ()),
    "mechanics.load_friction.negative.stribeck": ("5 mm/s", ("mechanics.load_friction.negative.static=20 N",)),
    "mechanics.load_friction.negative.viscous": ("5 N*s/m", ()),
    "mechanics.coupling.stiffness": ("50 N/um", ()),
    "mechanics.coupling.damping": ("1 kN*s/m", ()),
    "mechanics.coupling.backlash": ("10 um", ()),
    "encoder.resolution": ("2 um", ()),
    "encoder.delay": ("1", ()),
    "encoder.velocity_span": ("2", ()),
    "encoder.velocity_filter": ("0.2 ms", ()),
    "load_encoder.resolution": ("5 um", LOAD),
    "load_encoder.delay": ("1", LOAD),
    "load_encoder.velocity_span": ("2", LOAD),
    "load_encoder.velocity_filter": ("0.5 ms", LOAD),
    "method.structure": ("pid", PID[1:]),
    "method.sample_period": ("0.5 ms", ()),
    "method.position_gain": ("50", ()),
    "method.velocity_gain": ("110 V*s/m", ()),
    "method.velocity_integral": ("4 kV/m", ()),
    "method.velocity_limit": ("0.3 m/s", ("limits.speed=0.3 m/s", "method.feed_forward.viscous=0")),
    "method.proportional": ("5 kV/m", PID),
    "method.integral": ("10 kV/(m*s)", PID),
    "method.derivative": ("90 V*s/m", PID),
    "method.derivative_filter": ("1 ms", PID),
    "method.dead_band": ("20 um", ()),
    "controller.arithmetic": ("single", ()),
    "method.feedback.position": ("load", ("load_encoder.resolution=2 um",)),
    "method.feedback.velocity": ("load", ("load_encoder.resolution=2 um",)),
    "method.feed_forward.velocity": ("0.5", ()),
    "method.feed_forward.acceleration": ("0.5", ()),
    "method.feed_forward.viscous": ("0.5", ()),
    "method.feed_forward.coulomb": ("0.5", ()),
    "method.feed_forward.dead_band": ("10 mm/s", ()),
    "method.feed_forward.weight": ("1", ("mechanics.weight=30 N",)),
    "method.feed_forward.model.mass": ("50 kg", ()),
    "method.feed_forward.model.viscous": ("50 N*s/m", ()),
    "method.feed_forward.model.coulomb_positive": ("10 N", ()),
    "method.feed_forward.model.coulomb_negative": ("10 N", ()),
    "method.feed_forward.model.weight": ("10 N", ("mechanics.weight=30 N", "method.feed_forward.weight=1")),
    "method.feed_forward.model.effort_per_volt": ("150 N/V", ()),
    "disturbance.push.force": ("90 N", PUSH),
    "disturbance.push.at": ("60 ms", PUSH),
    "disturbance.push.duration": ("0.1 s", PUSH),
}
# Keys of a rotary axis, of what is said about it, and of the host that runs it.
ROTARY = {"axis.motion", "mechanics.pendulum", "method.feed_forward.model.pendulum"}
SAID = {"hardware.id", "axis.name", "axis.method"}
HOST = {"method.timeout", "axis.creep"} | FACE_KEYS

GUARDED = {
    "limits.travel": "0.4 m",
    "limits.lowest": "-1 mm",
    "method.in_position": "60 um",
    "method.in_position_time": "20 ms",
    "method.following_error": "1 mm",
    "protection.overspeed": "1.5",
    "protection.jump": "3",
    "protection.saturation_time": "0.5 s",
    "protection.travel": "false",
    "protection.stuck_time": "80 ms",
    "protection.reversed_time": "40 ms",
    "protection.stuck_effort": "0.8",
}
"""What the guard of the controller is made of."""

LINKS = ("load_encoder.resolution=2 um",)
HEAT = ("motor.max_current=2 A", "protection.thermal_time=5 s")
SUPERVISED: dict[str, tuple[str, tuple[str, ...]]] = {
    "encoder.checked": ("true", ()),
    "load_encoder.checked": ("true", LINKS),
    "protection.slip": ("1 mm", LINKS),
    "protection.oscillation": ("1 mm", ()),
    "protection.thermal_time": ("2 s", HEAT),
    "motor.max_current": ("1 A", HEAT),
    "limit_switches.lower": ("-20 mm", ("limit_switches.lower=-5 mm",)),
    "limit_switches.upper": ("520 mm", ("limit_switches.lower=-5 mm",)),
}
"""What is watched around the loop, and what must be stated for it."""

HOMED = {
    "home.by": "contact",
    "home.direction": "positive",
    "home.position": "1 mm",
    "home.speed": "20 mm/s",
    "home.creep": "1 mm/s",
    "home.back_off": "8 mm",
    "home.edge_to_index": "3 mm",
}
"""How a live axis finds its reference, and where in the machine that is."""

BRAKED = {"brake.force": "300 N", "brake.open_time": "50 ms", "brake.close_time": "30 ms"}
"""What holds an axis that is switched off."""


def load(name, *overrides):
    text = example_text(name)
    if BARE in overrides:
        text = text[: text.index("[motor]")] + text[text.index("[drive]") :]
    return axis_of(parse_source("axis.toml", text), [text for text in overrides if text != BARE]).spec


@cache
def registers(name, overrides):
    """What the axis has come to after a move there and back, and on the way."""
    spec = load(name, *overrides)
    p = build_cascade(spec)
    start, way = spec.mechanics.start_position, 0.05
    rig, seen = Rig(p, start), []
    for target in (start + way, start):
        move = plan_move(
            target - way if target > start else start + way, target, motion_limits(spec), p.controller.law.period
        )
        rig.r.controller.entry = 0
        for _ in range(4):
            rig.record(
                move.count // 4 * p.controller.sample_ticks,
                ["controller.law.command"],
                p.controller.sample_ticks,
                profile=move,
            )
            seen.append(bytes(rig.r))
        rig.run(800 * p.controller.sample_ticks)
    return tuple(seen)


@pytest.mark.parametrize("key", CHANGES)
def test_a_key_changes_the_run(key):
    value, given = CHANGES[key]
    base = given
    if key == "motor.catalogue":
        base = (BARE, *VOLTAGE, "motor.catalogue=maxon RE 40 148877")
        given = (BARE, *VOLTAGE)
    assert registers("cascade", base) != registers("cascade", (*given, f"{key}={value}"))


def test_every_key_is_tried():
    keys = {row.key for row in reference_rows("cascade")}
    watched = set(GUARDED) | set(SUPERVISED)
    assert set(CHANGES) | watched | set(HOMED) | set(BRAKED) | ROTARY | SAID | HOST == keys
    assert len(CHANGES) + len(watched) + len(HOMED) + len(BRAKED) + len(ROTARY | SAID | HOST) == len(keys)


@pytest.mark.parametrize("key", BRAKED)
def test_a_key_changes_how_an_axis_falls_that_is_switched_off_and_on(key):
    seen = []
    for change in ((), (f"{key}={BRAKED[key]}",)):
        spec = load("cascade", "brake.force=100 N", "mechanics.weight=200 N", *change)
        rig = Rig(build_cascade(spec), spec.mechanics.start_position)
        ticks = 400 * rig.p.controller.sample_ticks
        for on in (1, 0, 1):
            rig.r.controller.on = on
            rig.run(ticks)
        seen.append(rig.r.plant.machine.load.position)
    assert seen[0] != seen[1]


@pytest.mark.parametrize("key", HOMED)
def test_a_key_changes_how_it_homes(key):
    given = ("home.by=index",) if key == "home.edge_to_index" else ()
    specs = [load("cascade", *given, *change) for change in ((), (f"{key}={HOMED[key]}",))]
    (p, how), (other, otherwise) = ((build_cascade(spec), homing_params(spec, spec.home)) for spec in specs)
    changed = {*diff(p, other), *diff(how, otherwise)}
    assert changed
    assert all(path.startswith("plant.") or "." not in path for path in changed)


@pytest.mark.parametrize("key", GUARDED)
def test_a_key_changes_the_guard(key):
    p, other = (build_cascade(load("cascade", *change)).controller for change in ((), (f"{key}={GUARDED[key]}",)))
    changed = diff(p, other)
    assert changed
    assert all(path.startswith(("guard.", "limits.", "supervision.swing")) for path in changed)


@pytest.mark.parametrize("key", SUPERVISED)
def test_a_key_changes_what_is_watched(key):
    value, given = SUPERVISED[key]
    p, other = (build_cascade(load("cascade", *given, *change)) for change in ((), (f"{key}={value}",)))
    changed = diff(p, other)
    assert changed
    place = ("plant.ends.",) if "switches" in key else ("controller.supervision.",)
    assert all(path.startswith(place) for path in changed)


def test_what_the_axis_has_not_got_is_not_watched():
    p = build_cascade(load("cascade")).controller.supervision
    assert (p.link, p.slip, p.switches, p.bears) == (0, 0.0, 0, 0.0)
    assert (p.swing, p.slowest) == (pytest.approx(4 * 50e-6), 400)
    p = build_cascade(load("cascade", *LINKS, *HEAT, "encoder.checked=true", "limit_switches.lower=-5 mm"))
    found, ends = p.controller.supervision, p.plant.ends
    assert (found.link, found.switches, found.bears) == (20, 1, 2.0 / 0.8)
    assert found.slip == pytest.approx(10 * 600.0 / 60e6 + 4 * 3e-6)
    assert found.warming == pytest.approx(0.25e-3 / 5.0, rel=1e-3)
    assert (ends.present, ends.lower, ends.upper) == (1, -5e-3, pytest.approx(0.51))


def test_a_late_encoder_lags_behind_the_other_and_does_not_disagree():
    given = (*LINKS, "load_encoder.delay=4")
    late, prompt = (build_cascade(load("cascade", *one)).controller.supervision.slip for one in (given, LINKS))
    assert late - prompt == pytest.approx(4 * 0.25e-3 * 1.1 * 1.25 * 0.5)


def test_an_encoder_without_counts_is_not_looked_after():
    p = build_cascade(load("cascade", "encoder.resolution=0 m")).controller.guard
    assert (p.speed, p.jump, p.stuck, p.reversed) == (0, 0, 0, 0)
    assert p.following == p.travel == 1
    assert p.saturated > 0


def test_a_pendulum_pulls_a_rotary_axis_down():
    hanging = load("turntable", "mechanics.pendulum=0.5 N*m", "mechanics.start_position=90 deg")
    rig = Rig(build_cascade(hanging), hanging.mechanics.start_position)
    rig.drive([0.0], 200 * rig.p.controller.sample_ticks)
    assert rig.x < math.radians(89)
    still = load("turntable", "mechanics.pendulum=0.5 N*m")
    rig = Rig(build_cascade(still), still.mechanics.start_position)
    assert rig.drive([0.0], 200 * rig.p.controller.sample_ticks).x == 0.0


def test_the_continuous_current_is_warned_about():
    assert any("current" in caution.name for caution in find_cautions(load("cascade", "motor.max_current=0.3 A")))


def test_resistance_of_a_current_drive_is_told():
    one, other = (
        {f.name: f.value for f in derive(load("cascade", *overrides))}["motor voltage"]
        for overrides in ((), ("motor.resistance=2.4 ohm",))
    )
    assert other > one + 1


def test_limits_of_a_move():
    assert motion_limits(load("cascade")) == MotionLimits(0.5, 5.0, 200.0)
    text = example_text("cascade").replace('jerk = "200 m/s^3"', "")
    assert motion_limits(axis_of(parse_source("axis.toml", text), []).spec).jerk == math.inf


def test_parameters_of_a_rotary_axis():
    p = build_cascade(load("turntable"))
    radius = 8 / 360
    w = p.plant.machine.winding
    assert (w.used, w.resistance, w.inductance) == (1, 3.99, 0.556e-3)
    assert w.force_constant == pytest.approx(0.0352 / radius)
    assert w.max_current == pytest.approx(3 / w.force_constant)
    source = p.plant.source
    assert (source.gain, source.limit, source.delay, p.controller.law.max_command) == (2.4, 10.0, 1, 10.0)
    assert p.plant.machine.motor.mass == pytest.approx(0.02 + 45.3e-7 / radius**2)
    assert p.plant.machine.load.mass == pytest.approx(0.12)
    assert (p.controller.feedback.position_on_load, p.controller.feedback.velocity_on_load) == (1, 0)
    assert p.controller.load_sensor.resolution == p.plant.load_count == pytest.approx(math.radians(0.009))
    assert p.controller.law.feed_forward.velocity == 1.0


def test_feed_forward_is_what_the_plant_needs():
    shares = [f"method.feed_forward.{name}=1" for name in ("acceleration", "viscous", "coulomb", "weight")]
    spec = load("cascade", *shares, "mechanics.weight=50 N", "mechanics.friction.offset=2 N")
    f, per_volt = build_cascade(spec).controller.law.feed_forward, spec.effort_per_command
    assert f.acceleration * per_volt == pytest.approx(spec.mass)
    assert f.viscous * per_volt == pytest.approx(115)
    assert f.coulomb_positive * per_volt == pytest.approx(14 + 8 + 2)
    assert f.coulomb_negative * per_volt == pytest.approx(16 + 8 - 2)
    assert f.weight * per_volt == pytest.approx(50)
    rotary = load(
        "turntable", "method.feed_forward.viscous=0.5", "method.feed_forward.weight=0.5", "mechanics.pendulum=2 N*m"
    )
    f, per_volt = build_cascade(rotary).controller.law.feed_forward, rotary.effort_per_command
    assert f.pendulum * per_volt == pytest.approx(1.0)
    assert f.viscous * per_volt == pytest.approx(0.5 * (0.02 + rotary.back_emf_drag))


def test_the_command_ends_where_the_amplifier_does():
    for overrides in ((), ("drive.max_current=1 A",), VOLTAGE, (BARE, *FORCE)):
        p = build_cascade(load("cascade", *overrides))
        assert p.controller.law.max_command == p.plant.source.limit


def test_a_missing_encoder_of_the_load_reads_the_position_itself():
    s = build_cascade(load("cascade")).controller.load_sensor
    assert (s.resolution, s.delay, s.span, s.smoothing) == (0.0, 0, 1, 1.0)
    assert build_cascade(load("cascade")).plant.load_count == 0.0


@pytest.mark.parametrize("name", ["cascade", "turntable"])
@pytest.mark.parametrize("stiffer", [1, 1000])
def test_ticks_divide_the_sample_and_are_short_enough(name, stiffer):
    spec = load(name)
    key = spec.mechanics.coupling.stiffness * stiffer
    unit = "N/m" if name == "cascade" else "N*m/rad"
    p = build_cascade(load(name, f"mechanics.coupling.stiffness={key!r} {unit}"))
    assert p.plant.machine.period * p.controller.sample_ticks == pytest.approx(spec.method.sample_period, rel=1e-12)
    assert p.plant.machine.period <= LONGEST_TICK * (1 + 1e-9)
    assert fastest_rate(p.plant.machine) * p.plant.machine.period <= LARGEST_ANGLE * (1 + 1e-9) < MAX_RATE


def test_ticks_of_a_sample():
    assert sample_ticks(1e-3, 0.0) == 10
    assert sample_ticks(1e-3, 5e4) == 100
    assert sample_ticks(1e-6, 10.0) == 1


def test_a_push_counts_in_ticks():
    p = build_cascade(load("cascade", *PUSH))
    tick = p.plant.machine.period
    assert (p.plant.push.force, p.plant.push.begin, p.plant.push.end) == (80.0, round(0.05 / tick), round(0.25 / tick))
