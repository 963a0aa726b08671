"""Recordings as text tables: comma-separated values in all their dialects, read a block of rows at a time."""

import csv
import re
from array import array
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain, islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from detent.errors import FileProblem, InputError
from detent.files.text import lines_of, read_bytes, short
from detent.logs.cells import MISSING, is_moment, is_number, read_cell, read_column, read_moments
from detent.logs.headings import is_unit, split_heading
from detent.logs.log import tell_count
from detent.logs.mapping import SEPARATORS, FileOptions
from detent.logs.parts import MOST_TESTS, Change, changes_of
from detent.logs.raw_table import LARGEST_EXACT, BrokenRow, Item, RawTable, check_size

MAX_BYTES = 200_000_000  # longest text table read, unpacked: two hours of ten signals, 200 times a second, are 150 MB
ALLOWED = "a table as text: CSV, packed with gzip or not"
STRETCH = 1 << 20  # characters whose lines are in memory at once
BLOCK_ROWS = 16384  # rows whose cells are in memory as text at once
_MOST_BROKEN = 0.2
_UTF16 = (b"\xff\xfe", b"\xfe\xff")
SAMPLE_LINES = 200  # lines that say something from which the layout is guessed
_TRIED = ("\t", ";", ",", "|", " ")
_COMMENT = re.compile(r"\s*(#|%|//|\*)\s?")


@dataclass(slots=True)
class CsvLayout:
    """How one text table is laid out."""

    separator: str  # and decimal: as of `FileOptions`, both stated
    decimal: str
    first: int  # index of the first line of numbers
    width: int  # cells of a usual row; less than there are columns where the last are always empty
    # names, units: per column, from the header; a unit is empty where none is stated
    names: list[str] = field(default_factory=list[str])
    units: list[str] = field(default_factory=list[str])
    # text_columns, moment_columns: columns that hold words, and those that hold dates with times of day
    text_columns: set[int] = field(default_factory=set[int])
    moment_columns: set[int] = field(default_factory=set[int])


def read_csv(path: Path, options: FileOptions) -> RawTable:
    """Read a text table; rows that do not fit the header or their columns of numbers are put aside as broken."""
    table = RawTable(str(path))
    text = decode(path, read_bytes(path, MAX_BYTES, ALLOWED), table)
    text = text if "\n" in text else text.replace("\r", "\n")  # old programs end a line in CR alone
    is_quoted = '"' in text
    try:
        text = _unquoted(table, text)
        layout = guess_layout(table, _head(text, options.header or 0), options)
        most = _most_rows(table, layout, text)
        columns = _read_rows(table, layout, _blocks(layout, text, is_quoted=is_quoted), most)
    except csv.Error as error:
        got = f"ambiguous cells ({error})"
        raise InputError.of_file(table.file, got, ALLOWED, "remove the quotation marks, or state separator=") from None
    _check_broken(table, layout, text)
    del text  # as large as the file: no longer needed where the columns are put together
    for index in list(columns):
        table.add(Item(layout.names[index], columns.pop(index).joined(), layout.units[index]))
    words = [short(layout.names[index]) for index in sorted(layout.text_columns)]
    table.notes += [f"text columns skipped: {', '.join(words)}"] if words else []
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


def _lines(text: str, first: int = 0) -> Iterator[str]:
    """Lines of a text, as of `lines_of`, from one of them on: few are in memory at once, each as large as its text."""
    return islice(chain.from_iterable(map(lines_of, _stretches(text))), first, None)


def _stretches(text: str) -> Iterator[str]:
    """A text in stretches of whole lines."""
    first = 0
    while first < len(text):
        last = text.find("\n", first + STRETCH) + 1 or len(text)
        yield text[first:last]
        first = last


def _head(text: str, begin: int) -> list[str]:
    """Lines of a text as far as the layout is guessed from them: `SAMPLE_LINES` that say something, from one on."""
    head: list[str] = []
    left = SAMPLE_LINES
    for index, line in enumerate(_lines(text)):
        head.append(line)
        left -= index >= begin and is_telling(line)
        if not left:
            break
    return head


def _most_rows(table: RawTable, layout: CsvLayout, text: str) -> int:
    """How many rows there are, at most; a table that would fill the memory is refused."""
    most = text.count("\n") + 1
    try:
        check_size(table.file, most, len(layout.names))
    except InputError:  # not every line is a row
        most = sum(map(is_telling, _lines(text, layout.first)))
        check_size(table.file, most, len(layout.names))
    return most


