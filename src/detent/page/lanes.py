"""Lanes of bars as data for the script of a page: what goes on when, or what holds where (a Gantt chart)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from detent.page.chart import Chart, rounded

LANE_HEIGHT = 26  # height of a lane [px]
FOOT_HEIGHT = 44  # height of what is above and below the lanes [px]
PLACES = 600  # places at which the cursor stops besides the ends of the bars
DIGITS = 4


@dataclass(frozen=True, slots=True)
class Bar:
    """A stretch of the horizontal axis."""

    begin: float  # and end: its ends, in the unit of the axis
    end: float
    short: str  # written inside where there is room
    text: str  # told below the chart while the cursor is over it


@dataclass(frozen=True, slots=True)
class Lane:
    """Bars of one kind."""

    label: str  # name of the lane; about ten characters have room beside it
    colour: str  # as of a curve
    bars: Sequence[Bar]  # in any order


def lane_chart(name: str, lanes: Sequence[Lane], span: tuple[float, float], label: str, *, sync: str = "") -> Chart:
    """Draw lanes above one another."""
    shown = [
        (lane, [bar for bar in lane.bars if bar.end > span[0] and bar.begin < span[1] and bar.end > bar.begin])
        for lane in lanes
    ]
    ends = [place for _, bars in shown for bar in bars for place in (bar.begin, bar.end)]
    x = np.unique(np.clip(np.concatenate((np.linspace(*span, PLACES), ends)), *span))
    chart: Chart = {
        "id": name,
        "x": rounded(x, DIGITS),
        "xLabel": label,
        "height": LANE_HEIGHT * len(lanes) + FOOT_HEIGHT + (0 if sync else 20),
        "yRange": [0, len(lanes)],
        "lanes": [
            {"label": lane.label, "colour": lane.colour, "bars": [_bar(bar) for bar in bars]} for lane, bars in shown
        ],
        "series": [],
    }
    return chart | ({"sync": sync, "foot": False} if sync else {})


def _bar(bar: Bar) -> list[float | str]:
    return [round(bar.begin, DIGITS), round(bar.end, DIGITS), bar.short, bar.text]
