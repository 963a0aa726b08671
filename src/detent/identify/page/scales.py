"""Units in which the report of an identification draws places and efforts, and curves in them."""

import math
from dataclasses import dataclass

import numpy as np

from detent.identify.page.words import unit_text
from detent.methods.cascade.units import Scale, Units
from detent.page.chart import POINTS, Curve
from detent.page.parts import Numbers
from detent.page.words import GAP, number

SINCE = "time since the recording began"

_SMALL_EFFORTS = {"N": "mN", "N*m": "mN*m", "A": "mA", "V": "mV"}


@dataclass(frozen=True, slots=True)
class Ways:
    """How positions of a log are written."""

    unit: str  # of the log's positions: "m", "rad", or anything else as it is

    @property
    def _units(self) -> Units | None:
        return Units(rotary=self.unit == "rad") if self.unit in {"m", "rad"} else None

    @property
    def place(self) -> Scale:
        """Of positions."""
        return self._units.place if self._units else Scale(1.0, unit_text(self.unit))

    @property
    def speed(self) -> Scale:
        """Of velocities."""
        return self._units.speed if self._units else Scale(1.0, f"{unit_text(self.unit)}/s")

    def small(self, peak: float) -> Scale:
        """Of errors, by the largest of them."""
        return self._units.small(peak) if self._units else self.place

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


def scaled(  # noqa: PLR0913 - what a curve consists of
    label: str,
    colour: str,
    values: Numbers,
    scale: Scale,
    *,
    width: float | None = None,
    dash: tuple[int, int] | None = None,
    thin: int = POINTS,
) -> Curve:
    """A curve in its unit, with as many digits as it needs."""
    y = values * scale.factor
    return Curve(label=label, colour=colour, y=y, digits=digits_for(peak_of(y)), width=width, dash=dash, thin=thin)
