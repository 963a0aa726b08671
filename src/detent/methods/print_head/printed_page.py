"""What a print job puts on paper: characters at their places, gathered into lines.

Horizontal places are counted in columns of 1/120 inch from the left edge of the print line, vertical
places in 1/48 inch from the top of the first page: the two motion indices of the daisy-wheel printers,
and 2.5 emitters of the carriage encoder per column (300 emitters per inch, spec print-head 2.1).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

WHEEL_PITCH = 12
"""Columns of a glyph on a ten-pitch wheel: the ink width where the spacing says nothing about the glyph."""

NARROWEST_PITCH = 6
"""Columns of the narrowest pitch, twenty characters per inch."""


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
        if NARROWEST_PITCH <= self.width_columns <= WHEEL_PITCH:
            return self.width_columns
        return WHEEL_PITCH


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
class AcceptedCode:
    """A code that was understood but changes neither where nor what is printed, with its count."""

    code: str
    text: str
    count: int


@dataclass(frozen=True, slots=True)
class ByteAccount:
    """Where every byte of the file went; the four add up to the length of the file."""

    printed: int = 0  # bytes that left ink
    interpreted: int = 0  # bytes of blanks and of control codes that were carried out
    accepted: int = 0  # bytes of codes without effect on ink or motion
    noted: int = 0  # bytes covered by a `JobNote`

    @property
    def total(self) -> int:
        """All bytes accounted for."""
        return self.printed + self.interpreted + self.accepted + self.noted


@dataclass(frozen=True, slots=True)
class PrintJob:
    """A print job read whole."""

    name: str  # name of the file, for messages and reports
    kind: str  # "text" or "diablo630"
    lines: tuple[PrintLine, ...]  # only lines with ink, from the top down
    pages: int  # pages up to the last ink; 0 for a job without ink
    notes: tuple[JobNote, ...]  # what could not be carried out, in the order of the file
    accepted: tuple[AcceptedCode, ...]  # codes without effect on ink or motion
    length_bytes: int  # length of the file [byte]
    account: ByteAccount  # where the bytes went

    @property
    def characters(self) -> int:
        """Number of glyphs on paper; a glyph struck twice at one place counts once."""
        return sum(len(line.characters) for line in self.lines)


@dataclass(slots=True)
class _Glyph:
    """Strikes of one glyph at one place, while the job is still being read."""

    width_columns: int = 0
    strike: int = 0
    underline: bool = False


OPEN_LINES = 200
"""Lines that can be struck again without being taken apart first: more than reverse feeds reach on a page."""


@dataclass(slots=True)
class Sheet:
    """Collects strikes in any order and hands them back as lines.

    Overstrikes of the same glyph at the same place become one character with a higher `strike`. Lines left behind are
    settled into characters at once, and equal characters are one object, so that a job of any length stays small.
    """

    _open: dict[tuple[int, int], dict[tuple[int, str, bool], _Glyph]] = field(
        default_factory=dict[tuple[int, int], dict[tuple[int, str, bool], _Glyph]]
    )
    _settled: dict[tuple[int, int], tuple[PrintedCharacter, ...]] = field(
        default_factory=dict[tuple[int, int], tuple[PrintedCharacter, ...]]
    )
    _known: dict[PrintedCharacter, PrintedCharacter] = field(default_factory=dict[PrintedCharacter, PrintedCharacter])

    def strike(self, page: int, baseline: int, hit: PrintedCharacter) -> None:
        """Put one hit on paper: `baseline` [1/48 in] from the top of the first page, on page `page`."""
        line = self._open.get((page, baseline))
        if line is None:
            line = self._begin((page, baseline))
        _strike(line, hit)

    def lines(self) -> tuple[PrintLine, ...]:
        """Give all lines with ink, from the top down, numbered from 1."""
        for place in list(self._open):
            self._settle(place)
        return tuple(
            PrintLine(number, baseline, self._settled[page, baseline], page)
            for number, (page, baseline) in enumerate(sorted(self._settled), start=1)
        )

    def _begin(self, place: tuple[int, int]) -> dict[tuple[int, str, bool], _Glyph]:
        """Open a line, with what was struck on it before; the one opened longest ago makes room."""
        if len(self._open) >= OPEN_LINES:
            self._settle(next(iter(self._open)))
        line: dict[tuple[int, str, bool], _Glyph] = {}
        for character in self._settled.pop(place, ()):
            _strike(line, character)
        self._open[place] = line
        return line

    def _settle(self, place: tuple[int, int]) -> None:
        """Turn the strikes of one line into characters, sorted by column."""
        line = self._open.pop(place)
        found = [
            PrintedCharacter(char, column, glyph.width_columns, glyph.strike, red, glyph.underline)
            for (column, char, red), glyph in sorted(line.items(), key=lambda item: item[0])
        ]
        self._settled[place] = tuple(self._known.setdefault(character, character) for character in found)


def _strike(line: dict[tuple[int, str, bool], _Glyph], hit: PrintedCharacter) -> None:
    glyph = line.setdefault((hit.column, hit.char, hit.red), _Glyph())
    glyph.strike += hit.strike
    glyph.width_columns = max(glyph.width_columns, hit.width_columns)
    glyph.underline |= hit.underline
