"""The control codes of the Diablo 630 daisy-wheel printer: one table, no behaviour.

`diablo630` carries them out. The codes are those which the makers of compatible printers publish, in agreement:
AMT Datasouth, Accel-5350 and Accel-6300 user's guides, tables D-2 and D-3 (the motion indices and absolute moves
"n minus one", what a carriage return ends, Diablo graphics, program mode, offset); Brother HL series technical
reference, chapter 4 (half feeds, 1/120 inch backspace to the right in backward printing); Tandy LP 990, "Diablo
630/630 ECS" (the list of codes).
"""

from dataclasses import dataclass
from enum import Enum
from typing import Final


class Handling(Enum):
    """What becomes of a code."""

    CARRIED_OUT = "carried out"
    ACCEPTED = "accepted"  # understood; changes neither where nor what is printed
    NOT_SUPPORTED = "not supported"  # noted with its offset


@dataclass(frozen=True, slots=True)
class ControlCode:
    """One control code."""

    name: str  # as the manuals write it: "ESC US n"
    meaning: str  # what the printer does; for a code that is not supported, also what happens instead
    handling: Handling = Handling.CARRIED_OUT  # whether it is carried out, accepted or noted
    parameters: int = 0  # bytes that follow the code and belong to it


ESC: Final = 0x1B
SUB: Final = 0x1A

_ACCEPTED = Handling.ACCEPTED
_NOT_SUPPORTED = Handling.NOT_SUPPORTED

CONTROL: Final[dict[int, ControlCode]] = {
    0x00: ControlCode("NUL", "filler", _ACCEPTED),
    0x03: ControlCode("ETX", "end of a block, answered by ACK on a serial line", _ACCEPTED),
    0x07: ControlCode("BEL", "bell", _ACCEPTED),
    0x08: ControlCode("BS", "carriage back by one motion index"),
    0x09: ControlCode("HT", "carriage to the next tab stop"),
    0x0A: ControlCode("LF", "paper up by one line"),
    0x0B: ControlCode("VT", "paper up to the next vertical tab stop"),
    0x0C: ControlCode("FF", "paper up to the next page"),
    0x0D: ControlCode("CR", "carriage to the left margin; ends the modes of the line"),
    0x11: ControlCode("DC1", "transmission on", _ACCEPTED),
    0x13: ControlCode("DC3", "transmission off", _ACCEPTED),
    0x7F: ControlCode("DEL", "filler", _ACCEPTED),
}
"""Codes of one byte. SUB and ESC are taken up before this table is asked."""

