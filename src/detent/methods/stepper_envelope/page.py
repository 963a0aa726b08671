"""The page about a job on a stepper stage: did it keep its steps, how fast was it, and how near the limits it ran."""

from html import escape
from math import isfinite

from detent.methods.stepper_envelope import charts as stage_charts
from detent.methods.stepper_envelope.comparison_section import comparison_charts, comparison_section
from detent.methods.stepper_envelope.page_data import MotorRuns, MoveDetail, StageReportData
from detent.methods.stepper_envelope.stage_plan import MOST_TILES, plan_drawing, plan_legend
from detent.methods.stepper_envelope.stage_results import MotionResult, StageMoveResult, WorstMotion
from detent.methods.stepper_envelope.summary import PULL_OUT_LAG, called, rate, stated
from detent.page.chart import Chart
from detent.page.page import (
    ZOOM_HINT,
    Card,
    Page,
    cards,
    chart_slot,
    event_table,
    figure,
    headline,
    notes,
    section,
    small_print,
)
from detent.page.words import GAP, count, duration, further, number, table

MOST_MOTIONS = 500
"""Rows in the table: more than anybody reads."""

ENVELOPE_CAPTION = (
    "Step frequency over position: motion up above zero, motion down below it. The grey ground is what the table "
    "permits between the ends of the travel. Look for: lines that stay inside the grey; a motor that starts or stops "
    "anywhere keeps to its ramp. "
)
"""Stands at the first motor only."""

MOST_ZONES = 4
"""Zones that are named below a figure."""


def make_stage_page(data: StageReportData) -> Page:
    """What the page is made of."""
    return {
        "title": f"{data.job_name} on {data.axis_name}: {'done' if data.done else 'not done'}",
        "body": [
            _headline(data), _cards(data), notes(data.notes), _result(data), _envelopes(data), _detail(data),
            comparison_section(data), _moves(data), small_print(data.settings),
        ],
        "charts": all_charts(data),
        "version": data.version,
    }  # fmt: skip


def all_charts(data: StageReportData) -> list[Chart]:
    """Every chart of the page."""
    drawn = stage_charts.path_charts(data.path) if data.path else []
    shown = data.runs[: stage_charts.MOST_MOTORS]
    drawn += [stage_charts.runs_chart(runs, f"runs-{k}") for k, runs in enumerate(shown)]
    if data.detail:
        drawn += stage_charts.detail_charts(data.detail)
    return drawn + comparison_charts(data)


# ---- what came out, in one glance


def _headline(data: StageReportData) -> str:
    figures = data.figures
    kicker = f"Simulated run of the axis {data.axis_name}"
    asked = count(figures.asked, data.word)
    if not data.done:
        told = f"{data.failure[:1].upper()}{data.failure[1:].rstrip('.')}."
        if figures.made < figures.asked:
            begun = f"Stopped after {count(figures.made)} of {asked}, {duration(figures.seconds)} into the job."
        else:
            begun = f"{count(figures.placed)} of {asked} in place."
        return headline("bad", "Not done", data.job_name, kicker=kicker, lead=f"{begun} {told}")
    lead = f"{asked} in {duration(figures.seconds)}, {rate(figures, data.word)}; no step was lost."
    if isfinite(figures.faster):
        lead += f" At the constant start frequency the motors would run {number(figures.faster)} times as long."
    return headline("good", "Done", data.job_name, kicker=kicker, lead=lead)


def _cards(data: StageReportData) -> str:
    figures, word = data.figures, data.word
    seconds, _, unit = duration(figures.seconds).partition(GAP)
    beside = figures.asked - figures.placed
    shown = [
        Card(f"{word.capitalize()}s in place", count(figures.placed), f"of {count(figures.asked)}",
             f"{count(beside)} not" if beside else "every rotor on its step", bad=beside > 0),
        Card("Time", seconds, unit, rate(figures, word) if data.done else "for the whole job"),
    ]  # fmt: skip
    if figures.steps:
        first = figures.first_lost
        below = f"of {count(figures.steps)} made"
        if first:
            below = f"in the end; {_whose(data, first)} lost {count(abs(round(first.value)))} first"
        shown.append(Card("Lost steps", count(figures.all_lost), "", below, bad=first is not None))
    if figures.lag:
        below = f"{_whose(data, figures.lag)}; out of step from {number(PULL_OUT_LAG)}"
        shown.append(
            Card("Worst rotor lag", number(figures.lag.value), "steps", below, bad=figures.lag.value >= PULL_OUT_LAG)
        )
    if figures.margin:
        below = f"{_whose(data, figures.margin)}; falls behind below 1"
        least = figures.margin.value
        shown.append(Card("Least torque margin", f"× {number(least)}", "", below, bad=least < 1))
    if data.done and isfinite(figures.faster):
        saved, _, unit = duration(max(figures.naive - figures.moving, 0.0)).partition(GAP)
        below = f"{number(figures.faster)} times as fast as at the start frequency ({duration(figures.naive)})"
        shown.append(Card("Time saved", saved, unit, below))
    return cards(shown)


