"""What a stepper-envelope file may say, and what it means by what it leaves out."""

import math

import pytest
from tests.bad_files import check_bad_file, edit, given, params
from tests.dump import dump_spec
from tests.reference import reference_rows

from detent.files.fields import held_leaves, leaf_fields
from detent.files.problems import dotted
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec

ROWS = {row.key: row for row in reference_rows("stepper_envelope")}
A, X = "stepper.group_a", "stepper.x"


def motor(load_text, text, name, *overrides):
    return load_text(text, *overrides).spec.stepper[name]


@pytest.mark.parametrize("name", ["good_text", "stage_text"])
def test_no_default_is_left_open_after_loading(load_text, name, request):
    spec = load_text(request.getfixturevalue(name)).spec
    values = [value for _, _, value in held_leaves(spec)]
    assert len(values) > 60
    assert not any(isinstance(value, float) and math.isnan(value) for value in values)


def test_defaults_of_single_keys_are_inside_their_own_bounds(load_text, good_text):
    # Pydantic does not check defaults; stating each one does.
    defaults = {
        dotted(path).replace("stepper.NAME", A): field.default
        for path, field in leaf_fields(StepperEnvelopeSpec)
        if field.annotation in {int, float} and not field.is_required()
    }
    plain = {key: value for key, value in defaults.items() if not ROWS[key.replace(A, "stepper.NAME")].unit}
    assert len(plain) >= 4
    for key, value in plain.items():
        load_text(good_text, f"{key}={value}")


def test_motors_and_zones_keep_the_order_of_the_file(load_text, good_text):
    spec = load_text(good_text).spec
    assert list(spec.stepper) == ["group_a", "group_b"]
    assert list(spec.stepper["group_a"].zone) == ["near", "far"]
    assert spec.stepper["group_b"].zone["fine"].direction == "both"


def test_what_is_left_out_comes_from_other_tables(load_text, good_text, stage_text):
    zoom = motor(load_text, good_text, "group_a")
    assert (zoom.mechanics.lower_end, zoom.mechanics.start_position) == (0.0, 0.0)
    assert (zoom.extremes.start, zoom.extremes.turn, zoom.extremes.stop) == (0.0, pytest.approx(0.04), 0.0)
    assert zoom.drive.current is None
    x = motor(load_text, stage_text, "x")
    assert (x.extremes.start, x.extremes.turn) == (-0.055, pytest.approx(0.055))
    assert (x.drive.current, x.motor.rated_current, x.motor.holding_torque) == (1.0, 1.0, pytest.approx(0.27))
    assert (x.motor.steps_per_turn, x.motor.start_frequency) == (200, None)
    assert motor(load_text, stage_text, "x", f"{X}.drive.current=600 mA").drive.current == 0.6


@pytest.mark.parametrize(
    ("steps", "step", "hz", "count"),
    # Test 30: 200 steps of 1.8 deg, 96 of 3.75 deg, 360 of 1 deg.
    [(200, 5e-6, 4000.0, 8000), (96, 10.416667e-6, 1920.0, 3840), (360, 2.777778e-6, 7200.0, 14400)],
)
def test_geometry_is_that_of_the_specification(load_text, good_text, steps, step, hz, count):
    slow = (f"{A}.limits.speed={20 * 200 / steps if steps > 200 else 20} mm/s", f"{A}.drive.start_safety=10")
    table = motor(load_text, good_text, "group_a", f"{A}.motor.steps_per_turn={steps}", *slow)
    assert table.step == pytest.approx(step, rel=1e-6)
    assert table.steps == count
    assert table.hz(0.02) == hz


def test_twenty_millimetres_a_second_are_four_thousand_steps_to_the_last_bit(load_text, good_text):
    assert motor(load_text, good_text, "group_a").max_hz == 4000.0


@pytest.mark.parametrize(
    ("travel", "steps"), [("40 mm", 8000), ("40.004 mm", 8000), ("40.005 mm", 8001), ("39.9999 mm", 7999)]
)
def test_the_travel_is_whole_steps(load_text, good_text, travel, steps):
    table = motor(load_text, good_text, "group_a", f"{A}.limits.travel={travel}")
    assert table.steps == steps
    assert table.upper_end == pytest.approx(steps * 5e-6)
    assert table.extremes.turn == table.upper_end


def test_places_are_steps_and_back(load_text, stage_text):
    x = motor(load_text, stage_text, "x")
    assert (x.step_at(-0.055), x.step_at(0.0), x.step_at(0.055)) == (0, 11_000, 22_000)
    assert x.step_at(0.0000026) == 11_001
    assert x.position_of(11_000) == pytest.approx(0.0, abs=1e-12)
    assert (x.step_at(0.06), x.step_inside(0.06), x.step_at(-0.06), x.step_inside(-0.06)) == (23_000, 22_000, -1000, 0)


