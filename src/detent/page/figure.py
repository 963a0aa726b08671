"""A figure is one object: title, caption, and what is drawn or written below them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from markupsafe import Markup

from detent.page.chart import SCALES, Chart
from detent.page.parts import Event
from detent.page.table import Table
from detent.page.words import number


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """Charts, a table or a drawing under a title and a caption that says what to look for.

    Text is escaped unless it is `Markup`. Charts stand above one another, each under its own "title" if it has one, or
    `beside` one another where the screen is wide enough. `events` are listed with the numbers that they have in the
    charts, below a `hint`. `drawing` is ready-made SVG or HTML; `paper` a printed page as `page.paper` makes it. A
    figure of nothing leaves no trace on the page.
    """

    title: str
    caption: str = ""
    charts: Sequence[Chart] = ()
    table: Table | None = None
    events: Sequence[Event] = ()
    beside: bool = False
    hint: str = ""
    drawing: Markup | None = None
    paper: Mapping[str, Any] | None = None

    def __bool__(self) -> bool:
        return bool(self.charts or self.table or self.drawing or self.paper)

    @property
    def zooms(self) -> bool:
        """Whether the reader may drag across a chart: those over time, and those with loops."""
        return any("sync" in chart or "loops" in chart for chart in self.charts)

    @property
    def event_table(self) -> Table | None:
        """The numbered moments in the unit of the charts, with the drive only if one of them has it."""
        if not self.events:
            return None
        unit: Literal["ms", "s"] = "s" if any(chart["xLabel"].endswith("[s]") for chart in self.charts) else "ms"
        scale, digits = SCALES[unit]
        driven = any(event.drive is not None for event in self.events)
        heads = [("", False), (f"time [{unit}]", True), ("what happens", False)]
        rows = [
            [Markup('<span class="number">{}</span>').format(index), f"{event.t * scale:.{digits - 2}f}", event.text]
            + (["" if event.drive is None else number(event.drive)] if driven else [])
            for index, event in enumerate(self.events, 1)
        ]
        return Table(heads=heads + [("drive after [count]", True)] * driven, rows=rows)


def about(chart: Chart) -> str:
    """What a chart shows, for those who cannot see it."""
    return chart.get("about") or f"{chart.get('yLabel', 'lanes')} over {chart['xLabel']}"
