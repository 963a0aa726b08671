"""What validation found, told to a person: from pydantic's errors to `FileProblem`."""

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any, cast

from pydantic.fields import FieldInfo

from detent.errors import FileProblem
from detent.files.fields import (
    AnyName,
    Table,
    bounds_of_length,
    describe_allowed,
    example_of,
    extra_of,
    fits,
    is_list,
    is_named,
    is_rows,
    keys_of,
    leaf_fields,
    list_example,
    named_as,
    options_of,
    table_of,
    tables_of,
    type_of,
    unit_of,
)
from detent.files.locate import Index, Path, Place, find_place
from detent.files.text import MAX_SHOWN, lines_of, nearest
from detent.units import format_quantity

MAX_ELEMENTS = 3  # wrong numbers of a list shown in a message


class Reporter:
    """Makes problems of one file (and its overrides) with their places."""

    def __init__(
        self,
        file: str,
        places: dict[Path, Place],
        overrides: dict[Path, str],
        root: type[Table],
        changed: Mapping[Path, str] | None = None,
    ) -> None:
        self._file = file
        self._places = places
        self._overrides = overrides
        self._root = root
        self._changed = changed or {}  # of overrides by a program, what they are called

    def problem(self, path: Path, got: str, allowed: str, remedy: str) -> FileProblem:
        """Problem of a key, at its place."""
        if path in self._overrides:
            named = self._changed.get(path, "--set")
            return FileProblem(named, 0, 0, dotted(path), got, allowed, remedy)
        place = find_place(self._places, path)
        return FileProblem(self._file, place.line, place.column, dotted(path), got, allowed, remedy)

    def placed(self, path: Path, fault: FileProblem) -> FileProblem:
        """A problem of a table that knows neither its file nor its place; without `got`, the value as written."""
        path = (*path, *fault.key.split(".")) if fault.key else path
        return self.problem(path, fault.got or self.got(path), fault.allowed, fault.remedy)

    def is_stated(self, path: Path) -> bool:
        """True when the file or an override gives this key."""
        return path in self._overrides or path in self._places

    def is_table(self, path: Path) -> bool:
        """True when the file or an override gives a key inside this one."""
        return any(len(path) < len(key) and key[: len(path)] == path for key in (*self._overrides, *self._places))

    def got(self, path: Path, value: object = None) -> str:
        """Value of a key as it was written."""
        text = self._overrides.get(path) or (self._places[path].text if path in self._places else _written(value))
        return _shortened(text)

    def from_errors(self, errors: Sequence[dict[str, Any]]) -> FileProblem:
        """Problem for pydantic's errors about one key (entries of ``ValidationError.errors()``).

        There is more than one only where several numbers of a list are wrong.
        """
        error = errors[0]
        path = key_path(error["loc"])
        if error["type"] == "extra_forbidden":
            return self._unknown_key(path, error["input"])
        field = field_at(self._root, path)
        if is_named(field) and error["type"] in {"too_short", "too_long"}:
            return self._wrong_number(path, field, len(error["input"]))
        if error["type"] == "missing":
            return self._missing(path, field)
        if table_of(field) is not None:
            return self._not_a_table(path, error["input"])
        if is_list(field):
            return self._bad_list(path, field, errors)
        return self._bad_value(path, field, error)

    def _unknown_key(self, path: Path, value: object) -> FileProblem:
        """Unknown key: name the nearest known one, or the table it belongs to."""
        *around, key = path
        keys = known_keys(self._root, tuple(around))
        is_rows = isinstance(value, list) and all(isinstance(part, dict) for part in cast("list[object]", value))
        is_table = isinstance(value, dict) or is_rows
        what = f"the unknown table [{dotted(path)}]" if is_table else f'the unknown key "{_shortened(key)}"'
        place = f"in {self._header(tuple(around))}" if around else "at the top of the file"
        near = nearest_key(self._root, path)
        leaves = [known for known, _ in leaf_fields(self._root)]
        elsewhere = [known for known in leaves if known[-1] == key and not fits(known, path)]
        alike = nearest(key, {known[-1] for known in leaves if known[-1] != key}, 0.8)
        if near:
            remedy = f'did you mean "{near}"?'
        elif elsewhere:
            remedy = f"move it to {self._header(named_as(min(elsewhere, key=len)[:-1], path))}"
        elif alike and not is_table:
            home = min((known for known in leaves if known[-1] == alike), key=len)
            remedy = f'did you mean "{alike}", in {self._header(named_as(home[:-1], path))}?'
        else:
            remedy = "remove it" + self._axis(", or look the key up with `detent check` or in the reference")
        return self.problem(path, what, f"{place}: {', '.join(keys)}", remedy)

    def _header(self, path: Path) -> str:
        """A table as its header is written."""
        inside = path[:-1] if isinstance(path[-1], Index) else path
        return f"[[{dotted(inside)}]]" if is_rows(field_at(self._root, inside)) else f"[{dotted(inside)}]"

    def _axis(self, text: str) -> str:
        """What is said of axis files only."""
        return text if "axis" in self._root.model_fields else ""

    def wrong_name(self, path: Path, field: FieldInfo) -> FileProblem:
        """Problem of a table whose name will not do."""
        remedy = f"rename it, as in [{dotted((*path[:-1], example_of(field)))}]"
        return self.problem(path, f'the name "{path[-1]}"', extra_of(field, "allowed"), remedy)

    def _wrong_number(self, path: Path, field: FieldInfo, got: int) -> FileProblem:
        least, most = bounds_of_length(field)
        table = dotted((*path, example_of(field)))
        remedy = f"add [{table}] ({field.description})" if got < least else "remove some"
        return self.problem(path, f"{got} tables", f"{least} to {most} tables such as [{table}]", remedy)

    def _missing(self, path: Path, field: FieldInfo) -> FileProblem:
        table = table_of(field)
        if is_named(field):
            return self._wrong_number(path, field, 0)
        if table is not None:
            keys = [dotted(known) for known, leaf in leaf_fields(table) if leaf.is_required()]
            remedy = f"add [{dotted(path)}] with {', '.join(keys)}"
            return self.problem(path, "nothing", f"the table [{dotted(path)}]", remedy)
        where = f"in [{dotted(path[:-1])}]"
        remedy = f"add {path[-1]} = {example_of(field)} {where} ({field.description})"
        if "catalogue" in known_keys(self._root, path[:-1]):
            remedy = f"{remedy}, or name a motor of the catalogue that has it"
        return self.problem(path, "nothing", describe_allowed(field), remedy)

    def _not_a_table(self, path: Path, value: object) -> FileProblem:
        field = field_at(self._root, path)
        if is_rows(field):
            got, header = "a single table" if isinstance(value, dict) else self.got(path, value), self._header(path)
            remedy = f"write {header}, with two brackets, before the keys of each"
            return self.problem(path, got, f"tables {header}", remedy)
        keys = ", ".join(known_keys(self._root, path))
        if is_named(field):
            table = dotted((*path, example_of(field)))
            got = "a list" if isinstance(value, list) else self.got(path, value)
            remedy = f"write [{table}] with single brackets on a line of its own and its keys below it"
            return self.problem(path, got, f"tables with names, such as [{table}]", remedy)
        if isinstance(value, list):
            remedy = f"write [{dotted(path)}] once, with single brackets{self._axis(': one file describes one axis')}"
            return self.problem(path, "a list", f"one table [{dotted(path)}]", remedy)
        remedy = f"write [{dotted(path)}] on a line of its own and its keys below it"
        return self.problem(path, self.got(path, value), f"the table [{dotted(path)}] with {keys}", remedy)

    def _bad_value(self, path: Path, field: FieldInfo, error: dict[str, Any]) -> FileProblem:
        got = self.got(path, error["input"])
        allowed = describe_allowed(field)
        remedy = f"give {path[-1]} a value in this range ({field.description})"
        if error["type"] in {"quantity", "refused"}:
            allowed = str(error["ctx"].get("allowed", allowed)) if error["type"] == "refused" else allowed
            remedy = str(error["ctx"].get("remedy", remedy))
        elif options_of(field):
            remedy = f'write "{nearest(str(error["input"]), options_of(field), 0.0) or options_of(field)[0]}"'
        elif error["type"].endswith("_type"):
            remedy = _type_remedy(path[-1], field, error["input"])
        return self.problem(path, got, allowed, remedy)

    def _bad_list(self, path: Path, field: FieldInfo, errors: Sequence[dict[str, Any]]) -> FileProblem:
        kinds = {error["type"] for error in errors}
        example = f"{path[-1]} = {list_example(field)}"
        remedy = f"give every number of {path[-1]} a value in this range ({field.description})"
        if kinds & {"too_long", "too_short"}:
            got = f"{len(errors[0]['input'])} numbers"
            remedy = f"give {path[-1]} so many numbers ({field.description})"
        elif "list_type" in kinds:
            got = self.got(path, errors[0]["input"])
            remedy = f"write {'quantities' if unit_of(field) else 'whole numbers'} in brackets, as in {example}"
        else:
            got = ", ".join(_wrong_elements(errors))
        if kinds & {"int_type", "int_parsing_size"}:
            remedy = f"write every element as a whole number, as in {example}"
        elif "quantity" in kinds:
            remedy = f"write every element as text with a unit, as in {example}"
        return self.problem(path, got, describe_allowed(field), remedy)


