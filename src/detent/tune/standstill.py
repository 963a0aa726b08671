"""Whether an axis hunts at standstill: its own simulation from many starts, until rest or hunting is shown.

Rest is proven where friction holds both masses and no register that could move them changes. Hunting is shown by turns
that repeat and do not fade. A verdict is over all starts: an axis may rest from half of them and hunt from the others,
or only after a knock.
"""

import math
import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.kernel.step import step
from detent.methods.method import untold
from detent.methods.registry import METHODS
from detent.methods.tuning import COLUMNS, Course, Ensemble, Swing

Numbers = NDArray[np.float64]

LONGEST = 30.0  # simulated time of a start [s]; what is leapt over does not count
FIRST = 0.25  # stretch that is simulated before the first look [s]; each look doubles it
LAST = 0.6  # part of what was simulated that is looked at
TURNS = 6  # that show hunting
BEYOND = 0.15  # of the swing, that a turn goes at least
STEADY = 0.97, 1.03  # second half of a stretch over the first by which it is looked at no longer
FADING = 0.8  # the same below which a swing fades
GONE = 1e-3  # of the limit of flicker: so small a motion that fades is rest
APART = 3.0  # factor in amplitude or period between two kinds of hunting
RESTS, OPEN, FLICKERS, HUNTS = OUTCOMES = ("rests", "stands open", "flickers", "hunts")

MOTOR, LOAD = (1, 2), (3, 4)  # columns of the ends of both masses


@dataclass(frozen=True, slots=True, kw_only=True)
class Stood:
    """What came of one start."""

    start: str  # kind of the start
    outcome: str
    proven: bool  # rest was proven, or hunting was shown, before the time was over
    swing: Swing
    error: float  # reference less position at the end [m]; of one that hunts, the largest of its last stretch
    moved: bool  # it did not stand from the beginning
    simulated: float  # [s]
    leapt: float  # [s]


@dataclass(frozen=True, slots=True)
class Kind:
    """Starts that hunt alike."""

    name: str
    found: Sequence[Stood]

    @property
    def worst(self) -> Stood:
        """The one that moves farthest."""
        return max(self.found, key=lambda one: one.swing.largest)

    @property
    def starts(self) -> list[str]:
        """Kinds of starts that lead to it, in order."""
        return list(dict.fromkeys(one.start for one in self.found))

    @property
    def by_itself(self) -> bool:
        """True where no knock is needed."""
        return self.starts != ["hard"]

    @property
    def period(self) -> float:
        """Median [s]."""
        return float(np.median([one.swing.period for one in self.found]))

    @property
    def command(self) -> float:
        """Median swing of the command [V]."""
        return float(np.median([one.swing.command for one in self.found]))

    def swing(self, mass: str) -> float:
        """Median swing of "motor" or "load" [m]."""
        return float(np.median([getattr(one.swing, mass) for one in self.found]))


@dataclass(frozen=True)
class Standstill:
    """What an axis does at standstill, from all its starts."""

    ensemble: Ensemble
    found: Sequence[Stood]
    seed: int = 1
    on_counts: bool = False

    @property
    def shares(self) -> Mapping[str, float]:
        """Share of the starts by outcome."""
        return {name: sum(one.outcome == name for one in self.found) / len(self.found) for name in OUTCOMES}

    @property
    def hunts(self) -> bool:
        """True where any start hunts."""
        return self.shares[HUNTS] > 0.0

    @property
    def outcome(self) -> str:
        """The worst outcome of all starts."""
        return next(name for name in reversed(OUTCOMES) if self.shares[name] > 0.0)

    @cached_property
    def kinds(self) -> list[Kind]:
        """Kinds of hunting, the largest first; those that differ by more than a factor of 3 are two."""
        return self.kinds_of(HUNTS)

    def kinds_of(self, outcome: str) -> list[Kind]:
        """Kinds among the starts with an outcome."""
        groups = list[list[Stood]]()
        for one in sorted((one for one in self.found if one.outcome == outcome), key=lambda one: -one.swing.largest):
            alike = [group for group in groups if _alike(group[0].swing, one.swing)]
            (alike[0] if alike else groups.append([]) or groups[-1]).append(one)
        return [Kind(self.ensemble.kind(group[0].swing), group) for group in groups]

    @property
    def swing(self) -> float:
        """Largest swing of either mass [m]; 0 where nothing hunts."""
        return max((kind.worst.swing.largest for kind in self.kinds), default=0.0)

    @property
    def rest_error(self) -> float:
        """Largest error of a start that does not hunt [m]."""
        return max((abs(one.error) for one in self.found if one.outcome != HUNTS), default=0.0)


def _alike(one: Swing, other: Swing) -> bool:
    ratios = [one.largest / max(other.largest, 1e-300), one.period / other.period]
    return all(1.0 / APART <= ratio <= APART or math.isnan(ratio) for ratio in ratios)


