"""Every key of the axis file does something: no option that is read and then forgotten.

For each key a value is given that the axis must notice. "Notice" means more than another parameter: the axis makes a
move to each side from power-on twice, without and with the value, and its registers must come out different.
"""

import math
from functools import cache

import pytest
from tests.face_rig import FACE_KEYS
from tests.filtered_servo_rig import EXAMPLE
from tests.reference import reference_rows

from detent.axisfile.tables import HomeTable, MotionProtectionTable
from detent.control.pulse_generator import PER_PULSE
from detent.methods.filtered_servo.build import build_filtered_servo
from detent.methods.filtered_servo.controller import go_to
from detent.methods.filtered_servo.host import FilteredHost
from detent.methods.load import load_spec
from detent.sensing.counted_speed import FIXED, FLOAT, NONE

pytestmark = pytest.mark.compiled

VOLTAGE = ("drive.amplifier=voltage",)
BLOCKED = ("disturbance.push.force=-270 N", "disturbance.push.at=50 ms", "disturbance.push.duration=1 s")
PUSH = ("disturbance.push.force=20 N", "disturbance.push.at=50 ms", "disturbance.push.duration=1 s")
BURST = ("disturbance.lines.burst.kind=+", "disturbance.lines.burst.at=40 ms", "disturbance.lines.burst.count=5")
LISTED = ("disturbance.lines.burst.kind=-", "disturbance.lines.burst.ticks=[4000, 4100]")
# The slide overshoots its speed, so that counters reach the end of their ranges.
HASTE = ("limits.speed=124 mm/s", "method.command_acceleration=2.4 m/s^2")

# Key: the value, and what must hold for it to matter.
CHANGES: dict[str, tuple[str, tuple[str, ...]]] = {
    "limits.travel": ("35 mm", ()),
    "limits.speed": ("90 mm/s", ()),
    "limits.effort": ("50 N", ()),
    "motor.catalogue": ("maxon RE 40 148877", VOLTAGE),
    "motor.torque_constant": ("0.06 N*m/A", ()),
    "motor.back_emf_constant": ("0.06 V*s/rad", VOLTAGE),
    "motor.resistance": ("2.2 ohm", VOLTAGE),
    "motor.rotor_inertia": ("650 g*cm^2", ()),
    "motor.inductance": ("1 mH", VOLTAGE),
    "drive.amplifier": ("voltage", ()),
    "drive.current_per_count": ("36 mA", ()),
    "drive.supply": ("13 V", VOLTAGE),
    "drive.bridge_resistance": ("0.2 ohm", VOLTAGE),
    "drive.word_bits": ("6", ()),
    "drive.whole_words": ("true", ()),
    "drive.pwm_frequency": ("1 kHz", ()),
    "mechanics.travel_per_revolution": ("6 mm", ()),
    "mechanics.moving_mass": ("17 kg", ()),
    "mechanics.screw_inertia": ("10 g*cm^2", ()),
    "mechanics.start_position": ("21 mm", ()),
    "mechanics.friction.right.coulomb": ("2 N", ()),
    "mechanics.friction.right.viscous": ("5 N*s/m", ()),
    "mechanics.friction.right.static": ("6 N", ()),
    "mechanics.friction.left.coulomb": ("2 N", ()),
    "mechanics.friction.left.viscous": ("5 N*s/m", ()),
    "mechanics.friction.left.static": ("20 N", ()),
    "encoder.cycles_per_revolution": ("240", ()),
    "encoder.jitter": ("5 deg", ()),
    "encoder.missing_edges": ("0.001", ()),
    "encoder.seed": ("2", ("encoder.jitter=5 deg",)),
    "method.filter": ("none", ()),
    "method.coefficient": ("0.5", ()),
    "method.fraction_bits": ("2", ("method.filter=fixed",)),
    "method.scale": ("5", ()),
    "method.sample_period": ("4 ms", ()),
    "method.counter_bits": ("9", HASTE),
    "method.position_gain": ("1.1", ()),
    "method.position_bits": ("10", BLOCKED),
    "method.command_acceleration": ("0.9 m/s^2", ()),
    "method.in_position": ("40", ()),
    "method.in_position_time": ("35 ms", ()),
    "disturbance.push.force": ("10 N", PUSH),
    "disturbance.push.at": ("51 ms", PUSH),
    "disturbance.push.duration": ("10 ms", PUSH),
    "disturbance.lines.inserted": ("100 Hz", ()),
    "disturbance.lines.removed": ("100 Hz", ()),
    "disturbance.lines.lost_samples": ("50 Hz", ()),
    "disturbance.lines.corrupted": ("100 Hz", ()),
    "disturbance.lines.burst.kind": ("-", BURST),
    "disturbance.lines.burst.at": ("41 ms", BURST),
    "disturbance.lines.burst.count": ("3", BURST),
    "disturbance.lines.burst.spacing": ("50 us", BURST),
    "disturbance.lines.burst.ticks": ("[4000, 4200]", LISTED),
}  # fmt: skip

