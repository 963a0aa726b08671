"""The figures of a run that a person wants first, as rows of text for the terminal."""

import math
import statistics
from collections.abc import Callable

from detent.methods.moves.page_data import MoveFigures, Worst
from detent.methods.moves.run import MoveRecord, MoveRun, ServoSpec
from detent.methods.phase_servo.schema import PhaseServoSpec
from detent.methods.print_head.run import Direction, PrintRun
from detent.page.words import GAP, CountUnit, count, duration, length, number

SOONEST = 1e-6
"""An axis that says so by less than this before it is within the tolerance says so in time [s]."""

FAULT_WORDS = {
    "inserted": ("pulse put in", "pulses put in"),
    "removed": ("pulse taken away", "pulses taken away"),
    "lost samples": ("speed sample lost", "speed samples lost"),
    "corrupted": ("sensor sample corrupted", "sensor samples corrupted"),
}
"""What interference did, as `MoveRun.faults` names it, in words for one and for several."""


def summary_rows(run: PrintRun) -> list[tuple[str, str]]:
    """Name and text of each figure; what a run did not come to is left out.

    Parameters
    ----------
    run : PrintRun
        Printed or not.

    Returns
    -------
    list of (str, str)
        Such as ("lines", "11 of 11, on 1 page").
    """
    asked = len(run.job.lines)
    rows = [("lines", f"{_plain(len(run.lines))} of {_plain(asked)}, on {_plain(run.job.pages, 'page')}")]
    if run.lines:
        rows += [
            ("characters", f"{_plain(run.characters)}, {run.characters_per_second:.0f} per second"),
            ("time", f"{run.print_time:.2f} s, after {run.time_ready:.2f} s of homing and identification"),
            ("speeds", ", ".join(f"{s / 6:.4g} in/s ({_plain(n, 'line')})" for s, n in run.speeds.items())),
            ("turn-arounds", f"{_plain(run.turn_arounds)}; runs back before a line: {_plain(run.repositions)}"),
            ("column error", f"worst {run.worst_error * 1e6:.1f} µm, rms {run.rms_error * 1e6:.1f} µm"),
        ]
    rows += [(f"identified, {side}", _direction(line)) for side, line in run.identified.items() if line.speed_fast]
    return [*rows, ("motor", f"peak current {run.peak_current:.2f} A, energy {run.energy:.1f} J")]


def _direction(line: Direction) -> str:
    return (
        f"slope K {line.slope} (true {line.true_slope:.1f}), "
        f"friction {line.friction} counts (true {line.true_friction:.1f})"
    )


def _plain(value: int, word: str = "") -> str:
    """A count with ordinary spaces: what a terminal shows and a script splits."""
    return count(value, word).replace("\u202f", " ")


# ---- runs of moves


def move_summary_rows(spec: ServoSpec, run: MoveRun) -> list[tuple[str, str]]:
    """Name and text of each figure of a run of moves; what a run did not come to is left out.

    Parameters
    ----------
    spec : PhaseServoSpec or FilteredServoSpec
        The axis.
    run : MoveRun
        Done or not.

    Returns
    -------
    list of (str, str)
        Such as ("moves", "10 of 10").
    """
    figures, unit = move_figures(run), count_unit(spec)
    word = "characters" if run.job.kind == "text" else "moves"
    rows = [(word, f"{count(figures.arrived)} of {count(figures.asked)}")]
    if run.moves:
        rows += [
            ("time", duration(figures.seconds) + (f", {number(figures.rate)} {word} per second" if run.done else "")),
            *_settling_rows(figures, run.tolerance),
            *_worst_row("overshoot", figures.overshoot, unit),
            *_worst_row("error at rest", figures.error, unit),
        ]
    if figures.early:
        moves = count(figures.early_moves, "move")
        rows.append(
            ("ready too early", f"{moves}, by up to {_milliseconds(figures.early.value)} {_whose(figures.early)}")
        )
    if figures.peak_speed:
        rows.append(("peak speed", f"{number(figures.peak_speed.value * 1e3)} mm/s {_whose(figures.peak_speed)}"))
    rows.append(("motor", f"peak current {run.peak_current:.2f} A, energy {run.energy:.1f} J"))
    noise = interference_text(run)
    rows += [("interference", noise)] if noise else []
    return [(name, text.replace(GAP, " ")) for name, text in rows]


