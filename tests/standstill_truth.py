"""Truth test of `detent hunt`: drawn axes at standstill by brute force, and how often the forecast is right.

`python -m tests.standstill_truth`, from the root of the project, follows 48 starts of each axis for 200 s, of another
seed than those of the forecast, sample by sample: nothing is leapt over, nothing is proven. It takes half an hour of
processor time and keeps what came of it in standstill_truth.csv; a later call follows those that are missing there.
The comparison becomes a page of docs/explanation.
"""

import csv
import math
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np

from detent.cli.docs import table
from detent.methods.registry import METHODS
from detent.tune.standstill import BEYOND, HUNTS, LOAD, MOTOR, Standstill, standstill, turns
from tests.standstill_rig import drawn

AXES, STARTS, SEED = 72, 48, 2026
SECONDS, PIECE = 200.0, 10.0  # of a start, and that are simulated at a time [s]
PERIODS = 3.0  # over which an amplitude is taken, as it is in the forecast
NEVER = 2**62  # samples
WITHIN = 0.2  # of the true amplitude, that a forecast is right by
DATA = Path(__file__).with_suffix(".csv")
PAGE = Path(__file__).parents[1] / "docs" / "explanation" / "standstill-table.md"
SHAPES = "one mass", "two masses", "two masses and a gap"


class Followed(NamedTuple):
    """What one start did in the second half of its time."""

    whole: float  # swing of the mass that moves farther [m]
    last: float  # the largest of 10 s in the last quarter [m]
    swing: float  # median over stretches of three periods, at least 10 s [m]
    period: float  # NaN where it did not turn twice [s]


class Truth(NamedTuple):
    """What an axis does; amplitude and period are medians over the starts that hunt."""

    number: int
    hunting: int  # of 48 starts
    swing: float  # [m]; 0 where none hunts
    period: float  # [s]


def pieces(course) -> Iterator[np.ndarray]:
    """What a start does, sample by sample, 10 s at a time; it ends early where nothing has changed for so long."""
    course.watch.settled = NEVER  # neither leaps nor proofs
    for _ in range(round(SECONDS / PIECE)):
        rows = course.go(PIECE)
        yield rows
        if not np.ptp(rows[:, 1:8], axis=0).any():
            return


def swing(parts: Sequence[np.ndarray]) -> tuple[float, tuple[int, int]]:
    """How far the mass goes that moves farther [m], and the columns of its ends."""
    ends = [(max(rows[:, high].max() for rows in parts) - min(rows[:, low].min() for rows in parts), (low, high))
            for low, high in (MOTOR, LOAD)]  # fmt: skip
    return max(ends)


