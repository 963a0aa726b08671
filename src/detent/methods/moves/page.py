"""The page about a run of moves on a servo axis: did it arrive, how fast and how well, and how the axis did it."""

from html import escape
from math import isnan
from typing import Any

from detent.methods.moves import charts as servo_charts
from detent.methods.moves.comparison_section import comparison_charts, comparison_section
from detent.methods.moves.page_data import FilteredMove, MoveResult, PhaseMove, ServoReportData, Worst
from detent.methods.moves.summary import in_counts, length
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
    paper_figure,
    section,
    small_print,
)
from detent.page.paper import printed_pages
from detent.page.words import GAP, arrow, count, duration, further, number, offset_cell, table

MOST_MOVES = 500
"""Moves in the table: more than anybody reads."""

PAPER_CAPTION = "Each character stands where the carriage stood for it at the end of its dwell."

FEWEST_MOVES = 5
"""Moves below which a histogram says less than the table."""


def make_servo_page(data: ServoReportData) -> Page:
    """What the page is made of.

    Parameters
    ----------
    data : ServoReportData
        What to show.

    Returns
    -------
    Page
        For `detent.page.page.write_page`.
    """
    paper = printed_pages(data.marks, data.tolerance) if len(data.marks) else None
    return {
        "title": f"{data.job_name} on {data.axis_name}: {'done' if data.done else 'not done'}",
        "body": [
            _headline(data), _cards(data), notes(data.notes), _result(data, paper), _how(data),
            comparison_section(data), _moves(data), small_print(data.settings),
        ],
        "charts": all_charts(data),
        "paper": paper,
        "version": data.version,
    }  # fmt: skip


def all_charts(data: ServoReportData) -> list[Chart]:
    """Every chart of the page.

    Parameters
    ----------
    data : ServoReportData
        What to show.

    Returns
    -------
    list of dict
        In the order of the page.
    """
    drawn: list[Chart] = []
    if data.path:
        drawn.append(servo_charts.job_chart(data.path))
    if len(data.moves) >= FEWEST_MOVES:
        drawn.append(servo_charts.rest_chart(data.moves, data.tolerance))
    if data.detail:
        drawn += servo_charts.move_charts(data.detail)
        drawn += servo_charts.approach_charts(data.detail, data.unit, data.tolerance)
    return drawn + comparison_charts(data)


# ---- what came out, in one glance


def _word(data: ServoReportData) -> str:
    return "character" if data.kind == "text" else "move"


def _headline(data: ServoReportData) -> str:
    figures = data.figures
    kicker = f"Simulated run of the axis {data.axis_name}"
    asked = count(figures.asked, _word(data))
    if not data.done:
        done = f"Stopped after {count(figures.arrived)} of {asked}, {duration(figures.seconds)} into the job."
        lead = f"{done} {data.failure[:1].upper()}{data.failure[1:].rstrip('.')}."
        return headline("bad", "Not done", data.job_name, kicker=kicker, lead=lead)
    lead = f"{asked} in {duration(figures.seconds)}."
    if figures.error:
        counts = f"{number(figures.error.value / data.unit.size, 2)} {data.unit.words}"
        lead += (
            f" At the end of every dwell the axis stood within {length(figures.error.value)} ({counts}) of its target."
        )
    if figures.early:
        lead += (
            f" But in {count(figures.early_moves, 'move')} it said that it had arrived before it was there for good."
        )
        return headline("warn", "Done, but ready too early", data.job_name, kicker=kicker, lead=lead)
    return headline("good", "Done", data.job_name, kicker=kicker, lead=lead)


def _cards(data: ServoReportData) -> str:
    figures, word = data.figures, _word(data)
    rate = f"{number(figures.rate)} {word}s per second"
    seconds, _, time_unit = duration(figures.seconds).partition(GAP)
    shown = [
        Card(f"{word.capitalize()}s", count(figures.arrived), f"of {count(figures.asked)}", "arrived and stayed",
             bad=figures.arrived < figures.asked),
        Card("Time", seconds, time_unit, rate if data.done else "until it stopped"),
    ]  # fmt: skip
    if figures.worst_time:
        worst = f"median; worst {number(figures.worst_time.value * 1e3)}{GAP}ms, {_whose(figures.worst_time)}"
        shown.append(Card("Settled after", number(figures.median_time * 1e3), "ms", worst))
    if figures.overshoot:
        shown.append(_length_card("Worst overshoot", figures.overshoot, data))
    if figures.error:
        shown.append(
            _length_card(
                "Worst error at rest", figures.error, data, f", allowed {length(data.tolerance)}",
                bad=figures.error.value > data.tolerance,
            )
        )  # fmt: skip
    if figures.peak_speed:
        below = f"{_whose(figures.peak_speed)}, limit {number(data.max_speed * 1e3)}"
        shown.append(Card("Peak speed", number(figures.peak_speed.value * 1e3), "mm/s", below))
    return cards(shown)


def _length_card(title: str, worst: Worst, data: ServoReportData, more: str = "", *, bad: bool = False) -> Card:
    value, _, unit = length(worst.value).partition(GAP)
    below = f"{in_counts(worst.value, data.unit)}, {_whose(worst)}{more}"
    return Card(title, value, unit, below, bad=bad)


def _whose(worst: Worst) -> str:
    return f"move {count(worst.move)}"


# ---- figures


def _result(data: ServoReportData, paper: dict[str, Any] | None) -> str:
    text = paper_figure("The text", PAPER_CAPTION, paper) if paper else ""
    return section("What came out", text, _job_figure(data), _rest_figure(data))


