"""What is known of an expression: its text in C, its type, the interval of an integer."""

import ast
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from detent.errors import DetentError
from detent.kernel.registers import Field, Registers, Width
from detent.kernel.single import Single

INTEGERS = {
    "u1": "uint8_t", "u2": "uint16_t", "u4": "uint32_t", "i1": "int8_t", "i2": "int16_t", "i4": "int32_t",
    "i8": "int64_t",
}  # fmt: skip
RANK = {
    "bool": 8,
    "uint8_t": 8,
    "int8_t": 8,
    "int16_t": 15,
    "int": 16,
    "uint16_t": 17,
    "unsigned": 17,
    "int32_t": 32,
    "uint32_t": 33,
    "int64_t": 64,
}
TYPES = {16: "int", 32: "int32_t", 64: "int64_t"}
"""What C computes in: `int` has 16 bits on some processors, and what fits in those is never wider there."""
LOWEST, HIGHEST = -(1 << 63), (1 << 63) - 1  # of 64 bits
_CALL = re.compile(r"\w\(")
UNSIGNED = frozenset({"uint8_t", "uint16_t", "unsigned", "uint32_t"})
UNSIGNED_NAME = "@u"
"""Behind the name of a number of a module where an operand without a sign is beside it."""
ATOM, UNARY, PRODUCT, SUM, ANY = 0, 1, 2, 3, 5  # how tightly a text holds together

C_WORDS = frozenset({
    "auto", "break", "case", "char", "const", "continue", "default", "do", "double", "else", "enum", "extern",
    "float", "for", "goto", "if", "inline", "int", "long", "register", "restrict", "return", "short", "signed",
    "sizeof", "static", "struct", "switch", "typedef", "union", "unsigned", "void", "volatile", "while", "bool",
    "true", "false", "NULL", "asm", "errno",
})  # fmt: skip
"""What no name in C may be: words of the language, and of the headers that are included."""


def c_field(name: str) -> str:
    """Name of a register in C: that of its declaration, with an underscore where it is a word of C.

    >>> c_field("switch"), c_field("count")
    ('switch_', 'count')
    """
    return f"{name}_" if name in C_WORDS else name


class RefusedError(DetentError):
    """A step cannot be firmware; tells the code of the refusal, the place, what came, and what to do."""

    exit_status = 1

    def __init__(self, code: str, node: ast.AST | None, got: str, expected: str, remedy: str) -> None:
        self.code, self.node, self.told = code, node, (got, expected, remedy)
        super().__init__(f"{code}: got {got}; expected: {expected}; try: {remedy}")

    def at(self, where: str) -> "RefusedError":
        """The same with its place."""
        made = RefusedError(self.code, self.node, *self.told)
        made.args = (f"{where}: {self}",)
        return made


def outside_language(node: ast.AST, got: str, remedy: str) -> RefusedError:
    """A statement or an expression that no step may hold."""
    return RefusedError("FW02", node, got, "the language of a step", remedy)


@dataclass(frozen=True, slots=True, kw_only=True)
class Value:
    """Value of an expression: its text in C and what is known of it."""

    kind: str  # int, float, bool, file (of registers), array (of registers), signal (of the host), none
    text: str = ""
    ctype: str = ""
    lo: int = 0  # interval of an integer
    hi: int = 0
    level: int = ATOM
    truth: bool | None = None  # of a bool that is decided already
    registers: type[Registers] | None = None  # class of a register file
    width: Width | None = None  # of the elements of an array or a signal
    length: int = 0  # of an array, and of a signal that is a table
    element: str = "{text}[{index}]"  # text of an element of an array or a signal
    within: tuple[float, float] | None = None  # range of its elements
    literal: bool = False  # a number, or the name of one
    given: float | None = None  # of a float: the number that it is
    of: "tuple[str, Value, Value] | None" = None  # operator and operands, whose lower bits alone make its lower bits

    @property
    def is_constant(self) -> bool:
        """True for an integer that can only be one number, and whose text does nothing else."""
        return self.kind == "int" and self.lo == self.hi and not self.acts

    @property
    def is_single(self) -> bool:
        """True for a float of single precision."""
        return self.kind == "float" and self.ctype == "float"

    @property
    def is_composite(self) -> bool:
        """True for an operator between two operands: no cast may make it wider, or of another sign (MISRA C 10.8)."""
        return self.level > UNARY

    @property
    def acts(self) -> bool:
        """True for a text with a call in it: it must stay, even where its value is known."""
        return not self.literal and _CALL.search(self.text) is not None


