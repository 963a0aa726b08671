"""Values over those of a file, of ``--set`` or of a program: for which keys, what they mean, what is wrong."""

import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, TypeVar, cast

from pydantic.fields import FieldInfo

from detent.errors import DetentError, FileProblem
from detent.files.fields import AnyName, Table, example_of, fits, is_list, leaf_fields, named_as, options_of, unit_of
from detent.files.locate import Path
from detent.files.problems import dotted, field_at
from detent.files.text import did_you_mean

Leaf = TypeVar("Leaf")


def apply_overrides(
    tables: dict[str, Any], overrides: Sequence[str], model: type[Table]
) -> tuple[dict[Path, str], list[FileProblem]]:
    """Put values of ``--set`` over those of a file: by path each as written, and what is wrong with the others."""
    known, texts, problems = dict(leaf_fields(model)), dict[Path, str](), list[FileProblem]()
    for text in overrides:
        key, equals, value = (part.strip() for part in text.partition("="))
        path = tuple(key.split("."))
        wanted = _at(known, path)
        if not equals or not value:
            remedy = f"write it as in --set '{_example_override(tables, known.items())}'"
            problems.append(FileProblem("--set", 0, 0, key, f'"{text}"', "KEY=VALUE", remedy))
        elif value == "none" and _may_be_none(model, path, wanted):
            around = tables
            for part in path[:-1]:
                around = as_table(around.get(part))
            around.pop(path[-1], None)
            texts[path] = value
        elif wanted is None:
            remedy = did_you_mean(key, _keys_near(tables, known, path), "`detent check` lists the keys", 0.5)
            got, allowed = f'the unknown key "{key}"', "a key of the axis file"
            problems.append(FileProblem("--set", 0, 0, key, got, allowed, remedy))
        else:
            put_value(tables, path, _override_value(wanted, value))
            texts[path] = value
    return texts, problems


def _at(known: Mapping[Path, Leaf], path: Path) -> Leaf | None:
    """What is known of the key at a path: of a table of this very name, or of one of any name."""
    found = (leaf for pattern, leaf in known.items() if fits(pattern, path))
    return known[path] if path in known else next(found, None)


def _may_be_none(model: type[Table], path: Path, wanted: FieldInfo | None) -> bool:
    """True for a key, or a table, that need not be there, and for which "none" is no word of its own."""
    if wanted is None:
        try:
            wanted = field_at(model, path)
        except KeyError:
            return False
    is_word = wanted.annotation is str or "none" in options_of(wanted)
    return wanted.default is None and not wanted.is_required() and not is_word


def _example_override(tables: dict[str, Any], known: Iterable[tuple[Path, FieldInfo]]) -> str:
    """An override that this file could have."""
    quantities = [(path, field) for path, field in known if unit_of(field) and not is_list(field)]
    supply = [path for path, _ in quantities if path[-2:] == ("drive", "supply")]
    if supply:
        return f"{dotted(next(filled(tables, supply[0])))}=34 V"
    path, field = next((path, field) for path, field in quantities if field.is_required())
    return f"{dotted(next(filled(tables, path)))}={example_of(field).strip(chr(34))}"


def _keys_near(tables: dict[str, Any], known: Iterable[Path], path: Path) -> list[str]:
    """Keys that a misspelt one may have been meant to be, with its own names and with those of the file."""
    near: list[str] = []
    alike = [pattern for pattern in known if pattern[-1] == path[-1]]
    for pattern in alike or known:
        own = named_as(pattern, path)
        keys = [*filled(tables, pattern), *([] if any(isinstance(part, AnyName) for part in own) else [own])]
        near += [dotted(key) for key in keys]
    return near


def filled(tables: dict[str, Any], pattern: Path, done: Path = ()) -> Iterator[Path]:
    """A path of the schema with each name that the file uses; the placeholder stays where it uses none."""
    if not pattern:
        yield done
        return
    first = pattern[0]
    for name in (tables or [first]) if isinstance(first, AnyName) else [first]:
        yield from filled(as_table(tables.get(name)), pattern[1:], (*done, name))


