"""Quantities with units: exact conversion in, readable text out."""

import math
import os
import subprocess
import sys
from fractions import Fraction

import pint
import pytest

from detent.units import COMMON_UNITS, KINDS, MAX_TEXT, QuantityError, describe_kind, format_quantity, parse_quantity


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("12 mm", "m", 0.012),
        ("3 in", "m", 0.0762),
        ("0.05in", "m", 0.00127),
        ("1 ft", "m", 0.3048),
        ("40 in/s", "m/s", 1.016),
        ("600 mm / s", "m/s", 0.6),
        ("5 ms", "s", 0.005),
        ("350 µs", "s", 350e-6),
        ("350 us", "s", 350e-6),
        ("44.5 g", "kg", 0.0445),
        ("260 g*cm^2", "kg*m^2", 2.6e-5),
        ("260 g cm²", "kg*m^2", 2.6e-5),
        ("2.6e-5 kg.m^2", "kg*m^2", 2.6e-5),
        ("-3 N", "N", -3.0),
        ("0.2 N·m/A", "N*m/A", 0.2),
        ("38 V", "V", 38.0),
        ("12 Ω", "ohm", 12.0),
        ("12 mohm", "ohm", 0.012),
        ("12 mH", "H", 0.012),
        ("+10 %", "%", 0.1),
        ("-2.5%", "%", -0.025),
        ("1.5e3 mA", "A", 1.5),
        ("8 MHz", "Hz", 8e6),
        ("31.25 kHz", "Hz", 31250.0),
        ("20 Hz", "Hz", 20.0),
        ("10 m/s^2", "m/s^2", 10.0),
        ("10 m/s²", "m/s^2", 10.0),
        ("726.8 mm/s^2", "m/s^2", 0.7268),
        ("600 in/s^2", "m/s^2", 15.24),
        ("500 um/s^2", "m/s^2", 500e-6),
        (".5 m", "m", 0.5),
        ("5. m", "m", 5.0),
    ],
)
def test_conversion_is_exact(text, unit, value):
    assert parse_quantity(text, unit) == value


def test_conversions_that_hold_pi_or_a_standard_gravity():
    assert parse_quantity("180 deg", "rad") == math.pi
    assert parse_quantity("25.2 V/krpm", "V*s/rad") == pytest.approx(0.240642, rel=1e-5)
    assert parse_quantity("34.1 ozf*in/A", "N*m/A") == pytest.approx(0.240799, rel=1e-5)


def test_equal_lengths_are_the_same_number():
    assert parse_quantity("3 in", "m") == parse_quantity("76.2 mm", "m") == parse_quantity("0.25 ft", "m")


@pytest.mark.parametrize(
    ("text", "unit", "words"),
    [
        ("12", "m", ["bare number 12", 'a length such as "12 mm"', "unit after the number"]),
        ("12 V", "m", ['"V"', "something else", "a length"]),
        ("12 foo", "m", ['unknown unit "foo"', "a length"]),
        ("foo", "m", ["not a number with a unit"]),
        ("", "m", ["not a number with a unit"]),
        ("nan m", "m", ["not a number with a unit"]),
        ("inf m", "m", ["not a number with a unit"]),
        ("1e999 m", "m", ["beyond any number"]),
        ("1 m" + "m" * MAX_TEXT, "m", ["not a number with a unit"]),
        ("10**10**10 m", "m", ["unknown unit"]),
        ("1 m^99", "m", ["unknown unit"]),
        ("1 (((m", "m", ["unknown unit"]),
        ("1 __import__", "m", ["unknown unit"]),
        ("12 kOhm", "ohm", ["unknown unit"]),
        ("10", "%", ["bare number 10", "a percentage"]),
        ("10 m", "%", ['the unit "m"', "a percentage"]),
        ("10 %", "m", ['the unit "%"', "a length"]),
        ("34.1 oz*in/A", "N*m/A", ["oz and lb are masses", "ozf"]),
        ("3 V/Hz", "V*s/rad", ["ambiguous", "rpm"]),
        ("3 count", "m", ["something else"]),
        ("3000 rpm", "Hz", ['ambiguous unit "rpm"', 'a frequency such as "20 kHz"', "write Hz, kHz or MHz"]),
        ("5 rad/s", "Hz", ['ambiguous unit "rad/s"', "write Hz, kHz or MHz"]),
        ("5 turn/s", "Hz", ["ambiguous", "write Hz, kHz or MHz"]),
        ("60 1/min", "Hz", ['unknown unit "1/min"', 'use a unit as in "20 kHz"']),
        ("5 ms", "Hz", ['"ms"', "something else", "a frequency"]),
        ("20", "Hz", ["bare number 20", "a frequency", "unit after the number"]),
        ("10 m/s", "m/s^2", ['"m/s"', "something else", 'an acceleration such as "10 m/s^2"']),
        ("10", "m/s^2", ["bare number 10", "an acceleration"]),
        ("10 Hz", "m/s^2", ["something else", "an acceleration"]),
    ],
)
def test_a_refusal_says_what_came_what_is_allowed_and_what_to_do(text, unit, words):
    with pytest.raises(QuantityError) as caught:
        parse_quantity(text, unit)
    for word in words:
        assert word in str(caught.value)
    assert caught.value.allowed
    assert caught.value.remedy


