"""Reads a stream for the Diablo 630 daisy-wheel printer: byte by byte, each one accounted for.

The stream is motion as the word processor meant it: spacing changed within a line, lines sent backwards, bold by
striking again 1/120 inch further. What counts for the axis is where the ink is; in which direction a line is
finally printed is the supervisor's choice (`line_plan`). Reading is total: any bytes give a job, and what could not
be carried out stands in its notes. Distances are those of the printer: 1/120 inch across, 1/48 inch down, of which
paper moves by halves.

The codes are those which the makers of compatible printers publish, in agreement: AMT Datasouth, Accel-5350 and
Accel-6300 user's guides, tables D-2 and D-3 (the motion indices and absolute moves "n minus one", what a carriage
return ends, Diablo graphics, program mode, offset); Brother HL series technical reference, chapter 4 (half feeds,
1/120 inch backspace to the right in backward printing); Tandy LP 990, "Diablo 630/630 ECS" (the list of codes).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from enum import Enum
from typing import Any, Final

from detent.methods.print_head.printed_page import LINE, WHEEL_PITCH, Paper, PrintedCharacter, PrintJob, Reading

LINE_END = 1584  # right end of the print line [1/120 in]: 13.2 inches


def put(of: Any, **settings: Any) -> None:
    """Change settings of the printer, of its modes or of its paper."""
    for name, value in settings.items():
        setattr(of, name, value)


# ---- the mechanism: a carriage with a hammer, paper, and modes


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
    """Carriage, paper and modes; actions give what went wrong, if anything."""

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
        put(self, program_mode=False)
        put(self.modes, bold=False, shadow=False, underscore=False, offset=0)

    def reset(self) -> None:
        """Restore the settings of power-on; paper and what is printed stay."""
        self.paper.clear_margins()
        fresh = Printer(self.paper)
        put(self, **{setting.name: getattr(fresh, setting.name) for setting in fields(fresh)})

    def set_offset(self, n: int) -> None:
        """Add the low six bits of n to every advance [1/120 in]; bit 6 is the sign."""
        put(self.modes, offset=-(n & 0x3F) if n & 0x40 else n & 0x3F)

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


# ---- the codes


class Ignored(Enum):
    """Why a code is not carried out."""

    ACCEPTED = "accepted"  # understood; changes neither where nor what is printed
    NOT_SUPPORTED = "not supported"  # noted with its offset


Action = Callable[[Printer, int], str | None]
"""Carries out a code with the parameter `n`; gives what went wrong."""


@dataclass(frozen=True, slots=True)
class ControlCode:
    """One control code."""

    name: str  # as the manuals write it: "ESC US n"
    meaning: str  # what the printer does; for a code that is not supported, also what happens instead
    action: Action | Ignored
    parameters: int  # bytes that follow the code and belong to it


ESC: Final = 0x1B
SUB: Final = 0x1A

_LOW = "NUL SOH STX ETX EOT ENQ ACK BEL BS HT LF VT FF CR SO SI"
_HIGH = "DLE DC1 DC2 DC3 DC4 NAK SYN ETB CAN EM SUB ESC FS GS RS US"
_BYTES = {name: byte for byte, name in enumerate(f"{_LOW} {_HIGH}".split())} | {"DEL": 0x7F}


def _codes(prefix: str, table: Mapping[str, tuple[str, Action | Ignored]]) -> dict[int, ControlCode]:
    """Codes by the byte of which the manuals give the letter, or the name in ASCII."""
    codes: dict[int, ControlCode] = {}
    for name, (meaning, action) in table.items():
        word = name.removesuffix(" n")
        byte = _BYTES[word] if word in _BYTES else ord(word)
        codes[byte] = ControlCode(prefix + name, meaning, action, parameters=int(name != word))
    return codes


def _less_one(what: str, action: Action) -> Action:
    """The parameter is sent with one added, so that none is a NUL."""
    return lambda p, n: action(p, n - 1) if n else f"{what} below zero; ignored"


def _only(letter: str, action: Action) -> Action:
    """The parameter chooses among functions, of which there is one."""
    return lambda p, n: action(p, n) if n == ord(letter) else f"function {n:02X} hex is not supported; ignored"


CONTROL: Final = _codes("", {
    "NUL": ("filler", Ignored.ACCEPTED),
    "ETX": ("end of a block, answered by ACK on a serial line", Ignored.ACCEPTED),
    "BEL": ("bell", Ignored.ACCEPTED),
    "BS": ("carriage back by one motion index", lambda p, _: p.move(-(2 if p.modes.graphics else p.hmi))),
    "HT": ("carriage to the next tab stop", lambda p, _: p.next_tab()),
    "LF": ("paper up by one line", lambda p, _: p.feed(2)),
    "VT": ("paper up to the next vertical tab stop", lambda p, _: p.next_vertical_tab()),
    "FF": ("paper up to the next page", lambda p, _: p.paper.form_feed()),
    "CR": ("carriage to the left margin; ends the modes of the line", lambda p, _: p.carriage_return()),
    "DC1": ("transmission on", Ignored.ACCEPTED),
    "DC3": ("transmission off", Ignored.ACCEPTED),
    "DEL": ("filler", Ignored.ACCEPTED),
})  # fmt: skip
"""Codes of one byte. SUB and ESC are taken up before this table is asked."""

ESCAPE: Final = _codes("ESC ", {
    # -- places and distances
    "US n": ("horizontal motion index n-1 [1/120 in]", _less_one("motion index", lambda p, n: put(p, hmi=n))),
    "RS n": ("vertical motion index n-1 [1/48 in]", _less_one("motion index", lambda p, n: put(p, vmi=n))),
    "HT n": ("carriage to print position n-1, counted in motion indices",
             _less_one("print position", lambda p, n: put(p, column=n * p.hmi))),
    "VT n": ("paper to line n-1 of the page", _less_one("line", lambda p, n: p.line_at(n * 2 * p.vmi))),
    "FF n": ("n lines per page; the page begins here", lambda p, n: p.set_page(n)),
    "DC1 n": ("offset added to the advance of every character", lambda p, n: p.set_offset(n)),
    "S": ("motion index back to the spacing switch, ten characters per inch", lambda p, _: put(p, hmi=WHEEL_PITCH)),
    # -- margins and tab stops
    "9": ("left margin here", lambda p, _: put(p, left_margin=p.column)),
    "0": ("right margin here; it bounds only justified and centred text", Ignored.ACCEPTED),
    "T": ("top margin here", lambda p, _: put(p.paper, top_margin=p.paper.from_top)),
    "L": ("bottom margin here", lambda p, _: put(p.paper, bottom_margin=p.paper.from_top)),
    "C": ("top and bottom margins cleared", lambda p, _: p.paper.clear_margins()),
    "1": ("tab stop here", lambda p, _: p.tab_stops.add(p.column)),
    "8": ("tab stop here cleared", lambda p, _: p.tab_stops.discard(p.column)),
    "-": ("vertical tab stop here", lambda p, _: p.vertical_stops.add(p.paper.from_top)),
    "2": ("all tab stops cleared", lambda p, _: put(p, tab_stops=set[int](), vertical_stops=set[int]())),
    # -- single motions
    "BS": ("carriage back by 1/120 inch", lambda p, _: p.move(-1)),
    "LF": ("paper down by one line", lambda p, _: p.feed(-2)),
    "U": ("paper up by half a line", lambda p, _: p.feed(1)),
    "D": ("paper down by half a line", lambda p, _: p.feed(-1)),
    # -- direction of printing
    "5": ("forward printing", lambda p, _: put(p.modes, backward=False)),
    "6": ("backward printing: the carriage moves left after every character", lambda p, _: put(p.modes, backward=True)),
    "/": ("the printer chooses the direction of each line", Ignored.ACCEPTED),
    "\\": ("every line is printed to the right", Ignored.ACCEPTED),
    "<": ("reverse printing; the lines are printed as they come", Ignored.NOT_SUPPORTED),
    ">": ("reverse printing off", Ignored.ACCEPTED),
    "?": ("new line of itself at the right end of the print line", lambda p, _: put(p, auto_return=True)),
    "!": ("no new line of itself", lambda p, _: put(p, auto_return=False)),
    # -- what a character looks like
    "O": ("bold: every character struck twice", lambda p, _: put(p.modes, bold=True)),
    "W": ("shadow: every character struck again 1/120 inch to the right", lambda p, _: put(p.modes, shadow=True)),
    "&": ("bold and shadow off", lambda p, _: put(p.modes, bold=False, shadow=False)),
    "E": ("underscore on", lambda p, _: put(p.modes, underscore=True)),
    "R": ("underscore off", lambda p, _: put(p.modes, underscore=False)),
    "A": ("secondary ribbon colour", lambda p, _: put(p, red=True)),
    "B": ("primary ribbon colour", lambda p, _: put(p, red=False)),
    "7": ("characters to the end of the line move the carriage and print nothing",
          lambda p, _: put(p.modes, suppressed=True)),
    "P": ("proportional spacing; its widths belong to a wheel, the motion index stays in force", Ignored.NOT_SUPPORTED),
    "Q": ("proportional spacing off", Ignored.ACCEPTED),
    # -- modes of text and graphics
    "3": ("graphics: blanks of 1/60 inch, lines of 1/48 inch, characters do not advance",
          lambda p, _: put(p.modes, graphics=True)),
    "4": ("graphics off", lambda p, _: put(p.modes, graphics=False)),
    "X": ("bold, shadow, underscore, offset and program mode off", lambda p, _: p.end_word_processing()),
    "=": ("centring; the line is printed where it comes", Ignored.NOT_SUPPORTED),
    "M": ("justification; the line is printed where it comes", Ignored.NOT_SUPPORTED),
    "%": ("longer time for the carriage to settle", Ignored.ACCEPTED),
    "N": ("usual time for the carriage to settle", Ignored.ACCEPTED),
    "G": ("vector graphics; what follows is printed as characters", Ignored.NOT_SUPPORTED),
    # -- codes that select among functions by the byte that follows
    "CR n": ("reset, for n = P", _only("P", lambda p, _: p.reset())),
    "SUB n": ("reset, for n = I; otherwise remote diagnosis", _only("I", lambda p, _: p.reset())),
    "SO n": ("program mode, for n = M: a byte of hammer force after each character",
             _only("M", lambda p, _: put(p, program_mode=True))),
    "EM n": ("sheet feeder; the paper is left where it is", Ignored.NOT_SUPPORTED),
    "SYN n": ("download; ignored", Ignored.NOT_SUPPORTED),
    "CAN n": ("special function; ignored", Ignored.NOT_SUPPORTED),
    "GS n": ("special function; ignored", Ignored.NOT_SUPPORTED),
})  # fmt: skip
"""Codes that begin with ESC, by the byte after it."""

WHEEL_CHARACTERS: Final[dict[int, str]] = {ord("Y"): "\N{CENT SIGN}", ord("Z"): "\N{NOT SIGN}"}
"""Characters of the wheel under codes 20 and 7F hex, which mean a blank and a filler; ESC Y and ESC Z print them."""


# ---- the stream


def parse_diablo(data: bytes, name: str = "job") -> PrintJob:
    """Read a Diablo 630 stream.

    >>> job = parse_diablo(bytes([0x1B, 0x1F, 11]) + b"ab", "elite")
    >>> [(c.char, c.column) for c in job.lines[0].characters]
    [('a', 0), ('b', 10)]
    """
    reader = _Reader(data)
    while reader.at < len(data):
        reader.read_code()
    return reader.job(name, "diablo630")


class _Reader(Reading):
    """Reads `data` code by code; what reads one gives what its bytes count as."""

    def __init__(self, data: bytes) -> None:
        super().__init__()
        self.data = data
        self.printer = Printer(self.paper)

    def read_code(self) -> None:
        """Read one character or one control code with its parameters, and account for its bytes."""
        start = self.at
        byte = self.data[start]
        self.at += 1
        if byte == ESC:
            kind = self._read_escape(start)
        elif byte == SUB:
            kind = self._read_end(start)
        elif 0x20 <= byte < 0x7F:
            kind = self._read_character(chr(byte), start)
        elif byte in CONTROL:
            kind = self._obey(CONTROL[byte], start)
        else:
            kind = self.note(start, f"{byte:02X} hex", "no such character or code; ignored")
        self.account[kind] += self.at - start

    def _read_end(self, start: int) -> str:
        rest = self.data[start:]
        self.at = len(self.data)
        padding = "" if rest.strip(bytes([SUB])) == b"" else " which are not all padding"
        return self.note(start, "SUB", f"end of a CP/M file; the last {len(rest)} bytes{padding} are not read")

    def _read_character(self, char: str, start: int) -> str:
        if self.printer.program_mode and self.at < len(self.data):
            self.at += 1  # the byte of hammer force
        inked, trouble = self.printer.print_character(char)
        if trouble:
            self.note(start, f'"{char}"', trouble)
        if inked:
            return "printed"
        return "noted" if trouble else "interpreted"

    def _read_escape(self, start: int) -> str:
        if self.at == len(self.data):
            return self.note(start, "ESC", "the job ends inside a control code; ignored")
        byte = self.data[self.at]
        if byte == ESC:
            return self.note(start, "ESC", "another ESC follows; this one is ignored")
        self.at += 1
        if byte in WHEEL_CHARACTERS:
            return self._read_character(WHEEL_CHARACTERS[byte], start)
        if byte not in ESCAPE:
            shown = chr(byte) if 0x20 < byte < 0x7F else f"{byte:02X} hex"
            return self.note(start, f"ESC {shown}", "unknown control code; ignored")
        code = ESCAPE[byte]
        if self.at + code.parameters > len(self.data):
            return self.note(start, code.name, "the job ends inside this control code; ignored")
        self.at += code.parameters
        return self._obey(code, start)

    def _obey(self, code: ControlCode, start: int) -> str:
        if code.action is Ignored.ACCEPTED:
            self.accepted[code.name] += 1
            return "accepted"
        if code.action is Ignored.NOT_SUPPORTED:
            return self.note(start, code.name, f"not supported: {code.meaning}")
        trouble = code.action(self.printer, self.data[self.at - 1])
        return self.note(start, code.name, trouble) if trouble else "interpreted"
