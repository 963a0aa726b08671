"""Figures that follow from a stepper-envelope specification: sections 3.1 and 7.1, and the tables' tests 1 to 16."""

import math

import numpy as np
import pytest

from detent.methods.stepper_envelope.build import make_tables
from detent.methods.stepper_envelope.derive import MotorFigures, derive, first_crossing
from detent.planning.step_envelope import StepEnvelope

A, X = "stepper.group_a", "stepper.x"
BARE = "[stepper.group_a.zone.near]", "[stepper.group_b.limits]"


def without_zones(text):
    """The zoom whose first group has no zones."""
    begin, end = (text.index(header) for header in BARE)
    return text[:begin] + text[end:]


def rows_of(axis, name):
    return {row.name.removeprefix(f"{name}: "): row for row in derive(axis.spec) if row.name.startswith(f"{name}: ")}


@pytest.fixture(scope="module")
def figures(load_text, good_text):
    return rows_of(load_text(without_zones(good_text)), "group_a")


@pytest.mark.parametrize(
    ("name", "value", "tolerance"),
    [
        ("step", 5e-6, 1e-18),
        ("step angle", math.radians(1.8), 1e-12),
        ("travel", 8000, 0),
        ("largest frequency f_max", 4000, 0),
        ("inertia J", 1.013e-6, 0.5e-9),
        ("natural frequency", 273.9, 0.1),
        ("start frequency", 400, 0.5),
        ("pull-out torque at standstill", 0.045, 1e-12),
        ("pull-out torque at f_max", 0.0129, 0.00005),
        ("torque left at f_max", 0.00047, 0.00001),
        ("end of the linear ramp", 3510, 10),
        ("end of the torque", 4340, 10),
        ("torque used", 0.44, 0.005),
        ("ramp", 228, 0),
        ("braking distance from f_max", 227, 0),
        ("shortest way that reaches f_max", 455, 0),
        ("time for the whole travel", 2.0839, 0.0005),
        ("memory of the tables", 32_000, 0),
        ("memory of the ramp", 456, 0),
        ("error at rest", math.asin(0.1) * 2 / math.pi, 1e-9),
    ],
)
def test_derived_figures_are_those_of_the_specification(figures, name, value, tolerance):
    assert figures[name].value == pytest.approx(value, abs=tolerance)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("inertia J", "10.13 g*cm^2, load 0.126 x rotor"),
        ("start frequency", "400 Hz (2 mm/s), 1.46 x natural"),
        ("largest frequency f_max", "4 kHz, 1200 rpm"),
        ("ramp", "228 entries, 98.94 ms"),
        ("braking distance from f_max", "227 steps, 1.135 mm"),
        ("time for the whole travel", "2.084 s, 9.6 x as fast as at the start frequency"),
        ("memory of the tables", "32000 bytes (as 8-bit indices 16000)"),
        ("error at rest", "0.0638 steps, 318.8 nm"),
    ],
)
def test_figures_are_told_with_what_they_mean(figures, name, text):
    assert figures[name].text == text


def test_every_figure_has_a_text_and_a_formula_and_names_its_motor(load_text, good_text, stage_text):
    for text, names in ((good_text, ("group_a", "group_b")), (stage_text, ("x", "y"))):
        found = derive(load_text(text).spec)
        assert all(row.text and row.formula and math.isfinite(row.value) for row in found)
        counts = [sum(row.name.startswith(f"{name}: ") for row in found) for name in names]
        assert counts[0] == counts[1] == len(found) / 2 > 15


def test_zones_take_time_and_memory_of_the_comparison_methods(load_text, good_text):
    rows = rows_of(load_text(good_text), "group_a")
    # Test 14: 3.3945 s.
    assert rows["time for the whole travel"].value == pytest.approx(3.3945, rel=1e-3)
    assert rows["memory of the tables"].formula.endswith("take 24")


def test_the_time_of_the_travel_is_that_of_its_table(load_text, good_text):
    figures = MotorFigures(load_text(good_text).spec, "group_a")
    table = StepEnvelope(make_tables(figures.table).ramp, make_tables(figures.table).up.zones)
    assert figures.travel_time == pytest.approx(float(np.sum(1 / table.permissible_hz())), rel=1e-12)


def test_a_travel_that_is_no_whole_number_of_steps_says_how_long_it_is(load_text, good_text):
    row = rows_of(load_text(good_text, f"{A}.limits.travel=40.003 mm"), "group_a")["travel"]
    assert (row.value, row.text) == (8000, "8000 steps, 40 mm")