def key_path(location: Sequence[str | int]) -> Path:
    """Path of the key at a location of pydantic's, which may go on into a list of values by a number."""
    last = max((k for k, part in enumerate(location) if isinstance(part, str)), default=-1)
    parts = [part for part in location[: last + 1] if part != "[key]"]
    return tuple(Index(part) if isinstance(part, int) else part for part in parts)


def field_at(root: type[Table], path: Path) -> FieldInfo:
    """Declaration of the key at a path."""
    table: type[Table] | None = root
    field: FieldInfo | None = None
    for key in path:
        if field is not None and (is_named(field) or isinstance(key, Index)):
            # One of the tables, whatever its name or number: a required table like any other.
            table = tables_of(field).get(key, table)
            field = FieldInfo(annotation=table, description=field.description)
        else:
            field = keys_of(table)[key] if table else None
            table = table_of(field) if field else None
    if field is None:
        raise KeyError(path)
    return field


def known_keys(root: type[Table], path: Path) -> list[str]:
    """Keys a table of the schema knows."""
    field = field_at(root, path) if path else None
    if field is not None and is_named(field):
        return [AnyName(extra_of(field, "name"))]
    table = root if field is None else table_of(field)
    return list(keys_of(table)) if table else []


def nearest_key(root: type[Table], path: Path) -> str:
    """Known key that an unknown one was probably meant to be; empty when none is near."""
    return nearest(path[-1], known_keys(root, path[:-1]))


