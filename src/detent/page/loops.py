"""Curves that go to and fro as data for the script of a page: speed against position, for one."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from detent.page.chart import Chart, Curve, Panel, line_chart, rounded
from detent.page.parts import Numbers


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop:
    """A curve whose places need not rise.

    Attributes
    ----------
    label, colour : str
        As of a curve; loops of one label have one line in the legend.
    x, y : ndarray
        Finite places and values in the units of the chart, shape (n,).
    width : float
        Width of the line [px].
    digits : int
        Digits of values kept after the point.
    """

    label: str
    colour: str
    x: Numbers
    y: Numbers
    width: float = 2.0
    digits: int = 3


def loop_chart(panel: Panel, x: Numbers, label: str, loops: Sequence[Loop], *, digits: int = 4) -> Chart:
    """Draw curves over any horizontal axis, and loops above them.

    Parameters
    ----------
    panel : Panel
        What to draw below the loops, with a span that has room for these.
    x : ndarray
        Horizontal places of the curves' values, rising, shape (n,).
    label : str
        Of the horizontal axis, with unit.
    loops : sequence of Loop
        The first is drawn first.
    digits : int
        Digits of horizontal places kept after the point.

    Returns
    -------
    dict
        One chart; a loop is told in the legend by a curve without values.
    """
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
