"""Jobs of servo axes: lists of moves (CSV, TOML), and plain text as the moves of the carriage that prints it.

A servo axis knows no lines and no hammer: it goes to a place, says that it is ready and stands there for a while. A
move is that and nothing else.
"""

from __future__ import annotations

import unicodedata
from dataclasses import dataclass, replace
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, ClassVar, Generic, TypeVar

from detent.errors import MOST_PROBLEMS, FileProblem, InputError
from detent.files.fields import Table, optional, rows
from detent.files.quantities import Angle, AngularVelocity, Length, Time, Velocity
from detent.files.read import Row, check_values, read_tables
from detent.files.read_csv import CsvRows
from detent.files.screen import OnScreen
from detent.files.source import parse_source
from detent.files.text import decode_utf8, read_data
from detent.methods.changes import ChangeRow, ParameterChange, change_rows, read_changes

if TYPE_CHECKING:
    from collections.abc import Sequence
    from os import PathLike

    from _typeshed import DataclassInstance

AnyMove = TypeVar("AnyMove", bound="DataclassInstance")
AnyRow = TypeVar("AnyRow", bound=Row)

MOST_MOVES = 100_000
"""Moves of a job at most, repeats counted: hours of any axis, and still a job that fits into a report."""

TAB_WIDTH = 8  # characters between the tab stops of plain text

# A form feed brings another sheet under the hammer: to the carriage that is the beginning of a line, like the others.
_LINE_BEGINS = {"\n", "\r", "\f"}
_WHAT_TEXT_HOLDS = "printable characters, spaces, tabs, line ends and form feeds"
_ACCENTS = {"Mn", "Me"}  # categories of characters that are struck together with the one before
_WHAT_A_JOB_IS = "a list of moves (.csv or .toml) or a text (.txt)"


class MoveRow(Row, frozen=True):
    """A move as a file says it."""

    one_of: ClassVar[tuple[str, ...]] = ("target", "by")
    target: Length | None = optional("target position", None)
    by: Length | None = optional("distance from the previous target", None)
    dwell: Time = optional("dwell time after the axis is ready", 0.0, ge=0)
    repeat: int = optional("number of repetitions", 1, ge=1, le=MOST_MOVES)
    speed: Velocity | None = optional("speed of this move", None, derived="the axis's own", gt=0)
    sample_period: Time | None = optional("of the servo in this move", None, derived="the axis's own", gt=0)


class RotaryMoveRow(MoveRow, frozen=True):
    """The same of an axis that turns."""

    target: Angle | None = optional("target position", None)
    by: Angle | None = optional("distance from the previous target", None)
    speed: AngularVelocity | None = optional("speed of this move", None, derived="the axis's own", gt=0)


class MoveFile(Table, Generic[AnyRow], frozen=True):
    """A file of moves."""

    repeat: int = optional("number of repetitions of the whole list", 1, ge=1, le=MOST_MOVES)
    move: list[AnyRow] = rows("a move")
    parameter_change: list[ChangeRow] = change_rows()


@dataclass(frozen=True, slots=True)
class Move:
    """One move of an axis, and how long the axis stands after it.

    A value that is outside what is said here, or not finite, is a `DetentError`.
    """

    number: int  #: counted from 1 through the whole job, repeats counted
    row: int  #: line of the file that asks for the move, from 1
    target: float | None = None  #: target position [m]
    #: distance from the previous target [m], positive in the positive direction of the axis. Exactly one of
    #: `target` and `by` is given
    by: float | None = None
    dwell: float = 0.0  #: time the axis stands after it is ready [s], 0 or more
    speed: float | None = None  #: speed of this move [m/s], above 0; None for the axis's own
    #: sample period of the servo during this move [s], above 0; None for the axis's own
    sample_period: float | None = None
    label: str = ""  #: what the move is for, in a text the character

    @property
    def place_key(self) -> str:
        """The key that states the target."""
        return "target" if self.by is None else "by"

    def __post_init__(self) -> None:
        """Refuse what no axis could do."""
        names = ("target", "by", "dwell", "speed", "sample_period")
        check_values(MoveRow, f"move {self.number}", {name: getattr(self, name) for name in names})


@dataclass(frozen=True, slots=True, repr=False)
class MoveJob(OnScreen):
    """A list of moves."""

    name: str  #: name of the file, without its folders
    kind: str  #: "moves", or "text" where each move is a character
    moves: tuple[Move, ...]  #: in order, numbered from 1; repeats are written out
    changes: tuple[ParameterChange, ...] = ()  #: parameters of the controller that change on the way

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


