"""The mechanism of the Diablo 630 daisy-wheel printer: a carriage with a hammer, paper, and modes.

`diablo630` reads the codes and calls what stands here. Distances are those of the printer: 1/120 inch across,
1/48 inch down (kept in 1/96 inch, for half lines).
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, field

from detent.methods.print_head.paper import LINE, Paper
from detent.methods.print_head.printed_page import WHEEL_PITCH, PrintedCharacter, Sheet

LINE_END = 1584
"""Right end of the print line [1/120 in]: 13.2 inches."""

_AT_LEFT_STOP = "the carriage stood at its left stop and did not move further left"
_AT_PAPER_TOP = "the paper stood at the top of the job and was not pulled back further"


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
    """Carriage, paper, modes, and what has been put on paper.

    Every action gives what went wrong as a text, or nothing.
    """

    column: int = 0  # carriage [1/120 in]
    hmi: int = WHEEL_PITCH  # horizontal motion index [1/120 in]
    vmi: int = LINE // 2  # vertical motion index [1/48 in]
    left_margin: int = 0  # [1/120 in]
    # A stop every eight positions is what the makers of compatible printers ship.
    tab_stops: list[int] = field(default_factory=lambda: list(range(0, LINE_END, 8 * WHEEL_PITCH)))
    vertical_stops: list[int] = field(default_factory=list[int])  # [1/96 in] from the top of the page
    red: bool = False
    auto_return: bool = False
    program_mode: bool = False
    modes: LineModes = field(default_factory=LineModes)
    paper: Paper = field(default_factory=Paper)
    sheet: Sheet = field(default_factory=Sheet)

    # -- carriage and hammer ------------------------------------------------------------------------------

    def print_character(self, char: str) -> tuple[bool, str]:
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
            hit = PrintedCharacter("_", self.column, width, 1, self.red)
        else:
            hit = PrintedCharacter(char, self.column, width, 2 if modes.bold else 1, self.red, modes.underscore)
        self.sheet.strike(self.paper.page, self.paper.baseline, hit)
        if modes.shadow and char != " ":
            shadow = PrintedCharacter(char, self.column + 1, width, 1, self.red)
            self.sheet.strike(self.paper.page, self.paper.baseline, shadow)

    def move(self, distance: int) -> str:
        """Move the carriage [1/120 in] in the direction of printing; gives what went wrong."""
        self.column += -distance if self.modes.backward else distance
        if self.column >= 0:
            return ""
        self.column = 0
        return _AT_LEFT_STOP

    def carriage_return(self) -> str:
        """Return to the left margin and end the modes of the line."""
        self.column = self.left_margin
        self.modes = LineModes()
        return ""

    def end_word_processing(self) -> str:
        """End the modes that change what a character looks like; direction and graphics stay."""
        self.modes.bold = self.modes.shadow = self.modes.underscore = self.program_mode = False
        self.modes.offset = 0
        return ""

    def reset(self) -> str:
        """Restore the settings of power-on; paper and what is printed stay."""
        fresh = Printer()
        self.hmi, self.vmi, self.left_margin = fresh.hmi, fresh.vmi, fresh.left_margin
        self.tab_stops, self.vertical_stops = fresh.tab_stops, fresh.vertical_stops
        self.red = self.auto_return = self.program_mode = False
        self.paper.clear_margins()
        return self.carriage_return()

    def set_mode(self, mode: str, *, on: bool) -> str:
        """Switch one mode of the line."""
        setattr(self.modes, mode, on)
        return ""

    def set_colour(self, *, red: bool) -> str:
        """Choose the ribbon colour."""
        self.red = red
        return ""

    def set_auto_return(self, *, on: bool) -> str:
        """Choose whether the end of the print line starts a new line."""
        self.auto_return = on
        return ""

    # -- distances, places, stops -------------------------------------------------------------------------

    def set_hmi(self, n: int) -> str:
        """Set the horizontal motion index to n-1 [1/120 in]."""
        if n == 0:
            return "motion index below zero; ignored"
        self.hmi = n - 1
        return ""

    def set_vmi(self, n: int) -> str:
        """Set the vertical motion index to n-1 [1/48 in]."""
        if n == 0:
            return "motion index below zero; ignored"
        self.vmi = n - 1
        return ""

    def set_offset(self, n: int) -> str:
        """Add the low six bits of n to every advance [1/120 in]; bit 6 is the sign."""
        self.modes.offset = -(n & 0x3F) if n & 0x40 else n & 0x3F
        return ""

    def restore_hmi(self) -> str:
        """Give the motion index back to the spacing switch."""
        self.hmi = WHEEL_PITCH
        return ""

    def tab_to(self, n: int) -> str:
        """Move the carriage to print position n-1."""
        if n == 0:
            return "print position below zero; ignored"
        self.column = (n - 1) * self.hmi
        return ""

    def next_tab(self) -> str:
        """Move the carriage right to the next stop, whatever the direction of printing."""
        stop = bisect_right(self.tab_stops, self.column)
        if stop == len(self.tab_stops):
            return "no tab stop to the right; ignored"
        self.column = self.tab_stops[stop]
        return ""

    def set_tab(self) -> str:
        """Set a tab stop at the carriage."""
        self.tab_stops = sorted({*self.tab_stops, self.column})
        return ""

    def clear_tab(self) -> str:
        """Clear the tab stop at the carriage."""
        self.tab_stops = [stop for stop in self.tab_stops if stop != self.column]
        return ""

    def set_vertical_tab(self) -> str:
        """Set a vertical tab stop at the print line."""
        self.vertical_stops = sorted({*self.vertical_stops, self.paper.from_top})
        return ""

    def clear_all_tabs(self) -> str:
        """Clear all tab stops of both kinds."""
        self.tab_stops, self.vertical_stops = [], []
        return ""

    def set_left_margin(self) -> str:
        """Set the left margin at the carriage."""
        self.left_margin = self.column
        return ""

    # -- paper --------------------------------------------------------------------------------------------

    def feed(self, half_lines: int) -> str:
        """Feed paper by half lines of the vertical motion index; graphics has lines of 1/48 inch."""
        half_line = 1 if self.modes.graphics else self.vmi  # [1/96 in]
        return "" if self.paper.feed(half_lines * half_line) else _AT_PAPER_TOP

    def form_feed(self) -> str:
        """Advance to the next page; the carriage stays."""
        self.paper.form_feed()
        return ""

    def next_vertical_tab(self) -> str:
        """Advance the paper to the next vertical stop."""
        stop = bisect_right(self.vertical_stops, self.paper.from_top)
        if stop == len(self.vertical_stops):
            return "no vertical tab stop below; ignored"
        return self.line_at(self.vertical_stops[stop])

    def line_at(self, from_top: int) -> str:
        """Move the paper to a place of this page [1/96 in]."""
        return "" if self.paper.move_to(from_top) else "a place below the end of the page; ignored"

    def set_page(self, n: int) -> str:
        """Begin pages of n lines here."""
        if n == 0 or self.vmi == 0:
            return "a page without length; ignored"
        self.paper.set_form(n * 2 * self.vmi)
        return ""

    def set_top_margin(self) -> str:
        """Begin the pages to come at this line."""
        self.paper.top_margin = self.paper.from_top
        return ""

    def set_bottom_margin(self) -> str:
        """End the pages after this line."""
        self.paper.bottom_margin = self.paper.from_top
        return ""

    def clear_margins(self) -> str:
        """Use the whole page."""
        self.paper.clear_margins()
        return ""

    # -- functions chosen by a second byte ------------------------------------------------------------------

    def select(self, n: int, wanted: str, action: Callable[[], str]) -> str:
        """Carry out `action` if the parameter is the wanted letter."""
        if n == ord(wanted):
            return action()
        return f"function {n:02X} hex is not supported; ignored"

    def start_program_mode(self) -> str:
        """Take a byte of hammer force after every character."""
        self.program_mode = True
        return ""

    def off_bold_and_shadow(self) -> str:
        """End bold and shadow."""
        self.modes.bold = self.modes.shadow = False
        return ""
