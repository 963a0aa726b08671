"""What the rows of every file of moves have in common: their keys, the checks of their values, the job they make."""

from collections.abc import Mapping
from pathlib import PurePath

from detent.errors import FileProblem, InputError
from detent.planning.move_job import MOST_MOVES, MOST_PROBLEMS, Move, MoveJob, expand_moves, too_many_moves
from detent.units import QuantityError, parse_quantity

UNITS = {"target": "m", "by": "m", "dwell": "s", "repeat": "", "speed": "m/s", "sample_period": "s"}
"""Unit of each key of a row, behind the border; empty for a count."""

EXAMPLE_UNITS = {"m": "mm", "s": "ms", "m/s": "mm/s"}
"""Unit that messages suggest, by the unit behind the border."""

ONE_WAY = "exactly one of target (a place) and by (a way from the place before)"
"""What each row must say."""

MAX_SHOWN = 60
"""Characters of a value shown in a message."""


class RefusedValueError(Exception):
    """A value will not do; whoever reads the row adds its place.

    Attributes
    ----------
    came : str
        What is wrong with it; empty where the value as written says it.
    allowed, remedy : str
        What would be accepted, and what to do.
    """

    def __init__(self, came: str, allowed: str, remedy: str) -> None:
        super().__init__(came, allowed, remedy)
        self.came = came
        self.allowed = allowed
        self.remedy = remedy


def read_quantity(key: str, text: str) -> float:
    """Read a number with its unit as the value of a key, in SI units.

    Raises
    ------
    RefusedValueError
        It is no such quantity, or outside what the key allows.
    """
    try:
        value = parse_quantity(text, UNITS[key])
    except QuantityError as error:
        raise RefusedValueError(error.reason, error.allowed, error.remedy) from None
    unit = EXAMPLE_UNITS[UNITS[key]]
    if key == "dwell" and value < 0:
        raise RefusedValueError("", f"0 {unit} or more", "write how long the axis stands after the move")
    if key in {"speed", "sample_period"} and value <= 0:
        raise RefusedValueError("", f"more than 0 {unit}", "raise it, or leave it out for the axis's own")
    return value


def check_count(value: int) -> int:
    """Check a number of repeats.

    Raises
    ------
    RefusedValueError
        It is below 1, or beyond `MOST_MOVES`.
    """
    if 1 <= value <= MOST_MOVES:
        return value
    remedy = "leave it out to do it once" if value < 1 else "lower it"
    raise RefusedValueError("", f"a whole number from 1 to {MOST_MOVES}", remedy)


def short(text: str) -> str:
    """Text as it fits into a message."""
    shown = "".join(char if char.isprintable() else "\N{REPLACEMENT CHARACTER}" for char in text[: MAX_SHOWN + 1])
    return shown if len(shown) <= MAX_SHOWN else f"{shown[:MAX_SHOWN]}..."


class MoveRows:
    """The rows of one file as far as they could be read, and all that is wrong with it.

    Parameters
    ----------
    file : str
        The file as the user named it.

    Attributes
    ----------
    problems : list of FileProblem
        What is wrong, in the order it was found.
    """

    def __init__(self, file: str) -> None:
        self.file = file
        self.problems: list[FileProblem] = []
        self._rows: list[tuple[Move, int]] = []

    @property
    def is_over(self) -> bool:
        """True when nothing that follows could change the answer: too many rows, or problems enough."""
        return len(self._rows) > MOST_MOVES or len(self.problems) >= MOST_PROBLEMS

    def refuse(self, place: tuple[int, int], key: str, came: str, allowed: str, remedy: str) -> None:
        """Note a problem at `place` (line, column)."""
        self.problems.append(FileProblem(self.file, *place, key, came, allowed, remedy))

    def add(self, line: int, values: Mapping[str, float]) -> None:
        """Add the row of a line, once it is known to be whole; values in SI units, by key."""
        move = Move(
            number=1,
            row=line,
            target=values.get("target"),
            by=values.get("by"),
            dwell=values.get("dwell", 0.0),
            speed=values.get("speed"),
            sample_period=values.get("sample_period"),
        )
        self._rows.append((move, int(values.get("repeat", 1))))

    def to_job(self, repeat: int = 1) -> MoveJob:
        """Make the rows a job that does the list `repeat` times.

        Raises
        ------
        InputError
            There are problems, no moves, or too many.
        """
        if self.problems:
            raise InputError(InputError(self.problems).problems[:MOST_PROBLEMS])
        if not self._rows:
            raise InputError.of_file(self.file, "no moves", "a list of at least one move", "add a move with a target")
        if len(self._rows) > MOST_MOVES:
            raise too_many_moves(self.file, f"more than {MOST_MOVES} moves")
        return MoveJob(PurePath(self.file).name, "moves", expand_moves(self.file, self._rows, repeat))