def too_many_moves(file: str, got: str) -> InputError:
    """Refuse a job for its length."""
    remedy = "lower the repeats, or divide the job among several files"
    return InputError.of_file(file, got, f"up to {MOST_MOVES} moves", remedy)


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
    struck = _struck(text, name)
    if not struck:
        got = "a text without printable characters" if text else "an empty file"
        allowed, remedy = "a text with at least one character to print", "add some text, or name another file"
        raise InputError.of_file(name, got, allowed, remedy)
    moves = (
        Move(number, row, target=left_margin + column * pitch, dwell=hammer_time, label=label)
        for number, (row, column, label) in enumerate(struck, start=1)
    )
    return MoveJob(PurePath(name).name, "text", tuple(moves))


def _struck(text: str, file: str) -> list[tuple[int, int, str]]:
    """Line, column and character of everything that a text prints."""
    struck: list[tuple[int, int, str]] = []
    problems: list[FileProblem] = []
    row, place, column = 1, 0, 0  # the place is counted as an editor does
    letter = False  # the character before may take an accent
    for char in text.rstrip("\x1a").replace("\r\n", "\n"):
        place += 1
        category = unicodedata.category(char)
        accent, letter = letter and category in _ACCENTS, False
        if accent:
            struck[-1] = (*struck[-1][:2], struck[-1][2] + char)
            letter = True
        elif char in _LINE_BEGINS:
            column = 0
            row, place = (row, place) if char == "\f" else (row + 1, 0)
        elif char == "\t":
            column = (column // TAB_WIDTH + 1) * TAB_WIDTH
        elif category == "Zs":
            column += 1
        elif char.isprintable() and category not in _ACCENTS:
            struck.append((row, column, char))
            column, letter = column + 1, True
            if len(struck) > MOST_MOVES:
                raise too_many_moves(file, f"more than {MOST_MOVES} characters to print")
        elif len(problems) < MOST_PROBLEMS:
            code = f"0x{ord(char):02X}" if ord(char) < 0x100 else f"U+{ord(char):04X}"
            got = f"the character {code}, which is not printable by itself"
            remedy = "remove it; save a document of a word processor as plain text first"
            problems.append(FileProblem(file, row, place, "", got, _WHAT_TEXT_HOLDS, remedy))
    if problems:
        raise InputError(problems)
    return struck


def load_moves(
    path: str | PathLike[str],
    *,
    pitch: float | None = None,
    left_margin: float = 0.0,
    hammer_time: float = 0.0,
    rotary: bool = False,
) -> MoveJob:
    """Read the job of a servo axis: a list of moves, or a text of characters `pitch` [m] apart; the ending says which.

    Whether the axis can do it is not checked here; of an axis that turns, places and ways are angles [rad]. What is
    wrong with the file is told all at once, with line and column, as an `InputError`.
    """
    file = Path(path)
    data = read_data(file, (".csv", ".toml", ".txt"), _WHAT_A_JOB_IS)
    if file.suffix.lower() != ".txt":
        return _parse_moves(file, decode_utf8(file, data), RotaryMoveRow if rotary else MoveRow)
    if pitch is None:
        remedy = "name a list of moves; a text is for an axis that has a character pitch"
        got, allowed = "a text; this axis prints no text", "a list of moves (.csv or .toml)"
        raise InputError.of_file(str(file), got, allowed, remedy)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    return text_job(text, name=str(file), pitch=pitch, left_margin=left_margin, hammer_time=hammer_time)


def _parse_moves(file: Path, text: str, model: type[MoveRow]) -> MoveJob:
    """Moves of a text, in the format that the file's name says."""
    repeat, changes = 1, ()
    if file.suffix.lower() == ".csv":
        made = CsvRows(str(file), text, model).read(_make_move, MOST_MOVES)
    else:
        source = parse_source(str(file), text)
        found = read_tables(source, MoveFile[model])
        repeat = found.repeat
        made = [_make_move(source.line_of("move", number), row) for number, row in enumerate(found.move)]
        changes = read_changes(source, found.parameter_change)
    return MoveJob(file.name, "moves", expand_moves(str(file), made, repeat), changes)


def _make_move(line: int, row: MoveRow) -> tuple[Move, int]:
    """The move of a row, and how often it is done."""
    return Move(1, line, **row.model_dump(exclude={"repeat"})), row.repeat


def one_move(name: str, by: float, dwell: float) -> MoveJob:
    """A job of one move by a way [m] or [rad] and a dwell [s], for looking at signals."""
    return MoveJob(name, "moves", (Move(number=1, row=0, by=by, dwell=dwell),))


def half_and_back(lowest: float, highest: float, start: float) -> MoveJob:
    """A job over half of the travel to where there is more room, and back, half a second at rest after each."""
    way = 0.5 * (highest - lowest) * (1 if start - lowest < highest - start else -1)
    moves = tuple(Move(number=k, row=0, by=by, dwell=0.5) for k, by in enumerate((way, -way), 1))
    return MoveJob("half of the travel and back", "moves", moves)