def followed(course) -> Followed:
    """Follow a start for 200 s."""
    count = round(SECONDS / PIECE)
    late = [rows for k, rows in enumerate(pieces(course)) if k >= count // 2]
    if not late:
        return Followed(0.0, 0.0, 0.0, np.nan)
    whole, columns = swing(late)
    turned, first, final = turns(np.concatenate(late), columns[0], BEYOND * whole)
    t = np.concatenate([rows[:, 0] for rows in late])
    period = 2.0 * (t[final] - t[first]) / (turned - 1) if turned > 1 else np.nan
    several = len(late) if np.isnan(period) else min(math.ceil(PERIODS * period / PIECE), len(late))
    stretches = [swing(late[k : k + several])[0] for k in range(0, len(late) - several + 1, several)]
    last = max((swing([rows])[0] for rows in late[count // 4 :]), default=0.0)
    return Followed(whole, last, float(np.median(stretches)), period)


def summed(number: int, grain: float, starts: Sequence[Followed]) -> Truth:
    """A start hunts that moves on by half a count, and in the last 50 s by half of what it did before."""
    hunting = [one for one in starts if one.whole >= 0.5 * grain and one.last >= 0.5 * one.whole]
    periods = [one.period for one in hunting if np.isfinite(one.period)]
    swings = [one.swing for one in hunting]
    return Truth(number, len(hunting), float(np.median(swings or [0.0])), float(np.median(periods or [np.nan])))


def truth_of(number: int, starts: int = STARTS) -> Truth:
    """Brute force, on two threads."""
    ensemble = METHODS["cascade"].standstill(drawn(number).spec)
    with ThreadPoolExecutor(2) as pool:
        found = list(pool.map(followed, ensemble.courses(starts, SEED, on_counts=False)))
    return summed(number, ensemble.grain, found)


def write(truths: Sequence[Truth], path: Path = DATA) -> None:
    """Keep them, three digits each."""
    rows = [Truth._fields, *((one.number, one.hunting, f"{one.swing:.3g}", f"{one.period:.3g}") for one in truths)]
    path.write_text("".join(f"{','.join(map(str, row))}\n" for row in rows), encoding="utf-8")


def truths(path: Path = DATA) -> list[Truth]:
    """What was kept."""
    with path.open(encoding="utf-8") as file:
        return [Truth(int(one["number"]), int(one["hunting"]), float(one["swing"]), float(one["period"]))
                for one in csv.DictReader(file)]  # fmt: skip


class Compared(NamedTuple):
    """An axis as it is, and as it was forecast."""

    truth: Truth
    found: Standstill

    @property
    def amplitude(self) -> float:
        """Median over the starts that hunt, as that of the truth [m]."""
        return float(np.median([one.swing.largest for one in self.found.found if one.outcome == HUNTS] or [0.0]))

    @property
    def right(self) -> bool:
        """The verdict is."""
        return self.found.hunts == (self.truth.hunting > 0)

    @property
    def off(self) -> float:
        """Share by which the amplitude is off, of one that hunts and was said to."""
        return self.amplitude / self.truth.swing - 1.0


def compare(kept: Sequence[Truth]) -> list[Compared]:
    """Forecast these axes as `detent hunt` does."""
    return [Compared(one, standstill(drawn(one.number).spec)) for one in kept]


def hunting(compared: Sequence[Compared]) -> list[Compared]:
    """Those that hunt, and were said to."""
    return [one for one in compared if one.truth.hunting and one.found.hunts]


def confirmed(one: Compared) -> int:
    """How many of the starts from which only the forecast says that it hunts do so by brute force as well."""
    ensemble = METHODS["cascade"].standstill(drawn(one.truth.number).spec)
    courses = ensemble.courses(len(one.found.found), one.found.seed, on_counts=False)
    said = [course for course, start in zip(courses, one.found.found, strict=True) if start.outcome == HUNTS]
    return summed(one.truth.number, ensemble.grain, [followed(course) for course in said]).hunting


def row(what: str, compared: Sequence[Compared]) -> tuple[str, ...]:
    """How often the forecast is right."""
    both, right = hunting(compared), sum(one.right for one in compared)
    offs = [abs(one.off) for one in both]
    median = f"{100 * np.median(offs):.1f} %" if offs else "-"
    return (what, str(len(compared)), str(sum(one.truth.hunting > 0 for one in compared)), str(right),
            f"{sum(off <= WITHIN for off in offs)} of {len(both)}", median)  # fmt: skip


def _time(period: float) -> str:
    return f"{period:.3g}" if math.isfinite(period) else "-"


def each(one: Compared) -> tuple[str, ...]:
    """An axis that hunts, or was said to."""
    share = f"{round(one.found.shares[HUNTS] * len(one.found.found))} of {len(one.found.found)}"
    period = float(np.median([start.swing.period for start in one.found.found if start.outcome == HUNTS] or [np.nan]))
    true = (f"{1e6 * one.truth.swing:.3g}", _time(one.truth.period)) if one.truth.hunting else ("-", "-")
    seen = (f"{1e6 * one.amplitude:.3g}", _time(period)) if one.found.hunts else ("-", "-")
    return (
        str(one.truth.number),
        SHAPES[one.truth.number % 3],
        f"{one.truth.hunting} of {STARTS}",
        *true,
        share,
        *seen,
    )


def missed(compared: Sequence[Compared]) -> str:
    """Axes of which the verdict is not that of the truth, and why."""
    told = list[str]()
    for one in compared:
        if not one.right and one.found.hunts:
            said = sum(start.outcome == HUNTS for start in one.found.found)
            told.append(f"Axis {one.truth.number} is said to hunt from {said} starts, and no start of the truth does. "
                        f"Followed by brute force, {confirmed(one)} of these {said} hunt as well.")  # fmt: skip
        elif not one.right:
            told.append(f"Axis {one.truth.number} hunts from {one.truth.hunting} of {STARTS} starts of the truth, and "
                        f"the forecast says: {one.found.outcome}.")  # fmt: skip
    return "\n\n".join(told) or "No verdict was wrong."


HEAD = """# Truth test: how often the forecast of hunting is right

This page is written by `python -m tests.standstill_truth`, run from the root of the project; do not edit it.

{axes} axes drawn at random (`tests/standstill_rig.py`), of numbers below {drawn}; one that is not here has not been
followed yet. A third each are one mass, two masses on a coupling, and two masses with a gap of 5 to 100 um: friction of
0 to 40 N, static friction 1 to 2 times as large, Stribeck velocities of 0 to 5 mm/s; no integral, or one of 0.5 to 30
kV/m; position gains of 10 to 100 1/s, velocity loops of 15 to 70 Hz; ideal encoders and counts of 0.05 to 5 um, on the
motor or on the load; delays of 0 to 2 samples. A count of an ideal encoder stands for 1 um here.

The truth is brute force: {starts} starts, each followed for {seconds:g} s sample by sample. An axis *hunts* where any
of them moves by half a count or more in the last 100 s, and in the last 50 s at least half as far. The forecast is that
of `detent hunt`: 24 other starts, with leaps over standing and an end as soon as rest or hunting is shown.

{summary}
{missed}

An amplitude is right within {within:g} %. It is taken over three periods, at least 10 s, for the forecast looks at a
few periods as well: an axis that wanders goes farther in 100 s.

## Those that hunt

Swings are medians over the starts that hunt, of the mass that moves farther, from peak to peak in um; periods in s.

{rows}
"""


def page(compared: Sequence[Compared]) -> str:
    """The comparison as a page."""
    heads = ("", "axes", "hunt", "verdict right", "amplitude right", "median error of it")
    groups = [(name, [one for one in compared if one.truth.number % 3 == k]) for k, name in enumerate(SHAPES)]
    summary = table(heads, [row(name, group) for name, group in [*groups, ("all", list(compared))]])
    heads = ("axis", "", "truth", "swing", "period", "forecast", "swing", "period")
    rows = table(heads, [each(one) for one in compared if one.truth.hunting or one.found.hunts])
    told = {"summary": summary, "rows": rows, "within": 100 * WITHIN, "missed": missed(compared)}
    return HEAD.format(axes=len(compared), drawn=AXES, starts=STARTS, seconds=SECONDS, **told)


def main() -> None:
    """Follow every axis that is not kept yet, compare, and write the page."""
    kept = {one.number: one for one in truths()} if DATA.exists() else {}
    for number in range(AXES):
        if number not in kept:
            kept[number] = truth_of(number)
            write([kept[key] for key in sorted(kept)])
            sys.stdout.write(f"{kept[number]}\n")
            sys.stdout.flush()
    PAGE.write_text(page(compare(truths())), encoding="utf-8")


if __name__ == "__main__":
    main()
