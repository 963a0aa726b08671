"""Print jobs: read a file, find out what it is, and say which character stands where.

Two kinds of job are read: plain text (ten characters and six lines per inch), and streams for the Diablo 630
daisy-wheel printer (`diablo630`). The content decides, not the name of the file. A TOML file names one of these, and
the parameters that change while it is printed.
"""

import re
import unicodedata
from dataclasses import replace
from os import PathLike
from pathlib import Path

from detent.errors import InputError
from detent.files.fields import Table, required
from detent.files.read import read_tables
from detent.files.source import parse_source
from detent.files.text import MAX_BYTES, read_text, reading, refuse_longer
from detent.methods.changes import ChangeRow, change_rows, read_changes
from detent.methods.print_head.diablo630 import parse_diablo
from detent.methods.print_head.printed_page import LINE, WHEEL_PITCH, PrintedCharacter, PrintJob, Reading

TAB_WIDTH = 8  # characters between the tab stops of plain text

# Tab, line feed, form feed and carriage return occur in text; a CP/M text ends in SUB. Anything else is a code.
_CONTROL_BYTE = re.compile(rb"[\x00-\x08\x0b\x0e-\x1f]")

# Share of bytes without meaning above which a file is taken for something else. Real streams have none at all.
_MAX_MEANINGLESS_SHARE = 0.1

_WHAT_A_JOB_IS = "a text file, or a stream for the Diablo 630 printer"


class PrintFile(Table, frozen=True):
    """A file to print, and parameters that change meanwhile."""

    print: str = required("file to print, from where this file is", '"letter.txt"')
    parameter_change: list[ChangeRow] = change_rows()


def load_job(path: str | PathLike[str]) -> PrintJob:
    """Read a print job."""
    file = Path(path)
    if file.suffix.lower() != ".toml":
        return _load_print(file)
    source = parse_source(str(file), read_text(file, (".toml",), "a file to print, and what changes meanwhile (.toml)"))
    found = read_tables(source, PrintFile)
    return replace(
        _load_print(file.parent / found.print), name=file.name, changes=read_changes(source, found.parameter_change)
    )


def _load_print(file: Path) -> PrintJob:
    """Read what is to be printed."""
    limit = MAX_BYTES[".txt"]  # whatever the name ends in
    with reading(file, _WHAT_A_JOB_IS, "check the name after --job"), file.open("rb") as stream:
        data = stream.read(limit + 1)
    refuse_longer(file, data, limit, "divide the job among several files")
    if _CONTROL_BYTE.search(data.rstrip(b"\x1a")):
        job = parse_diablo(data, file.name)
        _refuse_rubbish(job, data, str(file))
    else:
        try:
            job = parse_text(data.decode("utf-8"), file.name)
        except UnicodeDecodeError:
            job = parse_text(data.decode("latin-1"), file.name, encoding="latin-1")
    if not job.lines:
        got = "an empty file" if not data else f"{len(data)} bytes without a printable character"
        raise InputError.of_file(
            str(file), got, "a job with at least one character to print", "add some text, or name another file"
        )
    return job


def _refuse_rubbish(job: PrintJob, data: bytes, file: str) -> None:
    """Raise for a stream that has no meaning to a printer, or only at its beginning."""
    notes = [note for note in job.notes if note.code != "SUB"]
    unread = job.length_bytes - next((note.offset for note in job.notes if note.code == "SUB"), job.length_bytes)
    meaningless = max(job.account.noted - unread, sum(byte >= 0x80 for byte in data))
    fillers = data.count(0)  # NUL is filler in a stream, and half of a UTF-16 text
    if meaningless <= _MAX_MEANINGLESS_SHARE * (len(data) - fillers):
        return
    first = f", the first at byte {notes[0].offset} ({notes[0].code})" if notes else ""
    raise InputError.of_file(
        file,
        f"{meaningless} of {len(data)} bytes that mean nothing to a printer{first}",
        _WHAT_A_JOB_IS,
        "name a text file or a printer stream; save a document of a word processor as plain text first",
    )


def parse_text(text: str, name: str = "job", *, encoding: str = "utf-8") -> PrintJob:
    r"""Lay out plain text at ten characters and six lines per inch on eleven-inch pages.

    Tab stops stand every eight characters, a form feed begins a page, a carriage return without line feed goes
    back to overstrike the line, a combining accent is struck over the letter before it.

    >>> job = parse_text("ab\n\n\tc")
    >>> [(line.baseline, line.first_column, line.text) for line in job.lines]
    [(0, 0, 'ab'), (16, 96, 'c')]
    """
    typist = _Typist()
    for char in text:
        length = len(char.encode(encoding, errors="replace"))
        typist.account[typist.type(char)] += length
        typist.at += length
    return typist.job(name, "text")


class _Typist(Reading):
    """Types text onto paper, character by character."""

    column = 0  # [1/120 in]

    def type(self, char: str) -> str:
        """Type one character; gives what its bytes count as."""
        if unicodedata.combining(char):
            self.paper.strike(PrintedCharacter(char, max(0, self.column - WHEEL_PITCH), WHEEL_PITCH))
            return "printed"
        if char.isprintable() and char != " ":
            self.paper.strike(PrintedCharacter(char, self.column, WHEEL_PITCH))
            self.column += WHEEL_PITCH
            return "printed"
        return self._move(char)

    def _move(self, char: str) -> str:
        if char in "\n\r\f":
            self.column = 0
            if char == "\n":
                self.paper.feed(LINE)
            elif char == "\f":
                self.paper.form_feed()
        elif char == "\t":
            tab = TAB_WIDTH * WHEEL_PITCH
            self.column = (self.column // tab + 1) * tab
        elif unicodedata.category(char) == "Zs":
            self.column += WHEEL_PITCH
        else:
            # A control code is named by its byte, another character by its code point.
            code = f"{ord(char):02X} hex" if ord(char) < 0x100 else f"U+{ord(char):04X}"
            return self.note(self.at, code, "not a printable character; ignored")
        return "interpreted"
