"""Controller of the rotary table: three clocks, the composition of the angle, and the positioner.

Its clocks are divisions of the base tick: the strobe of the real-time clock, the interrupt a fixed delay later, and the
timer task. What holds the dial, the buttons and the position number is the host.
"""

from detent.control.table_positioner import Positioner, PositionerParams, begin_task, end_task, interrupt
from detent.kernel.loop import controls
from detent.kernel.registers import CONTROLLER, PLANT, Registers, block, i4, i8, register, u1, u4
from detent.kernel.step import hot_step, step
from detent.sensing.angle_composition import AbsoluteAngle, CompositionParams, compose


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


class TableController(Registers):
    """State of the controller."""

    tick: i8 = register("base ticks that it has counted", unit="tick")
    clocks: TableClocks = block("clocks")
    absolute: AbsoluteAngle = block("unit 19")
    positioner: Positioner = block("positioner A")


class TableLines(Registers):
    """Wires between controller and plant."""

    fine: u4 = register("word of comparator 17 at the last strobe", unit="count", by=PLANT)
    coarse: u4 = register("word of comparator 18 at the last strobe", unit="count", by=PLANT)
    strobe: u1 = register("1: both comparators latch at the beginning of the next tick", by=CONTROLLER)
    word: i4 = register("speed register 5, to the D/A converter", unit="count", by=CONTROLLER)
    interrupt: u1 = register("1 in a tick with an interrupt", by=CONTROLLER)


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
        interrupt(p.positioner, c.positioner, c.absolute.theta)
        lines.word, lines.interrupt = c.positioner.s4, 1
    if task:
        end_task(p.positioner, c.positioner)
    clocks.wake = min(clocks.strobe, clocks.interrupt, clocks.task)


@controls(TableControllerParams)
@hot_step
def control(p: TableControllerParams, c: TableController, lines: TableLines) -> None:
    """All that the controller does in a tick: between its clocks it rests."""
    lines.interrupt = 0
    if c.tick == c.clocks.wake:
        serve(p, c, lines)
    c.tick += 1
    lines.strobe = 1 if c.tick == c.clocks.strobe else 0


# ------------------------------------------------------------------------------------------------------ host actions


@step
def power_on(p: TableControllerParams, c: TableController, lines: TableLines, task_at: int) -> None:
    """The first strobe is in the first tick, the first pass of the task at a tick."""
    c.clocks.interrupt, c.clocks.task = p.clocks.delay_ticks, task_at
    c.positioner.z = lines.strobe = 1


@step
def press(c: TableController, direction: int) -> None:
    """Hold a button down: 1 for +, -1 for -."""
    c.positioner.plus, c.positioner.minus = direction > 0, direction < 0


@step
def release(c: TableController) -> None:
    """No button."""
    c.positioner.plus = c.positioner.minus = 0


@step
def set_dial(c: TableController, dial: int) -> None:
    """Turn the speed dial [count/2^f per interrupt]."""
    c.positioner.dial = dial


@step
def start_position(c: TableController, number: int) -> None:
    """Set the position number and start; the next pass of the task takes it."""
    c.positioner.number, c.positioner.start = number, 1


@step
def acknowledge(c: TableController) -> None:
    """The host has seen that the table has come to rest."""
    c.positioner.event = 0