def _check_broken(table: RawTable, layout: CsvLayout, text: str) -> None:
    """Refuse a table of which too many rows are broken: the layout is another."""
    if len(table.broken) <= 2:
        return
    rows = array("q", (k for k, line in enumerate(_lines(text, layout.first), layout.first) if is_telling(line)))
    if len(table.broken) <= _MOST_BROKEN * len(rows):
        return
    worst = table.broken[0]
    place = rows[worst.row - 1]
    line = next(_lines(text, place)).strip()
    got = f"{short(line)} ({worst.reason}; {len(table.broken)} of {len(rows)} rows are broken)"
    allowed = f"rows of {len(layout.names)} cells as the header has"
    remedy = "state separator=, decimal= or header= (its line)"
    raise InputError([FileProblem(table.file, place + 1, 1, "", got, allowed, remedy)])


def _unquoted(table: RawTable, text: str) -> str:
    """Text without the quotation marks around each line that a spreadsheet leaves which took rows for cells."""
    sample = list(islice(filter(is_telling, _lines(text)), SAMPLE_LINES))
    if not sample or not all(line[0] == line.rstrip()[-1] == '"' for line in sample):
        return text
    if any(len(cells) != 1 for separator in "\t;,|" for cells in csv.reader(sample, delimiter=separator)):
        return text
    if not any(separator in cells[0] for cells in csv.reader(_lines(text)) for separator in "\t;,|" if cells):
        return text
    table.notes.append("quotation marks around whole lines left out")
    return "\n".join("".join(cells) for cells in csv.reader(_lines(text)))


Block = list[list[str]] | NDArray[np.float64]  # rows of cells; or of numbers, where all cells are


def _blocks(layout: CsvLayout, text: str, *, is_quoted: bool) -> Iterator[Block]:
    """The rows, a block at a time; what is quoted may go on in the next line."""
    lines = filter(is_telling, _lines(text, layout.first))
    if is_quoted:
        cells = split_lines(lines, layout.separator)
        while block := list(islice(cells, BLOCK_ROWS)):
            yield block
        return
    while told := list(islice(lines, BLOCK_ROWS)):
        found = _all_numbers(layout, told)
        yield list(split_lines(told, layout.separator)) if found is None else found


def _all_numbers(layout: CsvLayout, lines: list[str]) -> NDArray[np.float64] | None:
    """Numbers of lines that hold nothing else, as `read_column` would read them; None where one does."""
    if layout.separator == " " or layout.decimal != "." or layout.text_columns or layout.moment_columns:
        return None
    if "\r" in "".join(lines):  # it ends no line here, and may stand beside a number as a blank may
        lines = [line.replace("\r", " ") for line in lines]
    try:
        found = np.loadtxt(lines, np.float64, comments=None, delimiter=layout.separator, ndmin=2)
    except ValueError:  # a cell that is no number, or lines of different width
        return None
    is_exact = not np.any(np.all(np.abs(found) > LARGEST_EXACT, axis=0))
    return found if is_exact and found.shape == (len(lines), len(layout.names)) else None


class _Column:
    """A column put together of pieces, in memory asked for at once: many small arrays would leave holes behind."""

    def __init__(self, most: int) -> None:
        self._most, self._count = most, 0  # numbers that may come, whose memory is not taken before; those that came
        self._values: NDArray[np.generic] = np.empty(0)

    def append(self, piece: NDArray[np.generic]) -> None:
        """Put a piece behind those before; whole numbers become floats where others are."""
        if not self._count:
            self._values = np.empty(self._most, piece.dtype)
        self._values = self._values.astype(np.result_type(self._values, piece), copy=False)
        first, self._count = self._count, self._count + len(piece)
        self._values[first : self._count] = piece

    def joined(self) -> NDArray[np.generic]:
        """All pieces."""
        return self._values[: self._count]


def _read_rows(table: RawTable, layout: CsvLayout, blocks: Iterable[Block], most: int) -> dict[int, _Column]:
    """Read all rows, at most so many, into the columns of numbers, those of words, and the broken rows."""
    columns = {index: _Column(most) for index in range(len(layout.names)) if index not in layout.text_columns}
    rows = _Column(most)
    texts: dict[int, list[Change]] = {index: [] for index in sorted(layout.text_columns)}
    first = 1
    for block in blocks:
        if isinstance(block, np.ndarray):
            for index, column in columns.items():
                column.append(block[:, index])
            rows.append(np.arange(first, first + len(block)))
        else:
            fitting, keep, across = _read_cells(table, layout, block, first, columns)
            for index, said in texts.items():
                said.extend(changes_of(across[index], [row + first for row in fitting], said[-1][1] if said else None))
            rows.append(np.array(fitting, dtype=np.int64)[keep] + first)
        first += len(block)
    table.rows = rows.joined().astype(np.int64, copy=False)
    table.broken.sort()
    table.words = {layout.names[index]: said for index, said in texts.items() if len(said) <= MOST_TESTS}
    return columns


