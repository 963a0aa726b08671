"""The page about a list of moves on a cascade axis: did it follow, did it arrive, and what it took."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from detent.methods.cascade.panels import POINTS, both_sides, command_panel, error_panel, pair_panel
from detent.methods.cascade.run import CascadeMove, CascadeRun
from detent.methods.cascade.schema import CascadeSpec
from detent.methods.cascade.summary import arrived, worst_rest, worst_settling
from detent.methods.cascade.units import milliseconds, units_of
from detent.page.chart import Curve, Panel, Timeline, time_charts
from detent.page.figure import Figure
from detent.page.frame import Card, Comparison, Headline, Page, Section, card, comparison_section
from detent.page.parts import Event, Numbers
from detent.page.run_page import (
    Stretch,
    happened,
    page_title,
    recorded_whole,
    run_headline,
    stopped_after,
    stretch,
    time_card,
    warnings,
    worst,
)
from detent.page.table import Cell, bar_cell, left_out, long_table, offset_cell
from detent.page.words import count, duration, number
from detent.record.trace import Trace

REFERENCE, REFERENCE_SPEED = "controller.reference.position", "controller.reference.velocity"
LOAD, LOAD_SPEED = "plant.machine.load.position", "plant.machine.load.velocity"
FOLLOWING, COMMAND = "controller.law.position_error", "plant.source.command"
NEEDED = (REFERENCE, REFERENCE_SPEED, LOAD, LOAD_SPEED, FOLLOWING, COMMAND)
"""Signals that the figures over time are drawn from; of a trace without them these figures are left out."""

REST_WINDOWS = 5  # how far from the target the figure of the end of a move begins, in windows
AFTERWARDS = 0.02  # how long after its last event that figure ends [s]


def cascade_page(
    spec: CascadeSpec,
    run: CascadeRun,
    trace: Trace | None,
    comparisons: Sequence[Comparison] = (),
    settings: dict[str, str] | None = None,
) -> Page:
    """The page of a run of moves."""
    job = _job_figure(spec, run, trace)
    return Page(
        title=page_title(spec.axis.name, run),
        headline=_headline(spec, run),
        cards=_cards(spec, run),
        notes=warnings(run.warnings),
        sections=[
            Section("The whole job", [job] if job else []),
            Section("One move in detail", _move_figures(spec, run, trace)),
            comparison_section(comparisons),
            Section("Move by move", [_every_move(spec, run)] if run.moves else []),
        ],
        settings=settings or {},
    )


# ---- what came out, in one glance


def _headline(spec: CascadeSpec, run: CascadeRun) -> Headline:
    error, asked = units_of(spec).error, count(run.job.count, "move")
    if not run.done:
        return run_headline(spec.axis.name, run, stopped_after(arrived(run), asked, run.seconds))
    lead = (
        f"{asked} in {duration(run.seconds)}. "
        f"On the way the axis was never more than {error(run.worst_following)} from where it should be"
    )
    doubt, rest = "", error(run.worst_error)
    if run.worst_error > run.tolerance:
        doubt = "Done, but beside its targets"
        lead += f", but the load stood up to {rest} beside its target while the loop was in position."
    else:
        lead += f"; at the end of each move the load stood within {rest} of its target."
    return run_headline(spec.axis.name, run, lead, doubt=doubt, words=("Every move in position", "Not done"))


def _cards(spec: CascadeSpec, run: CascadeRun) -> list[Card]:
    error = units_of(spec).error
    shown = [
        # A run can also fail in the dwell of a move that was in position.
        Card("Moves in position", count(arrived(run)), f"of {count(run.job.count)}", "", bad=not run.done),
        time_card(run.seconds, "dwells included" if run.done else "until it stopped"),
    ]
    if found := worst_settling(run):
        below = f"after the reference's end, within {error(run.tolerance)}; {_whose(found.of)}"
        shown.append(card("Longest settling", milliseconds(found.value), below))
    if found := worst(run.moves, lambda move: move.peak_following):
        limit = spec.method.following_error
        below = f"{_whose(found.of)}; the drive goes off at {error(limit)}"
        shown.append(card("Largest following error", error(found.value), below, bad=found.value > limit))
    if found := worst_rest(run):
        below = f"of the load, {_whose(found.of)}"
        shown.append(card("Worst error at rest", error(found.value), below, bad=found.value > run.tolerance))
    if found := worst(run.moves, lambda move: move.peak_command):
        limited = sum(move.limited for move in run.moves)
        below = f"of {number(run.max_command)} V, {_whose(found.of)}"
        below += f"; at its limit for {milliseconds(limited)}" if limited else ""
        shown.append(Card("Peak command", number(found.value), "V", below))
    return shown


def _whose(move: CascadeMove) -> str:
    return f"move {count(move.number)}"


# ---- figures over time


def _job_figure(spec: CascadeSpec, run: CascadeRun, trace: Trace | None) -> Figure | None:
    rows = stretch(trace, NEEDED, run.time_ready) if run.moves else None
    if rows is None:
        return None
    position, _, following, command = _panels(spec, run, rows, "job")
    timeline = Timeline(name="job", t=rows.t, label="time since the axis was ready", unit="s")
    return Figure(
        title="Position, following error and command",
        caption=(
            "Above: where the axis should be (dashed) and where the load is. Below: the following error, reference "
            "less what the position loop measures, and the command to the drive. Look for: peaks of the error, and "
            "whether the command comes near its limit."
        ),
        charts=time_charts(timeline, [position, following, command]),
    )


def _panels(spec: CascadeSpec, run: CascadeRun, rows: Stretch, name: str) -> list[Panel]:
    """Position, velocity, following error, command."""
    units = units_of(spec)
    levels = ((spec.method.following_error, "the drive goes off"), (run.tolerance, "in position"))
    places = ("reference", _while_on(run, rows, REFERENCE)), ("load", rows[LOAD])
    speeds = ("reference", _while_on(run, rows, REFERENCE_SPEED)), ("load", rows[LOAD_SPEED])
    following = ("reference less measured position", _while_on(run, rows, FOLLOWING))
    return [
        pair_panel(f"{name}-position", "position", units.place, *places),
        pair_panel(f"{name}-speed", "velocity", units.speed, *speeds),
        error_panel(f"{name}-following", "following error", following, units, levels),
        command_panel(f"{name}-command", rows[COMMAND], run.max_command),
    ]


def _while_on(run: CascadeRun, rows: Stretch, signal: str) -> Numbers:
    """A signal of the loops: a drive that is off knows no reference and no error."""
    return np.where(rows.trace.time[rows.rows] > run.time_off, np.nan, rows[signal])


def _move_figures(spec: CascadeSpec, run: CascadeRun, trace: Trace | None) -> list[Figure]:
    """The most telling of the moves that were recorded: the one that failed, else the fastest."""
    whole = recorded_whole(trace, run.moves) if trace is not None else []
    if not whole:
        return []
    failed = not run.done and whole[-1] is run.moves[-1]
    move = whole[-1] if failed else max(whole, key=lambda one: one.peak_speed)
    rows = stretch(trace, NEEDED, move.begin, run.time_end if failed else move.end)
    if rows is None:
        return []
    events = _events(move, failed=failed)
    caption = f"Shown is {'the move that failed' if failed else 'the fastest move'}."
    if run.done:
        caption += " Look for: how soon the load is at rest once its reference is, and the command where it sets off."
    timeline = Timeline(name="move", t=rows.t, label="time since the move began", events=events)
    charts = time_charts(timeline, _panels(spec, run, rows, "move"))
    shown = Figure(title=f"Move {count(move.number)}", caption=caption, charts=charts, events=events)
    rest = None if math.isnan(move.arrived) else _rest_figure(spec, run, move, rows, events)
    return [shown, rest] if rest else [shown]


def _events(move: CascadeMove, *, failed: bool) -> list[Event]:
    """What happens in a move, on a clock that starts with it."""
    texts = {
        "the reference sets off": move.begin,
        "the reference has come to the target": move.arrived,
        "the load is within the window for good": move.settled,
        "in position: the loop's error was within the window for its time": move.ready,
        "the drive goes off": move.end if failed else math.nan,
    }
    return happened({text: moment - move.begin for text, moment in texts.items()}, move.end - move.begin)


def _rest_figure(
    spec: CascadeSpec, run: CascadeRun, move: CascadeMove, rows: Stretch, events: list[Event]
) -> Figure | None:
    """The load coming to rest, from a few windows away until it is quiet."""
    units, window = units_of(spec), run.tolerance
    far = np.flatnonzero(np.abs(rows[LOAD] - move.target) > REST_WINDOWS * window)
    begin = min(float(rows.t[far[-1]]) if far.size else 0.0, move.arrived - move.begin)
    marks = [moment for moment in (move.arrived, move.settled, move.ready) if not math.isnan(moment)]
    near = rows.between(begin, max(marks) - move.begin + AFTERWARDS)
    if len(near) < 3:
        return None
    seen = [event for event in events if begin <= event.t <= near.t[-1]]
    off = near[LOAD] - move.target
    scale = units.small(min(float(np.abs(off).max()), 20 * window))
    reach = REST_WINDOWS * window * scale.factor
    asked = (_while_on(run, near, REFERENCE) - move.target) * scale.factor
    panel = Panel(
        name="move-rest",
        label=f"position less target [{scale.name}]",
        zero=True,
        span=(-reach, reach),
        curves=[
            Curve(label="load", colour="speed", width=2.5, y=off * scale.factor, thin=POINTS),
            Curve(label="reference", colour="left", dash=(5, 4), y=asked, thin=POINTS),
        ],
        levels=both_sides(window * scale.factor, "in position"),
    )
    caption = (
        "The end of the same move, magnified: how far the load is from the target. Between the dashed lines, "
        f"±{units.error(window)}, it counts as in position."
    )
    timeline = Timeline(name="rest", t=near.t, label="time since the move began", events=seen)
    return Figure(title="Coming to rest", caption=caption, charts=time_charts(timeline, [panel]), events=seen)


# ---- table


def _every_move(spec: CascadeSpec, run: CascadeRun) -> Figure:
    units, place = units_of(spec), units_of(spec).place.name
    off, lag = units.small(max(run.worst_error, run.worst_overshoot)), units.small(run.worst_following)

    def following(move: CascadeMove) -> Cell:
        beyond = move.peak_following > spec.method.following_error
        return bar_cell(move.peak_following * lag.factor, run.worst_following * lag.factor or 1.0, over=beyond)

    def error(move: CascadeMove) -> Cell:
        # A move that failed may have stopped anywhere; its bar is a full one, no longer.
        furthest = max(run.worst_error, abs(move.error)) * off.factor or 1.0
        return offset_cell(move.error * off.factor, furthest, over=abs(move.error) > run.tolerance)

    columns: dict[str, Callable[[CascadeMove], str | Cell]] = {
        "move": lambda move: count(move.number),
        "begin [s]": lambda move: f"{move.begin - run.time_ready:.3f}",
        f"from [{place}]": lambda move: units.position(move.start),
        f"to [{place}]": lambda move: units.position(move.target),
        "reference [ms]": lambda move: number(round((move.arrived - move.begin) * 1e3, 6)),
        "settles after [ms]": lambda move: number(round(move.settling * 1e3, 6)),
        f"following error [{lag.name}]": following,
        f"overshoot [{off.name}]": lambda move: number(move.overshoot * off.factor, 2),
        f"error [{off.name}]": error,
        "peak command [V]": lambda move: number(move.peak_command),
        "in position": lambda move: "✔" if move.in_position else Cell(text="✘ no", over=True),
    }
    heads = [(name, name != "in position") for name in columns]
    rows = [[cell(move) for cell in columns.values()] for move in run.moves]
    caption = (
        "The reference takes its time; then the load settles within the window. Following error is the largest of the "
        "move; error is target less position of the load at the end of the move."
    )
    return Figure(title="Every move", caption=caption + left_out(len(rows), "move"), table=long_table(heads, rows))
