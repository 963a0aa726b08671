"""How pages write the quantities of an axis: one that slides in mm and µm, one that turns in degrees."""

import math
from dataclasses import dataclass

from detent.page.words import ARCSEC, GAP, SMALL, angle, degrees, length, number

MICRO = 1e-3  # lengths below this are drawn in micrometres [m]


@dataclass(frozen=True, slots=True)
class Scale:
    """A unit of a plot area."""

    factor: float  # from SI units
    name: str  # of the unit


@dataclass(frozen=True, slots=True)
class Units:
    """Units of an axis."""

    rotary: bool  # it turns

    @property
    def place(self) -> Scale:
        """Of positions."""
        return Scale(180 / math.pi, "deg") if self.rotary else Scale(1e3, "mm")

    @property
    def speed(self) -> Scale:
        """Of velocities."""
        return Scale(180 / math.pi, "deg/s") if self.rotary else Scale(1e3, "mm/s")

    def small(self, peak: float) -> Scale:
        """Of errors, by the largest of them [m]."""
        if self.rotary:
            return Scale(1 / ARCSEC, "arcsec") if abs(peak) < SMALL else self.place
        return Scale(1e6, "µm") if abs(peak) < MICRO else self.place

    def error(self, value: float) -> str:
        """Write an error with its unit: 5.7 µm, 5.73 deg."""
        if math.isnan(value):
            return "\u2013"
        return angle(value) if self.rotary else length(value)

    def position(self, value: float) -> str:
        """Write a position, without its unit."""
        scaled = round(value * self.place.factor, 4)
        return f"{scaled:.3f}".replace("-", "\u2212")

    def speed_text(self, value: float) -> str:
        """Write a speed with its unit."""
        text = degrees(value) if self.rotary else number(round(value * 1e3, 6))
        return f"{text}{GAP}{self.speed.name}"

    def of(self, unit: str) -> Scale:
        """Unit in which a signal of this SI unit is drawn."""
        scales = {"m": self.place, "rad": self.place, "m/s": self.speed, "rad/s": self.speed}
        scales |= {"rad/s^2": Scale(180 / math.pi, "deg/s²"), "rad/s^3": Scale(180 / math.pi, "deg/s³")}
        return scales.get(unit) or Scale(1.0, unit.replace("^2", "²").replace("^3", "³").replace("*", " "))

    def written(self, value: float, unit: str) -> str:
        """Write a difference of a signal of this SI unit."""
        if unit in {"m", "rad"}:
            return self.error(value)
        if unit in {"m/s", "rad/s"}:
            return self.speed_text(value)
        scale = self.of(unit)
        return f"{number(value * scale.factor)}{GAP}{scale.name}"
