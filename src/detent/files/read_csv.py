"""Rows as comma-separated values: a header that names keys of the row's model with units, then lines of plain numbers.

The first line that is neither empty nor a comment (``#``) is the header. An empty cell, or one that a short line lacks,
says nothing. Separators are commas, or semicolons if the header has one; then numbers may have a decimal comma.
"""

import csv
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

from pydantic import ValidationError

from detent.errors import MOST_PROBLEMS, FileProblem
from detent.files.fields import describe_allowed, keys_of, type_of, unit_of
from detent.files.locate import Path, Place
from detent.files.problems import Reporter
from detent.files.read import Row, refuse, told_errors
from detent.files.text import did_you_mean, short
from detent.units import QuantityError, describe_kind, parse_quantity

AnyRow = TypeVar("AnyRow", bound=Row)
Made = TypeVar("Made")

_HEADING = re.compile(r"([^\[\]]*?)\s*(?:\[\s*([^\[\]]*?)\s*\])?")
_POINT_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?")
_COMMA_NUMBER = re.compile(_POINT_NUMBER.pattern.replace(r"\.", ","))
_WHOLE_NUMBER = re.compile(r"([+-]?)0*([0-9]{1,19})")


@dataclass(frozen=True, slots=True)
class Column:
    """What the header says about a column: the key of its values, empty where it is not read, and their unit."""

    key: str = ""
    unit: str = ""


@dataclass(frozen=True, slots=True)
class Line:
    """One line that says something: its number from 1, its text, and its cells without the blanks around them."""

    number: int
    text: str
    cells: tuple[str, ...]


