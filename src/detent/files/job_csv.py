"""Job files as comma-separated values: a header that names columns with their units, then lines of plain numbers.

The first line that is neither empty nor a comment (``#``) is the header. An empty cell, or one that a short line lacks,
says nothing. Separators are commas, or semicolons if the header has one; then numbers may have a decimal comma.
"""

import csv
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from detent.errors import FileProblem
from detent.files.job_rows import check_count
from detent.files.job_values import RefusedValueError, short
from detent.methods.moves.job import MOST_MOVES
from detent.units import QuantityError, describe_kind, parse_quantity

_HEADING = re.compile(r"([^\[\]]*?)\s*(?:\[\s*([^\[\]]*?)\s*\])?")
_POINT_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?")
_COMMA_NUMBER = re.compile(_POINT_NUMBER.pattern.replace(r"\.", ","))
_WHOLE_NUMBER = re.compile(r"([+-]?)0*([0-9]{1,9})")


@dataclass(frozen=True, slots=True)
class Column:
    """What the header says about a column."""

    name: str = ""  # key of its values; empty for a column that is not read
    unit: str = ""  # unit of its numbers, as the user wrote it


@dataclass(frozen=True, slots=True)
class Line:
    """One line that says something: its number from 1, its text, and its cells without the blanks around them."""

    number: int
    text: str
    cells: tuple[str, ...]

    @property
    def stated(self) -> dict[int, str]:
        """Cells that are not empty, by their index."""
        return {index: cell for index, cell in enumerate(self.cells) if cell}


class JobTable:
    """The lines of one file, and what is wrong with them."""

    def __init__(self, file: str, text: str, problems: list[FileProblem]) -> None:
        self._file, self.problems = file, problems
        self._lines = _telling_lines(text)
        number, header = next(self._lines, (0, ""))
        self.separator = ";" if ";" in header else ","  # between cells
        cells = list(self._split(number, header)) if number else []
        while cells and not cells[-1]:  # spreadsheets end lines with empty cells
            cells.pop()
        # the header; without cells where there is none, or where it cannot be read
        self.header = Line(number, header, tuple(cells))
        self.columns: list[Column] = []  # one per cell of the header, once `read_header` has been called

    def read_header(self, read_heading: Callable[[str], Column]) -> None:
        """Read the columns, each with a function that may refuse it."""
        for index, cell in enumerate(self.header.cells):
            column = Column()
            try:
                column = read_heading(cell)
            except RefusedValueError as error:
                self.refuse(self.header, index, error)
            self.columns.append(column)

    def lines(self) -> Iterator[Line]:
        """The lines below the header; those that cannot be split, or have cells beyond the columns, are refused."""
        for number, text in self._lines:
            line = Line(number, text, self._split(number, text))
            if any(index >= len(self.columns) for index in line.stated):
                self._refuse_excess(line)
            elif line.stated:
                yield line

    def read_line(self, line: Line, read_cell: Callable[[Column, str], float]) -> dict[str, float]:
        """Values of a line by the names of their columns, each read with a function that may refuse it."""
        values: dict[str, float] = {}
        for index, cell in line.stated.items():
            column = self.columns[index]
            try:
                if column.name:
                    values[column.name] = read_cell(column, cell)
            except RefusedValueError as error:
                self.refuse(line, index, error)
        return values

    def quantity(self, column: Column, cell: str) -> str:
        """Number of a cell with the unit of its column, as `detent.units.parse_quantity` reads it."""
        number = cell
        if self.separator == ";" and _COMMA_NUMBER.fullmatch(cell):
            number = cell.replace(",", ".")
        if _POINT_NUMBER.fullmatch(number):
            return f"{number} {column.unit}"
        remedy = f"write the number alone; its unit, {column.unit}, stands in the header"
        if _COMMA_NUMBER.fullmatch(cell):
            remedy = "write a decimal point, or separate cells by semicolons"
        raise RefusedValueError(f'"{short(cell)}"', "a plain number such as 12.5", remedy)

    def refuse(self, line: Line, index: int, error: RefusedValueError) -> None:
        """Note what is wrong with a cell, or with the whole line where there is no such column yet."""
        column = self.columns[index] if line is not self.header and index < len(self.columns) else Column()
        cell = line.cells[index] if index < len(line.cells) else ""
        came = error.came or f"{short(cell)} {column.unit}".rstrip()
        self._note(line.number, _place_of(line.text, index, self.separator), column.name, came, error)

    def refuse_header(self, error: RefusedValueError) -> None:
        """Note what is wrong with the header as a whole; what came is its text unless the error says otherwise."""
        came = error.came or f'"{short(self.header.text.strip())}"'
        self._note(self.header.number, 1, "", came, error)

    def _refuse_excess(self, line: Line) -> None:
        """Refuse a line with more cells than columns."""
        remedy = "remove the cells beyond, or name their columns in the header"
        if self.separator == ",":
            remedy += "; separate cells by semicolons where numbers have decimal commas"
        error = RefusedValueError(f"{len(line.cells)} cells", f"{len(self.columns)} as in the header", remedy)
        self.refuse(line, len(self.columns), error)

    def _split(self, number: int, line: str) -> tuple[str, ...]:
        """Cells of a line, without the blanks around them; none, and a problem, where quotes do not close."""
        try:
            (cells,) = csv.reader([line], delimiter=self.separator, skipinitialspace=True, strict=True)
        except csv.Error as error:
            allowed, remedy = "cells separated by commas or semicolons", f"remove the quotation marks ({error})"
            self._note(number, 1, "", short(line.strip()), RefusedValueError("", allowed, remedy))
            return ()
        return tuple(cell.strip() for cell in cells)

    def _note(self, line: int, column: int, key: str, came: str, error: RefusedValueError) -> None:
        self.problems.append(FileProblem(self._file, line, column, key, came, error.allowed, error.remedy))


def split_heading(cell: str) -> tuple[str, str | None]:
    """Name and unit of a heading such as ``target [mm]``; None for one without brackets."""
    match = _HEADING.fullmatch(cell)
    name, unit = match.groups() if match else (cell, None)
    return name, unit


def check_unit(name: str, unit: str, si_unit: str, suggested: str, cell: str) -> None:
    """Refuse a unit that a column cannot have."""
    kind, _ = describe_kind(si_unit)
    try:
        parse_quantity(f"1 {unit}", si_unit)
    except QuantityError as error:
        came = f"{error.reason}, in {cell}" if unit else f'"{cell}" without a unit'
        raise RefusedValueError(came, f"the unit of {kind} in brackets", f"write {name} [{suggested}]") from None


def read_count(cell: str) -> int:
    """Read a number of repeats."""
    match = _WHOLE_NUMBER.fullmatch(cell)
    if match is None:
        allowed = f"a whole number from 1 to {MOST_MOVES}"
        raise RefusedValueError(f'"{short(cell)}"', allowed, "write a whole number, as in 3")
    return check_count(int(match.group(1) + match.group(2)))


def _telling_lines(text: str) -> Iterator[tuple[int, str]]:
    """Lines that say something, with their numbers."""
    for number, line in enumerate(text.replace("\r\n", "\n").replace("\r", "\n").split("\n"), start=1):
        if line.strip() and not line.lstrip().startswith("#"):
            yield number, line


def _place_of(line: str, index: int, separator: str) -> int:
    """Column in which a cell begins, from 1; the end of the line where it has no such cell."""
    is_quoted = False
    for place, char in enumerate(line):
        if index == 0 and not char.isspace():
            return place + 1
        if char == '"':
            is_quoted = not is_quoted
        elif char == separator and not is_quoted:
            index -= 1
    return len(line) + 1
