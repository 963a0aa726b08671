"""A printed page as data for template/paper.js: every character where it landed."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from detent.page.chart import rounded
from detent.page.figure import Figure
from detent.page.parts import INCH, Numbers

MARKS = 100_000  # characters that a report draws, a megabyte; beyond them it leaves whole pages out, and says so


@dataclass(frozen=True, slots=True, kw_only=True)
class Marks:
    """Every character struck, in the order of striking; arrays of shape (n,), lengths [m] from column 0 of the paper.

    `column` is where the left edge of the cell belongs, `landed` where it landed; `baseline` counts from the top of its
    page, and `strikes` above 1 are bold. Pages and lines count from 1; directions are +1 and -1.
    """

    characters: Sequence[str]
    page: Numbers
    line: Numbers
    baseline: Numbers
    column: Numbers
    landed: Numbers
    width: Numbers
    direction: Numbers
    strikes: Numbers

    def __len__(self) -> int:
        return len(self.characters)

    @property
    def offset(self) -> Numbers:
        """How far right of its column each mark landed [m]: landed - column, the opposite sign of a control error."""
        return self.landed - self.column


def paper_figure(title: str, caption: str, marks: Marks, limit: float) -> Figure:
    """Pages line by line, with at most `MARKS` characters where they landed; a figure of nothing if none was struck.

    `limit` is of good offsets [m]. Columns and widths are in 1/120 in, heights in 1/48 in, offsets in micrometres.
    """
    if not len(marks):
        return Figure(title=title, caption=caption)
    numbers, sizes = np.unique(marks.page, return_counts=True)
    kept = numbers[: max(1, int(np.searchsorted(np.cumsum(sizes), MARKS, side="right")))]
    # The factor that draws the worst error a character wide or a little less.
    worst = float(np.abs(marks.offset).max())
    factors = [n * 10**k for k in range(7) for n in (1, 2, 5)]
    column = np.round(marks.column / INCH * 120, 2)
    extent = float((column + marks.width / INCH * 120).max())
    paper = {
        "pages": [_one_page(marks, int(number)) for number in kept],
        "leftOut": len(numbers) - len(kept),
        "limit": round(limit * 1e6, 2),
        "columns": round(extent, 1),
        "magnify": max((n for n in factors if worst > 0 and n <= 0.1 * INCH / worst), default=1),
    }
    return Figure(title=title, caption=caption, paper=paper)


def _one_page(marks: Marks, number: int) -> dict[str, Any]:
    rows = np.flatnonzero(np.asarray(marks.page) == number)
    starts = np.flatnonzero(np.diff(marks.line[rows], prepend=marks.line[rows[0]] - 1))
    lines: list[dict[str, Any]] = []
    for row in np.split(rows, starts[1:]):
        order = row[np.argsort(marks.column[row], kind="stable")]
        lines.append({
            "n": int(marks.line[order[0]]),
            "d": int(marks.direction[order[0]]),
            "y": round(float(marks.baseline[order[0]]) / INCH * 48, 2),
            "text": "".join([marks.characters[index] for index in cast("list[int]", order.tolist())]),
            "x": rounded(marks.column[order] / INCH * 120, 2),
            "off": rounded(marks.offset[order] * 1e6, 2),
            "w": round(float(np.median(marks.width[order])) / INCH * 120, 2),
            "bold": np.flatnonzero(marks.strikes[order] > 1).tolist(),
        })  # fmt: skip
    return {"number": number, "lines": lines}
