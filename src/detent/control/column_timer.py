"""Print timing: fires the columns of a line from the emitter signal.

Position zero is the left frame, which homing leaves in the middle of emitter 0: the edge at which emitter n begins lies
half an emitter left of n. Between two edges the position is extrapolated with the last interval. A wire needs its
flight time to reach the paper, so it is fired early by commanded speed x flight time; what is left when the true speed
differs is the column error. Positions in 1/256 emitter from the left frame, times in microseconds.
"""

from detent.kernel.registers import Registers, i4, i4_array, i8, register, u1, u1_array
from detent.kernel.step import hot_step, step

COLUMNS = 2048
"""Columns of the line buffer: 17 in at 120 per inch."""

HALF_EMITTER = 128
"""How far left of its count an emitter begins [1/256 emitter]."""

AHEAD = 16
"""Columns looked at on an emitter at most, so that no interrupt takes long; the head passes 0.4 of one meanwhile."""

NEVER = 1 << 62


class ColumnTimerParams(Registers):
    """Geometry of the line and lead of the wires."""

    column_zero: i4 = register("carriage position of column 0, 1/256 emitter", unit="emitter/256", range=(0, 0xFFFFFF))
    column_pitch: i4 = register("distance of two columns, 1/256 emitter", unit="emitter/256", range=(1, 0xFFFF))
    lead_per_speed: i4 = register(
        "flight lead per speed value, 1/65536 emitter", unit="emitter/65536", range=(0, 1 << 16)
    )


class LineBuffer(Registers):
    """Two banks of columns: the supervisor fills one while the other prints."""

    ink: u1_array = register("1 where a column is printed; bank 0, then bank 1", length=2 * COLUMNS)
    speed: i4_array = register("speed value the line of each bank was begun with", unit="1/6 in/s", length=2)
    direction: i4_array = register("direction of the line of each bank", length=2)
    turned: i4_array = register("1 if the line of each bank was begun by a turn-around", length=2)


class ColumnTimer(Registers):
    """State of the print timing of the running line."""

    bank: u1 = register("bank of the line buffer that prints", range=(0, 1))
    active: u1 = register("1 while columns of the running line are still to be fired")
    column: i4 = register("next column to fire", range=(0, COLUMNS - 1))
    end_column: i4 = register("last column of the line in the direction of motion", range=(0, COLUMNS - 1))
    lead: i4 = register("flight lead at the commanded speed, 1/256 emitter", unit="emitter/256", range=(0, 0xFFFF))
    fire_us: i8 = register("time at which the next column fires; far future when none is due", unit="us")
    fired: i8 = register("columns printed so far", unit="count")
    missed: i8 = register("inked columns passed without being fired", unit="count")


@step
def start_line(r: ColumnTimer, first: int, last: int, direction: int) -> None:
    """Begin a line whose printable interval runs from column `first` to `last` in the direction of motion."""
    r.column = min(max(first, 0), COLUMNS - 1)
    r.end_column = min(max(last, 0), COLUMNS - 1)
    r.active = 1 if (last - first) * direction >= 0 else 0
    r.fire_us = NEVER


@step
def set_lead(p: ColumnTimerParams, r: ColumnTimer, s: int) -> None:
    """Flight lead for a commanded speed."""
    r.lead = (p.lead_per_speed * s + 128) >> 8


@step
def next_column(r: ColumnTimer) -> None:
    """The present column is done; the line is, behind its last one."""
    r.fire_us = NEVER
    if r.column == r.end_column:
        r.active = 0
    else:
        r.column += 1 if r.column < r.end_column else -1


@hot_step
def schedule(
    p: ColumnTimerParams, r: ColumnTimer, b: LineBuffer, emitter: int, direction: int, now: int, interval: int
) -> None:
    """On an emitter: set the firing time of the next inked column if it lies before the next emitter.

    A column found behind the head (its time passed while the interval was still unknown) is counted as missed.
    """
    edge = emitter * 256 - HALF_EMITTER
    for _ in range(AHEAD):
        if not r.active or r.fire_us != NEVER:
            return
        if b.ink[r.bank * COLUMNS + r.column]:
            ahead = (p.column_zero + r.column * p.column_pitch - edge) * direction - r.lead
            if ahead >= 256:
                return
            if ahead >= 0 and interval > 0:
                r.fire_us = now + ((ahead * interval + 128) >> 8)
                return
            r.missed += 1
        next_column(r)


@step
def fired(r: ColumnTimer) -> None:
    """The due column has been fired."""
    r.fired += 1
    next_column(r)
