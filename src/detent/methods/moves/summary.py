"""The figures of a run of moves that a person wants first, and the same as rows for the terminal."""

import math
from collections.abc import Callable

from detent.methods.moves.run import SOONEST, MoveRecord, MoveRun
from detent.page.run_page import median_of, worst
from detent.page.words import GAP, CountUnit, count, duration, length, milliseconds, number

FAULT_WORDS = {
    "inserted": ("pulse inserted", "pulses inserted"),
    "removed": ("pulse removed", "pulses removed"),
    "lost samples": ("speed sample lost", "speed samples lost"),
    "corrupted": ("sensor sample corrupted", "sensor samples corrupted"),
}
"""What interference did, as `MoveRun.faults` names it, in words for one and for several."""


def arrived(run: MoveRun, move: MoveRecord) -> bool:
    """Whether a move ended within the tolerance, and the axis said so."""
    return move.arrived_within(run.tolerance)


class MoveFigures:
    """Extremes and medians of a run, done or not; None and NaN where no move has the figure."""

    def __init__(self, run: MoveRun) -> None:
        self.run, moves = run, run.moves
        self.word = "character" if run.job.kind == "text" else "move"  # what is counted
        self.asked = len(run.job.moves)
        # From the first readiness to the end of the job [s]; from power-on where the axis never was ready.
        self.seconds = max(run.time_end - run.time_ready, 0.0)
        self.there = [move for move in moves if arrived(run, move)]
        self.went = [move for move in self.there if abs(move.target - move.start) > run.tolerance]  # and went anywhere
        # Those of which the axis said so before they were within tolerance for good, and the earliest of them [s].
        self.early = [move for move in self.there if move.early > SOONEST]
        self.earliest = worst(self.early, lambda move: move.early)
        self.longest = worst(self.went, lambda move: move.settling)  # time to settle [s]
        # Of a move that the axis gave up on its way there is no overshoot, and no rest; what it is off is told as such.
        given_up = [move for move in moves if math.isnan(move.ready)]
        reached = [move for move in moves if move not in given_up or move.overshoot > 0]
        self.overshoot = worst(reached, lambda move: move.overshoot)  # farthest beyond a target [m]
        # Largest magnitude at the end of a dwell, and where the axis gave up [m].
        self.error = worst([move for move in moves if move not in given_up], lambda move: abs(move.error))
        self.short = worst(given_up, lambda move: abs(move.error))
        self.peak_speed = worst(moves, lambda move: move.peak_speed)  # [m/s]


def move_summary(run: MoveRun, unit: CountUnit) -> list[tuple[str, str]]:
    """Name and text of each figure of a run of moves; what a run did not come to is left out."""
    figures = MoveFigures(run)
    words, within = figures.word + "s", f"until within {length(run.tolerance)} for good"
    rows = [(words, f"{count(len(figures.there))} of {count(figures.asked)}")]
    if run.moves:
        rate = f", {number(run.moves_per_second)} {words} per second" if run.done else ""
        rows.append(("time", duration(figures.seconds) + rate))
    switched = [move for move in figures.went if not math.isnan(move.switched)]
    rows += _times(figures.went, lambda move: move.settling, "settling", f"from the command {within}")
    rows += _times(switched, lambda move: move.approach, "final approach", f"from the mode switch {within}")
    for name, found in (("overshoot", figures.overshoot), ("error at rest", figures.error)):
        if found:
            rows.append((name, f"worst {length(found.value)}, {unit.counts(found.value)} ({whose(found.of)})"))
    if short := figures.short:
        off = f"{length(short.value)}, {unit.counts(short.value)} ({whose(short.of)})"
        rows.append(("off its target in the end", off))
    if early := figures.earliest:
        moves = count(len(figures.early), "move")
        rows.append(("ready too early", f"{moves}, by up to {milliseconds(early.value)} ({whose(early.of)})"))
    if fastest := figures.peak_speed:
        rows.append(("peak speed", f"{number(fastest.value * 1e3)} mm/s ({whose(fastest.of)})"))
    rows.append(("motor", f"peak current {run.peak_current:.2f} A, energy {run.energy:.1f} J"))
    if noise := interference_text(run):
        rows.append(("interference", noise))
    return [(name, text.replace(GAP, " ")) for name, text in rows]


def _times(moves: list[MoveRecord], time: Callable[[MoveRecord], float], name: str, span: str) -> list[tuple[str, str]]:
    longest = worst(moves, time)
    if longest is None:
        return []
    text = f"median {milliseconds(median_of(moves, time))}, worst {milliseconds(longest.value)} ({whose(longest.of)})"
    return [(name, f"{text}, {span}")]


def whose(move: MoveRecord) -> str:
    """Which move it is: "move 3"."""
    return f"move {count(move.number)}"


def interference_text(run: MoveRun) -> str:
    """What interference did to the pulse lines: "30 pulses inserted, 2 speed samples lost"; empty if it did nothing."""
    return ", ".join(count(n, *FAULT_WORDS[kind]) for kind, n in run.faults.items() if n)
