"""Pseudo-random register files: the same in plain Python, compiled, and in the C of an export.

Borders, small numbers and neighbours of what was drawn before come more often than chance would have it: that is where
a comparison turns. The stream is the linear congruential generator of 64 bits of Knuth (The Art of Computer
Programming 2, 3.3.4: MMIX), its upper half.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.kernel.compiled import bits_of, byte_at, put_byte
from detent.kernel.compiled_single import single_bits_of
from detent.kernel.image import FNV_PRIME, ImageHash
from detent.kernel.loop import Bytes, run_controller
from detent.kernel.registers import Registers, f8, i8, register
from detent.kernel.step import step

MULTIPLIER, INCREMENT = 6364136223846793005, 1442695040888963407
HIGHEST = (1 << 63) - 1
FEW, LARGE = 8, 64  # elements that are drawn of an array that has more than LARGE
GRID = 1 << 12  # floats are drawn in whole parts of it
OFFSET, SIZE, LENGTH, IS_FLOAT, LO, HI, SPAN = range(7)  # columns of `Places`

Places = NDArray[np.int64]
"""A row for each register that is drawn; `SPAN` is how many integers it may be."""
Ends = NDArray[np.float64]
"""Of the same registers, where they are floats: least, largest, and the value of the axis."""


class Draws(Registers):
    """A stream, and what it gave last."""

    state: i8 = register("state of the generator", unit="code")
    last: i8 = register("whole number that was drawn last", unit="count")
    near: f8 = register("float that was drawn last")


@step
def draw(d: Draws) -> int:
    """32 bits."""
    d.state = d.state * MULTIPLIER + INCREMENT
    return d.state >> 32 & 0xFFFFFFFF


@step
def draw_whole(d: Draws, lo: int, hi: int, span: int) -> int:
    """An integer from `lo` to `hi`."""
    w = draw(d)
    kind = w & 15
    if kind < 2:
        d.last = lo
    elif kind < 4:
        d.last = hi
    elif kind < 7:
        d.last = d.last + (w >> 10 & 3) - 1
    elif kind < 10:
        d.last = (w >> 10 & 31) - 4
    else:
        d.last = draw(d) << 32
        d.last = d.last + draw(d)
        d.last = d.last >> (w >> 4 & 63)
    if d.last < lo or d.last > hi:
        d.last = lo + (d.last & HIGHEST) % span
    return d.last


@step
def draw_real(d: Draws, lo: float, hi: float, given: float) -> float:
    """A float from `lo` to `hi`."""
    w = draw(d)
    kind = w & 15
    value = 0.0
    if kind == 1:
        value = lo
    elif kind == 2:
        value = hi
    elif kind == 3:
        value = d.near
    elif kind == 4:
        value = -d.near
    elif kind == 5:
        value = given
    elif kind == 6:
        value = 1.0
    elif kind > 6:
        value = ((draw(d) >> 6) - GRID * GRID * 2 >> (w >> 4 & 15)) / GRID
    if not lo <= value <= hi:
        value = lo + (hi - lo) * ((w >> 8) / 16777216.0)
    d.near = value
    return value


@step
def store_bytes(r: Any, offset: int, size: int, bits: int) -> None:
    """Write a number in its width."""
    for k in range(size):
        put_byte(r, offset + k, bits >> 8 * k & 0xFF)


@step
def draw_into(d: Draws, r: Any, places: Places, ends: Ends, mask: int) -> None:
    """Draw registers anew: all of them for a `mask` of 0, else one in `mask` + 1."""
    for n in range(places.shape[0]):
        if draw(d) & mask == 0:
            length, size = int(places[n, LENGTH]), int(places[n, SIZE])
            for j in range(FEW if length > LARGE else max(length, 1)):
                k = draw(d) % length if length > LARGE else j
                offset = int(places[n, OFFSET]) + k * size
                if places[n, IS_FLOAT] != 0:
                    value = draw_real(d, float(ends[n, 0]), float(ends[n, 1]), float(ends[n, 2]))
                    store_bytes(r, offset, size, bits_of(value) if size == 8 else single_bits_of(value))
                else:
                    whole = draw_whole(d, int(places[n, LO]), int(places[n, HI]), int(places[n, SPAN]))
                    store_bytes(r, offset, size, whole)


@step
def nudge(d: Draws, r: Any, places: Places) -> None:
    """Move integers a little from where they stand; codes and levels seldom, and to 0 or 1."""
    for n in range(places.shape[0]):
        w = draw(d)
        size, lo = int(places[n, SIZE]), int(places[n, LO])
        if places[n, IS_FLOAT] == 0 and w & (63 if size == 1 else 3) == 0:
            d.last = w >> 8 & 1
            if size > 1:
                d.last = 0
                for k in range(size):
                    d.last = d.last | byte_at(r, int(places[n, OFFSET]) + k) << 8 * k
                if lo < 0 and size < 8 and d.last >> 8 * size - 1 != 0:
                    d.last = d.last - (1 << 8 * size)
                d.last = d.last + (w >> 8) % 5 - 2
            if lo <= d.last <= places[n, HI]:
                store_bytes(r, int(places[n, OFFSET]), size, d.last)


@step
def add_image(h: ImageHash, r: Any, picks: NDArray[np.int64]) -> None:
    """Add these bytes of a register file to a hash."""
    for k in range(picks.shape[0]):
        h.value = (h.value ^ byte_at(r, int(picks[k]))) * FNV_PRIME


@step
def misuse(  # noqa: PLR0913 - a controller, what it is told at random, and what is noted of it
    d: Draws, p: Any, c: Any, lines: Any, wires: Places, ends: Ends, picks: NDArray[np.int64],
    line_picks: NDArray[np.int64], h: ImageHash, low: Bytes, calm: int, *feed: Any,
) -> None:  # fmt: skip
    """As many ticks as `low` has places, for the low byte of the hash after each.

    In a calm stretch the wires move by little, else they jump.
    """
    for k in range(low.shape[0]):
        if calm != 0:
            nudge(d, lines, wires)
        else:
            draw_into(d, lines, wires, ends, 7)
        run_controller(p, c, lines, *feed)
        add_image(h, c, picks)
        add_image(h, lines, line_picks)
        low[k] = h.value & 0xFF
