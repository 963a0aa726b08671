"""Files of moves as comma-separated values: the header names the columns with their units, each line is a move."""

import csv
import difflib
import re
from collections.abc import Iterator
from dataclasses import dataclass

from detent.planning.move_job import MOST_MOVES, MoveJob
from detent.simulation.move_rows import (
    EXAMPLE_UNITS,
    ONE_WAY,
    UNITS,
    MoveRows,
    RefusedValueError,
    check_count,
    read_quantity,
    short,
)
from detent.units import QuantityError, describe_kind, parse_quantity

_NAMES = ", ".join(f"{name} [{EXAMPLE_UNITS[unit]}]" if unit else name for name, unit in UNITS.items())
_HEADING = re.compile(r"([^\[\]]*?)\s*(?:\[\s*([^\[\]]*?)\s*\])?")
_POINT_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?")
_COMMA_NUMBER = re.compile(_POINT_NUMBER.pattern.replace(r"\.", ","))
_WHOLE_NUMBER = re.compile(r"([+-]?)0*([0-9]{1,9})")


def parse_move_csv(file: str, text: str) -> MoveJob:
    """Read a file of moves from comma-separated values.

    The first line that is neither empty nor a comment (``#``) names the columns, in any order: ``target [mm]`` or
    ``by [mm]`` or both, and where wanted ``dwell [ms]``, ``repeat``, ``speed [mm/s]``, ``sample_period [ms]``. Cells
    are plain numbers in the unit of their column; an empty cell, or one that a short line lacks, says nothing.
    Separators are commas, or semicolons if the header has one; then numbers may have a decimal comma.

    Parameters
    ----------
    file : str
        The file as the user named it.
    text : str
        Its text.

    Returns
    -------
    MoveJob
        With at least one move.

    Raises
    ------
    InputError
        All that is wrong, each with line and column.
    """
    rows = MoveRows(file)
    lines = _telling_lines(text)
    number, header = next(lines, (0, ""))
    table = _Table(rows, ";" if ";" in header else ",")
    if number:
        table.read_header(number, header)
    for number, line in lines if table.columns else ():
        if rows.is_over:
            break
        table.read_line(number, line)
    return rows.to_job()


def _telling_lines(text: str) -> Iterator[tuple[int, str]]:
    """Lines that say something, with their numbers."""
    for number, line in enumerate(text.replace("\r\n", "\n").replace("\r", "\n").split("\n"), start=1):
        if line.strip() and not line.lstrip().startswith("#"):
            yield number, line


@dataclass(frozen=True, slots=True)
class _Column:
    """What the header says about a column; no name where it could not be read."""

    name: str = ""
    unit: str = ""


