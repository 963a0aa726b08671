"""Recordings as text tables: comma-separated values in all their dialects."""

import csv
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from detent.errors import FileProblem, InputError
from detent.files.text import read_bytes, short
from detent.logs.csv_layout import CsvLayout, FileOptions, guess_layout, is_telling, read_cell, split_lines
from detent.logs.raw_table import BrokenRow, Item, RawTable, check_size

MAX_BYTES = 200_000_000  # longest text table read, unpacked: two hours of ten signals, 200 times a second, are 150 MB
ALLOWED = "a table as text: CSV, packed with gzip or not"

BLOCK_ROWS = 16384  # rows whose cells are in memory as text at once
_MOST_BROKEN = 0.2
_UTF16 = (b"\xff\xfe", b"\xfe\xff")


def read_csv(path: Path, options: FileOptions) -> RawTable:
    """Read a text table.

    Rows that do not fit the header, or hold what is no number in a column of numbers, are put aside as broken.
    """
    table = RawTable(str(path))
    lines = decode(path, read_bytes(path, MAX_BYTES, ALLOWED), table).splitlines()
    try:
        layout = guess_layout(table, lines, options)
        numbers = [index for index in range(layout.first, len(lines)) if is_telling(lines[index])]
        check_size(table.file, len(numbers), len(layout.names))
        _read_rows(table, layout, lines, numbers)
    except csv.Error as error:
        came = f"cells that cannot be told apart ({error})"
        raise InputError.of_file(table.file, came, ALLOWED, "remove the quotation marks, or state separator=") from None
    if len(table.broken) > _MOST_BROKEN * len(numbers) and len(table.broken) > 2:
        worst = table.broken[0]
        line = numbers[worst.row - 1]
        came = f"{short(lines[line].strip())} ({worst.reason}; {len(table.broken)} of {len(numbers)} rows are broken)"
        allowed = f"rows of {len(layout.names)} cells as the header has"
        remedy = "state separator=, decimal= or header= (its line)"
        raise InputError([FileProblem(table.file, line + 1, 1, "", came, allowed, remedy)])
    return table


def decode(path: Path, data: bytes, table: RawTable) -> str:
    """Text of a file: UTF-8, UTF-16 with its mark, or else the encoding of western Windows."""
    if data.startswith(_UTF16):
        return data.decode("utf-16", "replace")
    if b"\0" in data:
        raise InputError.of_file(str(path), "NUL bytes, as in a binary file", ALLOWED, "name a file of text")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        table.notes.append("not UTF-8: read as Windows-1252")
        return data.decode("cp1252", "replace")


def _read_rows(table: RawTable, layout: CsvLayout, lines: list[str], numbers: list[int]) -> None:
    """Read all rows, a block at a time, into the columns and the broken rows."""
    cells = split_lines((lines[index] for index in numbers), layout.separator)
    columns = [index for index in range(len(layout.names)) if index not in layout.text_columns]
    pieces: dict[int, list[NDArray[np.generic]]] = {index: [] for index in columns}
    rows: list[NDArray[np.int64]] = []
    first = 1
    while block := list(islice(cells, BLOCK_ROWS)):
        fitting = _sort_out(table, layout, block, first)
        found: list[NDArray[np.generic]] = []
        wrong: dict[int, str] = {}  # of each row that holds no number where it should, the first such cell
        for index in columns:
            column = [block[row][index] for row in fitting]
            values, bad = layout.read(index, column)
            found.append(values)
            wrong = {fitting[place]: column[place] for place in bad} | wrong
        for row, cell in wrong.items():
            _break(table, layout, block[row], first + row, f'"{short(cell)}" is no number')
        keep = np.array([row not in wrong for row in fitting], dtype=np.bool_)
        for index, values in zip(columns, found, strict=True):
            pieces[index].append(values[keep])
        rows.append(np.array(fitting, dtype=np.int64)[keep] + first)
        first += len(block)
    table.rows = np.concatenate(rows) if rows else table.rows
    for index in columns:
        table.add(Item(layout.names[index], np.concatenate(pieces[index]), layout.units[index]))
    table.broken.sort()
    words = [short(layout.names[index]) for index in sorted(layout.text_columns)]
    table.notes += [f"columns of words passed over: {', '.join(words)}"] if words else []


def _sort_out(table: RawTable, layout: CsvLayout, block: list[list[str]], first: int) -> list[int]:
    """Indices of the rows of a block that are as wide as the header; the others are put aside."""
    width = len(layout.names)
    fitting: list[int] = []
    for index, cells in enumerate(block):
        while len(cells) > width and not cells[-1]:
            cells.pop()
        if layout.width <= len(cells) < width:
            cells.extend([""] * (width - len(cells)))
        if len(cells) == width:
            fitting.append(index)
        else:
            _break(table, layout, cells, first + index, f"{len(cells)} cells in place of {width}")
    return fitting


def _break(table: RawTable, layout: CsvLayout, cells: list[str], row: int, reason: str) -> None:
    """Put a row aside."""
    telling = tuple(read_cell(cell, layout.decimal) for cell in cells if cell)
    table.broken.append(BrokenRow(row, telling, reason))
