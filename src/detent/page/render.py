"""Pages as HTML: a single file that needs nothing else, made by the templates in template/.

Style, script and data are inside, and the page's own security policy forbids it to fetch anything. Figures are drawn in
the browser by uPlot (MIT, see vendor/). The templates escape everything that is not `Markup`.
"""

import json
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any, cast

from jinja2 import Environment, PackageLoader, StrictUndefined, Template
from markupsafe import Markup

from detent import __version__
from detent.files.text import shown, write_text
from detent.page.figure import about
from detent.page.frame import Page
from detent.page.words import further

LEVELS = {"error": "Error", "warning": "Warning", "note": "Note"}  # of notes, in the order of the page
SIGNS = {"good": "✔", "warn": "!", "bad": "✘"}

FOR_THE_PAGE = {"title", "about"}  # what is said of a chart outside the plot area


def write_page(path: str | Path, page: Page, *, force: bool = False) -> None:
    """Write a page as one self-contained HTML file, in place of one that is there; DetentError if that fails."""
    write_text(path, render_page(page), force=force)


def render_page(page: Page) -> str:
    """A whole HTML document."""
    order = list(LEVELS)
    made = _template().render(
        page=page,
        notes=sorted(page.notes, key=lambda note: order.index(note.level)),
        charts=[{key: value for key, value in chart.items() if key not in FOR_THE_PAGE} for chart in page.charts],
        version=__version__,
        signs=SIGNS,
        levels=LEVELS,
        asset=_asset,
        embedded=_embedded,
        about=about,
        further=further,
    )
    return shown(made)


@cache
def _template() -> Template:
    made = Environment(
        loader=PackageLoader("detent.page", "template"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
        keep_trailing_newline=True,
    )
    return made.get_template("page.html.j2")


def _asset(name: str) -> Markup:
    return Markup(resources.files("detent.page").joinpath(name).read_text(encoding="utf-8"))  # noqa: S704 - our own


def _embedded(name: str, payload: dict[str, Any]) -> Markup:
    """JSON in a script element that it cannot end, whatever it says."""
    text = json.dumps(_shown(payload), ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    safe = text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")
    return Markup(f'<script type="application/json" id="{name}">{safe}</script>')  # noqa: S704 - escaped above


def _shown(data: Any) -> Any:
    """The same data, its texts as they may be shown."""
    if isinstance(data, str):
        return shown(data)
    if isinstance(data, dict):
        return {key: _shown(value) for key, value in cast("dict[str, Any]", data).items()}
    if isinstance(data, list | tuple) and not (data and isinstance(data[0], int | float)):  # not what a curve holds
        return [_shown(one) for one in cast("list[Any]", data)]
    return cast("Any", data)
