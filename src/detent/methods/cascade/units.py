"""How the pages of a cascade axis write its quantities."""

from detent.methods.cascade.schema import CascadeSpec
from detent.page.units import Units
from detent.page.words import GAP, number


def units_of(spec: CascadeSpec) -> Units:
    """Units of an axis."""
    return Units(rotary=spec.axis.motion == "rotary")


def milliseconds(seconds: float) -> str:
    """Write a time in milliseconds; what is round but for the last bits comes out round."""
    return f"{number(round(seconds * 1e3, 6))}{GAP}ms"
