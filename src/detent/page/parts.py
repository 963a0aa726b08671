"""What every report shows: moments worth a mark, and notes to the reader.

Everything is SI except what names its unit; the pages turn lengths into the units of the trade.
"""

from dataclasses import dataclass
from typing import Any, Literal

from numpy.typing import NDArray

Numbers = NDArray[Any]

INCH = 0.0254


@dataclass(frozen=True, slots=True)
class Event:
    """A moment worth a mark in a figure."""

    t: float  # moment [s], on the clock of the figure it belongs to
    text: str  # what happened, in a few words: "stop begins, IR part subtracted"
    drive: int | None = None  # drive value right after the event [count], right positive


@dataclass(frozen=True, slots=True)
class Note:
    """Something the reader should know, in one or two sentences."""

    # how much it matters: for information; look at it; the reason why it failed
    level: Literal["note", "warning", "error"]
    text: str  # what it is, with value and limit, and what to do
