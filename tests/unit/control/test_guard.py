import pytest

from detent.control.guard import (
    FOLLOWING,
    JUMPED,
    NEVER,
    NO_ARRIVAL,
    OVERSPEED,
    REVERSED,
    SATURATED,
    STUCK,
    TRAVEL,
    Guard,
    GuardParams,
    await_arrival,
    enable_guard,
    miss_arrival,
    watch,
)
from detent.errors import GUARD_TEXT

WATCHES = {"speed": 11, "jump": 15, "travel": 1, "following": 3, "saturated": 4, "stuck": 5, "reversed": 6}


def fault(samples, **params):
    """Code and number of the sample with the first fault; (0, None) without."""
    p, g = GuardParams(**(WATCHES | params)), Guard()
    for number, one in enumerate(samples, 1):
        seen = {"late": False, "side": 0, "limited": False, "pushing": 0, "moved": 5} | one
        if watch(p, g, *seen.values()):
            return int(g.code), number
    return 0, None


CALM = {}


@pytest.mark.parametrize(
    ("wrong", "code", "lasts"),
    [
        ({"late": True}, FOLLOWING, 3),
        ({"limited": True}, SATURATED, 4),
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
        ("following", {"late": True}),
        ("saturated", {"limited": True}),
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


@pytest.mark.parametrize("way", [1, -1])
def test_braking_is_none(way):
    braking = [{"pushing": way, "moved": -way * k} for k in range(10, -1, -1)]
    back = [{"pushing": way, "moved": way * k} for k in range(10)]
    assert fault([*braking, *back]) == (0, None)


def test_the_first_cause_stays_until_the_axis_is_enabled():
    p, g = GuardParams(**WATCHES), Guard()
    await_arrival(g, 1000)
    watch(p, g, False, -1, False, 0, 0)
    for _ in range(20):
        assert watch(p, g, True, 1, True, 1, 0) == TRAVEL
    assert (g.code, g.side) == (TRAVEL, -1)
    enable_guard(g)
    assert (g.code, g.side, g.stuck, g.deadline) == (0, 0, 0, 1000)
    miss_arrival(g)
    assert (g.code, g.deadline) == (NO_ARRIVAL, NEVER)


def test_every_fault_has_its_text():
    assert set(GUARD_TEXT) == {
        STUCK, JUMPED, REVERSED, FOLLOWING, SATURATED, OVERSPEED, NO_ARRIVAL, TRAVEL
    }  # fmt: skip
