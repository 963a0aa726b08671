"""How a key of the axis file is declared: its unit, bounds, default and meaning, once, on the field itself.

Everything else that knows about keys (validation, messages, the printed axis, the reference) reads these declarations.
"""

import operator
from collections.abc import Callable, Iterator, Sequence
from dataclasses import astuple, dataclass
from functools import cache
from types import NoneType, UnionType
from typing import Annotated, Any, Final, Literal, Union, cast, get_args, get_origin

from annotated_types import Ge, Gt, Le, Lt, MaxLen, MinLen
from pydantic import BaseModel, ConfigDict, Field, GetCoreSchemaHandler, ValidationInfo
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from detent.units import QuantityError, describe_kind, format_quantity, parse_quantity

LIST_EXAMPLE = "[20000, 20096]"  # list of whole numbers shown for a key that has no example of its own
IN_SI: Final = "values are in SI units"  # context of a validation of numbers from a program: no text with a unit


# Bounds of a number: how one is told, and whether a number keeps to it.
BOUNDS: dict[type, tuple[str, Callable[[Any, Any], bool]]] = {
    Gt: ("above", operator.gt),
    Ge: ("from", operator.ge),
    Lt: ("below", operator.lt),
    Le: ("up to", operator.le),
}


class AnyName(str):
    """Place in a path of the schema where the file has a name of the user's choice, as in ``[position.NUMBER]``."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class Unit:
    """Annotation of a dimensional field: text with a unit in the file, a float of this unit inside."""

    symbol: str

    def __get_pydantic_core_schema__(self, source: object, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Put the reading of the text before the check of the number."""
        return core_schema.with_info_before_validator_function(self.read, handler(source))

    def read(self, value: object, info: ValidationInfo) -> object:
        """Read the text of a quantity; anything else is refused with an example."""
        if info.context == IN_SI:
            return value
        if not isinstance(value, str):
            kind, example = describe_kind(self.symbol)
            allowed = f'{kind} with its unit, such as "{example}"'
            remedy = f'write it as text with a unit, as in "{example}"'
            raise PydanticCustomError("quantity", "not a quantity", {"allowed": allowed, "remedy": remedy})
        try:
            return parse_quantity(value, self.symbol)
        except QuantityError as error:
            context = {"allowed": error.allowed, "remedy": error.remedy}
            raise PydanticCustomError("quantity", "not a quantity", context) from None


@dataclass(frozen=True, slots=True)
class OwnTables:
    """Annotation of tables that the user names: those of some names have a model of their own."""

    models: tuple[tuple[str, "type[Table]"], ...]


class Table(BaseModel, frozen=True):
    """A table of a file: unknown keys are errors, nothing is converted silently, nothing changes later.

    Each model says ``frozen=True`` again: pyright lets a method narrow a common field only where it reads that.
    """

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


def required(  # noqa: PLR0913 - each word is one that a key may have
    doc: str,
    example: str,
    *,
    allowed: str = "",
    alias: str | None = None,
    start: str = "",
    turned: str = "",
    **bounds: float,
) -> Any:
    """Declare a key that must be stated; a starting file has its example, or what shall stand there in its place.

    `turned` is the example of a rotary axis.
    """
    constraints: dict[str, Any] = dict(bounds)
    extra: dict[str, Any] = {"allowed": allowed, "start": start, "turned": turned}
    return Field(description=doc, examples=[example], alias=alias, json_schema_extra=extra, **constraints)


def optional(  # noqa: PLR0913 - the same
    doc: str,
    default: object,
    *,
    derived: str = "",
    allowed: str = "",
    alias: str | None = None,
    start: str = "",
    turned: str = "",
    **bounds: float,
) -> Any:
    """Declare a key that may be left out; `start` is what a starting file says all the same, `turned` if it turns."""
    constraints: dict[str, Any] = dict(bounds)
    constraints["default_factory" if callable(default) else "default"] = default
    extra: dict[str, Any] = {"allowed": allowed, "derived": derived, "start": start, "turned": turned}
    return Field(description=doc, alias=alias, json_schema_extra=extra, **constraints)


def begun() -> Any:
    """Declare a table that may be left out, but that a starting file has."""
    return Field(default=None, json_schema_extra={"start": "true"})


def rows(doc: str) -> Any:
    """Declare a list of tables, as in ``[[move]]``; the field's type is ``list[SomeTable]``."""
    return Field(description=doc, default_factory=list)


