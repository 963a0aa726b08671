"""How a key of the axis file is declared: its unit, bounds, default and meaning, once, on the field itself.

Everything else that knows about keys (validation, messages, the printed axis, the reference) reads these declarations.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal, cast, get_args, get_origin

from annotated_types import Ge, Gt, Le, Lt, MaxLen, MinLen
from pydantic import BaseModel, ConfigDict, Field, GetCoreSchemaHandler
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from detent.units import QuantityError, describe_kind, format_quantity, parse_quantity

LIST_EXAMPLE = "[20000, 20096]"
"""List of whole numbers shown for a key that has no example of its own."""


@dataclass(frozen=True, slots=True)
class Unit:
    """Annotation of a dimensional field: text with a unit in the file, a float of this unit inside."""

    symbol: str

    def __get_pydantic_core_schema__(self, source: object, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Put the reading of the text before the check of the number."""
        return core_schema.no_info_before_validator_function(self.read, handler(source))

    def read(self, value: object) -> object:
        """Read the text of a quantity; anything else is refused with an example."""
        kind, example = describe_kind(self.symbol)
        allowed = f'{kind} with its unit, such as "{example}"'
        if not isinstance(value, str):
            remedy = f'write it as text with a unit, as in "{example}"'
            raise PydanticCustomError("quantity", "not a quantity", {"allowed": allowed, "remedy": remedy})
        try:
            return parse_quantity(value, self.symbol)
        except QuantityError as error:
            context = {"allowed": error.allowed, "remedy": error.remedy}
            raise PydanticCustomError("quantity", "not a quantity", context) from None


class Table(BaseModel, frozen=True):
    """A table of the axis file: unknown keys are errors, nothing is converted silently, nothing changes later.

    Each model says ``frozen=True`` again: pyright lets a method narrow a common field only where it reads that.
    """

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


def required(doc: str, example: str, *, allowed: str = "", **bounds: float) -> Any:
    """Declare a key that must be stated.

    Parameters
    ----------
    doc : str
        Meaning of the key, one sentence without a full stop.
    example : str
        A value as TOML text, used in messages and in the reference.
    allowed : str
        Range in words, where the bounds in SI would be hard to recognise.
    **bounds : float
        ``gt``, ``ge``, ``lt``, ``le`` in the SI unit of the field, or ``min_length``, ``max_length`` of a text or a
        list. The numbers of a list are bounded by its type: ``list[Annotated[int, Ge(0)]]``.
    """
    constraints: dict[str, Any] = dict(bounds)
    return Field(description=doc, examples=[example], json_schema_extra={"allowed": allowed}, **constraints)


def optional(doc: str, default: object, *, derived: str = "", allowed: str = "", **bounds: float) -> Any:
    """Declare a key that may be left out.

    Parameters
    ----------
    doc : str
        Meaning of the key, one sentence without a full stop.
    default : object
        Value in the SI unit of the field; a callable makes it from the table's other values.
    derived : str
        Where the default comes from, in words, when it depends on other keys.
    allowed, **bounds
        As in `required`.
    """
    constraints: dict[str, Any] = dict(bounds)
    constraints["default_factory" if callable(default) else "default"] = default
    return Field(description=doc, json_schema_extra={"allowed": allowed, "derived": derived}, **constraints)


def file_key(name: str, field: FieldInfo) -> str:
    """Key of a field as written in the file."""
    return field.alias or name


def unit_of(field: FieldInfo) -> str:
    """SI unit of a dimensional field; empty for pure numbers, words and switches."""
    units = [entry.symbol for entry in _annotations_of(field) if isinstance(entry, Unit)]
    return units[0] if units else ""


def table_of(field: FieldInfo) -> type[Table] | None:
    """Model of the table below a field, or None for a value."""
    for candidate in (field.annotation, *get_args(field.annotation)):
        if isinstance(candidate, type) and issubclass(candidate, Table):
            return candidate
    return None


