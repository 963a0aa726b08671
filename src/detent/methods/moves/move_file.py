"""Jobs of servo axes, read from files: lists of moves as CSV or TOML, or a text to print."""

from os import PathLike
from pathlib import Path

from detent.errors import InputError
from detent.files.fields import optional
from detent.files.quantities import Angle, AngularVelocity
from detent.files.read import read_tables
from detent.files.read_csv import CsvRows
from detent.files.source import parse_source
from detent.files.text import decode_utf8, read_data
from detent.methods.moves.job import MOST_MOVES, Move, MoveFile, MoveJob, MoveRow, expand_moves, text_job

_KINDS = (".csv", ".toml", ".txt")
_WHAT_A_JOB_IS = "a list of moves (.csv or .toml) or a text (.txt)"


class RotaryMoveRow(MoveRow, frozen=True):
    """The same of an axis that turns."""

    target: Angle | None = optional("where to", None)
    by: Angle | None = optional("how far from where the move before went to", None)
    speed: AngularVelocity | None = optional("speed of this move", None, derived="the axis's own", gt=0)


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
    data = read_data(file, _KINDS, _WHAT_A_JOB_IS)
    if file.suffix.lower() != ".txt":
        return _parse_moves(file, decode_utf8(file, data), RotaryMoveRow if rotary else MoveRow)
    if pitch is None:
        remedy = "name a list of moves; a text is for an axis that has a character pitch"
        came, allowed = "a text; this axis prints no text", "a list of moves (.csv or .toml)"
        raise InputError.of_file(str(file), came, allowed, remedy)
    text = _decode_text(data)
    return text_job(text, name=str(file), pitch=pitch, left_margin=left_margin, hammer_time=hammer_time)


def _parse_moves(file: Path, text: str, model: type[MoveRow]) -> MoveJob:
    """Moves of a text, in the format that the file's name says."""
    repeat = 1
    if file.suffix.lower() == ".csv":
        made = CsvRows(str(file), text, model).read(_make_move, MOST_MOVES)
    else:
        source = parse_source(str(file), text)
        found = read_tables(source, MoveFile[model])
        repeat = found.repeat
        made = [_make_move(source.line_of("move", number), row) for number, row in enumerate(found.move)]
    return MoveJob(file.name, "moves", expand_moves(str(file), made, repeat))


def _make_move(line: int, row: MoveRow) -> tuple[Move, int]:
    """The move of a row, and how often it is done."""
    values = row.model_dump(exclude={"repeat"})
    return Move(1, line, **values), row.repeat


def _decode_text(data: bytes) -> str:
    """Text to print."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")
