"""The keys of a file of tables, for people: each with its unit, range, default and meaning, and a file to start from.

Both are made from the declarations of the schema alone.
"""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from textwrap import wrap
from typing import cast

from pydantic.fields import FieldInfo

from detent.files.fields import (
    Table,
    describe_allowed,
    example_of,
    extra_of,
    is_list,
    is_named,
    is_rows,
    keys_of,
    leaf_fields,
    list_example,
    options_of,
    table_of,
    tables_of,
    unit_of,
)
from detent.files.locate import Path
from detent.files.problems import default_text, dotted, format_value
from detent.units import describe_kind

WIDTH = 100  # columns of a comment in a starting file


@dataclass(frozen=True, slots=True)
class KeyRow:
    """One key of a file."""

    key: str  # dotted key
    unit: str  # SI unit the value is converted to; empty for numbers, words and switches
    default: str  # value that holds when the key is left out; empty when it must be stated
    required: bool  # True when it must be stated (in its table, if that is given at all)
    doc: str  # meaning
    allowed: str  # allowed values
    example: str  # a value as TOML text, for keys that must be stated

    def holds(self, word: str) -> bool:
        """True when a word, in capitals or not, is part of what is said of the key."""
        return word.lower() in f"{self.key} {self.unit} {self.default} {self.doc} {self.allowed}".lower()


def key_rows(model: type[Table]) -> tuple[KeyRow, ...]:
    """All keys that a file knows, in the order of the schema."""
    return tuple(
        KeyRow(
            key=dotted(path),
            unit=unit_of(field),
            default=default_text(field),
            required=field.is_required(),
            doc=field.description or "",
            allowed=describe_allowed(field),
            example=example_of(field),
        )
        for path, field in leaf_fields(model)
    )


def own_rows(model: type[Table], beside: type[Table]) -> tuple[KeyRow, ...]:
    """Keys that a model has, and another beside it has not."""
    known = {row.key for row in key_rows(beside)}
    return tuple(row for row in key_rows(model) if row.key not in known)


def starting_file(model: type[Table], stated: Mapping[Path, object], given: Mapping[Path, object] | None = None) -> str:
    """Text of a file with every key: those stated here or needed to begin with as they are, the others as comments.

    Taken out of its comment, a key has the value that holds without it, or an example where that is made from others.
    What is `given` from elsewhere, as by a catalogue, is a comment too.
    """
    return "\n".join(_table_lines(model, (), _Values(stated, given or {}), live=True)).strip() + "\n"


@dataclass(frozen=True, slots=True)
class _Values:
    """Values that a starting file has, by path: those it states, and those that hold without being stated."""

    stated: Mapping[Path, object]
    given: Mapping[Path, object]


def _table_lines(table: type[Table], path: Path, values: _Values, *, live: bool) -> Iterator[str]:
    """Keys of a table, then the tables below it; one that may be left out is a comment as a whole."""
    mark, below = "" if live else "#", list[tuple[FieldInfo, type[Table], Path]]()
    if path:
        yield from ("", f"# {(table.__doc__ or '').splitlines()[0]}", f"{mark}[{dotted(path)}]")
    for key, field in keys_of(table).items():
        inside, own = table_of(field), (*path, key)
        if inside is None:
            yield from _key_lines(field, own, values, live=live)
        elif is_named(field):
            names = {known[len(own)] for known in values.stated if known[: len(own)] == own} or {example_of(field)}
            models = tables_of(field)
            below += [(field, models.get(name, inside), (*own, name)) for name in sorted(names)]
        elif not is_rows(field):
            below.append((field, inside, own))
    for field, inside, own in below:
        begun = field.is_required() or field.default_factory is inside or bool(extra_of(field, "start"))
        meant = any(known[: len(own)] == own for known in values.stated)
        yield from _table_lines(inside, own, values, live=live and (begun or meant))


def _key_lines(field: FieldInfo, path: Path, values: _Values, *, live: bool) -> Iterator[str]:
    """Meaning, range and default of a key as a comment, then the key."""
    start, is_stated = extra_of(field, "start"), path in values.stated
    known = values.stated if is_stated else values.given
    text = toml_text(known[path]) if path in known else start or example_of(field) or _default_example(field)
    needed = is_stated or (path not in values.given and (field.is_required() or bool(start)))
    default = default_text(field)
    told = f"; default: {default or 'nothing'}" if not field.is_required() and default != text.strip('"') else ""
    about = f"{field.description}: {describe_allowed(field)}{told}"
    yield from wrap(about, WIDTH, initial_indent="# ", subsequent_indent="#   ", break_on_hyphens=False)
    yield f"{'' if live and needed else '#'}{path[-1]} = {text}"


def _default_example(field: FieldInfo) -> str:
    """Default of a key as TOML text; where there is none, or it is made from other keys, an example of its kind."""
    default, unit = cast("object", field.default), unit_of(field)
    if is_list(field):
        return toml_text(default) if default and not unit else list_example(field)
    if extra_of(field, "derived") or default is None:
        if options_of(field):
            return toml_text(options_of(field)[0])
        return toml_text(describe_kind(unit)[1]) if unit else "1"
    return toml_text(format_value(field, default) if unit else default)


def toml_text(value: object) -> str:
    """A value as TOML text."""
    if isinstance(value, list):
        return f"[{', '.join(toml_text(one) for one in cast('list[object]', value))}]"
    if isinstance(value, float):
        return repr(value)
    return json.dumps(value, ensure_ascii=False)
