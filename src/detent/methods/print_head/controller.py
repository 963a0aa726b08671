"""The controller of the print head: quadrature decoder and axis computer, the wires to the machine, and the mailbox.

One call of `control` is one period of the 25 kHz trigger; firmware calls the same entries from its interrupts.
"""

from collections.abc import Iterable

from detent.control import column_timer, head_sequence
from detent.control.column_timer import COLUMNS, schedule
from detent.control.head_computer import HeadComputer, HeadParams
from detent.control.head_sequence import next_wake, on_emitter, on_reverse_edge
from detent.control.latch import read_latch, write_latch
from detent.kernel.loop import controls
from detent.kernel.registers import CONTROLLER, PLANT, Registers, block, i1, i2_array, i8, register, u1, u1_array, u2
from detent.kernel.step import Act, do, hot_step, step
from detent.sensing.quadrature import Quadrature, count_edge

PERIOD_US = 40

EDGES = 64
"""Edges that the lines carry per period: 64 in 40 us are a head at 34 m/s, 33 times the fastest there is."""

FIRES = 4
"""Columns that the lines carry per period: one that was due and one per emitter, of which the third within 40 us is a
fault (`RUNAWAY_US`)."""


class PrintHeadController(Registers):
    """State of the controller."""

    quadrature: Quadrature = block("quadrature decoder")
    cycle: i8 = register("encoder cycle last reported as an emitter", unit="count")
    head: HeadComputer = block("axis computer")


class PrintHeadLines(Registers):
    """Wires between controller and machine; what happened in a period comes with its time."""

    edges: u1 = register("encoder edges in the last period", unit="count", by=PLANT)
    when_us: u1_array = register("when in the period each came", unit="us", length=EDGES, by=PLANT)
    levels: u1_array = register("channels after each, bit 0 A, bit 1 B", unit="code", length=EDGES, by=PLANT)
    count: u2 = register("count register of the PWM timer", unit="count", by=CONTROLLER)
    right_left: u1 = register("direction line, 1 = right", by=CONTROLLER)
    transition: u1 = register("transition line TR", by=CONTROLLER)
    fired: u1 = register("columns fired in the last period", unit="count", by=CONTROLLER)
    fired_us: u1_array = register("when in the period each was fired", unit="us", length=FIRES, by=CONTROLLER)
    place: i2_array = register("which each was: its place in the line buffer", length=FIRES, by=CONTROLLER)


# ---- interrupts: `control` calls them in the order of time, and firmware that has a decoder of its own may, too


@hot_step
def begin(c: PrintHeadController, now_us: i8) -> None:
    """A period begins: the 25 kHz trigger."""
    c.head.now_us = now_us


@hot_step
def emitter(p: HeadParams, c: PrintHeadController, when: i8, change: i1) -> None:
    """A new cycle of the decoder, 1 right or -1 left, at a time [us]; it also times the columns until the next one."""
    h = c.head
    on_emitter(p, h, when, change)
    h.wake_us = next_wake(p, h)
    if h.columns.active and change == h.direction:
        line_passed = h.emitter if change > 0 else h.emitter + 1
        schedule(p.columns, h.columns, h.buffer, line_passed, change, when, h.interval_us)


@hot_step
def reverse(p: HeadParams, c: PrintHeadController) -> None:
    """An edge against the motion, which may end a stop."""
    on_reverse_edge(p, c.head)
    c.head.wake_us = next_wake(p, c.head)


@hot_step
def fired(c: PrintHeadController) -> None:
    """The column that was due at `columns.fire_us` has been fired."""
    column_timer.fired(c.head.columns)


@hot_step
def decide(p: HeadParams, c: PrintHeadController, lines: PrintHeadLines) -> None:
    """The computer's turn in a period, after its events, and what it puts out."""
    head_sequence.decide(p, c.head)
    lines.count = c.head.out.count
    lines.right_left = c.head.out.right_left
    lines.transition = c.head.out.transition


