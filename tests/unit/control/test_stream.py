"""Set-points and what lies between them, by themselves and under an operation."""

import math
from typing import Any

import pytest
from tests.unit.control.test_operation import Desk

from detent.control import operation as ops
from detent.control.stream import (
    AHEAD,
    CLOSED,
    EFFORT,
    LATEST,
    POSITION,
    VELOCITY,
    Stream,
    advance_stream,
    is_lost,
    open_stream,
    point_in_turn,
    point_now,
)

PERIOD, LOOKS = 0.004, 4


def opened(quantity: int = POSITION, looks: int = LOOKS) -> Any:
    made = Stream()
    open_stream(made, quantity, looks, PERIOD)
    return made


def led(s: Any, looks: int = 1, here: float | None = None) -> list[float]:
    """References of looks, of an axis that goes where it is led."""
    found = []
    for _ in range(looks):
        advance_stream(s, s.value if here is None else here)
        found.append(s.value)
    return found


def test_a_set_point_is_reached_in_a_straight_line_in_its_period():
    s = opened()
    point_now(s, 1.0, 1.0)
    assert (s.fresh, led(s, LOOKS, here=1.0)) == (1, [1.0] * LOOKS)
    point_now(s, 1.4, 1.0)
    assert led(s, LOOKS) == pytest.approx([1.1, 1.2, 1.3, 1.4])
    assert (s.slope, s.bend) == (pytest.approx(0.4 / PERIOD), pytest.approx(0.4 / PERIOD**2))
    assert s.value == 1.4
    point_now(s, 1.8, 1.4)
    assert led(s, LOOKS)[-1] == 1.8
    assert s.bend == pytest.approx(0.0, abs=1e-6 / PERIOD**2)


def test_a_late_position_goes_on_along_its_slope_and_a_velocity_stays():
    s = opened()
    point_now(s, 1.4, 1.0)
    assert led(s, 1, here=1.0) == [pytest.approx(1.1)]
    assert led(s, 5)[-1] == pytest.approx(1.6)
    assert (s.late, s.bend) == (1, 0.0)
    point_now(s, 1.8, 1.6)  # half a period late is late, not two periods' way
    assert s.slope == pytest.approx(0.4 / (2 * PERIOD))
    for quantity in (VELOCITY, EFFORT):
        s = opened(quantity)
        point_now(s, 0.4, 0.0)
        assert led(s, 8, here=0.0)[-1] == 0.4
        assert s.slope == 0.0


def test_where_some_were_lost_the_difference_is_that_of_their_periods():
    s = opened()
    for value in (1.0, 1.1):
        point_now(s, value, 1.0)
        led(s, LOOKS, here=None if s.taken > 1 else 1.0)
    led(s, 2 * LOOKS)  # two that did not come
    point_now(s, 1.4, 1.3)
    assert s.slope == pytest.approx(0.1 / PERIOD)
    assert s.bend == pytest.approx(0.0, abs=1e-9 / PERIOD**2)


def test_the_newest_of_several_counts_and_its_slope_is_that_to_the_one_before():
    s = opened()
    point_now(s, 1.0, 1.0)
    led(s, LOOKS, here=1.0)
    point_now(s, 1.1, 1.0)
    point_now(s, 1.2, 1.0)
    assert s.slope == pytest.approx(0.1 / PERIOD)
    assert led(s, LOOKS)[-1] == 1.2


@pytest.mark.parametrize("looks", [1, 4])
def test_it_is_lost_when_so_many_periods_have_passed(looks):
    s = opened(looks=looks)
    assert not is_lost(s)
    led(s, 100)
    assert not is_lost(s)  # nothing has begun
    point_now(s, 1.0, 1.0)
    led(s, looks * (1 + LATEST) - 1)
    assert not is_lost(s)
    led(s)
    assert (is_lost(s), s.late) == (True, LATEST)


def test_set_points_in_turn_wait_for_one_another_and_the_last_one_ends_the_stream():
    s = opened()
    for k in range(1, 4):
        assert point_in_turn(s, 1.0 + k, 1.0, 1 if k == 3 else 0)
    assert not point_in_turn(s, 9.0, 1.0, 0)  # behind the last one
    assert led(s, 1, here=1.0) == [1.25]
    assert led(s, 11)[3::4] == [pytest.approx(2.25), pytest.approx(3.25)]
    assert (s.value, s.late) == (4.0, 0)
    led(s)
    assert (s.closing, s.value, is_lost(s)) == (CLOSED, 4.0, False)


