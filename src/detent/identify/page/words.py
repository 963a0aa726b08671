"""How the report of an identification writes and draws constants, units, places and efforts."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup

from detent.identify.fit.estimate import Estimate
from detent.page.chart import Curve
from detent.page.parts import Numbers
from detent.page.units import Scale, Units
from detent.page.words import GAP, number

UNKNOWN = 10.0  # half of an interval over the value from which on nothing is known about a constant
UNKNOWN_DELAY = 0.1  # the same of a delay [s], which may be 0
LONGEST = 220  # longest bar of a table [px]

_CONSTANTS = {
    "mass": ("inertia", "effort per acceleration"),
    "coulomb": ("Coulomb friction", "at any speed; constant forces are part of it"),
    "viscous": ("viscous friction", "grows with speed"),
    "static": ("static friction", "just before standstill"),
    "stribeck": ("Stribeck velocity", "below it friction rises to static friction"),
    "pendulum": ("weight", "times the sine of the angle"),
    "pendulum.across": ("weight, across", "times the cosine of the angle"),
    "spring": ("spring", "effort per distance from position 0"),
    "loss": ("share lost in the transmission", ""),
    "delay": ("delay of the effort", "how much later it acts than it was recorded"),
}
"""Names of constants, and what they mean."""

_WAYS = {"positive": "in positive direction", "negative": "in negative direction"}
SINCE = "time since the recording began"
_SMALL_EFFORTS = {"N": "mN", "N*m": "mN*m", "A": "mA", "V": "mV"}


def constant_name(name: str, unit: str = "") -> str:
    """Name of a constant for people.

    >>> constant_name("viscous.positive"), constant_name("mass", "kg*m^2")
    ('viscous friction in positive direction', 'moment of inertia')
    """
    if name == "mass" and unit in {"kg", "kg*m^2"}:
        return "mass" if unit == "kg" else "moment of inertia"
    if name in _CONSTANTS:
        return _CONSTANTS[name][0]
    kind, _, way = name.partition(".")
    return f"{_CONSTANTS[kind][0] if kind in _CONSTANTS else kind} {_WAYS.get(way, way)}".strip()


def meaning_of(name: str) -> str:
    """What a constant says, in a few words; empty where its name does."""
    return (_CONSTANTS.get(name) or _CONSTANTS.get(name.partition(".")[0], ("", "")))[1]


def sentence(text: str) -> str:
    """Begin a text with a capital letter."""
    return text[:1].upper() + text[1:]


def unit_text(unit: str) -> str:
    """Write a unit as it is printed.

    >>> unit_text("N*s/m").replace(GAP, " "), unit_text("kg*m^2").replace(GAP, " "), unit_text("1")
    ('N s/m', 'kg m²', '')
    """
    return "" if unit == "1" else unit.replace("^2", "²").replace("*", GAP)


@dataclass(frozen=True, slots=True)
class Written:
    """A number with its limits, written out."""

    value: str  # with as many digits as its limits leave
    half: str  # half of the interval, in two digits
    unit: str  # as it is printed

    def __str__(self) -> str:
        """Give value, limits and unit."""
        return f"{self.value} ± {self.half}{GAP + self.unit if self.unit else ''}"


def written(found: Estimate) -> Written:
    """Write an estimate so that its last digit is the second of its uncertainty; a delay in ms."""
    factor, unit = (1e3, "ms") if found.unit == "s" else (1.0, unit_text(found.unit))
    value, half = found.value * factor, found.half * factor
    if not 0.0 < half < math.inf:
        return Written(number(value), "0", unit)
    size = max(abs(value), half)
    # The power of ten that is set apart: none for a number that reads well without.
    power = 0 if 1e-3 <= size < 1e6 else 3 * math.floor(math.log10(size) / 3)
    scaled, reach = value / 10.0**power, half / 10.0**power
    places = min(max(0, 1 - math.floor(math.log10(reach))), 9)
    text = f"{scaled:.{places}f}".replace("-", "\u2212")
    raised = str(power).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    times = f"{GAP}·{GAP}10{raised}" if power else ""
    return Written(text + times, f"{reach:.{places}f}{times}", unit)


def relative_half(found: Estimate) -> float:
    """Half of the 95 % interval over the value; infinite for a value of 0."""
    return found.half / abs(found.value) if found.value else math.inf


def is_known(found: Estimate) -> bool:
    """False where the interval says nothing: a log without what this constant needs."""
    return found.half < UNKNOWN_DELAY if found.unit == "s" else relative_half(found) < UNKNOWN


def long_bar(share: float, text: str, *, chosen: bool) -> Markup:
    """A bar, of at most `LONGEST`, with its figure."""
    width = max(round(LONGEST * min(max(0.0, share), 1.0)), 1)
    colour = "good" if chosen else "muted"
    return Markup(
        '<span class="bar" style="width:{}px;background:var(--{})"></span><span class="nowrap">{}</span>'
    ).format(width, colour, text)


class Ways:
    """How positions of a log are written: in the units of an axis, or in a unit of the log that is not m or rad."""

    def __init__(self, unit: str) -> None:
        self._units = Units(rotary=unit == "rad") if unit in {"m", "rad"} else None
        own = unit_text(unit)
        self.place = self._units.place if self._units else Scale(1.0, own)
        self.speed = self._units.speed if self._units else Scale(1.0, f"{own}/s")

    def small(self, peak: float) -> Scale:
        """Of errors, by the largest of them."""
        return self._units.small(peak) if self._units else self.place

    def spread(self, half: float) -> str:
        """Write half of the interval that the limits of the constants leave a simulation; nan where they leave all."""
        return f"±{GAP}{self.error(half)}" if math.isfinite(half) else "not known"

    def error(self, value: float) -> str:
        """Write an error with its unit."""
        return self._units.error(value) if self._units else f"{number(value)}{GAP}{self.place.name}"


def effort_scale(unit: str, peak: float) -> Scale:
    """Unit in which efforts are drawn, by the largest of them.

    >>> effort_scale("N*m", 0.02).factor, effort_scale("N", 80.0).factor
    (1000.0, 1.0)
    """
    if peak < 0.1 and unit in _SMALL_EFFORTS:
        return Scale(1e3, unit_text(_SMALL_EFFORTS[unit]))
    return Scale(1.0, unit_text(unit))


def digits_for(peak: float) -> int:
    """Digits after the point that a chart keeps of numbers up to a peak: four significant ones of the largest.

    >>> digits_for(150.0), digits_for(0.02)
    (2, 6)
    """
    return 3 if not (math.isfinite(peak) and peak > 0.0) else min(max(0, 4 - math.floor(math.log10(peak))), 12)


def label_of(words: str, unit: str) -> str:
    """Label of an axis: words, and the unit in brackets if there is one."""
    return f"{words} [{unit}]" if unit else words


def peak_of(values: Numbers) -> float:
    """The largest magnitude; 0 of nothing."""
    return float(np.nanmax(np.abs(values), initial=0.0))


def scaled(label: str, colour: str, values: Numbers, scale: Scale, **look: Any) -> Curve:
    """A curve in its unit, with as many digits as it needs, and with the look of a `Curve`."""
    y = values * scale.factor
    return Curve(label=label, colour=colour, y=y, digits=digits_for(peak_of(y)), **look)
