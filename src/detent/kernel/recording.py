"""The rows of a trace, written inside the compiled loop: the same for every axis.

A row is some bytes of the state at a count (of ticks, of steps) divisible by `every`, in a buffer that its reader
empties before it comes round.
"""

from typing import Any

from detent.kernel.compiled import byte_at
from detent.kernel.step import hot_step


@hot_step
def until_row(count: int, ticks: int, every: int) -> int:
    """Of `ticks` to run from `count` on, those up to the next row; all of them where `every` is 0."""
    return min(ticks, every - count % every) if every > 0 else ticks


@hot_step
def write_row(r: Any, count: int, trace: Any, picks: Any, every: int) -> None:
    """Write the row of this count, if it has one.

    Parameters
    ----------
    r : Registers
        State of an axis.
    count : int
        Ticks or steps so far.
    trace : uint8 array, shape (rows, bytes)
        One row per record; row number ``count // every`` modulo rows.
    picks : int64 array, shape (bytes,)
        Byte offsets in the state that make a row.
    every : int
        Counts between two rows; 0 records nothing.
    """
    if every > 0 and count % every == 0:
        row = (count // every) % trace.shape[0]
        for k in range(picks.shape[0]):
            trace[row, k] = byte_at(r, picks[k])
