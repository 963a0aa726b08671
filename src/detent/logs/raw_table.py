"""The columns of a file before anybody knows what they mean: numbers, headings, row numbers."""

from collections import Counter
from collections.abc import Generator, Iterable
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from detent.errors import InputError
from detent.files.text import short
from detent.logs.headings import rank, split_heading
from detent.logs.log import LARGEST, SMALLEST, Finding, Rows, Values

MAX_CELLS = 50_000_000  # most numbers read from one file: 400 MB of them
MAX_COLUMNS = 2000  # most columns read from one file
MAX_CONSTANTS = 200  # most single values kept beside the columns
LARGEST_EXACT = 2**53  # whole numbers up to this size are exact as floats
MOST_NAMED = 12  # columns named in a message


class Item(NamedTuple):
    """Something a file holds under a name: an array of any shape, a number or a text."""

    name: str
    value: Any
    unit: str = ""


class BrokenRow(NamedTuple):
    """A row of a text file that does not fit its header."""

    row: int  # its number below the header, from 1
    cells: tuple[float | None, ...]  # its cells that say something; None for one that is no number
    reason: str  # what is wrong with it


@dataclass
class RawTable:
    """The columns of one file."""

    file: str  # the file as the user named it
    # from the name of a column to its numbers, shape (n,), in the order of the file; NaN where a cell is empty
    columns: dict[str, Values] = field(default_factory=dict[str, Values])
    # number of each row in the file, from 1 below the header, shape (n,)
    rows: Rows = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    # from the name of a column to the unit its heading states, as written
    units: dict[str, str] = field(default_factory=dict[str, str])
    # from the name of a column of words to the rows at which it says another one, with that, where it seldom does
    words: dict[str, list[tuple[int, str]]] = field(default_factory=dict[str, list[tuple[int, str]]])
    # single numbers and texts beside the columns
    constants: dict[str, float | str] = field(default_factory=dict[str, float | str])
    # what had to be guessed about the file, and what was skipped
    notes: list[str] = field(default_factory=list[str])
    broken: list[BrokenRow] = field(default_factory=list[BrokenRow])  # rows that are not among the columns
    findings: list[Finding] = field(default_factory=list[Finding])  # what was found and done so far

    def add(self, item: Item) -> None:
        """Add a column of numbers under a name of its own."""
        name = item.name
        while name in self.columns:
            name += "'"
        values, unit = self._as_floats(name, np.asarray(item.value))
        self.columns[name] = values
        self.units[name] = unit or item.unit

    def keep(self, item: Item) -> bool:
        """Keep a single number or text; False for anything else, or when there are too many."""
        value: Any = item.value
        if isinstance(value, np.ndarray | np.generic):
            array = np.asarray(cast("NDArray[Any]", value))
            value = array.reshape(-1)[0].item() if array.size == 1 and array.dtype.kind in "biufUS" else None
        if isinstance(value, bytes):
            value = value.decode("utf-8", "replace")
        if len(self.constants) >= MAX_CONSTANTS or not isinstance(value, str | int | float):
            return False
        try:
            self.constants[item.name] = short(value) if isinstance(value, str) else float(value)
        except OverflowError:
            return False
        return True

    def _as_floats(self, name: str, values: NDArray[Any]) -> tuple[Values, str]:
        """Numbers of a column as floats, and their unit if their type says it."""
        # Whole numbers beyond what a float holds exactly, such as nanoseconds since 1970, are counted from the first.
        unit, absent = "", np.zeros(len(values), dtype=np.bool_)
        if values.dtype.kind in "mM":
            absent = np.isnat(values)
            moments = values.astype(f"{values.dtype.kind}8[ns]")
            moments[absent] = moments[~absent][0] if not absent.all() else 0
            values, unit = moments.astype(np.int64), "ns"
        is_whole = values.dtype.kind in "iu" and len(values)
        if is_whole and max(abs(int(values.max())), abs(int(values.min()))) > LARGEST_EXACT:
            origin = int(values[0])
            self.notes.append(f"{short(name)}: counted from its first value, {origin}")
            # Subtracting without a sign wraps round to the right difference, as long as that fits.
            values = (values.astype(np.uint64) - np.uint64(origin % 2**64)).astype(np.int64)
        floats = values.astype(np.float64)
        size = np.abs(floats)
        floats[size < SMALLEST] = 0.0
        floats[absent | ~(size <= LARGEST)] = np.nan
        return floats, unit


