"""The page about a list of moves on a cascade axis: did it follow, did it arrive, and what it took."""

import math
from html import escape

from detent.methods.cascade.charts import detail_charts, job_charts, rest_events
from detent.methods.cascade.comparison_section import comparison_charts, comparison_section
from detent.methods.cascade.page_data import CascadeReportData
from detent.methods.cascade.report import milliseconds
from detent.methods.cascade.run import CascadeMove
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
from detent.page.words import GAP, bar_cell, count, duration, further, number, offset_cell, table

MOST_MOVES = 500
"""Moves in the table: more than anybody reads."""


def make_cascade_page(data: CascadeReportData) -> Page:
    """What the page is made of."""
    drawn = all_charts(data)
    return {
        "title": f"{data.run.job.name} on {data.axis_name}: {'done' if data.run.done else 'not done'}",
        "body": [
            _headline(data), _cards(data), notes(data.notes), _job(data), _detail(data, drawn),
            comparison_section(data.comparison), _moves(data), small_print(data.settings),
        ],
        "charts": drawn,
        "version": data.version,
    }  # fmt: skip


def all_charts(data: CascadeReportData) -> list[Chart]:
    """Every chart of the page."""
    return [*job_charts(data), *detail_charts(data), *comparison_charts(data.comparison)]


# ---- what came out, in one glance


def _headline(data: CascadeReportData) -> str:
    run, error = data.run, data.units.error
    kicker = f"Simulated run of the axis {data.axis_name}"
    seconds = duration(max(run.time_end - run.time_ready, 0.0))
    if not run.done:
        arrived = count(sum(move.in_position for move in run.moves))
        lead = f"Stopped after {arrived} of {count(run.job.count, 'move')}, {seconds} in. "
        lead += f"{run.failure[:1].upper()}{run.failure[1:].rstrip('.')}."
        return headline("bad", "Not done", run.job.name, kicker=kicker, lead=lead)
    lead = f"{count(run.job.count, 'move')} in {seconds}. "
    lead += f"On the way the axis was never more than {error(run.worst_following)} from where it should be"
    if run.worst_error > run.tolerance:
        lead += f", but the load stood up to {error(run.worst_error)} beside its target while the loop was in position."
        return headline("warn", "Done, but beside its targets", run.job.name, kicker=kicker, lead=lead)
    lead += f"; at the end of each move the load stood within {error(run.worst_error)} of its target."
    return headline("good", "Every move in position", run.job.name, kicker=kicker, lead=lead)


def _cards(data: CascadeReportData) -> str:
    run = data.run
    arrived = sum(move.in_position for move in run.moves)
    seconds, _, unit = duration(max(run.time_end - run.time_ready, 0.0)).partition(GAP)
    shown = [
        Card("Moves in position", count(arrived), f"of {count(run.job.count)}", "", bad=not run.done),
        Card("Time", seconds, unit, "dwells included" if run.done else "until it stopped"),
    ]
    if not run.moves:
        return cards(shown)
    settled = [move for move in run.moves if not math.isnan(move.settling)]
    if settled:
        worst = max(settled, key=lambda move: move.settling)
        value, _, unit = milliseconds(worst.settling).partition(GAP)
        below = f"after the reference's end, within {data.units.error(run.tolerance)}; {_whose(worst)}"
        shown.append(Card("Longest settling", value, unit, below))
    worst = max(run.moves, key=lambda move: move.peak_following)
    limit = f"{_whose(worst)}; the drive goes off at {data.units.error(data.following_limit)}"
    beyond = worst.peak_following > data.following_limit
    shown.append(_error_card(data, "Largest following error", worst.peak_following, limit, bad=beyond))
    if arrived:
        worst = max((move for move in run.moves if move.in_position), key=lambda move: abs(move.error))
        off = abs(worst.error) > run.tolerance
        shown.append(
            _error_card(data, "Worst error at rest", abs(worst.error), f"of the load, {_whose(worst)}", bad=off)
        )
    worst = max(run.moves, key=lambda move: move.peak_command)
    limited = sum(move.limited for move in run.moves)
    below = f"of {number(run.max_command)} V, {_whose(worst)}"
    below += f"; at its limit for {milliseconds(limited)}" if limited else ""
    shown.append(Card("Peak command", number(worst.peak_command), "V", below))
    return cards(shown)


