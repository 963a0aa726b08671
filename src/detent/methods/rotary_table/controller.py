"""Controller of the rotary table: three clocks, the composition of the angle, the positioner, and its guard.

Its clocks are divisions of the base tick: the strobe of the real-time clock, the interrupt a fixed delay later, and the
timer task. What holds the dial, the buttons and the position number is the host.
"""

from detent.control import guard
from detent.control.guard import Guard, GuardParams, await_arrival, enable_guard, is_overdue, watch
from detent.control.table_positioner import (
    Positioner,
    PositionerParams,
    PositionTable,
    begin_task,
    end_task,
    interrupt,
)
from detent.kernel.loop import controls
from detent.kernel.registers import CONTROLLER, PLANT, Fit, Registers, block, i1, i4, i8, register, u1, u4
from detent.kernel.step import hot_step, step
from detent.sensing.resolver_counter import AbsoluteAngle, CompositionParams, compose


class TableClockParams(Registers):
    """Divisions of the base tick."""

    strobe_ticks: i8 = register("period of the strobe", unit="tick")
    delay_ticks: i8 = register("from the strobe to its interrupt, below the strobe's period", unit="tick")
    task_ticks: i8 = register("period of the timer task", unit="tick")


class TableClocks(Registers):
    """When each clock comes next."""

    strobe: i8 = register("tick of the next strobe", unit="tick")
    interrupt: i8 = register("tick of the next interrupt", unit="tick")
    task: i8 = register("tick of the next pass of the timer task", unit="tick")
    wake: i8 = register("the soonest of the three", unit="tick")


class TableControllerParams(Registers):
    """Constants of the controller; the position table may change between two starts."""

    clocks: TableClockParams = block("clocks")
    composition: CompositionParams = block("unit 19")
    positioner: PositionerParams = block("positioner A")
    guard: GuardParams = block("protection")
    look_interrupts: i8 = register("time between two looks of the guard, in interrupts", unit="count")
    following: i8 = register("largest deviation dR that is none to worry about", unit="count/2^f")
    breaking: i8 = register("speed word under which the table must move", unit="count")


class TableController(Registers):
    """State of the controller."""

    tick: i8 = register("base ticks that it has counted", unit="tick")
    clocks: TableClocks = block("clocks")
    absolute: AbsoluteAngle = block("unit 19")
    positioner: Positioner = block("positioner A")
    guard: Guard = block("protection")
    watched: i8 = register("position of record at the last look of the guard", unit="count")
    look: i8 = register("interrupts until its next look", unit="count")


class TableLines(Registers):
    """Wires between controller and plant."""

    fine: u4 = register("word of comparator 17 at the last strobe", unit="count", by=PLANT)
    coarse: u4 = register("word of comparator 18 at the last strobe", unit="count", by=PLANT)
    strobe: u1 = register("1: both comparators latch at the beginning of the next tick", by=CONTROLLER)
    word: i4 = register("speed register 5, to the D/A converter", unit="count", by=CONTROLLER)
    interrupt: u1 = register("1 in a tick with an interrupt", by=CONTROLLER)
    enable: u1 = register("1 lets the amplifier drive the motor", by=CONTROLLER)


@step
def protect(p: TableControllerParams, c: TableController, lines: TableLines) -> None:
    """The guard looks: deviation dR and speed word as they are, way since the last look; a fault switches off."""
    q = c.positioner
    moved = q.angle.position - c.watched
    c.watched, c.look = q.angle.position, p.look_interrupts
    if q.interrupts == 1 or lines.enable == 0:  # the first angle is no way
        return
    late = 1 if abs(q.dr) > p.following else 0
    pushing = 1 if q.s4 >= p.breaking else -1 if q.s4 <= -p.breaking else 0
    limited = 1 if abs(q.s4) >= p.positioner.max_word else 0
    if watch(p.guard, c.guard, late, 0, limited, pushing, moved):
        lines.enable, q.event = 0, 1


@step
def take_interrupt(p: TableControllerParams, c: TableController, lines: TableLines) -> None:
    """Interrupt S8, and what looks after it."""
    interrupt(p.positioner, c.positioner, c.absolute.theta)
    c.look -= 1
    if c.look <= 0:
        protect(p, c, lines)
    if c.guard.awaited and is_overdue(c.guard):
        c.positioner.event = 1
    lines.word, lines.interrupt = c.positioner.s4 if lines.enable else 0, 1


@step
def serve(p: TableControllerParams, c: TableController, lines: TableLines) -> None:
    """A tick in which a clock comes: the interrupt in the middle of the task, where steps 118 and 120 meet."""
    clocks = c.clocks
    if c.tick == clocks.strobe:
        clocks.strobe += p.clocks.strobe_ticks
        compose(p.composition, c.absolute, lines.fine, lines.coarse)
    task = c.tick == clocks.task
    if task:
        clocks.task += p.clocks.task_ticks
        begin_task(p.positioner, c.positioner)
    if c.tick == clocks.interrupt:
        clocks.interrupt += p.clocks.strobe_ticks
        take_interrupt(p, c, lines)
    if task:
        end_task(p.positioner, c.positioner)
    clocks.wake = min(clocks.strobe, clocks.interrupt, clocks.task)


def fit(p: TableControllerParams) -> Fit:
    """How much of its position table an axis uses."""
    entries = max(1, p.positioner.pdt.entries)
    columns = ("angle", "speed", "policy")
    return Fit({(PositionTable, one): entries for one in columns}, {(PositionTable, "entries"): (0, entries)})


@controls(TableControllerParams)
@hot_step
def control(p: TableControllerParams, c: TableController, lines: TableLines) -> None:
    """All that the controller does in a tick: between its clocks it rests."""
    lines.interrupt = 0
    if c.tick == c.clocks.wake:
        serve(p, c, lines)
    c.tick += 1
    lines.strobe = 1 if c.tick == c.clocks.strobe else 0


@step
def power_on(p: TableControllerParams, c: TableController, lines: TableLines, task_at: int) -> None:
    """The first strobe is in the first tick, the first pass of the task at a tick."""
    c.clocks.interrupt, c.clocks.task = p.clocks.delay_ticks, task_at
    c.positioner.z = lines.strobe = lines.enable = 1
    enable_guard(c.guard)


@step
def dial(c: TableController, speed: int) -> None:
    """Set the speed dial [count/2^f per interrupt]."""
    c.positioner.dial = speed


@step
def press(c: TableController, direction: i1) -> None:
    """Hold a button down: 1 for +, -1 for -."""
    c.positioner.plus, c.positioner.minus = direction > 0, direction < 0


@step
def release(c: TableController) -> None:
    """No button."""
    c.positioner.plus = c.positioner.minus = 0


@step
def position(c: TableController, number: u1) -> None:
    """Set the position number and start; the positioner takes it in its next task."""
    c.positioner.number, c.positioner.start = number, 1


@step
def acknowledge(c: TableController) -> None:
    """The host has seen that the table is at rest."""
    c.positioner.event = 0


@step
def arrive_within(c: TableController, strobes: int) -> None:
    """The table must come to rest within so many strobes; 0 lifts it."""
    await_arrival(c.guard, strobes)


@step
def forget_conduct(c: TableController) -> None:
    """A stretch begins that is to be judged for itself."""
    guard.forget_conduct(c.guard)