def _override_value(field: FieldInfo, text: str) -> object:
    """Value of an override: what the same words mean in a file, quotes being optional."""
    if len(text) >= 2 and text[0] == text[-1] and text[0] in "\"'":
        return text[1:-1]
    if field.annotation is str or options_of(field) or (text in {"true", "false"} and unit_of(field)):
        return text
    try:
        tables = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):  # what is no TOML stays text, and validation refuses it
        return text
    value: object = tables["value"]
    # After a line break anything could follow.
    kinds: tuple[type, ...] = (list,) if is_list(field) else (bool, int, float)
    return value if len(tables) == 1 and type(value) in kinds else text


# ---- values from a program


def nested(changes: Mapping[Any, Any], before: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Tables of changes, over those made before; a key may be dotted, and None takes a value back.

    >>> nested({"limits.speed": 0.5, "axis": {"name": "a"}}, {"limits": {"speed": 1.0, "travel": 2.0}})
    {'limits': {'speed': 0.5, 'travel': 2.0}, 'axis': {'name': 'a'}}
    """
    made: dict[str, Any] = {
        key: nested(cast("dict[str, Any]", one)) if isinstance(one, dict) else one
        for key, one in (before or {}).items()
    }
    value: Any
    for key, value in changes.items():
        *around, last = str(key).split(".")
        table = made
        for part in around:
            below = table.setdefault(part, {})
            if not isinstance(below, dict):
                raise DetentError(
                    f"{key}: got a value in {part}, which is one itself; expected: a value or a table; leave one out"
                )
            table = cast("dict[str, Any]", below)
        held = table.get(last)
        is_table = isinstance(value, Mapping)
        table[last] = nested(cast("Mapping[Any, Any]", value), as_table(held)) if is_table else _plain(value)
    return made


def _plain(value: Any) -> Any:
    """A value without the types of NumPy: an array as a list, a number as one of Python."""
    plain = value.tolist() if hasattr(value, "tolist") else value
    return [_plain(one) for one in cast("list[Any]", plain)] if isinstance(plain, list | tuple) else plain


def apply_changes(tables: dict[str, Any], changes: Mapping[str, Any], model: type[Table]) -> dict[Path, str]:
    """Put values of a program over those of a file: by path each as it would be written there.

    A number of a dimensional key is in the SI unit of the key, as numbers of a program are.
    """
    units = {pattern: unit_of(field) for pattern, field in leaf_fields(model)}
    texts: dict[Path, str] = {}
    for path, value in _leaves(changes):
        if value is None:
            _take_out(tables, path)
            continue
        unit = _at(units, path) or ""
        written = _with_unit(value, unit)
        table = tables
        for key in path[:-1]:
            if not isinstance(table.get(key), dict):
                table[key] = {}  # where a value stood: validation says that it is one
            table = table[key]
        table[path[-1]] = written | as_table(table.get(path[-1])) if isinstance(written, dict) else written
        texts[path] = _text(written)
        # Of a table in place of a value, the value is what is wrong.
        values = (path[:length] for length in range(1, len(path)) if any(fits(one, path[:length]) for one in units))
        texts.update(dict.fromkeys(values, "a table"))
    return texts


def _leaves(tables: Mapping[str, Any], prefix: Path = ()) -> Iterator[tuple[Path, Any]]:
    for key, value in tables.items():
        if isinstance(value, dict) and value:
            yield from _leaves(cast("dict[str, Any]", value), (*prefix, key))
        else:
            yield (*prefix, key), value


def _with_unit(value: Any, unit: str) -> Any:
    if isinstance(value, list):
        return [_with_unit(one, unit) for one in cast("list[Any]", value)]
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return f"{float(value)!r} {unit}" if is_number and unit else value


def _text(value: Any) -> str:
    """A value as messages show what was written."""
    return value if isinstance(value, str) else str(value).lower() if isinstance(value, bool) else str(value)


def _take_out(tables: dict[str, Any], path: Path) -> None:
    for key in path[:-1]:
        tables = as_table(tables.get(key))
    tables.pop(path[-1], None)


def as_table(value: object) -> dict[str, Any]:
    """Give the value itself if it is a table, else an empty one."""
    return cast("dict[str, Any]", value) if isinstance(value, dict) else {}


def put_value(tables: dict[str, Any], path: Path, value: object) -> None:
    """Set a value in nested tables; where a table is none, validation says so."""
    for key in path[:-1]:
        tables = as_table(tables.setdefault(key, {}))
    tables[path[-1]] = value
