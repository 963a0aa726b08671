"""What is watched around a loop: each watch by itself, and what it does not take for a fault."""

from typing import Any

import pytest

from detent.control.guard import Guard, GuardParams, enable_guard
from detent.control.reaction import SOFT
from detent.control.supervision import (
    DISAGREE,
    LINK_LOST,
    MOST_SWINGS,
    ON_SWITCH,
    OPEN_WIRE,
    SWINGS,
    TOO_HOT,
    Supervision,
    SupervisionParams,
    supervise,
    warm_up,
)

CALM: dict[str, float] = {"lost": 0, "apart": 0.0, "lower": 1, "upper": 1, "error": 0.0}
WATCHES: dict[str, Any] = {"link": 20, "slip": 1e-4, "switches": 1, "bears": 2.0, "warming": 0.1, "swing": 1e-3,
                           "slowest": 8}  # fmt: skip


class Watched:
    """A guard that has just been enabled, and what is watched around its loop."""

    def __init__(self, softly: int = 0, **params: Any) -> None:
        self.p, self.s = SupervisionParams(**(WATCHES | params)), Supervision()
        self.q, self.g = GuardParams(softly=softly), Guard()
        enable_guard(self.g)

    def see(self, times: int = 1, **seen: float) -> "Watched":
        for _ in range(times):
            supervise(self.p, self.s, self.q, self.g, *(CALM | seen).values())  # pyright: ignore[reportArgumentType]
            self.g.fresh = 0  # as the guard does
        return self

    @property
    def codes(self) -> tuple[int, int]:
        return int(self.g.code), int(self.g.hard)


def test_a_sound_axis_has_no_fault():
    assert Watched().see(1000, apart=0.9e-4, error=0.9e-3).codes == (0, 0)


@pytest.mark.parametrize("between", [0, 1, 19])
def test_a_second_word_that_is_none_within_the_time_is_a_fault(between):
    watched = Watched().see(lost=1)
    assert watched.see(between).codes == (0, 0)
    assert watched.see(lost=1).codes == (LINK_LOST, LINK_LOST)


def test_one_word_now_and_then_is_none():
    watched = Watched()
    for _ in range(10):
        watched.see(lost=1).see(20)
    assert watched.codes == (0, 0)
    assert Watched(link=0).see(10, lost=1).codes == (0, 0)


@pytest.mark.parametrize("apart", [1.1e-4, -1.1e-4])
def test_encoders_that_disagree_for_two_samples_are_a_fault(apart):
    watched = Watched().see(apart=apart).see().see(apart=apart)
    assert watched.codes == (0, 0)
    assert watched.see(apart=apart).codes == (DISAGREE, DISAGREE)
    assert Watched(slip=0.0).see(9, apart=1.0).codes == (0, 0)


@pytest.mark.parametrize(("ends", "side"), [({"lower": 0}, -1), ({"upper": 0}, 1)])
def test_running_onto_a_switch_is_a_fault_at_which_a_led_axis_comes_to_rest(ends, side):
    watched = Watched(SOFT).see().see(**ends)
    assert (*watched.codes, watched.g.side, watched.s.side) == (ON_SWITCH, 0, side, side)
    assert Watched().see().see(**ends).codes == (ON_SWITCH, ON_SWITCH)
    assert Watched(switches=0).see().see(9, lower=0, upper=0).codes == (0, 0)


def test_who_leads_an_axis_may_bring_it_away_from_a_switch_and_not_back():
    watched = Watched(SOFT).see(50, upper=0)
    assert (*watched.codes, watched.s.side) == (0, 0, 1)
    assert watched.see().s.side == 0
    assert watched.see(upper=0).codes == (ON_SWITCH, 0)
    assert Watched().see(upper=0).codes == (ON_SWITCH, ON_SWITCH)  # nobody leads it


def test_both_switches_at_once_are_a_wire():
    assert Watched(SOFT).see().see(lower=0, upper=0).codes == (OPEN_WIRE, 0)
    assert Watched(SOFT).see(lower=0, upper=0).codes == (OPEN_WIRE, 0)


def test_a_motor_bears_its_current_for_ever_and_more_for_a_while():
    watched = Watched(SOFT)
    for _ in range(2000):
        warm_up(watched.p, watched.s, -2.0)
    assert watched.s.heat == pytest.approx(1.0)
    watched.s.heat, samples = 0.0, 0
    while watched.s.heat < 1.0:
        assert watched.see().codes == (0, 0)
        warm_up(watched.p, watched.s, 4.0)
        samples += 1
    assert samples == 3  # 1 - 0.9^n reaches a quarter
    assert watched.see().codes == (TOO_HOT, 0)
    warm_up(watched.p, watched.s, 0.0)
    assert watched.s.heat < 1.0
    cold = Watched(bears=0.0)
    warm_up(cold.p, cold.s, 4.0)
    assert cold.s.heat == 0.0


def swing(watched: Watched, halves: int, samples: int, error: float = 1.1e-3) -> Watched:
    """Half swings of so many samples each."""
    for k in range(halves):
        watched.see(samples, error=error if k % 2 else -error)
    return watched


def test_swings_in_a_row_are_a_fault_and_an_overshoot_is_none():
    assert swing(Watched(SOFT), MOST_SWINGS - 1, 8).codes == (0, 0)
    assert swing(Watched(SOFT), MOST_SWINGS, 8).codes == (SWINGS, 0)
    assert swing(Watched(), 100, 9).codes == (0, 0)  # too slow to be one
    assert swing(Watched(), 100, 4, error=0.9e-3).codes == (0, 0)
    assert swing(Watched(swing=0.0), 100, 4).codes == (0, 0)
    ringing = Watched()
    for _ in range(10):
        swing(ringing, 6, 4).see(8)
    assert ringing.codes == (0, 0)


def test_swings_are_forgotten_with_enabling():
    watched = swing(Watched(), MOST_SWINGS - 1, 4)
    enable_guard(watched.g)
    assert swing(watched, MOST_SWINGS - 2, 4).codes == (0, 0)
