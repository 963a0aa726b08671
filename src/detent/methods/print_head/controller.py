"""The controller of the print head: quadrature decoder and axis computer, the wires to the machine, and the mailbox.

One call of `control` is one period of the 25 kHz trigger; firmware calls the same entries from its interrupts.
"""

from collections.abc import Iterable

from detent.control import head_sequence
from detent.control.column_timer import COLUMNS, fired, schedule
from detent.control.head_computer import HeadComputer, HeadParams
from detent.control.head_sequence import decide, next_wake, on_emitter, on_reverse_edge
from detent.control.latch import read_latch, write_latch
from detent.kernel.loop import controls
from detent.kernel.registers import CONTROLLER, PLANT, Registers, block, i2_array, i8, register, u1, u1_array, u2
from detent.kernel.step import hot_step, step
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


@hot_step
def take_emitter(p: HeadParams, c: PrintHeadController, cycle: int, when: int) -> None:
    """A new cycle of the decoder is an emitter interrupt; it also times the columns until the next one."""
    h = c.head
    change = 1 if cycle > c.cycle else -1
    c.cycle = cycle
    on_emitter(p, h, when, change)
    h.wake_us = next_wake(p, h)
    if h.columns.active and change == h.direction:
        line_passed = h.emitter if change > 0 else h.emitter + 1
        schedule(p.columns, h.columns, h.buffer, line_passed, change, when, h.interval_us)


@hot_step
def fire_until(c: PrintHeadController, lines: PrintHeadLines, begin: int, last: int) -> None:
    """Fire the columns due up to `last` [us] in the period that began at `begin`."""
    columns = c.head.columns
    while columns.fire_us <= last:
        k = min(lines.fired, FIRES - 1)
        lines.fired_us[k] = columns.fire_us - begin
        lines.place[k] = columns.bank * COLUMNS + columns.column
        lines.fired = k + 1
        fired(columns, c.head.buffer, c.head.direction)


@hot_step
def take_edge(p: HeadParams, c: PrintHeadController, lines: PrintHeadLines, begin: int, k: int) -> None:
    """Edge `k` of the period that began at `begin`: four are an emitter, and one against the motion may end a stop.

    Only these two change what is due, so the columns due before the edge need not be fired at the others.
    """
    change = count_edge(c.quadrature, lines.levels[k] & 1, lines.levels[k] >> 1)
    cycle = c.quadrature.count >> 2
    if cycle != c.cycle:
        when = begin + lines.when_us[k]
        fire_until(c, lines, begin, when)
        take_emitter(p, c, cycle, when)
    if change == -c.head.direction:
        fire_until(c, lines, begin, begin + lines.when_us[k])
        on_reverse_edge(p, c.head)
        c.head.wake_us = next_wake(p, c.head)


@hot_step
def take_events(p: HeadParams, c: PrintHeadController, lines: PrintHeadLines) -> None:
    """Edges and due columns of the last period, in order of time."""
    begin = c.head.now_us - PERIOD_US
    lines.fired = 0
    for k in range(lines.edges):
        take_edge(p, c, lines, begin, k)
    fire_until(c, lines, begin, begin + PERIOD_US - 1)


@controls(HeadParams)
@hot_step
def control(p: HeadParams, c: PrintHeadController, lines: PrintHeadLines) -> None:
    """One period: what happened in the last one, the computer's turn, and what it puts out."""
    c.head.now_us += PERIOD_US
    take_events(p, c, lines)
    decide(p, c.head)
    lines.count = c.head.out.count
    lines.right_left = c.head.out.right_left
    lines.transition = c.head.out.transition


def power_on(p: HeadParams, c: PrintHeadController, quarter: int, a: int, b: int) -> None:
    """Reset, with the channels at `a` and `b`, which is this quarter of an emitter."""
    c.quadrature.count, c.quadrature.channel_a, c.quadrature.channel_b = quarter, a, b
    c.cycle = 0
    head_sequence.power_on(p, c.head)


@step
def write_command(c: PrintHeadController, byte: int) -> None:
    """The supervisor's side of the command latch; it is free while its flag is 0."""
    write_latch(c.head.command_latch, byte)


@step
def read_status(c: PrintHeadController) -> int:
    """The supervisor's side of the status latch; a byte waits while its flag is 1."""
    return read_latch(c.head.status.latch)


def load_line(c: PrintHeadController, bank: int, inked: Iterable[range]) -> None:
    """Fill a bank of the line buffer: these columns print. Banks alternate with every PRINT, the first is bank 1."""
    ink, base = c.head.buffer.ink, bank * COLUMNS
    ink[base : base + COLUMNS] = [0] * COLUMNS
    for columns in inked:
        ink[base + columns.start : base + columns.stop] = [1] * len(columns)
