"""One page about one run: did it print, how well, and how the axis did it.

The page is a single file that needs nothing else: style, script and data are inside, and its own security policy
forbids it to fetch anything. Figures are drawn in the browser by uPlot (MIT, see vendor/) from the data of `charts`.
"""

import json
from collections.abc import Sequence
from html import escape
from importlib import resources
from math import isnan
from pathlib import Path
from string import Template
from typing import Any

from detent import __version__
from detent.errors import DetentError
from detent.report import charts
from detent.report.data import COLUMN, INCH, ColumnErrors, Event, ReportData
from detent.report.words import GAP, arrow, count, duration, inches_per_second, micrometres, number, table

MOST_LINES = 500
"""Lines in the table: more than anybody reads."""

LEVELS = {"error": "Error", "warning": "Warning", "note": "Note"}


def write_report(data: ReportData, path: str | Path) -> None:
    """Write the report of a run as one self-contained HTML file.

    Parameters
    ----------
    data : ReportData
        What to show.
    path : str or Path
        Target; replaced if it exists.

    Raises
    ------
    DetentError
        The file cannot be written.
    """
    path = Path(path)
    part = path.with_name(path.name + ".part")
    try:
        # A file name need not be valid UTF-8; the page must be.
        part.write_text(render_report(data), encoding="utf-8", errors="replace")
        part.replace(path)
    except OSError as error:
        reason = error.strerror or str(error)
        raise DetentError(f"{path}: cannot be written ({reason}); choose another place or make room") from error


def render_report(data: ReportData) -> str:
    """Make the page as text.

    Parameters
    ----------
    data : ReportData
        What to show.

    Returns
    -------
    str
        A whole HTML document.
    """
    paper = charts.page_data(data.marks, data.column_limit) if len(data.marks) else None
    body = [
        _headline(data), _cards(data), _notes(data), _result(data, paper), _path(data), _how(data), _lines(data),
        _settings(data),
    ]  # fmt: skip
    return Template(_asset("template/report.html")).substitute(
        title=escape(f"{data.job_name} on {data.axis_name}: {'printed' if data.printed else 'not printed'}"),
        version=escape(data.version or __version__),
        library_style=_asset("vendor/uPlot.min.css"),
        style=_asset("template/report.css"),
        body="\n".join(body),
        data=_embedded({"charts": _all_charts(data), "paper": paper}),
        library_script=_asset("vendor/uPlot.iife.min.js"),
        script=_asset("template/report.js"),
    )


def _asset(name: str) -> str:
    return resources.files("detent.report").joinpath(name).read_text(encoding="utf-8")


