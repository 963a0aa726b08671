"""Job files in TOML as lists of tables, such as ``[[move]]``: each value with the place where it is written."""

import difflib
import re
from collections.abc import Iterable, Mapping
from typing import Any, cast

from detent.errors import FileProblem, InputError
from detent.files.job_values import RefusedValueError, short
from detent.files.locate import Place, find_place, locate_keys
from detent.files.source import parse_source

_HEADER = re.compile(r"\s*\[\[\s*(\"?|'?)([A-Za-z_]+)\1\s*\]\]")
_LARGEST_SHOWN = 10**18


class JobTables:
    """What the parser of TOML understood of a job file, and where it stands.

    Where a list is spelled otherwise than by headers, as in ``move = [{...}]``, messages give the place of the list and
    the number of the table.
    """

    def __init__(self, file: str, text: str, names: tuple[str, ...], problems: list[FileProblem]) -> None:
        source = parse_source(file, text)
        if not source.is_readable:
            raise InputError(source.problems)
        problems += source.problems
        self.file, self.problems = file, problems
        # top: everything at the top of the file, the lists too; is_whole: False when lines were left out: then a
        # missing key proves nothing
        self.top, self.is_whole = source.tables, source.is_whole
        self._places, self._lines = source.places, text.splitlines()
        headers = [(number, found[2]) for number, line in enumerate(self._lines) if (found := _HEADER.match(line))]
        self._bounds = [*(number for number, _ in headers), len(self._lines)]
        self._tables = {name: self._find(name) for name in names}
        starts = {name: [number for number, header in headers if header == name] for name in names}
        self._starts = {name: found for name, found in starts.items() if len(found) == len(self._tables[name])}

    def _find(self, name: str) -> list[dict[str, Any]]:
        """Tables of a list; none, and a problem, where it is something else."""
        found = self.top.get(name, [])
        if isinstance(found, list) and all(isinstance(table, dict) for table in cast("list[object]", found)):
            return cast("list[dict[str, Any]]", found)
        place = self.top_place(name)
        came = f"one table [{name}]" if isinstance(found, dict) else _written(place, cast("object", found))
        remedy = f"write [[{name}]], with two brackets, before the keys of each {name}"
        self._note(place, name, RefusedValueError(came, "a list of tables", remedy), None)
        return []

    def tables(self, name: str) -> list[dict[str, Any]]:
        """Tables of one list, in the order of the file."""
        return self._tables[name]

    def line(self, name: str, index: int) -> int:
        """Line of a table's header, from 1."""
        return self._starts[name][index] + 1 if name in self._starts else self.top_place(name).line

    def refuse(self, name: str, index: int, key: str, value: object, error: RefusedValueError) -> None:
        """Note what is wrong with a key of a table, or with the table where the key is empty."""
        table = name if name in self._starts else f"{name}[{index + 1}]"
        self._note(self._place(name, index, key), f"{table}.{short(key)}" if key else table, error, value)

    def refuse_top(self, key: str, value: object, error: RefusedValueError) -> None:
        """Note what is wrong with a key outside the tables."""
        self._note(self.top_place(key), short(key), error, value)

    def _note(self, place: Place, key: str, error: RefusedValueError, value: object) -> None:
        came = error.came or _written(place, value)
        problem = FileProblem(self.file, place.line, place.column, key, came, error.allowed, error.remedy)
        self.problems.append(problem)

    def unknown(self, key: str, value: object, keys: tuple[str, ...], inside: Mapping[str, str]) -> RefusedValueError:
        """Error for what stands outside the tables and is not known there."""
        lists = tuple(self._tables)
        is_table = isinstance(value, dict | list)
        near = difflib.get_close_matches(key.lower(), lists if is_table else (*keys, *lists), n=1, cutoff=0.6)
        if is_table:
            remedy = f"did you mean [[{near[0]}]]?" if near else f"remove it, or name a file of {lists[-1]}s"
        elif key in inside:
            remedy = f"move it below a [[{inside[key]}]]"
        else:
            remedy = f'did you mean "{near[0]}"?' if near else "remove it"
        came = f'the unknown {"table" if is_table else "key"} "{short(key)}"'
        return RefusedValueError(came, f"at the top of the file: {', '.join((*keys, *lists))}", remedy)

    def top_place(self, key: str) -> Place:
        """Place of a key outside the tables."""
        place = find_place(self._places, (key,))
        return place if (key,) in self._places else Place(place.line, place.column, "")

    def _place(self, name: str, index: int, key: str) -> Place:
        """Place of a key of a table, or of the table."""
        if name not in self._starts:
            place = self.top_place(name)
            return Place(place.line, place.column, "")
        begin = self._starts[name][index]
        end = next(bound for bound in self._bounds if bound > begin)
        places = locate_keys("\n".join(self._lines[begin:end]))
        path = (name, key) if key else (name,)
        if key and path not in places:  # a key inside a table inside this one
            path = (name, *key.split("."))
        place = find_place(places, path)
        return Place(begin + place.line, place.column, place.text if path in places else "")


def unknown_key(key: str, known: Iterable[str], where: str) -> RefusedValueError:
    """Error for a key that a table does not have; it names the nearest known one."""
    keys = list(known)
    near = difflib.get_close_matches(key.lower(), keys, n=1, cutoff=0.6)
    remedy = f'did you mean "{near[0]}"?' if near else "remove it"
    return RefusedValueError(f'the unknown key "{short(key)}"', f"{where}: {', '.join(keys)}", remedy)


def _written(place: Place, value: object) -> str:
    """Value as it was written, or what can be said of it where its place is not known."""
    if place.text:
        first, *more = place.text.splitlines()
        return f"{short(first)}..." if more else short(first)
    if isinstance(value, int) and abs(value) > _LARGEST_SHOWN:  # Python refuses to write very large ones at all
        return "a very large number"
    if isinstance(value, str | int | float):
        return short(str(value))
    return "a table" if isinstance(value, dict) else f"a {type(value).__name__}"