ESCAPE: Final[dict[int, ControlCode]] = {
    # -- places and distances: n is sent with one added, so that no parameter is a NUL
    0x1F: ControlCode("ESC US n", "horizontal motion index n-1 [1/120 in]", parameters=1),
    0x1E: ControlCode("ESC RS n", "vertical motion index n-1 [1/48 in]", parameters=1),
    0x09: ControlCode("ESC HT n", "carriage to print position n-1, counted in motion indices", parameters=1),
    0x0B: ControlCode("ESC VT n", "paper to line n-1 of the page", parameters=1),
    0x0C: ControlCode("ESC FF n", "n lines per page; the page begins here", parameters=1),
    0x11: ControlCode("ESC DC1 n", "offset added to the advance of every character", parameters=1),
    ord("S"): ControlCode("ESC S", "motion index back to the spacing switch, ten characters per inch"),
    # -- margins and tab stops
    ord("9"): ControlCode("ESC 9", "left margin here"),
    ord("0"): ControlCode("ESC 0", "right margin here; it bounds only justified and centred text", _ACCEPTED),
    ord("T"): ControlCode("ESC T", "top margin here"),
    ord("L"): ControlCode("ESC L", "bottom margin here"),
    ord("C"): ControlCode("ESC C", "top and bottom margins cleared"),
    ord("1"): ControlCode("ESC 1", "tab stop here"),
    ord("8"): ControlCode("ESC 8", "tab stop here cleared"),
    ord("-"): ControlCode("ESC -", "vertical tab stop here"),
    ord("2"): ControlCode("ESC 2", "all tab stops cleared"),
    # -- single motions
    0x08: ControlCode("ESC BS", "carriage back by 1/120 inch"),
    0x0A: ControlCode("ESC LF", "paper down by one line"),
    ord("U"): ControlCode("ESC U", "paper up by half a line"),
    ord("D"): ControlCode("ESC D", "paper down by half a line"),
    # -- direction of printing
    ord("5"): ControlCode("ESC 5", "forward printing"),
    ord("6"): ControlCode("ESC 6", "backward printing: the carriage moves left after every character"),
    ord("/"): ControlCode("ESC /", "the printer chooses the direction of each line", _ACCEPTED),
    ord("\\"): ControlCode("ESC \\", "every line is printed to the right", _ACCEPTED),
    ord("<"): ControlCode("ESC <", "reverse printing; the lines are printed as they come", _NOT_SUPPORTED),
    ord(">"): ControlCode("ESC >", "reverse printing off", _ACCEPTED),
    ord("?"): ControlCode("ESC ?", "new line of itself at the right end of the print line"),
    ord("!"): ControlCode("ESC !", "no new line of itself"),
    # -- what a character looks like
    ord("O"): ControlCode("ESC O", "bold: every character struck twice"),
    ord("W"): ControlCode("ESC W", "shadow: every character struck again 1/120 inch to the right"),
    ord("&"): ControlCode("ESC &", "bold and shadow off"),
    ord("E"): ControlCode("ESC E", "underscore on"),
    ord("R"): ControlCode("ESC R", "underscore off"),
    ord("A"): ControlCode("ESC A", "secondary ribbon colour"),
    ord("B"): ControlCode("ESC B", "primary ribbon colour"),
    ord("7"): ControlCode("ESC 7", "characters to the end of the line move the carriage and print nothing"),
    ord("P"): ControlCode(
        "ESC P", "proportional spacing; its widths belong to a wheel, the motion index stays in force", _NOT_SUPPORTED
    ),
    ord("Q"): ControlCode("ESC Q", "proportional spacing off", _ACCEPTED),
    # -- modes of text and graphics
    ord("3"): ControlCode("ESC 3", "graphics: blanks of 1/60 inch, lines of 1/48 inch, characters do not advance"),
    ord("4"): ControlCode("ESC 4", "graphics off"),
    ord("X"): ControlCode("ESC X", "bold, shadow, underscore, offset and program mode off"),
    ord("="): ControlCode("ESC =", "centring; the line is printed where it comes", _NOT_SUPPORTED),
    ord("M"): ControlCode("ESC M", "justification; the line is printed where it comes", _NOT_SUPPORTED),
    ord("%"): ControlCode("ESC %", "longer time for the carriage to settle", _ACCEPTED),
    ord("N"): ControlCode("ESC N", "usual time for the carriage to settle", _ACCEPTED),
    ord("G"): ControlCode("ESC G", "vector graphics; what follows is printed as characters", _NOT_SUPPORTED),
    # -- codes that select among functions by the byte that follows
    0x0D: ControlCode("ESC CR n", "reset, for n = P", parameters=1),
    0x1A: ControlCode("ESC SUB n", "reset, for n = I; otherwise remote diagnosis", parameters=1),
    0x0E: ControlCode("ESC SO n", "program mode, for n = M: a byte of hammer force after each character", parameters=1),
    0x19: ControlCode("ESC EM n", "sheet feeder; the paper is left where it is", _NOT_SUPPORTED, 1),
    0x16: ControlCode("ESC SYN n", "download; ignored", _NOT_SUPPORTED, 1),
    0x18: ControlCode("ESC CAN n", "special function; ignored", _NOT_SUPPORTED, 1),
    0x1D: ControlCode("ESC GS n", "special function; ignored", _NOT_SUPPORTED, 1),
}
"""Codes that begin with ESC, by the byte after it."""

WHEEL_CHARACTERS: Final[dict[int, str]] = {ord("Y"): "\N{CENT SIGN}", ord("Z"): "\N{NOT SIGN}"}
"""Characters of the wheel under codes 20 and 7F hex, which mean a blank and a filler; ESC Y and ESC Z print them."""