# ---- a period


@hot_step
def fire_until(c: PrintHeadController, lines: PrintHeadLines, since: int, last: int) -> None:
    """Fire the columns due up to `last` [us] in the period that began at `since`."""
    columns = c.head.columns
    if columns.fire_us <= last:  # once: the next one is due by the next emitter
        k = min(lines.fired, FIRES - 1)
        lines.fired_us[k] = columns.fire_us - since
        lines.place[k] = columns.bank * COLUMNS + columns.column
        lines.fired = k + 1
        fired(c)


@hot_step
def take_edge(p: HeadParams, c: PrintHeadController, lines: PrintHeadLines, since: int, k: int) -> None:
    """Edge `k` of the period that began at `since`: four are an emitter, and one against the motion may end a stop.

    Only these two change what is due, so the columns due before the edge need not be fired at the others.
    """
    change = count_edge(c.quadrature, lines.levels[k] & 1, lines.levels[k] >> 1)
    cycle = c.quadrature.count >> 2
    if cycle != c.cycle:
        when = since + lines.when_us[k]
        fire_until(c, lines, since, when)
        step_of_cycle = 1 if cycle > c.cycle else -1
        c.cycle = cycle
        emitter(p, c, when, step_of_cycle)
    if change == -c.head.direction:
        fire_until(c, lines, since, since + lines.when_us[k])
        reverse(p, c)


@hot_step
def take_events(p: HeadParams, c: PrintHeadController, lines: PrintHeadLines) -> None:
    """Edges and due columns of the last period, in order of time."""
    since = c.head.now_us - PERIOD_US
    lines.fired = 0
    for k in range(min(lines.edges, EDGES)):
        take_edge(p, c, lines, since, k)
    fire_until(c, lines, since, since + PERIOD_US - 1)


@controls(HeadParams)
@hot_step
def control(p: HeadParams, c: PrintHeadController, lines: PrintHeadLines) -> None:
    """One period: what happened in the last one, the computer's turn, and what it puts out."""
    begin(c, c.head.now_us + PERIOD_US)
    take_events(p, c, lines)
    decide(p, c, lines)


@step
def power_on(p: HeadParams, c: PrintHeadController, quarter: u1, a: u1, b: u1, periods: int) -> None:
    """Reset, with the channels at `a` and `b`, which is this quarter of an emitter; so many periods have passed."""
    c.quadrature.count, c.quadrature.channel_a, c.quadrature.channel_b = quarter, a, b
    c.cycle = 0
    c.head.now_us = (periods - 1) * PERIOD_US
    head_sequence.power_on(p, c.head)


@step
def write_command(c: PrintHeadController, byte: u1) -> None:
    """The supervisor's side of the command latch; it is free while its flag is 0."""
    write_latch(c.head.command_latch, byte)


@step
def read_status(c: PrintHeadController) -> int:
    """The supervisor's side of the status latch; a byte waits while its flag is 1."""
    return read_latch(c.head.status.latch)


@step
def ink_columns(c: PrintHeadController, bank: u1, first: u2, end: u2, inked: u1) -> None:
    """Columns `first` to below `end` of a bank of the line buffer print, or with `inked` 0 do not."""
    base = COLUMNS if bank else 0
    for k in range(min(first, COLUMNS), min(end, COLUMNS)):
        if c.head.buffer.ink[base + k] != inked:  # a plain loop of stores becomes a call of memset in C
            c.head.buffer.ink[base + k] = inked


def load_line(c: PrintHeadController, bank: int, inked: Iterable[range], act: Act = do) -> None:
    """Fill a bank of the line buffer: these columns print. Banks alternate with every PRINT, the first is bank 1."""
    act(ink_columns, c, bank, 0, COLUMNS, 0)
    for columns in inked:
        act(ink_columns, c, bank, columns.start, columns.stop, 1)
