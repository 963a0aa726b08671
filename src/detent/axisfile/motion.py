"""One schema for an axis that slides and for one that turns: the model of the second is made from that of the first.

A rotary axis has rad for m, N*m for N and kg*m^2 for kg; nothing else about its keys differs. A model that is written
for a linear axis therefore says all there is to say, and `rotary_model` exchanges the units of its quantities. Where
other keys fit better, a table names the one that takes its place.

An axis slides or turns by its key ``axis.motion``; of an axis with several motors each says so for itself
(`MovingTable`).
"""

from copy import copy
from functools import cache
from types import UnionType
from typing import Annotated, Any, Literal, Self, TypeVar, Union, cast, get_args, get_origin

from pydantic import ModelWrapValidatorHandler, ValidationInfo, create_model, model_validator
from pydantic.fields import FieldInfo

from detent.files.fields import OwnTables, Table, Unit, extra_of, is_named, keys_of, optional, table_of
from detent.units import describe_kind, format_quantity

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


class MovingTable(Table, frozen=True):
    """A motor among several, which slides or turns what it moves whatever the others do."""

    motion: Literal["linear", "rotary"] = optional("whether the motor slides or turns what it moves", "linear")

    @model_validator(mode="wrap")
    @classmethod
    def _by_motion(cls, value: Any, handler: ModelWrapValidatorHandler[Self], info: ValidationInfo) -> Self:
        """Read a table that says that its motor turns by the model of those."""
        turns = isinstance(value, dict) and cast("dict[str, Any]", value).get("motion") == "rotary"
        model = rotary_model(cls) if turns else cls
        return handler(value) if model is cls else model.model_validate(value, context=info.context)

    @property
    def turns(self) -> bool:
        """True for a motor that turns what it moves."""
        return self.motion == "rotary"

    def unit(self, linear: str) -> str:
        """Unit of a quantity of this motor, by that of a motor that slides: "rad" for "m" if it turns."""
        return unit_in(self.motion, linear)

    def text(self, value: float, linear: str, digits: int = 4) -> str:
        """Write a quantity of this motor for people, by the unit of a motor that slides."""
        return format_quantity(value, self.unit(linear), digits)


@cache
def motors_model(model: type[TableT], turning: frozenset[str]) -> type[TableT]:
    """The same file, in which the motors of these names turn."""
    fields: dict[str, Any] = {}
    for name, field in keys_of(model).items():
        table = table_of(field)
        if table is not None and is_named(field) and issubclass(table, MovingTable):
            made = copy(field)
            # The annotation brings the models, and pydantic joins both.
            made.annotation = None
            own = OwnTables(tuple((motor, rotary_model(table)) for motor in sorted(turning)))
            fields[name] = (Annotated[field.annotation, own], made)
    return _remade(model, "Mixed", fields) if turning and fields else model


@cache
def rotary_model(model: type[TableT]) -> type[TableT]:
    """The same table for an axis that turns."""
    own = model.__dict__.get("turned")
    if own is not None:
        return cast("type[TableT]", rotary_model(own))
    changed = {name: _rotary_field(field) for name, field in model.model_fields.items()}
    fields = {name: field for name, field in changed.items() if field is not None}
    return _remade(model, "Rotary", fields) if fields else model


def _remade(model: type[TableT], word: str, fields: dict[str, Any]) -> type[TableT]:
    """A model with some of its fields declared anew."""
    make: Any = create_model
    made = make(f"{word}{model.__name__}", __base__=model, __module__=model.__module__, __doc__=model.__doc__, **fields)
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
    elif get_origin(annotation) in {list, dict}:
        inner = tuple(_exchanged(one) for one in held)
        made = get_origin(annotation)[inner] if inner != held else annotation
    elif get_origin(annotation) in {Union, UnionType}:
        inner = tuple(_exchanged(one) for one in held)
        made = Union[inner] if inner != held else annotation  # noqa: UP007 - the members are only known here
    return made


def _is_table(annotation: object) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, Table)


def _rotary_unit(entry: object) -> object:
    """An annotation with the unit of a rotary axis."""
    return Unit(ROTARY_UNITS.get(entry.symbol, entry.symbol)) if isinstance(entry, Unit) else entry