def test_no_more_wait_than_there_is_room_for():
    s = opened()
    taken = [point_in_turn(s, float(k), 0.0, 0) for k in range(AHEAD + 3)]
    assert taken == [True] * (AHEAD + 1) + [False] * 2  # the first is reached for at once
    point_now(s, 5.0, 0.0)
    assert s.first == s.last


# ---- under an operation


class Streaming(Desk):
    """An enabled axis that streams."""

    def __init__(self, kind: int = ops.STREAM_POSITION, **more: Any) -> None:
        super().__init__(look=0.001, **more)
        self.enabled()
        self.stream = self.ask(kind, PERIOD)
        self.pass_looks()

    def send(self, value: float, kind: int = ops.POINT, **more: int) -> None:
        self.ask(kind, value, **{"id": self.stream} | more)


def test_a_stream_is_followed_from_its_first_set_point_to_a_stop():
    desk = Streaming()
    assert (desk.o.demand.do, desk.o.running) == (ops.HOLD, desk.stream)
    desk.send(0.1)
    desk.pass_looks()
    assert desk.o.demand.do == ops.FOLLOW
    desk.ask(ops.STOP)
    assert (desk.o.demand.do, desk.o.running) == (ops.HALT, desk.number)
    assert [one for one in desk.endings if one[0] == desk.stream] == [(desk.stream, ops.ABORTED, 0, desk.number)]
    desk.send(0.2)  # it belongs to nothing
    assert (desk.o.stream.dropped, desk.o.stream.goal) == (1, 0.1)


def test_lost_set_points_end_it_with_a_stop():
    desk = Streaming()
    desk.send(0.1)
    desk.pass_looks(LOOKS * (1 + LATEST) - 1)
    assert desk.o.running == desk.stream
    desk.pass_looks()
    assert desk.last == (desk.stream, ops.FAILED, ops.LEASE_LOST, 0)
    assert desk.o.demand.do == ops.HALT


def test_the_last_set_point_ends_it_well_in_the_window():
    desk = Streaming()
    desk.send(0.1, ops.LAST_POINT)
    desk.pass_looks(LOOKS + 1)
    assert (desk.o.demand.do, desk.o.running) == (ops.HALT, desk.stream)
    desk.pass_looks(3)
    assert desk.last == (desk.stream, ops.DONE, 0, 0)


def test_a_method_that_does_not_follow_is_brought_to_rest():
    desk = Streaming()
    desk.send(0.1)
    desk.a.refused = 113
    desk.pass_looks()
    assert (desk.last, desk.o.demand.do) == ((desk.stream, ops.REFUSED, 113, 0), ops.HALT)
    desk.a.refused = 0
    desk = Streaming()
    desk.send(0.1)
    desk.pass_looks()
    desk.a.refused = 114
    desk.pass_looks()
    assert (desk.last, desk.o.demand.do) == ((desk.stream, ops.FAILED, 114, 0), ops.HALT)


@pytest.mark.parametrize("wrong", [{"id": 99}, {"client": 2}, {"value": math.nan}, {"value": math.inf}])
def test_set_points_of_others_and_of_no_number_change_nothing(wrong):
    desk = Streaming()
    desk.send(0.1)
    before = len(desk.endings)
    value = wrong.pop("value", 0.2)
    desk.send(value, **wrong)
    s = desk.o.stream
    assert (s.goal, s.taken, s.dropped, len(desk.endings)) == (0.1, 1, 1, before)


@pytest.mark.parametrize(
    ("kind", "period", "trust", "why"),
    [
        (ops.STREAM_POSITION, 0.0, ops.REFERENCED, ops.NOT_FINITE),
        (ops.STREAM_POSITION, 2.0, ops.REFERENCED, ops.NOT_FINITE),
        (ops.STREAM_POSITION, -1.0, ops.REFERENCED, ops.NOT_FINITE),
        (ops.STREAM_POSITION, PERIOD, ops.NOT_KNOWN, ops.UNREFERENCED),
        (ops.STREAM_EFFORT, PERIOD, ops.NOT_KNOWN, ops.UNREFERENCED),
        (ops.STREAM_VELOCITY, PERIOD, ops.NOT_KNOWN, 0),
    ],
)
def test_what_is_no_stream_is_refused(kind, period, trust, why):
    desk = Desk(look=0.001).enabled()
    desk.o.trust = trust
    stream = desk.ask(kind, period)
    assert (desk.o.running == stream) == (why == 0)
    if why:
        assert desk.last == (stream, ops.REFUSED, why, 0)
