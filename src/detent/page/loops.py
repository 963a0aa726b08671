"""Curves that go to and fro as data for the script of a page: speed against position, for one."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from detent.page.chart import Chart, Curve, Panel, line_chart, rounded
from detent.page.parts import Numbers


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop:
    """A curve whose places need not rise."""

    label: str  # and colour: as of a curve; loops of one label have one line in the legend
    colour: str
    x: Numbers  # and y: finite places and values in the units of the chart, shape (n,)
    y: Numbers
    width: float = 2.0  # width of the line [px]
    digits: int = 3  # digits of values kept after the point


def loop_chart(panel: Panel, x: Numbers, label: str, loops: Sequence[Loop], *, digits: int = 4) -> Chart:
    """Draw curves over any horizontal axis, and loops above them."""
    chart = line_chart(panel, x, label, digits=digits)
    named = {loop.label: loop for loop in loops}
    nothing = np.full(len(x), np.nan)
    legend = [Curve(label=loop.label, colour=loop.colour, width=loop.width, y=nothing) for loop in named.values()]
    chart["series"] += line_chart(Panel(name="", label="", curves=legend), x, label)["series"]
    chart["loops"] = [
        {"colour": loop.colour, "width": loop.width, "x": rounded(loop.x, digits), "y": rounded(loop.y, loop.digits)}
        for loop in loops
    ]
    return chart
