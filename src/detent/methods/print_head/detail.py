"""How a print head did it: the drive of one line, a turn-around, and what the axis found out about itself."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
from markupsafe import Markup

from detent.control.head_computer import (
    HIGH_ACCEL,
    HIGH_REVERSE,
    HIGH_STEADY,
    HIGH_TRANSITION,
    IDLE,
    LOW_START,
    LOW_STEADY,
    LOW_STOP,
)
from detent.files.quantities import INCH
from detent.methods.print_head.run import Direction, LineRecord, PrintRun
from detent.methods.print_head.schema import FULL_DRIVE_COUNTS, SPEED_STEP
from detent.page.chart import POINTS, Band, Chart, Curve, Panel, Timeline, line_chart, spans_of, time_charts
from detent.page.figure import Figure
from detent.page.parts import Event
from detent.page.run_page import Stretch, has, recorded_whole, stretch
from detent.page.table import Cell, Table
from detent.page.words import GAP, number
from detent.record.trace import Trace

SIGNALS = (
    "plant.train.position", "plant.train.velocity", "plant.train.current", "controller.head.state",
    "controller.head.drive_cmd", "lines.transition", "controller.head.speed", "controller.head.direction",
    "controller.head.columns.fired",
)  # fmt: skip
"""What the figures over time are drawn from."""

STATE_EVENTS = {
    (HIGH_ACCEL, HIGH_STEADY): "top of the ramp: IR part removed, trim on",
    (HIGH_STEADY, HIGH_TRANSITION): "stop begins: IR part subtracted, TR on",
    (HIGH_STEADY, HIGH_REVERSE): "stop begins: drive against the motion",
    (HIGH_TRANSITION, HIGH_REVERSE): "drive value passes zero: TR off, line toggled",
    (HIGH_REVERSE, HIGH_ACCEL): "zero speed: turn-around, drive jumps by both frictions",
    (HIGH_TRANSITION, HIGH_ACCEL): "zero speed: turn-around, drive jumps by both frictions",
    (HIGH_REVERSE, IDLE): "zero speed: drive off",
    (LOW_START, LOW_STEADY): "low-speed start over, trim on",
    (LOW_STEADY, LOW_STOP): "stop begins: drive reversed",
    (LOW_STOP, IDLE): "zero speed: drive off",
}

BEFORE_STOP, AFTER_RAMP = 10e-3, 20e-3  # shown of the steady speeds on both sides of a turn-around [s]
LAST = 1.0  # shown of the end of a run that failed, at most [s]
TOP_SPEED = 240  # end of the axis of speed, 40 in/s [1/6 in/s]

IN_THE_LINE = (
    "Top: speed. Bottom: drive value of the axis computer; 300 counts are the full supply. The drive is a sum: "
    "friction + back-EMF (grows with speed) + a fixed IR part, added while accelerating, subtracted while "
    "braking. Check: speed on the dashed line, constant while printing."
)

IN_THE_END = (
    "The last second, or less where a line was printed before. Above: the speed. Below: the drive value the axis "
    "computer sent, 300 counts being the full supply. Look for: a drive that moves nothing, or a speed that it did not "
    "make."
)

IN_THE_TURN = (
    "The motor current while the head reverses. It is not measured: the drive ramp alone keeps it constant. Check: two "
    "constant levels - braking, then accelerating, where friction adds to the load - and no step where the "
    "transition ends."
)


def how_figures(run: PrintRun, trace: Trace | None) -> list[Figure]:
    """Those over time for which enough was recorded, and what was identified."""
    shown = [_identified_figure(run), _constants_figure(run)]
    if trace is not None and has(trace, SIGNALS):
        lines = recorded_whole(trace, run.lines)
        shown = [_end_figure(run, trace), _line_figure(lines, trace), _turn_figure(lines, trace), *shown]
    return [figure for figure in shown if figure]


# ---- over time


def _end_figure(run: PrintRun, trace: Trace) -> Figure | None:
    """The last of a run that failed, after the last line that was printed."""
    begin = max(run.lines[-1].stop if run.lines else 0.0, run.time_end - LAST)
    rows = None if run.done else stretch(trace, SIGNALS, begin, run.time_end)
    if rows is None:
        return None
    events = [*_events(rows), Event(float(rows.t[-1]), "the run ends here")]
    label = f"time from {begin:.3f} s after power-on on"
    charts = _profile(rows, Timeline(name="end", t=rows.t, label=label, bands=[_transition(rows)], events=events))
    return Figure(title="How the run ended: speed and drive", caption=IN_THE_END, charts=charts, events=events)


def _profile(rows: Stretch, timeline: Timeline, *more: Curve) -> list[Chart]:
    """Speed, with more curves beside it, above the drive value."""
    value = rows["controller.head.drive_cmd"]
    drive = Curve(label="drive value", colour="drive", width=2, step=True, y=value, digits=1)
    return time_charts(timeline, [
        Panel(
            name=f"{timeline.name}-speed", label="speed [in/s]", zero=True, curves=[*more, _true_speed(rows, POINTS)]
        ),
        Panel(name=f"{timeline.name}-drive", label="drive [count]", zero=True, curves=[drive]),
    ])  # fmt: skip


def _line_figure(lines: list[LineRecord], trace: Trace) -> Figure | None:
    """The line with the most columns among the fastest."""
    if not lines:
        return None
    line = max(lines, key=lambda line: (line.speed_value, line.columns))
    # One row more: the end of the move shows in the first row after it.
    rows = stretch(trace, SIGNALS, line.start, line.stop + float(trace.time[1] - trace.time[0]))
    if rows is None:
        return None
    # After the stop the computer already demands the speed of the next line.
    moving = np.isin(rows["controller.head.state"], (HIGH_ACCEL, HIGH_STEADY, LOW_START, LOW_STEADY))
    speed = rows["controller.head.speed"] * rows["controller.head.direction"] * (SPEED_STEP / INCH)
    demand = np.where(moving & (rows.t <= line.stop - line.start), speed, np.nan)
    demanded = Curve(label="demanded", colour="muted", dash=(6, 4), y=demand, thin=0)
    fired = np.flatnonzero(np.diff(rows["controller.head.columns.fired"]))
    spans = [(float(rows.t[fired[0]]), float(rows.t[fired[-1] + 1]))] if fired.size else []
    bands, events = [Band(label="printing", colour="good", spans=spans), _transition(rows)], _events(rows)
    timeline = Timeline(name="profile", t=rows.t, label="time since the move began", bands=bands, events=events)
    charts = _profile(rows, timeline, demanded)
    title = f"Line {line.number}, printed to the {'right' if line.direction > 0 else 'left'}: speed and drive"
    return Figure(title=title, caption=IN_THE_LINE, charts=charts, events=events)


def _turn_figure(lines: list[LineRecord], trace: Trace) -> Figure | None:
    """The turn-around at the highest speed, from the stop of a line to the steady speed of the next."""
    pairs = [(before, after) for before, after in pairwise(lines) if after.turn_around]
    if not pairs:
        return None
    before, after = max(pairs, key=lambda pair: pair[1].speed_value)
    both = stretch(trace, SIGNALS, before.start, after.stop)
    rows = _turn(before, both) if both else None
    if rows is None:
        return None
    current = Curve(label="motor current", colour="current", y=rows["plant.train.current"], digits=4)
    bands, events = [_transition(rows)], _events(rows)
    timeline = Timeline(name="turn", t=rows.t, label="time since the stop began", bands=bands, events=events)
    charts = time_charts(timeline, [
        Panel(name="turn-current", label="current [A]", zero=True, curves=[current]),
        Panel(name="turn-speed", label="speed [in/s]", zero=True, curves=[_true_speed(rows, POINTS // 4)], height=160),
    ])  # fmt: skip
    title = f"Turn-around from line {before.number} to line {after.number}: motor current"
    return Figure(title=title, caption=IN_THE_TURN, charts=charts, events=events)


def _turn(before: LineRecord, rows: Stretch) -> Stretch | None:
    """Rows of a turn-around after a line, on a clock that starts when the stop begins."""
    was, becomes, t = rows["controller.head.state"][:-1], rows["controller.head.state"][1:], rows.t[1:]
    zero_speed = before.stop - before.start
    stops = t[(was == HIGH_STEADY) & (becomes != HIGH_STEADY) & (t < zero_speed)]
    ramps = t[(was == HIGH_ACCEL) & (becomes == HIGH_STEADY) & (t > zero_speed)]
    if not stops.size or not ramps.size:
        return None
    begin = float(stops[-1])
    part = rows.between(begin - BEFORE_STOP, float(ramps[0]) + AFTER_RAMP)
    return replace(part, t=part.t - begin)


def _true_speed(rows: Stretch, thin: int) -> Curve:
    return Curve(label="true speed", colour="speed", width=2, y=rows["plant.train.velocity"] / INCH, thin=thin)


def _transition(rows: Stretch) -> Band:
    spans = spans_of(rows.t, rows["lines.transition"] != 0)
    return Band(label="transition (TR)", colour="brake", spans=spans)


def _events(rows: Stretch) -> list[Event]:
    """Changes of the computer's state, each with the drive value right after it."""
    state, drive = rows["controller.head.state"], rows["controller.head.drive_cmd"]
    changes = ((k, (int(state[k - 1]), int(state[k]))) for k in (np.flatnonzero(np.diff(state)) + 1).tolist())
    return [Event(float(rows.t[k]), STATE_EVENTS[c], int(drive[k])) for k, c in changes if c in STATE_EVENTS]