def _job_figure(data: ServoReportData) -> str:
    if not data.path:
        return ""
    # A long job is drawn in part, and of a very long one only the beginning is recorded.
    shown, seconds = min(float(data.path.t[-1]), servo_charts.PATH_SECONDS), data.figures.seconds
    whole = shown > 0.99 * seconds
    title = "The whole job" if whole else f"The first {duration(shown)} of {duration(seconds)}"
    caption = "Where the axis was and where it had to go. Look for: the line on the dashes at the end of every move."
    return figure(title, caption, chart_slot("job", "Position and target over time"), ZOOM_HINT)


def _rest_figure(data: ServoReportData) -> str:
    if len(data.moves) < FEWEST_MOVES:
        return ""
    error = data.figures.error
    outside = " (outside the figure)" if error and error.value < data.tolerance / 1.5 else ""
    caption = (
        "How far from its target the axis stood at the end of each dwell. Look for: narrow heaps around zero; heaps "
        "that stand apart mean that it matters from which side the axis comes. "
        f"Allowed: ±{length(data.tolerance)}{outside}; a {data.unit.word} is {length(data.unit.size)}."
    )
    return figure("Error at rest", caption, chart_slot("rest", "Histogram of the error at the end of the dwell"))


def _how(data: ServoReportData) -> str:
    detail = data.detail
    if not detail:
        return ""
    path = detail.path
    way = path.target - path.start
    side = "right" if way > 0 else "left"
    title = f"Move {count(path.number)}, {length(abs(way))} to the {side}"
    slots = [("move-speed", "Speed over time")]
    if isinstance(detail, PhaseMove):
        slots += [("move-to-go", "Way to go over time"), ("move-drive", "Drive word over time")]
    else:
        slots += [
            ("move-counted", "Counted speed, before and after the filter"),
            ("move-deviation", "Following error over time"),
            ("move-drive", "Drive word over time"),
        ]
    content = "".join(chart_slot(name, label) for name, label in slots)
    whole = figure(title, f"{_why(path.why)} {_move_caption(detail)}", content, ZOOM_HINT + event_table(path.events))
    return section("How the axis did it", whole, _approach_figure(data, detail))


def _why(why: str) -> str:
    return f"Shown is {escape(why)}."


def _move_caption(detail: PhaseMove | FilteredMove) -> str:
    if isinstance(detail, PhaseMove):
        return (
            "Until shortly before the target the speed follows a table of the way still to go, counted in pulses; "
            "then position mode begins, and the phase of the resolver itself says where to stop. Look for: speed on "
            "the dashes while braking, and a drive that comes to rest."
        )
    return (
        "The slide follows the command pulses at a distance that grows with speed: the following error less the speed "
        "word is the drive. Look for: the filtered speed word, smooth where the counted one jumps by whole pulses "
        "times B."
    )


def _approach_figure(data: ServoReportData, detail: PhaseMove | FilteredMove) -> str:
    if not detail.path.approach:
        return ""
    counts = in_counts(data.tolerance, data.unit)
    caption = (
        f"The end of the same move, magnified: position less target, in {data.unit.words} of {length(data.unit.size)}. "
        f"Arrived means within ±{counts} (dashed); the numbers are those above. "
    )
    if isinstance(detail, PhaseMove):
        caption += (
            "Below: the absolute error word, the integral and the drive word that they make with the speed. Look for: "
            "no way back out of the dashed lines, and stillness after the stop."
        )
    else:
        caption += (
            "Below: following error less filtered speed is the drive word. Look for: few swings around the target; "
            "the lag of the filter costs damping."
        )
    content = chart_slot("approach-place", "Position less target over time") + chart_slot(
        "approach-words", "Words of the control over time"
    )
    return figure("Coming to rest", caption, content, ZOOM_HINT)


# ---- table


def _moves(data: ServoReportData) -> str:
    if not data.moves:
        return ""
    labelled = any(move.label for move in data.moves)
    heads = [("move", True), *([("character", False)] if labelled else []), ("start [s]", True), ("from [mm]", True),
             ("to [mm]", True), ("way [mm]", False), ("ready after [ms]", True), ("settled after [ms]", True),
             ("overshoot [µm]", True), ("off target [µm]", True)]  # fmt: skip
    longest = max(abs(move.offset) for move in data.moves) or 1.0
    rows = [_row(data, move, longest, labelled=labelled) for move in data.moves[:MOST_MOVES]]
    caption = (
        f"Ready is what the axis says; settled, within ±{length(data.tolerance)} for good, is what is true. Off "
        "target: at the end of the dwell, plus is to the right of it."
    )
    left_out = len(data.moves) - len(rows)
    if left_out > 0:
        caption += f" {further(left_out, 'move')} in the JSON summary only."
    return section("Move by move", figure("Every move", caption, table(heads, rows, tall=True)))


def _row(data: ServoReportData, move: MoveResult, longest: float, *, labelled: bool) -> list[str]:
    late = not isnan(move.ready) and move.settled > move.ready + 1e-6
    settled = number(move.settled * 1e3)
    way = f"{arrow(1 if move.way > 0 else -1)} {number(abs(move.way) * 1e3, 4)}"
    return [
        count(move.number),
        *([escape(move.label)] if labelled else []),
        f"{move.begin:.3f}",
        f"{move.start * 1e3:.3f}",
        f"{move.target * 1e3:.3f}",
        f'<td class="nowrap">{way if abs(move.way) > data.tolerance else "stays"}</td>',
        number(move.ready * 1e3),
        f'<td class="n over">{settled}</td>' if late or isnan(move.settled) else settled,
        number(move.overshoot * 1e6, 2),
        offset_cell(move.offset * 1e6, longest * 1e6, over=abs(move.offset) > data.tolerance),
    ]
