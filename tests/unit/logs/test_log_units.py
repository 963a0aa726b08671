"""Units in headings: where they stand, how they are written, what they become."""

import math

import pytest

from detent.logs.headings import BITS, Conversion, find_conversion, is_unit, split_heading


@pytest.mark.parametrize(
    ("heading", "name", "unit"),
    [
        ("position [mm]", "position", "mm"), ("time(ms)", "time", "ms"), ("t/s", "t", "s"), ("v/mm/s", "v", "mm/s"),
        ("Position, mm", "Position", "mm"), ("enc1_mm", "enc1", "mm"), ("speed_mm_s", "speed", "mm_s"),
        ("Measured Motor Steps", "Measured Motor", "Steps"), ("input_V", "input", "V"), ("t_s", "t", "s"),
        ("inputSignal(8bits)", "inputSignal", "8bits"), ("T [°C]", "T", "°C"), ("a [m/s^2]", "a", "m/s^2"),
        ("qm", "qm", ""), ("goal_position", "goal_position", ""), ("motor.velocity", "motor.velocity", ""),
        ("[mm]", "[mm]", ""), ("ratio a/b", "ratio a/b", ""), ("", "", ""), ("steps", "steps", ""),
    ],
)  # fmt: skip
def test_headings(heading, name, unit):
    assert split_heading(heading) == (name, unit)


@pytest.mark.parametrize(
    ("text", "unit", "factor", "offset"),
    [
        ("mm", "m", 1e-3, 0), ("µm", "m", 1e-6, 0), ("0.3125 um", "m", 0.3125e-6, 0),
        ("1.8 deg", "rad", math.pi / 100, 0),
        ("°", "rad", math.pi / 180, 0), ("rpm", "rad/s", math.tau / 60, 0), ("U/min", "rad/s", math.tau / 60, 0),
        ("deg/s", "rad/s", math.pi / 180, 0), ("m/s²", "m/s^2", 1, 0), ("g0", "m/s^2", 9.80665, 0), ("Nm", "N*m", 1, 0),
        ("mNm", "N*m", 1e-3, 0), ("35.15 N", "N", 35.15, 0), ("mA", "A", 1e-3, 0), ("Amps", "A", None, 0),
        ("usec", "s", 1e-6, 0),
        ("degC", "K", 1, 273.15), ("°C", "K", 1, 273.15), ("K", "K", 1, 0), ("°F", "K", 5 / 9, 459.67 * 5 / 9),
        ("2 degC", "K", None, 0), ("%", "", 0.01, 0), ("", "", 1, 0), ("-", "", 1, 0), ("8bits", "", 1, 0),
        ("10 bit", "", 1, 0),
        ("0.5", "", 0.5, 0), ("steps", "count", 1, 0), ("Counts", "count", 1, 0), ("cts/s", "count/s", 1, 0),
        ("4 counts", "count", 4, 0), ("steps", "m", None, 0), ("steps", "rad", None, 0), ("1/s", "rad/s", None, 0),
        ("m", "count", None, 0), ("mm", "s", None, 0), ("furlong per hour or so", "m", None, 0),
        ("m" * 100, "m", None, 0),
        ("Hz", "rad/s", None, 0), ("rad", "m", None, 0), ("turn", "rad", math.tau, 0),
    ],
)  # fmt: skip
def test_conversions(text, unit, factor, offset):
    found = find_conversion(text, unit)
    if factor is None:
        assert found is None
    else:
        assert found == Conversion(unit, pytest.approx(factor, rel=1e-14), offset)


def test_rows_of_units():
    assert all(map(is_unit, ["s", "mm", "V", "deg", "N*m", "", "-", "counts", "degC", "rpm"]))
    assert not any(map(is_unit, ["time", "x", "12.5 apples"]))


def test_bits():
    widths = [BITS.fullmatch(text) for text in ("8bits", "16 bit", "bits", "mm")]
    assert [width and int(width[1]) for width in widths] == [8, 16, None, None]