@dataclass(frozen=True, slots=True)
class Naming:
    """How the user may name tables."""

    placeholder: str  # what stands for the name in the reference, such as ``"NUMBER"``
    pattern: str  # regular expression that every name matches as a whole
    allowed: str  # the same in words
    example: str  # a name that would do


def named(doc: str, naming: Naming, *, start: bool = False, **bounds: int) -> Any:
    """Declare tables that the user names, as in ``[position.3]``; the field's type is ``dict[str, SomeTable]``.

    A starting file has one where `start` says so, or where there must be one.
    """
    extra: dict[str, Any] = {"name": naming.placeholder, "pattern": naming.pattern, "allowed": naming.allowed}
    extra |= {"start": "true"} if start else {}
    constraints: dict[str, Any] = dict(bounds)
    if "min_length" not in bounds:
        constraints["default_factory"] = dict
    return Field(description=doc, examples=[naming.example], json_schema_extra=extra, **constraints)


@cache
def is_named(field: FieldInfo) -> bool:
    """True for tables that the user names."""
    return get_origin(field.annotation) is dict


def is_rows(field: FieldInfo) -> bool:
    """True for a list of tables."""
    return table_of(field) is not None and is_list(field)


def file_key(name: str, field: FieldInfo) -> str:
    """Key of a field as written in the file."""
    return field.alias or name


@cache
def keys_of(table: type[Table]) -> dict[str, FieldInfo]:
    """Declaration of each key of a table, as written in the file."""
    return {file_key(name, field): field for name, field in table.model_fields.items()}


@cache
def unit_of(field: FieldInfo) -> str:
    """SI unit of a dimensional field; empty for pure numbers, words and switches."""
    units = [entry.symbol for entry in _annotations_of(field) if isinstance(entry, Unit)]
    return units[0] if units else ""


@cache
def table_of(field: FieldInfo) -> type[Table] | None:
    """Model of the table below a field, of each table where they are named, or None for a value."""
    for candidate in (field.annotation, *get_args(field.annotation)):
        if isinstance(candidate, type) and issubclass(candidate, Table):
            return candidate
    return None


def tables_of(field: FieldInfo) -> dict[str, type[Table]]:
    """Models of the tables of some names, where they have one of their own."""
    return dict(next((entry.models for entry in field.metadata if isinstance(entry, OwnTables)), ()))


def type_of(field: FieldInfo) -> object:
    """Type of a value that is stated: that of the field, without None."""
    stated: object = field.annotation
    if get_origin(stated) in {Union, UnionType}:
        stated = next(part for part in get_args(stated) if part is not NoneType)
    return get_args(stated)[0] if get_origin(stated) is Annotated else stated


def is_list(field: FieldInfo) -> bool:
    """True for a key that holds a list: of whole numbers, or of quantities."""
    return list in {get_origin(candidate) for candidate in (field.annotation, *get_args(field.annotation))}


def list_example(field: FieldInfo) -> str:
    """Give an example of a list, as TOML text."""
    held, unit = cast("object", field.default), unit_of(field)
    whole_numbers = str(cast("list[int]", held)) if held and isinstance(held, list) else LIST_EXAMPLE
    return example_of(field) or (f'["{describe_kind(unit)[1]}"]' if unit else whole_numbers)


def extra_of(field: FieldInfo, name: str) -> str:
    """Word kept beside a field by `required` or `optional` (``allowed``, ``derived``, ``start``, ``turned``)."""
    extra = field.json_schema_extra
    return str(cast("dict[str, object]", extra).get(name, "")) if isinstance(extra, dict) else ""


def example_of(field: FieldInfo) -> str:
    """Give an example of a value that must be stated, as TOML text."""
    return str(field.examples[0]) if field.examples else ""


@cache
def leaf_fields(table: type[Table]) -> Sequence[tuple[tuple[str, ...], FieldInfo]]:
    """All values a table can hold, tables below it included, in the order of declaration.

    Where the user names the tables, `AnyName` stands in the path; names with a model of their own follow.
    """
    return tuple(_leaves_below(table, ()))


def _leaves_below(table: type[Table], prefix: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], FieldInfo]]:
    for key, field in keys_of(table).items():
        path, below = (*prefix, key), table_of(field)
        if below is None:
            yield path, field
        elif is_named(field):
            yield from _leaves_below(below, (*path, AnyName(extra_of(field, "name"))))
            for own, model in tables_of(field).items():
                yield from _leaves_below(model, (*path, own))
        else:
            yield from _leaves_below(below, path)