def whole(text: str, ctype: str, lo: int, hi: int, level: int = ATOM) -> Value:
    """An integer."""
    return Value(kind="int", text=text, ctype=ctype, lo=lo, hi=hi, level=level)


def real(text: str, level: int = ATOM, ctype: str = "double") -> Value:
    """A float, of 64 bits unless told otherwise."""
    return Value(kind="float", text=text, ctype=ctype, level=level)


def wider(one: str, other: str) -> str:
    """The type that holds floats of both; "" is one of which nothing is known yet."""
    return "double" if "double" in (one, other) else one or other


def as_single_number(value: float) -> Value:
    """The nearest constant of single precision."""
    rounded = float(Single(value))
    if math.isinf(rounded):
        return replace(real(f"{'-' if rounded < 0 else ''}INFINITY", UNARY, "float"), given=rounded)
    return replace(real(f"{rounded!r}f" if rounded >= 0 else f"({rounded!r}f)", ctype="float"), given=rounded)


def truth(text: str, level: int = ANY, decided: bool | None = None) -> Value:  # noqa: FBT001 - a truth value
    """A condition."""
    return Value(kind="bool", text=text, ctype="bool", level=level, truth=decided)


def decided(value: bool) -> Value:  # noqa: FBT001 - a truth value
    """A condition that is known."""
    return truth("true" if value else "false", ATOM, value)


def interval_of(width: Width) -> tuple[int, int]:
    """Least and largest number of a width."""
    bits = 8 * width.size
    return (-(1 << bits - 1), (1 << bits - 1) - 1) if width.is_signed else (0, (1 << bits) - 1)


def bits_of(*numbers: int) -> int:
    """Bits in which all these numbers fit, with a sign: 16, 32, 64, or 128 for more."""
    for bits in (16, 32, 64):
        if all(-(1 << bits - 1) <= one < 1 << bits - 1 for one in numbers):
            return bits
    return 128


def in_brackets(value: Value, level: int) -> str:
    """Its text, in brackets where it does not hold together as tightly."""
    return f"({value.text})" if value.level > level else value.text


def number(value: float) -> Value:
    """A constant."""
    if isinstance(value, Single):
        return as_single_number(value)
    if isinstance(value, bool):
        return decided(value)
    if isinstance(value, int):
        if bits_of(value) == 128:
            raise RefusedError("FW02", None, f"the number {value}", "a number of 64 bits", "use a smaller one")
        if value == LOWEST:
            return whole("((-INT64_MAX) - 1)", "int64_t", value, value)
        wide = bits_of(value) > 32 or value == -(1 << 31)
        text = f"INT64_C({abs(value)})" if wide else str(abs(value))
        text = f"(-{text})" if value < 0 else text
        return replace(whole(text, TYPES[bits_of(value)], value, value), literal=True)
    if value != value:  # noqa: PLR0124 - not a number
        raise RefusedError("FW02", None, "a constant that is no number", "a number", "write another one")
    if value in (float("inf"), -float("inf")):
        return replace(real(f"{'-' if value < 0 else ''}(double)INFINITY", UNARY), given=value)
    return replace(real(repr(value) if value >= 0 else f"({value!r})"), given=value)


def as_whole(value: Value) -> Value:
    """A truth value as 0 or 1."""
    if value.kind != "bool":
        return value
    if value.truth is not None:
        return number(int(value.truth))
    return whole(f"{in_brackets(value, UNARY)} ? (int)1 : 0", "int", 0, 1, ANY + 1)


def as_truth(value: Value) -> Value:
    """A number as a condition."""
    if value.kind == "bool":
        return value
    if value.kind == "int":
        if value.is_constant or not (value.acts or value.lo <= 0 <= value.hi):
            return decided(value.lo != 0)
        return truth(f"{in_brackets(value, UNARY)} != {'0U' if value.ctype in UNSIGNED else '0'}")
    if value.kind == "float":
        return truth(f"{in_brackets(value, UNARY)} != {'0.0f' if value.is_single else '0.0'}")
    raise outside_language(ast.Pass(), f"a condition of kind {value.kind}", "compare numbers")


def unsigned(value: Value) -> Value:
    """A number that is not negative, as a constant without a sign; of a name `Program` says what is made of it."""
    if value.text.startswith("INT64_C("):
        return replace(value, text=f"U{value.text}", ctype="uint64_t")
    return replace(value, text=f"{value.text}{'U' if value.text.isdigit() else UNSIGNED_NAME}", ctype="unsigned")


