"""Every key of the axis file does something: no option that is read and then forgotten.

For each key a value is given that the axis must notice. "Notice" means more than another parameter: the axis makes a
move to each side from power-on twice, without and with the value, and its registers must come out different.
"""

import math
from functools import cache
from pathlib import Path

import pytest
from tests.face_rig import FACE_KEYS
from tests.phase_servo_rig import EXAMPLE
from tests.reference import reference_rows

from detent.axisfile.tables import HomeTable, ProtectionTable
from detent.control.phase_sequencer import NEVER
from detent.errors import InputError
from detent.kernel.turn_table import TURN
from detent.methods.load import load_spec
from detent.methods.phase_servo.build import build_phase_servo
from detent.methods.phase_servo.host import PhaseHost

pytestmark = pytest.mark.compiled

PUSH = ("disturbance.push.force=2 N", "disturbance.push.at=15 ms", "disturbance.push.duration=1 s")
BURST = ("disturbance.lines.burst.kind=+", "disturbance.lines.burst.at=4 ms", "disturbance.lines.burst.count=12")
LISTED = ("disturbance.lines.burst.kind=-", "disturbance.lines.burst.ticks=[20000, 20100]")
NOISE = ("detector.jitter=20 ns", "mechanics.start_position=2.543308 mm")
# Where the carriage stands at power-on, the comparator's edge is half a turn from the reference counter's.
ANTIPHASE = ("mechanics.start_position=0.3141927 mm",)

# Key: the value, and what must hold for it to matter.
CHANGES: dict[str, tuple[str, tuple[str, ...]]] = {
    "limits.travel": ("0.11 in", ()),
    "limits.speed": ("0.05 m/s", ()),
    "limits.effort": ("1 A", ()),
    "motor.torque_constant": ("0.06 N*m/A", ()),
    "motor.back_emf_constant": ("0.06 V*s/rad", ()),
    "motor.resistance": ("2.2 ohm", ()),
    "motor.inductance": ("1 mH", ()),
    "motor.rotor_inertia": ("240 g*cm^2", ()),
    "drive.supply": ("23 V", ()),
    "drive.bridge_resistance": ("0.5 ohm", ()),
    "drive.pwm_bits": ("9", ()),
    "mechanics.pulley_circumference": ("50 mm", ()),
    "mechanics.carriage_mass": ("0.7 kg", ()),
    "mechanics.pulley_inertia": ("100 g*cm^2", ()),
    "mechanics.start_position": ("0.2 in", ()),
    "mechanics.friction.right.coulomb": ("1.1 N", ()),
    "mechanics.friction.right.viscous": ("1 N*s/m", ()),
    "mechanics.friction.right.static": ("1.5 N", ()),
    "mechanics.friction.left.coulomb": ("1.1 N", ()),
    "mechanics.friction.left.viscous": ("1 N*s/m", ()),
    "mechanics.friction.left.static": ("1.5 N", ()),
    "detector.pitches_per_revolution": ("110", ()),
    "detector.counts": ("32", ("method.threshold=7", "method.expected_spurious=5")),
    "detector.lag_counts": ("14", ()),
    "detector.gain_error": ("20 %", ()),
    "detector.quadrature_error": ("10 deg", ()),
    "detector.amplitude": ("50 %", ("detector.offset_error=10 %",)),
    "detector.offset_error": ("5 %", ()),
    "detector.jitter": ("30 ns", NOISE),
    "detector.seed": ("2", NOISE),
    "clock.oscillator": ("7.5 MHz", ()),
    "clock.order": ("literal", ()),
    "clock.integrate_tap": ("12", PUSH),
    "clock.sample_tap": ("13", ()),
    "method.final": ("incremental", ()),
    "method.threshold": ("10", ()),
    "method.table_acceleration": ("8 m/s^2", ()),
    "method.speed_gains": ("[1, 1, 15]", ()),
    "method.position_gains": ("[4, 15, 1]", ()),
    "method.speed_bits": ("4", ("limits.speed=0.05 m/s", *BURST)),
    "method.corrector": ("false", ()),
    "method.integrator": ("false", PUSH),
    "method.dead_band": ("2", PUSH),
    "method.integral_limit": ("1", PUSH),
    "method.ready_time": ("4 ms", ()),
    "method.stop_time": ("15 ms", ()),
    "method.stop_always_off": ("true", ()),
    "method.leave_antiphase": ("true", ANTIPHASE),
    "disturbance.push.force": ("1 N", PUSH),
    "disturbance.push.at": ("16 ms", PUSH),
    "disturbance.push.duration": ("2 ms", PUSH),
    "disturbance.lines.inserted": ("1 kHz", ()),
    "disturbance.lines.removed": ("1 kHz", ()),
    "disturbance.lines.lost_samples": ("500 Hz", ()),
    "disturbance.lines.corrupted": ("1 kHz", ()),
    "disturbance.lines.burst.kind": ("-", BURST),
    "disturbance.lines.burst.at": ("5 ms", BURST),
    "disturbance.lines.burst.count": ("3", BURST),
    "disturbance.lines.burst.spacing": ("10 us", BURST),
    "disturbance.lines.burst.ticks": ("[20000, 20200]", LISTED),
}  # fmt: skip