def _embedded(payload: dict[str, Any]) -> str:
    """Give JSON that cannot end its script element, whatever the job printed."""
    text = json.dumps(payload, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def _all_charts(data: ReportData) -> list[charts.Chart]:
    drawn: list[charts.Chart] = []
    if data.errors and data.errors.total:
        drawn.append(charts.histogram_chart(data.errors, data.column_limit))
    if data.path:
        drawn.append(charts.path_chart(data.path))
    if data.profile:
        drawn += charts.profile_charts(data.profile)
    if data.turn_around:
        drawn += charts.turn_charts(data.turn_around)
    return drawn + [charts.identified_chart(line) for line in data.identified]


# ---- what came out, in one glance


def _off_column(data: ReportData) -> int:
    """Count the columns beyond the limit."""
    return data.errors.beyond(data.column_limit) if data.errors else 0


def _headline(data: ReportData) -> str:
    off = _off_column(data)
    if not data.printed:
        badge = '<span class="badge bad">✘ Not printed</span>'
        done = f"{count(len(data.lines))} of {count(data.line_count, 'line')}"
        lead = f"Stopped after {done}, {duration(data.duration)} into the job. {data.failure}"
    else:
        good = '<span class="badge good">✔ Printed</span>'
        badge = '<span class="badge warn">! Printed, but off its columns</span>' if off else good
        lead = (
            f"{count(data.line_count, 'line')} and {count(data.character_count, 'character')} on "
            f"{count(data.page_count, 'page')} in {duration(data.duration)}. {_accuracy(data, off)}"
        )
    return (
        f'<header><p class="kicker">Simulated run of the axis {escape(data.axis_name)}</p>\n'
        f'<h1>{badge} {escape(data.job_name)}</h1>\n<p class="lead">{escape(lead)}</p></header>'
    )


def _accuracy(data: ReportData, off: int) -> str:
    if not data.errors or not data.errors.total:
        return ""
    if off:
        whose = "its" if off == 1 else "their"
        return f"{count(off, 'column')} landed more than {micrometres(data.column_limit)} from {whose} place."
    return f"Every column of dots landed within {micrometres(data.errors.worst)} of its place."


def _card(title: str, value: str, unit: str, below: str, *, bad: bool = False) -> str:
    return (
        f'<div class="card{" bad" if bad else ""}"><dt>{escape(title)}</dt>'
        f'<dd class="value">{value} <small>{escape(unit)}</small></dd><dd class="sub">{escape(below)}</dd></div>'
    )


def _cards(data: ReportData) -> str:
    struck = sum(line.characters for line in data.lines)
    rate = struck / data.duration if data.duration > 0 else None
    done = len(data.lines)
    cards = [
        _card("Lines printed", count(done), f"of {count(data.line_count)}", count(struck, "character"),
              bad=done < data.line_count),
        _card("Throughput", number(rate), "characters/s", f"in {duration(data.duration)}"),
    ]  # fmt: skip
    if data.errors and data.errors.total:
        worst = micrometres(data.errors.worst).partition(GAP)
        cards.append(
            _card("Worst column error", worst[0], worst[2],
                  f"rms {micrometres(data.errors.rms)}, allowed {micrometres(data.column_limit)}",
                  bad=_off_column(data) > 0)
        )  # fmt: skip
    if data.lines:
        fastest = max(line.speed for line in data.lines)
        at_top = sum(line.speed == fastest for line in data.lines)
        turns = sum(line.turn_around for line in data.lines)
        cards += [
            _card("Top print speed", inches_per_second(fastest), "in/s",
                  f"{number(fastest)}{GAP}m/s, in {count(at_top)} of {count(done)} lines"),
            _card("Turn-arounds", count(turns), f"of {count(max(done - 1, 0))}", "line changes without a stop"),
        ]  # fmt: skip
    return f'<dl class="cards">{"".join(cards)}</dl>'


def _notes(data: ReportData) -> str:
    if not data.notes:
        return ""
    order = list(LEVELS)
    notes = sorted(data.notes, key=lambda note: order.index(note.level))
    items = "\n".join(
        f'<li class="note {note.level}"><b>{LEVELS[note.level]}</b>{escape(note.text)}</li>' for note in notes
    )
    return f'<ul class="notes" aria-label="Notes">{items}</ul>'


# ---- figures


def _figure(title: str, caption: str, content: str, after: str = "") -> str:
    """Frame a figure; the caption says what to look at."""
    return f"<figure><figcaption><h3>{escape(title)}</h3><p>{caption}</p></figcaption>\n{content}\n{after}</figure>"


def _chart(name: str, label: str) -> str:
    return f'<div class="chart" id="{name}" role="img" aria-label="{escape(label)}"></div>'


_ZOOM = '<p class="hint">Drag across to zoom in, double-click to zoom out.</p>'


def _result(data: ReportData, paper: dict[str, Any] | None) -> str:
    if paper is None:
        return ""
    return "\n".join(["<h2>What came out</h2>", _paper_figure(paper), _histogram_figure(data, data.errors)])


def _paper_figure(paper: dict[str, Any]) -> str:
    left_out: int = paper["leftOut"]
    pages: int = len(paper["pages"])
    factor = count(paper["magnify"])
    controls = (
        '<span class="group"><button id="true-size" aria-pressed="true">True size</button>'
        f'<button id="magnified" aria-pressed="false">Errors × {factor}</button></span>'
    )
    if pages > 1:
        controls += (
            '<span class="group"><button id="page-back" disabled aria-label="page before">\u2039</button>'
            '<button id="page-next" aria-label="next page">\u203a</button></span><span id="page-label"></span>'
        )
    caption = (
        "Each character stands where it landed. At the margin: the line's number and the direction in which it was "
        f"printed, {arrow(1)} or {arrow(-1)}. <b>Errors × {factor}</b> moves every character so many times too far, "
        "so that the errors can be seen."
    )
    if left_out:
        caption += f" {count(left_out, 'further page')} {'is' if left_out == 1 else 'are'} not drawn."
    content = f'<div class="controls">{controls}</div><div class="paper" id="paper" tabindex="0"></div>'
    return _figure("The printed page", caption, content)


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
    chart = _chart("histogram", "Histogram of column errors, printed to the right and to the left")
    return _figure("Column errors", caption, chart)


def _path(data: ReportData) -> str:
    if not data.path:
        return ""
    travel = number(data.path.travel / INCH, 3)
    caption = (
        f"The head between the frames (0 to {travel}{GAP}in). Thick: printing, "
        '<span class="right">to the right</span> or <span class="left">to the left</span>. Thin: the way between. '
        "Look for: long thin stretches are time without print."
    )
    whole = data.path.t[-1] - data.path.t[0] <= charts.PATH_SECONDS
    title = "The whole job" if whole else f"The first {charts.PATH_SECONDS:g} seconds of {duration(data.duration)}"
    chart = _chart("path", "Head position over time, printing marked")
    return "<h2>Where the head was</h2>\n" + _figure(title, caption, chart, _ZOOM)


def _how(data: ReportData) -> str:
    figures = [_profile_figure(data), _turn_figure(data), _identified_figure(data), _constants(data)]
    shown = [figure for figure in figures if figure]
    return "\n".join(["<h2>How the axis did it</h2>", *shown]) if shown else ""


def _event_table(events: Sequence[Event]) -> str:
    if not events:
        return ""
    rows = [
        (f'<span class="number">{index}</span>', f"{event.t * 1e3:.1f}", escape(event.text),
         "" if event.drive is None else number(event.drive))
        for index, event in enumerate(events, 1)
    ]  # fmt: skip
    return table([("", False), ("time [ms]", True), ("what happens", False), ("drive after [count]", True)], rows)


def _profile_figure(data: ReportData) -> str:
    profile = data.profile
    if not profile:
        return ""
    caption = (
        "Above: the speed. Below: the drive value the axis computer sent, 300 counts being the full supply. "
        "The drive is a sum: friction + back-EMF (grows with speed) + a fixed IR part, added while speeding up, "
        "subtracted while slowing down. Look for: speed on the dashed line, flat while printing."
    )
    content = _chart("profile-speed", "Speed over time") + _chart("profile-drive", "Drive value over time")
    direction = "right" if profile.direction > 0 else "left"
    title = f"Line {profile.line}, printed to the {direction}: speed and drive"
    return _figure(title, caption, content, _ZOOM + _event_table(profile.events))


def _turn_figure(data: ReportData) -> str:
    turn = data.turn_around
    if not turn:
        return ""
    caption = (
        "The motor current while the head reverses. Nothing measures it: the drive ramp alone keeps it level. "
        "Look for: two level stretches - braking, then speeding up, where friction adds to the work - and no step "
        "where the transition ends."
    )
    content = _chart("turn-current", "Motor current over time") + _chart("turn-speed", "Speed over time")
    title = f"Turn-around from line {turn.line_from} to line {turn.line_to}: motor current"
    return _figure(title, caption, content, _ZOOM + _event_table(turn.events))


def _identified_figure(data: ReportData) -> str:
    if not data.identified:
        return ""
    panels: list[str] = []
    for line in data.identified:
        name = "right" if line.direction > 0 else "left"
        chart = _chart(f"identified-{name}", f"Drive value over speed, to the {name}")
        panels.append(f'<div><p class="chart-title">To the {name}</p>{chart}</div>')
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
    return _figure("What the axis knows of itself", caption, f'<div class="pair">{"".join(panels)}</div>')


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
    return _figure(
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
            _error_cell(line.worst_error, scale, data.column_limit),
            number(line.rms_error * 1e6, 2),
        )
        for line in data.lines[:MOST_LINES]
    ]
    caption = "Time runs from the command to zero speed. The bar compares the lines with one another."
    left_out = len(data.lines) - len(rows)
    if left_out > 0:
        caption += f" {count(left_out, 'further line')} {'is' if left_out == 1 else 'are'} in the JSON summary only."
    return "<h2>Line by line</h2>\n" + _figure("Every line", caption, table(heads, rows, tall=True))


def _error_cell(error: float, scale: float, limit: float) -> str:
    if isnan(error):
        return '<td class="n">\u2013</td>'
    kind = "n over" if error > limit else "n"
    bar = f'<span class="bar" style="width:{48 * error / scale:.0f}px"></span>'
    return f'<td class="{kind}">{bar}{number(error * 1e6, 2)}</td>'


def _settings(data: ReportData) -> str:
    rows = "".join(f"<dt>{escape(name)}</dt><dd>{escape(value)}</dd>" for name, value in data.settings.items())
    head = f'<h2>How this run was made</h2>\n<dl class="settings">{rows}</dl>' if rows else ""
    version = escape(data.version or __version__)
    return f"{head}<footer>Written by detent {version}. This file is complete: it loads nothing.</footer>"