def test_indices_of_a_long_ramp_need_more_than_eight_bits(load_text, good_text):
    rows = rows_of(load_text(good_text, f"{A}.limits.acceleration=0.1 m/s^2"), "group_a")
    assert rows["ramp"].value > 255
    assert rows["memory of the tables"].text == "32000 bytes"


def test_electrical_figures_are_those_of_a_known_winding(load_text, good_text, stage_text):
    assert not [name for name in rows_of(load_text(good_text), "group_a") if "winding" in name or "current" in name]
    rows = rows_of(load_text(stage_text, f"{X}.drive.bridge_resistance=1.3 ohm", f"{X}.drive.current=800 mA"), "x")
    assert rows["current rise time L / R"].value == pytest.approx(1e-3)
    assert rows["heat of the windings"].value == pytest.approx(2 * 5.3 * 0.64)
    assert rows["pull-out torque at standstill"].formula == "from winding, current and supply"


def test_the_start_frequency_of_a_motor_without_one_is_that_of_its_swing(load_text, stage_text):
    figures = MotorFigures(load_text(stage_text).spec, "x")
    assert figures.start_hz / figures.natural_hz == pytest.approx(3 / 2.1)
    # Half the current, half the torque: the rotor swings more slowly, and starts at less.
    weaker = MotorFigures(load_text(stage_text, f"{X}.drive.current=500 mA").spec, "x")
    assert weaker.natural_hz == pytest.approx(figures.natural_hz / math.sqrt(2))
    assert weaker.start_hz / weaker.natural_hz == pytest.approx(3 / 2.1)


def test_a_motor_that_starts_at_its_largest_speed_needs_no_ramp(load_text, stage_text):
    rows = rows_of(load_text(stage_text, f"{X}.limits.speed=1.6 mm/s"), "x")
    assert (rows["ramp"].value, rows["braking distance from f_max"].value) == (1, 0)
    assert rows["start frequency"].value == rows["largest frequency f_max"].value == 320
    assert rows["time for the whole travel"].text.endswith(", 1 x as fast as at the start frequency")


def test_torque_without_an_end_is_not_told(load_text, stage_text):
    free = ("motor.pull_out=first order", "motor.pull_out_torque=0.2 N*m", "motor.corner_frequency=1 MHz")
    rows = rows_of(load_text(stage_text, *(f"{X}.{text}" for text in free)), "x")
    assert "end of the torque" not in rows
    assert "end of the linear ramp" not in rows


def test_a_ramp_that_the_torque_limits_from_the_start_has_no_linear_part(load_text, good_text):
    rows = rows_of(load_text(good_text, f"{A}.limits.acceleration=5 m/s^2"), "group_a")
    assert rows["end of the linear ramp"].value == rows["start frequency"].value


def test_the_words_round_the_frequencies(load_text, good_text):
    figures = MotorFigures(load_text(good_text).spec, "group_a")
    # Test 31: 400 Hz = 2500 ticks and 4000 Hz = 250 ticks of 1 MHz exactly; in between half a tick of 250 at most.
    assert 1e-3 < figures.rounding(1e6, "reload") <= 2e-3
    assert figures.rounding(1e8, "reload") < 1e-4
    # Frequencies are whole Hz: half of one at 400 Hz.
    assert 0.5e-3 < figures.rounding(1e9, "frequency") <= 1.25e-3
    row = rows_of(load_text(good_text), "group_a")["largest rounding error"]
    assert row.value == figures.rounding(1e6, "reload")


def test_a_step_of_the_ramp_may_be_doubled_by_a_zone(load_text, stage_text):
    figures = MotorFigures(load_text(stage_text).spec, "x")
    share, hz = figures.torque_used
    # All of the ramp is linear: friction and twice the torque of the acceleration, over the torque at the frequency.
    needed = 0.02 + 2 * figures.inertia * math.radians(1.8) * 0.3 / 5e-6
    held = 0.27 * figures.motor.pull_out(hz) / figures.motor.pull_out(0.0)
    assert share == pytest.approx(needed / held, rel=1e-6)
    assert 3900 < hz <= 4000


@pytest.mark.parametrize(
    ("function", "place"),
    [
        (lambda hz: 1000 - hz, 1000),
        (lambda _: -1.0, 100),
        (lambda _: 1.0, None),
        (lambda hz: 50 - hz, 100),
        # The first of several.
        (lambda hz: math.cos(hz / 300), 150 * math.pi),
    ],
)
def test_the_first_crossing_of_a_curve(function, place):
    found = first_crossing(function, 100)
    assert found == (place if place is None else pytest.approx(place, rel=1e-9))