def _whose(data: StageReportData, worst: WorstMotion) -> str:
    label = next((move.label for move in data.moves if move.number == worst.move), "")
    return f"{called(worst.move, label, data.kind)}, {worst.motor}"


# ---- what came out


def _result(data: StageReportData) -> str:
    return section("What came out", _plan_figure(data), _path_figure(data))


def _plan_figure(data: StageReportData) -> str:
    plan = data.plan
    if not plan:
        return ""
    caption = (
        "Every square is a tile, where it was asked for, with its name; the line goes through the places where the "
        "rotors stood, in the order of the visits, and the ring is the first. Both axes move together: a tile is done "
        "when both are settled. The squares are as large as the tiles are apart, not as the camera sees. The stage "
        f"came from {escape(plan.motors[0])} {stated(plan.start[0] * 1e3)}, {escape(plan.motors[1])} "
        f"{stated(plan.start[1] * 1e3)}{GAP}mm."
    )
    left_out = len(plan.tiles) - MOST_TILES
    if left_out > 0:
        caption += f" {further(left_out, 'tile')} not drawn."
    return figure("The tiles from above", caption, plan_legend(plan) + plan_drawing(plan))


def _path_figure(data: StageReportData) -> str:
    path = data.path
    if not path:
        return ""
    shown, seconds = stage_charts.path_end(path), data.figures.seconds
    whole = shown > 0.99 * seconds
    title = "Where the motors were" if whole else f"The first {duration(shown)} of {duration(seconds)}"
    caption = (
        "Where each motor was and where it had to go. Look for: the line on the dashes at the end of every move; where "
        "the counted position leaves the true one, steps are lost."
    )
    left_out = len(path.motors) - stage_charts.MOST_MOTORS
    if left_out > 0:
        caption += f" {further(left_out, 'motor')} not drawn."
    slots = "".join(
        chart_slot(f"path-{k}", f"Position of {motor.motor} over time")
        for k, motor in enumerate(path.motors[: stage_charts.MOST_MOTORS])
    )
    return figure(title, caption, slots, ZOOM_HINT)


# ---- frequency against position


def _envelopes(data: StageReportData) -> str:
    shown = data.runs[: stage_charts.MOST_MOTORS]
    left_out = len(data.runs) - len(shown)
    more = f'<p class="hint">{further(left_out, "motor")} not drawn.</p>' if left_out > 0 else ""
    return section("Speed under the envelope", *(_runs_figure(runs, k) for k, runs in enumerate(shown)), more)


def _runs_figure(runs: MotorRuns, k: int) -> str:
    caption = "" if k else ENVELOPE_CAPTION
    caption += f"1{GAP}000{GAP}Hz is {stated(runs.step * 1e6)}{GAP}mm/s.{_zones_text(runs)}"
    low, high = (stated(place * 1e3) for place in runs.travel)
    if stage_charts.shown_window(runs) != runs.travel:
        caption += f" The travel goes from {low} to {high}{GAP}mm; drawn is what was used."
    if runs.left_out:
        caption += f" {further(runs.left_out, 'move')} not drawn."
    slot = chart_slot(f"runs-{k}", f"Step frequency of {runs.motor} over position, under the envelope")
    return figure(f"Motor {runs.motor}", caption, slot, ZOOM_HINT)


def _zones_text(runs: MotorRuns) -> str:
    """Zones by name: in the figure not all have room for theirs."""
    zones = stage_charts.shown_zones(runs)
    if not zones:
        return ""
    named = [
        f"{escape(zone.name)} ({stated(zone.begin * 1e3)} to {stated(zone.end * 1e3)}{GAP}mm)"
        for zone in zones[:MOST_ZONES]
    ]
    more = f" and {count(len(zones) - MOST_ZONES)} more" if len(zones) > MOST_ZONES else ""
    return f" The shaded zones have a limit of their own: {', '.join(named)}{more}."


# ---- one move


def _detail(data: StageReportData) -> str:
    detail = data.detail
    if not detail:
        return ""
    motion = detail.motion
    name = called(detail.number, detail.label, data.kind).capitalize()
    name += f" “{detail.label}”" if detail.label and data.kind != "tiles" else ""
    way = abs(motion.stop - motion.start)
    side = "up" if motion.stop > motion.start else "down"
    legs = len(detail.runs.arcs)
    turned = f", with {count(legs - 1, 'turn')} on the way" if legs > 1 else ""
    told = f"motor {motion.motor}, {stated(way * 1e3)}{GAP}mm {side}{turned}"
    return section(
        f"{name}, step by step", _table_figure(detail, told), _torque_figure(detail), _rotor_figure(detail),
        _rest_figure(detail),
    )  # fmt: skip


def _table_figure(detail: MoveDetail, told: str) -> str:
    caption = (
        f"Shown is {escape(detail.why)}: {escape(told)}. The grey ground is now the table of this very move, which "
        "ends at its extremes: every step was looked up in it. Look for: the line on the edge of the grey."
    )
    slot = chart_slot("detail-runs", "Step frequency over position, under the table of this move")
    return figure("Frequency against position, under the table of the move", caption, slot, ZOOM_HINT)


