"""Rows of the reference of the print-head axis."""

import pytest
from tests.reference import reference_rows

ROWS = {row.key: row for row in reference_rows("print_head")}


def test_keys_are_written_as_in_the_file():
    assert "print.left_margin" in ROWS
    assert "mechanics.friction.right.static" in ROWS
    assert not any(key.startswith("printing") for key in ROWS)


@pytest.mark.parametrize(
    ("key", "unit", "default", "required"),
    [
        ("limits.travel", "m", "", True),
        ("motor.back_emf_constant", "V*s/rad", "motor.torque_constant", False),
        ("motor.max_current", "A", "none", False),
        ("mechanics.start_position", "m", "0.25 x limits.travel", False),
        ("mechanics.friction.left.static", "N", "1.15 x coulomb", False),
        ("encoder.jitter", "rad", "0 deg", False),
        ("encoder.missing_edges", "", "0", False),
        ("method.trim", "", "true", False),
        ("method.zero_speed_timeout", "s", "5 ms", False),
        ("homing.speed", "m/s", "127 mm/s", False),
        ("disturbance.motor_constant", "%", "0 %", False),
        ("disturbance.push.force", "N", "", True),
    ],
)
def test_rows(key, unit, default, required):
    row = ROWS[key]
    assert (row.unit, row.default, row.required) == (unit, default, required)