def _read_cells(
    table: RawTable, layout: CsvLayout, block: list[list[str]], first: int, columns: dict[int, _Column]
) -> tuple[list[int], NDArray[np.bool_], list[tuple[str, ...]]]:
    """Read rows of cells into the columns; rows as wide as the header, which of them hold numbers, cells."""
    fitting = _sort_out(table, layout, block, first)
    found: dict[int, NDArray[np.generic]] = {}
    wrong: dict[int, str] = {}  # of each row that holds no number where it should, the first such cell
    across = list(zip(*(block[row] for row in fitting), strict=True)) or [()] * len(layout.names)
    for index in columns:
        cells = across[index]
        dated = index in layout.moment_columns
        values, bad = read_moments(cells) if dated else read_column(cells, layout.decimal)
        found[index] = values
        wrong = {fitting[place]: cells[place] for place in bad} | wrong
    for row, cell in wrong.items():
        _break(table, layout, block[row], first + row, f'"{short(cell)}" is no number')
    keep = np.array([row not in wrong for row in fitting], dtype=np.bool_)
    for index, values in found.items():
        columns[index].append(values[keep])
    return fitting, keep, across


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


def is_telling(line: str) -> bool:
    """True for a line that is neither empty nor a comment."""
    return line[:1].isdigit() or (bool(line.strip()) and not _COMMENT.match(line))


def split_lines(lines: Iterable[str], separator: str) -> Iterator[list[str]]:
    """Cells of lines, without the blanks around them."""
    if separator == " ":
        yield from (line.split() for line in lines)
    else:
        reader = csv.reader(lines, delimiter=separator, skipinitialspace=True)
        yield from (list(map(str.strip, cells)) for cells in reader)


def guess_layout(table: RawTable, lines: Sequence[str], options: FileOptions) -> CsvLayout:
    """Find out how a text table is laid out; what was guessed is among the notes of the table.

    The first row of numbers is the first of the usual width; the header is the line above it, which may be a comment,
    or the line before that where it holds nothing but units.
    """
    begin = options.header or 0
    sample = list(islice((index for index in range(begin, len(lines)) if is_telling(lines[index])), SAMPLE_LINES))
    separator = options.separator or _guess_separator([lines[index] for index in sample])
    rows = list(split_lines([lines[index] for index in sample], separator))
    width = _width(rows)
    place = _first_data(rows, width)
    if place is None:
        got = short(lines[sample[0]].strip()) if sample else "no lines below the header"
        allowed = "a table: a header such as t [s],position [mm], then lines of numbers"
        remedy = "state separator=, decimal= or header= (its line), or name another file"
        raise InputError.of_file(table.file, got, allowed, remedy)
    # Lines may end in separators behind which nothing ever stands.
    while width > 1 and not any(cells[width - 1 : width] != [""] for cells in rows[place:] if len(cells) >= width):
        width -= 1
    # The decimal sign is a comma where numbers have one and it does not separate cells, or stands in quotes.
    signed = [cell for cells in rows[place:] for cell in cells if is_number(cell)]
    commas, points = sum("," in cell for cell in signed), sum("." in cell for cell in signed)
    decimal = options.decimal or ("," if commas and (separator != "," or commas > points) else ".")
    layout = CsvLayout(separator, decimal, sample[place], width)
    _read_header(table, lines, layout, options.header)
    _find_texts(rows[place:], layout)
    if not options.separator and separator != ",":
        table.notes.append(f"separator {next(word for word, value in SEPARATORS.items() if value == separator)}")
    if not options.decimal and layout.decimal == ",":
        table.notes.append("decimal comma")
    return layout


def _guess_separator(lines: Sequence[str]) -> str:
    """Separator that leaves the most cells of one width that are numbers."""
    scores: dict[str, tuple[float, int]] = {}  # rows whose cells are numbers or nothing, and how many cells they have
    for separator in _TRIED:
        rows = list(split_lines(lines, separator))
        width = _width(rows)
        whole = (cells for cells in rows if len(cells) == width > 1)
        known = (_numbers(cells) + sum(cell.lower() in MISSING for cell in cells) for cells in whole)
        scores[separator] = sum(count / width for count in known), width
    best = max(_TRIED, key=lambda separator: scores[separator])
    return best if scores[best][0] else ","


def _width(rows: Sequence[Sequence[str]]) -> int:
    """Commonest number of cells among the rows that hold numbers."""
    widths = Counter(len(cells) for cells in rows if any(is_number(cell) for cell in cells))
    return widths.most_common(1)[0][0] if widths else 0


