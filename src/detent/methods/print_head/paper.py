"""Paper under the print head: line feeds, pages, and the margins at top and bottom.

Places are counted in 1/96 inch from the top of the first page on continuous paper, so that half of any
line spacing is a whole number and two half feeds are exactly one line.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, field

UNITS_PER_INCH = 96
LINE = UNITS_PER_INCH // 6
"""Height of a line at six lines per inch [1/96 in]."""

PAGE = 66 * LINE
"""Length of an eleven-inch page [1/96 in]."""


@dataclass(slots=True)
class Paper:
    """Where the paper stands, and where its pages begin."""

    place: int = 0  # print line below the top of the first page [1/96 in], never negative
    page_length: int = PAGE  # length of the pages to come [1/96 in]
    tops: list[int] = field(default_factory=lambda: [0])  # where each page reached so far begins [1/96 in], rising
    # top_margin, bottom_margin: first and last printable place of a page, from its top [1/96 in]; None while not set
    top_margin: int | None = None
    bottom_margin: int | None = None  # [1/96 in]

    @property
    def page(self) -> int:
        """Page under the head, 1 for the first."""
        return bisect_right(self.tops, self.place)

    @property
    def baseline(self) -> int:
        """Print line below the top of the first page [1/48 in]; an odd half feed is rounded up the page."""
        return self.place // 2

    @property
    def from_top(self) -> int:
        """Print line below the top of its own page [1/96 in]."""
        return self.place - self.tops[self.page - 1]

    def feed(self, distance: int) -> bool:
        """Advance the paper by `distance` [1/96 in]; negative pulls it back."""
        self.place += distance
        if self.place < 0:
            self.place = 0
            return False
        while self.place >= self.tops[-1] + self.page_length:
            self.tops.append(self.tops[-1] + self.page_length)
        if distance > 0 and self.bottom_margin is not None and self.from_top > self.bottom_margin:
            self.form_feed()
        return True

    def form_feed(self) -> None:
        """Advance to the top of the next page, below its top margin."""
        page = self.page
        if page == len(self.tops):
            self.tops.append(self.tops[-1] + self.page_length)
        self.place = self.tops[page] + (self.top_margin or 0)

    def move_to(self, from_top: int) -> bool:
        """Move to a place on this page [1/96 in from its top]; False, and no motion, if it is below the page."""
        if from_top >= self.page_length:
            return False
        self.place = self.tops[self.page - 1] + from_top
        return True

    def set_form(self, page_length: int) -> None:
        """Begin a form of `page_length` [1/96 in] here; margins are cleared."""
        self.tops = [top for top in self.tops if top < self.place] + [self.place]
        self.page_length = page_length
        self.clear_margins()

    def clear_margins(self) -> None:
        """Print from the top of the page to its end."""
        self.top_margin = self.bottom_margin = None
