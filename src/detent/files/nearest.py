"""The value that would do in place of a refused one, as a message names it: ready to be copied into the file."""

import math
from decimal import ROUND_CEILING, ROUND_FLOOR, ROUND_HALF_EVEN, Decimal

from detent.files.fields import BOUNDS, Table, bounds_of, unit_of
from detent.files.problems import field_at
from detent.units import IN_DEGREES, format_quantity, in_degrees, parse_quantity

BARELY = 1e-9  # relative distance that a value keeps from a bound it must not touch
UNITS = "check the units of what it depends on"  # remedy where a key has no value that would do


def at_most(value: float, unit: str, digits: int = 4) -> str:
    """Write the largest short number that is not above a bound, in quotes as in the file.

    >>> at_most(0.407166, "m/s")
    '"407.1 mm/s"'
    """
    return _written(value, unit, digits, ROUND_FLOOR)


def at_least(value: float, unit: str, digits: int = 4) -> str:
    """Write the smallest short number that is not below a bound.

    >>> at_least(0.407166, "m/s")
    '"407.2 mm/s"'
    """
    return _written(value, unit, digits, ROUND_CEILING)


def _written(value: float, unit: str, digits: int, rounding: str) -> str:
    if unit in IN_DEGREES:
        shown, name = in_degrees(value, unit)  # what is rounded is the number that is written
        shown = float(f"{shown:.13g}")  # a round figure in degrees comes back from radians off by the last bit
        return f'"{_rounded(shown, digits, rounding):.{digits}g} {name}"'
    return f'"{format_quantity(_rounded(value, digits, rounding), unit, digits)}"'


def _rounded(value: float, digits: int, rounding: str) -> float:
    # The shortest text of a float reads back as the same float, so that rounding it keeps to the bound.
    shortest = Decimal(repr(value))
    return float(shortest.quantize(Decimal(1).scaleb(shortest.adjusted() - digits + 1), rounding))


def put(key: str, text: object) -> str:
    """One remedy: the key with the value that would do."""
    return f"set {key} = {text}"


class Remedies:
    """Values that would do, for the keys of a model: each within the key's own bounds, or else what is said instead."""

    def __init__(self, model: type[Table]) -> None:
        self._model = model

    def most(self, key: str, bound: float, otherwise: str = UNITS, digits: int = 4) -> str:
        """Set a key to the largest short value that is not above a bound."""
        return self._set(key, bound, otherwise, digits, ROUND_FLOOR)

    def least(self, key: str, bound: float, otherwise: str = UNITS, digits: int = 4) -> str:
        """Set a key to the smallest short value that is not below a bound."""
        return self._set(key, bound, otherwise, digits, ROUND_CEILING)

    def exactly(self, key: str, value: float, otherwise: str = UNITS) -> str:
        """Set a key to a value, to twelve digits."""
        return self._set(key, value, otherwise, 12, ROUND_HALF_EVEN)

    def _set(self, key: str, value: float, otherwise: str, digits: int, rounding: str) -> str:
        if not math.isfinite(value):
            return otherwise
        field = field_at(self._model, tuple(key.split(".")))
        unit = unit_of(field)
        if unit:
            written = _written(value, unit, digits, rounding)
            value = parse_quantity(written.strip('"'), unit)
        elif field.annotation is int:
            value = int(Decimal(repr(value)).to_integral_value(rounding))
            written = str(value)
        else:
            value = _rounded(value, digits, rounding)
            written = f"{value:.{digits}g}"
        keeps = all(BOUNDS[kind][1](value, bound) for kind, bound in bounds_of(field))
        return put(key, written) if keeps else otherwise