def is_list(field: FieldInfo) -> bool:
    """True for a key that holds a list of whole numbers."""
    return list in {get_origin(candidate) for candidate in (field.annotation, *get_args(field.annotation))}


def list_example(field: FieldInfo) -> str:
    """Give an example of a list, as TOML text."""
    held: object = field.default
    return example_of(field) or (str(cast("list[int]", held)) if held and isinstance(held, list) else LIST_EXAMPLE)


def extra_of(field: FieldInfo, name: str) -> str:
    """Word kept beside a field by `required` or `optional` (``allowed``, ``derived``)."""
    extra = field.json_schema_extra
    return str(cast("dict[str, object]", extra).get(name, "")) if isinstance(extra, dict) else ""


def example_of(field: FieldInfo) -> str:
    """Give an example of a value that must be stated, as TOML text."""
    return str(field.examples[0]) if field.examples else ""


def leaf_fields(table: type[Table], prefix: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], FieldInfo]]:
    """Walk all values a table can hold, tables below it included, in the order of declaration."""
    for name, field in table.model_fields.items():
        path = (*prefix, file_key(name, field))
        below = table_of(field)
        if below is None:
            yield path, field
        else:
            yield from leaf_fields(below, path)


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
    if field.annotation is bool:
        return "true or false"
    if field.annotation is str:
        return "text in quotes"
    return _describe_number(field)


def options_of(field: FieldInfo) -> tuple[str, ...]:
    """Words a field may hold, when it is a choice."""
    if get_origin(field.annotation) is Literal:
        return tuple(str(option) for option in get_args(field.annotation))
    return ()


def _describe_list(field: FieldInfo) -> str:
    """Say what a list may be: its numbers, an example, its length."""
    numbers = f"a list of whole numbers {_describe_bounds(field, '')}".rstrip()
    lengths: list[str] = []
    for entry in _annotations_of(field):
        if isinstance(entry, MinLen) and entry.min_length > 0:
            lengths.append(f"at least {entry.min_length}")
        elif isinstance(entry, MaxLen):
            lengths.append(f"at most {entry.max_length}")
    many = f", {' and '.join(lengths)} of them" if lengths else ""
    return f"{numbers}, such as {list_example(field)}{many}"


def _describe_number(field: FieldInfo) -> str:
    """Say what a quantity or a number may be."""
    unit = unit_of(field)
    bounds = _describe_bounds(field, unit)
    if unit:
        kind, example = describe_kind(unit)
        return f"{kind} {bounds}" if bounds else f'{kind} such as "{example}"'
    kind = "a whole number" if field.annotation is int else "a number"
    return f"{kind} {bounds}".rstrip()


def _describe_bounds(field: FieldInfo, unit: str) -> str:
    """Bounds of a number in words, with units; empty when there are none."""
    texts: list[str] = []
    for entry in _annotations_of(field):
        if isinstance(entry, Gt):
            texts.append(f"above {_bound_text(entry.gt, unit)}")
        elif isinstance(entry, Ge):
            texts.append(f"from {_bound_text(entry.ge, unit)}")
        elif isinstance(entry, Lt):
            texts.append(f"below {_bound_text(entry.lt, unit)}")
        elif isinstance(entry, Le):
            texts.append(f"up to {_bound_text(entry.le, unit)}")
    return " and ".join(texts).replace(" and up to", " up to")


def _bound_text(bound: object, unit: str) -> str:
    """Write a bound with its unit; whole numbers in full."""
    if isinstance(bound, int) and not unit:
        return str(bound)
    return format_quantity(float(str(bound)), unit)


def _annotations_of(field: FieldInfo) -> Iterator[object]:
    """Annotations of a field, those inside ``... | None`` and ``list[...]`` included."""
    yield from field.metadata
    yield from _annotations_inside(get_args(field.annotation))


def _annotations_inside(candidates: Sequence[object]) -> Iterator[object]:
    """Annotations of the types that a type is made of."""
    for candidate in candidates:
        yield from getattr(candidate, "__metadata__", ())
        if get_origin(candidate) is list:
            yield from _annotations_inside(get_args(candidate))
