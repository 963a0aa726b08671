"""Files of moves as TOML: a `[[move]]` table each, quantities with their units."""

from collections.abc import Iterable, Mapping
from typing import Any

from detent.files.job_rows import EXAMPLE_UNITS, JobRows, check_count
from detent.files.job_toml import JobTables, unknown_key
from detent.files.job_values import RefusedValueError, read_text_quantity, read_whole_number
from detent.methods.moves.job import Move, MoveJob
from detent.methods.moves.move_rows import ONE_WAY, UNITS, add_move, check_quantity, to_job


def parse_move_toml(file: str, text: str, units: Mapping[str, str] = UNITS) -> MoveJob:
    """Read a file of moves from TOML.

    Each ``[[move]]`` has ``target`` or ``by``, and where wanted ``dwell``, ``repeat``, ``speed`` and ``sample_period``.
    A ``repeat`` before the first of them does the whole list so many times.
    """
    rows = JobRows[Move](file)
    tables = JobTables(file, text, ("move",), rows.problems)
    repeat = read_repeat(tables, units)
    for index, move in enumerate(tables.tables("move")):
        if rows.is_over:
            break
        _read_move(tables, rows, index, move, units)
    return to_job(rows, repeat)


def read_repeat(tables: JobTables, keys: Iterable[str]) -> int:
    """Check what stands outside the moves, which may have these keys; gives how often the list is done."""
    repeat = 1
    for key, value in tables.top.items():
        try:
            if key == "repeat":
                repeat = check_count(read_whole_number(key, value))
            elif key != "move":
                raise tables.unknown(key, value, ("repeat",), dict.fromkeys(keys, "move"))
        except RefusedValueError as error:
            tables.refuse_top(key, value, error)
    return repeat


def _read_move(
    tables: JobTables, rows: JobRows[Move], index: int, move: dict[str, Any], units: Mapping[str, str]
) -> None:
    """Read one move."""
    values: dict[str, float] = {}
    known = len(rows.problems)
    for key, value in move.items():
        try:
            values[key] = _read_value(key, value, units)
        except RefusedValueError as error:
            tables.refuse("move", index, key, value, error)
    ways = {"target", "by"} & set(move)
    if len(ways) == 2:
        tables.refuse("move", index, "by", None, RefusedValueError("target and by", ONE_WAY, "remove one of the two"))
    elif not ways and tables.is_whole:
        unit = EXAMPLE_UNITS[units["target"]]
        error = RefusedValueError("neither target nor by", ONE_WAY, f'add target = "12 {unit}" or by = "1 {unit}"')
        tables.refuse("move", index, "", None, error)
    if ways and len(rows.problems) == known:
        add_move(rows, tables.line("move", index), values)


def _read_value(key: str, value: object, units: Mapping[str, str]) -> float:
    """Read one value of a move."""
    if key not in units:
        raise unknown_key(key, units, "in [[move]]")
    if not units[key]:
        return check_count(read_whole_number(key, value))
    unit = units[key]
    return check_quantity(key, read_text_quantity(key, value, unit, f"12 {EXAMPLE_UNITS[unit]}"), units)