def test_a_quantity_error_is_a_value_error():
    assert issubclass(QuantityError, ValueError)


@pytest.mark.parametrize("unit", KINDS)
def test_the_example_of_every_kind_is_accepted(unit):
    _, example = describe_kind(unit)
    assert parse_quantity(example, unit) > 0


def test_an_unlisted_unit_describes_itself():
    assert describe_kind("W") == ("a quantity in W", "1 W")
    assert parse_quantity("3 kW", "W") == 3000.0


@pytest.fixture(scope="module")
def registry():
    """Pint's own units, which take half a second to read."""
    return pint.UnitRegistry(non_int_type=Fraction)


@pytest.mark.parametrize(("unit", "text"), [(unit, text) for unit, texts in COMMON_UNITS.items() for text in texts])
def test_the_built_in_factors_are_pints(unit, text, registry):
    assert registry.Quantity(Fraction(1), registry.parse_units(text)).to(unit).magnitude == COMMON_UNITS[unit][text]


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.0762, "m", "76.2 mm"),
        (1.016, "m/s", "1.016 m/s"),
        (350e-6, "s", "350 us"),
        (1234.0, "s", "1234 s"),
        (12.0, "ohm", "12 ohm"),
        (0.012, "H", "12 mH"),
        (12345.0, "V", "12.35 kV"),
        (-0.02, "A", "-20 mA"),
        (0.99999, "A", "1 A"),
        (0.0, "A", "0 A"),
        (0.045, "kg", "45 g"),
        (1.3212, "kg", "1.321 kg"),
        (2.6e-5, "kg*m^2", "260 g*cm^2"),
        (0.0, "kg*m^2", "0 kg*m^2"),
        (0.1, "%", "10 %"),
        (math.pi / 36, "rad", "5 deg"),
        (31250.0, "Hz", "31.25 kHz"),
        (8e6, "Hz", "8 MHz"),
        (0.5, "Hz", "500 mHz"),
        (9.80665, "m/s^2", "9.807 m/s^2"),
        (1234.0, "m/s^2", "1234 m/s^2"),
        (0.0005, "m/s^2", "500 um/s^2"),
        (3.14159, "", "3.142"),
        (3e-14, "H", "3e-05 nH"),
        (math.inf, "V", "inf V"),
    ],
)
def test_values_are_written_for_people(value, unit, text):
    assert format_quantity(value, unit) == text


def test_digits_are_a_choice():
    assert format_quantity(0.0423333333, "m", digits=6) == "42.3333 mm"


@pytest.mark.process
def test_pint_waits_until_an_unusual_unit_comes():
    program = (
        "import sys; from detent.units import parse_quantity; parse_quantity('3 in', 'm'); "
        "assert 'pint' not in sys.modules; parse_quantity('3 ft', 'm'); assert 'pint' in sys.modules"
    )
    subprocess.run([sys.executable, "-c", program], check=True, timeout=60)


@pytest.mark.process
def test_units_leave_nothing_in_the_users_cache(tmp_path):
    """What pint kept there was code to be run, and a damaged file of it a traceback."""
    program = "from detent.units import parse_quantity; assert parse_quantity('1 ft', 'm') == 0.3048"
    environment = os.environ | {"XDG_CACHE_HOME": str(tmp_path), "HOME": str(tmp_path)}
    subprocess.run([sys.executable, "-c", program], env=environment, check=True, timeout=60)
    assert list(tmp_path.rglob("*")) == []


@pytest.mark.parametrize(
    "text", ["((((m^9)^9)^9)^9)^9", "m^9^9", "(m)^2", "m^10", "m)(s", "m*", "(m*s", "mm" * 19 + "!"]
)
def test_what_is_no_product_of_units_never_reaches_pint(text, monkeypatch):
    """Powers of powers, 40 characters of them, kept pint busy for over 40 s."""
    from detent import units

    monkeypatch.setattr(units, "_registry", lambda: pytest.fail("pint was asked"))
    with pytest.raises(QuantityError, match="unknown unit"):
        parse_quantity(f"1 {text}", "m")