def test_the_torque_held_is_in_proportion_to_the_current(load_text, stage_text):
    assert motor(load_text, stage_text, "x").held_torque == pytest.approx(0.27)
    assert motor(load_text, stage_text, "x", f"{X}.drive.current=600 mA").held_torque == pytest.approx(0.162)


@pytest.mark.parametrize(
    ("key", "unit", "default", "required"),
    [
        ("controller.timer", "Hz", "1 MHz", False),
        ("controller.tolerance", "", "0.5", False),
        ("stepper.NAME.limits.speed", "m/s", "", True),
        ("stepper.NAME.motor.start_frequency", "Hz", "3 x the natural frequency of rotor and field", False),
        ("stepper.NAME.motor.curve_torque", "N*m", "", False),
        ("stepper.NAME.drive.current", "A", "motor.rated_current", False),
        ("stepper.NAME.drive.reversal_pause", "", "1", False),
        ("stepper.NAME.mechanics.travel_per_revolution", "m", "", True),
        ("stepper.NAME.extremes.turn", "m", "upper end", False),
        ("stepper.NAME.zone.ZONE.begin", "m", "", True),
        ("stepper.NAME.zone.ZONE.direction", "", "both", False),
        ("stepper.NAME.method.rule", "", "ramp-limited", False),
    ],
)
def test_rows_of_the_reference(key, unit, default, required):
    assert (ROWS[key].unit, ROWS[key].default, ROWS[key].required) == (unit, default, required)


@pytest.mark.parametrize(
    "overrides",
    [
        (),
        (f"{X}.drive.current=700 mA", f"{X}.motor.start_frequency=300 Hz", "controller.words=frequency"),
        (f"{X}.extremes.turn=50 mm", f"{X}.extremes.start=-20 mm", f"{X}.extremes.stop=0.3 in"),
        (f"{X}.zone.a.begin=0 mm", f"{X}.zone.a.end=2 mm", f"{X}.zone.a.speed=5 mm/s", f"{X}.zone.a.direction=up"),
        (f"{X}.motor.pull_out=points", f'{X}.motor.curve_frequency=["1 kHz", "4.5 kHz"]',
         f'{X}.motor.curve_torque=["0.2 N*m", "5.3 N*cm"]', f"{X}.limits.speed=10 mm/s"),
    ],
)  # fmt: skip
def test_loading_what_was_dumped_gives_the_same_specification(load_text, stage_text, overrides):
    spec = load_text(stage_text, *overrides).spec
    assert load_text(dump_spec(spec)).spec == spec


SPEED = 'speed = "20 mm/s"'
WAY = f"{A}.motor.pull_out"
VALUES = [
    edit("speed", SPEED, 'speed = "4 kHz"', "10:1", f"{A}.limits.speed"),
    edit("bare", SPEED, "speed = 20", "10:1", f"{A}.limits.speed"),
    edit("no speed", SPEED, "", "8:1", f"{A}.limits.speed"),
    edit("torque", '"60 mN*m"', '"60 mN"', "15:1", f"{A}.motor.holding_torque"),
    edit("way", '"first order"', '"line"', "18:1", WAY),
    edit("rule", "[axis]", f'[{A}.method]\nrule = "x"\n[axis]', "2:1", f"{A}.method.rule"),
    given("direction", f"{A}.zone.near.direction=left", key=f"{A}.zone.near.direction"),
    given("timer", "controller.timer=20 kHz", key="controller.timer"),
    given("steps", f"{A}.motor.steps_per_turn=2", key=f"{A}.motor.steps_per_turn"),
    given("pause", f"{A}.drive.reversal_pause=256", key=f"{A}.drive.reversal_pause"),
    given("safety", f"{A}.drive.torque_safety=0.9", key=f"{A}.drive.torque_safety"),
    given("list", f"{A}.motor.curve_torque=45 mN*m", key=f"{A}.motor.curve_torque"),
    given("negative torque", f'{A}.motor.curve_torque=["45 mN*m", "-1 mN*m"]', key=f"{A}.motor.curve_torque"),
    given("bare torque", f"{A}.motor.curve_torque=[0.045]", key=f"{A}.motor.curve_torque"),
    given("catalogue", f"{A}.motor.catalogue=NEMA 17", key=f"{A}.motor.catalogue"),
]  # fmt: skip


@pytest.mark.parametrize("bad", params(value=VALUES))
def test_bad_value(bad, good_text, load_text, golden):
    check_bad_file(bad, good_text, load_text, golden)