def _torque_figure(detail: MoveDetail) -> str:
    if not detail.torques:
        return ""
    safety = stated(detail.torques.safety)
    caption = (
        "Above: the torque that the motor can give at the frequency of each step, and what the step asks for: friction "
        "and acceleration; friction helps to brake. Below: their ratio, cut off where it is far above the least. Under "
        f"1 the rotor cannot follow; the ramp is planned with a reserve of {safety}. Look for: the least margin, "
        f"×{GAP}{_margin(detail.motion)}, and where it is."
    )
    content = chart_slot("detail-torque", "Pull-out torque and torque needed at every step") + chart_slot(
        "detail-margin", "Torque margin at every step"
    )
    return figure("Margin of torque at every step", caption, content, ZOOM_HINT)


def _rotor_figure(detail: MoveDetail) -> str:
    if not detail.rotor:
        return ""
    caption = (
        "Nothing measures the rotor of a stepper; the simulation does. It swings after the field, which jumps by a "
        f"step at every pulse. Look for: a lag well below {number(PULL_OUT_LAG)} steps, from where on the field pulls "
        "the rotor the wrong way and steps are lost four at a time."
    )
    content = chart_slot("detail-speed", "Speed of field and rotor over time") + chart_slot(
        "detail-lag", "Lag of the rotor over time"
    )
    unit = "ms" if detail.rotor.t[-1] < 1 else "s"
    return figure("How the rotor followed", caption, content, ZOOM_HINT + event_table(detail.rotor.events, unit))


def _rest_figure(detail: MoveDetail) -> str:
    if not detail.rotor or not stage_charts.rest_charts(detail):
        return ""
    caption = (
        "The end of the same move, magnified. Green is the time that the host waits for the swing to die away. Look "
        f"for: the line within ±{detail.rotor.tolerance:g} steps (dashed) long before that time is over."
    )
    slot = chart_slot("rest-lag", "Lag of the rotor over time after the last step")
    return figure("Coming to rest", caption, slot, ZOOM_HINT)


# ---- table


def _moves(data: StageReportData) -> str:
    if not data.moves:
        return ""
    labelled = any(move.label for move in data.moves)
    astray = any(motion.off for move in data.moves for motion in move.motions)
    name = [("tile" if data.kind == "tiles" else "name", False)] if labelled else []
    heads = [("move", True), *name, ("start [s]", True), ("motor", False), ("from [mm]", True), ("to [mm]", True),
             ("way [mm]", False), ("time [ms]", True), ("peak [Hz]", True), ("lag [step]", True), ("margin", True),
             ("lost [step]", True), *([("off [step]", True)] if astray else [])]  # fmt: skip
    rows = [row for move in data.moves for row in _rows(move, labelled=labelled, astray=astray)]
    caption = (
        "A row per motor that moved. Time goes from the start signal to the end of the last step; margin is pull-out "
        "torque over torque needed in the worst step."
    )
    if astray:
        caption += " Off: how far the rotor stood beside its place in the end, steps of earlier moves included."
    left_out = len(rows) - MOST_MOTIONS
    if left_out > 0:
        caption += f" {further(left_out, 'row')} in the JSON summary only."
    title = f"Every {data.word}"
    content = table(heads, rows[:MOST_MOTIONS], tall=True)
    return section(f"{data.word.capitalize()} by {data.word}", figure(title, caption, content))


def _rows(move: StageMoveResult, *, labelled: bool, astray: bool) -> list[list[str]]:
    """Rows of one move: its number and name stand in the first only."""
    head = [count(move.number), *([escape(move.label)] if labelled else []), f"{move.begin:.3f}"]
    if not move.motions:
        return [[*head, "none: stays", *["" for _ in range(8 + astray)]]]
    blank = ["" for _ in head]
    return [[*(blank if k else head), *_cells(motion, astray=astray)] for k, motion in enumerate(move.motions)]


def _cells(motion: MotionResult, *, astray: bool) -> list[str]:
    way = motion.stop - motion.start
    side, sign = ("right", "↑ up") if way >= 0 else ("left", "↓ down")
    return [
        escape(motion.motor),
        _place(motion.start),
        _place(motion.target),
        f'<td class="nowrap"><span class="arrow {side}">{sign}</span> {stated(abs(way) * 1e3)}</td>',
        number(motion.seconds * 1e3),
        count(round(motion.peak_hz)),
        _marked(number(motion.lag), wrong=motion.lag >= PULL_OUT_LAG),
        _marked(_margin(motion), wrong=motion.margin < 1),
        _marked(number(motion.lost), wrong=motion.lost != 0),
        *([_marked(number(motion.off), wrong=motion.off != 0)] if astray else []),
    ]


def _margin(motion: MotionResult) -> str:
    """Without friction and acceleration no torque is needed."""
    return number(motion.margin) if isfinite(motion.margin) else "any"


def _place(position: float) -> str:
    """In mm; a rounding error below 0 is 0."""
    return f"{round(position * 1e3, 3) + 0.0:.3f}".replace("-", "\u2212")


def _marked(text: str, *, wrong: bool) -> str:
    return f'<td class="n over">{text}</td>' if wrong else text