def bad_names(root: type[Table], tables: object, prefix: Path = ()) -> Iterator[tuple[Path, FieldInfo]]:
    """Names of the user's own tables that will not do: their paths, each with the declaration of the tables."""
    if not isinstance(tables, dict):
        return
    held = cast("dict[str, object]", tables)
    for key, field in keys_of(root).items():
        below, value = table_of(field), held.get(key)
        if below is None or not isinstance(value, dict):
            continue
        if not is_named(field):
            yield from bad_names(below, cast("object", value), (*prefix, key))
            continue
        for own, table in cast("dict[str, object]", value).items():
            if not re.fullmatch(extra_of(field, "pattern"), own):
                yield (*prefix, key, own), field
            yield from bad_names(below, table, (*prefix, key, own))


def dotted(path: Sequence[str]) -> str:
    """Key as written in messages; parts that need quotes get them."""
    return ".".join(_written_key(part) for part in path if not isinstance(part, Index))


@lru_cache(4096)  # an axis file is read with the same few hundred keys over and over
def _written_key(part: str) -> str:
    part = _shortened(part)
    return part if part.replace("_", "").replace("-", "").isalnum() else f'"{part}"'


def _shortened(text: str) -> str:
    """First line of a text, and no more of it than a message has room for."""
    first, *more = lines_of(text) or [""]
    return f"{first[:MAX_SHOWN]}..." if more or len(first) > MAX_SHOWN else first


def _written(value: object) -> str:
    """What can be said of a value whose text is not known."""
    if isinstance(value, dict | list):
        return "a table" if isinstance(value, dict) else "a list"
    return repr(value)


def _wrong_elements(errors: Sequence[dict[str, Any]]) -> Iterator[str]:
    for error in errors[:MAX_ELEMENTS]:
        value = error["input"]
        text = str(value).lower() if isinstance(value, bool) else f'"{value}"' if isinstance(value, str) else str(value)
        index = next(part for part in error["loc"] if isinstance(part, int))
        yield f"{_shortened(text)} as element {index + 1}"
    if len(errors) > MAX_ELEMENTS:
        yield f"and {len(errors) - MAX_ELEMENTS} more"


def _type_remedy(key: str, field: FieldInfo, value: object) -> str:
    if type_of(field) is bool:
        return f"write {key} = true or {key} = false, without quotes"
    if type_of(field) is str:
        return f'put it in quotes: {key} = "{value}"'
    if isinstance(value, str):
        return f"write the number without quotes and without a unit, as in {key} = {_example_number(field)}"
    kind = "a whole number" if type_of(field) is int else "a number"
    return f"write {kind}, as in {key} = {_example_number(field)}"


def _example_number(field: FieldInfo) -> str:
    """Number that would do: the example, or the default, or 1 where that is none."""
    return example_of(field) or str(1 if field.is_required() or field.default is None else field.default)


def default_text(field: FieldInfo) -> str:
    """Default of a key in words; empty when it has none."""
    if field.is_required():
        return ""
    return extra_of(field, "derived") or format_value(field, field.default)


def format_value(field: FieldInfo, value: object) -> str:
    """Value of a field as a person writes it: quantities with units, words and numbers as in the file."""
    if value is None:
        return "none"
    if isinstance(value, bool):
        return "true" if value else "false"
    unit = unit_of(field)
    if unit and isinstance(value, float):
        return format_quantity(value, unit)
    if unit and isinstance(value, list):
        return ", ".join(format_quantity(one, unit) for one in cast("list[float]", value))
    return f"{value:g}" if isinstance(value, float) else str(value)