def _settling_rows(figures: MoveFigures, tolerance: float) -> list[tuple[str, str]]:
    within = f"until within {length(tolerance)} for good"
    rows = [
        ("settling", figures.median_time, figures.worst_time, f"from the command {within}"),
        ("final approach", figures.median_approach, figures.worst_approach, f"from the mode switch {within}"),
    ]
    return [
        (name, f"median {_milliseconds(median)}, worst {_milliseconds(worst.value)} {_whose(worst)}, {span}")
        for name, median, worst, span in rows
        if worst
    ]


def _worst_row(name: str, worst: Worst | None, unit: CountUnit) -> list[tuple[str, str]]:
    if worst is None:
        return []
    return [(name, f"worst {length(worst.value)}, {in_counts(worst.value, unit)} {_whose(worst)}")]


def _whose(worst: Worst) -> str:
    return f"(move {count(worst.move)})"


def _milliseconds(seconds: float) -> str:
    return f"{number(seconds * 1e3)} ms"


def in_counts(value: float, unit: CountUnit) -> str:
    """Write a length in the smallest way that the axis knows."""
    return unit.counts(value)


def interference_text(run: MoveRun) -> str:
    """Say what interference did to the pulse lines.

    Parameters
    ----------
    run : MoveRun
        The run.

    Returns
    -------
    str
        Such as "30 pulses put in, 2 speed samples lost"; empty if it did nothing.
    """
    return ", ".join(count(n, *FAULT_WORDS[kind]) for kind, n in run.faults.items() if n)


def count_unit(spec: ServoSpec) -> CountUnit:
    """The smallest way that an axis knows.

    Parameters
    ----------
    spec : PhaseServoSpec or FilteredServoSpec
        The axis.

    Returns
    -------
    CountUnit
        A step of the phase servo, a pulse of the filtered servo.
    """
    if isinstance(spec, PhaseServoSpec):
        return CountUnit(spec.step, "step")
    return CountUnit(spec.pulse, "pulse")


def arrived(run: MoveRun, move: MoveRecord) -> bool:
    """Whether a move ended within the tolerance, and the axis said so.

    Parameters
    ----------
    run : MoveRun
        The run.
    move : MoveRecord
        One of its moves.

    Returns
    -------
    bool
        True if it did.
    """
    return not math.isnan(move.ready) and abs(move.error) <= run.tolerance


def move_figures(run: MoveRun) -> MoveFigures:
    """Medians and extremes of a run.

    Parameters
    ----------
    run : MoveRun
        Done or not.

    Returns
    -------
    MoveFigures
        Times to settle are those of moves that arrived and were longer than the tolerance.
    """
    there = [move for move in run.moves if arrived(run, move)]
    went = [move for move in there if abs(move.target - move.start) > run.tolerance]
    switched = [move for move in went if not math.isnan(move.switched)]
    late = [move for move in there if move.settled - move.ready > SOONEST]
    return MoveFigures(
        asked=len(run.job.moves),
        arrived=len(there),
        seconds=max(run.time_end - run.time_ready, 0.0) if run.moves else 0.0,
        rate=run.moves_per_second,
        median_time=statistics.median(move.move_time for move in went) if went else math.nan,
        worst_time=_worst(went, lambda move: move.move_time),
        median_approach=statistics.median(_approach(move) for move in switched) if switched else math.nan,
        worst_approach=_worst(switched, _approach),
        overshoot=_worst(run.moves, lambda move: move.overshoot),
        error=_worst(run.moves, lambda move: abs(move.error)),
        peak_speed=_worst(run.moves, lambda move: move.peak_speed),
        early=_worst(late, lambda move: move.settled - move.ready),
        early_moves=len(late),
    )


def _approach(move: MoveRecord) -> float:
    """From the mode switch until within the tolerance for good [s]."""
    return max(move.settled - move.switched, 0.0)


def _worst(moves: list[MoveRecord], figure: Callable[[MoveRecord], float]) -> Worst | None:
    if not moves:
        return None
    found = max(moves, key=figure)
    return Worst(figure(found), found.number)
