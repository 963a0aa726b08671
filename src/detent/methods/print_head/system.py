"""The print-head axis, wired as its block diagram (print-head specification 2.2).

    command latch -> head computer -> PWM timer, lines -> decoder -> H-bridge -> motor -> belt, carriage, frames
                          ^                                                          |
                          +------------ quadrature decoder <- encoder <--------------+

One tick is one PWM period of 40 us, begun by the 25 kHz trigger. Its order is: sample what the encoder saw during the
last period, decide, actuate, move.
"""

from detent.control.column_timer import LineBuffer, fire, schedule
from detent.control.head_computer import HeadComputer, HeadParams
from detent.control.head_sequence import decide, next_wake, on_emitter, on_reverse_edge, power_on
from detent.drive.h_bridge import Bridge, BridgeLines, steer
from detent.drive.pwm_timer import PwmTimer, trigger
from detent.kernel.loop import ticks
from detent.kernel.registers import Registers, block, f8, i8, register, u1
from detent.kernel.step import hot_step, step
from detent.plant.drive_train import DriveTrain, DriveTrainParams, move_averaged
from detent.plant.push import Push, push_force
from detent.plant.switched_motor import Scratch, SwitchedParams, move_switched
from detent.sensing.encoder import Encoder, EncoderParams, pass_left, pass_right, stand_at
from detent.sensing.quadrature import Quadrature, count_edge

PERIOD_US = 40
TICK = PERIOD_US * 1e-6
"""Base tick [s]."""
AVERAGED, SWITCH_LEVEL = 0, 1


class PrintHeadParams(Registers):
    """Everything about the axis that does not change while it runs."""

    fidelity: u1 = register("0 averaged, 1 switch level")
    supply: f8 = register("true supply of the bridge", unit="V")
    train: DriveTrainParams = block("motor and mechanics")
    encoder: EncoderParams = block("encoder")
    head: HeadParams = block("axis computer")
    push: Push = block("disturbing force")
    switched: SwitchedParams = block("pulse responses of the switch-level fidelity")


class PrintHead(Registers):
    """State of the whole axis."""

    tick: i8 = register("PWM periods since power-on", unit="tick")
    train: DriveTrain = block("motor and carriage")
    sampled: f8 = register("carriage position at the last sample", unit="m")
    encoder: Encoder = block("encoder disc")
    quadrature: Quadrature = block("quadrature decoder")
    cycle: i8 = register("encoder cycle last reported as an emitter", unit="count")
    timer: PwmTimer = block("PWM timer")
    lines: BridgeLines = block("lines the decoder sees")
    bridge: Bridge = block("H-bridge")
    head: HeadComputer = block("axis computer")
    scratch: Scratch = block("work space of the switch-level solution")
    buffer: LineBuffer = block("columns of the running and of the next line")


@hot_step
def edge_time(now: int, start: float, end: float, x: float) -> int:
    """Time at which the carriage passed `x` on its way from `start` to `end` in the last period [whole us]."""
    share = (x - start) / (end - start) if end != start else 0.0
    return now - PERIOD_US + min(max(int(share * PERIOD_US), 0), PERIOD_US - 1)


@step
def take_emitter(p: PrintHeadParams, r: PrintHead, cycle: int, when: int) -> None:
    """A new cycle of the decoder is an emitter interrupt; it also times the columns until the next one."""
    c = r.head
    change = 1 if cycle > r.cycle else -1
    r.cycle = cycle
    on_emitter(p.head, c, r.buffer, when, change)
    c.wake_us = next_wake(p.head, c)
    if c.columns.active and change == c.direction:
        line_passed = c.emitter if change > 0 else c.emitter + 1
        schedule(p.head.columns, c.columns, r.buffer, line_passed, change, when, c.interval_us)


@step
def take_reverse_edge(p: PrintHeadParams, r: PrintHead) -> None:
    """A quadrature edge against the motion: it may end a stop."""
    on_reverse_edge(p.head, r.head, r.buffer)
    r.head.wake_us = next_wake(p.head, r.head)