def table_of(file: str, items: Iterable[Item], allowed: str) -> RawTable:
    """Make a table of named arrays, such as a file of arrays holds.

    Arrays of one length are its columns; single values are constants; a matrix gives one column per column of its own.
    Where arrays differ in length, those as long as the one called time are taken, otherwise the commonest length.
    """
    table = RawTable(file)
    vectors: list[Item] = []
    passed: list[str] = []
    for item in items:
        found = _vectors(item)
        if found:
            vectors += found
        elif not table.keep(item):
            passed.append(short(item.name))
    # Rows of the table: those of the time if there is one, otherwise those that most vectors have.
    lengths = [len(item.value) for item in vectors]
    timed = [len(item.value) for item in vectors if rank(split_heading(item.name)[0], "time") is not None]
    common = Counter(timed or lengths).most_common()
    length = max((length for length, count in common if count == common[0][1]), default=0)
    check_size(file, length, len(vectors))
    for item in vectors:
        if len(item.value) == length:
            table.add(item)
        else:
            passed.append(f"{short(item.name)} ({len(item.value)} rows)")
    if not table.columns:
        remedy = "name another file, or another table of it with table=NAME"
        raise InputError.of_file(file, "no columns of numbers", allowed, remedy)
    if passed:
        table.notes.append(f"skipped: {tell(passed)}")
    table.rows = np.arange(1, length + 1, dtype=np.int64)
    return table


@contextmanager
def whole(path: Path, kind: str, allowed: str, remedy: str = "save it again, or as CSV") -> Generator[None]:
    """Turn whatever a library stumbles over in a damaged file into an error that says what to do."""
    try:
        yield
    except (InputError, MemoryError):
        raise
    except Exception as error:  # noqa: BLE001 - parsers raise whatever the damage makes them stumble over
        got = f"a file that is no {kind} file ({short(str(error) or type(error).__name__)})"
        raise InputError.of_file(str(path), got, allowed, remedy) from None


def no_table(file: str, name: str, held: Iterable[str], nothing: str = "") -> InputError:
    """The error for a table that a file does not hold."""
    allowed = f"one of {', '.join(map(short, [*held][:MOST_NAMED])) or nothing}"
    return InputError.of_file(file, f'the table "{short(name)}"', allowed, "state one of these as table=")


def check_size(file: str, rows: int, columns: int) -> None:
    """Refuse what would fill the memory."""
    if rows * columns > MAX_CELLS or columns > MAX_COLUMNS:
        allowed = f"up to {MAX_COLUMNS} columns and {MAX_CELLS // 1_000_000} million numbers"
        remedy = "split the recording, or save only the columns needed"
        raise InputError.of_file(file, f"{columns} columns of {rows} rows", allowed, remedy)


def tell(names: list[str]) -> str:
    """Name some things, and say how many more there are."""
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return ", ".join(names[:MOST_NAMED]) + more


def flatten(name: str, value: Any, depth: int = 3) -> Iterable[Item]:
    """Items of a value that may be a mapping of values: names joined by points, three mappings deep at most."""
    if isinstance(value, dict) and depth:
        for key, inner in value.items():  # pyright: ignore[reportUnknownVariableType]
            yield from flatten(f"{name}.{key}" if name else str(key), inner, depth - 1)  # pyright: ignore[reportUnknownArgumentType]
    else:
        yield Item(name, value)


def _vectors(item: Item) -> list[Item]:
    """Columns that an item holds; none for a single value or for what is no array of numbers."""
    array: Any = item.value
    if not isinstance(array, np.ndarray):
        return []
    array = cast("NDArray[Any]", array)
    if array.dtype.names:
        fields = [Item(f"{item.name}.{name}" if item.name else name, array[name]) for name in array.dtype.names]
        return [vector for inner in fields for vector in _vectors(inner)]
    if array.dtype.kind not in "biufmM" or array.size < 2:
        return []
    if max(array.shape) == array.size:
        return [Item(item.name, array.ravel(), item.unit)]
    if array.ndim != 2:
        return []
    # A matrix holds its signals along the longer side.
    matrix = array if array.shape[0] > array.shape[1] else array.T
    return [Item(f"{item.name}.{index + 1}", matrix[:, index], item.unit) for index in range(matrix.shape[1])]
