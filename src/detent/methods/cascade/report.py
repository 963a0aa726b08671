"""From a run of a cascade axis and its trace to what its report shows, and the figures for the terminal."""

import math
from collections.abc import Callable

import numpy as np

from detent.methods.cascade.comparison import ProfileComparison
from detent.methods.cascade.page_data import CascadeDetail, CascadePath, CascadeReportData, ReplayReportData
from detent.methods.cascade.replay import Compared, ReplayRun
from detent.methods.cascade.run import CascadeMove, CascadeRun
from detent.methods.cascade.schema import CascadeSpec
from detent.methods.cascade.units import Units, percent
from detent.page.parts import Event, Note
from detent.page.words import GAP, count, duration, number
from detent.record.trace import Trace

FEWEST_ROWS = 10
"""Rows of a trace without which nothing is drawn."""

REST_WINDOWS = 5
"""How far from the target the figure of the end of a move begins, in windows."""

NEEDED = {
    "reference": "reference.position",
    "load": "machine.load.position",
    "motor": "machine.motor.position",
    "velocity_ref": "reference.velocity",
    "velocity": "machine.load.velocity",
    "following": "law.position_error",
    "command": "source.command",
}
"""Signals that the figures over time are drawn from; a trace without them gives a report without these."""


def units_of(spec: CascadeSpec) -> Units:
    """Units of an axis."""
    return Units(rotary=spec.axis.motion == "rotary")


# ---- runs of moves


def cascade_summary_rows(spec: CascadeSpec, run: CascadeRun) -> list[tuple[str, str]]:
    """Name and text of each figure of a run of moves; what a run did not come to is left out."""
    units = units_of(spec)
    arrived = sum(move.in_position for move in run.moves)
    rows = [("moves", f"{count(arrived)} of {count(run.job.count)} in position")]
    if run.moves:
        rows.append(("time", duration(max(run.time_end - run.time_ready, 0.0))))
        settled = [move for move in run.moves if not math.isnan(move.settling)]
        if settled:
            worst = _worst(settled, lambda move: move.settling)
            window = units.error(run.tolerance)
            text = f"worst {milliseconds(worst.settling)} {whose(worst)}, from the end of the reference until within "
            rows.append(("settling", f"{text}{window} for good"))
        for name, key in (("following error", "peak_following"), ("overshoot", "overshoot")):
            worst = _worst(run.moves, lambda move, key=key: getattr(move, key))
            rows.append((name, f"worst {units.error(getattr(worst, key))} {whose(worst)}"))
        rested = [move for move in run.moves if move.in_position]
        if rested:
            worst = _worst(rested, lambda move: abs(move.error))
            rows.append(("error at rest", f"worst {units.error(abs(worst.error))} {whose(worst)}, of the load"))
        worst = _worst(run.moves, lambda move: move.peak_speed)
        rows.append(("peak speed", f"{units.speed_text(worst.peak_speed)} {whose(worst)}"))
        worst = _worst(run.moves, lambda move: move.peak_command)
        limit = f" of {number(run.max_command)} V"
        rows.append(("peak command", f"{number(worst.peak_command)}{limit} {whose(worst)}"))
    return [(name, text.replace(GAP, " ")) for name, text in rows]


def whose(move: CascadeMove) -> str:
    """Which move a figure is of."""
    return f"(move {count(move.number)})"


def milliseconds(seconds: float) -> str:
    """Write a time in milliseconds."""
    return f"{number(round(seconds * 1e3, 6))}{GAP}ms"


def _worst(moves: list[CascadeMove], figure: Callable[[CascadeMove], float]) -> CascadeMove:
    return max(moves, key=figure)


def cascade_report(
    spec: CascadeSpec,
    run: CascadeRun,
    trace: Trace | None,
    *,
    comparison: ProfileComparison | None = None,
    settings: dict[str, str] | None = None,
) -> CascadeReportData:
    """Everything the report of a run of moves shows."""
    usable = trace if trace is not None and len(trace) > 1 and all(n in trace for n in NEEDED.values()) else None
    return CascadeReportData(
        axis_name=spec.axis.name,
        units=units_of(spec),
        run=run,
        following_limit=spec.method.following_error,
        path=_path(run, usable, run.time_ready, math.inf) if usable and run.moves else None,
        detail=_detail(run, usable) if usable else None,
        comparison=comparison,
        notes=[Note("warning", text) for text in run.warnings],
        settings=settings or {},
    )


