"""Reads a stream for the Diablo 630 daisy-wheel printer: byte by byte, each one accounted for.

The stream is motion as the word processor meant it: spacing changed within a line, lines sent backwards, bold by
striking again 1/120 inch further. What counts for the axis is where the ink is; in which direction a line is
finally printed is the supervisor's choice (`line_plan`). Reading is total: any bytes give a job, and what could not
be carried out stands in its notes.

Three files share the work: `diablo630_codes` is the table of codes, `diablo630_printer` the mechanism, and here
each code of the table is given its action.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

from detent.methods.print_head.diablo630_codes import CONTROL, ESC, ESCAPE, SUB, WHEEL_CHARACTERS, ControlCode, Handling
from detent.methods.print_head.diablo630_printer import Printer
from detent.methods.print_head.printed_page import AcceptedCode, ByteAccount, JobNote, PrintJob


def parse_diablo(data: bytes, name: str = "job") -> PrintJob:
    """Read a Diablo 630 stream.

    >>> job = parse_diablo(bytes([0x1B, 0x1F, 11]) + b"ab", "elite")
    >>> [(c.char, c.column) for c in job.lines[0].characters]
    [('a', 0), ('b', 10)]
    """
    reader = _Reader(data)
    while reader.at < len(data):
        reader.read_code()
    lines = reader.printer.sheet.lines()
    return PrintJob(
        name=name,
        kind="diablo630",
        lines=lines,
        pages=lines[-1].page if lines else 0,
        notes=tuple(reader.notes),
        accepted=tuple(AcceptedCode(c.name, c.meaning, n) for c, n in reader.accepted.items()),
        length_bytes=len(data),
        account=ByteAccount(**reader.account),
    )


@dataclass(slots=True)
class _Reader:
    """Where the reading of `data` stands, and what became of the bytes so far."""

    data: bytes
    at: int = 0  # next byte
    printer: Printer = field(default_factory=Printer)
    notes: list[JobNote] = field(default_factory=list[JobNote])
    accepted: Counter[ControlCode] = field(default_factory=Counter[ControlCode])
    account: Counter[str] = field(default_factory=Counter[str])

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
            kind = self._obey(CONTROL[byte], 0, start)
        else:
            kind = self.note(start, f"{byte:02X} hex", "no such character or code; ignored")
        self.account[kind] += self.at - start

    def note(self, offset: int, code: str, text: str) -> str:
        """Note what could not be carried out; gives the kind of its bytes."""
        self.notes.append(JobNote(offset, code, text))
        return "noted"

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
        code = ESCAPE.get(byte)
        if code is None:
            shown = chr(byte) if 0x20 < byte < 0x7F else f"{byte:02X} hex"
            return self.note(start, f"ESC {shown}", "unknown control code; ignored")
        if self.at + code.parameters > len(self.data):
            return self.note(start, code.name, "the job ends inside this control code; ignored")
        self.at += code.parameters
        return self._obey(code, self.data[self.at - 1], start)

    def _obey(self, code: ControlCode, parameter: int, start: int) -> str:
        if code.handling is Handling.ACCEPTED:
            self.accepted[code] += 1
            return "accepted"
        if code.handling is Handling.NOT_SUPPORTED:
            return self.note(start, code.name, f"not supported: {code.meaning}")
        trouble = ACTIONS[code.name](self.printer, parameter)
        return self.note(start, code.name, trouble) if trouble else "interpreted"


ACTIONS: dict[str, Callable[[Printer, int], str]] = {
    "BS": lambda p, _: p.move(-(2 if p.modes.graphics else p.hmi)),
    "HT": lambda p, _: p.next_tab(),
    "LF": lambda p, _: p.feed(2),
    "VT": lambda p, _: p.next_vertical_tab(),
    "FF": lambda p, _: p.form_feed(),
    "CR": lambda p, _: p.carriage_return(),
    "ESC US n": lambda p, n: p.set_hmi(n),
    "ESC RS n": lambda p, n: p.set_vmi(n),
    "ESC HT n": lambda p, n: p.tab_to(n),
    "ESC VT n": lambda p, n: p.line_at((n - 1) * 2 * p.vmi) if n else "line below zero; ignored",
    "ESC FF n": lambda p, n: p.set_page(n),
    "ESC DC1 n": lambda p, n: p.set_offset(n),
    "ESC S": lambda p, _: p.restore_hmi(),
    "ESC 9": lambda p, _: p.set_left_margin(),
    "ESC T": lambda p, _: p.set_top_margin(),
    "ESC L": lambda p, _: p.set_bottom_margin(),
    "ESC C": lambda p, _: p.clear_margins(),
    "ESC 1": lambda p, _: p.set_tab(),
    "ESC 8": lambda p, _: p.clear_tab(),
    "ESC -": lambda p, _: p.set_vertical_tab(),
    "ESC 2": lambda p, _: p.clear_all_tabs(),
    "ESC BS": lambda p, _: p.move(-1),
    "ESC LF": lambda p, _: p.feed(-2),
    "ESC U": lambda p, _: p.feed(1),
    "ESC D": lambda p, _: p.feed(-1),
    "ESC 5": lambda p, _: p.set_mode("backward", on=False),
    "ESC 6": lambda p, _: p.set_mode("backward", on=True),
    "ESC ?": lambda p, _: p.set_auto_return(on=True),
    "ESC !": lambda p, _: p.set_auto_return(on=False),
    "ESC O": lambda p, _: p.set_mode("bold", on=True),
    "ESC W": lambda p, _: p.set_mode("shadow", on=True),
    "ESC &": lambda p, _: p.off_bold_and_shadow(),
    "ESC E": lambda p, _: p.set_mode("underscore", on=True),
    "ESC R": lambda p, _: p.set_mode("underscore", on=False),
    "ESC A": lambda p, _: p.set_colour(red=True),
    "ESC B": lambda p, _: p.set_colour(red=False),
    "ESC 7": lambda p, _: p.set_mode("suppressed", on=True),
    "ESC 3": lambda p, _: p.set_mode("graphics", on=True),
    "ESC 4": lambda p, _: p.set_mode("graphics", on=False),
    "ESC X": lambda p, _: p.end_word_processing(),
    "ESC CR n": lambda p, n: p.select(n, "P", p.reset),
    "ESC SUB n": lambda p, n: p.select(n, "I", p.reset),
    "ESC SO n": lambda p, n: p.select(n, "M", p.start_program_mode),
}
"""What carries out each code of the tables, by its name; gives what went wrong, or nothing."""
