"""Jobs of servo axes: lists of moves, and plain text as the moves of the carriage that prints it.

A servo axis knows no lines and no hammer: it goes to a place, says that it is ready and stands there for a while. A
move is that and nothing else. Files of moves are read in `move_file`; here everything is in SI units.
"""

from __future__ import annotations

import unicodedata
from dataclasses import dataclass, field, replace
from pathlib import PurePath
from typing import TYPE_CHECKING, ClassVar, Generic, TypeVar

from detent.errors import MOST_PROBLEMS, FileProblem, InputError
from detent.files.fields import Table, optional, rows
from detent.files.quantities import Length, Time, Velocity
from detent.files.read import Row, check_values

if TYPE_CHECKING:
    from collections.abc import Sequence

    from _typeshed import DataclassInstance

AnyMove = TypeVar("AnyMove", bound="DataclassInstance")
AnyRow = TypeVar("AnyRow", bound=Row)

MOST_MOVES = 100_000
"""Moves of a job at most, repeats counted: hours of any axis, and still a job that fits into a report."""

TAB_WIDTH = 8  # characters between the tab stops of plain text

# A form feed brings another sheet under the hammer: to the carriage that is the beginning of a line, like the others.
_LINE_BEGINS = {"\n", "\r", "\f"}
_WHAT_TEXT_HOLDS = "printable characters, spaces, tabs, line ends and form feeds"


class MoveRow(Row, frozen=True):
    """A move as a file says it."""

    one_of: ClassVar[tuple[str, ...]] = ("target", "by")
    target: Length | None = optional("where to", None)
    by: Length | None = optional("how far from where the move before went to", None)
    dwell: Time = optional("how long the axis stands after it is ready", 0.0, ge=0)
    repeat: int = optional("how often it is done in succession", 1, ge=1, le=MOST_MOVES)
    speed: Velocity | None = optional("speed of this move", None, derived="the axis's own", gt=0)
    sample_period: Time | None = optional("of the servo in this move", None, derived="the axis's own", gt=0)


class MoveFile(Table, Generic[AnyRow], frozen=True):
    """A file of moves."""

    repeat: int = optional("how often the whole list is done", 1, ge=1, le=MOST_MOVES)
    move: list[AnyRow] = rows("a move")


@dataclass(frozen=True, slots=True)
class Move:
    """One move of an axis, and how long the axis stands after it.

    A value that is outside what is said here, or not finite, is a `DetentError`.
    """

    number: int  #: counted from 1 through the whole job, repeats counted
    row: int  #: line of the file that asks for the move, from 1
    target: float | None = None  #: where to [m]
    #: how far from where the move before went to [m], positive in the positive direction of the axis. Exactly one of
    #: `target` and `by` is given
    by: float | None = None
    dwell: float = 0.0  #: time the axis stands after it is ready [s], 0 or more
    speed: float | None = None  #: speed of this move [m/s], above 0; None for the axis's own
    #: sample period of the servo during this move [s], above 0; None for the axis's own
    sample_period: float | None = None
    label: str = ""  #: what the move is for, in a text the character

    @property
    def place_key(self) -> str:
        """The key that says where to."""
        return "target" if self.by is None else "by"

    def __post_init__(self) -> None:
        """Refuse what no axis could do."""
        names = ("target", "by", "dwell", "speed", "sample_period")
        check_values(MoveRow, f"move {self.number}", {name: getattr(self, name) for name in names})


@dataclass(frozen=True, slots=True)
class MoveJob:
    """A list of moves."""

    name: str  #: name of the file, without its folders
    kind: str  #: "moves", or "text" where each move is a character
    moves: tuple[Move, ...]  #: in order, numbered from 1; repeats are written out

    @property
    def count(self) -> int:
        """Number of moves."""
        return len(self.moves)


def expand_moves(
    file: str, rows: Sequence[tuple[AnyMove, int]], repeat: int = 1, *, missing: str = "add a move with a target"
) -> tuple[AnyMove, ...]:
    """Write out the repeats of a list, and number the moves.

    >>> step = Move(number=1, row=3, by=0.001)
    >>> [(move.number, move.row, move.by) for move in expand_moves("steps.toml", [(step, 3)])]
    [(1, 3, 0.001), (2, 3, 0.001), (3, 3, 0.001)]
    """
    if not rows:
        raise InputError.of_file(file, "no moves", "a list of at least one move", missing)
    if len(rows) > MOST_MOVES:
        raise too_many_moves(file, f"more than {MOST_MOVES} moves")
    count = repeat * sum(times for _, times in rows)
    if count > MOST_MOVES:
        raise too_many_moves(file, f"{count} moves, repeats counted")
    moves: list[AnyMove] = []
    for _ in range(repeat):
        for move, times in rows:
            moves += [replace(move, number=len(moves) + 1 + done) for done in range(times)]
    return tuple(moves)


