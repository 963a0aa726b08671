"""Recordings as JSON: a list of records, lists by their names, or one record per line."""

import json
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from detent.errors import FileProblem, InputError
from detent.files.text import decode_utf8, kind_of, lines_of, read_bytes, short
from detent.logs.cells import is_moment, read_cell, read_moments
from detent.logs.headings import split_heading
from detent.logs.mapping import FileOptions
from detent.logs.raw_table import BrokenRow, Item, RawTable, check_size, flatten, no_table, table_of, tell

MAX_BYTES = 100_000_000  # longest file of JSON read, unpacked; its values take ten times the memory
ALLOWED = "JSON: a list of records, lists by their names, or one record per line"

Record = dict[str, Any]

_LINES = (".jsonl", ".ndjson")
_MOST_BROKEN = 0.2
_SYSID_UNITS = {"Meters": "m", "Feet": "ft", "Inches": "in", "Radians": "rad", "Degrees": "deg", "Rotations": "turn"}


def read_json(path: Path, options: FileOptions) -> RawTable:
    """Read records, objects or lists of equal length, or an object with a list of them beside constants.

    Objects in records give names joined by points; of several lists of records ``table`` names one.
    """
    file = str(path)
    text = decode_utf8(path, read_bytes(path, MAX_BYTES, ALLOWED))
    if kind_of(path) in _LINES:
        return _read_lines(file, text)
    try:
        found: Any = json.loads(text)
    except json.JSONDecodeError as error:
        if error.msg == "Extra data" and error.lineno > 1:
            return _read_lines(file, text)  # one record per line, under another name
        remedy = f"correct the line ({error.msg[:1].lower()}{error.msg[1:]}), or record again"
        got = short(lines_of(text)[error.lineno - 1].strip()) or "the end of the file"
        problem = FileProblem(file, error.lineno, error.colno, "", got, ALLOWED, remedy)
        raise InputError([problem]) from None
    except (RecursionError, ValueError) as error:
        got = "brackets nested too deeply" if isinstance(error, RecursionError) else "a number of thousands of digits"
        raise InputError.of_file(file, got, ALLOWED, "name another file") from None
    if isinstance(found, list):
        if signals := _signals(cast("list[Any]", found)):
            return table_of(file, signals, ALLOWED)
        return _from_records(file, cast("list[Any]", found), {})
    return _from_object(file, found, options.table)


def _from_object(file: str, found: Any, name: str) -> RawTable:
    """Read an object: the records it holds under some name, or lists by their names."""
    items: Record = {item.name: item.value for item in flatten("", found) if item.name}
    for key in [key for key, value in items.items() if _is_records(value) and key != name]:
        if signals := _signals(items[key]):
            others = [Item(other, _array(value)) for other, value in items.items() if other != key]
            return table_of(file, [*signals, *others], ALLOWED)
    lists = [key for key, value in items.items() if _is_records(value)]
    if items.get("sysid") is True and not name:
        return _characterisation(file, items, lists)
    inside = {key.removeprefix(f"{name}."): value for key, value in items.items() if key.startswith(f"{name}.")}
    if name and name not in lists and not inside:
        raise no_table(file, name, lists, "none: it holds no lists of records")
    if inside or not lists:
        arrays = [Item(key, _array(value)) for key, value in (inside or items).items()]
        return table_of(file, arrays, ALLOWED)
    chosen = name or max(lists, key=lambda key: len(items[key]))
    table = _from_records(file, items[chosen], {key: value for key, value in items.items() if key not in lists})
    others = [key for key in lists if key != chosen]
    table.notes += [f"list {chosen} read, not {', '.join(others)}"] if others and not name else []
    return table


def _characterisation(file: str, items: Record, lists: list[str]) -> RawTable:
    """Read the tests of WPILib's SysId as one recording: rows of time, voltage, position and velocity in each list.

    A drivetrain has two sides, and the angle and the angular rate of its chassis behind them.
    """
    tests = sorted((key for key in lists if items[key][0]), key=lambda key: items[key][0][0])
    rows = [row for key in tests for row in items[key]]
    unit = _SYSID_UNITS.get(str(items.get("units")), "")
    sides = ["left", "right"] if rows and len(rows[0]) == 9 else [""]
    signals = [("voltage", "V"), ("position", unit), ("velocity", f"{unit}/s" if unit else "")]
    named = [f"{signal} {side}".strip() + (f" [{said}]" if said else "") for signal, said in signals for side in sides]
    names = ["time [s]", *named, *(["heading", "heading rate"] if len(sides) == 2 else [])]
    table = _from_records(file, [names, *rows], {key: value for key, value in items.items() if key not in lists})
    firsts = np.cumsum([1, *(len(items[key]) for key in tests)]).tolist()
    table.words["test"] = list(zip(firsts, tests, strict=False))
    table.notes.append(f"tests read as one recording: {', '.join(tests)}")
    return table


def _is_records(value: Any) -> bool:
    """True for a list of records."""
    return isinstance(value, list) and bool(value) and isinstance(value[0], dict | list)  # pyright: ignore[reportUnknownArgumentType]


