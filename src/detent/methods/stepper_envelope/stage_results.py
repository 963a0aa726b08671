"""The figures of a job on a stepper stage: of the whole of it, of each move and of each motor in a move.

Everything is SI except what names its unit: a step is one period of a motor's step frequency. Positions are those of
the axis, up is to larger ones. Times count from the start of the job unless something else is said.
"""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class WorstMotion:
    """The most telling of the figures of all motions, and whose it is.

    Attributes
    ----------
    value : float
        The figure.
    move : int
        Number of the move.
    motor : str
        Motor that made it.
    """

    value: float
    move: int
    motor: str


@dataclass(frozen=True, slots=True, kw_only=True)
class StageFigures:
    """The figures of a job that a person wants first.

    Attributes
    ----------
    asked, made : int
        Moves of the job; those that came to their end.
    placed : int
        Of those made, the ones after which every rotor stood in its place: it had lost no step up to then.
    seconds : float
        From the start of the job to its end [s].
    rate : float
        Moves per second, settling and dwells included.
    moving : float
        Time in which a motor ran [s].
    naive : float
        The same if every motor had run at its start frequency [s].
    steps : int
        Steps made by all motors.
    lost : dict of int by motor
        Steps lost in all.
    first_lost : WorstMotion, optional
        The motion that lost steps first, and how many.
    lag, rest : WorstMotion, optional
        Largest distance of a rotor from its field, on the way and when the move was taken for done [step].
    margin : WorstMotion, optional
        Smallest torque margin; None if no motion needed torque.
    peak_hz, peak_speed : WorstMotion, optional
        Largest step frequency [Hz], largest speed [m/s].
    """

    asked: int
    made: int
    placed: int
    seconds: float
    rate: float
    moving: float
    naive: float
    steps: int
    lost: dict[str, int]
    first_lost: WorstMotion | None
    lag: WorstMotion | None
    rest: WorstMotion | None
    margin: WorstMotion | None
    peak_hz: WorstMotion | None
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
    """How one motor made a move.

    Attributes
    ----------
    motor : str
        Its name.
    start, target, stop : float
        Where it stood, where it had to go, and its position of record in the end [m].
    seconds : float
        From the start signal to the end of the last step [s].
    steps : int
        Steps made, both ways.
    peak_hz : float
        Largest step frequency [Hz].
    lag : float
        Largest distance of the rotor from its field [step].
    margin : float
        Smallest torque margin; infinite if no torque was needed.
    lost : int
        Steps lost in this move.
    off : int
        Steps that the rotor stands beside its place in the end, those of earlier moves included.
    passed : bool
        A stop that was changed on the way lay too near, was passed and come back to.
    """

    motor: str
    start: float
    target: float
    stop: float
    seconds: float
    steps: int
    peak_hz: float
    lag: float
    margin: float
    lost: int
    off: int
    passed: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class StageMoveResult:
    """How one move went.

    Attributes
    ----------
    number : int
        From 1.
    label : str
        The tile, or what the job calls it.
    begin : float
        When the start signals came [s].
    seconds : float
        From then until every rotor was at rest [s].
    motions : sequence of MotionResult
        Motors that moved.
    """

    number: int
    label: str
    begin: float
    seconds: float
    motions: Sequence[MotionResult]