def held_leaves(table: Table, prefix: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], FieldInfo, object]]:
    """Walk all values that a table holds, with the names the user gave; optional tables it lacks are skipped."""
    for name, field in type(table).model_fields.items():
        path, value = (*prefix, file_key(name, field)), cast("object", getattr(table, name))
        if isinstance(value, Table):
            yield from held_leaves(value, path)
        elif is_named(field):
            for own, below in cast("dict[str, Table]", value).items():
                yield from held_leaves(below, (*path, own))
        elif table_of(field) is None:
            yield path, field, value


def fits(pattern: tuple[str, ...], path: tuple[str, ...]) -> bool:
    """True when a path of a file is one of those that a path of the schema stands for."""
    return len(pattern) == len(path) and all(
        isinstance(part, AnyName) or part == own for part, own in zip(pattern, path, strict=True)
    )


def named_as(pattern: tuple[str, ...], path: tuple[str, ...]) -> tuple[str, ...]:
    """A path of the schema, with the names that a path of a file has where both are alike up to there."""
    for k, (part, own) in enumerate(zip(pattern, path, strict=False)):
        if isinstance(part, AnyName):
            pattern = (*pattern[:k], own, *pattern[k + 1 :])
        elif part != own:
            break
    return pattern


def describe_allowed(field: FieldInfo) -> str:
    """Say what a value may be: its kind, its range, an example."""
    stated = extra_of(field, "allowed")
    if stated:
        return stated
    options = options_of(field)
    if options:
        return " or ".join(f'"{option}"' for option in options)
    if is_list(field):
        return _describe_list(field)
    if type_of(field) is bool:
        return "true or false"
    if type_of(field) is str:
        return "text in quotes"
    return _describe_number(field)


def options_of(field: FieldInfo) -> tuple[str, ...]:
    """Words a field may hold, when it is a choice."""
    kind = type_of(field)
    return tuple(map(str, get_args(kind))) if get_origin(kind) is Literal else ()


def _describe_list(field: FieldInfo) -> str:
    """Say what a list may be: its numbers, an example, its length."""
    unit = unit_of(field)
    kind = f"a list, each {describe_kind(unit)[0]}" if unit else "a list of whole numbers"
    numbers = f"{kind} {_describe_bounds(field, unit)}".rstrip()
    least, most = bounds_of_length(field)
    lengths = [f"at least {least}"] if least else []
    lengths += [f"at most {most}"] if most else []
    many = f", {' and '.join(lengths)} of them" if lengths else ""
    return f"{numbers}, such as {list_example(field)}{many}"


def bounds_of_length(field: FieldInfo) -> tuple[int, int]:
    """Least and largest number of elements of a list, or of tables that the user names; 0 where nothing is said."""
    least = [entry.min_length for entry in _annotations_of(field) if isinstance(entry, MinLen)]
    most = [entry.max_length for entry in _annotations_of(field) if isinstance(entry, MaxLen)]
    return (least or [0])[0], (most or [0])[0]


def _describe_number(field: FieldInfo) -> str:
    """Say what a quantity or a number may be."""
    unit = unit_of(field)
    bounds = _describe_bounds(field, unit)
    if unit:
        kind, example = describe_kind(unit)
        return f"{kind} {bounds}" if bounds else f'{kind} such as "{example}"'
    kind = "a whole number" if type_of(field) is int else "a number"
    return f"{kind} {bounds}".rstrip()


def _describe_bounds(field: FieldInfo, unit: str) -> str:
    """Bounds of a number in words, with units; empty when there are none."""
    texts: list[str] = []
    for kind, bound in bounds_of(field):
        in_full = isinstance(bound, int) and not unit
        texts.append(f"{BOUNDS[kind][0]} {bound if in_full else format_quantity(float(bound), unit)}")
    return " and ".join(texts).replace(" and up to", " up to")


def bounds_of(field: FieldInfo) -> Iterator[tuple[type, Any]]:
    """Bounds of a number: the kind of each, as in `BOUNDS`, and the bound."""
    for entry in _annotations_of(field):
        if isinstance(entry, Gt | Ge | Lt | Le):
            yield type(entry), astuple(entry)[0]


def _annotations_of(field: FieldInfo) -> Iterator[object]:
    """Annotations of a field, those inside ``... | None`` and ``list[...]`` included."""
    yield from field.metadata
    inside = list(get_args(field.annotation))
    for candidate in inside:
        yield from getattr(candidate, "__metadata__", ())
        if get_origin(candidate) is list:
            inside += get_args(candidate)