def join(one: Value | None, other: Value) -> Value:
    """What holds of either."""
    if one is None:
        return other
    if {one.kind, other.kind} == {"int"}:
        return replace(one, lo=min(one.lo, other.lo), hi=max(one.hi, other.hi))
    if {one.kind, other.kind} == {"int", "float"}:
        return one if one.kind == "float" else other
    if one.kind == other.kind == "float":
        return replace(one, ctype=wider(one.ctype, other.ctype))
    if {one.kind, other.kind} == {"int", "bool"}:
        i = one if one.kind == "int" else other
        return replace(i, lo=min(i.lo, 0), hi=max(i.hi, 1))
    if one.kind != other.kind or one.registers is not other.registers:
        raise outside_language(ast.Pass(), f"a name for {one.kind} and for {other.kind}", "use two names")
    return one


def widen(old: Value | None, new: Value) -> Value:
    """Jump to the interval of the next width, so that loops come to an end."""
    if old is None or old.kind != "int" or new.kind != "int" or (old.lo <= new.lo and new.hi <= old.hi):
        return new
    for bits in (8, 16, 32):
        lo, hi = -(1 << bits - 1), (1 << bits - 1) - 1
        if lo <= new.lo and new.hi <= hi:
            return replace(new, lo=lo if new.lo < old.lo else new.lo, hi=hi if new.hi > old.hi else new.hi)
    return replace(new, lo=LOWEST if new.lo < old.lo else new.lo, hi=HIGHEST if new.hi > old.hi else new.hi)


def type_of_local(value: Value) -> str:
    """C type of a variable that holds it."""
    if value.kind == "int":
        return TYPES[min(bits_of(value.lo, value.hi), 64)]
    if value.kind in ("float", "bool"):
        return value.ctype
    raise outside_language(ast.Pass(), f"a variable of kind {value.kind}", "use the registers themselves")


@dataclass(frozen=True)
class Table:
    """Numbers that do not change: they stand outside of the registers, where a processor keeps constants."""

    name: str
    width: Width
    length: int
    within: tuple[int, int]  # the least and the largest
    element: str = "{text}[{index}]"


@dataclass(frozen=True)
class Shape:
    """What of the registers and arguments is other in C than it is declared."""

    tables: Mapping[tuple[type[Registers], str], Table] = field(default_factory=dict[Any, Table])
    """Arrays of parameters that are tables."""
    laid: Mapping[str, Table] = field(default_factory=dict[str, Table])
    """Signals that are tables, by the names of the arguments."""
    narrowed: Mapping[tuple[type[Registers], str], tuple[Width, tuple[int, int] | None]] = field(
        default_factory=dict[Any, Any]
    )
    """Registers that are as wide, and hold as much, as this axis needs."""
    lengths: Mapping[tuple[type[Registers], str], int] = field(default_factory=dict[Any, int])
    """Arrays that are as long as this axis needs."""
    names: Mapping[Callable[..., Any], str] = field(default_factory=dict[Any, str])
    """Names in C of steps that are not those of the steps."""
    constants: Mapping[str, str] = field(default_factory=dict[str, str])
    """Names in C of numbers of a module that are not those of the numbers."""
    storage: str = ""  # of every function, where it is not that of an entry
    checks: bool = True  # claims can be checked by a build with FIRMWARE_CHECK

    def seen(self, registers: type[Registers], declared: Field) -> Field:
        """The declaration of a register as it is in C."""
        place = registers, declared.name
        width, claimed = self.narrowed.get(place, (declared.width, declared.range))
        return replace(declared, width=width, range=claimed, length=self.lengths.get(place, declared.length))


@dataclass
class Notes:
    """What a translation found on its way; places are file, line and text."""

    claims: set[tuple[str, str]] = field(default_factory=set[tuple[str, str]])
    """Stores into a register with a range that only the declaration says they keep."""
    wraps: set[tuple[str, str]] = field(default_factory=set[tuple[str, str]])
    """Stores that may wrap, and sums and products that may go beyond 64 bits."""
    promotions: set[tuple[str, str]] = field(default_factory=set[tuple[str, str]])
    """Where a number of single precision meets one of double, and the result is one."""
    loops: set[tuple[str, str]] = field(default_factory=set[tuple[str, str]])
    """Loops with the bounds that are declared for them."""
    helpers: set[str] = field(default_factory=set[str])
    constants: dict[str, tuple[Any, str]] = field(default_factory=dict[str, tuple[Any, str]])