def _first_data(rows: Sequence[Sequence[str]], width: int) -> int | None:
    """Index of the first row of numbers: of the usual width, as is the next; numbers alone may be fewer before it."""
    full = [cells for cells in rows if len(cells) == width]
    later = full[len(full) // 2 :]  # which columns hold numbers, the later rows say: no header is among them
    numeric = [index for index in range(width) if 2 * _numbers([cells[index] for cells in later]) >= len(later)]

    def is_data(cells: Sequence[str]) -> bool:
        """True where fewer than half of the cells that should be numbers are words; empty ones are none."""
        known = [cells[index] for index in numeric]
        words = sum(cell.lower() not in MISSING for cell in known) - (numbers := _numbers(known))
        return numbers > 0 and 2 * words < len(known)

    data = [len(cells) == width and is_data(cells) for cells in rows]
    place = next((place for place, ok in enumerate(data) if ok and all(data[place + 1 : place + 2])), None)
    while place and len(rows[place - 1]) >= width / 2 and _numbers(rows[place - 1]) == len(rows[place - 1]):
        place -= 1
    return place


def _numbers(cells: Sequence[str]) -> int:
    """How many cells are numbers."""
    return sum(is_number(cell) or is_moment(cell) for cell in cells)


def _read_header(table: RawTable, lines: Sequence[str], layout: CsvLayout, stated: int | None) -> None:
    """Names and units of the columns."""
    width = layout.width
    above = [index for index in range(layout.first) if lines[index].strip()]
    if stated is not None:
        above = [stated - 1] if stated else []
    rows = [_cells(lines[index], layout.separator) for index in above]
    units: list[str] = []
    if stated is None and _is_by_channel(rows, width):
        rows, units = _by_channel(table, rows)
    if stated is None and len(rows) > 2 and not _is_units(rows[-1]) and _is_units(rows[-2]):
        rows.pop()  # what each column is in words, below its name and its unit
    if stated is None and len(rows) > 1 and _is_units(rows[-1]) and len(rows[-2]) >= len(rows[-1]) > 1:
        units = [cell.strip("[]() ") for cell in rows.pop()]
    # A line above the numbers that is much narrower than they are is no header but a remark.
    names = rows[-1] if rows and (stated or len(rows[-1]) >= max(1, (width + 1) // 2)) else []
    passed = len(rows) - bool(names)
    if passed:
        table.notes.append(f"{tell_count(passed, 'line')} above the header skipped")
    if names and len(names) < width:
        table.notes.append(f"the header names {len(names)} columns, the rows have {width}: the last ones have no name")
    if not names:
        table.notes.append("no header: columns are named by their numbers")
    for index in range(max(len(names), width)):
        name = names[index] if index < len(names) else ""
        layout.names.append(name or f"column {index + 1}")
        layout.units.append(split_heading(name)[1] or (units[index] if index < len(units) else ""))


def _is_units(cells: Sequence[str]) -> bool:
    """True for a row of nothing but units, such as ``[s];[mm]``; some columns may have none."""
    telling = [cell.strip("[]() ") for cell in cells if cell.strip("[]() -")]
    return len(cells) > 1 and bool(telling) and all(map(is_unit, telling))


def _is_by_channel(rows: Sequence[Sequence[str]], width: int) -> bool:
    """True for lines that say of each channel, a pair of columns of time and value, one property: its key, then it."""
    pairs = [row for row in rows if len(row) > width - 2 and len(set(row[0::2])) == 1 and row[0]]
    return width > 1 and width % 2 == 0 and len(pairs) > 1 and any(row[0].casefold() == "name" for row in pairs)


def _by_channel(table: RawTable, rows: Sequence[Sequence[str]]) -> tuple[list[list[str]], list[str]]:
    """Names and units of channels, as the exports of PLC scopes have them: of times in ms, and of values."""
    stated = {row[0].casefold(): row[1::2] for row in rows if len(set(row[0::2])) == 1}
    names, units = stated["name"], stated.get("unit", [])
    table.notes.append("pairs of columns: the time in ms and the value of each channel")
    filled = [*units, *[""] * (len(names) - len(units))]
    return [[cell for name in names for cell in ("time", name)]], [cell for unit in filled for cell in ("ms", unit)]


def _cells(line: str, separator: str) -> list[str]:
    """Cells of a line above the numbers; a mark of a comment before them is left out."""
    match = _COMMENT.match(line)
    text = line[match.end() :] if match else line
    cells = next(split_lines([text], separator), list[str]())
    while cells and not cells[-1]:
        cells.pop()
    return cells


def _find_texts(rows: Sequence[Sequence[str]], layout: CsvLayout) -> None:
    """Find the columns of words and those of dates: at least half of their cells are no numbers."""
    for index in range(len(layout.names)):
        cells = [row[index] for row in rows if index < len(row) and row[index].lower() not in MISSING]
        moments = sum(map(is_moment, cells))
        if moments > len(cells) / 2:
            layout.moment_columns.add(index)
        elif sum(map(is_number, cells)) < len(cells) / 2:
            layout.text_columns.add(index)
