"""Files of moves as TOML: a `[[move]]` table each, quantities with their units."""

import difflib
import re
from collections.abc import Iterable
from typing import Any, cast

from detent.axisfile.locate import Place, find_place, locate_keys
from detent.axisfile.source import Source, parse_source
from detent.errors import InputError
from detent.planning.move_job import MoveJob
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
from detent.units import describe_kind

_HEADER = re.compile(r"\s*\[\[\s*(?:move|\"move\"|'move')\s*\]\]")
_LARGEST_SHOWN = 10**18


def parse_move_toml(file: str, text: str) -> MoveJob:
    """Read a file of moves from TOML.

    Each ``[[move]]`` has ``target`` or ``by``, and where wanted ``dwell``, ``repeat``, ``speed`` and ``sample_period``.
    A ``repeat`` before the first of them does the whole list so many times.

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
    source = parse_source(file, text)
    if not source.is_readable:
        raise InputError(source.problems)
    rows = MoveRows(file)
    rows.problems += source.problems
    reader = _Reader(rows, source, text)
    repeat = reader.read_top()
    for index, move in enumerate(reader.moves):
        if rows.is_over:
            break
        reader.read_move(index, move)
    return rows.to_job(repeat)


class _Reader:
    """Reads what the parser of TOML understood."""

    def __init__(self, rows: MoveRows, source: Source, text: str) -> None:
        self._rows = rows
        self._source = source
        self._lines = text.splitlines()
        self.moves = self._find_moves(source.tables.get("move", []))
        starts = [number for number, line in enumerate(self._lines) if _HEADER.match(line)]
        # Where the list is spelled otherwise, as in `move = [{...}]`, messages give its place and the move's number.
        self._starts = starts if len(starts) == len(self.moves) else []

    def _find_moves(self, found: object) -> list[dict[str, Any]]:
        """Tables of the moves; none, and a problem, where they are something else."""
        if isinstance(found, list) and all(isinstance(table, dict) for table in cast("list[object]", found)):
            return cast("list[dict[str, Any]]", found)
        place = self._top_place("move")
        came = "one table [move]" if isinstance(found, dict) else _written(place, cast("object", found))
        remedy = "write [[move]], with two brackets, before the keys of each move"
        self._rows.refuse((place.line, place.column), "move", came, "a list of tables", remedy)
        return []

    def read_top(self) -> int:
        """Check what stands outside the moves; gives how often the list is done."""
        repeat = 1
        for key, value in self._source.tables.items():
            try:
                if key == "repeat":
                    repeat = _read_count(value)
                elif key != "move":
                    raise _unknown(key, value, ("repeat", "move"), "at the top of the file")
            except RefusedValueError as error:
                self._refuse(self._top_place(key), short(key), value, error)
        return repeat

    def read_move(self, index: int, move: dict[str, Any]) -> None:
        """Read one move."""
        values: dict[str, float] = {}
        known = len(self._rows.problems)
        for key, value in move.items():
            try:
                values[key] = _read_value(key, value)
            except RefusedValueError as error:
                self._refuse(self._place(index, key), self._key(index, key), value, error)
        ways = {"target", "by"} & set(move)
        if len(ways) == 2:
            error = RefusedValueError("target and by", ONE_WAY, "remove one of the two")
            self._refuse(self._place(index, "by"), self._key(index, "by"), None, error)
        elif not ways and self._source.is_whole:
            error = RefusedValueError("neither target nor by", ONE_WAY, 'add target = "12 mm" or by = "1 mm"')
            self._refuse(self._place(index), self._key(index), None, error)
        if ways and len(self._rows.problems) == known:
            line = self._starts[index] + 1 if self._starts else self._top_place("move").line
            self._rows.add(line, values)

    def _refuse(self, place: Place, key: str, value: object, error: RefusedValueError) -> None:
        came = error.came or _written(place, value)
        self._rows.refuse((place.line, place.column), key, came, error.allowed, error.remedy)

    def _key(self, index: int, key: str = "") -> str:
        """Key as messages name it."""
        move = "move" if self._starts else f"move[{index + 1}]"
        return f"{move}.{short(key)}" if key else move

    def _top_place(self, key: str) -> Place:
        """Place of a key outside the moves."""
        place = find_place(self._source.places, (key,))
        return place if (key,) in self._source.places else Place(place.line, place.column, "")

    def _place(self, index: int, key: str = "") -> Place:
        """Place of a key of a move, or of the move."""
        if not self._starts:
            place = self._top_place("move")
            return Place(place.line, place.column, "")
        begin, end = [*self._starts, len(self._lines)][index : index + 2]
        places = locate_keys("\n".join(self._lines[begin:end]))
        path = ("move", key) if key else ("move",)
        place = find_place(places, path)
        return Place(begin + place.line, place.column, place.text if path in places else "")


def _read_value(key: str, value: object) -> float:
    """Read one value of a move."""
    if key not in UNITS:
        raise _unknown(key, value, UNITS, "in [[move]]")
    if not UNITS[key]:
        return _read_count(value)
    if isinstance(value, str):
        return read_quantity(key, value)
    kind, _ = describe_kind(UNITS[key])
    example = f'"12 {EXAMPLE_UNITS[UNITS[key]]}"'
    raise RefusedValueError("", f"{kind} such as {example}", f"write it in quotes with its unit: {key} = {example}")


def _read_count(value: object) -> int:
    """Read a number of repeats."""
    if isinstance(value, int) and not isinstance(value, bool):
        return check_count(value)
    raise RefusedValueError("", "a whole number", "write a whole number without quotes, as in repeat = 3")


def _unknown(key: str, value: object, known: Iterable[str], where: str) -> RefusedValueError:
    """Error for an unknown key or table that names the nearest known one."""
    keys = list(known)
    is_table = isinstance(value, dict | list) and "move" in keys
    near = difflib.get_close_matches(key.lower(), keys, n=1, cutoff=0.6)
    remedy = f'did you mean "{near[0]}"?' if near else "remove it"
    if is_table:
        remedy = "did you mean [[move]]?" if near else "remove it, or name a file of moves"
    elif key in UNITS:
        remedy = "move it below a [[move]]"
    came = f'the unknown {"table" if is_table else "key"} "{short(key)}"'
    return RefusedValueError(came, f"{where}: {', '.join(keys)}", remedy)


def _written(place: Place, value: object) -> str:
    """Value as it was written, or what can be said of it where its place is not known."""
    if place.text:
        first, *more = place.text.splitlines()
        return f"{short(first)}..." if more else short(first)
    if isinstance(value, int) and abs(value) > _LARGEST_SHOWN:  # Python refuses to write very large ones at all
        return "a very large number"
    return short(str(value)) if isinstance(value, str | int | float) else f"a {type(value).__name__}"
