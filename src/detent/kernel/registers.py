"""Register files: typed fields of exact width, declared once.

A class of registers is a `ctypes.Structure`, so an instance is one flat piece of memory in the layout of the C
compiler. Plain Python reads full integers from it and every store wraps to the width of the field; compiled steps work
on the same memory with the same rule (`kernel.compiled`). The trace columns and the reference tables derive from the
one declaration, and numpy takes the class for a dtype.
"""

import ctypes
import dataclasses
import inspect
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any, Self, TypeVar, get_args

from detent.kernel.single import Single

if TYPE_CHECKING:
    # The metaclass of ctypes.Structure has no public name.
    from _ctypes import _PyCStructType as type_of_structure  # pyright: ignore[reportPrivateUsage, reportAttributeAccessIssue, reportUnknownVariableType]
else:
    type_of_structure = type(ctypes.Structure)


@dataclass(frozen=True)
class Width:
    """Storage of one field: its short name, its ctypes type and its C name."""

    code: str
    ctype: Any
    c_name: str

    @property
    def size(self) -> int:
        """Bytes."""
        return int(self.code[1:])

    @property
    def is_float(self) -> bool:
        """True for a float, False for an integer."""
        return self.code[0] == "f"

    @property
    def is_signed(self) -> bool:
        """True unless the field is an unsigned integer."""
        return self.code[0] != "u"


u1 = Annotated[int, Width("u1", ctypes.c_uint8, "uint8_t")]
u2 = Annotated[int, Width("u2", ctypes.c_uint16, "uint16_t")]
u4 = Annotated[int, Width("u4", ctypes.c_uint32, "uint32_t")]
i1 = Annotated[int, Width("i1", ctypes.c_int8, "int8_t")]
i2 = Annotated[int, Width("i2", ctypes.c_int16, "int16_t")]
i4 = Annotated[int, Width("i4", ctypes.c_int32, "int32_t")]
i8 = Annotated[int, Width("i8", ctypes.c_int64, "int64_t")]
f4 = Annotated[float, Width("f4", ctypes.c_float, "float")]
f8 = Annotated[float, Width("f8", ctypes.c_double, "double")]
FOLLOWS = "in the arithmetic of the axis"
real = Annotated[float, Width("f8", ctypes.c_double, "double"), FOLLOWS]
"""`f8`, and `f4` in the registers of an axis whose arithmetic is single (`single`)."""
u1_array = Annotated[list[int], Width("u1", ctypes.c_uint8, "uint8_t")]
i2_array = Annotated[list[int], Width("i2", ctypes.c_int16, "int16_t")]
i4_array = Annotated[list[int], Width("i4", ctypes.c_int32, "int32_t")]
i8_array = Annotated[list[int], Width("i8", ctypes.c_int64, "int64_t")]
f8_array = Annotated[list[float], Width("f8", ctypes.c_double, "double")]


@dataclass(frozen=True)
class Field:
    """One declared field of a register file; name, place and type are known when the structure is laid out."""

    doc: str
    unit: str = ""
    length: int = 0  # number of elements of an array; 0 for a single value
    by: str = ""  # who writes a wire between controller and plant; empty elsewhere
    range: tuple[float, float] | None = None  # least and largest value that is ever stored, where one is claimed
    option: bool = False  # of parameters: it chooses a variant, and is a constant of the firmware
    table: bool = False  # of arrays of parameters: numbers that firmware keeps among its constants
    follows: bool = False  # declared `real`
    name: str = ""
    offset: int = 0  # bytes from the start of the structure
    width: Width | None = None  # None for a nested block
    block: "type[Registers] | None" = None  # its class


@dataclass(frozen=True)
class Leaf:
    """One stored quantity reached through nested blocks, such as ``motor.current``."""

    path: str
    doc: str
    unit: str
    offset: int
    width: Width
    length: int
    by: str = ""
    range: tuple[float, float] | None = None


