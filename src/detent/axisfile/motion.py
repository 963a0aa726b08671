"""One schema for an axis that slides and for one that turns: the model of the second is made from that of the first.

A rotary axis has rad for m, N*m for N and kg*m^2 for kg; nothing else about its keys differs. A model that is written
for a linear axis therefore says all there is to say, and `rotary_model` exchanges the units of its quantities.
"""

from copy import copy
from functools import cache
from types import UnionType
from typing import Annotated, Any, TypeVar, Union, cast, get_args, get_origin

from pydantic import create_model
from pydantic.fields import FieldInfo

from detent.files.fields import Table, Unit, extra_of, table_of
from detent.units import describe_kind

TableT = TypeVar("TableT", bound=Table)

ROTARY_UNITS = {
    "m": "rad",
    "m/s": "rad/s",
    "m/s^2": "rad/s^2",
    "m/s^3": "rad/s^3",
    "N": "N*m",
    "kg": "kg*m^2",
    "N*s/m": "N*m*s/rad",
    "N/m": "N*m/rad",
    "N/V": "N*m/V",
    "V*s/m": "V*s/rad",
    "V/m": "V/rad",
    "V/(m*s)": "V/(rad*s)",
}
"""Units of a rotary axis, by those of a linear one; every other unit is the same for both."""


def unit_in(motion: str, unit: str) -> str:
    """Unit of an axis's quantity, by that of a linear axis.

    >>> unit_in("rotary", "N/m"), unit_in("linear", "N/m"), unit_in("rotary", "ohm")
    ('N*m/rad', 'N/m', 'ohm')
    """
    return ROTARY_UNITS.get(unit, unit) if motion == "rotary" else unit


@cache
def rotary_model(model: type[TableT]) -> type[TableT]:
    """The same table for an axis that turns."""
    changed = {name: _rotary_field(field) for name, field in model.model_fields.items()}
    fields = {name: field for name, field in changed.items() if field is not None}
    if not fields:
        return model
    make: Any = create_model
    made = make(f"Rotary{model.__name__}", __base__=model, __module__=model.__module__, __doc__=model.__doc__, **fields)
    return cast("type[TableT]", made)


def _rotary_field(field: FieldInfo) -> tuple[Any, FieldInfo] | None:
    """Annotation and declaration of a key of a rotary axis; None where they are those of a linear one."""
    annotation = _exchanged(field.annotation)
    metadata = [_rotary_unit(entry) for entry in field.metadata]
    units = [entry for entry in metadata if isinstance(entry, Unit)]
    if annotation is field.annotation and metadata == field.metadata:
        return None
    made = copy(field)
    # The annotation brings the unit, and pydantic joins both.
    made.metadata = [entry for entry in metadata if not isinstance(entry, Unit)]
    made.annotation = None
    below = table_of(field)
    if below is not None and field.default_factory is below:
        made.default_factory = rotary_model(below)
    turned = extra_of(field, "turned")
    if field.examples and units:
        made.examples = [turned or f'"{describe_kind(units[0].symbol)[1]}"']
    if extra_of(field, "start"):
        made.json_schema_extra = cast("dict[str, Any]", field.json_schema_extra) | {"start": turned}
    return (Annotated[annotation, *units] if units else annotation), made


def _exchanged(annotation: Any) -> Any:
    """A type with the units of a rotary axis; the type itself where nothing in it has one."""
    made, held = annotation, get_args(annotation)
    if _is_table(annotation):
        return rotary_model(annotation)
    if get_origin(annotation) is Annotated:
        kept = [_rotary_unit(entry) for entry in held[1:]]
        made = Annotated[held[0], *kept] if kept != list(held[1:]) else annotation
    elif get_origin(annotation) in {Union, UnionType}:
        inner = tuple(_exchanged(one) for one in held)
        made = Union[inner] if inner != held else annotation  # noqa: UP007 - the members are only known here
    return made


def _is_table(annotation: object) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, Table)


def _rotary_unit(entry: object) -> object:
    """An annotation with the unit of a rotary axis."""
    return Unit(ROTARY_UNITS.get(entry.symbol, entry.symbol)) if isinstance(entry, Unit) else entry
