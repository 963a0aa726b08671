"""The catalogue's figures: complete, consistent, and honest about what was inferred."""

import math
from pathlib import Path

import pytest

from detent.axisfile import catalogue
from detent.axisfile.catalogue import DC_MOTORS
from detent.axisfile.tables import MotorTable
from detent.files.fields import leaf_fields, unit_of
from detent.units import parse_quantity

REAL = [name for name, entry in DC_MOTORS.entries().items() if not entry.get("inferred")]
UNITS = {path[0]: unit_of(field) for path, field in leaf_fields(MotorTable)}
DOCUMENTING = {
    "name": "",
    "maker": "",
    "source": "",
    "inferred": "",
    "nominal_voltage": "V",
    "no_load_speed": "rpm",
    "no_load_current": "A",
}


def test_there_is_a_choice_of_motors_and_makers():
    assert len(REAL) >= 12
    assert len({DC_MOTORS.entries()[name]["maker"] for name in REAL}) >= 3


def test_no_name_is_given_twice():
    text = Path(catalogue.__file__).with_name(DC_MOTORS.file).read_text(encoding="utf-8")
    assert text.count("[[motor]]") == len(DC_MOTORS.entries())


@pytest.mark.parametrize("name", DC_MOTORS.entries())
def test_an_entry_has_known_keys_a_source_and_readable_figures(name):
    entry = DC_MOTORS.entries()[name]
    assert {"name", "maker", "source", "nominal_voltage", "torque_constant", "resistance", "rotor_inertia"} <= set(
        entry
    )
    assert set(entry) <= set(DOCUMENTING) | set(DC_MOTORS.keys)
    assert len(entry["source"]) > 20
    for key, value in entry.items():
        unit = {**DOCUMENTING, **UNITS}[key]
        if unit:
            assert parse_quantity(value, unit) > 0


@pytest.mark.parametrize("name", REAL)
def test_the_published_no_load_point_lies_on_the_motors_line(name):
    entry = DC_MOTORS.entries()[name]
    speed = parse_quantity(entry["no_load_speed"], "rpm") * math.pi / 30
    constant = parse_quantity(entry["torque_constant"], "N*m/A")
    voltage = parse_quantity(entry["nominal_voltage"], "V")
    drop = parse_quantity(entry["resistance"], "ohm") * parse_quantity(entry["no_load_current"], "A")
    assert 0.95 < speed * constant / (voltage - drop) < 1.05
    assert 0 < drop < 0.1 * voltage


@pytest.mark.parametrize("name", REAL)
def test_time_constants_are_those_of_a_motor(name):
    # A slipped power of ten in inductance or inertia shows here.
    entry = DC_MOTORS.entries()[name]
    resistance = parse_quantity(entry["resistance"], "ohm")
    constant = parse_quantity(entry["torque_constant"], "N*m/A")
    mechanical = parse_quantity(entry["rotor_inertia"], "kg*m^2") * resistance / constant**2
    assert 1e-3 < mechanical < 30e-3
    if "inductance" in entry:
        assert 10e-6 < parse_quantity(entry["inductance"], "H") / resistance < 3e-3


def test_the_motor_of_the_specification_is_marked_as_inferred():
    entry = DC_MOTORS.entries()["JDH-2250-DF-1C (inferred)"]
    assert entry["inferred"] is True
    assert "INFERRED" in entry["source"]
    assert DC_MOTORS.constants(entry["name"]) == {
        "torque_constant": "0.24097 N*m/A",
        "resistance": "12 ohm",
        "inductance": "12 mH",
        "rotor_inertia": "260 g*cm^2",
    }


def test_an_unknown_motor_has_no_constants():
    assert DC_MOTORS.constants("perpetuum mobile") is None


def test_catalogue_keys_are_keys_of_the_axis_file():
    assert set(DC_MOTORS.keys) <= set(UNITS)
