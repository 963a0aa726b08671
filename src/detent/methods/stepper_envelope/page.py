"""The page about a job on a stepper stage: did it keep its steps, how fast was it, and how near the limits it ran."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import isfinite

import numpy as np
from markupsafe import Markup

from detent.methods.stepper_envelope.detail import detail_section
from detent.methods.stepper_envelope.run import PULL_OUT_LAG, StageRun
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec
from detent.methods.stepper_envelope.stage_job import StageJog
from detent.methods.stepper_envelope.stage_plan import plan_figure
from detent.methods.stepper_envelope.stage_trace import MadeSteps, Runs, motor_runs, recorded_steps, runs_chart
from detent.methods.stepper_envelope.summary import (
    Motion,
    StageFigures,
    margin_text,
    speed_text,
    stated,
    units_of,
    way_text,
)
from detent.page.chart import Curve, Panel, Timeline, time_charts
from detent.page.figure import Figure
from detent.page.frame import Card, Comparison, Headline, Page, Section, card, comparison_section
from detent.page.parts import Note, Numbers
from detent.page.run_page import (
    FEWEST_ROWS,
    LONGEST,
    Stretch,
    has,
    made_card,
    page_title,
    run_headline,
    stopped_after,
    stretch,
    time_card,
    warnings,
    whole_or_first,
)
from detent.page.table import Cell, left_out, long_table
from detent.page.units import Units
from detent.page.words import GAP, count, duration, further, number
from detent.record.trace import Trace

MOST_MOTORS = 6  # motors that are drawn
POINTS = 1500  # rows that are chosen for one curve's sake: a page has many of them
MOST_ZONES = 4  # zones that are named below a figure


def stage_page(
    spec: StepperEnvelopeSpec,
    run: StageRun,
    trace: Trace | None,
    comparisons: Sequence[Comparison] = (),
    settings: Mapping[str, str] | None = None,
) -> Page:
    """The page of a run; figures whose signals were not recorded are left out."""
    if trace is not None and len(trace) < FEWEST_ROWS:
        trace = None
    figures = StageFigures(spec, run)
    made = recorded_steps(figures, trace)
    result = [plan_figure(figures), _path_figure(figures, trace)]
    return Page(
        title=page_title(spec.axis.name, run),
        headline=_headline(figures),
        cards=_cards(figures),
        notes=_notes(figures),
        sections=[
            Section("Results", [figure for figure in result if figure]),
            Section("Speed under the envelope", _runs_figures(figures, made)),
            detail_section(figures, trace, made),
            comparison_section(comparisons),
            Section(f"{figures.word.capitalize()} by {figures.word}", [_every_move(figures)] if run.moves else []),
        ],
        settings=settings or {},
    )


def _headline(figures: StageFigures) -> Headline:
    run, axis = figures.run, figures.spec.axis.name
    asked = count(figures.asked, figures.word)
    if not run.done:
        if len(run.moves) < figures.asked:
            return run_headline(axis, run, stopped_after(run, len(run.moves), asked, began=bool(run.moves)))
        return run_headline(axis, run, f"{count(figures.placed)} of {asked} in place.")
    lead = f"{asked} in {duration(figures.seconds)}, {figures.rate}; no step was lost."
    if isfinite(figures.faster):
        lead += f" At the constant start frequency the motors would run {number(figures.faster)} times as long."
    return run_headline(axis, run, lead)


def _cards(figures: StageFigures) -> list[Card]:
    run, word = figures.run, figures.word
    beside = figures.asked - figures.placed
    below = f"{count(beside)} not" if beside else "every rotor on its step"
    stopped = "until it stopped" if len(run.moves) < figures.asked else "for the whole job"
    shown = [
        made_card(f"{word.capitalize()}s in place", figures.placed, figures.asked, below),
        time_card(figures.seconds, figures.rate if run.done else stopped),
    ]
    if figures.steps:
        first, below = figures.first_lost, f"of {count(figures.steps)} made"
        if first:
            below = f"in the end; {figures.whose(first)} lost {count(abs(first.motor.lost))} first"
        shown.append(Card("Lost steps", count(figures.all_lost), "", below, bad=first is not None))
    if lag := figures.lag:
        below = f"{figures.whose(lag.of)}; out of step from {number(PULL_OUT_LAG)}"
        shown.append(Card("Worst rotor lag", number(lag.value), "steps", below, bad=lag.value >= PULL_OUT_LAG))
    if margin := figures.margin:
        below = f"{figures.whose(margin.of)}; falls behind below 1"
        shown.append(Card("Least torque margin", f"× {number(margin.value)}", "", below, bad=margin.value < 1))
    if run.done and isfinite(figures.faster):
        saved = duration(max(figures.naive - figures.moving, 0.0))
        below = f"{number(figures.faster)} times as fast as at the start frequency ({duration(figures.naive)})"
        shown.append(card("Time saved", saved, below))
    return shown


def _notes(figures: StageFigures) -> list[Note]:
    job = figures.run.job
    notes = warnings(figures.run.warnings)
    return [*notes, Note("note", f"how {job.name} was read: {'; '.join(job.notes)}")] if job.notes else notes


def _path_figure(figures: StageFigures, trace: Trace | None) -> Figure | None:
    names = [name for name in figures.moved if has(trace, [f"{name}.controller.rule.position"])]
    rows = stretch(trace, [], figures.run.time_ready)
    if not names or rows is None:
        return None
    part = slice(0, int(np.searchsorted(rows.t, LONGEST, side="right")))
    t = rows.t[part]
    panels = [
        Panel(
            name=f"path-{k}", label=f"{name} [{figures.units(name).place.name}]", height=170,
            curves=_path_curves(figures, rows, name, part), about=f"Position of {name} over time",
        )
        for k, name in enumerate(names[:MOST_MOTORS])
    ]  # fmt: skip
    caption = (
        "Where each motor was and where it had to go. Look for: the line on the dashes at the end of every move; where "
        "the counted position leaves the true one, steps are lost."
    )
    if len(names) > MOST_MOTORS:
        caption += f" {further(len(names) - MOST_MOTORS, 'motor')} not drawn."
    charts = time_charts(Timeline(name="path", t=t, label="time since the job began", unit="s"), panels)
    title = whole_or_first(float(t[-1]), figures.seconds, "Where the motors were")
    return Figure(title=title, caption=caption, charts=charts)


def _path_curves(figures: StageFigures, rows: Stretch, name: str, part: slice) -> list[Curve]:
    """Target, and where the rotor was; the counted position if it is not that, or if nothing better was recorded."""
    table, scale = figures.spec.stepper[name], figures.units(name).place.factor
    lower, steps = table.mechanics.lower_end, rows[f"{name}.controller.rule.position"][part]
    aim = target_of(figures, name, rows.trace.time[rows.rows][part])
    # A manual run has no target: one who makes nothing else has no curve.
    aimed = Curve(label="target", colour="muted", dash=(6, 4), step=True, y=aim * scale, thin=0)
    target = [] if np.isnan(aim).all() else [aimed]
    counted = (lower + steps * table.step) * scale
    if not has(rows.trace, [f"{name}.plant.rotor.lag"]):
        return [*target, Curve(label="counted position", colour="speed", width=2, y=counted, digits=4, thin=POINTS)]
    # The field is where the steps are counted: the rotor lags behind it.
    place = (lower + (steps - rows[f"{name}.plant.rotor.lag"][part]) * table.step) * scale
    rotor = Curve(label="true position", colour="speed", width=2, y=place, digits=4, thin=POINTS)
    if not any(motion.motor.lost for motion in figures.motions if motion.name == name):
        return [*target, rotor]
    return [*target, Curve(label="counted position", colour="left", dash=(3, 3), y=counted, digits=4, thin=0), rotor]


def target_of(figures: StageFigures, name: str, t: Numbers) -> Numbers:
    """Where a motor had to go at each moment since power-on [m]; a manual run has no target."""
    manual = {move.number for move in figures.run.job.moves if isinstance(move, StageJog)}
    moments, targets = [-np.inf], [figures.spec.stepper[name].mechanics.start_position]
    for move, who, motor, _ in figures.motions:
        if who == name and move.number in manual:
            moments += [move.begin, motor.arrived]
            targets += [np.nan, motor.target]
        elif who == name:
            moments.append(move.begin)
            targets.append(motor.target)
    return np.array(targets)[np.searchsorted(moments, t, side="right") - 1]


def _runs_figures(figures: StageFigures, made: Mapping[str, MadeSteps]) -> list[Figure]:
    runs = [runs for runs in (motor_runs(figures, name, steps) for name, steps in made.items()) if runs.arcs]
    drawn: list[Figure] = []
    caption = (
        "Step frequency over position: motion up above zero, motion down below it. The grey ground is what the table "
        "permits between the ends of the travel. Look for: lines that stay inside the grey; a motor that starts or "
        "stops anywhere keeps to its ramp. "
    )
    for k, one in enumerate(runs[:MOST_MOTORS]):
        caption += f"1{GAP}000{GAP}Hz is {speed_text(one.table, one.table.step * 1e3)}.{_zones_text(one)}"
        if one.window != one.travel:
            low, high = one.travel
            low = stated(low * units_of(one.table).place.factor)
            caption += f" The travel goes from {low} to {way_text(one.table, high)}; drawn is what was used."
        if one.left_out:
            caption += f" {further(one.left_out, 'move')} not drawn."
        drawn.append(Figure(title=f"Motor {one.name}", caption=caption, charts=[runs_chart(one, f"runs-{k}")]))
        caption = ""  # what to look for stands at the first motor only
    if len(runs) > MOST_MOTORS:
        drawn[-1] = replace(drawn[-1], hint=f"{further(len(runs) - MOST_MOTORS, 'motor')} not drawn.")
    return drawn


def _zones_text(runs: Runs) -> str:
    """Zones by name: in the figure not all have room for theirs."""
    table, scale, zones = runs.table, units_of(runs.table).place.factor, runs.zones.items()
    named = [f"{name} ({stated(zone.begin * scale)} to {way_text(table, zone.end)})" for name, zone in zones]
    if not named:
        return ""
    more = f" and {count(len(named) - MOST_ZONES)} more" if len(named) > MOST_ZONES else ""
    return f" The shaded zones have a limit of their own: {', '.join(named[:MOST_ZONES])}{more}."


def _every_move(figures: StageFigures) -> Figure:
    run = figures.run
    labelled, astray = any(move.label for move in run.moves), any(motion.off for motion in figures.motions)
    name = [("tile" if figures.word == "tile" else "name", False)] if labelled else []
    # Motors that slide beside motors that turn: each cell has its unit.
    units = {figures.units(motion.name).place.name for motion in figures.motions}
    unit, own = (f" [{'/'.join(units)}]", False) if len(units) < 2 else ("", True)
    heads = [("move", True), *name, ("start [s]", True), ("motor", False), (f"from{unit}", True), (f"to{unit}", True),
             (f"way{unit}", False), ("time [ms]", True), ("peak [Hz]", True), ("lag [step]", True), ("margin", True),
             ("lost [step]", True), *([("off [step]", True)] if astray else [])]  # fmt: skip
    rows: list[list[str | Cell]] = []
    for move, motions in zip(run.moves, figures.by_move, strict=True):
        cells = [_cells(motion, figures.units(motion.name), own=own) for motion in motions]
        cells = cells or [["none: stays", *[""] * 9]]
        lead = [count(move.number), *([move.label] if labelled else []), f"{move.begin - run.time_ready:.3f}"]
        # Number and name stand in the first row only.
        heading = [lead, *([[""] * len(lead)] * (len(cells) - 1))]
        rows += [[*first, *rest[: len(heads) - len(lead)]] for first, rest in zip(heading, cells, strict=True)]
    caption = (
        "A row per motor that moved. Time goes from the start signal to the end of the last step; margin is pull-out "
        "torque over torque needed in the worst step."
    )
    if astray:
        caption += " Off: how far the rotor stood beside its place in the end, steps of earlier moves included."
    caption += left_out(len(rows), "row")
    return Figure(title=f"Every {figures.word}", caption=caption, table=long_table(heads, rows))


def _cells(motion: Motion, units: Units, *, own: bool) -> list[str | Cell]:
    """Cells of a motion, with units of their own or not; the last is left out where every rotor stands in its place."""
    motor, way = motion.motor, motion.motor.stop - motion.motor.start
    look, side = ("right", "↑ up") if way >= 0 else ("left", "↓ down")
    unit, scale = f"{GAP}{units.place.name}" if own else "", units.place.factor
    arrow = Markup('<span class="arrow {}">{}</span> {}{}').format(look, side, stated(abs(way) * scale), unit)
    return [
        motion.name,
        _place(motor.start * scale) + unit,
        _place(motor.target * scale) + unit,
        Cell(text=arrow, nowrap=True),
        number(motion.seconds * 1e3),
        count(round(motor.peak_hz)),
        Cell(text=number(motor.peak_lag), over=motor.peak_lag >= PULL_OUT_LAG),
        Cell(text=margin_text(motion), over=motor.margin < 1),
        Cell(text=number(motor.lost), over=motor.lost != 0),
        Cell(text=number(motion.off), over=motion.off != 0),
    ]


def _place(position: float) -> str:
    """A position in its unit; a rounding error below 0 is 0."""
    return f"{round(position, 3) + 0.0:.3f}".replace("-", "\u2212")
