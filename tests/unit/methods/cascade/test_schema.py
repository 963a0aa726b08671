"""What a cascade file may say, and what it means by what it leaves out."""

import math

import pytest
from tests.bad_files import check_bad_file, edit, params
from tests.dump import dump_spec

from detent.errors import InputError
from detent.files.fields import Table, leaf_fields
from detent.files.problems import dotted
from detent.methods.cascade.schema import CascadeSpec


def values_of(table):
    for name in type(table).model_fields:
        value = getattr(table, name)
        if isinstance(value, Table):
            yield from values_of(value)
        else:
            yield value


@pytest.mark.parametrize("which", ["good_text", "rotary_text"])
def test_no_default_is_left_open_after_loading(load_text, request, which):
    values = list(values_of(load_text(request.getfixturevalue(which)).spec))
    assert len(values) > 60
    assert not any(isinstance(value, float) and math.isnan(value) for value in values)


def test_a_short_file_is_an_axis_without_a_motor(load_text, short_text):
    spec = load_text(short_text).spec
    assert (spec.axis.motion, spec.drive.input, spec.motor, spec.mechanics.coupling) == ("linear", "force", None, None)
    assert (spec.mass, spec.motor_mass) == (2.0, 0.0)
    assert (spec.effort_per_command, spec.largest_command, spec.largest_effort) == (1.0, 10.0, 10.0)
    assert spec.mechanics.start_position == 0.0
    assert spec.method.velocity_limit == 1.25
    assert spec.method.in_position == pytest.approx(20e-6)
    assert spec.method.following_error == pytest.approx(20e-3)
    assert load_text(dump_spec(spec)).spec == spec


def test_in_position_is_at_least_two_counts_of_the_coarser_encoder(load_text, short_text):
    assert load_text(short_text, "encoder.resolution=0.1 mm").spec.method.in_position == pytest.approx(2e-4)
    assert load_text(short_text, "load_encoder.resolution=0.3 mm").spec.method.in_position == pytest.approx(6e-4)


@pytest.mark.parametrize(("lowest", "start"), [("-50 mm", 0.0), ("30 mm", 0.03), ("-300 mm", -0.1)])
def test_the_axis_starts_at_zero_or_at_the_end_next_to_it(load_text, short_text, lowest, start):
    assert load_text(short_text, f"limits.lowest={lowest}").spec.mechanics.start_position == pytest.approx(start)


def test_static_friction_follows_coulomb(load_text, short_text):
    spec = load_text(short_text, "mechanics.friction.negative.coulomb=4 N").spec
    assert spec.mechanics.friction.negative.static == pytest.approx(4.6)
    assert spec.mechanics.friction.positive.static == 0.0


def test_a_direct_drive_turns_as_its_motor(load_text, rotary_text):
    spec = load_text(rotary_text.replace('travel_per_revolution = "8 deg"', "")).spec
    assert spec.mechanics.travel_per_revolution == 2 * math.pi
    assert spec.radius == 1.0
    assert spec.motor_mass == pytest.approx(0.02 + 45.3e-7)


def test_a_motor_drives_through_its_travel_per_turn(load_text, good_text):
    spec = load_text(good_text).spec
    radius = 0.01 / (2 * math.pi)
    assert spec.motor_mass == pytest.approx(8 + 600e-7 / radius**2)
    assert spec.force_constant == pytest.approx(0.35 / radius)
    assert spec.emf_constant == pytest.approx(0.35 / radius)
    assert spec.effort_per_command == pytest.approx(0.8 * 0.35 / radius)
    assert spec.back_emf_drag == 0.0


def test_limits_of_a_current_drive(load_text, good_text):
    by_effort = load_text(good_text).spec
    assert by_effort.largest_effort == pytest.approx(600)
    assert by_effort.largest_command * by_effort.effort_per_command == pytest.approx(600)
    by_current = load_text(good_text, "drive.max_current=2 A").spec
    assert by_current.max_current == 2.0
    assert by_current.largest_command == pytest.approx(2.5)
    assert load_text(good_text, "drive.command_limit=1 V").spec.largest_command == 1.0


def test_limits_of_a_voltage_drive(load_text, rotary_text):
    spec = load_text(rotary_text).spec
    radius = 8 / 360
    assert spec.max_current == pytest.approx(3 * radius / 0.0352)
    assert spec.largest_command == 10.0
    assert spec.largest_effort == pytest.approx(3.0)
    assert spec.effort_per_command == pytest.approx(2.4 * 0.0352 / radius / 3.99)
    assert spec.back_emf_drag == pytest.approx((0.0352 / radius) ** 2 / 3.99)
    weak = load_text(rotary_text, "drive.max_current=1 A").spec
    assert weak.largest_effort == pytest.approx(0.0352 / radius)


def test_a_missing_encoder_of_the_load_reads_without_error(load_text, short_text):
    spec = load_text(short_text).spec
    assert spec.encoder_of("position") is spec.encoder
    loaded = load_text(short_text, "load_encoder.resolution=5 um", "method.feedback.position=load").spec
    assert loaded.encoder_of("position") is loaded.load_encoder
    assert loaded.encoder_of("velocity") is loaded.encoder


def test_defaults_of_single_keys_are_inside_their_own_bounds(load_text, good_text):
    whole = [(dotted(path), field.default) for path, field in leaf_fields(CascadeSpec) if field.annotation is int]
    stated = [(key, default) for key, default in whole if isinstance(default, int) and "load_encoder" not in key]
    assert len(stated) >= 3
    for key, default in stated:
        load_text(good_text, f"{key}={default}")


def test_units_follow_the_motion(load_text, good_text, rotary_text):
    assert load_text(good_text).spec.unit("N*s/m") == "N*s/m"
    assert load_text(rotary_text).spec.unit("N*s/m") == "N*m*s/rad"


BOUNDS = [
    edit("no speed", 'speed = "0.5 m/s"\n', "", "5:1", "limits.speed"),
    edit("span", 'resolution = "1 um" ', 'velocity_span = 0\nresolution = "1 um" ', "54:1", "encoder.velocity_span"),
    edit("input", 'input = "current"', 'input = "torque"', "19:1", "drive.input"),
    edit("gain without unit", 'velocity_gain = "100 V*s/m"', "velocity_gain = 100", "60:1", "method.velocity_gain"),
]


@pytest.mark.parametrize("bad", params(bounds=BOUNDS))
def test_bad_values(bad, good_text, load_text, golden):
    check_bad_file(bad, good_text, load_text, golden)


def test_a_file_without_method_table_asks_for_the_gains(load_text, short_text):
    with pytest.raises(InputError) as caught:
        load_text(short_text[: short_text.index("[method]")])
    assert [problem.key for problem in caught.value.problems] == ["method.velocity_gain", "method.position_gain"]