# ---- what the axis knows of itself


def _measured(found: Direction) -> dict[int, int]:
    """Drive [count] by the speed value that it gave, of the two passes of the identification; empty without."""
    if found.speed_fast <= 0 or found.speed_slow <= 0:
        return {}
    return {found.speed_fast: found.drive_fast, found.speed_slow: found.drive_slow}


def _identified_figure(run: PrintRun) -> Figure | None:
    if not run.identified:
        return None
    known = (
        "At power-up the axis ran at two drive values and measured the speeds (circles); the line through them gives "
        "the drive for every other speed."
    )
    if not all(found.valid for found in run.identified.values()):
        sides = [side for side, found in run.identified.items() if not found.valid]
        end = "the axis works with its defaults" if run.lines else "the run ended before, with the defaults in force"
        known = f"Not identified, {' and '.join(sides)}: {end}."
    caption = (
        f"The drive value that sustains a speed. {known} Its value at zero speed is the drive that overcomes friction. "
        "Check: the line coincides with the dashed true line."
    )
    charts = [identified_chart(side, found) for side, found in run.identified.items()]
    return Figure(title="Identified constants", caption=caption, charts=charts, beside=True)


def identified_chart(side: str, found: Direction) -> Chart:
    """Drive value against speed in one direction: default, identified line, truth, and what was measured."""
    points = _measured(found)
    speeds = np.array(sorted({0, TOP_SPEED, *points}), dtype=float)

    lines: list[tuple[str, str, tuple[int, int] | None, float, float]] = [
        ("power-on default", "muted", (2, 4), found.default_slope, found.default_friction),
        ("identified" if found.valid else "in use", side, None, found.slope, found.friction),
        ("true machine", "ink", (8, 6), found.true_slope, found.true_friction),
    ]
    curves = [
        Curve(
            label=label, colour=colour, dash=dash, width=None if dash else 3, digits=2, y=slope / 256 * speeds + offset
        )
        for label, colour, dash, slope, offset in lines
    ]
    if points:
        measured = np.array([points.get(speed, np.nan) for speed in speeds.tolist()])
        curves.append(Curve(label="measured", colour="ink", rings=9, y=measured, digits=2))
    panel = Panel(
        name=f"identified-{side}",
        label="drive [count]",
        title=f"To the {side}",
        about=f"Drive value over speed, to the {side}",
        height=260,
        span=(0, 220),
        levels=[(found.friction, f"friction {found.friction}")],
        curves=curves,
    )
    return line_chart(panel, speeds * SPEED_STEP / INCH, "speed [in/s]")


