"""The page that a report is: its shell, and the parts that every report is put together from.

A page is a single file that needs nothing else: style, script and data are inside, and its own security policy forbids
it to fetch anything. Figures are drawn in the browser by uPlot (MIT, see vendor/) from the data of `chart`.

What is called text here is escaped here; what is called HTML is taken as it is, and its maker has escaped what is not
his own.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib import resources
from pathlib import Path
from string import Template
from typing import Any, Literal, NotRequired, TypedDict

from detent import __version__
from detent.errors import DetentError
from detent.page import frame, render
from detent.page.chart import SCALES, Chart
from detent.page.frame import Card
from detent.page.parts import Event, Note
from detent.page.words import count, further, number, table

LEVELS = {"error": "Error", "warning": "Warning", "note": "Note"}

SIGNS = {"good": "✔", "warn": "!", "bad": "✘"}

ZOOM_HINT = '<p class="hint">Drag across to zoom in, double-click to zoom out.</p>'
"""Stands below figures over time."""


class Page(TypedDict):
    """What a page is made of."""

    title: str  # title of the window, as text
    # headline, cards, notes, sections and small print as HTML, from top to bottom; empty ones leave no trace
    body: Sequence[str]
    charts: Sequence[Chart]  # charts, each drawn in the slot of its id
    # the printed page, drawn by template/paper.js in the element "paper"; None if nothing is on paper
    paper: NotRequired[dict[str, Any] | None]
    version: NotRequired[str]  # of detent; the package's own if empty


def write_page(path: str | Path, page: Page | frame.Page) -> None:
    """Write a page as one self-contained HTML file."""
    if isinstance(page, frame.Page):
        render.write_page(path, page)
        return
    path = Path(path)
    part = path.with_name(path.name + ".part")
    try:
        # A file name need not be valid UTF-8; the page must be.
        part.write_text(render_page(page), encoding="utf-8", errors="replace")
        part.replace(path)
    except OSError as error:
        reason = error.strerror or str(error)
        raise DetentError(f"{path}: cannot be written ({reason}); choose another place or make room") from error


def render_page(page: Page) -> str:
    """Make a page as text."""
    paper = page.get("paper")
    return Template(_asset("template/report.html")).substitute(
        title=escape(page["title"]),
        version=escape(page.get("version") or __version__),
        library_style=_asset("vendor/uPlot.min.css"),
        style=_asset("template/report.css"),
        body="\n".join(part for part in page["body"] if part),
        data=_embedded("report-data", {"charts": list(page["charts"])}),
        library_script=_asset("vendor/uPlot.iife.min.js"),
        script=_asset("template/report.js"),
        paper=f"{_embedded('paper-data', paper)}\n<script>{_asset('template/paper.js')}</script>\n" if paper else "",
    )


def _asset(name: str) -> str:
    return resources.files("detent.page").joinpath(name).read_text(encoding="utf-8")


def _embedded(name: str, payload: dict[str, Any]) -> str:
    """Give JSON in a script element that it cannot end, whatever it says."""
    text = json.dumps(payload, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    safe = text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")
    return f'<script type="application/json" id="{name}">{safe}</script>'


# ---- what came out, in one glance


def headline(level: Literal["good", "warn", "bad"], verdict: str, name: str, *, kicker: str, lead: str) -> str:
    """Say what happened: a badge and a name, and one or two sentences below them."""
    badge = f'<span class="badge {level}">{SIGNS[level]} {escape(verdict)}</span>'
    return (
        f'<header><p class="kicker">{escape(kicker)}</p>\n'
        f'<h1>{badge} {escape(name)}</h1>\n<p class="lead">{escape(lead)}</p></header>'
    )


def cards(shown: Iterable[Card]) -> str:
    """Place cards side by side."""
    items = "".join(
        f'<div class="card{" bad" if card.bad else ""}"><dt>{escape(card.title)}</dt>'
        f'<dd class="value">{escape(card.value)} <small>{escape(card.unit)}</small></dd>'
        f'<dd class="sub">{escape(card.below)}</dd></div>'
        for card in shown
    )
    return f'<dl class="cards">{items}</dl>'


def notes(told: Sequence[Note]) -> str:
    """List notes, errors first, then warnings."""
    order = list(LEVELS)
    items = "\n".join(
        f'<li class="note {note.level}"><b>{LEVELS[note.level]}</b>{escape(note.text)}</li>'
        for note in sorted(told, key=lambda note: order.index(note.level))
    )
    return f'<ul class="notes" aria-label="Notes">{items}</ul>' if items else ""


# ---- sections, figures, tables


def section(title: str, *figures: str) -> str:
    """Put figures under a title."""
    shown = [figure for figure in figures if figure]
    return "\n".join([f"<h2>{escape(title)}</h2>", *shown]) if shown else ""


def figure(title: str, caption: str, content: str, after: str = "") -> str:
    """Frame charts or a table under a title and a caption that says what to look at."""
    return f"<figure><figcaption><h3>{escape(title)}</h3><p>{caption}</p></figcaption>\n{content}\n{after}</figure>"


def paper_figure(title: str, caption: str, paper: Mapping[str, Any]) -> str:
    """Frame the printed page, with the buttons that template/paper.js serves."""
    factor, left_out = count(paper["magnify"]), int(paper["leftOut"])
    controls = (
        '<span class="group"><button id="true-size" aria-pressed="true">True size</button>'
        f'<button id="magnified" aria-pressed="false">Errors × {factor}</button></span>'
    )
    if len(paper["pages"]) > 1:
        controls += (
            '<span class="group"><button id="page-back" disabled aria-label="page before">\u2039</button>'
            '<button id="page-next" aria-label="next page">\u203a</button></span><span id="page-label"></span>'
        )
    caption += f" <b>Errors × {factor}</b> moves every character so many times too far, so that the errors can be seen."
    if left_out:
        caption += f" {further(left_out, 'page')} not drawn."
    content = f'<div class="controls">{controls}</div><div class="paper" id="paper" tabindex="0"></div>'
    return figure(title, caption, content)


def chart_slot(name: str, label: str) -> str:
    """Make the place where a chart is drawn."""
    return f'<div class="chart" id="{escape(name)}" role="img" aria-label="{escape(label)}"></div>'


def side_by_side(shown: Mapping[str, str]) -> str:
    """Place charts beside one another, where the screen is wide enough."""
    items = "".join(f'<div><p class="chart-title">{escape(title)}</p>{slot}</div>' for title, slot in shown.items())
    return f'<div class="pair">{items}</div>'


def event_table(events: Sequence[Event], unit: Literal["ms", "s"] = "ms") -> str:
    """List the numbered moments of a figure."""
    if not events:
        return ""
    scale, digits = SCALES[unit]
    heads = [("", False), (f"time [{unit}]", True), ("what happens", False)]
    driven = any(event.drive is not None for event in events)
    rows = [
        [f'<span class="number">{index}</span>', f"{event.t * scale:.{digits - 2}f}", escape(event.text)]
        + (["" if event.drive is None else number(event.drive)] if driven else [])
        for index, event in enumerate(events, 1)
    ]
    return table(heads + [("drive after [count]", True)] * driven, rows)


def small_print(settings: Mapping[str, str]) -> str:
    """Say how the run was made, at the end of the page."""
    rows = "".join(f"<dt>{escape(name)}</dt><dd>{escape(value)}</dd>" for name, value in settings.items())
    return section("How this run was made", f'<dl class="settings">{rows}</dl>' if rows else "")
