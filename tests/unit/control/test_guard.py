import math

import pytest

from detent.control.guard import (
    FOLLOWING,
    JUMPED,
    NO_ARRIVAL,
    NO_NUMBER,
    OVERSPEED,
    REVERSED,
    SATURATED,
    STUCK,
    TRAVEL,
    Guard,
    GuardParams,
    Weighing,
    await_arrival,
    begin_weighing,
    enable_guard,
    is_overdue,
    watch,
    watch_number,
    weigh_effort,
)
from detent.control.reaction import SOFT
from detent.control.supervision import DISAGREE, LINK_LOST, ON_SWITCH, OPEN_WIRE, SWINGS, TOO_HOT
from detent.errors import GUARD_TEXT

WATCHES = {"speed": 11, "jump": 15, "travel": 1, "following": 3, "saturated": 4, "stuck": 5, "reversed": 6}


def fault(samples, **params):
    """Code and number of the sample with the first fault; (0, None) without."""
    p, g = GuardParams(**(WATCHES | params)), Guard()
    for number, one in enumerate(samples, 1):
        seen = {"late": 0, "side": 0, "limited": 0, "pushing": 0, "moved": 5} | one
        if watch(p, g, *seen.values()):
            return int(g.code), number
    return 0, None


CALM = {}


@pytest.mark.parametrize(
    ("wrong", "code", "lasts"),
    [
        ({"late": 1}, FOLLOWING, 3),
        ({"limited": 1}, SATURATED, 4),
        ({"pushing": 1, "moved": 0}, STUCK, 5),
        ({"pushing": -1, "moved": 0}, STUCK, 5),
        ({"side": 1}, TRAVEL, 1),
        ({"moved": -12}, OVERSPEED, 2),
    ],
)
def test_a_fault_is_what_lasts(wrong, code, lasts):
    assert fault([CALM, *[wrong] * 50]) == (code, 1 + lasts)
    assert fault([*[wrong] * (lasts - 1), CALM] * 20) == (0, None)


@pytest.mark.parametrize(
    ("watch_of", "wrong"),
    [
        ("following", {"late": 1}),
        ("saturated", {"limited": 1}),
        ("stuck", {"pushing": 1, "moved": 0}),
        ("travel", {"side": -1}),
        ("speed", {"moved": 12}),
    ],
)
def test_a_watch_without_a_window_is_off(watch_of, wrong):
    assert fault([wrong] * 100, **{watch_of: 0}) == (0, None)


def test_a_jump_is_a_fault_the_second_time():
    jump = {"moved": 400}
    assert fault([CALM, jump, CALM, CALM, jump]) == (JUMPED, 5)
    assert fault([CALM, jump, CALM, CALM, jump], jump=0) == (0, None)


@pytest.mark.parametrize("way", [1, -1])
def test_speeding_up_against_the_effort_is_a_sensor_the_wrong_way_round(way):
    runaway = [{"pushing": way, "moved": -way * k} for k in range(1, 10)]
    assert fault(runaway) == (REVERSED, 6)


def runaway(way, push, answer, samples=12):
    """Effort and counts of an axis under a constant push: its effort grows with its speed against it, to a limit."""
    effort, speed = 0.0, 0.0
    for _ in range(samples):
        effort = max(effort, min(8.0, 0.5 * speed))
        yield way * effort, -way * round(speed)
        speed += push + answer * effort


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize(("push", "answer", "code"), [(1.0, 1.0, REVERSED), (12.0, -1.0, 0), (30.0, -1.0, 0)])
def test_effort_that_holds_back_what_a_force_drives_is_no_reversed_sensor(way, push, answer, code):
    p, g, w = GuardParams(reversed=10), Guard(), Weighing()
    for effort, moved in runaway(way, push, answer):
        weigh_effort(w, g, effort, moved)
        watch(p, g, 0, 0, 0, way if abs(effort) > 1.0 else 0, moved)
    assert g.code == code
    enable_guard(g)
    begin_weighing(w)
    assert (g.code, g.driven, w.effort, w.moved, w.against) == (0, 0, 0.0, 0, 0)


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize(("weighed", "code"), [(True, 0), (False, REVERSED)])
def test_a_sensor_that_has_counted_right_once_is_not_reversed(way, weighed, code):
    p, g, w = GuardParams(reversed=6), Guard(), Weighing()
    right, against = [way * k for k in range(8)], [-way * k for k in range(20)]
    for moved in right + against:
        if weighed:
            weigh_effort(w, g, 1.0 * way, moved)
        watch(p, g, 0, 0, 0, way, moved)
    assert (g.code, g.proven, g.driven) == (code, 1, weighed)


