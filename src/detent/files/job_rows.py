"""Rows of job files that become moves: collected one by one, then numbered with their repeats written out."""

from typing import Generic

from detent.errors import FileProblem, InputError
from detent.files.job_values import RefusedValueError
from detent.methods.moves.job import MOST_MOVES, MOST_PROBLEMS, AnyMove, expand_moves, too_many_moves

EXAMPLE_UNITS = {"m": "mm", "s": "ms", "m/s": "mm/s", "rad": "deg", "rad/s": "deg/s"}
"""Unit that messages suggest, by the unit behind the border."""


class JobRows(Generic[AnyMove]):
    """The rows of one file as far as they could be read, and all that is wrong with it."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.problems: list[FileProblem] = []  # what is wrong, in the order it was found
        self._rows: list[tuple[AnyMove, int]] = []

    @property
    def is_over(self) -> bool:
        """True when nothing that follows could change the answer: too many rows, or problems enough."""
        return len(self._rows) > MOST_MOVES or len(self.problems) >= MOST_PROBLEMS

    def add(self, move: AnyMove, times: float = 1) -> None:
        """Add a row, once it is known to be whole; its move is done so many times in succession."""
        self._rows.append((move, int(times)))

    def written_out(self, repeat: int = 1, *, missing: str = "add a move with a target") -> tuple[AnyMove, ...]:
        """All moves, numbered, of a job that does the list `repeat` times."""
        if self.problems:
            raise InputError(InputError(self.problems).problems[:MOST_PROBLEMS])
        if not self._rows:
            raise InputError.of_file(self.file, "no moves", "a list of at least one move", missing)
        if len(self._rows) > MOST_MOVES:
            raise too_many_moves(self.file, f"more than {MOST_MOVES} moves")
        return expand_moves(self.file, self._rows, repeat)


def check_count(value: int) -> int:
    """Check a number of repeats."""
    if 1 <= value <= MOST_MOVES:
        return value
    remedy = "leave it out to do it once" if value < 1 else "lower it"
    raise RefusedValueError("", f"a whole number from 1 to {MOST_MOVES}", remedy)


def check_dwell(value: float) -> float:
    """Check how long something stands after a move [s]."""
    if value < 0:
        raise RefusedValueError("", f"0 {EXAMPLE_UNITS['s']} or more", "write how long the axis stands after the move")
    return value
