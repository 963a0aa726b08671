"""What the positions of an axis mean: counts of what length, between which ends, told by what kind of sensor.

A position of record is a whole number of counts (int64). It is a place of the machine only together with what stands
here, so that whatever keeps positions keeps this beside them, and compares.
"""

from dataclasses import dataclass
from enum import StrEnum
from fractions import Fraction


class Sensed(StrEnum):
    """What a position sensor knows when the power comes back."""

    INCREMENTAL = "incremental"  #: nothing: it counts from where it is switched on
    BAND = "absolute within a band"  #: the place within a band, not which band; a pitch, or a turn of the motor
    ABSOLUTE = "absolute"  #: the place, over the whole travel or within the turn of an axis that has no ends


@dataclass(frozen=True, slots=True, kw_only=True)
class PositionSensor:
    """What counts the position of one motor."""

    sensor: str  #: in words, with all that makes its readings mean what they do
    kind: Sensed
    scale: float  #: travel per count [unit]
    unit: str = "m"  #: "m" or "rad"
    origin: float = 0.0  #: position of count 0 [unit]
    ends: tuple[float, float] | None = None  #: of the travel [unit]; None: it turns without end
    band: int = 0  #: counts after which readings repeat: of the band, or of the turn of an axis without ends
    window: int = 1  #: counts by which two readings at rest may differ
    held: bool = False  #: a brake or a screw that locks itself holds the axis while its power is off
    id: str = ""  #: what the hardware says of itself

    @property
    def is_circle(self) -> bool:
        """True where positions are places of a circle: the turn of an axis without ends."""
        return self.kind is Sensed.ABSOLUTE and self.ends is None and self.band > 0

    @property
    def reach(self) -> tuple[int, int] | None:
        """First and last count at which the axis can stand; None for an axis that turns without end."""
        if self.is_circle:
            return 0, self.band - 1
        if self.ends is None:
            return None
        low, high = (self.counts(end) for end in self.ends)
        return low - self.window, high + self.window

    def counts(self, position: float) -> int:
        """Count nearest to a position [unit]."""
        return round((Fraction(position) - Fraction(self.origin)) / Fraction(self.scale))

    def position(self, counts: int) -> float:
        """Position of a count [unit]."""
        return float(Fraction(self.origin) + counts * Fraction(self.scale))
