"""The page about a sequence on a rotary table: was it done, how exactly, and how the table goes on beyond a turn."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from detent.methods.rotary_table.detail import AHEAD, DETECTED, POINTS, VELOCITY, degree_curve, step_section
from detent.methods.rotary_table.run import SequenceRun, StepRecord, is_off
from detent.methods.rotary_table.schema import RotaryTableSpec
from detent.methods.rotary_table.sequence_controller import Change
from detent.methods.rotary_table.summary import SequenceFigures, rollovers, times, turns, whose
from detent.page.chart import Bar, Chart, Curve, Lane, Panel, Timeline, lane_chart, time_charts
from detent.page.figure import Figure
from detent.page.frame import Card, Comparison, Headline, Page, Section, card, comparison_section
from detent.page.run_page import (
    Stretch,
    made_card,
    page_title,
    run_headline,
    stopped_after,
    stretch,
    time_card,
    warnings,
    whole_or_first,
)
from detent.page.table import Cell, left_out, long_table, offset_cell
from detent.page.words import CountUnit, angle, count, degrees, duration, further
from detent.record.trace import Trace

PHASE, COMMANDED = "plant.table", "controller.positioner.interpolator.speed"
NEEDED = (PHASE, VELOCITY, DETECTED, AHEAD, COMMANDED)  # signals that the whole sequence is drawn from
PHASE_TURN = float(1 << 32)  # register of the true angle per turn
LINE_SECONDS = 120.0  # time that the timeline shows: more than this is a grey block on any screen
MOST_SIGNALS = 12  # inputs and outputs that the timeline shows

KINDS = (("go", "go to", "right"), ("jog", "jog", "left"), ("wait", "wait", "muted"))
"""Kinds of steps that last, their lanes and colours; an output is switched in no time."""

COLOURS = {kind: colour for kind, _, colour in KINDS} | {"output": "good"}
LINE = "line"  # name of the timeline: its plot areas share their cursor

SINCE = "time since the sequence began"

HEADS = (
    ("step", True), ("what", False), ("start [s]", True), ("duration [s]", True), ("from [deg]", True),
    ("to [deg]", True), ("distance [deg]", True), ("error [count]", True), ("lag [deg]", True), ("crossed", True),
    ("roll\u00adovers", True),
)  # fmt: skip


def table_page(
    spec: RotaryTableSpec,
    run: SequenceRun,
    trace: Trace | None,
    comparisons: Sequence[Comparison] = (),
    settings: dict[str, str] | None = None,
) -> Page:
    """The page of a run; figures whose signals were not recorded are left out."""
    figures = SequenceFigures(run)
    return Page(
        title=page_title(spec.axis.name, run),
        headline=_headline(spec, figures),
        cards=_cards(spec, figures),
        notes=warnings(run.warnings),
        sections=[
            Section("Results", [_line_figure(spec, figures, trace)] if run.steps else []),
            step_section(spec, run, trace),
            comparison_section(comparisons),
            Section("Steps", [_every_step(spec, run)] if run.steps else []),
        ],
        settings=settings or {},
    )


# ---- results, in one glance


def _headline(spec: RotaryTableSpec, figures: SequenceFigures) -> Headline:
    run, name, asked = figures.run, spec.axis.name, count(figures.run.job.count, "step")
    if not run.done:
        return run_headline(name, run, stopped_after(run, len(figures.made), asked, began=bool(run.steps)))
    lead = f"{asked} in {duration(figures.seconds)}."
    if figures.deviation:
        crossed = f" and crossed the end of its turn {times(run.crossings)}" if run.crossings else ""
        lead += f" The table turned {turns(run.travel)}{crossed}."
    error = figures.error
    if error is None:
        return run_headline(name, run, lead)
    off = f"{angle(error.value)} ({CountUnit(spec.count, 'count').counts(error.value)})"
    if is_off(run, error.value):
        return run_headline(name, run, lead, doubt="Done, but off target")
    return run_headline(name, run, f"{lead} In every positioning it stopped within {off} of its target.")


def _cards(spec: RotaryTableSpec, figures: SequenceFigures) -> list[Card]:
    run, unit = figures.run, CountUnit(spec.count, "count")
    shown = [
        made_card("Steps", len(figures.made), run.job.count, figures.kinds),
        time_card(figures.seconds, "for the sequence" if run.done else "until it stopped"),
    ]
    if error := figures.error:
        value, word = unit.counts(error.value).split(" ")
        below = f"{angle(error.value)}, {whose(error.of)}; window {unit.counts(run.in_position)}"
        shown.append(Card("Worst error at rest", value, word, below, bad=is_off(run, error.value)))
    if deviation := figures.deviation:
        value, word = turns(run.travel).split(" ")
        crossed = f"end of the turn crossed {times(run.crossings)}" if run.crossings else "within the turn"
        shown.append(Card("Turned", value, word, crossed + rollovers(run)))
        shown.append(card("Largest lag", angle(deviation.value), f"deviation dR, {whose(deviation.of)}"))
    if fastest := figures.peak_speed:
        below = f"{whose(fastest.of)}, command limited to {degrees(spec.limits.speed)}"
        shown.append(Card("Peak speed", degrees(fastest.value), "deg/s", below))
    return shown


# ---- timeline


def _line_figure(spec: RotaryTableSpec, figures: SequenceFigures, trace: Trace | None) -> Figure:
    run, rows = figures.run, stretch(trace, NEEDED, figures.run.time_ready)
    recorded = float(rows.t[-1]) if rows else math.inf
    end = min(figures.seconds, recorded, LINE_SECONDS)
    signals = _signal_lanes(run)
    lanes = [*_step_lanes(run), *signals[:MOST_SIGNALS]]
    caption = "Actions of the sequence controller, and the response of the table."
    if run.inputs and any(step.kind == "jog" for step in run.steps):
        caption += " A jog that waits for its signal begins before the table moves."
    if rows:
        caption += " D is the detected angle: it restarts at 0 in every turn."
    if rows and run.done and run.crossings:
        caption += " Check: the true angle continues without a step where D jumps."
    if len(signals) > MOST_SIGNALS:
        caption += f" {further(len(signals) - MOST_SIGNALS, 'signal')} not drawn."
    return Figure(
        title=whole_or_first(end, figures.seconds, "Timeline"),
        caption=caption,
        charts=_line_charts(spec, run, rows.between(0.0, end), lanes) if rows else [_lane_chart(lanes, (0.0, end))],
    )


def _lane_chart(lanes: list[Lane], span: tuple[float, float], sync: str = "") -> Chart:
    return lane_chart("line-steps", lanes, span, f"{SINCE} [s]", sync=sync) | {"about": "Steps and signals over time"}


def _step_lanes(run: SequenceRun) -> list[Lane]:
    lanes = [
        Lane(label, colour, [_step_bar(run, step) for step in run.steps if step.kind == kind])
        for kind, label, colour in KINDS
    ]
    return [lane for lane in lanes if lane.bars]


def _step_bar(run: SequenceRun, step: StepRecord) -> Bar:
    # What the name of the lane says already is left out: "go to position 2 (180 deg, positive)" -> "2".
    short = step.text.removeprefix("go to position ").removeprefix("jog ").removeprefix("wait ")
    short = short.partition(" ")[0] if step.kind == "go" else short
    return Bar(step.begin - run.time_ready, step.end - run.time_ready, short, f"{whose(step)}: {step.text}")


def _signal_lanes(run: SequenceRun) -> list[Lane]:
    return [
        Lane(f"{way} {name}", colour, [Bar(begin, end, "on", f"{way}put {name} is on") for begin, end in spans])
        for way, colour, changes in (("out", "good", run.outputs), ("in", "drive", run.inputs))
        for name, spans in _spans(run, changes).items()
    ]


def _spans(run: SequenceRun, changes: Sequence[Change]) -> dict[str, list[tuple[float, float]]]:
    """Stretches in which each signal was on [s]; what is still on at the end is on up to there."""
    spans: dict[str, list[tuple[float, float]]] = {name: [] for _, name, _ in changes}
    since: dict[str, float] = {}
    for moment, name, on in (*changes, *((run.time_end, name, False) for name in spans)):
        if on:
            since.setdefault(name, moment - run.time_ready)
        elif name in since:
            spans[name].append((since.pop(name), moment - run.time_ready))
    return spans


def _line_charts(spec: RotaryTableSpec, run: SequenceRun, rows: Stretch, lanes: list[Lane]) -> list[Chart]:
    """Steps and signals as bars, angle and speed of the table below."""
    speed, demanded = rows[VELOCITY] / spec.ratio, rows[AHEAD] * rows[COMMANDED] / spec.per_interrupt(1.0)
    target = np.full(len(rows.t), np.nan)
    for step in run.steps:
        if step.kind == "go":
            span = np.searchsorted(rows.t, (step.begin - run.time_ready, step.end - run.time_ready))
            target[slice(*span)] = step.target / math.tau
    true: Any = np.unwrap(rows[PHASE] / PHASE_TURN, period=1.0)
    true += round(run.steps[0].start / math.tau - float(true[0]))  # the register knows one turn
    ways = [
        Curve(label="target of a positioning", colour="left", dash=(6, 4), y=target, thin=0),
        Curve(label="true angle", colour="speed", width=2, y=true, digits=5, thin=POINTS),
    ]
    detected = degree_curve("detected angle D", "ink", rows[DETECTED] * spec.count)
    speeds = [
        degree_curve("commanded", "left", demanded, dash=(6, 4)),
        degree_curve("true speed", "speed", speed, width=2),
    ]
    return [
        _lane_chart(lanes, (float(rows.t[0]), float(rows.t[-1])), LINE),
        *time_charts(Timeline(name=LINE, t=rows.t, label=SINCE, unit="s"), [
            Panel(name="line-turns", label="table [turn]", height=200, zero=True, curves=ways),
            Panel(name="line-detected", label="D [deg]", height=150, span=(0.0, 360.0), curves=[detected]),
            Panel(name="line-speed", label="speed [deg/s]", height=180, zero=True, curves=speeds),
        ]),
    ]  # fmt: skip


# ---- table


def _every_step(spec: RotaryTableSpec, run: SequenceRun) -> Figure:
    errors = [abs(_error(run, step)) for step in run.steps]
    longest = max((error for error in errors if not math.isnan(error)), default=0.0) / spec.count or 1.0
    rows = [_row(spec, run, step, longest) for step in run.steps]
    caption = (
        "Colours as in the timeline. From and to are true angles of the table within its turn; distance accumulates "
        "over turns. Error is target minus true angle when the step ends; a count is "
        f"{angle(spec.count)}. Lag is the largest deviation dR; crossed counts the passes over the end of the turn."
    )
    return Figure(title="Every step", caption=caption + left_out(len(rows), "step"), table=long_table(HEADS, rows))


def _row(spec: RotaryTableSpec, run: SequenceRun, step: StepRecord, longest: float) -> list[str | Cell]:
    what = Cell(text=step.text, mark=COLOURS[step.kind])
    row = [count(step.number), what, f"{step.begin - run.time_ready:.3f}"]
    if step.kind != "output":
        row += [f"{step.end - step.begin:.3f}", _place(step.start), _place(step.stop)]
    if step.kind in {"go", "jog"}:
        error = _error(run, step)
        row += [
            f"{math.degrees(step.travel):+.3f}".replace("-", "\u2212"),
            offset_cell(error / spec.count, longest, over=is_off(run, error)),
            degrees(step.peak_deviation),
            count(step.crossings) if step.crossings else "",
            count(step.rollovers) if step.rollovers else "",
        ]
    return row + [""] * (len(HEADS) - len(row))


def _error(run: SequenceRun, step: StepRecord) -> float:
    """Target less angle at the end [rad]; a jog that broke off is held on no place of its own."""
    broken = not run.done and step is run.steps[-1] and step.kind == "jog"
    return math.nan if broken else step.error


def _place(endless: float) -> str:
    """Angle within the turn; 359.9997 deg is 0.000 deg."""
    return f"{round(math.degrees(endless), 3) % 360:.3f}"
