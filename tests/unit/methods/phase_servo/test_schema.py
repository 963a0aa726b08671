"""What a phase-servo file may say, and what it means by what it leaves out."""

import math

import pytest
from tests.bad_files import added, check_bad_file, edit, params
from tests.dump import dump_spec
from tests.reference import reference_rows

from detent.files.fields import Table, leaf_fields
from detent.files.problems import dotted
from detent.kernel.registers import Registers
from detent.methods.phase_servo.schema import PhaseServoSpec

ROWS = {row.key: row for row in reference_rows("phase_servo")}


def values_of(table):
    for name in type(table).model_fields:
        value = getattr(table, name)
        if isinstance(value, Table):
            yield from values_of(value)
        else:
            yield value


def test_no_default_is_left_open_after_loading(load_text, good_text):
    values = list(values_of(load_text(good_text).spec))
    assert len(values) > 50
    assert not any(isinstance(value, float) and math.isnan(value) for value in values)
    assert [] not in values


def test_defaults_of_single_keys_are_inside_their_own_bounds(load_text, good_text):
    # Pydantic does not check defaults; stating each one does.
    whole = [(dotted(path), field.default) for path, field in leaf_fields(PhaseServoSpec) if field.annotation is int]
    stated = [
        (key, default) for key, default in whole if isinstance(default, int) and default >= 0 and "burst" not in key
    ]
    assert len(stated) >= 8
    for key, default in stated:
        load_text(good_text, f"{key}={default}")


@pytest.mark.parametrize(
    ("overrides", "key", "value"),
    [
        ((), "mechanics.start_position", 0.1 * 0.0254),
        ((), "detector.lag_counts", 15),
        (("detector.counts=32", "method.threshold=4", "method.expected_spurious=8"), "detector.lag_counts", 7),
        ((), "clock.integrate_tap", 13),
        ((), "clock.sample_tap", 12),
        (("clock.order=literal",), "clock.integrate_tap", 12),
        (("clock.order=literal",), "clock.sample_tap", 13),
        ((), "method.speed_gains", [1, 1, 16]),
        ((), "method.position_gains", [4, 16, 1]),
        (("clock.order=literal",), "method.speed_gains", [1, 1, 8]),
        (("clock.order=literal",), "method.position_gains", [3, 6, 1]),
        (("clock.order=literal", "method.position_gains=[4, 8, 1]"), "method.position_gains", [4, 8, 1]),
        ((), "print.left_margin", 0.0254),
        (("limits.travel=30 mm",), "print.left_margin", 0.015),
        ((), "print.character_pitch", 0.00254),
        (("mechanics.pulley_circumference=50 mm",), "print.character_pitch", 0.0025),
        (("mechanics.pulley_circumference=1 m", "limits.speed=5 m/s"), "print.character_pitch", 1 / 120),
        ((), "motor.back_emf_constant", 0.05),
    ],
)
def test_defaults_that_depend_on_another_key(load_text, good_text, overrides, key, value):
    if "mechanics.pulley_circumference=1 m" in overrides:
        overrides = (*overrides, "method.table_acceleration=50 m/s^2")
    held = load_text(good_text, *overrides).spec
    for name in key.split("."):
        held = getattr(held, {"print": "printing"}.get(name, name))
    assert held == pytest.approx(value)


def test_the_start_is_a_tenth_of_the_way_unless_stated(load_text, good_text):
    text = good_text.replace('start_position = "0.1 in"', "")
    assert load_text(text).spec.mechanics.start_position == pytest.approx(1.4 * 0.0254)


def test_what_the_specification_calls_by_name(load_text, good_text):
    spec = load_text(good_text).spec
    assert spec.pitch == pytest.approx(0.0254 / 60)
    assert spec.step == pytest.approx(6.6146e-6, rel=1e-5)
    assert spec.tick == 2.5e-7
    assert spec.sample_period == 512e-6
    assert spec.peak_count == 27


def test_the_peak_is_rounded_down_and_a_whole_count_is_kept(load_text, good_text):
    one = 0.0254 / 60 / 64 / 512e-6
    assert load_text(good_text, f"limits.speed={20 * one!r} m/s").spec.peak_count == 20
    assert load_text(good_text, f"limits.speed={20.99 * one!r} m/s").spec.peak_count == 20


