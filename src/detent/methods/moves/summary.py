"""The figures of a run of moves that a person wants first, and the same as rows for the terminal."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

from detent.methods.moves.run import MoveRecord, MoveRun
from detent.page.run_page import Worst, median_of, worst
from detent.page.words import GAP, CountUnit, count, duration, length, milliseconds, number

SOONEST = 1e-6  # an axis that says so by less than this before it is within the tolerance says so in time [s]

FAULT_WORDS = {
    "inserted": ("pulse put in", "pulses put in"),
    "removed": ("pulse taken away", "pulses taken away"),
    "lost samples": ("speed sample lost", "speed samples lost"),
    "corrupted": ("sensor sample corrupted", "sensor samples corrupted"),
}
"""What interference did, as `MoveRun.faults` names it, in words for one and for several."""

WorstMove = Worst[MoveRecord] | None


def arrived(run: MoveRun, move: MoveRecord) -> bool:
    """Whether a move ended within the tolerance, and the axis said so."""
    return not math.isnan(move.ready) and abs(move.error) <= run.tolerance


def settled(run: MoveRun, move: MoveRecord) -> float:
    """Time from the command until within the tolerance for good [s]; NaN for a move that ended outside."""
    return move.move_time if abs(move.error) <= run.tolerance else math.nan


def approach(move: MoveRecord) -> float:
    """Time from the mode switch until within the tolerance for good [s]; NaN for an axis of one mode."""
    return math.nan if math.isnan(move.switched) else max(move.settled - move.switched, 0.0)


@dataclass(frozen=True)
class MoveFigures:
    """Extremes and medians of a run, done or not; None and NaN where no move has the figure."""

    run: MoveRun

    @property
    def word(self) -> str:
        """What is counted: each move of a text is a character."""
        return "character" if self.run.job.kind == "text" else "move"

    @property
    def asked(self) -> int:
        """Moves of the job."""
        return len(self.run.job.moves)

    @property
    def seconds(self) -> float:
        """From the first readiness to the end of the job [s]."""
        return max(self.run.time_end - self.run.time_ready, 0.0) if self.run.moves else 0.0

    @cached_property
    def there(self) -> list[MoveRecord]:
        """Moves that arrived."""
        return [move for move in self.run.moves if arrived(self.run, move)]

    @cached_property
    def went(self) -> list[MoveRecord]:
        """Those that went farther than the tolerance."""
        return [move for move in self.there if abs(move.target - move.start) > self.run.tolerance]

    @cached_property
    def early(self) -> list[MoveRecord]:
        """Those of which the axis said so before they were within the tolerance for good."""
        return [move for move in self.there if move.settled - move.ready > SOONEST]

    @property
    def earliest(self) -> WorstMove:
        """The one that said so earliest, and by how much [s]."""
        return worst(self.early, lambda move: move.settled - move.ready)

    @property
    def longest(self) -> WorstMove:
        """The longest time to settle [s]."""
        return worst(self.went, lambda move: move.move_time)

    @property
    def overshoot(self) -> WorstMove:
        """Farthest beyond a target [m]."""
        return worst(self.run.moves, lambda move: move.overshoot)

    @property
    def error(self) -> WorstMove:
        """Largest magnitude of the error at the end of a dwell [m]."""
        return worst(self.run.moves, lambda move: abs(move.error))

    @property
    def peak_speed(self) -> WorstMove:
        """Largest speed [m/s]."""
        return worst(self.run.moves, lambda move: move.peak_speed)


def move_summary(run: MoveRun, unit: CountUnit) -> list[tuple[str, str]]:
    """Name and text of each figure of a run of moves; what a run did not come to is left out."""
    figures = MoveFigures(run)
    words = figures.word + "s"
    rows = [(words, f"{count(len(figures.there))} of {count(figures.asked)}")]
    if run.moves:
        rate = f", {number(run.moves_per_second)} {words} per second" if run.done else ""
        rows += [
            ("time", duration(figures.seconds) + rate),
            *_settling(figures),
            *_worst(figures.overshoot, "overshoot", unit),
            *_worst(figures.error, "error at rest", unit),
        ]
    if early := figures.earliest:
        moves = count(len(figures.early), "move")
        rows.append(("ready too early", f"{moves}, by up to {milliseconds(early.value)} {_whose(early.of)}"))
    if fastest := figures.peak_speed:
        rows.append(("peak speed", f"{number(fastest.value * 1e3)} mm/s {_whose(fastest.of)}"))
    rows.append(("motor", f"peak current {run.peak_current:.2f} A, energy {run.energy:.1f} J"))
    noise = interference_text(run)
    rows += [("interference", noise)] if noise else []
    return [(name, text.replace(GAP, " ")) for name, text in rows]


def _settling(figures: MoveFigures) -> list[tuple[str, str]]:
    within = f"until within {length(figures.run.tolerance)} for good"
    switched = [move for move in figures.went if not math.isnan(move.switched)]
    return [
        *_times(figures.went, lambda move: move.move_time, "settling", f"from the command {within}"),
        *_times(switched, approach, "final approach", f"from the mode switch {within}"),
    ]


def _times(moves: list[MoveRecord], time: Callable[[MoveRecord], float], name: str, span: str) -> list[tuple[str, str]]:
    longest = worst(moves, time)
    if longest is None:
        return []
    text = f"median {milliseconds(median_of(moves, time))}, worst {milliseconds(longest.value)} {_whose(longest.of)}"
    return [(name, f"{text}, {span}")]


def _worst(found: WorstMove, name: str, unit: CountUnit) -> list[tuple[str, str]]:
    return [(name, f"worst {length(found.value)}, {unit.counts(found.value)} {_whose(found.of)}")] if found else []


def _whose(move: MoveRecord) -> str:
    return f"(move {count(move.number)})"


def interference_text(run: MoveRun) -> str:
    """What interference did to the pulse lines: "30 pulses put in, 2 speed samples lost"; empty if it did nothing."""
    return ", ".join(count(n, *FAULT_WORDS[kind]) for kind, n in run.faults.items() if n)
