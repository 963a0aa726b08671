"""The page about a run of a print head: did it print, how well, and how the axis did it."""

from html import escape
from math import isnan
from typing import Any

from detent.methods.print_head import charts as print_charts
from detent.methods.print_head.page_data import COLUMN, ColumnErrors, ReportData
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
    side_by_side,
    small_print,
)
from detent.page.paper import printed_pages
from detent.page.parts import INCH
from detent.page.words import (
    GAP,
    arrow,
    bar_cell,
    count,
    duration,
    further,
    inches_per_second,
    micrometres,
    number,
    table,
)

MOST_LINES = 500
"""Lines in the table: more than anybody reads."""


def make_print_page(data: ReportData) -> Page:
    """What the page is made of."""
    paper = printed_pages(data.marks, data.column_limit) if len(data.marks) else None
    return {
        "title": f"{data.job_name} on {data.axis_name}: {'printed' if data.printed else 'not printed'}",
        "body": [
            _headline(data), _cards(data), notes(data.notes), _result(data, paper), _path(data), _how(data),
            _lines(data), small_print(data.settings),
        ],
        "charts": _all_charts(data),
        "paper": paper,
        "version": data.version,
    }  # fmt: skip


def _all_charts(data: ReportData) -> list[Chart]:
    drawn: list[Chart] = []
    if data.errors and data.errors.total:
        drawn.append(print_charts.column_chart(data.errors, data.column_limit))
    if data.path:
        drawn.append(print_charts.path_chart(data.path))
    if data.profile:
        drawn += print_charts.profile_charts(data.profile)
    if data.turn_around:
        drawn += print_charts.turn_charts(data.turn_around)
    return drawn + [print_charts.identified_chart(line) for line in data.identified]


# ---- what came out, in one glance


def _off_column(data: ReportData) -> int:
    """Count the columns beyond the limit."""
    return data.errors.beyond(data.column_limit) if data.errors else 0


def _headline(data: ReportData) -> str:
    off = _off_column(data)
    kicker = f"Simulated run of the axis {data.axis_name}"
    if not data.printed:
        done = f"{count(len(data.lines))} of {count(data.line_count, 'line')}"
        lead = f"Stopped after {done}, {duration(data.duration)} into the job. {data.failure}"
        return headline("bad", "Not printed", data.job_name, kicker=kicker, lead=lead)
    lead = (
        f"{count(data.line_count, 'line')} and {count(data.character_count, 'character')} on "
        f"{count(data.page_count, 'page')} in {duration(data.duration)}. {_accuracy(data, off)}"
    )
    if off:
        return headline("warn", "Printed, but off its columns", data.job_name, kicker=kicker, lead=lead)
    return headline("good", "Printed", data.job_name, kicker=kicker, lead=lead)


def _accuracy(data: ReportData, off: int) -> str:
    if not data.errors or not data.errors.total:
        return ""
    if off:
        whose = "its" if off == 1 else "their"
        return f"{count(off, 'column')} landed more than {micrometres(data.column_limit)} from {whose} place."
    return f"Every column of dots landed within {micrometres(data.errors.worst)} of its place."


def _cards(data: ReportData) -> str:
    struck = sum(line.characters for line in data.lines)
    rate = struck / data.duration if data.duration > 0 else None
    done = len(data.lines)
    shown = [
        Card("Lines printed", count(done), f"of {count(data.line_count)}", count(struck, "character"),
              bad=done < data.line_count),
        Card("Throughput", number(rate), "characters/s", f"in {duration(data.duration)}"),
    ]  # fmt: skip
    if data.errors and data.errors.total:
        worst = micrometres(data.errors.worst).partition(GAP)
        shown.append(
            Card("Worst column error", worst[0], worst[2],
                  f"rms {micrometres(data.errors.rms)}, allowed {micrometres(data.column_limit)}",
                  bad=_off_column(data) > 0)
        )  # fmt: skip
    if data.lines:
        fastest = max(line.speed for line in data.lines)
        at_top = sum(line.speed == fastest for line in data.lines)
        turns = sum(line.turn_around for line in data.lines)
        shown += [
            Card("Top print speed", inches_per_second(fastest), "in/s",
                  f"{number(fastest)}{GAP}m/s, in {count(at_top)} of {count(done)} lines"),
            Card("Turn-arounds", count(turns), f"of {count(max(done - 1, 0))}", "line changes without a stop"),
        ]  # fmt: skip
    return cards(shown)


# ---- figures


def _result(data: ReportData, paper: dict[str, Any] | None) -> str:
    if paper is None:
        return ""
    return section("What came out", _paper_figure(paper), _histogram_figure(data, data.errors))


def _paper_figure(paper: dict[str, Any]) -> str:
    caption = (
        "Each character stands where it landed. At the margin: the line's number and the direction in which it was "
        f"printed, {arrow(1)} or {arrow(-1)}."
    )
    return paper_figure("The printed page", caption, paper)


def _histogram_figure(data: ReportData, errors: ColumnErrors | None) -> str:
    if errors is None or not errors.total:
        return ""
    limit = micrometres(data.column_limit)
    outside = " (outside the figure)" if errors.worst < data.column_limit / 1.5 else ""
    caption = (
        "How far from its place each column of dots landed. Look for: two narrow heaps in the same place. Heaps that "
        "stand apart mean that lines printed to the right and to the left do not line up. "
        f"Allowed: ±{limit}{outside}; the finest column grid is {micrometres(COLUMN)} (1/120{GAP}in)."
    )
    chart = chart_slot("histogram", "Histogram of column errors, printed to the right and to the left")
    return figure("Column errors", caption, chart)