# Keys that are no matter of the machine, and where they are held.
ELSEWHERE = (
    {
        "axis.name": "test_the_machine_does_not_know",
        "axis.creep": "test_live.py, test 21",
        "axis.method": "tests/unit/methods/test_registry.py",
        "motor.max_current": "test_cautions.py: current of the largest drive word",
        "method.timeout": "test_rules.py: timeout; the jobs of the axis",
    }
    | dict.fromkeys(
        (f"protection.{key}" for key in MotionProtectionTable.model_fields),
        "tests/unit/axisfile/test_protection.py: each moves its own register; test_guard.py: what the registers do",
    )
    | dict.fromkeys(
        (f"home.{key}" for key in HomeTable.model_fields),
        "tests/unit/axisfile/test_home.py; tests/unit/methods/test_homing.py",
    )
)


def test_each_key_of_the_schema_is_tried() -> None:
    assert set(CHANGES) | set(ELSEWHERE) | FACE_KEYS == {row.key for row in reference_rows("filtered_servo")}


@cache
def registers_after(overrides: tuple[str, ...]) -> tuple[bytes, ...]:
    """Registers every 5 ms while the axis of `overrides` goes 20 mm to the right, and back."""
    spec = load_spec(EXAMPLE, overrides)
    machine = FilteredHost(spec).machine
    machine.pass_ticks(10)
    r, states, moves = machine.state, [], [4000, 0]
    r.controller.event = 1
    while machine.time < 1.2:
        if r.controller.event:
            r.controller.event = 0
            if moves:
                go_to(r.controller, moves.pop(0), round(spec.limits.speed / spec.pulse * PER_PULSE))
        machine.pass_time(5e-3)
        states.append(bytes(r))
    return tuple(states)


@pytest.mark.parametrize("key", CHANGES)
def test_a_key_changes_what_the_axis_does(key: str) -> None:
    value, context = CHANGES[key]
    others = tuple(text for text in context if not text.startswith(f"{key}="))
    assert registers_after((*others, f"{key}={value}")) != registers_after(context)


@pytest.mark.parametrize("text", ["axis.name=left slide", "motor.max_current=1 A", "method.timeout=1 s"])
def test_the_machine_does_not_know(text: str) -> None:
    assert bytes(build_filtered_servo(load_spec(EXAMPLE, [text]))) == bytes(build_filtered_servo(load_spec(EXAMPLE)))


