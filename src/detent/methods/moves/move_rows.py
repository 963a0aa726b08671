"""What the rows of every file of moves have in common: their keys, the checks of their values, the move they make."""

from collections.abc import Mapping
from pathlib import PurePath

from detent.files.job_rows import EXAMPLE_UNITS, JobRows, check_dwell
from detent.files.job_values import RefusedValueError
from detent.methods.moves.job import Move, MoveJob
from detent.units import QuantityError, parse_quantity

UNITS = {"target": "m", "by": "m", "dwell": "s", "repeat": "", "speed": "m/s", "sample_period": "s"}
"""Unit of each key of a row, behind the border; empty for a count."""

ROTARY_UNITS = UNITS | {"target": "rad", "by": "rad", "speed": "rad/s"}
"""The same for an axis that turns."""

ONE_WAY = "exactly one of target (a place) and by (a way from the place before)"
"""What each row must say."""


def read_quantity(key: str, text: str, units: Mapping[str, str] = UNITS) -> float:
    """Read a number with its unit as the value of a key, in SI units."""
    try:
        value = parse_quantity(text, units[key])
    except QuantityError as error:
        raise RefusedValueError(error.reason, error.allowed, error.remedy) from None
    return check_quantity(key, value, units)


def check_quantity(key: str, value: float, units: Mapping[str, str] = UNITS) -> float:
    """Check the value of a key, in SI units."""
    if key == "dwell":
        return check_dwell(value)
    if key in {"speed", "sample_period"} and value <= 0:
        unit = EXAMPLE_UNITS[units[key]]
        raise RefusedValueError("", f"more than 0 {unit}", "raise it, or leave it out for the axis's own")
    return value


def add_move(rows: JobRows[Move], line: int, values: Mapping[str, float]) -> None:
    """Add the move of a line, once it is known to be whole; values in SI units, by key."""
    move = Move(
        number=1,
        row=line,
        target=values.get("target"),
        by=values.get("by"),
        dwell=values.get("dwell", 0.0),
        speed=values.get("speed"),
        sample_period=values.get("sample_period"),
    )
    rows.add(move, values.get("repeat", 1))


def to_job(rows: JobRows[Move], repeat: int = 1) -> MoveJob:
    """Make the rows a job that does the list `repeat` times."""
    return MoveJob(PurePath(rows.file).name, "moves", rows.written_out(repeat))