# Keys that are no matter of the machine, and where they are held.
ELSEWHERE = (
    {
        "axis.name": "test_the_machine_does_not_know",
        "axis.creep": "test_live.py, test 21",
        "axis.method": "tests/unit/methods/test_registry.py",
        "motor.catalogue": "test_a_catalogue_motor_gives_its_constants",
        "motor.max_current": "test_cautions.py: current limit",
        "method.expected_spurious": "test_rules.py: protection",
        "print.left_margin": "test_rules.py: left margin; the jobs of the axis",
        "print.character_pitch": "test_rules.py: character pitch; the jobs of the axis",
        "print.hammer_time": "the jobs of the axis",
    }
    | dict.fromkeys(
        (f"protection.{key}" for key in ProtectionTable.model_fields),
        "tests/unit/axisfile/test_protection.py: each moves its own register; test_guard.py: what the registers do",
    )
    | dict.fromkeys(
        (f"home.{key}" for key in HomeTable.model_fields),
        "tests/unit/axisfile/test_home.py; tests/unit/methods/test_homing.py",
    )
)


def test_each_key_of_the_schema_is_tried() -> None:
    assert set(CHANGES) | set(ELSEWHERE) | FACE_KEYS == {row.key for row in reference_rows("phase_servo")}


@cache
def registers_after(overrides: tuple[str, ...]) -> tuple[bytes, ...]:
    """Registers each millisecond while the axis of `overrides` acquires, goes a pitch to the right, and back."""
    spec = load_spec(EXAMPLE, overrides)
    machine = PhaseHost(spec).machine
    s, states, moves = machine.state.controller.sequencer, [], [0, 1]
    while machine.time < 0.07:
        machine.pass_time(1e-3)
        states.append(bytes(machine.state))
        if s.event:
            s.event = 0
            if moves:
                s.command, s.backward, s.strobe = spec.detector.counts, moves.pop(0), 1
    return tuple(states)


@pytest.mark.parametrize("key", CHANGES)
def test_a_key_changes_what_the_axis_does(key: str) -> None:
    value, context = CHANGES[key]
    others = tuple(text for text in context if not text.startswith(f"{key}="))
    assert registers_after((*others, f"{key}={value}")) != registers_after(context)


@pytest.mark.parametrize(
    "text", ["axis.name=left head", "print.hammer_time=1 ms", "motor.max_current=1 A", "method.expected_spurious=2"]
)
def test_the_machine_does_not_know(text: str) -> None:
    assert bytes(build_phase_servo(load_spec(EXAMPLE, [text]))) == bytes(build_phase_servo(load_spec(EXAMPLE)))


def test_the_parameters_of_the_default_axis_are_those_of_the_specification() -> None:
    p = build_phase_servo(load_spec(EXAMPLE))
    c, s, law = p.controller.converters, p.controller.sequencer, p.controller.law
    assert (c.carrier.mask, c.tracking.mask, c.absolute.mask) == (63, 63, 63)
    assert (c.tracking.top, c.absolute.top, c.carrier.shift, c.tracking.leave_antiphase) == (5, 5, 3, 0)
    assert (p.controller.clocks.integrate_mask, p.controller.clocks.sample_mask) == (8191, 4095)
    assert (s.threshold, s.last, s.ready_ticks, s.stop_ticks, s.incremental) == (8, 886, 12_000, 80_000, 0)
    entries = {1: 1, 8: 3, 9: 3, 16: 4, 32: 5, 64: 7, 128: 10, 256: 14, 512: 20, 886: 27}
    assert {n: s.table[n] for n in entries} == entries
    assert s.quiet_ticks == 32 * 64  # N/2 carrier cycles
    assert (law.speed_k1, law.speed_k2, law.speed_k3) == (1, 1, 16)
    assert (law.position_k1, law.position_k2, law.position_k3) == (4, 16, 1)
    assert (law.dead_band, law.integral_limit, law.corrector, law.integrator) == (1, 127, 1, 1)
    assert (law.word_limit, p.controller.pwm.half, p.controller.speed.half) == (128, 128, 128)
    assert (p.plant.bridge.supply, p.plant.bridge.limit) == (24.0, 6.0)


