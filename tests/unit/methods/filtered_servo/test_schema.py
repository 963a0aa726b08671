"""What a filtered-servo file may say, and what it means by what it leaves out."""

import math

import pytest
from tests.bad_files import check_bad_file, edit, params
from tests.dump import dump_spec
from tests.reference import reference_rows

from detent.files.fields import Table, leaf_fields
from detent.files.problems import dotted
from detent.methods.filtered_servo.schema import FilteredServoSpec

ROWS = {row.key: row for row in reference_rows("filtered_servo")}
PERIOD = 'sample_period = "5 ms"'


def values_of(table):
    for name in type(table).model_fields:
        value = getattr(table, name)
        if isinstance(value, Table):
            yield from values_of(value)
        else:
            yield value


def test_no_default_is_left_open_after_loading(load_text, good_text):
    values = list(values_of(load_text(good_text).spec))
    assert len(values) > 45
    assert not any(isinstance(value, float) and math.isnan(value) for value in values)


def test_defaults_of_single_keys_are_inside_their_own_bounds(load_text, good_text):
    # Pydantic does not check defaults; stating each one does.
    whole = [(dotted(path), field.default) for path, field in leaf_fields(FilteredServoSpec) if field.annotation is int]
    stated = [(key, default) for key, default in whole if isinstance(default, int) and "burst" not in key]
    assert len(stated) >= 7
    for key, default in stated:
        load_text(good_text, f"{key}={default}")


def test_the_start_is_a_tenth_of_the_way_unless_stated(load_text, good_text):
    text = good_text.replace('start_position = "20 mm"', "")
    assert load_text(text).spec.mechanics.start_position == pytest.approx(0.05)


def test_the_plant_of_the_specification(load_text, good_text):
    """Section 7: K = 0.0352 x 0.05 / 7e-5 x 1000 / (2 pi); plant B 5329 1/s^2 with 56 ms."""
    slide = ["mechanics.moving_mass=0 kg", "motor.rotor_inertia=700 g*cm^2"]
    spec = load_text(good_text, *slide).spec
    assert spec.pulse == 5e-6
    assert spec.gain == pytest.approx(4.0e3, rel=1e-3)
    assert spec.motor_time_constant == math.inf
    spec = load_text(good_text, *slide, "drive.amplifier=voltage").spec
    assert spec.gain == pytest.approx(5329, abs=1)
    assert spec.motor_time_constant == pytest.approx(56e-3)


def test_the_slide_of_the_example_is_as_heavy_as_its_comment_says(load_text, good_text):
    spec = load_text(good_text).spec
    assert spec.mechanics.moving_mass * spec.mechanics.radius**2 == pytest.approx(100e-7, rel=1e-3)
    friction = spec.mechanics.friction.right.coulomb
    assert friction * spec.mechanics.radius == pytest.approx(1.8e-3, rel=1e-3)
    assert friction / spec.force_per_count == pytest.approx(1, abs=0.03)


def test_the_word_is_limited_by_its_width_and_by_the_effort(load_text, good_text):
    assert load_text(good_text, "limits.effort=1 kN").spec.word_limit == 127
    assert load_text(good_text, "limits.effort=22.11681 N").spec.word_limit == pytest.approx(10, rel=1e-6)
    assert load_text(good_text, "limits.effort=2 kN", "drive.word_bits=10").spec.word_limit == 511


@pytest.mark.parametrize(("bits", "most"), [(8, 126), (9, 254), (12, 2046)])
def test_a_counter_about_to_wrap_is_a_fault(load_text, good_text, bits, most):
    assert load_text(good_text, f"method.counter_bits={bits}").spec.most_counted == most


@pytest.mark.parametrize(("speed", "counted"), [(0.1, 100), (0.1001, 101), (0.099, 99), (1e-6, 1)])
def test_a_window_counts_the_pulse_that_has_begun(load_text, good_text, speed, counted):
    assert load_text(good_text).spec.counted(speed) == counted


def test_the_harder_direction_holds_the_word(load_text, good_text):
    more = ["mechanics.friction.left.coulomb=4 N", "mechanics.friction.left.static=4 N"]
    spec = load_text(good_text, *more, "mechanics.friction.right.viscous=100 N*s/m").spec
    assert spec.holding_word(0.0) == pytest.approx(4 / spec.force_per_count)
    assert spec.holding_word(0.1) == pytest.approx((2.26 + 10) / spec.force_per_count)


@pytest.mark.parametrize(
    ("key", "unit", "default", "required"),
    [
        ("limits.effort", "N", "", True),
        ("motor.inductance", "H", "0 H", False),
        ("drive.pwm_frequency", "Hz", "20 kHz", False),
        ("drive.current_per_count", "A", "35.2 mA", False),
        ("mechanics.start_position", "m", "0.1 x limits.travel", False),
        ("method.coefficient", "", "0.25", False),
        ("method.command_acceleration", "m/s^2", "0 m/s^2", False),
        ("method.sample_period", "s", "5 ms", False),
        ("disturbance.lines.burst.spacing", "s", "24 us", False),
    ],
)
def test_rows_of_the_reference(key, unit, default, required):
    assert (ROWS[key].unit, ROWS[key].default, ROWS[key].required) == (unit, default, required)


@pytest.mark.parametrize(
    "overrides",
    [
        (),
        ("drive.amplifier=voltage", "motor.inductance=1 mH", "motor.max_current=3 A"),
        ("method.filter=fixed", "method.coefficient=0.125", "method.fraction_bits=10", "encoder.jitter=30 deg"),
        ("disturbance.push.force=-3 N", "disturbance.push.at=2 s", "disturbance.push.duration=60 ms"),
        ("disturbance.lines.removed=0.3 Hz", "method.command_acceleration=0 m/s^2"),
    ],
)
def test_loading_what_was_dumped_gives_the_same_specification(load_text, good_text, overrides):
    spec = load_text(good_text, *overrides).spec
    assert load_text(dump_spec(spec)).spec == spec


VALUES = [
    edit("no time", PERIOD, 'sample_period = "200 Hz"', "40:1", "method.sample_period"),
    edit("bare time", PERIOD, "sample_period = 0.005", "40:1", "method.sample_period"),
    edit("filter", '"float"', '"iir"', "37:1", "method.filter"),
    edit("scale", "scale = 4", "scale = 0", "39:1", "method.scale"),
    edit("part", "scale = 4", "scale = 4.5", "39:1", "method.scale"),
    edit("amplifier", '"current"', '"power"', "17:1", "drive.amplifier"),
    edit("effort", '"280 N"', '"6 A"', "8:1", "limits.effort"),
    edit("no effort", 'effort = "280 N"', "", "5:1", "limits.effort"),
    edit("PWM", "[drive]", '[drive]\npwm_frequency = "20000 rpm"', "17:1", "drive.pwm_frequency"),
    edit("no screw", "_revolution", "_rev", "21:1", "mechanics.travel_per_rev"),
    edit("jitter", "[encoder]", '[encoder]\njitter = "31 deg"', "34:1", "encoder.jitter"),
    edit("resolver", "[encoder]", "[detector]\n[encoder]", "33:1", "detector"),
]


@pytest.mark.parametrize("bad", params(value=VALUES))
def test_bad_value(bad, good_text, load_text, golden):
    check_bad_file(bad, good_text, load_text, golden)
