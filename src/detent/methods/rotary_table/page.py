"""The page about a sequence on a rotary table: was it done, how exactly, and how the table goes on beyond a turn."""

import math
from html import escape

from detent.methods.rotary_table.charts import KINDS, left_out_signals, line_charts, line_end, turn_charts
from detent.methods.rotary_table.comparison_section import comparison_charts, comparison_section
from detent.methods.rotary_table.page_data import StepResult, TableReportData, TurnDetail, WorstStep
from detent.methods.rotary_table.summary import angle, degrees, kinds_text, times, turns
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
from detent.page.words import GAP, CountUnit, count, duration, further, offset_cell, table

MOST_STEPS = 500
"""Steps in the table: more than anybody reads."""

COLOURS = {kind: colour for kind, _, colour in KINDS} | {"output": "good"}
"""Of the kinds of steps, as in the time line."""


def make_table_page(data: TableReportData) -> Page:
    """What the page is made of."""
    return {
        "title": f"{data.job_name} on {data.axis_name}: {'done' if data.done else 'not done'}",
        "body": [
            _headline(data), _cards(data), notes(data.notes), _line(data), _turn(data),
            comparison_section(data.comparison), _steps(data), small_print(data.settings),
        ],
        "charts": all_charts(data),
        "version": data.version,
    }  # fmt: skip


def all_charts(data: TableReportData) -> list[Chart]:
    """Every chart of the page."""
    drawn = line_charts(data) if data.steps else []
    if data.detail:
        drawn += turn_charts(data.detail)
    return drawn + comparison_charts(data.comparison)


# ---- what came out, in one glance


def _headline(data: TableReportData) -> str:
    figures = data.figures
    kicker = f"Simulated run of the axis {data.axis_name}"
    if not data.done:
        done = f"Stopped after {count(figures.made)} of {count(figures.asked, 'step')}, {duration(figures.seconds)} in."
        lead = f"{done} {data.failure[:1].upper()}{data.failure[1:].rstrip('.')}."
        return headline("bad", "Not done", data.job_name, kicker=kicker, lead=lead)
    lead = f"{count(figures.asked, 'step')} in {duration(figures.seconds)}."
    if figures.deviation:
        crossed = f" and crossed the end of its turn {times(figures.crossings)}" if figures.crossings else ""
        lead += f" The table turned {turns(figures.travel)}{crossed}."
    if not figures.error:
        return headline("good", "Done", data.job_name, kicker=kicker, lead=lead)
    off = f"{angle(figures.error.value)} ({_counts(data, figures.error.value)})"
    if _is_off(data):
        lead += (
            f" But in step {count(figures.error.step)} it stood {off} beside its target while the axis said that it was"
            " in position: the detector cannot see what backlash and eccentricity of the gear do to the table."
        )
        return headline("warn", "Done, but beside its targets", data.job_name, kicker=kicker, lead=lead)
    lead += f" In every positioning it came to within {off} of its target."
    return headline("good", "Done", data.job_name, kicker=kicker, lead=lead)


def _is_off(data: TableReportData) -> bool:
    """The table stands farther off than window and resolution of the detector allow."""
    error = data.figures.error
    return error is not None and error.value > data.in_position + data.count


def _counts(data: TableReportData, value: float) -> str:
    return CountUnit(data.count, "count").counts(value)


def _cards(data: TableReportData) -> str:
    figures = data.figures
    seconds, _, time_unit = duration(figures.seconds).partition(GAP)
    shown = [
        Card("Steps", count(figures.made), f"of {count(figures.asked)}", kinds_text(figures),
             bad=figures.made < figures.asked),
        Card("Time", seconds, time_unit, "for the sequence" if data.done else "until it stopped"),
    ]  # fmt: skip
    if figures.error:
        value, _, unit = _counts(data, figures.error.value).partition(" ")
        allowed = _counts(data, data.in_position)
        below = f"{angle(figures.error.value)}, {_whose(figures.error)}; window {allowed}"
        shown.append(Card("Worst error at rest", value, unit, below, bad=_is_off(data)))
    if figures.deviation:
        value, _, unit = turns(figures.travel).partition(" ")
        rollovers = f", {count(figures.rollovers, 'rollover')}" if figures.rollovers else ""
        crossed = f"end of the turn crossed {times(figures.crossings)}" if figures.crossings else "within the turn"
        shown.append(Card("Turned", value, unit, crossed + rollovers))
        value, _, unit = angle(figures.deviation.value).partition(GAP)
        shown.append(Card("Largest lag", value, unit, f"deviation dR, {_whose(figures.deviation)}"))
    if figures.peak_speed:
        below = f"{_whose(figures.peak_speed)}, command limited to {degrees(data.max_speed)}"
        shown.append(Card("Peak speed", degrees(figures.peak_speed.value), "deg/s", below))
    return cards(shown)


def _whose(worst: WorstStep) -> str:
    return f"step {count(worst.step)}"


# ---- time line


