"""What a print job puts on paper: characters at their places, gathered into lines.

Horizontal places are counted in columns of 1/120 inch from the left edge of the print line, vertical
places in 1/48 inch from the top of the first page: the two motion indices of the daisy-wheel printers,
and 2.5 emitters of the carriage encoder per column (300 emitters per inch, spec print-head 2.1). The paper
itself moves by 1/96 inch, so that half of any line spacing is a whole number and two half feeds are one line.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import Counter
from dataclasses import dataclass, field, replace
from itertools import pairwise

from detent.files.screen import OnScreen
from detent.methods.changes import ParameterChange

WHEEL_PITCH = 12  # columns of a glyph on a ten-pitch wheel: its ink where the spacing says nothing about the glyph
NARROWEST_PITCH = 6  # columns of the narrowest pitch, twenty characters per inch
LINE = 16  # height of a line at six lines per inch [1/96 in]
PAGE = 66 * LINE  # length of an eleven-inch page [1/96 in]
OPEN_LINES = 200  # lines that can be struck again at once: more than reverse feeds reach on a page


@dataclass(frozen=True, slots=True)
class PrintedCharacter:
    """One glyph at one place, struck once or more."""

    char: str  # the glyph
    column: int  # left edge [1/120 in] from column 0 of the paper, never negative
    width_columns: int  # carriage spacing (HMI) in force when it was struck [1/120 in]; 0 where the carriage was held
    strike: int = 1  # how often the hammer hit this glyph at this place: 2 is bold by overstrike
    red: bool = False  # struck with the secondary ribbon colour
    underline: bool = False  # an underscore is struck at the same place

    @property
    def ink_columns(self) -> int:
        """Width of the ink [1/120 in]: the pitch, or a ten-pitch glyph where the spacing is no pitch.

        Word processors hold the carriage (HMI 0) for bold and stretch it to justify a line; the glyph
        on the wheel stays as wide as it is.
        """
        return self.width_columns if NARROWEST_PITCH <= self.width_columns <= WHEEL_PITCH else WHEEL_PITCH

    def over(self, before: PrintedCharacter) -> PrintedCharacter:
        """The same glyph, struck over one that is there."""
        return replace(
            self,
            width_columns=max(before.width_columns, self.width_columns),
            strike=before.strike + self.strike,
            underline=before.underline or self.underline,
        )


@dataclass(frozen=True, slots=True)
class PrintLine:
    """All ink on one base line."""

    number: int  # 1 for the first line with ink, counted downwards over all pages
    baseline: int  # distance from the top of the first page [1/48 in], on continuous paper
    characters: tuple[PrintedCharacter, ...]  # at least one, sorted by column
    page: int = 1  # 1 for the first page

    @property
    def first_column(self) -> int:
        """Left end of the ink [1/120 in]."""
        return self.characters[0].column

    @property
    def last_column(self) -> int:
        """Right end of the ink [1/120 in], exclusive."""
        return max(c.column + c.ink_columns for c in self.characters)

    @property
    def text(self) -> str:
        """The line as a reader sees it: one glyph per place, blanks where a gap is wide enough for one."""
        seen: list[PrintedCharacter] = []
        for here in self.characters:
            if not seen or here.column - seen[-1].column >= NARROWEST_PITCH:
                seen.append(here)
            elif seen[-1].char == "_":  # the same place again: bold, shadow, an accent, a letter on its underscore
                seen[-1] = here
        words = seen[0].char
        for before, here in pairwise(seen):
            gap = here.column - before.column - before.ink_columns
            words += " " * max(1, round(gap / WHEEL_PITCH)) * (gap >= WHEEL_PITCH // 2)
            words += here.char
        return words


@dataclass(frozen=True, slots=True)
class JobNote:
    """Something in the job that could not be carried out as it stands."""

    offset: int  # where in the file it stands [byte], 0 is the first
    code: str  # the control code as the manuals write it, such as "ESC P"
    text: str  # what was met, and what was done instead

    def __str__(self) -> str:
        """As a person reads it."""
        return f"byte {self.offset}, {self.code}: {self.text}"


@dataclass(frozen=True, slots=True)
class ByteAccount:
    """Where every byte of the file went; the four add up to the length of the file."""

    printed: int = 0  # bytes that left ink
    interpreted: int = 0  # bytes of blanks and of control codes that were carried out
    accepted: int = 0  # bytes of codes without effect on ink or motion
    noted: int = 0  # bytes covered by a `JobNote`


@dataclass(frozen=True, slots=True, repr=False)
class PrintJob(OnScreen):
    """A print job read whole."""

    name: str  # name of the file, for messages and reports
    kind: str  # "text" or "diablo630"
    lines: tuple[PrintLine, ...]  # only lines with ink, from the top down
    pages: int  # pages up to the last ink; 0 for a job without ink
    notes: tuple[JobNote, ...]  # what could not be carried out, in the order of the file
    accepted: dict[str, int]  # codes understood that change neither where nor what is printed, and how often
    length_bytes: int  # length of the file [byte]
    account: ByteAccount  # where the bytes went
    changes: tuple[ParameterChange, ...] = ()  # parameters of the controller that change on the way

    @property
    def characters(self) -> int:
        """Number of glyphs on paper; a glyph struck twice at one place counts once."""
        return sum(len(line.characters) for line in self.lines)


_Place = tuple[int, int]  # of a line: page and baseline
_Ink = dict[tuple[int, str, bool], PrintedCharacter]  # of a line that is open, by column, glyph and ribbon


@dataclass(slots=True)
class Paper:
    """Where the paper stands, where its pages begin, and the ink on it.

    Strikes come in any order; those of one glyph at one place become one character with a higher `strike`. Lines left
    behind are settled at once, and equal characters are one object, so that a job of any length stays small.
    """

    place: int = 0  # print line below the top of the first page [1/96 in], never negative
    page_length: int = PAGE  # length of the pages to come [1/96 in]
    tops: list[int] = field(default_factory=lambda: [0])  # where each page reached so far begins [1/96 in], rising
    # top_margin, bottom_margin: first and last printable place of a page, from its top [1/96 in]; None while not set
    top_margin: int | None = None
    bottom_margin: int | None = None  # [1/96 in]
    _open: dict[_Place, _Ink] = field(default_factory=dict[_Place, _Ink])
    _settled: dict[_Place, tuple[PrintedCharacter, ...]] = field(
        default_factory=dict[_Place, tuple[PrintedCharacter, ...]]
    )
    _known: dict[PrintedCharacter, PrintedCharacter] = field(default_factory=dict[PrintedCharacter, PrintedCharacter])

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

    def strike(self, hit: PrintedCharacter) -> None:
        """Put one hit on the print line."""
        place, glyph = (self.page, self.baseline), (hit.column, hit.char, hit.red)
        if place not in self._open:
            if len(self._open) >= OPEN_LINES:
                self._settle(next(iter(self._open)))  # opened longest ago
            before = self._settled.pop(place, ())
            self._open[place] = {(one.column, one.char, one.red): one for one in before}
        line = self._open[place]
        line[glyph] = hit.over(line[glyph]) if glyph in line else hit

    def lines(self) -> tuple[PrintLine, ...]:
        """Give all lines with ink, from the top down, numbered from 1."""
        for place in list(self._open):
            self._settle(place)
        return tuple(
            PrintLine(number, baseline, self._settled[page, baseline], page)
            for number, (page, baseline) in enumerate(sorted(self._settled), start=1)
        )

    def _settle(self, place: tuple[int, int]) -> None:
        """Close one line, its characters sorted by column."""
        line = self._open.pop(place)
        self._settled[place] = tuple(self._known.setdefault(line[glyph], line[glyph]) for glyph in sorted(line))


class Reading:
    """A job while it is read: its paper, and what became of its bytes."""

    def __init__(self) -> None:
        self.at = 0  # bytes read so far
        self.paper = Paper()
        self.notes: list[JobNote] = []
        self.accepted: Counter[str] = Counter()
        self.account: Counter[str] = Counter()

    def note(self, offset: int, code: str, text: str) -> str:
        """Note what could not be carried out; gives what its bytes count as."""
        self.notes.append(JobNote(offset, code, text))
        return "noted"

    def job(self, name: str, kind: str) -> PrintJob:
        """The job, read to its end."""
        lines = self.paper.lines()
        return PrintJob(
            name=name,
            kind=kind,
            lines=lines,
            pages=lines[-1].page if lines else 0,
            notes=tuple(self.notes),
            accepted=dict(self.accepted),
            length_bytes=self.at,
            account=ByteAccount(**self.account),
        )
