"""Values of ``--set``: which key they are for, what they mean, and what is wrong with them."""

import tomllib
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, cast

from pydantic.fields import FieldInfo

from detent.errors import FileProblem
from detent.files.fields import AnyName, Table, example_of, fits, is_list, leaf_fields, named_as, options_of, unit_of
from detent.files.locate import Path
from detent.files.problems import dotted
from detent.files.text import did_you_mean


def apply_overrides(
    tables: dict[str, Any], overrides: Sequence[str], model: type[Table]
) -> tuple[dict[Path, str], list[FileProblem]]:
    """Put values of ``--set`` over those of a file: by path each as written, and what is wrong with the others."""
    known, texts, problems = dict(leaf_fields(model)), dict[Path, str](), list[FileProblem]()
    for text in overrides:
        key, equals, value = (part.strip() for part in text.partition("="))
        path = tuple(key.split("."))
        wanted = next((leaf for pattern, leaf in known.items() if fits(pattern, path)), None)
        if not equals or not value:
            remedy = f"write it as in --set '{_example_override(tables, known.items())}'"
            problems.append(FileProblem("--set", 0, 0, key, f'"{text}"', "KEY=VALUE", remedy))
        elif wanted is None:
            remedy = did_you_mean(key, _keys_near(tables, known, path), "`detent check` lists the keys", 0.5)
            came, allowed = f'the unknown key "{key}"', "a key of the axis file"
            problems.append(FileProblem("--set", 0, 0, key, came, allowed, remedy))
        else:
            put_value(tables, path, _override_value(wanted, value))
            texts[path] = value
    return texts, problems


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
    for pattern in known:
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


def as_table(value: object) -> dict[str, Any]:
    """Give the value itself if it is a table, else an empty one."""
    return cast("dict[str, Any]", value) if isinstance(value, dict) else {}


def put_value(tables: dict[str, Any], path: Path, value: object) -> None:
    """Set a value in nested tables; where a table is none, validation says so."""
    for key in path[:-1]:
        tables = as_table(tables.setdefault(key, {}))
    tables[path[-1]] = value
