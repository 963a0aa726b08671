"""What the cells of a text table say: numbers, moments, truth values, or that there is none."""

import re
from collections.abc import Sequence
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from detent.logs.raw_table import LARGEST_EXACT

# Texts, in small letters, with which programs say that there is no value.
MISSING = frozenset({"", "-", "--", "?", "na", "n/a", "nan", "-nan", "null", "none", "nil", "inf", "-inf", "+inf"})
_WORDS = {"true": 1.0, "false": 0.0, "on": 1.0, "off": 0.0}
_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:[.,][0-9]*)?|[.,][0-9]+)(?:[eEdD][+-]?[0-9]{1,3})?")
_MOMENT = re.compile(
    r"([0-9]{4}-[0-9]{2}-[0-9]{2})[T ]([0-9]{2}:[0-9]{2}:[0-9]{2}(?:[.,][0-9]{1,9})?)(?:Z|[+-][0-9:]{4,6})?"
)


def is_number(cell: str) -> bool:
    """True for a cell that is a number, with a decimal point or comma, or a truth value."""
    return _NUMBER.fullmatch(cell) is not None or cell.lower() in _WORDS


def is_moment(cell: str) -> bool:
    """True for a cell that is a date with a time of day, such as ``2024-10-26T12:23:27.5``."""
    return _MOMENT.fullmatch(cell) is not None


def read_cell(cell: str, decimal: str) -> float | None:
    """Number of one cell: NaN where it says nothing, None where it is no number.

    >>> read_cell("1,5", ","), read_cell("n/a", ","), read_cell("1.2.3", ",")
    (1.5, nan, None)
    """
    if cell.lower() in MISSING:
        return np.nan
    if cell.lower() in _WORDS:
        return _WORDS[cell.lower()]
    if not _NUMBER.fullmatch(cell) or ("," in cell and decimal != ","):
        return None
    # Fortran writes double precision with a D.
    return float(cell.replace(",", ".").replace("D", "e").replace("d", "e"))


def read_column(cells: Sequence[str], decimal: str) -> tuple[NDArray[np.float64] | NDArray[np.int64], set[int]]:
    """Numbers of a piece of a column, and the indices of the cells that are no numbers (NaN there)."""
    # Whole numbers beyond what a float holds exactly stay whole numbers.
    try:
        values = np.array(cells, dtype=np.float64)
    except ValueError:
        found = [read_cell(cell, decimal) for cell in cells]
        wrong = {index for index, value in enumerate(found) if value is None}
        values = np.array([np.nan if value is None else value for value in found])
        return values, wrong
    if len(values) and np.all(np.abs(values) > LARGEST_EXACT):
        with suppress(ValueError, OverflowError):
            return np.array([int(cell) for cell in cells], dtype=np.int64), set()
    return values, set()


def read_moments(cells: Sequence[str]) -> tuple[NDArray[np.datetime64], set[int]]:
    """Moments of a piece of a column of dates, their difference to UTC left out, and the indices of what is none."""
    found = [_MOMENT.fullmatch(cell) for cell in cells]
    texts = [f"{match[1]}T{match[2].replace(',', '.')}" if match else "NaT" for match in found]
    try:
        return np.array(texts, dtype="datetime64[ns]"), {index for index, match in enumerate(found) if match is None}
    except ValueError:  # a month 13, or a year beyond what nanoseconds can count
        return np.full(len(cells), np.datetime64("NaT"), dtype="datetime64[ns]"), set(range(len(cells)))
