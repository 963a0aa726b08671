"""What a rotary-table file may say, and what it means by what it leaves out."""

import math

import pytest
from tests.bad_files import added, check_bad_file, edit, params
from tests.dump import dump_spec
from tests.reference import reference_rows

from detent.files.fields import Table, held_leaves, leaf_fields
from detent.files.problems import dotted
from detent.methods.rotary_table.schema import RotaryTableSpec

ROWS = {row.key: row for row in reference_rows("rotary_table")}
DEG = math.pi / 180
RATIO = "gear_ratio = 90 "


def test_no_default_is_left_open_after_loading(load_text, good_text):
    values = [value for _, _, value in held_leaves(load_text(good_text).spec)]
    assert len(values) > 60
    assert not any(isinstance(value, float) and math.isnan(value) for value in values)


def test_defaults_of_single_keys_are_inside_their_own_bounds(load_text, good_text):
    # Pydantic does not check defaults; stating each one does.
    whole = [(dotted(path), field.default) for path, field in leaf_fields(RotaryTableSpec) if field.annotation is int]
    stated = [(key, default) for key, default in whole if isinstance(default, int)]
    assert len(stated) == 6
    for key, default in stated:
        load_text(good_text, f"{key}={default}")


def test_what_depends_on_another_table_is_filled(load_text, good_text):
    spec = load_text(good_text, "limits.speed=50 deg/s", "mechanics.gear_ratio=80", "mechanics.coulomb=0.1 N*m").spec
    assert spec.drive.full_speed == spec.motor.max_speed == pytest.approx(2000 / 60 * 2 * math.pi)
    assert spec.detector.coarse.reduction == 80
    assert spec.mechanics.static == pytest.approx(0.115)
    assert [entry.speed / DEG for entry in spec.position.values()] == pytest.approx([50, 30, 50, 50, 50])


def test_what_is_stated_is_kept(load_text, good_text):
    spec = load_text(good_text, "drive.full_speed=1900 rpm", "mechanics.static=0.3 N*m").spec
    assert spec.drive.full_speed == pytest.approx(1900 / 60 * 2 * math.pi)
    assert spec.mechanics.static == 0.3


def test_the_axis_of_the_specification(load_text, good_text):
    """Section 7."""
    spec = load_text(good_text).spec
    assert (spec.ratio, spec.period, spec.largest_word) == (90, 368_640, 2047)
    assert spec.count / DEG * 3600 == pytest.approx(3.5, abs=0.05)
    assert spec.largest_speed / DEG == pytest.approx(133.3, abs=0.05)
    assert spec.speed_per_word / DEG == pytest.approx(0.065, abs=0.0005)
    assert spec.per_interrupt(0.1 * DEG) / 65_536 == pytest.approx(0.2048)
    assert spec.acceleration_word / 65_536 == pytest.approx(1.2288)
    assert spec.inertia == pytest.approx(9.988e-4, rel=1e-4)
    slower = load_text(good_text, "drive.full_speed=1500 rpm").spec
    assert slower.largest_speed / DEG == pytest.approx(100)
    assert load_text(good_text, "drive.full_speed=3000 rpm").spec.largest_speed == pytest.approx(spec.largest_speed)


def test_there_may_be_no_positions(load_text, good_text):
    assert load_text(good_text[: good_text.index("[position.0]")]).spec.position == {}


def test_a_table_of_positions_may_have_gaps(load_text, good_text):
    spec = load_text(f'{good_text}\n[position.127]\nangle = "1 deg"\n').spec
    assert list(spec.position) == ["0", "1", "2", "3", "4", "127"]
    assert spec.position["127"].direction == "shortest"


@pytest.mark.parametrize(
    ("key", "unit", "default", "required"),
    [
        ("limits.speed", "rad/s", "", True),
        ("limits.acceleration", "rad/s^2", "", True),
        ("limits.effort", "N*m", "", True),
        ("mechanics.gear_ratio", "", "", True),
        ("mechanics.static", "N*m", "1.15 x coulomb", False),
        ("drive.full_speed", "rad/s", "motor.max_speed", False),
        ("drive.droop", "%", "0 %", False),
        ("detector.coarse.reduction", "", "mechanics.gear_ratio", False),
        ("method.form", "", "turn counter", False),
        ("method.strobe_period", "s", "2 ms", False),
        ("method.fraction_bits", "", "16", False),
        ("position.NUMBER.angle", "rad", "", True),
        ("position.NUMBER.speed", "rad/s", "limits.speed", False),
    ],
)
def test_rows_of_the_reference(key, unit, default, required):
    assert (ROWS[key].unit, ROWS[key].default, ROWS[key].required) == (unit, default, required)


@pytest.mark.parametrize(
    "overrides",
    [
        (),
        ("method.update=flag first", "method.task_phase=4.2 ms", "method.signed_remaining=false"),
        ("position.17.angle=-540 deg", "position.17.direction=as commanded", "drive.full_speed=1900 rpm"),
        ("disturbance.load.torque=-30 N*m", "disturbance.load.at=2 s", "disturbance.load.duration=60 ms"),
        ("detector.fine.noise=2 deg", "detector.coarse.offset_error=-3 %", "detector.seed=9223372036854775807"),
    ],
)
def test_loading_what_was_dumped_gives_the_same_specification(load_text, good_text, overrides):
    spec = load_text(good_text, *overrides).spec
    assert load_text(dump_spec(spec)).spec == spec


def test_the_tables_cannot_be_changed(load_text, good_text):
    spec = load_text(good_text).spec
    assert isinstance(spec.method, Table)
    with pytest.raises(ValueError, match="frozen"):
        spec.method.position_gain = 31.0


VALUES = [
    edit("no speed", 'speed = "60 deg/s"', "", "5:1", "limits.speed"),
    edit("hertz", '"60 deg/s"', '"1 Hz"', "6:1", "limits.speed"),
    edit("force", '"3 N*m"', '"3 N"', "8:1", "limits.effort"),
    edit("no ratio", RATIO, "", "19:1", "mechanics.gear_ratio"),
    edit("one", RATIO, "gear_ratio = 1 ", "20:1", "mechanics.gear_ratio"),
    edit("bare angle", '"10 deg"', "10", "22:1", "mechanics.start_angle"),
    edit("gain", "= 30 ", "= 0 ", "25:1", "method.position_gain"),
    edit("gain text", "= 30 ", '= "30 1/s" ', "25:1", "method.position_gain"),
    edit("number", "[position.1]", "[position.128]", "31:1", "position.128"),
    edit("name", "[position.1]", "[position.home]", "31:1", "position.home"),
    edit("no angle", 'angle = "90 deg"', "", "31:1", "position.1.angle"),
    edit("way", '"positive"', '"left"', "37:1", "position.2.direction"),
    edit("key", "[method]", "[method]\nrange = 1", "25:1", "method.range"),
    added("resolver", "[encoder]\nlines = 1", "45:1", "encoder"),
    added("no load", '[disturbance.load]\nat = "1 s"\nduration = "1 s"', "45:1", "disturbance.load.torque"),
]  # fmt: skip


@pytest.mark.parametrize("bad", params(value=VALUES))
def test_bad_value(bad, good_text, load_text, golden):
    check_bad_file(bad, good_text, load_text, golden)
