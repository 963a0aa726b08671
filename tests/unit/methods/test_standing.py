"""Standstill after moves of an axis's own host: where starts lie, what rows say, when rest is proven."""

from types import SimpleNamespace

import numpy as np
import pytest

from detent.errors import AxisError
from detent.methods.registry import METHODS
from detent.methods.standing import HostCourse, Watched, places
from detent.methods.tuning import COLUMNS

WATCHED = Watched(
    place=lambda seen: seen["x"], error=lambda seen: 1.0 - seen["x"], velocity="v", command="u", limit=10.0,
    integral="i",
)  # fmt: skip


def course(x, u, i, **more):
    """A course whose next stretch is this."""
    x = np.asarray(x, float)
    block = np.zeros(len(x), [(name, "f8") for name in ("t", "x", "v", "u", "i")])
    block["x"], block["u"], block["i"], block["v"] = x, u, i, np.diff(x, prepend=x[0])
    machine = SimpleNamespace(tick=1e-3, recorder=None, time=0.5, close=lambda: None)
    made = HostCourse(
        start="move", machine=machine, watched=WATCHED, failure=more.pop("failure", str), **more,
        rest=lambda _: made.blocks.append(block),
    )  # fmt: skip
    return made


def test_starts_are_spread_evenly_and_the_same_however_many_there_are():
    eight = np.array([places(number, 1) for number in range(8)])
    assert np.unique(np.floor(8 * ((eight[:, 0] - eight[0, 0]) % 1.0 + 1e-9))).tolist() == list(range(8))
    assert len(np.unique(np.floor(3 * ((eight[:, 1] - eight[0, 1]) % 1.0 + 1e-9)))) == 3
    assert places(3, 1) == tuple(eight[3])
    assert places(3, 2) != places(3, 1)


def test_rows_lie_between_the_places_of_two_records():
    rows = course([0.0, 2.0, 1.0], [10.0, -3.0, 0.0], 0.0).go(1.0)
    assert rows.shape == (3, len(COLUMNS))
    assert rows[:, 1].tolist() == [0.0, 0.0, 1.0]
    assert rows[:, 2].tolist() == [0.0, 2.0, 2.0]
    assert (rows[:, 3:5] == rows[:, 1:3]).all()
    assert rows[:, 5].tolist() == [1.0, -1.0, 0.0]
    assert rows[:, 8].tolist() == [1.0, 0.0, 0.0]
    assert rows[:, 9].tolist() == [1.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("x", "u", "i", "noisy", "proven"),
    [
        (1.0, 0.0, 0.0, False, True),
        (1.0, np.geomspace(1e-9, 1e-12, 100), 0.0, False, True),
        (1.0, 0.0, 0.0, True, False),
        (1.0, 0.0, np.arange(100.0), False, False),
        (1.0, np.linspace(0.0, 1e-6, 100), 0.0, False, False),
        (np.where(np.arange(100) == 95, 1.1, 1.0), 0.0, 0.0, False, False),
        (np.where(np.arange(100) == 50, 1.1, 1.0), 0.0, 0.0, False, True),
    ],
)
def test_rest_is_proven_where_nothing_changes_through_the_last_fifth(x, u, i, noisy, proven):
    made = course(np.broadcast_to(x, 100), u, i, noisy=noisy)
    made.go(1.0)
    assert made.proven is proven


def test_an_axis_that_its_guard_has_switched_off_does_not_rest():
    with pytest.raises(AxisError, match=r"0\.5 s after power-on, when it should stand: the encoder is stuck"):
        course([1.0, 1.0], 0.0, 0.0, failure=lambda: "the encoder is stuck").go(1.0)


@pytest.mark.parametrize(("name", "why"), [("print_head", "friction holds"), ("stepper_envelope", "windings")])
def test_what_closes_no_loop_says_what_holds_it(name, why):
    assert why in METHODS[name].rests
    assert not METHODS[name].stands