@pytest.mark.parametrize("way", [1, -1])
def test_braking_is_none(way):
    braking = [{"pushing": way, "moved": -way * k} for k in range(10, -1, -1)]
    back = [{"pushing": way, "moved": way * k} for k in range(10)]
    assert fault([*braking, *back]) == (0, None)


def test_the_first_cause_stays_until_the_axis_is_enabled():
    p, g = GuardParams(**WATCHES), Guard()
    watch(p, g, 0, -1, 0, 0, 0)
    for _ in range(20):
        assert watch(p, g, 1, 1, 1, 1, 0) == TRAVEL
    assert (g.code, g.side) == (TRAVEL, -1)
    enable_guard(g)
    assert (g.code, g.side, g.stuck, g.awaited) == (0, 0, 0, 0)


def test_an_arrival_is_awaited_for_so_many_ticks():
    g = Guard()
    await_arrival(g, 3)
    assert [is_overdue(g) for _ in range(3)] == [False, False, True]
    assert (g.code, g.awaited) == (NO_ARRIVAL, 0)
    await_arrival(g, 0)
    assert g.code == NO_ARRIVAL
    await_arrival(g, 3)
    assert g.code == 0


def test_a_late_arrival_switches_nothing_off_and_gives_way_to_what_does():
    p, g = GuardParams(**WATCHES), Guard()
    await_arrival(g, 1)
    assert is_overdue(g)
    assert [watch(p, g, 0, 0, 0, 0, 5) for _ in range(50)] == [0] * 50
    assert g.code == NO_ARRIVAL
    assert watch(p, g, 0, 1, 0, 0, 5) == TRAVEL
    assert (g.code, g.side) == (TRAVEL, 1)


def test_every_fault_has_its_text():
    around = {LINK_LOST, DISAGREE, SWINGS, TOO_HOT, ON_SWITCH, OPEN_WIRE}
    assert set(GUARD_TEXT) == around | {
        STUCK, JUMPED, REVERSED, FOLLOWING, SATURATED, OVERSPEED, NO_ARRIVAL, TRAVEL, NO_NUMBER
    }  # fmt: skip


def test_where_somebody_brings_it_to_rest_a_fault_leaves_the_drive_on_until_a_worse_one():
    p, g = GuardParams(**WATCHES, softly=SOFT), Guard()
    assert [watch(p, g, 1, 0, 0, 0, 5) for _ in range(50)] == [0] * 50
    assert g.code == FOLLOWING
    assert [watch(p, g, 0, 0, 0, 1, 0) for _ in range(5)] == [0] * 4 + [STUCK]
    assert g.code == FOLLOWING  # the first cause


def test_a_following_error_that_grows_on_switches_off():
    p, g = GuardParams(**WATCHES, softly=SOFT), Guard()
    assert [watch(p, g, 2, 0, 0, 0, 5) for _ in range(3)] == [0, 0, FOLLOWING]


@pytest.mark.parametrize("side", [-1, 1])
def test_an_axis_enabled_beyond_an_end_may_come_back_once(side):
    p, g = GuardParams(**WATCHES, softly=SOFT), Guard()
    enable_guard(g)
    assert [watch(p, g, 0, one, 0, 0, 5) for one in (side, side, 0)] == [0, 0, 0]
    assert g.code == 0
    watch(p, g, 0, side, 0, 0, 5)
    assert (g.code, g.side, g.hard) == (TRAVEL, side, 0)


def test_it_may_not_leave_by_the_other_end():
    p, g = GuardParams(**WATCHES, softly=SOFT), Guard()
    enable_guard(g)
    watch(p, g, 0, 1, 0, 0, 5)
    watch(p, g, 0, -1, 0, 0, 5)
    assert g.code == TRAVEL


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_switches_off_at_once(value):
    p, g = GuardParams(**WATCHES, softly=SOFT), Guard()
    watch_number(p, g, 1e9)
    assert g.code == 0
    watch_number(p, g, value)
    assert watch(p, g, 0, 0, 0, 0, 5) == g.code == NO_NUMBER