def test_a_catalogue_motor_gives_its_constants(tmp_path: Path) -> None:
    text = EXAMPLE.read_text(encoding="utf-8")
    begin, end = text.index("torque_constant"), text.index("[drive]")
    file = tmp_path / "axis.toml"
    file.write_text(text[:begin] + 'catalogue = "maxon RE 40 148877"\n\n' + text[end:], encoding="utf-8")
    named, stated = (build_phase_servo(load_spec(path)).plant.train for path in (file, EXAMPLE))
    assert (named.resistance, named.inductance) == (1.13, 0.33e-3)
    assert bytes(named) != bytes(stated)


def test_the_literal_order_is_that_of_the_specification() -> None:
    p = build_phase_servo(load_spec(EXAMPLE, ["clock.order=literal"]))
    assert (p.controller.clocks.integrate_mask, p.controller.clocks.sample_mask) == (4095, 8191)
    assert (p.controller.law.speed_k3, p.controller.law.position_k1, p.controller.law.position_k2) == (8, 3, 6)
    assert p.controller.sequencer.table[p.controller.sequencer.last] == 54


def test_the_plant_is_seen_from_the_carriage() -> None:
    t = build_phase_servo(load_spec(EXAMPLE, ["drive.bridge_resistance=0.3 ohm"])).plant.train
    radius = 50.8e-3 / (2 * math.pi)
    assert t.resistance == pytest.approx(2.3)
    assert t.force_constant == pytest.approx(0.05 / radius) == pytest.approx(t.emf_constant)
    assert t.mass == pytest.approx(0.6 + 3.1e-5 / radius**2)
    assert (t.left_end, t.right_end) == (0.0, pytest.approx(14 * 0.0254))
    assert t.period == 2 / 8e6


def test_the_detector_lags_at_the_positioning_points() -> None:
    d = build_phase_servo(load_spec(EXAMPLE, ["detector.jitter=100 ns", "detector.gain_error=2 %"])).plant.detector
    assert d.offset == TURN - 15 * TURN // 64
    assert d.carrier_shift == 26
    assert d.turns_per_metre * 0.0254 / 60 == pytest.approx(TURN)
    assert d.jitter / TURN == pytest.approx(100e-9 * 62_500)
    assert d.rise.used == 1


@pytest.mark.parametrize("counts", [16, 32, 64, 128, 256, 512, 1024])
def test_every_number_of_steps_fits_its_registers(counts: int) -> None:
    quarter = counts // 4
    spec = load_spec(
        EXAMPLE,
        [
            f"detector.counts={counts}", "method.position_gains=[1, 4, 1]", "drive.pwm_bits=10", "method.threshold=3",
            "method.expected_spurious=1", "limits.speed=1 mm/s", "clock.sample_tap=18", "limits.travel=20 mm",
            "method.table_acceleration=1 m/s^2",
        ],
    )  # fmt: skip
    p = build_phase_servo(spec)
    c, s = p.controller.converters, p.controller.sequencer
    assert c.carrier.mask + 1 == 1 << (c.tracking.top + 1) == 1 << (32 - p.plant.detector.carrier_shift) == counts
    assert c.carrier.shift == c.tracking.top - 2
    assert p.plant.detector.offset == TURN - (quarter - 1) * TURN // counts
    assert 2 * counts * counts // 4 == s.quiet_ticks
    assert s.table[s.last] == spec.peak_count


def test_a_stop_that_never_comes_is_later_than_any_run() -> None:
    assert (
        build_phase_servo(load_spec(EXAMPLE, ["method.stop_always_off=true"])).controller.sequencer.stop_ticks
        == NEVER // 2
    )


def test_noise_and_push_count_in_base_ticks() -> None:
    p = build_phase_servo(load_spec(EXAMPLE, [*PUSH, *BURST]))
    assert (p.plant.push.begin, p.plant.push.end) == (60_000, 4_060_000)
    assert [p.plant.interference.tick[k] for k in range(2)] == [16_000, 16_096]


def test_a_weak_secondary_lets_offset_and_noise_displace_the_edges_farther() -> None:
    faults = ["detector.jitter=20 ns", "detector.offset_error=10 %"]
    full, weak, strong = (
        build_phase_servo(load_spec(EXAMPLE, [*faults, f"detector.amplitude={share} %"])).plant.detector
        for share in (100, 50, 200)
    )
    assert weak.jitter == pytest.approx(2 * full.jitter)
    assert strong.jitter == pytest.approx(full.jitter / 2)
    # sin(displacement) = offset / amplitude
    for detector, share in ((full, 0.1), (weak, 0.2), (strong, 0.05)):
        assert detector.rise.value[0] / TURN * 2 * math.pi == pytest.approx(math.asin(share), rel=1e-6)


def test_a_secondary_too_weak_for_the_offset_is_refused() -> None:
    with pytest.raises(InputError, match=r"detector\.(offset_error|amplitude)"):
        load_spec(EXAMPLE, ["detector.offset_error=40 %", "detector.amplitude=30 %"])