def _constants_figure(run: PrintRun) -> Figure | None:
    rows: list[list[str | Cell]] = []
    of_slope = "drive per speed: the motor's back-EMF in counts"
    of_friction = f"drive that just keeps the head moving; {FULL_DRIVE_COUNTS} counts are the full supply"
    for side, found in run.identified.items():
        rows.append(_constant(f"slope K, {side}", of_slope, "1/256 count per 1/6 in/s", found.slope, found.true_slope))
        rows.append(_constant(f"friction Vf, {side}", of_friction, "count", found.friction, found.true_friction))
    if run.width:
        rows.append(_constant("width between the frames", "found while homing", "mm", run.width * 1e3, None))
    if not rows:
        return None
    heads = [("constant", False), ("in use", True), ("true", True), ("difference", True), ("unit", False)]
    caption = "Measured by the axis, and true values of the simulated machine."
    if not all(found.valid for found in run.identified.values()):
        caption = (
            "Slope and friction are defaults where the axis could not measure them; with the true values of the "
            "machine."
        )
    return Figure(title="Constants of the axis", caption=caption, table=Table(heads=heads, rows=rows))


def _constant(name: str, meaning: str, unit: str, identified: float, true: float | None) -> list[str | Cell]:
    named = Markup('{}<br><span class="kicker">{}</span>').format(name, meaning)
    difference = "\u2013"
    if true is not None:
        off = identified - true
        difference = ("+" if off > 0 else "") + number(off, 2)
        if true:
            difference = f"{difference} ({100 * off / abs(true):+.1f}{GAP}%)".replace("-", "\u2212")
    return [named, number(identified, 4), number(true, 4), difference, unit]