def standstill(  # noqa: PLR0913 - what may be asked
    spec: Any, starts: int = 24, seed: int = 1, *, on_counts: bool = False, longest: float = LONGEST,
    progress: Any = untold,
) -> Standstill:  # fmt: skip
    """Watch an axis at standstill, on as many threads as there are processors; parameters as of `Axis.hunt`.

    Of each start at most `longest` [s] are simulated; standing that is leapt over does not count.
    """
    ensemble = METHODS[spec.axis.method].standstill(spec)
    courses = ensemble.courses(starts, seed, on_counts=on_counts)
    found = list[Stood]()
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        for one in pool.map(partial(watch, grain=ensemble.grain, longest=longest), courses):
            found.append(one)
            progress(len(found) / len(courses), f"start {len(found)} of {len(courses)}")
    return Standstill(ensemble, found, seed, on_counts)


def watch(course: Course, grain: float, longest: float = LONGEST) -> Stood:
    """Follow one start until rest or hunting is shown, or the time is over."""
    rows, simulated = np.zeros((0, len(COLUMNS))), 0.0
    while simulated < longest and not course.proven:
        more = min(max(FIRST, simulated), longest - simulated)
        rows = np.concatenate([rows, course.go(more)])
        simulated += more
        if course.proven:
            break
        seen = look(rows[_first(rows) :])
        if seen.swing.largest >= 0.5 * grain and seen.turns >= TURNS and STEADY[0] <= seen.ratio <= STEADY[1]:
            break
    stretch = rows[_first(rows) :]
    seen = NOTHING if course.proven else look(stretch)
    outcome = RESTS if course.proven else seen.outcome(grain)
    error = float(rows[-1, 5]) if outcome != HUNTS else float(np.max(np.abs(stretch[:, 5])))
    shown = course.proven or simulated < longest
    return Stood(
        start=course.start, outcome=outcome, proven=shown, swing=seen.swing, error=error,
        moved=float(_swings(rows).max()) >= GONE * grain, simulated=simulated, leapt=course.leapt,
    )  # fmt: skip


def _first(rows: Numbers) -> int:
    """Row with which the stretch begins that is looked at."""
    return int((1.0 - LAST) * len(rows))


@dataclass(frozen=True, slots=True)
class Seen:
    """What is seen of a stretch."""

    swing: Swing  # in its second half
    ratio: float  # of that to the one in the first half
    turns: int
    fades: bool  # from quarter to quarter it swings less far

    def outcome(self, grain: float) -> str:
        """What an axis does whose rest was not proven."""
        lasts = self.turns >= TURNS and (self.ratio >= FADING or not self.fades)
        if self.swing.largest >= 0.5 * grain:
            return HUNTS if lasts else OPEN
        if self.swing.largest < GONE * grain:
            return RESTS
        return FLICKERS if lasts else OPEN


NOTHING = Seen(Swing(motor=0.0, load=0.0, period=math.nan, command=0.0, held=1.0, limited=0.0), 0.0, 0, fades=True)


def look(rows: Numbers) -> Seen:
    """How an axis moves in a stretch of rows, shape (n, columns)."""
    if len(rows) < 4:
        return NOTHING
    half, parts = len(rows) // 2, [_swings(part) for part in np.array_split(rows, 4)]
    first, second = _swings(rows[:half]), _swings(rows[half:])
    mass, t = int(second[1] > second[0]), rows[:, 0]
    turned, first_turn, last_turn = turns(rows, (MOTOR, LOAD)[mass][0], BEYOND * float(second[mass]))
    period = 2.0 * (t[last_turn] - t[first_turn]) / (turned - 1) if turned > 1 else math.nan
    passed = np.diff(t, prepend=t[0])
    swing = Swing(
        motor=float(second[0]), load=float(second[1]), period=float(period), command=float(np.ptp(rows[half:, 6])),
        held=float(np.sum(passed * rows[:, 8]) / max(np.sum(passed), 1e-300)), limited=float(np.mean(rows[:, 9])),
    )  # fmt: skip
    ratio = float(second[mass] / first[mass]) if first[mass] > 0.0 else 0.0
    fades = all(one[mass] > after[mass] for one, after in pairwise(parts))
    return Seen(swing, ratio, turned, fades)


@step
def turns(rows: Numbers, low: int, least: float) -> tuple[int, int, int]:
    """Turns of more than `least` [m] of what lies between column `low` and the next: how many, first and last row."""
    count, first, last, way, place = 0, 0, 0, 0, 0
    lowest = highest = 0.5 * (rows[0, low] + rows[0, low + 1])
    for k in range(rows.shape[0]):
        below, above = rows[k, low], rows[k, low + 1]
        turn = -1 if way >= 0 and below < highest - least else 1 if way <= 0 and above > lowest + least else 0
        if turn != 0:
            if way != 0:  # the first motion is no turn
                count, last = count + 1, place
                first = place if count == 1 else first
            way, place, lowest, highest = turn, k, below, above
        elif way > 0 and above > highest:
            highest, place = above, k
        elif way < 0 and below < lowest:
            lowest, place = below, k
        elif way == 0:
            lowest, highest = min(lowest, below), max(highest, above)
    return count, first, last


def _swings(rows: Numbers) -> Numbers:
    """Of motor and load, peak to peak [m]."""
    return np.array([rows[:, high].max() - rows[:, low].min() for low, high in (MOTOR, LOAD)])
