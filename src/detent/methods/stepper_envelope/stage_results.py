"""The figures of a job on a stepper stage: of the whole of it, of each move and of each motor in a move.

Everything is SI except what names its unit: a step is one period of a motor's step frequency. Positions are those of
the axis, up is to larger ones. Times count from the start of the job unless something else is said.
"""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class WorstMotion:
    """The most telling of the figures of all motions, and whose it is."""

    value: float  # the figure
    move: int  # number of the move
    motor: str  # motor that made it


@dataclass(frozen=True, slots=True, kw_only=True)
class StageFigures:
    """The figures of a job that a person wants first."""

    asked: int  # and made: moves of the job; those that came to their end
    made: int
    placed: int  # of those made, the ones after which every rotor stood in its place: it had lost no step up to then
    seconds: float  # from the start of the job to its end [s]
    rate: float  # moves per second, settling and dwells included
    moving: float  # time in which a motor ran [s]
    naive: float  # the same if every motor had run at its start frequency [s]
    steps: int  # steps made by all motors
    lost: dict[str, int]  # steps lost in all
    first_lost: WorstMotion | None  # the motion that lost steps first, and how many
    # lag, rest: largest distance of a rotor from its field, on the way and when the move was taken for done [step]
    lag: WorstMotion | None
    rest: WorstMotion | None  # [step]
    margin: WorstMotion | None  # smallest torque margin; None if no motion needed torque
    peak_hz: WorstMotion | None  # and peak_speed: largest step frequency [Hz], largest speed [m/s]
    peak_speed: WorstMotion | None

    @property
    def all_lost(self) -> int:
        """Steps lost by all motors, of either sign."""
        return sum(abs(n) for n in self.lost.values())

    @property
    def faster(self) -> float:
        """How many times as long the start frequency would take; NaN if nothing moved."""
        return self.naive / self.moving if self.moving > 0 else float("nan")


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionResult:
    """How one motor made a move."""

    motor: str  # its name
    start: float  # and target, stop: where it stood, where it had to go, and its position of record in the end [m]
    target: float  # [m]
    stop: float  # [m]
    seconds: float  # from the start signal to the end of the last step [s]
    steps: int  # steps made, both ways
    peak_hz: float  # largest step frequency [Hz]
    lag: float  # largest distance of the rotor from its field [step]
    margin: float  # smallest torque margin; infinite if no torque was needed
    lost: int  # steps lost in this move
    off: int  # steps that the rotor stands beside its place in the end, those of earlier moves included
    passed: bool  # a stop that was changed on the way lay too near, was passed and come back to


@dataclass(frozen=True, slots=True, kw_only=True)
class StageMoveResult:
    """How one move went."""

    number: int  # from 1
    label: str  # the tile, or what the job calls it
    begin: float  # when the start signals came [s]
    seconds: float  # from then until every rotor was at rest [s]
    motions: Sequence[MotionResult]  # motors that moved