class CsvRows(Generic[AnyRow]):
    """The rows of one file, and what is wrong with them."""

    def __init__(self, file: str, text: str, model: type[AnyRow]) -> None:
        self.problems: list[FileProblem] = []
        self._file, self.model = file, model
        self.fields = keys_of(model)
        self._whole_numbers = {key for key, field in self.fields.items() if type_of(field) is int}
        lines = enumerate(re.split(r"\r\n|\r|\n", text), start=1)
        self._lines = ((k, line) for k, line in lines if line.strip() and not line.lstrip().startswith("#"))
        number, header = next(self._lines, (0, ""))
        self.separator = ";" if ";" in header else ","
        cells = list(self._split(number, header)) if number else []
        while cells and not cells[-1]:  # spreadsheets end lines with empty cells
            cells.pop()
        self.header = Line(number, header, tuple(cells))
        self.columns: list[Column] = []
        self.several = frozenset[str]()
        if cells:
            self.read_header()
        self._is_whole = bool(self.columns) and not self.problems

    def read(self, make: Callable[[int, AnyRow], Made], most: int) -> list[Made]:
        """What is made of each line's number and row, in order; no more than `most` and one, or every problem."""
        made: list[Made] = []
        for line in self._rows() if self.columns else ():
            if len(made) > most or len(self.problems) >= MOST_PROBLEMS:
                break
            row = self._read_line(line)
            if row is not None:
                made.append(make(line.number, row))
        if self.problems:
            refuse(self.problems)
        return made

    # ------------------------------------------------------------------------------------------------------ header

    def read_header(self) -> None:
        """Read the columns, if the line is a header and each row can say what it must."""
        names = [split_heading(cell)[0].partition("[")[0].strip().lower() for cell in self.header.cells]
        if not any(name in self.fields for name in names):
            first = self.model.one_of[0]
            other = next(key for key in self.fields if key not in self.model.one_of)
            remedy = f"begin with a header such as {self.heading_of(first)}{self.separator}{self.heading_of(other)}"
            self.refuse_header(f"names of columns: {self._headings()}", remedy)
            return
        for index, cell in enumerate(self.header.cells):
            self.columns.append(self.read_heading(index, cell))
        keys = {column.key for column in self.columns}
        if "" not in keys and not keys.intersection(self.model.one_of):
            headings = " or ".join(self.heading_of(key) for key in self.model.one_of)
            self.refuse_header(f"a column {' or '.join(self.model.one_of)}", f"add a column {headings}")

    def read_heading(self, index: int, cell: str) -> Column:
        """Read key and unit of a column."""
        name, unit = split_heading(cell)
        if name in self.fields:
            return self.column_of(index, name, unit)
        remedy = did_you_mean(name, self.fields, "remove the column")
        return self.refuse_heading(index, f'the unknown column "{short(cell)}"', self._headings(), remedy)

    def column_of(self, index: int, key: str, unit: str | None) -> Column:
        """The column of a key, once its unit is found to be right and no other column is the key's."""
        cell, si_unit = short(self.header.cells[index]), unit_of(self.fields[key])
        if any(key == other.key for other in self.columns) and key not in self.several:
            return self.refuse_heading(index, f'a second column "{key}"', "each column once", "remove one of the two")
        if not si_unit:
            if unit is not None:
                return self.refuse_heading(index, f'"{cell}"', "a heading without a unit", f"write {key}")
            return Column(key)
        try:
            parse_quantity(f"1 {unit or ''}", si_unit)
        except QuantityError as error:
            got = f"{error.reason}, in {cell}" if unit else f'"{cell}" without a unit'
            allowed = f"the unit of {describe_kind(si_unit)[0]} in brackets"
            return self.refuse_heading(index, got, allowed, f"write {self.heading_of(key)}")
        return Column(key, unit or "")

    def heading_of(self, key: str) -> str:
        """A heading that a column of a key could have."""
        unit = unit_of(self.fields[key])
        return f"{key} [{describe_kind(unit)[1].rpartition(' ')[2]}]" if unit else key

    def refuse_heading(self, index: int, got: str, allowed: str, remedy: str) -> Column:
        """Note what is wrong with a heading; the column is not read."""
        place = _place_of(self.header.text, index, self.separator)
        self._note(self.header.number, place, got, allowed, remedy)
        return Column()

    def refuse_header(self, allowed: str, remedy: str) -> None:
        """Note what is wrong with the header as a whole."""
        self._note(self.header.number, 1, f'"{short(self.header.text.strip())}"', allowed, remedy)

    def _headings(self) -> str:
        return ", ".join(self.heading_of(key) for key in self.fields)

    # ------------------------------------------------------------------------------------------------------- lines

    def _rows(self) -> Iterator[Line]:
        """The lines below the header; those that cannot be split, or have cells beyond the columns, are refused."""
        for number, text in self._lines:
            line = Line(number, text, self._split(number, text))
            excess = next((k for k, cell in enumerate(line.cells) if cell and k >= len(self.columns)), None)
            if excess is not None:
                remedy = "remove the cells beyond, or name their columns in the header"
                if self.separator == ",":
                    remedy += "; separate cells by semicolons where numbers have decimal commas"
                got, allowed = f"{len(line.cells)} cells", f"{len(self.columns)} as in the header"
                place = _place_of(text, len(self.columns), self.separator)
                self._note(number, place, got, allowed, remedy)
            elif any(line.cells):
                yield line

    def _read_line(self, line: Line) -> AnyRow | None:
        """The row of a line; None, and problems, where it will not do."""
        known, values, stated = len(self.problems), dict[str, object](), dict[str, str]()
        for index, (column, cell) in enumerate(zip(self.columns, line.cells, strict=False)):
            if cell and column.key:
                stated[column.key] = cell
                value = self._quantity(column, cell) if column.unit else self._value(column.key, cell)
                if isinstance(value, FileProblem):
                    place = _place_of(line.text, index, self.separator)
                    self.problems.append(replace(value, file=self._file, line=line.number, column=place))
                else:
                    values[column.key] = value
        row = None
        try:
            row = self.model.model_validate(values)
        except ValidationError as error:
            told = told_errors(error, self._reporter(line), self.model, is_whole=self._is_whole)
            self.problems += (problem for _, problem, _ in told)
        for fault in self.model.faults(stated, is_whole=self._is_whole):
            self.problems.append(self._reporter(line).placed((), fault))
        return row if self._is_whole and len(self.problems) == known else None

    def _value(self, key: str, cell: str) -> object:
        """A cell without a unit as a TOML file would have it, or its problem, which has no place yet."""
        if key not in self._whole_numbers:
            return cell
        match = _WHOLE_NUMBER.fullmatch(cell)
        if match is None:
            remedy = "write a whole number, as in 3"
            return FileProblem.of_key(key, f'"{short(cell)}"', describe_allowed(self.fields[key]), remedy)
        return int(match.group(1) + match.group(2))

    def _quantity(self, column: Column, cell: str) -> object:
        """Number of a cell with the unit of its column, or its problem, which has no place yet."""
        is_comma = _COMMA_NUMBER.fullmatch(cell) is not None
        number = cell.replace(",", ".") if is_comma and self.separator == ";" else cell
        if _POINT_NUMBER.fullmatch(number):
            return f"{number} {column.unit}"
        remedy = f"write the number alone; its unit, {column.unit}, stands in the header"
        if is_comma:
            remedy = "write a decimal point, or separate cells by semicolons"
        return FileProblem.of_key(column.key, f'"{short(cell)}"', "a plain number such as 12.5", remedy)

    def _reporter(self, line: Line) -> Reporter:
        """Tells where the values of a line stand, those that it lacks too."""
        places: dict[Path, Place] = {(): Place(line.number, 1, "")}
        for index, column in enumerate(self.columns):
            if column.key:
                cell = line.cells[index] if index < len(line.cells) else ""
                place = _place_of(line.text, index, self.separator)
                places[column.key,] = Place(line.number, place, f"{short(cell)} {column.unit}".strip())
        return Reporter(self._file, places, {}, self.model)

    def _split(self, number: int, line: str) -> tuple[str, ...]:
        """Cells of a line, without the blanks around them; none, and a problem, where quotes do not close."""
        try:
            (cells,) = csv.reader([line], delimiter=self.separator, skipinitialspace=True, strict=True)
        except csv.Error as error:
            allowed, remedy = "cells separated by commas or semicolons", f"remove the quotation marks ({error})"
            self._note(number, 1, short(line.strip()), allowed, remedy)
            return ()
        return tuple(cell.strip() for cell in cells)

    def _note(self, line: int, column: int, got: str, allowed: str, remedy: str) -> None:
        self.problems.append(FileProblem(self._file, line, column, "", got, allowed, remedy))


def split_heading(cell: str) -> tuple[str, str | None]:
    """Name and unit of a heading such as ``target [mm]``; None for one without brackets."""
    match = _HEADING.fullmatch(cell)
    name, unit = match.groups() if match else (cell, None)
    return name, unit


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