@step
def fire_column(p: PrintHeadParams, r: PrintHead, start: float, end: float, velocity: float) -> None:
    """Fire the due column with the carriage where it truly was at that moment, counted from edge 0 of the encoder."""
    c = r.head.columns
    share = (c.fire_us - (r.head.now_us - PERIOD_US)) * (1.0 / PERIOD_US)
    x = start + (end - start) * share - p.encoder.origin
    fire(p.head.columns, c, r.buffer, x, velocity, r.head.direction)


@hot_step
def sample(p: PrintHeadParams, r: PrintHead, x: float, velocity: float) -> None:
    """Edges and due columns of the last period, in order of time; the carriage stands at `x` now.

    The time of an edge costs a division, so it is worked out only where a due column or an emitter asks for it.
    """
    now, e = r.head.now_us, r.encoder
    while True:
        rightward = x >= e.next_right
        passed = rightward or x < e.next_left
        edge = e.next_right if rightward else e.next_left
        due = r.head.columns.fire_us
        if due < now and (not passed or due <= edge_time(now, r.sampled, x, edge)):
            fire_column(p, r, r.sampled, x, velocity)
        elif not passed:
            break
        else:
            if rightward:
                pass_right(p.encoder, e)
            else:
                pass_left(p.encoder, e)
            change = count_edge(r.quadrature, e.channel_a, e.channel_b)
            cycle = r.quadrature.count >> 2
            if cycle != r.cycle:
                take_emitter(p, r, cycle, edge_time(now, r.sampled, x, edge))
            if change == -r.head.direction:
                take_reverse_edge(p, r)
    r.sampled = x


@hot_step
def actuate(p: PrintHeadParams, r: PrintHead) -> None:
    """25 kHz trigger: timer and lines take over what the computer put out; the bridge follows."""
    out = r.head.out
    r.timer.count = out.count
    trigger(r.timer)
    changed = r.timer.pulse != r.bridge.pulse or out.right_left != r.lines.right_left
    if changed or out.transition != r.lines.transition:
        r.lines.right_left = out.right_left
        r.lines.transition = out.transition
        steer(r.bridge, r.lines, r.timer.pulse, p.supply)


@hot_step
def move(p: PrintHeadParams, r: PrintHead, train: DriveTrain) -> None:
    """The plant moves through the period."""
    b = r.bridge
    train.force = push_force(p.push, r.tick)
    if p.fidelity == AVERAGED:
        move_averaged(p.train, train, b.mean_positive, b.mean_negative)
    else:
        move_switched(
            p.train, p.switched, train, r.scratch, b.pulse, b.on_positive, b.on_negative, b.off_positive, b.off_negative
        )


@ticks(PrintHeadParams, local="train")
@hot_step
def tick(p: PrintHeadParams, r: PrintHead, train: DriveTrain) -> bool:
    """One PWM period, on `train` of `r`; none while a status byte waits for the supervisor."""
    if r.head.status.latch.flag:
        return False
    r.head.now_us = r.tick * PERIOD_US
    sample(p, r, train.position, train.velocity)
    decide(p.head, r.head, r.buffer)
    actuate(p, r)
    move(p, r, train)
    r.tick += 1
    return True


def switch_on(p: PrintHeadParams, r: PrintHead, position: float, seed: int) -> None:
    """Power-on with the carriage at `position` [m]; `seed` starts the encoder's noise."""
    r.train.position = r.sampled = position
    stand_at(p.encoder, r.encoder, position, seed)
    r.quadrature.count = r.encoder.edge & 3
    r.quadrature.channel_a, r.quadrature.channel_b = r.encoder.channel_a, r.encoder.channel_b
    r.cycle = 0
    power_on(p.head, r.head)
    steer(r.bridge, r.lines, 0, p.supply)