def too_many_moves(file: str, came: str) -> InputError:
    """Refuse a job for its length."""
    return InputError.of_file(
        file, came, f"up to {MOST_MOVES} moves", "lower the repeats, or divide the job among several files"
    )


def text_job(text: str, *, name: str, pitch: float, left_margin: float = 0.0, hammer_time: float = 0.0) -> MoveJob:
    r"""Make plain text the moves of a carriage that prints it, character by character.

    Each printable character is a move to its column, where the carriage stands while the hammer strikes. Spaces are
    skipped: the way over them is one longer move. Tabs go to every eighth column. The first character after a line
    feed, a carriage return or a form feed stands at its column from the left again: the carriage goes back. A combining
    accent is struck together with the letter before it. A SUB that ends a CP/M text is ignored.

    >>> job = text_job("ab c\nd", name="short.txt", pitch=0.00254, hammer_time=0.008)
    >>> [(move.label, move.target, move.row) for move in job.moves]
    [('a', 0.0, 1), ('b', 0.00254, 1), ('c', 0.00762, 1), ('d', 0.0, 2)]
    """
    carriage = _Carriage(name)
    for char in text.rstrip("\x1a").replace("\r\n", "\n"):
        carriage.read(char)
        if len(carriage.problems) >= MOST_PROBLEMS:
            break
        if len(carriage.struck) > MOST_MOVES:
            raise too_many_moves(name, f"more than {MOST_MOVES} characters to print")
    if carriage.problems:
        raise InputError(carriage.problems)
    if not carriage.struck:
        raise InputError.of_file(
            name,
            "a text that prints nothing" if text else "an empty file",
            "a text with at least one character to print",
            "put some text into it, or name another file",
        )
    moves = (
        Move(number, row, target=left_margin + column * pitch, dwell=hammer_time, label=label)
        for number, (row, column, label) in enumerate(carriage.struck, start=1)
    )
    return MoveJob(PurePath(name).name, "text", tuple(moves))


@dataclass(slots=True)
class _Carriage:
    """Reads text character by character and notes what is struck where."""

    file: str
    row: int = 1
    place: int = 0  # characters of this line read so far, as an editor counts them
    column: int = 0  # where the carriage stands
    may_take_accent: bool = False  # the character before was a letter
    struck: list[tuple[int, int, str]] = field(default_factory=list[tuple[int, int, str]])
    problems: list[FileProblem] = field(default_factory=list[FileProblem])

    def read(self, char: str) -> None:
        """Take the next character."""
        self.place += 1
        category = unicodedata.category(char)
        if category in {"Mn", "Me"} and self.may_take_accent:
            row, column, letter = self.struck[-1]
            self.struck[-1] = (row, column, letter + char)
            return
        self.may_take_accent = False
        if char in _LINE_BEGINS:
            self.column = 0
            if char != "\f":
                self.row += 1
                self.place = 0
        elif char == "\t":
            self.column = (self.column // TAB_WIDTH + 1) * TAB_WIDTH
        elif category == "Zs":
            self.column += 1
        elif char.isprintable() and category not in {"Mn", "Me"}:
            self.struck.append((self.row, self.column, char))
            self.column += 1
            self.may_take_accent = True
        else:
            self._refuse(char)

    def _refuse(self, char: str) -> None:
        code = f"0x{ord(char):02X}" if ord(char) < 0x100 else f"U+{ord(char):04X}"
        remedy = "remove it; save a document of a word processor as plain text first"
        came = f"the character {code}, which prints nothing alone"
        self.problems.append(FileProblem(self.file, self.row, self.place, "", came, _WHAT_TEXT_HOLDS, remedy))


def one_move(name: str, by: float, dwell: float) -> MoveJob:
    """A job of one move by a way [m] or [rad] and a dwell [s], for looking at signals."""
    return MoveJob(name, "moves", (Move(number=1, row=0, by=by, dwell=dwell),))