def _path(data: ReportData) -> str:
    if not data.path:
        return ""
    travel = number(data.path.travel / INCH, 3)
    caption = (
        f"The head between the frames (0 to {travel}{GAP}in). Thick: printing, "
        '<span class="right">to the right</span> or <span class="left">to the left</span>. Thin: the way between. '
        "Look for: long thin stretches are time without print."
    )
    whole = data.path.t[-1] - data.path.t[0] <= print_charts.PATH_SECONDS
    title = (
        "The whole job" if whole else f"The first {print_charts.PATH_SECONDS:g} seconds of {duration(data.duration)}"
    )
    chart = chart_slot("path", "Head position over time, printing marked")
    return section("Where the head was", figure(title, caption, chart, ZOOM_HINT))


def _how(data: ReportData) -> str:
    figures = [_profile_figure(data), _turn_figure(data), _identified_figure(data), _constants(data)]
    return section("How the axis did it", *figures)


def _profile_figure(data: ReportData) -> str:
    profile = data.profile
    if not profile:
        return ""
    caption = (
        "Above: the speed. Below: the drive value the axis computer sent, 300 counts being the full supply. "
        "The drive is a sum: friction + back-EMF (grows with speed) + a fixed IR part, added while speeding up, "
        "subtracted while slowing down. Look for: speed on the dashed line, flat while printing."
    )
    content = chart_slot("profile-speed", "Speed over time") + chart_slot("profile-drive", "Drive value over time")
    direction = "right" if profile.direction > 0 else "left"
    title = f"Line {profile.line}, printed to the {direction}: speed and drive"
    return figure(title, caption, content, ZOOM_HINT + event_table(profile.events))


def _turn_figure(data: ReportData) -> str:
    turn = data.turn_around
    if not turn:
        return ""
    caption = (
        "The motor current while the head reverses. Nothing measures it: the drive ramp alone keeps it level. "
        "Look for: two level stretches - braking, then speeding up, where friction adds to the work - and no step "
        "where the transition ends."
    )
    content = chart_slot("turn-current", "Motor current over time") + chart_slot("turn-speed", "Speed over time")
    title = f"Turn-around from line {turn.line_from} to line {turn.line_to}: motor current"
    return figure(title, caption, content, ZOOM_HINT + event_table(turn.events))


def _identified_figure(data: ReportData) -> str:
    if not data.identified:
        return ""
    names = ["right" if line.direction > 0 else "left" for line in data.identified]
    charts = {
        f"To the {name}": chart_slot(f"identified-{name}", f"Drive value over speed, to the {name}") for name in names
    }
    measured = any(line.points for line in data.identified)
    known = (
        "At power-up the axis ran at two drive values and measured the speeds (circles); the line through them gives "
        "the drive for every other speed. "
    )
    caption = (
        "The drive value that holds a speed. "
        + (known if measured else "The axis was not identified: these are its defaults. ")
        + "Where it meets the axis is the drive that overcomes friction. Look for: the line on the dashed truth."
    )
    return figure("What the axis knows of itself", caption, side_by_side(charts))


def _constants(data: ReportData) -> str:
    if not data.constants:
        return ""
    rows = [
        (
            escape(row.name) + (f'<br><span class="kicker">{escape(row.meaning)}</span>' if row.meaning else ""),
            number(row.identified, 4),
            number(row.true, 4),
            _deviation(row.identified, row.true),
            escape(row.unit),
        )
        for row in data.constants
    ]
    heads = [("constant", False), ("identified", True), ("true", True), ("difference", True), ("unit", False)]
    return figure(
        "Constants of the axis", "As the axis measured them, and as the simulated machine has them.", table(heads, rows)
    )


def _deviation(identified: float | None, true: float | None) -> str:
    if identified is None or true is None:
        return "\u2013"
    difference = identified - true
    text = ("+" if difference > 0 else "") + number(difference, 2)
    return f"{text} ({100 * difference / abs(true):+.1f}{GAP}%)".replace("-", "\u2212") if true else text


# ---- tables at the end


def _lines(data: ReportData) -> str:
    if not data.lines:
        return ""
    heads = [("line", True), ("printed", False), ("speed [in/s]", True), ("reached by", False), ("start [s]", True),
             ("time [s]", True), ("characters", True), ("worst error [µm]", True), ("rms [µm]", True)]  # fmt: skip
    scale = max((line.worst_error for line in data.lines if not isnan(line.worst_error)), default=0.0) or 1.0
    rows = [
        (
            str(line.number),
            arrow(line.direction),
            inches_per_second(line.speed),
            f'<td class="nowrap">{"turn-around" if line.turn_around else "standing start"}</td>',
            f"{line.start:.3f}",
            f"{line.stop - line.start:.3f}",
            count(line.characters),
            bar_cell(line.worst_error * 1e6, scale * 1e6, over=line.worst_error > data.column_limit),
            number(line.rms_error * 1e6, 2),
        )
        for line in data.lines[:MOST_LINES]
    ]
    caption = "Time runs from the command to zero speed. The bar compares the lines with one another."
    left_out = len(data.lines) - len(rows)
    if left_out > 0:
        caption += f" {further(left_out, 'line')} in the JSON summary only."
    return section("Line by line", figure("Every line", caption, table(heads, rows, tall=True)))
