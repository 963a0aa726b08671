"""The page about a list of moves on a cascade axis: did it follow, did it arrive, and what it took."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from operator import attrgetter

import numpy as np

from detent.methods.cascade.run import CascadeMove, CascadeRun
from detent.methods.cascade.schema import CascadeSpec
from detent.methods.cascade.units import milliseconds, units_of
from detent.page.chart import Curve, Panel, Timeline, time_charts
from detent.page.figure import Figure
from detent.page.frame import Card, Comparison, Headline, Page, Section, card, comparison_section
from detent.page.parts import Event, Numbers
from detent.page.run_page import (
    Stretch,
    Worst,
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
from detent.page.units import Scale, Units
from detent.page.words import GAP, count, duration, number
from detent.record.trace import Trace

REFERENCE, REFERENCE_SPEED = "controller.reference.position", "controller.reference.velocity"
LOAD, LOAD_SPEED = "plant.machine.load.position", "plant.machine.load.velocity"
FOLLOWING, COMMAND = "controller.law.position_error", "plant.source.command"
NEEDED = (REFERENCE, REFERENCE_SPEED, LOAD, LOAD_SPEED, FOLLOWING, COMMAND)
"""Signals that the figures over time are drawn from; of a trace without them these figures are left out."""

REST_WINDOWS = 5  # how far from the target the figure of the end of a move begins, in windows
AFTERWARDS = 0.02  # how long after its last event that figure ends [s]

POINTS = 1500  # rows that are chosen for one curve's sake: plot areas stand above one another
WINDOW_SHARE = 0.02  # windows and limits narrower than this share of the curves would only blacken the line at zero

Named = tuple[str, Numbers]  # name of a curve, and its values in SI units


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
            Section("Moves", [_every_move(spec, run)] if run.moves else []),
        ],
        settings=settings or {},
    )


# ---- results, in one glance


def cascade_summary(spec: CascadeSpec, run: CascadeRun) -> list[tuple[str, str]]:
    """Name and text of each figure of a run of moves; what a run did not come to is left out."""
    units, found = units_of(spec), _worst_figures(run)
    within = f"until within {units.error(run.tolerance)} for good"
    figures: dict[str, tuple[str, Callable[[float], str], str]] = {
        "settling": ("settling", milliseconds, f"worst {{}}, from the command {within}"),
        "approach": ("final approach", milliseconds, f"worst {{}}, from the end of the reference {within}"),
        "peak_following": ("following error", units.error, "worst {}"),
        "overshoot": ("overshoot", units.error, "worst {}"),
        "rest": ("error at rest", units.error, "worst {}, of the load"),
        "peak_speed": ("peak speed", units.speed_text, "{}"),
        "peak_command": ("peak command", lambda value: f"{number(value)} of {number(run.max_command)} V", "{}"),
    }
    rows = [("moves", f"{count(arrived(run))} of {count(run.job.count)} in position")]
    rows += [("time", duration(run.seconds))] if run.moves else []
    for key, (name, written, text) in figures.items():
        if one := found.get(key):
            rows.append((name, text.format(f"{written(one.value)} ({_whose(one.of)})")))
    return [(name, text.replace(GAP, " ")) for name, text in rows]


def arrived(run: CascadeRun) -> int:
    """Moves that were in position."""
    return sum(move.in_position for move in run.moves)


def _worst_figures(run: CascadeRun) -> dict[str, Worst[CascadeMove]]:
    """The largest of each figure of the moves, with whose it is; what no move has is left out."""
    settled = [move for move in run.moves if not math.isnan(move.settled) and move.in_position]
    resting = [move for move in run.moves if move.in_position]
    found = {
        "settling": worst(settled, attrgetter("settling")),
        "approach": worst(settled, attrgetter("approach")),
        "rest": worst(resting, lambda move: abs(move.error)),
    }
    for name in ("peak_following", "overshoot", "peak_speed", "peak_command"):
        found[name] = worst(run.moves, attrgetter(name))
    return {name: one for name, one in found.items() if one}


def _whose(move: CascadeMove) -> str:
    return f"move {count(move.number)}"


def _headline(spec: CascadeSpec, run: CascadeRun) -> Headline:
    error, asked = units_of(spec).error, count(run.job.count, "move")
    if not run.done:
        return run_headline(spec.axis.name, run, stopped_after(run, arrived(run), asked, began=bool(run.moves)))
    lead = f"{asked} in {duration(run.seconds)}. The following error never exceeded {error(run.worst_following)}"
    doubt, rest = "", error(run.worst_error)
    if run.worst_error > run.tolerance:
        doubt, lead = "Done, but off target", f"{lead}."
    else:
        lead += f"; at the end of each move the load was within {rest} of its target."
    return run_headline(spec.axis.name, run, lead, doubt=doubt, words=("Every move in position", "Not done"))


def _cards(spec: CascadeSpec, run: CascadeRun) -> list[Card]:
    error = units_of(spec).error
    shown = [
        # A run can also fail in the dwell of a move that was in position.
        Card("Moves in position", count(arrived(run)), f"of {count(run.job.count)}", "", bad=not run.done),
        time_card(run.seconds, "dwells included" if run.done else "until it stopped"),
    ]
    found, limit = _worst_figures(run), spec.method.following_error
    if one := found.get("approach"):
        below = f"after the reference's end, within {error(run.tolerance)}; {_whose(one.of)}"
        shown.append(card("Longest final approach", milliseconds(one.value), below))
    if one := found.get("peak_following"):
        below = f"{_whose(one.of)}; the drive trips at {error(limit)}"
        shown.append(card("Largest following error", error(one.value), below, bad=one.value > limit))
    if one := found.get("rest"):
        below = f"of the load, {_whose(one.of)}"
        shown.append(card("Worst error at rest", error(one.value), below, bad=one.value > run.tolerance))
    if one := found.get("peak_command"):
        limited = sum(move.limited for move in run.moves)
        below = f"of {number(run.max_command)} V, {_whose(one.of)}"
        below += f"; at its limit for {milliseconds(limited)}" if limited else ""
        shown.append(Card("Peak command", number(one.value), "V", below))
    return shown


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
            "Top: reference position (dashed) and load position. Below: the following error (reference minus measured "
            "position) and the command to the drive. Check: peaks of the error, and whether the command comes "
            "near its limit."
        ),
        charts=time_charts(timeline, [position, following, command]),
    )


def _panels(spec: CascadeSpec, run: CascadeRun, rows: Stretch, name: str) -> list[Panel]:
    """Position, velocity, following error, command."""
    units = units_of(spec)
    levels = ((spec.method.following_error, "the drive trips"), (run.tolerance, "in position"))
    places = ("reference", _while_on(run, rows, REFERENCE)), ("load", rows[LOAD])
    speeds = ("reference", _while_on(run, rows, REFERENCE_SPEED)), ("load", rows[LOAD_SPEED])
    following = ("reference minus measured position", _while_on(run, rows, FOLLOWING))
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
    moments = {
        "the reference starts": move.begin,
        "the reference reaches the target": move.arrived,
        "the load is within the window for good": move.settled,
        "in position: the loop's error was within the window for its time": move.ready,
        "the drive trips": move.end if failed else math.nan,
    }
    events = happened({text: moment - move.begin for text, moment in moments.items()}, move.end - move.begin)
    caption = f"Shown is {'the move that failed' if failed else 'the fastest move'}."
    if run.done:
        caption += " Check how soon the load settles after its reference, and the command at the start of the move."
    timeline = Timeline(name="move", t=rows.t, label="time since the move began", events=events)
    charts = time_charts(timeline, _panels(spec, run, rows, "move"))
    shown = Figure(title=f"Move {count(move.number)}", caption=caption, charts=charts, events=events)
    return [shown] if math.isnan(move.arrived) else [shown, *_rest_figure(spec, run, move, rows, events)]


def _rest_figure(
    spec: CascadeSpec, run: CascadeRun, move: CascadeMove, rows: Stretch, events: list[Event]
) -> list[Figure]:
    """The load coming to rest, from a few windows away until it is quiet."""
    units, window = units_of(spec), run.tolerance
    far = np.flatnonzero(np.abs(rows[LOAD] - move.target) > REST_WINDOWS * window)
    begin = min(float(rows.t[far[-1]]) if far.size else 0.0, move.arrived - move.begin)
    marks = [moment for moment in (move.arrived, move.settled, move.ready) if not math.isnan(moment)]
    near = rows.between(begin, max(marks) - move.begin + AFTERWARDS)
    if len(near) < 3:
        return []
    seen = [event for event in events if begin <= event.t <= near.t[-1]]
    off = near[LOAD] - move.target
    scale = units.small(min(float(np.abs(off).max()), 20 * window))
    reach = REST_WINDOWS * window * scale.factor
    asked, did = ("reference", _while_on(run, near, REFERENCE) - move.target), ("load", off)
    panel = pair_panel("move-rest", "position minus target", scale, asked, did)
    panel = replace(panel, span=(-reach, reach), levels=both_sides(window * scale.factor, "in position"))
    caption = (
        "The end of the same move, magnified: distance of the load from the target. Between the dashed lines, "
        f"±{units.error(window)}, it counts as in position."
    )
    timeline = Timeline(name="rest", t=near.t, label="time since the move began", events=seen)
    return [Figure(title="Settling", caption=caption, charts=time_charts(timeline, [panel]), events=seen)]


# ---- plot areas


def pair_panel(name: str, label: str, scale: Scale, asked: Named, did: Named) -> Panel:
    """What was asked or measured, dashed over what the axis did."""
    curves = [
        Curve(label=did[0], colour="speed", width=2.5, y=did[1] * scale.factor, thin=POINTS),
        Curve(label=asked[0], colour="left", width=1.5, dash=(5, 4), y=asked[1] * scale.factor, thin=POINTS),
    ]
    return Panel(name=name, label=f"{label} [{scale.name}]", zero=True, curves=curves)


def error_panel(name: str, label: str, error: Named, units: Units, levels: tuple[tuple[float, str], ...] = ()) -> Panel:
    """An error [m or rad] in a unit that suits it, with levels on both sides that are of its size."""
    text, values = error
    peak = float(np.nanmax(np.abs(values), initial=0.0))
    scale = units.small(peak)
    shown = [(value, word) for value, word in levels if WINDOW_SHARE * peak < value < 2 * peak]
    marks = [mark for value, word in shown for mark in both_sides(value * scale.factor, word)]
    curve = Curve(label=text, colour="current", y=values * scale.factor, width=1.5, thin=POINTS)
    return Panel(name=name, label=f"{label} [{scale.name}]", height=170, zero=True, curves=[curve], levels=marks)


def command_panel(name: str, command: Numbers, limit: float) -> Panel:
    """The command [V] with its limit, where it comes near it."""
    near = float(np.abs(command).max(initial=0.0)) > 0.5 * limit
    levels, span = (both_sides(limit, "limit"), (-1.5 * limit, 1.5 * limit)) if near else ([], None)
    curve = Curve(label="command", colour="drive", step=True, y=command, thin=POINTS)
    return Panel(name=name, label="command [V]", height=150, zero=True, curves=[curve], levels=levels, span=span)


def both_sides(value: float, word: str) -> list[tuple[float, str]]:
    """Levels at a magnitude, the upper one named."""
    return [(value, word), (-value, "")]


# ---- table


def _every_move(spec: CascadeSpec, run: CascadeRun) -> Figure:
    units, place = units_of(spec), units_of(spec).place.name
    # A move that failed may have stopped anywhere: its error too has to be read in the unit of the column.
    furthest = max((abs(move.error) for move in run.moves), default=0.0)
    off, lag = units.small(max(furthest, run.worst_overshoot)), units.small(run.worst_following)

    def following(move: CascadeMove) -> Cell:
        beyond = move.peak_following > spec.method.following_error
        return bar_cell(move.peak_following * lag.factor, run.worst_following * lag.factor or 1.0, over=beyond)

    def error(move: CascadeMove) -> Cell:
        longest = run.worst_error * off.factor or furthest * off.factor or 1.0
        return offset_cell(move.error * off.factor, longest, over=abs(move.error) > run.tolerance)

    columns: dict[str, Callable[[CascadeMove], str | Cell]] = {
        "move": lambda move: count(move.number),
        "start [s]": lambda move: f"{move.begin - run.time_ready:.3f}",
        f"from [{place}]": lambda move: units.position(move.start),
        f"to [{place}]": lambda move: units.position(move.target),
        "reference [ms]": lambda move: number(round((move.arrived - move.begin) * 1e3, 6)),
        "settled after [ms]": lambda move: number(round(move.settling * 1e3, 6)),
        "final approach [ms]": lambda move: number(round(move.approach * 1e3, 6)),
        f"following error [{lag.name}]": following,
        f"overshoot [{off.name}]": lambda move: number(move.overshoot * off.factor, 2),
        f"error [{off.name}]": error,
        "peak command [V]": lambda move: number(move.peak_command),
        "in position": lambda move: "✔" if move.in_position else Cell(text="✘ no", over=True),
    }
    heads = [(name, name != "in position") for name in columns]
    rows = [[cell(move) for cell in columns.values()] for move in run.moves]
    caption = (
        "Settling time counts from the command; the final approach starts when the reference ends. Following error is "
        "the largest of the move; error is target minus load position at the end of the move."
    )
    return Figure(title="Every move", caption=caption + left_out(len(rows), "move"), table=long_table(heads, rows))