def _line(data: TableReportData) -> str:
    if not data.steps:
        return ""
    shown, seconds = line_end(data), data.figures.seconds
    title = "Time line" if shown > 0.99 * seconds else f"The first {duration(shown)} of {duration(seconds)}"
    caption = "What the sequence controller did, and what the table did with it."
    if any(step.kind == "jog" for step in data.steps) and data.inputs:
        caption += " A jog that waits for its signal begins before the table moves."
    slots = [chart_slot("line-steps", "Steps and signals over time")]
    if data.path:
        caption += " D is what the detector says: it starts again at 0 in every turn."
        if data.done and data.figures.crossings:
            caption += " Look for: the true angle, which runs on without a step where D jumps."
        slots += [
            chart_slot("line-turns", "Turns of the table over time"),
            chart_slot("line-detected", "Detected angle over time"),
            chart_slot("line-speed", "Speed over time"),
        ]
    left_out = left_out_signals(data)
    if left_out:
        caption += f" {further(left_out, 'signal')} not drawn."
    return section("What the sequence did", figure(title, caption, "".join(slots), ZOOM_HINT))


# ---- one step


def _turn(data: TableReportData) -> str:
    detail = data.detail
    if not detail:
        return ""
    slots = [
        ("turn-angles", "Angles of the positioner over time"),
        ("turn-count", "Turns added and FLG over time"),
        ("turn-deviation", "Deviation over time"),
        ("turn-speed", "Speed signal and speed over time"),
    ]
    content = "".join(chart_slot(name, label) for name, label in slots)
    title = f"Step {count(detail.number)}: {detail.text}"
    caption = f"Shown is {escape(detail.why)}. {_turn_caption(detail)}"
    heading = "How the table goes on beyond a turn" if detail.crossings else "One step in detail"
    return section(heading, figure(title, caption, content, ZOOM_HINT + event_table(detail.events, "s")))


CARRIED = {
    "turn counter": "The positioner adds n turns and reckons with the present angle R = D + n turns.",
    "flag": "The positioner notes the jump in FLG, and adds one turn along the motion to R while that is on.",
    "raw": "A conventional unit reckons with this angle as it comes: R is D.",
}
"""What becomes of the jump, by the form of the axis."""


def _turn_caption(detail: TurnDetail) -> str:
    carried = f"The detector knows one turn: at its end D jumps by 360 deg. {CARRIED[detail.form]} "
    carried += "Shaded: R is not D. " if detail.crossings and detail.form != "raw" else ""
    if detail.kind == "go":
        asked = "The commanded angle C runs to the target M, and R follows. "
        look = "Look for: a deviation that knows nothing of the end of the turn."
    else:
        asked = (
            "The target M of a jog is two turns ahead and never reached: as soon as less than one turn is left, R and "
            "C go back by a whole turn together (rollover), and everything begins again. "
        )
        look = "Look for: a deviation that knows nothing of all this; if one went alone, it would jump by 360 deg."
    return carried + asked + ("Look for: where the lag leaves its course." if detail.failed else look)


# ---- table


def _steps(data: TableReportData) -> str:
    if not data.steps:
        return ""
    heads = [("step", True), ("what", False), ("begin [s]", True), ("took [s]", True),
             ("from [deg]", True), ("to [deg]", True), ("way [deg]", True), ("off target [count]", True),
             ("lag [deg]", True), ("crossed", True), ("roll\u00adovers", True)]  # fmt: skip
    offsets = [abs(step.offset) for step in data.steps if not math.isnan(step.offset)]
    longest = max(offsets, default=0.0) / data.count or 1.0
    rows = [_row(data, step, longest) for step in data.steps[:MOST_STEPS]]
    caption = (
        "Colours as in the time line. From and to are true angles of the table within its turn; way counts on through "
        "turns. Off target is true angle less target when the step ends; a count is "
        f"{angle(data.count)}. Lag is the largest deviation dR; crossed counts ends of the turn."
    )
    left_out = len(data.steps) - len(rows)
    if left_out > 0:
        caption += f" {further(left_out, 'step')} in the JSON summary only."
    return section("Step by step", figure("Every step", caption, table(heads, rows, tall=True)))


def _row(data: TableReportData, step: StepResult, longest: float) -> list[str]:
    mark = f'<span class="bar" style="width:8px;background:var(--{COLOURS[step.kind]})"></span>'
    what = [count(step.number), f'<td style="min-width:11em">{mark}{escape(step.text)}</td>', f"{step.begin:.3f}"]
    if step.kind == "output":
        return [*what, *[""] * 8]
    rest = [f"{step.seconds:.3f}", _place(step.start), _place(step.stop)]
    if step.kind == "wait":
        return [*what, *rest, *[""] * 5]
    return [
        *what,
        *rest,
        _signed(step.travel),
        offset_cell(step.offset / data.count, longest, over=abs(step.offset) > data.in_position + data.count),
        degrees(step.peak_deviation),
        count(step.crossings) if step.crossings else "",
        count(step.rollovers) if step.rollovers else "",
    ]


def _place(endless: float) -> str:
    """Angle within the turn; 359.9997 deg is 0.000 deg."""
    return f"{round(math.degrees(endless), 3) % 360:.3f}"


def _signed(way: float) -> str:
    text = f"{math.degrees(way):+.3f}"
    return text.replace("-", "\u2212")
