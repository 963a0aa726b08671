"""The text of an axis file: read, parsed as far as it can be, with every error of syntax."""

import re
import string
import tomllib
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from detent.errors import FileProblem, InputError
from detent.files.locate import Index, Place, locate_keys
from detent.files.text import decode_utf8, lines_of, read_head, refuse_longer

MAX_BYTES = 1_000_000  # largest axis file read; a real one has a few thousand bytes
MAX_SYNTAX_PROBLEMS = 20  # syntax errors reported at most: a file of another kind would have one in each line
_POSITION = re.compile(r" \(at (?:line (\d+), column (\d+)|end of document)\)$")
_ASSIGNMENT = re.compile(r"\s*[\w.\"' -]+=")
_BEFORE_COMMENT = re.compile(r'(?:[^"#]|"[^"]*"?)*')
_UNQUOTED_QUANTITY = re.compile(r"[+-]?[0-9.]+(?:[eE][+-]?[0-9]+)?\s*[A-Za-z%µΩ][^\"']*")
_UNQUOTED_WORD = re.compile(r"[A-Za-z_][\w -]*")


@dataclass(frozen=True, slots=True)
class Source:
    """An axis file after reading."""

    file: str  # the file as the user named it
    tables: dict[str, Any]  # what TOML makes of the text, lines with syntax errors left out
    places: dict[tuple[str, ...], Place]  # where each key stands
    problems: tuple[FileProblem, ...] = ()  # errors of syntax
    is_whole: bool = True  # False when lines were left out: then a missing key proves nothing
    is_readable: bool = True  # False when not even the tables are trustworthy
    content: bytes = b""  # as it was read; empty for a text that came from no file

    def line_of(self, name: str, number: int) -> int:
        """Line in which a table of a list begins."""
        return self.places[name, Index(number)].line


def read_source(path: Path | str) -> Source:
    """Read and parse an axis file."""
    allowed, remedy = "an axis file (TOML)", "name an axis file; `detent examples` copies one to start from"
    content = read_head(Path(path), MAX_BYTES, allowed, remedy)
    refuse_longer(Path(path), content, MAX_BYTES, remedy)
    return replace(parse_source(str(path), decode_utf8(Path(path), content)), content=content)


def parse_source(file: str, text: str) -> Source:
    """Parse the text of an axis file; each line with a syntax error is reported and left out."""
    problems: list[FileProblem] = []
    lines = lines_of(text)
    trustworthy = True
    while len(problems) < MAX_SYNTAX_PROBLEMS:
        try:
            tables = tomllib.loads("\n".join(lines))
        except (ValueError, RecursionError) as error:
            row, column, reason = _where(error, lines)
            problems.append(_syntax_problem(file, row, column, reason, lines[row - 1] if lines else ""))
            trustworthy = trustworthy and _ASSIGNMENT.match(lines[row - 1]) is not None
            if not trustworthy:
                break
            lines[row - 1] = ""
        else:
            places = locate_keys("\n".join(lines))
            return Source(file, tables, places, tuple(problems), is_whole=not problems)
    return Source(file, {}, {}, tuple(problems), is_whole=False, is_readable=False)


def _where(error: Exception, lines: list[str]) -> tuple[int, int, str]:
    """Line, column and reason of a parser's error; places past the end become the last line that says something."""
    if isinstance(error, RecursionError):
        return _line_with_most("[{", lines), 1, "brackets nested too deeply"
    found = _POSITION.search(str(error))
    reason = str(error)[: found.start()] if found else str(error)
    if found and found.group(1):
        row, column = int(found.group(1)), int(found.group(2))
        return min(row, len(lines)), column, reason
    if found is None:  # the only error without a place is a whole number of thousands of digits
        return _line_with_most(string.digits, lines), 1, reason
    row = next((index for index in range(len(lines), 0, -1) if lines[index - 1].strip()), 1)
    return row, len(lines[row - 1]) + 1, reason


def _line_with_most(chars: str, lines: list[str]) -> int:
    """Line in which these characters stand most often."""
    return max(range(len(lines)), key=lambda index: sum(char in chars for char in lines[index])) + 1


def _syntax_problem(file: str, row: int, column: int, reason: str, line: str) -> FileProblem:
    """Say what is wrong with a line of TOML, with the usual cause named."""
    bare = str(_BEFORE_COMMENT.findall(line)[0]).strip()
    shown = f"`{bare[:60]}{'...' if len(bare) > 60 else ''}`" if bare else "the end of the file"
    key, remedy = next(_usual_causes(bare, reason), ("", f"correct the line ({reason[:1].lower()}{reason[1:]})"))
    return FileProblem(file, row, column, key, shown, 'TOML: `key = value`, text and quantities in "quotes"', remedy)


def _usual_causes(line: str, reason: str) -> Iterator[tuple[str, str]]:
    """Key and remedy of the slips people make most."""
    key, equals, value = (part.strip() for part in line.partition("="))
    if equals and not value:
        yield key, f"give {key} a value, or remove the line"
    if "4300 digits" in reason:
        yield key, "write a number of fewer digits"
    if equals and _UNQUOTED_QUANTITY.fullmatch(value):
        yield key, f'put the quantity in quotes: {key} = "{value}"'
    if equals and value.lower() in {"true", "false", "yes", "no", "on", "off"}:
        yield key, f"write {key} = {'true' if value.lower() in {'true', 'yes', 'on'} else 'false'}"
    if equals and _UNQUOTED_WORD.fullmatch(value):
        yield key, f'put the text in quotes: {key} = "{value}"'
    if "Cannot overwrite" in reason:
        yield key, "remove one of the two lines that set this key"
    if "Cannot declare" in reason:
        yield line.strip("[] "), "merge this table with the earlier one of the same name"
    if line.count('"') % 2 == 1:
        yield key if equals else "", "close the quotes"
    if line.startswith("[") and "]" not in line:
        yield line.strip("[ "), "close the bracket of the table's name"
    colon = re.fullmatch(r"([\w.]+)\s*:\s*(\S.*)", line)
    if colon:
        yield colon.group(1), f"write = between key and value: {colon.group(1)} = {colon.group(2)}"


@contextmanager
def given_as(name: str, given: object) -> Generator[None]:
    """Tell problems of a job, which knows only the name of its file, with the path that was given."""
    try:
        yield
    except InputError as error:
        if not isinstance(given, str | Path):
            raise
        told = (replace(one, file=str(given)) if one.file == name else one for one in error.problems)
        raise InputError(told) from error
