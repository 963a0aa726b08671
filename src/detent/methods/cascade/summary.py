"""The figures of a run of a cascade axis that a person wants first, as rows of text for the terminal."""

import math

from detent.methods.cascade.replay import Compared, ReplayRun
from detent.methods.cascade.run import CascadeMove, CascadeRun
from detent.methods.cascade.schema import CascadeSpec
from detent.methods.cascade.units import milliseconds, percent, units_of
from detent.page.run_page import Worst, worst
from detent.page.words import GAP, count, duration, number

WorstMove = Worst[CascadeMove] | None


def cascade_summary(spec: CascadeSpec, run: CascadeRun) -> list[tuple[str, str]]:
    """Name and text of each figure of a run of moves; what a run did not come to is left out."""
    units, moves = units_of(spec), run.moves
    rows = [("moves", f"{count(arrived(run))} of {count(run.job.count)} in position")]
    if moves:
        rows.append(("time", duration(run.seconds)))
    if found := worst_settling(run):
        text = f"worst {milliseconds(found.value)} {_whose(found)}, from the end of the reference until within "
        rows.append(("settling", f"{text}{units.error(run.tolerance)} for good"))
    if found := worst(moves, lambda move: move.peak_following):
        rows.append(("following error", f"worst {units.error(found.value)} {_whose(found)}"))
    if found := worst(moves, lambda move: move.overshoot):
        rows.append(("overshoot", f"worst {units.error(found.value)} {_whose(found)}"))
    if found := worst_rest(run):
        rows.append(("error at rest", f"worst {units.error(found.value)} {_whose(found)}, of the load"))
    if found := worst(moves, lambda move: move.peak_speed):
        rows.append(("peak speed", f"{units.speed_text(found.value)} {_whose(found)}"))
    if found := worst(moves, lambda move: move.peak_command):
        rows.append(("peak command", f"{number(found.value)} of {number(run.max_command)} V {_whose(found)}"))
    return [(name, text.replace(GAP, " ")) for name, text in rows]


def arrived(run: CascadeRun) -> int:
    """Moves that were in position."""
    return sum(move.in_position for move in run.moves)


def worst_settling(run: CascadeRun) -> WorstMove:
    """Longest time from the end of a reference until within the window for good [s]."""
    return worst((move for move in run.moves if not math.isnan(move.settling)), lambda move: move.settling)


def worst_rest(run: CascadeRun) -> WorstMove:
    """Largest error of the load at the end of a move that was in position [m]."""
    return worst((move for move in run.moves if move.in_position), lambda move: abs(move.error))


def _whose(found: Worst[CascadeMove]) -> str:
    return f"(move {count(found.of.number)})"


def replay_summary(spec: CascadeSpec, run: ReplayRun) -> list[tuple[str, str]]:
    """Name and text of each figure of a replay."""
    units = units_of(spec)
    source = f"driven by the recorded {run.open_loop}" if run.open_loop else "along the recorded reference"
    rows = [("recording", f"{duration(run.job.seconds)}, {count(len(run.job.t))} samples, {source}")]
    for one in run.compared:
        rms, peak = units.written(one.rms, one.unit), units.written(one.peak, one.unit)
        rows.append((one.name, f"rms {rms}, largest {peak}, {relative(one)}"))
    if not math.isnan(run.peak_following):
        rows.append(("following error", f"up to {units.error(run.peak_following)}, simulated"))
    return [(name, text.replace(GAP, " ")) for name, text in rows]


def relative(one: Compared) -> str:
    """The relative error of a signal, with what it is relative to."""
    return f"{percent(one.relative)} of the recording"
