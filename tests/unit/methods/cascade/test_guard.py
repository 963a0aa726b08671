"""When the drive goes off, in the sample that shows it, and when a move is in position."""

import math

import numpy as np

import detent
from detent.methods.cascade.guard import Arrival, Guard
from detent.methods.cascade.host import Stop
from detent.methods.load import load_spec


def linear(*overrides):
    return load_spec(detent.example("cascade.toml"), overrides)


def rows_of(count):
    rows = np.zeros(
        count,
        [
            ("controller.law.position_error", "f8"),
            ("controller.law.limited", "u1"),
            ("plant.machine.load.position", "f8"),
        ],
    )
    rows["plant.machine.load.position"] = 0.1
    return rows


def test_the_guard_takes_what_is_no_number_for_wrong():
    rows = rows_of(4)
    guard = Guard(linear(), 1e-3)
    assert guard(rows) is None
    rows["controller.law.position_error"][2] = math.nan
    found = guard(rows)
    assert found is not None
    assert found.samples == 3
    assert "following error" in found.cause


def test_what_comes_first_is_told():
    rows = rows_of(4)
    rows["controller.law.position_error"][3], rows["plant.machine.load.position"][1] = 1.0, -1.0
    found = Guard(linear(), 1e-3)(rows)
    assert found is not None
    assert found.samples == 2
    assert "lower end" in found.cause


def test_saturation_is_counted_over_stretches():
    rows = rows_of(600)
    rows["controller.law.limited"] = 1
    guard = Guard(linear(), 1e-3)
    assert guard(rows) is None
    found = guard(rows)
    assert found is not None
    assert found.samples == 400


def test_a_move_is_in_position_once_its_error_has_been_small_for_long_enough():
    spec = linear("method.in_position_time=5 ms")
    arrival = Arrival(spec, 1e-3, Guard(spec, 1e-3))
    rows = rows_of(4)
    rows["controller.law.position_error"][0] = 1e-3
    assert arrival(rows) is None
    # Three of the five samples lie in the stretch before.
    assert arrival(rows_of(4)) == Stop(2)


def test_the_guard_comes_before_the_arrival():
    spec = linear("method.in_position_time=2 ms")
    rows = rows_of(6)
    rows["controller.law.position_error"][:4] = 1e-3
    rows["plant.machine.load.position"][4] = 9.0
    found = Arrival(spec, 1e-3, Guard(spec, 1e-3))(rows)
    assert found is not None
    assert found.samples == 5
    assert "upper end" in found.cause
    rows["plant.machine.load.position"][4] = 0.1
    assert Arrival(spec, 1e-3, Guard(spec, 1e-3))(rows) == Stop(6)
