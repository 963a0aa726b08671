"""The mechanism of the Diablo 630 daisy-wheel printer: a carriage with a hammer, paper, and modes.

`diablo630` reads the codes and calls what stands here; actions give what went wrong as a text, if anything. Distances
are those of the printer: 1/120 inch across, 1/48 inch down (kept in 1/96 inch, for half lines).
"""

from dataclasses import dataclass, field, fields
from typing import Any

from detent.methods.print_head.printed_page import LINE, WHEEL_PITCH, Paper, PrintedCharacter

LINE_END = 1584
"""Right end of the print line [1/120 in]: 13.2 inches."""


@dataclass(slots=True)
class LineModes:
    """Modes that a carriage return ends."""

    backward: bool = False
    bold: bool = False
    shadow: bool = False
    underscore: bool = False
    suppressed: bool = False
    graphics: bool = False
    offset: int = 0  # [1/120 in]


@dataclass(slots=True)
class Printer:
    """Carriage, paper and modes."""

    paper: Paper = field(default_factory=Paper)
    column: int = 0  # carriage [1/120 in]
    hmi: int = WHEEL_PITCH  # horizontal motion index [1/120 in]
    vmi: int = LINE // 2  # vertical motion index [1/48 in]
    left_margin: int = 0  # [1/120 in]
    # A stop every eight positions is what the makers of compatible printers ship.
    tab_stops: set[int] = field(default_factory=lambda: set(range(0, LINE_END, 8 * WHEEL_PITCH)))
    vertical_stops: set[int] = field(default_factory=set[int])  # [1/96 in] from the top of the page
    red: bool = False
    auto_return: bool = False
    program_mode: bool = False
    modes: LineModes = field(default_factory=LineModes)

    def print_character(self, char: str) -> tuple[bool, str | None]:
        """Strike `char` here and advance; gives whether there is ink, and what went wrong."""
        if self.auto_return and not self.modes.backward and self.column + self.hmi > LINE_END:
            self.carriage_return()
            self.feed(2)
        modes = self.modes
        inked = not modes.suppressed and (char != " " or modes.underscore)
        if inked:
            self._strike(char)
        if modes.graphics:
            return inked, self.move(2 if char == " " else 0)
        return inked, self.move(max(0, self.hmi + modes.offset))

    def _strike(self, char: str) -> None:
        modes = self.modes
        width = 0 if modes.graphics else self.hmi
        if char == " ":
            self.paper.strike(PrintedCharacter("_", self.column, width, 1, self.red))
            return
        strikes = 2 if modes.bold else 1
        self.paper.strike(PrintedCharacter(char, self.column, width, strikes, self.red, modes.underscore))
        if modes.shadow:
            self.paper.strike(PrintedCharacter(char, self.column + 1, width, 1, self.red))

    def move(self, distance: int) -> str | None:
        """Move the carriage [1/120 in] in the direction of printing."""
        self.column += -distance if self.modes.backward else distance
        if self.column >= 0:
            return None
        self.column = 0
        return "the carriage stood at its left stop and did not move further left"

    def carriage_return(self) -> None:
        """Return to the left margin and end the modes of the line."""
        self.column = self.left_margin
        self.modes = LineModes()

    def end_word_processing(self) -> None:
        """End the modes that change what a character looks like; direction and graphics stay."""
        self.put(program_mode=False)
        self.put_modes(bold=False, shadow=False, underscore=False, offset=0)

    def reset(self) -> None:
        """Restore the settings of power-on; paper and what is printed stay."""
        self.paper.clear_margins()
        fresh = Printer(self.paper)
        self.put(**{setting.name: getattr(fresh, setting.name) for setting in fields(fresh)})

    def put(self, **settings: Any) -> None:
        """Change settings of the printer."""
        for name, value in settings.items():
            setattr(self, name, value)

    def put_modes(self, **modes: int) -> None:
        """Change modes of the line."""
        for name, value in modes.items():
            setattr(self.modes, name, value)

    def set_offset(self, n: int) -> None:
        """Add the low six bits of n to every advance [1/120 in]; bit 6 is the sign."""
        self.put_modes(offset=-(n & 0x3F) if n & 0x40 else n & 0x3F)

    def next_tab(self) -> str | None:
        """Move the carriage right to the next stop, whatever the direction of printing."""
        stops = [stop for stop in self.tab_stops if stop > self.column]
        if not stops:
            return "no tab stop to the right; ignored"
        self.column = min(stops)
        return None

    def feed(self, half_lines: int) -> str | None:
        """Feed paper by half lines of the vertical motion index; graphics has lines of 1/48 inch."""
        half_line = 1 if self.modes.graphics else self.vmi  # [1/96 in]
        moved = self.paper.feed(half_lines * half_line)
        return None if moved else "the paper stood at the top of the job and was not pulled back further"

    def next_vertical_tab(self) -> str | None:
        """Advance the paper to the next vertical stop."""
        stops = [stop for stop in self.vertical_stops if stop > self.paper.from_top]
        return self.line_at(min(stops)) if stops else "no vertical tab stop below; ignored"

    def line_at(self, from_top: int) -> str | None:
        """Move the paper to a place of this page [1/96 in]."""
        return None if self.paper.move_to(from_top) else "a place below the end of the page; ignored"

    def set_page(self, n: int) -> str | None:
        """Begin pages of n lines here."""
        if n == 0 or self.vmi == 0:
            return "a page without length; ignored"
        self.paper.set_form(n * 2 * self.vmi)
        return None

    def set_top_margin(self) -> None:
        """Begin the pages to come at this line."""
        self.paper.top_margin = self.paper.from_top

    def set_bottom_margin(self) -> None:
        """End the pages after this line."""
        self.paper.bottom_margin = self.paper.from_top
