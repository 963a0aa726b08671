"""Jobs of servo axes, read from files: lists of moves as CSV or TOML, or a text to print."""

from os import PathLike
from pathlib import Path

from detent.errors import InputError
from detent.files.job_text import decode_utf8, read_data
from detent.methods.moves.job import MoveJob, text_job
from detent.methods.moves.move_csv import parse_move_csv
from detent.methods.moves.move_rows import ROTARY_UNITS, UNITS
from detent.methods.moves.move_toml import parse_move_toml

_KINDS = (".csv", ".toml", ".txt")
_WHAT_A_JOB_IS = "a list of moves (.csv or .toml) or a text (.txt)"


def load_moves(
    path: str | PathLike[str],
    *,
    pitch: float | None = None,  # distance of two characters [m], above 0; None for an axis that prints no text
    left_margin: float = 0.0,  # position of a text's first column [m]
    hammer_time: float = 0.0,  # time the axis stands at each character of a text [s]
    rotary: bool = False,
) -> MoveJob:
    """Read the job of a servo axis; the ending of the name says what it is."""
    file = Path(path)
    data = read_data(file, _KINDS, _WHAT_A_JOB_IS)
    ending, units = file.suffix.lower(), ROTARY_UNITS if rotary else UNITS
    if ending == ".csv":
        return parse_move_csv(str(file), decode_utf8(file, data), units)
    if ending == ".toml":
        return parse_move_toml(str(file), decode_utf8(file, data), units)
    if pitch is None:
        remedy = "name a list of moves; a text is for an axis that has a character pitch"
        raise InputError.of_file(
            str(file), "a text; this axis prints no text", "a list of moves (.csv or .toml)", remedy
        )
    text = _decode_text(data)
    return text_job(text, name=str(file), pitch=pitch, left_margin=left_margin, hammer_time=hammer_time)


def _decode_text(data: bytes) -> str:
    """Text to print."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")