class _Table:
    """Reads the lines of one table."""

    def __init__(self, rows: MoveRows, separator: str) -> None:
        self._rows = rows
        self._separator = separator
        self._is_whole = False  # every column has a meaning, and one of them says where to
        self.columns: list[_Column] = []

    def read_header(self, number: int, line: str) -> None:
        """Read the names and units of the columns; none of them if the line is no header."""
        cells = self._split(number, line)
        if not cells:
            return
        while cells and not cells[-1]:  # spreadsheets end lines with empty cells
            cells.pop()
        if not any(cell.partition("[")[0].strip().lower() in UNITS for cell in cells):
            remedy = f"begin with a header such as target [mm]{self._separator}dwell [ms]"
            self._rows.refuse((number, 1), "", f'"{short(line.strip())}"', f"names of columns: {_NAMES}", remedy)
            return
        for index, cell in enumerate(cells):
            try:
                self.columns.append(self._read_heading(cell))
            except RefusedValueError as error:
                place = number, _place_of(line, index, self._separator)
                self._rows.refuse(place, "", error.came, error.allowed, error.remedy)
                self.columns.append(_Column())
        names = {column.name for column in self.columns}
        self._is_whole = "" not in names
        if self._is_whole and not {"target", "by"} & names:
            remedy = "add a column target [mm] or by [mm]"
            self._rows.refuse((number, 1), "", f'"{short(line.strip())}"', "a column target or by", remedy)
            self._is_whole = False

    def _read_heading(self, cell: str) -> _Column:
        """Read name and unit of a column."""
        match = _HEADING.fullmatch(cell)
        name, unit = match.groups() if match else (cell, None)
        if name not in UNITS:
            near = difflib.get_close_matches(name.lower(), UNITS, n=1, cutoff=0.6)
            remedy = f'did you mean "{near[0]}"?' if near else "remove the column"
            raise RefusedValueError(f'the unknown column "{short(cell)}"', _NAMES, remedy)
        if any(name == column.name for column in self.columns):
            raise RefusedValueError(f'a second column "{name}"', "each column once", "remove one of the two")
        if not UNITS[name] and unit is not None:
            raise RefusedValueError(f'"{short(cell)}"', "a count, without a unit", f"write {name}")
        if UNITS[name]:
            _check_unit(name, unit or "", short(cell))
        return _Column(name, unit or "")

    def read_line(self, number: int, line: str) -> None:
        """Read one move."""
        cells = self._split(number, line)
        stated = {index: cell for index, cell in enumerate(cells) if cell}
        if any(index >= len(self.columns) for index in stated):
            self._refuse_excess(number, line, cells)
            return
        values: dict[str, float] = {}
        known = len(self._rows.problems)
        for index, cell in stated.items():
            column = self.columns[index]
            try:
                if column.name:
                    values[column.name] = self._read_cell(column, cell)
            except RefusedValueError as error:
                place = number, _place_of(line, index, self._separator)
                came = error.came or f"{short(cell)} {column.unit}".rstrip()
                self._rows.refuse(place, column.name, came, error.allowed, error.remedy)
        if stated:
            self._check_way(number, line, {self.columns[index].name for index in stated})
        if values and self._is_whole and len(self._rows.problems) == known:
            self._rows.add(number, values)

    def _refuse_excess(self, number: int, line: str, cells: list[str]) -> None:
        """Refuse a line with more cells than columns."""
        remedy = "remove the cells beyond, or name their columns in the header"
        if self._separator == ",":
            remedy += "; separate cells by semicolons where numbers have decimal commas"
        place = number, _place_of(line, len(self.columns), self._separator)
        self._rows.refuse(place, "", f"{len(cells)} cells", f"{len(self.columns)} as in the header", remedy)

    def _check_way(self, number: int, line: str, stated: set[str]) -> None:
        """Refuse a line with both a place and a way, or with neither."""
        ways = [index for index, column in enumerate(self.columns) if column.name in {"target", "by"}]
        if {"target", "by"} <= stated:
            came, remedy, index = "target and by", "leave one of the two cells empty", ways[-1]
        elif self._is_whole and not {"target", "by"} & stated:
            came, remedy, index = "an empty cell", "write a number", ways[0]
        else:
            return
        place = number, _place_of(line, index, self._separator)
        self._rows.refuse(place, self.columns[index].name, came, ONE_WAY, remedy)

    def _read_cell(self, column: _Column, cell: str) -> float:
        """Read one number."""
        if column.name == "repeat":
            return _read_count(cell)
        number = cell
        if self._separator == ";" and _COMMA_NUMBER.fullmatch(cell):
            number = cell.replace(",", ".")
        if _POINT_NUMBER.fullmatch(number):
            return read_quantity(column.name, f"{number} {column.unit}")
        remedy = f"write the number alone; its unit, {column.unit}, stands in the header"
        if _COMMA_NUMBER.fullmatch(cell):
            remedy = "write a decimal point, or separate cells by semicolons"
        raise RefusedValueError(f'"{short(cell)}"', "a plain number such as 12.5", remedy)

    def _split(self, number: int, line: str) -> list[str]:
        """Cells of a line, without the blanks around them; none, and a problem, where quotes do not close."""
        try:
            (cells,) = csv.reader([line], delimiter=self._separator, skipinitialspace=True, strict=True)
        except csv.Error as error:
            allowed = "cells separated by commas or semicolons"
            remedy = f"remove the quotation marks ({error})"
            self._rows.refuse((number, 1), "", short(line.strip()), allowed, remedy)
            return []
        return [cell.strip() for cell in cells]


def _check_unit(name: str, unit: str, cell: str) -> None:
    """Refuse a unit that a column cannot have."""
    kind, _ = describe_kind(UNITS[name])
    try:
        parse_quantity(f"1 {unit}", UNITS[name])
    except QuantityError as error:
        came = f"{error.reason}, in {cell}" if unit else f'"{cell}" without a unit'
        remedy = f"write {name} [{EXAMPLE_UNITS[UNITS[name]]}]"
        raise RefusedValueError(came, f"the unit of {kind} in brackets", remedy) from None


def _read_count(cell: str) -> int:
    """Read a number of repeats."""
    match = _WHOLE_NUMBER.fullmatch(cell)
    if match is None:
        raise RefusedValueError(
            f'"{short(cell)}"', f"a whole number from 1 to {MOST_MOVES}", "write a whole number, as in 3"
        )
    return check_count(int(match.group(1) + match.group(2)))


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
