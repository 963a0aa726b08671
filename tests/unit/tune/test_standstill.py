"""The engine of `detent hunt`, on courses made by hand."""

import math
from dataclasses import dataclass, field

import numpy as np
import pytest

from detent.methods.tuning import COLUMNS, Rule, Swing
from detent.tune.standstill import FLICKERS, HUNTS, OPEN, RESTS, Standstill, Stood, look, turns, watch

PERIOD = 1e-3
GRAIN = 1e-6


@dataclass
class Made:
    """A course whose load follows a function of time, the motor half of it."""

    motion: object
    start: str = "small"
    proven: bool = False
    leapt: float = 0.0
    rests_at: float = math.inf
    t: float = 0.0
    error: float = 2e-7
    asked: list[float] = field(default_factory=list)

    def go(self, seconds):
        self.asked.append(seconds)
        t = self.t + PERIOD * np.arange(1, round(seconds / PERIOD) + 1)
        t = t[t <= self.rests_at] if self.rests_at < self.t + seconds else t
        self.proven, self.t = self.rests_at < self.t + seconds, self.t + seconds
        rows = np.zeros((len(t), len(COLUMNS)))
        rows[:, 0], rows[:, 5] = t, self.error
        rows[:, 3] = rows[:, 4] = self.motion(t)
        rows[:, 1] = rows[:, 2] = 0.5 * rows[:, 4]
        return rows


def sine(amplitude, frequency, fade=0.0):
    return lambda t: amplitude * np.exp(-fade * t) * np.sin(2 * np.pi * frequency * t)


def test_hunting_is_shown_as_soon_as_turns_repeat():
    course = Made(sine(3e-6, 5.0))
    found = watch(course, GRAIN)
    assert (found.outcome, found.proven) == (HUNTS, True)
    assert (found.swing.load, found.swing.motor) == (pytest.approx(6e-6, rel=1e-2), pytest.approx(3e-6, rel=1e-2))
    assert found.swing.period == pytest.approx(0.2, rel=1e-2)
    assert found.simulated == 1.0
    assert course.asked == [0.25, 0.25, 0.5]


@pytest.mark.parametrize(
    ("motion", "outcome"),
    [
        (sine(2e-7, 5.0), FLICKERS),
        (sine(2e-7, 0.02), OPEN),  # too slow to have turned six times
        (sine(1.0, 0.02), OPEN),
        (sine(1.0, 5.0, fade=3.0), RESTS),  # it fades below a thousandth of a count
        (sine(1.0, 2.0, fade=0.05), OPEN),  # it fades, and has not come there
        (lambda t: 0.0 * t, RESTS),
    ],
)
def test_what_is_not_shown_within_the_time_is_judged_by_it(motion, outcome):
    found = watch(Made(motion), GRAIN)
    assert (found.outcome, found.proven, found.simulated) == (outcome, False, 30.0)
    assert found.error == 2e-7


def test_proven_rest_ends_it_and_keeps_the_error():
    found = watch(Made(sine(1e-6, 5.0), rests_at=0.4), GRAIN)
    assert (found.outcome, found.proven, found.simulated, found.error) == (RESTS, True, 0.5, 2e-7)


def test_turns_are_those_beyond_a_threshold_and_not_the_first_motion():
    t = np.linspace(0.0, 4.0, 4001)
    rows = np.zeros((len(t), len(COLUMNS)))
    rows[:, 1] = rows[:, 2] = np.cos(2 * np.pi * t) + 0.05 * np.cos(2 * np.pi * 40 * t)
    count, first, last = turns(rows, 1, 0.3)
    assert count == 7
    assert (t[first], t[last]) == (pytest.approx(0.5, abs=0.02), pytest.approx(3.5, abs=0.02))
    assert turns(rows, 1, 0.01)[0] > 100
    assert turns(rows, 1, 3.0)[0] == 0


def test_a_single_row_is_no_swing():
    seen = look(np.zeros((1, len(COLUMNS))))
    assert (seen.swing.largest, seen.ratio, seen.turns) == (0.0, 0.0, 0)


class Still:
    unit, grain, stated, rule = "m", GRAIN, True, Rule(0.0, math.inf, "")

    def kind(self, swing):
        return "stick-slip" if swing.period > 0.1 else "beyond the margin"


def stood(start="small", outcome=HUNTS, load=5e-6, period=1.0, error=1e-7):
    swing = Swing(motor=0.5 * load, load=load, period=period, command=0.1, held=0.9, limited=0.0)
    return Stood(start=start, outcome=outcome, proven=True, swing=swing, error=error, simulated=1.0, leapt=0.0)


def test_kinds_are_told_apart_by_a_factor_of_three():
    quick = stood("hard", load=9e-6, period=3e-3)
    found = Standstill(Still(), [stood(), stood("wide", load=8e-6), quick, stood(outcome=RESTS, error=-4e-7)])
    assert found.hunts
    assert found.outcome == HUNTS
    assert found.shares == {"rests": 0.25, "stands open": 0.0, "flickers": 0.0, "hunts": 0.75}
    fast, slow = found.kinds
    assert (fast.name, fast.by_itself, len(fast.found)) == ("beyond the margin", False, 1)
    assert (slow.name, slow.by_itself, slow.starts) == ("stick-slip", True, ["wide", "small"])
    assert (slow.swing("load"), slow.period, slow.worst.swing.load) == (pytest.approx(6.5e-6), 1.0, 8e-6)
    assert (found.swing, found.rest_error) == (9e-6, 4e-7)
    resting = Standstill(Still(), [stood(outcome=RESTS), stood(outcome=FLICKERS)])
    assert (resting.hunts, resting.outcome, resting.kinds, resting.swing) == (False, FLICKERS, [], 0.0)
