"""Values that a message names: short, on the right side of their bound, and as the file wants them."""

import math

import pytest

from detent.files.nearest import Remedies, at_least, at_most, put
from detent.methods.phase_servo.schema import PhaseServoSpec


@pytest.mark.parametrize(
    ("value", "unit", "down", "up"),
    [
        (0.407166, "m/s", '"407.1 mm/s"', '"407.2 mm/s"'),
        (1e-5, "s", '"10 us"', '"10 us"'),
        (8057999.4, "Hz", '"8.057 MHz"', '"8.058 MHz"'),
        (0.99999, "A", '"999.9 mA"', '"1 A"'),
        (0.4175, "%", '"41.75 %"', '"41.75 %"'),
        (12345.0, "N", '"12.34 kN"', '"12.35 kN"'),
        (3.0, "", '"3"', '"3"'),
        # A round figure in degrees stays one, though radians give it back a last bit beside it.
        (math.radians(29), "rad", '"29 deg"', '"29 deg"'),
        (math.radians(60), "rad", '"60 deg"', '"60 deg"'),
        (math.radians(12.34567), "rad", '"12.34 deg"', '"12.35 deg"'),
    ],
)
def test_short_values_beside_a_bound(value, unit, down, up):
    assert (at_most(value, unit), at_least(value, unit)) == (down, up)


def test_digits_are_a_choice():
    assert at_most(0.0123456789, "m", digits=7) == '"12.34567 mm"'


@pytest.mark.parametrize(
    ("key", "value", "text"),
    [
        ("method.threshold", 1.0, "1"),
        ("method.threshold", 7.6, "7"),
        ("method.threshold", 0, ""),
        ("method.threshold", 1025, ""),
        ("limits.speed", 10.0, '"10 m/s"'),
        ("limits.speed", 10.01, ""),
        ("limits.speed", 0.0, ""),
        ("limits.speed", math.inf, ""),
        ("limits.speed", math.nan, ""),
        ("detector.offset_error", -0.45, '"-45 %"'),
        ("detector.offset_error", -0.451, ""),
        ("motor.max_current", 1.0, '"1 A"'),
        ("motor.max_current", 0.0, ""),
    ],
)
def test_a_value_beyond_the_bounds_of_its_key_is_not_named(key, value, text):
    remedy = Remedies(PhaseServoSpec)
    assert remedy.most(key, value, "do without") == (put(key, text) if text else "do without")


def test_values_keep_to_their_side():
    remedy = Remedies(PhaseServoSpec)
    assert remedy.least("method.threshold", 7.2) == "set method.threshold = 8"
    assert remedy.least("limits.speed", 0.123456) == 'set limits.speed = "123.5 mm/s"'
    assert remedy.least("detector.offset_error", -0.123456) == 'set detector.offset_error = "-12.34 %"'
    assert remedy.exactly("limits.speed", 0.123456) == 'set limits.speed = "123.456 mm/s"'