@dataclass(frozen=True)
class Fit:
    """How much of their arrays some registers use, and what those that reach into them hold then; by class and name."""

    lengths: "Mapping[tuple[type[Registers], str], int]" = dataclasses.field(default_factory=dict[Any, Any])
    ranges: "Mapping[tuple[type[Registers], str], tuple[float, float]]" = dataclasses.field(
        default_factory=dict[Any, Any]
    )
    values: "Mapping[tuple[type[Registers], str], int]" = dataclasses.field(default_factory=dict[Any, Any])
    """Parameters that say how much it is."""


# Who writes a wire: sensor words and switches come from the plant, actuator words and enables from the controller.
PLANT, CONTROLLER = "plant", "controller"


def register(  # noqa: PLR0913 - all that can be said of one
    doc: str,
    *,
    unit: str = "",
    length: int = 0,
    by: str = "",
    range: tuple[float, float] | None = None,  # noqa: A002 - the word for it
    option: bool = False,
    table: bool = False,
) -> Any:
    """Declare a register; a wire says by whom it is written, `PLANT` or `CONTROLLER`.

    `range` claims something of every value ever stored, and changes neither width nor layout; with
    ``DETENT_CHECK_RANGES=1`` plain steps raise on a store outside.
    """
    return Field(doc, unit, length, by, range, option, table)


def block(doc: str, *, by: str = "") -> Any:
    """Declare a nested register file; of wires, by whom all of it is written."""
    return Field(doc, by=by)


def _storage(name: str, hint: Any, length: int) -> tuple[Any, Width | None]:
    """Type of a field for ctypes; its width where it is no block."""
    if isinstance(hint, type) and issubclass(hint, Registers):
        return hint, None
    widths = [part for part in get_args(hint)[1:] if isinstance(part, Width)]
    if len(widths) != 1:
        raise TypeError(
            f"register {name!r}: got {hint!r}; expected: a width such as i8 or f8, or a Registers class; declare one"
        )
    ctype = widths[0].ctype
    return ctype * length if length else ctype, widths[0]


class _SingleField:
    """A register of single precision: what is read is a `Single`, what is written is rounded."""

    def __init__(self, stored: Any) -> None:
        self._stored, self.offset, self.size = stored, stored.offset, stored.size

    def __get__(self, registers: Any, kind: Any = None) -> Any:
        """What it holds."""
        return self if registers is None else Single(self._stored.__get__(registers, kind))

    def __set__(self, registers: Any, value: float) -> None:
        """Store."""
        self._stored.__set__(registers, Single(value))


class _RegistersMeta(type_of_structure):  # pyright: ignore[reportGeneralTypeIssues] - see above
    """Lays the structure out from the annotations of the class body."""

    def __init__(self, name: str, bases: tuple[type, ...], namespace: dict[str, Any], **kwargs: Any) -> None:
        super().__init__(name, bases, namespace, **kwargs)
        declared = {key: value for key, value in namespace.items() if isinstance(value, Field)}
        if not declared:
            return
        hints = inspect.get_annotations(self, eval_str=True)
        stored = {key: _storage(key, hints[key], field.length) for key, field in declared.items()}
        structure: Any = self
        structure._fields_ = [(key, ctype) for key, (ctype, _) in stored.items()]
        structure.__fields__ = {
            key: replace(
                declared[key],
                name=key,
                offset=int(getattr(structure, key).offset),
                width=width,
                block=None if width else ctype,
                follows=FOLLOWS in get_args(hints[key])[1:],
            )
            for key, (ctype, width) in stored.items()
        }
        for key, (_, width) in stored.items():
            if width is not None and width.code == "f4":
                if declared[key].length:
                    raise TypeError(f"register {key!r}: got an array of f4; expected: one value; declare f8_array")
                setattr(structure, key, _SingleField(vars(structure)[key]))
        if os.environ.get("DETENT_CHECK_RANGES") == "1":
            structure.__setattr__ = _set_checked