def _path(run: CascadeRun, trace: Trace, begin: float, end: float) -> CascadePath | None:
    """Signals of a stretch; time since its begin. A drive that is off knows no reference and no error."""
    part = trace.between(begin, end)
    if len(part) < FEWEST_ROWS:
        return None
    found = {name: np.asarray(part[signal], np.float64) for name, signal in NEEDED.items()}
    off = part.time > (math.inf if math.isnan(run.time_off) else run.time_off)
    for name in ("reference", "velocity_ref", "following"):
        found[name] = np.where(off, np.nan, found[name])
    return CascadePath(t=part.time - begin, **found)


def _detail(run: CascadeRun, trace: Trace) -> CascadeDetail | None:
    """The most telling of the moves that were recorded: the one that failed, else the fastest."""
    row = float(trace.time[1] - trace.time[0])
    whole = [m for m in run.moves if m.end <= trace.time[-1] + row and m.end - m.begin > FEWEST_ROWS * row]
    if not whole:
        return None
    failed = not run.done and whole[-1] is run.moves[-1]
    move = whole[-1] if failed else max(whole, key=lambda one: one.peak_speed)
    path = _path(run, trace, move.begin, run.time_end if failed else move.end)
    if path is None:
        return None
    return CascadeDetail(
        number=move.number,
        why="the move that failed" if failed else "the fastest move",
        target=move.target,
        path=path,
        events=_events(move, failed=failed),
        rest=None if math.isnan(move.arrived) else _rest(run, move, path),
    )


def _events(move: CascadeMove, *, failed: bool) -> list[Event]:
    """What happens in a move, in order of time."""
    texts = {
        "the reference sets off": move.begin,
        "the reference has come to the target": move.arrived,
        "the load is within the window for good": move.settled,
        "in position: the loop's error was within the window for its time": move.ready,
        "the drive goes off": move.end if failed else math.nan,
    }
    found = [Event(moment - move.begin, text) for text, moment in texts.items() if not math.isnan(moment)]
    return sorted(found, key=lambda event: event.t)


def _rest(run: CascadeRun, move: CascadeMove, path: CascadePath) -> tuple[float, float]:
    """Stretch that shows the load come to rest [s]: from a few windows away until it is quiet."""
    far = np.flatnonzero(np.abs(path.load - move.target) > REST_WINDOWS * run.tolerance)
    begin = float(path.t[far[-1]]) if far.size else 0.0
    marks = [moment - move.begin for moment in (move.arrived, move.settled, move.ready) if not math.isnan(moment)]
    end = max(marks) + 0.02
    return min(begin, move.arrived - move.begin), min(end, float(path.t[-1]))


# ---- replayed recordings


def replay_summary_rows(spec: CascadeSpec, run: ReplayRun) -> list[tuple[str, str]]:
    """Name and text of each figure of a replay."""
    units = units_of(spec)
    source = f"driven by the recorded {run.open_loop}" if run.open_loop else "along the recorded reference"
    rows = [("recording", f"{duration(run.job.seconds)}, {count(len(run.job.t))} samples, {source}")]
    rows += [
        (one.name, f"rms {figure(one, one.rms, units)}, largest {figure(one, one.peak, units)}, {relative(one)}")
        for one in run.compared
    ]
    if not math.isnan(run.peak_following):
        rows.append(("following error", f"up to {units.error(run.peak_following)}, simulated"))
    return [(name, text.replace(GAP, " ")) for name, text in rows]


def relative(one: Compared) -> str:
    """The relative error of a signal, with what it is relative to."""
    return f"{percent(one.relative)} of the recording"


def figure(one: Compared, value: float, units: Units) -> str:
    """Write a difference of a signal with its unit."""
    if one.unit in {"m", "rad"}:
        return units.error(value)
    if one.unit in {"m/s", "rad/s"}:
        return units.speed_text(value)
    if one.unit == "rad/s^2":
        return f"{number(np.degrees(value))}{GAP}deg/s²"
    return f"{number(value)}{GAP}{one.unit.replace('^2', '²').replace('*', ' ')}"


def replay_report(spec: CascadeSpec, run: ReplayRun, *, settings: dict[str, str] | None = None) -> ReplayReportData:
    """Everything the report of a replay shows."""
    notes = [Note("warning", text) for text in run.warnings] + [Note("note", text) for text in run.job.notes]
    return ReplayReportData(
        axis_name=spec.axis.name, units=units_of(spec), run=run, notes=notes, settings=settings or {}
    )