@pytest.mark.parametrize(
    ("key", "unit", "default", "required"),
    [
        ("limits.speed", "m/s", "", True),
        ("detector.lag_counts", "", "N/4 - 1", False),
        ("clock.oscillator", "Hz", "8 MHz", False),
        ("clock.sample_tap", "", "12, with the literal order 13", False),
        ("method.table_acceleration", "m/s^2", "10 m/s^2", False),
        ("method.position_gains", "", "[4, 16, 1], with the literal order [3, 6, 1]", False),
        ("print.character_pitch", "m", "the whole number of pitches nearest to 1/10 in", False),
        ("disturbance.lines.inserted", "Hz", "0 Hz", False),
        ("disturbance.lines.burst.at", "s", "none: ticks are listed", False),
        ("disturbance.lines.burst.ticks", "", "[]", False),
    ],
)
def test_rows_of_the_reference(key, unit, default, required):
    assert (ROWS[key].unit, ROWS[key].default, ROWS[key].required) == (unit, default, required)


@pytest.mark.parametrize(
    "overrides",
    [
        (),
        ("clock.order=literal", "method.final=incremental", "method.leave_antiphase=true"),
        ("detector.gain_error=-2.3 %", "detector.quadrature_error=30 deg", "detector.jitter=20 ns"),
        ("disturbance.push.force=3 N", "disturbance.push.at=30 ms", "disturbance.push.duration=1 s"),
        ("disturbance.lines.inserted=2 Hz", "motor.max_current=8 A", "method.position_gains=[1, 2, 3]"),
    ],
)
def test_loading_what_was_dumped_gives_the_same_specification(load_text, good_text, overrides):
    spec = load_text(good_text, *overrides).spec
    assert load_text(dump_spec(spec)).spec == spec


GAINS = "three whole numbers from 1 to 1000"
VALUES = [
    added("two gains", "[method]\nspeed_gains = [1, 1]", "57:1", "method.speed_gains"),
    added("no gain", "[method]\nposition_gains = [4, 0, 1]", "57:1", "method.position_gains"),
    added("gain", "[method]\nposition_gains = [4, 1001, 1]", "57:1", "method.position_gains"),
    added("a gain", "[method]\nspeed_gains = 16", "57:1", "method.speed_gains"),
    added("order", '[clock]\norder = "strict"', "57:1", "clock.order"),
    added("final", '[method]\nfinal = "counted"', "57:1", "method.final"),
    added("clock", '[clock]\noscillator = "8 rad/s"', "57:1", "clock.oscillator"),
    added("clock without unit", "[clock]\noscillator = 8e6", "57:1", "clock.oscillator"),
    added("slow", '[clock]\noscillator = "50 kHz"', "57:1", "clock.oscillator"),
    edit("few steps", "# counts = 64 ", "counts = 8 # ", "36:1", "detector.counts"),
    edit("crooked windings", "# counts = 64 ", 'quadrature_error = "31 deg" # ', "36:1", "detector.quadrature_error"),
    edit("encoder", "[detector]", "[encoder]\ncycles_per_revolution = 3\n[detector]", "34:1", "encoder"),
    edit("no winding", 'inductance = "0.8 mH"', "", "10:1", "motor.inductance"),
    edit("no side", 'effort = "6 A"', "", "5:1", "limits.effort"),
    edit("effort in volts", '"6 A"', '"6 V"', "8:1", "limits.effort"),
]


@pytest.mark.parametrize("bad", params(value=VALUES))
def test_bad_value(bad, good_text, load_text, golden):
    check_bad_file(bad, good_text, load_text, golden)


@pytest.mark.parametrize("angle", ["30 deg", "-30 deg"])
def test_the_largest_angle_named_is_accepted(load_text, good_text, angle):
    assert math.degrees(load_text(good_text, f"detector.quadrature_error={angle}").spec.detector.quadrature_error) == (
        pytest.approx(float(angle.split()[0]))
    )


def test_the_bounds_fit_the_registers():
    from detent.methods.phase_servo.system import PhaseServo, PhaseServoParams

    # Register: the largest value that the keys of the schema can put there, and the smallest.
    largest = {
        (PhaseServo, "controller.converters.tracking.reference"): (1023, 0),
        (PhaseServo, "controller.converters.absolute.word"): (1024, 0),
        (PhaseServo, "controller.sequencer.command"): (65535, 0),
        (PhaseServo, "controller.speed.word"): (2**15 - 1, -(2**15)),
        (PhaseServo, "controller.law.word"): (2**11 - 1, -(2**11)),
        (PhaseServo, "controller.law.integral"): (32767, -32767),
        (PhaseServo, "controller.pwm.sawtooth"): (2**11 - 1, -(2**11)),
        (PhaseServoParams, "controller.sequencer.table"): (2**15 - 1, 0),
        (PhaseServoParams, "controller.law.speed_k1"): (1000, 1),
    }
    for (registers, path), values in largest.items():
        assert issubclass(registers, Registers)
        (width,) = [leaf.width for leaf in registers.leaves() if leaf.path == path]
        bits = 8 * width.size
        low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if width.code[0] == "i" else (0, 2**bits - 1)
        assert all(low <= value <= high for value in values), path
