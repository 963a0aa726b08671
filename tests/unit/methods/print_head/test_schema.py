"""Helpers of the schema, and its promises about defaults."""

import math

import pytest

from detent.files.fields import leaf_fields
from detent.files.problems import field_at
from detent.methods.print_head.schema import PrintHeadSpec, speed_value


@pytest.mark.parametrize(
    ("velocity", "value"),
    [(1.016, 240), (0.0762, 18), (0.127, 30), (1.0, 236), (0.0254 / 6 * 59, 59), (0.0254 / 6 * 59.999, 59), (0.0, 0)],
)
def test_speed_values_are_rounded_down_to_the_grid(velocity, value):
    assert speed_value(velocity) == value


def test_every_speed_value_survives_its_own_velocity():
    assert [speed_value(value * 0.0254 / 6) for value in range(18, 241)] == list(range(18, 241))


def test_no_default_is_left_open_after_loading(load_text, good_text):
    spec = load_text(good_text).spec
    values = [
        value
        for table in (spec.mechanics, spec.method, spec.disturbance, spec.motor, spec.homing, spec.printing)
        for value in dict(table).values()
        if isinstance(value, float)
    ]
    assert len(values) >= 20
    assert not any(math.isnan(value) for value in values)


def test_defaults_of_single_keys_are_inside_their_own_bounds(load_text, good_text):
    # Pydantic does not check defaults; stating each one does.
    for path, field in leaf_fields(PrintHeadSpec):
        if isinstance(field.default, int) and not isinstance(field.default, bool):
            load_text(good_text, f"{'.'.join(path)}={field.default}")


def test_an_unknown_path_has_no_declaration():
    with pytest.raises(KeyError):
        field_at(PrintHeadSpec, ("limits", "nothing"))
    with pytest.raises(KeyError):
        field_at(PrintHeadSpec, ())