def test_the_parameters_of_the_default_axis() -> None:
    spec = load_spec(EXAMPLE)
    p = build_filtered_servo(spec)
    assert round(spec.method.sample_period * 1e6) == 5000
    assert (
        p.controller.deviation.gain,
        p.controller.deviation.range,
        p.controller.deviation.whole_words,
        p.controller.speed.half,
    ) == (1.0, 2047, 0, 128)
    assert p.controller.deviation.word_limit == pytest.approx(280 / (0.0352 * 0.05 * 2 * math.pi / 5e-3))
    assert (
        p.controller.filter.kind,
        p.controller.filter.scale,
        p.controller.filter.coefficient,
        p.controller.filter.shift,
    ) == (FLOAT, 4, 0.25, 2)
    assert (p.plant.amplifier.voltage_drive, p.plant.amplifier.per_count, p.plant.amplifier.carrier_ticks) == (
        0,
        0.0352,
        5,
    )
    assert p.plant.encoder.edge_pitch == pytest.approx(5e-6)
    assert p.plant.encoder.origin == pytest.approx(-2.5e-6)
    assert (p.controller.window, p.controller.window_ticks) == (2, round(spec.method.in_position_time / 1e-5))
    # 1 m/s^2 are 200 000 pulses/s^2: 2 pulses/s a tick.
    assert p.controller.generator.acceleration == pytest.approx(2 * PER_PULSE)
    assert p.controller.generator.ticks_per_second == pytest.approx(1e5)


def test_the_plant_is_seen_from_the_slide() -> None:
    t = build_filtered_servo(load_spec(EXAMPLE, ["mechanics.screw_inertia=50 g*cm^2"])).plant.train
    radius = 5e-3 / (2 * math.pi)
    assert t.mass == pytest.approx(15.8 + 6.5e-5 / radius**2)
    assert t.force_constant == pytest.approx(0.05 / radius) == pytest.approx(t.emf_constant)
    assert (t.resistance, t.inductance, t.right_end) == (2.0, 0.0, 0.5)
    assert t.substep * (t.force_constant * t.emf_constant / t.resistance / t.mass) <= 0.25


def test_a_voltage_amplifier_gives_its_supply_at_a_full_word() -> None:
    p = build_filtered_servo(load_spec(EXAMPLE, [*VOLTAGE, "limits.effort=1 kN"]))
    assert (p.plant.amplifier.voltage_drive, p.plant.amplifier.per_count) == (1, 12 / 128)
    assert p.controller.deviation.word_limit == 127
    p = build_filtered_servo(load_spec(EXAMPLE, [*VOLTAGE, "drive.word_bits=10", "limits.effort=1 kN"]))
    assert (p.plant.amplifier.per_count, p.controller.deviation.word_limit) == (12 / 512, 511)


@pytest.mark.parametrize(
    ("filter_", "coefficient", "kind", "shift"),
    [("none", 0.25, NONE, 2), ("fixed", 1.0, FIXED, 0), ("fixed", 2.0**-12, FIXED, 12), ("float", 0.3, FLOAT, 2)],
)
def test_the_filter_is_the_one_asked_for(filter_: str, coefficient: float, kind: int, shift: int) -> None:
    f = build_filtered_servo(
        load_spec(EXAMPLE, [f"method.filter={filter_}", f"method.coefficient={coefficient}"])
    ).controller.filter
    assert (f.kind, f.shift, f.coefficient) == (kind, shift, coefficient)


def test_a_substep_is_short_against_the_fastest_time_constant() -> None:
    for inductance in ("1 mH", "0.01 mH"):
        t = build_filtered_servo(load_spec(EXAMPLE, [f"motor.inductance={inductance}"])).plant.train
        assert 0 < t.substep <= 0.25 * t.inductance / t.resistance


def test_noise_and_push_count_in_base_ticks() -> None:
    p = build_filtered_servo(load_spec(EXAMPLE, [*PUSH, *BURST]))
    assert (p.plant.push.begin, p.plant.push.end) == (5000, 105_000)
    assert [p.plant.interference.tick[k] for k in range(2)] == [4000, 4002]


def test_the_widest_counters_fit_their_registers() -> None:
    widest = ["method.counter_bits=12", "method.position_bits=15", "drive.word_bits=16", "method.in_position=1000"]
    p = build_filtered_servo(load_spec(EXAMPLE, widest))
    assert (p.controller.speed.half, p.controller.deviation.range) == (2048, 16383)
