"""Single precision: a number whose every operation is rounded to binary32, in plain Python and compiled.

A register `f4` reads as a `Single`. Beside another, or beside a whole number, it gives a `Single`; beside a float the
result is a float, of double precision. A step for both writes its constants as whole numbers, ``2 * x``, which take on
what they stand beside, and converts with `alike`.

Each operation is done in binary64 and rounded once more, which gives the bits of one rounding: for + - * / and the
square root that holds where the wider format has 2 q + 2 bits or more of a narrower one with q: 53 >= 2 * 24 + 2.

Figueroa: When is double rounding innocuous? SIGNUM Newsletter 30 (1995), 21-26.
"""

import ctypes
import math
import operator
from collections.abc import Callable
from typing import Any, Self, TypeVar

T = TypeVar("T")
EXACT = 53  # bits of a whole number that a float holds


class Single(float):
    """A number of IEEE binary32.

    >>> Single(0.1) + Single(0.2), Single(0.1) + 0.2
    (0.30000001192092896, 0.30000000149011613)
    """

    __slots__ = ()

    def __new__(cls, value: float = 0.0) -> Self:
        """The nearest; of a whole number of any length rounded once, too."""
        if isinstance(value, int) and value.bit_length() > EXACT:
            value = _sticky(value)
        return float.__new__(cls, ctypes.c_float(value).value)

    def __abs__(self) -> "Single":
        return Single(abs(float(self)))

    def __neg__(self) -> "Single":
        return Single(-float(self))

    __hash__ = float.__hash__


def _sticky(value: int) -> int:
    """A long whole number in 53 bits, of which the last says that one behind it was set: it rounds as it did."""
    size = abs(value)
    drop = size.bit_length() - EXACT
    size = (size >> drop | (1 if size & (1 << drop) - 1 else 0)) << drop
    return -size if value < 0 else size


def _operates(of: Callable[[float, float], Any], *, turned: bool = False) -> Callable[[Single, Any], Any]:
    """An operator of a `Single`: in its precision beside one or a whole number, else in that of a float."""

    def operate(self: Single, other: Any) -> Any:
        """The result."""
        if not isinstance(other, int | float):
            return NotImplemented
        beside = Single(other) if isinstance(other, int) else other
        made = of(float(beside), float(self)) if turned else of(float(self), float(beside))
        return Single(made) if isinstance(beside, Single) and isinstance(made, float) else made

    return operate


for _name in ("add", "sub", "mul", "truediv"):
    setattr(Single, f"__{_name}__", _operates(getattr(operator, _name)))
    setattr(Single, f"__r{_name}__", _operates(getattr(operator, _name), turned=True))
for _name in ("lt", "le", "gt", "ge", "eq", "ne"):
    setattr(Single, f"__{_name}__", _operates(getattr(operator, _name)))


def alike(model: T, value: float) -> T:
    """A number in the precision of another one: a `Single` beside a `Single`, else a float."""
    made: Any = Single(value) if isinstance(model, Single) else float(value)
    return made


def sqrt(value: T) -> T:
    """Square root, in the precision of its argument."""
    number: Any = value
    return alike(value, math.sqrt(number))
