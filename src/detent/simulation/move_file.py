"""Jobs of servo axes, read from files: lists of moves as CSV or TOML, or a text to print."""

from os import PathLike
from pathlib import Path

from detent.errors import FileProblem, InputError
from detent.planning.move_job import MoveJob, text_job
from detent.simulation.move_csv import parse_move_csv
from detent.simulation.move_toml import parse_move_toml

MAX_BYTES = {".csv": 8_000_000, ".txt": 8_000_000, ".toml": 1_000_000}
"""Largest file read, by the ending of its name: room for the most moves that a job can have. TOML is parsed more slowly
than it is written by hand; a list so long comes from a program, which can write CSV."""

_WHAT_A_JOB_IS = "a list of moves (.csv or .toml) or a text (.txt)"
_REMEDY = "check the name after --job"


def load_moves(
    path: str | PathLike[str], *, pitch: float | None = None, left_margin: float = 0.0, hammer_time: float = 0.0
) -> MoveJob:
    """Read the job of a servo axis; the ending of the name says what it is.

    Parameters
    ----------
    path : str or path
        A list of moves (``.csv``, ``.toml``; UTF-8), or a text (``.txt``; UTF-8, or Latin-1 where it is not UTF-8).
    pitch : float or None
        Distance of two characters [m], above 0; None for an axis that prints no text.
    left_margin : float
        Position of a text's first column [m].
    hammer_time : float
        Time the axis stands at each character of a text [s].

    Returns
    -------
    MoveJob
        With at least one move. Whether the axis can do it is not checked here.

    Raises
    ------
    InputError
        The file cannot be read, or something in it is wrong: all of it is told, with line and column.
    """
    file = Path(path)
    data = _read_bytes(file)
    ending = file.suffix.lower()
    if ending == ".csv":
        return parse_move_csv(str(file), _decode(file, data))
    if ending == ".toml":
        return parse_move_toml(str(file), _decode(file, data))
    if pitch is None:
        remedy = "name a list of moves; a text is for an axis that has a character pitch"
        raise InputError.of_file(
            str(file), "a text; this axis prints no text", "a list of moves (.csv or .toml)", remedy
        )
    text = _decode_text(data)
    return text_job(text, name=str(file), pitch=pitch, left_margin=left_margin, hammer_time=hammer_time)


def _read_bytes(file: Path) -> bytes:
    """Content of a file of a known kind, or an `InputError` that says why there is none."""
    limit = MAX_BYTES.get(file.suffix.lower(), 0)
    try:
        with file.open("rb") as stream:
            data = stream.read(limit + 1)
    except FileNotFoundError:
        raise InputError.of_file(str(file), "no such file", _WHAT_A_JOB_IS, _REMEDY) from None
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        came = f"a file that cannot be read ({reason})"
        raise InputError.of_file(str(file), came, _WHAT_A_JOB_IS, _REMEDY) from None
    except ValueError:
        raise InputError.of_file(repr(str(file)), "a name no file can have", _WHAT_A_JOB_IS, _REMEDY) from None
    if not limit:
        came = f'a name that ends in "{file.suffix}"' if file.suffix else "a name without an ending"
        remedy = "name a file of one of these kinds, or give it the ending of its kind"
        raise InputError.of_file(str(file), came, _WHAT_A_JOB_IS, remedy)
    if len(data) > limit:
        remedy = "divide the job among several files, or use repeat; a CSV file may be the longest"
        raise InputError.of_file(str(file), f"more than {limit // 1000} kB", f"up to {limit // 1000} kB", remedy)
    if not data.strip():
        raise InputError.of_file(str(file), "an empty file", _WHAT_A_JOB_IS, _REMEDY)
    if b"\0" in data:
        remedy = "save the file as UTF-8 text, or name another"
        raise InputError.of_file(str(file), "NUL bytes, as in a binary file or UTF-16", _WHAT_A_JOB_IS, remedy)
    return data


def _decode(file: Path, data: bytes) -> str:
    """Text of a list of moves."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line_start = data.rfind(b"\n", 0, error.start) + 1
        line = data.count(b"\n", 0, error.start) + 1
        column = len(data[line_start : error.start].decode("utf-8", errors="replace")) + 1
        came = f"the byte 0x{data[error.start]:02X}"
        problem = FileProblem(str(file), line, column, "", came, "UTF-8 text", "save the file as UTF-8")
        raise InputError([problem]) from None


def _decode_text(data: bytes) -> str:
    """Text to print."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")
