"""The reference is generated from the declarations, so every key of every method must be declared in full."""

import pytest
from tests.reference import reference_rows

from detent.methods.registry import METHODS

ROWS = [pytest.param(row, id=f"{name}: {row.key}") for name in METHODS for row in reference_rows(name)]


@pytest.mark.parametrize("row", ROWS)
def test_every_key_is_documented(row):
    assert len(row.doc) >= 4
    assert not row.doc.endswith(".")
    assert row.allowed
    assert bool(row.example) == row.required


NO_LIMIT_AT_ALL = {("cascade", "limits.jerk"), ("cascade", "limits.lowest")}
"""Keys beside the limits that need not be stated: where the way begins, and a limit that only some moves have."""


@pytest.mark.parametrize("name", METHODS)
def test_limits_have_no_defaults(name):
    limits = [row for row in reference_rows(name) if "limits." in row.key and (name, row.key) not in NO_LIMIT_AT_ALL]
    assert len(limits) >= 3
    assert all(row.required for row in limits)


@pytest.mark.parametrize(
    ("method", "key"),
    [("rotary_table", "position.NUMBER.angle"), ("stepper_envelope", "stepper.NAME.zone.ZONE.speed")],
)
def test_a_placeholder_stands_for_a_name_of_the_user(method, key):
    assert key in {row.key for row in reference_rows(method)}
