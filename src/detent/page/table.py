"""Tables as data: heads, rows, and cells that are more than their text."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isnan
from typing import NamedTuple

from markupsafe import Markup

from detent.page.words import arrow, further, number

MOST_ROWS = 500  # rows of a table on a page: more than anybody reads
WIDEST_BAR = 48  # length of the longest bar of a column [px]


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """A cell with a look of its own: `bar` as a share of the longest, `over` its limit, `mark` a spot of colour."""

    text: str
    bar: float | None = None
    over: bool = False
    mark: str = ""
    nowrap: bool = False

    @property
    def width(self) -> str:
        """Length of the bar [px]."""
        return f"{WIDEST_BAR * (self.bar or 0.0):.0f}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Heads and rows; text is escaped unless it is `Markup`. A `tall` one has a limited height and scrolls inside."""

    heads: Sequence[tuple[str, bool]]
    rows: Sequence[Sequence[str | Cell]]
    tall: bool = False

    def __post_init__(self) -> None:
        for place, row in enumerate(self.rows, 1):
            if len(row) != len(self.heads):
                raise ValueError(f"table: row {place} has {len(row)} cells, expected: {len(self.heads)}, one per head")

    def cells(self, row: Sequence[str | Cell]) -> list[tuple[Cell, bool]]:
        """Cells of a row, each with whether its column holds numbers."""
        whole = [cell if isinstance(cell, Cell) else Cell(text=cell) for cell in row]
        return [(cell, numeric) for cell, (_, numeric) in zip(whole, self.heads, strict=True)]


class TextTable(NamedTuple):
    """A table for the terminal."""

    title: str
    heads: Sequence[str]
    rows: Sequence[Sequence[str]]

    @property
    def on_page(self) -> Table:
        """The same for a page: all but the first column to the right."""
        return Table(heads=[(head, k > 0) for k, head in enumerate(self.heads)], rows=self.rows)


def bar_cell(value: float, longest: float, *, over: bool = False) -> Cell:
    """A number >= 0 behind a bar, `longest` being the value of the longest bar; none is longer. NaN is a dash."""
    if isnan(value):
        return Cell(text="\u2013")
    return Cell(text=number(value, 2), bar=value / longest if value < longest else 1.0, over=over)


def offset_cell(offset: float, longest: float, *, over: bool = False) -> Cell:
    """A number with its sign behind a bar for its magnitude; NaN is a dash."""
    cell = bar_cell(abs(offset), longest, over=over)
    sign = "+" if offset > 0 else "\u2212" if offset < 0 else ""
    return Cell(text=sign + cell.text, bar=cell.bar, over=cell.over)


def way_cell(direction: int, text: str) -> Cell:
    """A length of way behind an arrow."""
    return Cell(text=Markup("{} {}").format(arrow(direction), text), nowrap=True)


def long_table(heads: Sequence[tuple[str, bool]], rows: Sequence[Sequence[str | Cell]]) -> Table:
    """A table of everything that a run did, of at most `MOST_ROWS` rows, that scrolls inside."""
    return Table(heads=heads, rows=rows[:MOST_ROWS], tall=True)


def left_out(rows: int, word: str) -> str:
    """What to add to the caption of a `long_table` of so many rows; empty if they are all there."""
    return f" {further(rows - MOST_ROWS, word)} in the JSON summary only." if rows > MOST_ROWS else ""