def _error_card(data: CascadeReportData, title: str, value: float, below: str, *, bad: bool) -> Card:
    shown, _, unit = data.units.error(value).partition(GAP)
    return Card(title, shown, unit, below, bad=bad)


def _whose(move: CascadeMove) -> str:
    return f"move {count(move.number)}"


# ---- figures


def _job(data: CascadeReportData) -> str:
    if data.path is None:
        return ""
    caption = (
        "Above: where the axis should be (dashed) and where the load is. Below: the following error, reference less "
        "what the position loop measures, and the command to the drive. Look for: peaks of the error, and whether the "
        "command comes near its limit."
    )
    content = (
        chart_slot("job-position", "Reference and position of the load over time")
        + chart_slot("job-following", "Following error over time")
        + chart_slot("job-command", "Command over time")
    )
    return section("The whole job", figure("Position, following error and command", caption, content, ZOOM_HINT))


def _detail(data: CascadeReportData, drawn: list[Chart]) -> str:
    detail = data.detail
    if detail is None:
        return ""
    caption = f"Shown is {escape(detail.why)}."
    if data.run.done:
        caption += " Look for: how soon the load is at rest once its reference is, and the command where it sets off."
    content = (
        chart_slot("move-position", "Reference and position of the load over time")
        + chart_slot("move-speed", "Velocity of the reference and of the load over time")
        + chart_slot("move-following", "Following error over time")
        + chart_slot("move-command", "Command over time")
    )
    figures = [
        figure(f"Move {count(detail.number)}", caption, content, ZOOM_HINT + event_table(detail.events)),
    ]
    if any(chart["id"] == "move-rest" for chart in drawn):
        caption = (
            f"The end of the same move, magnified: how far the load is from the target. Between the dashed lines, "
            f"±{data.units.error(data.run.tolerance)}, it counts as in position."
        )
        content = chart_slot("move-rest", "Distance of the load from the target over time")
        figures.append(figure("Coming to rest", caption, content, ZOOM_HINT + event_table(rest_events(detail))))
    return section("One move in detail", *figures)


# ---- table


def _moves(data: CascadeReportData) -> str:
    run, units = data.run, data.units
    if not run.moves:
        return ""
    scale = units.small(max(run.worst_error, run.worst_overshoot))
    lag = units.small(run.worst_following)
    place = units.place.name
    heads = [("move", True), ("begin [s]", True), (f"from [{place}]", True), (f"to [{place}]", True),
             ("reference [ms]", True), ("settles after [ms]", True), (f"following error [{lag.name}]", True),
             (f"overshoot [{scale.name}]", True), (f"off target [{scale.name}]", True), ("peak command [V]", True),
             ("in position", False)]  # fmt: skip
    rows = [_row(data, move) for move in run.moves[:MOST_MOVES]]
    caption = (
        "The reference takes its time; then the load settles within the window. Following error is the largest of the "
        "move; off target is position of the load less target at the end of the move."
    )
    left_out = len(run.moves) - len(rows)
    if left_out > 0:
        caption += f" {further(left_out, 'move')} in the JSON summary only."
    return section("Move by move", figure("Every move", caption, table(heads, rows, tall=True)))


def _row(data: CascadeReportData, move: CascadeMove) -> list[str]:
    run, units = data.run, data.units
    scale = units.small(max(run.worst_error, run.worst_overshoot)).factor
    lag = units.small(run.worst_following).factor
    longest = max(run.worst_following * lag, 1e-12)
    off = max(run.worst_error * scale, 1e-12)
    return [
        count(move.number),
        f"{move.begin - run.time_ready:.3f}",
        units.position(move.start),
        units.position(move.target),
        number(round((move.arrived - move.begin) * 1e3, 6)),
        number(round(move.settling * 1e3, 6)),
        bar_cell(move.peak_following * lag, longest, over=move.peak_following > data.following_limit),
        number(move.overshoot * scale, 2),
        offset_cell(-move.error * scale, off, over=abs(move.error) > run.tolerance),
        number(move.peak_command),
        "✔" if move.in_position else '<td class="over">✘ no</td>',
    ]