def _set_checked(registers: "Registers", name: str, value: Any) -> None:
    """Store, unless what then stands there is outside the range that the declaration claims."""
    field = registers.__fields__.get(name)
    ctypes.Structure.__setattr__(registers, name, value)
    if field is not None and field.range is not None and not field.length:
        lowest, highest = field.range
        stored = getattr(registers, name)
        if not lowest <= stored <= highest:
            raise ValueError(
                f"register {type(registers).__name__}.{name}: got {stored!r}; expected: {lowest!r} to {highest!r}, as "
                "it is declared; correct the step, or the range of the declaration"
            )


class Registers(ctypes.Structure, metaclass=_RegistersMeta):
    """Base of every register file; an instance starts with all bits zero.

    >>> class Counter(Registers):
    ...     count: u1 = register("pulses", unit="count")
    >>> counter = Counter()
    >>> counter.count = 257
    >>> counter.count
    1
    """

    __fields__: "dict[str, Field]" = {}  # noqa: RUF012 - replaced per class by the metaclass
    __declared__: "type[Registers] | None" = None  # of one that `single` made: the class of the declaration

    @classmethod
    def leaves(cls, prefix: str = "", offset: int = 0, by: str = "") -> Iterator[Leaf]:
        """Every stored quantity with its dotted path, in order of memory."""
        for field in cls.__fields__.values():
            path, place, writer = prefix + field.name, offset + field.offset, field.by or by
            if field.block is not None:
                yield from field.block.leaves(path + ".", place, writer)
            elif field.width is not None:
                yield Leaf(path, field.doc, field.unit, place, field.width, field.length, writer, field.range)

    def snapshot(self) -> bytes:
        """Copy of the whole state."""
        return bytes(self)

    def restore(self, state: bytes) -> None:
        """Put a snapshot back."""
        size = ctypes.sizeof(self)
        if len(state) != size:
            raise ValueError(
                f"snapshot of {type(self).__name__}: got {len(state)} bytes; expected: {size}; "
                "take the snapshot with this version of the declaration"
            )
        ctypes.memmove(ctypes.addressof(self), state, size)

    def copy(self) -> Self:
        """Independent copy."""
        return type(self).from_buffer_copy(self)


R = TypeVar("R", bound=Registers)
_SINGLES: dict[type[Registers], type[Registers]] = {}


def single(registers: type[R]) -> type[R]:
    """The same registers for an axis whose arithmetic is single: those declared `real` are f4, in blocks too.

    Where nothing is declared so, the class itself. Steps are the same: what they compute follows what they read.
    """
    if registers not in _SINGLES:
        _SINGLES[registers] = _made_single(registers)
    made: Any = _SINGLES[registers]
    return made


def _made_single(registers: type[Registers]) -> type[Registers]:
    fields = vars(registers).get("__fields__", {})
    bases: list[Any] = list(registers.__bases__)
    bases = [single(one) if issubclass(one, Registers) and one is not Registers else one for one in bases]
    blocks = {field.block: single(field.block) for field in fields.values() if field.block is not None}
    same = bases == list(registers.__bases__) and all(one is made for one, made in blocks.items())
    if same and not any(field.follows for field in fields.values()):
        return registers
    own = {key: value for key, value in vars(registers).items() if key not in _OF_A_CLASS}
    hints = inspect.get_annotations(registers, eval_str=True)
    hints |= {name: f4 for name, field in fields.items() if field.follows}
    hints |= {name: blocks[field.block] for name, field in fields.items() if field.block is not None}
    made = {name: _in_single(field) if field.follows else field for name, field in fields.items()}
    own |= {"__annotations__": hints, "__declared__": registers, "__qualname__": f"Single{registers.__qualname__}"}
    metaclass: Any = type(Registers)
    return metaclass(f"Single{registers.__name__}", tuple(bases), own | made)


def _in_single(field: Field) -> Field:
    """A declaration whose range ends at singles."""
    ends = None if field.range is None else tuple(float(Single(end)) for end in field.range)
    return replace(field, range=ends)  # pyright: ignore[reportArgumentType] - two


_OF_A_CLASS = frozenset(("_fields_", "__fields__", "__dict__", "__weakref__", "__setattr__"))


def declared_of(registers: Any) -> type[Registers]:
    """The class of the declaration, of one that `single` made too."""
    return registers.__declared__ or registers