def _signals(records: list[Any]) -> list[Item]:
    """Signals of a list in which each has its name, its numbers in one list, and perhaps its unit; else nothing."""
    found: list[Item] = []
    for record in records:
        stated = cast("Record", record) if isinstance(record, dict) else {}
        series: list[Any] = [value for value in stated.values() if isinstance(value, list)]
        named = next((stated[key] for key in ("name", "Name", "label", "signal") if key in stated), None)
        if len(series) != 1 or not isinstance(named, str):
            return []
        unit = next((stated[key] for key in ("unit", "Unit", "units") if isinstance(stated.get(key), str)), "")
        found.append(Item(named, _array(series[0]), str(unit)))
    return found


def _array(value: Any) -> Any:
    """A list of numbers as an array, NaN for null; anything else as it is."""
    if not isinstance(value, list):
        return value
    try:
        # As objects first: an array of texts is as wide in every cell as the longest is.
        cells: NDArray[Any] = np.array(cast("list[Any]", value), dtype=np.object_)
        whole = set(map(type, cells.ravel().tolist())) <= {int, bool, float}
        array: NDArray[Any] = np.array(cast("list[Any]", value), dtype=None if whole else np.float64)
        return array if array.dtype.kind in "biuf" else array.astype(np.float64)
    except (ValueError, TypeError, OverflowError):
        return None


def _read_lines(file: str, text: str) -> RawTable:
    """Read one record per line; a line that is none becomes a broken row."""
    records: list[Any] = []
    for line in lines_of(text):
        if line.strip():
            try:
                records.append(json.loads(line))
            except (ValueError, RecursionError):
                records.append(None)
    return _from_records(file, records, {})


def _from_records(file: str, records: list[Any], constants: Record) -> RawTable:
    """Make a table of records."""
    table = RawTable(file)
    for key, value in constants.items():
        table.keep(Item(key, value))
    flat = _flatten(table, records)
    names = list(dict.fromkeys(name for record in flat.values() for name in record))
    check_size(file, len(flat), len(names))
    columns: dict[str, NDArray[Any]] = {}
    wrong: dict[int, str] = {}
    passed: list[str] = []
    for name in names:
        values = _read_values([record.get(name) for record in flat.values()], wrong)
        if values is None:
            passed.append(short(name))
        else:
            columns[name] = values
    rows = np.array(list(flat), dtype=np.int64)
    keep = np.array([place not in wrong for place in range(len(rows))], dtype=np.bool_)
    table.broken += [BrokenRow(int(rows[place]), (), f'"{short(cell)}" is no number') for place, cell in wrong.items()]
    table.broken.sort()
    if len(table.broken) > max(2, _MOST_BROKEN * len(records)) or not columns or not keep.any():
        some = f"{len(table.broken)} invalid records of {len(records)}"
        got = some if table.broken else "no records of numbers"
        raise InputError.of_file(file, got, ALLOWED, "name another file, or another list of it with table=NAME")
    table.rows = rows[keep]
    for name, values in columns.items():
        table.add(Item(name, values[keep], split_heading(name)[1]))
    table.notes += [f"skipped: {tell(passed)}"] if passed else []
    return table


def _flatten(table: RawTable, records: list[Any]) -> dict[int, Record]:
    """Records by their row, each flat, the names in the first of lists; those that are none become broken rows."""
    names: list[str] = []
    if records and isinstance(records[0], list):
        first = cast("list[Any]", records[0])
        is_header = all(isinstance(cell, str) for cell in first)
        names = [str(cell) for cell in first] if is_header else [f"column {place + 1}" for place in range(len(first))]
        records = records[1:] if is_header else records
    found: dict[int, Record] = {}
    for row, record in enumerate(records, start=1):
        if isinstance(record, dict) and not names:
            found[row] = {item.name: item.value for item in flatten("", record)}
        elif isinstance(record, list) and len(cast("list[Any]", record)) == len(names) > 0:
            found[row] = dict(zip(names, cast("list[Any]", record), strict=True))
        else:
            table.broken.append(BrokenRow(row, (), "no record"))
    return found


def _read_values(cells: list[Any], wrong: dict[int, str]) -> NDArray[Any] | None:
    """Numbers of one column; None for a column of something else. Notes which cells are no numbers."""
    texts = {place: cell for place, cell in enumerate(cells) if isinstance(cell, str)}
    others = [cell for cell in cells if cell is not None and not isinstance(cell, str | int | float)]
    stated = sum(cell is not None for cell in cells)
    if others or not stated:
        return None
    if sum(map(is_moment, texts.values())) > stated / 2:
        moments, bad = read_moments([cell if isinstance(cell, str) else "" for cell in cells])
        wrong |= {place: str(cells[place]) for place in bad if place not in wrong}
        return moments
    numbers = {place: read_cell(cell, ".") for place, cell in texts.items()}
    bad = {place for place, number in numbers.items() if number is None}
    if len(bad) > stated / 2:
        return None
    wrong |= {place: texts[place] for place in sorted(bad) if place not in wrong}
    filled = [np.nan if cell is None else numbers.get(place) or 0.0 if place in texts else cell
              for place, cell in enumerate(cells)]  # fmt: skip
    return _array(filled)
