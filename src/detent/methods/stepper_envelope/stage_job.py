"""Jobs of stepper stages: moves of one motor or of several at once, and manual runs of one.

A stage goes to a place with every motor that the move names, and stands there for a while: a microscope takes a
picture of a tile then. A move of one motor may also turn on its way, or have its stop extreme changed while it runs; a
manual run is what an operator does with a joystick. Files of them are read in `stage_file`; here
everything is in SI units, and nothing is known of the motors but their names.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from detent.methods.moves.job import bad_move, check_dwell


@dataclass(frozen=True, slots=True)
class Change:
    """A stop extreme changed on the way.

    Attributes
    ----------
    at : float
        Position [m] at which the motor is when the change comes.
    to : float
        The new stop extreme [m].
    """

    at: float
    to: float


@dataclass(frozen=True, slots=True)
class StageMove:
    """One automatic move, of all the motors it names at the same time, and how long the stage stands after it.

    Attributes
    ----------
    number : int
        Counted from 1 through the whole job, repeats counted.
    row : int
        Line of the file that asks for the move, from 1.
    targets : dict of float by motor
        Where to [m].
    by : dict of float by motor
        How far from where the motor was told to go before [m]. No motor is in both; one that is in neither stays.
    dwell : float
        Time the stage stands after the last motor is ready [s], 0 or more.
    label : str
        What the move is for: the number of a tile, or a word.
    turn : float or None
        Where the motor turns before it goes to its target [m], the turn extreme of its envelope: it runs on to there
        and comes back in the same move. Only where exactly one motor moves.
    change : Change or None
        A stop extreme changed on the way. Only where exactly one motor moves, and without `turn`: the motor would pass
        one place twice.

    Raises
    ------
    DetentError
        A value is outside what is said above, or not finite.
    """

    number: int
    row: int
    targets: dict[str, float] = field(default_factory=dict[str, float])
    by: dict[str, float] = field(default_factory=dict[str, float])
    dwell: float = 0.0
    label: str = ""
    turn: float | None = None
    change: Change | None = None

    def __post_init__(self) -> None:
        """Refuse what no stage could do."""
        motors = self.motors
        if not motors:
            raise bad_move(self.number, "no motor", "a target or a way for at least one motor")
        if len(set(motors)) < len(motors):
            both = next(motor for motor in self.targets if motor in self.by)
            raise bad_move(self.number, f"a target and a way for {both}", "one of the two for each motor")
        for motor, way in (*self.targets.items(), *self.by.items()):
            _check_length(self.number, f"way of {motor}", way)
        check_dwell(self.number, self.dwell)
        if self.turn is not None or self.change is not None:
            self._check_extremes(motors)

    def _check_extremes(self, motors: tuple[str, ...]) -> None:
        if len(motors) > 1:
            raise bad_move(self.number, f"a turn or a change with {len(motors)} motors", "one motor, which it is for")
        if self.turn is not None and self.change is not None:
            raise bad_move(self.number, "a turn and a change", "one of the two")
        if self.turn is not None:
            _check_length(self.number, "turn", self.turn)
        if self.change is not None:
            _check_length(self.number, "place of the change", self.change.at)
            _check_length(self.number, "changed stop", self.change.to)

    @property
    def motors(self) -> tuple[str, ...]:
        """Motors that the move names."""
        return (*self.targets, *self.by)


@dataclass(frozen=True, slots=True)
class StageJog:
    """One manual run: the joystick of a motor is held deflected for a time, then let go.

    Attributes
    ----------
    number, row : int
        As of a `StageMove`.
    motor : str
        The motor.
    speed : float
        Speed asked for [m/s], negative for the negative direction, not 0.
    duration : float
        Time until the joystick is let go [s], above 0; the motor then slows down to rest.
    dwell : float
        Time the stage stands after that [s], 0 or more.
    label : str
        What the run is for.

    Raises
    ------
    DetentError
        A value is outside what is said above, or not finite.
    """

    number: int
    row: int
    motor: str
    speed: float
    duration: float
    dwell: float = 0.0
    label: str = ""

    def __post_init__(self) -> None:
        """Refuse what no stage could do."""
        if not (math.isfinite(self.speed) and self.speed):
            raise bad_move(self.number, f"a speed of {self.speed} m/s", "a finite speed other than 0 m/s")
        if not 0 < self.duration < math.inf:
            raise bad_move(self.number, f"a duration of {self.duration} s", "more than 0 s")
        check_dwell(self.number, self.dwell)

    @property
    def motors(self) -> tuple[str, ...]:
        """The motor, as the one that this run names."""
        return (self.motor,)


@dataclass(frozen=True, slots=True)
class StageJob:
    """A list of moves of a stage.

    Attributes
    ----------
    name : str
        Name of the file, without its folders.
    kind : str
        "moves", or "tiles" where the file is a list of tiles.
    moves : tuple of StageMove or StageJog
        In order, numbered from 1; repeats are written out.
    motors : tuple of str
        Motors that the job names, in the order of the axis file.
    notes : tuple of str
        What the reader of the file chose, to be told to the user, such as the columns it took.
    """

    name: str
    kind: str
    moves: tuple[StageMove | StageJog, ...]
    motors: tuple[str, ...]
    notes: tuple[str, ...] = ()

    @property
    def count(self) -> int:
        """Number of moves."""
        return len(self.moves)


def _check_length(number: int, name: str, value: float) -> None:
    if not math.isfinite(value):
        raise bad_move(number, f"a {name} of {value} m", "a finite number of metres")
