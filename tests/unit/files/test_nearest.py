"""Values that a message names: short, on the right side of their bound, and as the file wants them."""

import pytest

from detent.files.nearest import at_least, at_most, either, offer, put
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
    ],
)
def test_short_values_beside_a_bound(value, unit, down, up):
    assert (at_most(value, unit), at_least(value, unit)) == (down, up)


def test_digits_are_a_choice():
    assert at_most(0.0123456789, "m", digits=7) == '"12.34567 mm"'


@pytest.mark.parametrize(
    ("key", "text", "accepted"),
    [
        ("method.threshold", 1, True),
        ("method.threshold", 0, False),
        ("method.threshold", 1025, False),
        ("limits.speed", '"10 m/s"', True),
        ("limits.speed", '"10.01 m/s"', False),
        ("limits.speed", '"0 m/s"', False),
        ("detector.offset_error", '"-45 %"', True),
        ("detector.offset_error", '"-45.1 %"', False),
        ("motor.max_current", '"1 A"', True),
        ("motor.max_current", '"0 A"', False),
    ],
)
def test_a_value_beyond_the_bounds_of_its_key_is_not_offered(key, text, accepted):
    assert offer(PhaseServoSpec, key, text) == (f"set {key} = {text}" if accepted else "")


def test_remedies_are_joined():
    assert put("method.threshold", 7) == "set method.threshold = 7"
    assert either(put("a.b", [1, 2]), "", "do without") == "set a.b = [1, 2] or do without"
    assert either("", "") == ""
