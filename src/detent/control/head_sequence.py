"""What the axis computer does next: commands, homing, identification passes, zero speed and faults.

Print-head specification 3.2, 3.3, 3.13 and 4.1.
"""

from detent.control.column_timer import NEVER
from detent.control.feed_forward import steady_drive
from detent.control.head_commands import (
    answer,
    plan_command,
    plan_run,
    plan_waiting,
    receive_byte,
    send_position,
    set_speed,
    take_next,
)
from detent.control.head_computer import (
    BACKWARD,
    CALCULATE,
    DEAD_US,
    FAR,
    FAULT,
    HIGH_ACCEL,
    HIGH_REVERSE,
    HIGH_STEADY,
    HIGH_TRANSITION,
    HOME_LEFT,
    HOME_RIGHT,
    IDLE,
    IMPLAUSIBLE,
    LOW_START,
    LOW_STEADY,
    LOW_STOP,
    LOWEST_FAST_PASS,
    NO_OPERATION,
    NOT_CALIBRATED,
    OBSTRUCTION,
    OK,
    POWER_ON,
    QUEUE,
    REFUSED,
    RUNAWAY_US,
    SET_SPEED,
    SLOWEST_PASS,
    STALL_MARGIN,
    STALL_US,
    WINDOWS,
    HeadComputer,
    HeadParams,
    is_motion,
    line_of,
)
from detent.control.head_motion import (
    begin_move,
    begin_stop,
    forget_drive,
    forget_emitters,
    move_emitter,
    move_timer,
    put_drive,
)
from detent.control.latch import pass_on, send
from detent.control.self_identification import LONGEST, identify
from detent.control.speed_selection import HIGH_SPEED
from detent.kernel.step import bounded, hot_step, step

BREAK_LOOSE_US = 1000
"""Homing without a speed trim: while the head stands, the drive rises one count per millisecond up to the homing limit.
It stands once no emitter has come for the zero-speed time; a drive that rose while it creeps would double its speed."""

FAST_WINDOW_US, SLOW_WINDOW_US = 20_000, 80_000
PASS_FAST_LEFT, PASS_FAST_RIGHT, PASS_SLOW_LEFT, PASS_SLOW_RIGHT = 1, 2, 3, 4
RUNAWAY_EMITTERS = 2
REVERSAL_US = 800
"""Emitter interval from which a reversed encoder sequence is believed: the last one before standstill takes over 1 ms,
and at speed a missing pulse looks like a reversal."""


@step
def stand(p: HeadParams, c: HeadComputer, state: int) -> None:
    """Drive off, the line back in the direction of the move: current left by a reversed drive returns to the supply.

    With the line of the reversed drive it would circulate for milliseconds and push the head back.
    """
    c.drive = 0
    c.state = state
    put_drive(p, c, 0)
    if c.direction != 0:
        c.out.right_left = 1 if c.direction > 0 else 0


@step
@bounded(QUEUE, "commands that wait")
def fault(p: HeadParams, c: HeadComputer, code: int) -> None:
    """Drive off; the running command and all waiting ones are answered with the code."""
    stand(p, c, FAULT)
    c.columns.active = 0
    c.columns.fire_us = NEVER
    c.calibration_pass = 0
    c.homed = 0
    if c.operation != NO_OPERATION:
        send(c.status, code)
    while c.queue.waiting > 0:
        take_next(c)
        answer(c, code)
    c.operation = NO_OPERATION


@step
def begin_homing(p: HeadParams, c: HeadComputer, state: int) -> None:
    """Creep towards a frame (3.2)."""
    c.state = state
    c.direction = -1 if state == HOME_LEFT else 1
    forget_emitters(c)
    c.drive = min(steady_drive(p.slope_default, p.friction_default, p.homing_speed), p.homing_limit)
    c.next_ramp_us = c.now_us + p.zero_speed_us
    put_drive(p, c, c.direction * c.drive)


@step
def begin_calculation(p: HeadParams, c: HeadComputer) -> None:
    """CALCULATE PARAMETERS: default drive values, then homing and the four passes."""
    for direction in (1, -1):
        line = line_of(c, direction)
        line.slope = p.slope_default
        line.friction = p.friction_default
        line.speed_fast = 0
        line.speed_slow = 0
        line.valid = 0
        forget_drive(c, direction)
    c.homed = 0
    c.calibration_pass = 0
    begin_homing(p, c, HOME_LEFT)


@step
def homing_timer(p: HeadParams, c: HeadComputer) -> None:
    """Raise the drive while the head stands; standing for the contact time with drive to spare is contact."""
    if c.next_ramp_us <= c.now_us:
        c.next_ramp_us += BREAK_LOOSE_US
        c.drive = min(c.drive + 1, p.homing_limit)
    put_drive(p, c, c.direction * c.drive)
    if c.now_us - c.last_emitter_us < p.contact_us or c.drive < p.friction_default + STALL_MARGIN:
        return
    if c.state == HOME_LEFT:
        c.emitter = 0
        begin_homing(p, c, HOME_RIGHT)
        return
    c.width = c.emitter
    if c.width < p.expected_width - p.width_tolerance:
        fault(p, c, OBSTRUCTION)
        return
    c.homed = 1
    if p.run_speed < LOWEST_FAST_PASS:
        stand(p, c, IDLE)
        finish(p, c, IMPLAUSIBLE, False)
        return
    begin_pass(p, c, PASS_FAST_LEFT)


@step
def begin_pass(p: HeadParams, c: HeadComputer, number: int) -> None:
    """One identification pass: standard acceleration and stop, constant drive between them."""
    stand(p, c, IDLE)
    c.calibration_pass = number
    c.windows = 0
    c.window_total = 0
    leftward = number in (PASS_FAST_LEFT, PASS_SLOW_LEFT)
    fast = number in (PASS_FAST_LEFT, PASS_FAST_RIGHT)
    plan_run(c, p.calibration_margin if leftward else c.width - p.calibration_margin, c.emitter, p.run_speed)
    c.plan.speed = p.run_speed if fast else HIGH_SPEED
    begin_move(p, c, False)


@step
def begin_windows(c: HeadComputer) -> None:
    """Measuring windows begin with the steady phase, for the slow passes one window later, at settled speed."""
    fast = c.calibration_pass <= PASS_FAST_RIGHT
    c.window_us = c.now_us + (FAST_WINDOW_US if fast else SLOW_WINDOW_US)
    c.windows = 0 if fast else -1
    c.phase_start = c.emitter


@step
def is_creeping(c: HeadComputer) -> bool:
    """The slow pass has taken too long: 240 emitters come in a window at 10 in/s."""
    return c.calibration_pass >= PASS_SLOW_LEFT and c.windows * 240 > SLOWEST_PASS * c.width


@step
def give_up_pass(p: HeadParams, c: HeadComputer) -> None:
    """Stop on the way; without the fast speed there is no line, and the defaults stay."""
    line_of(c, c.direction).speed_fast = 0
    c.window_total = 0
    begin_stop(p, c)


@step
def window_timer(c: HeadComputer) -> None:
    """End of a measuring window: the fast passes keep the last one, the slow ones add up all (3.3)."""
    if c.window_us <= c.now_us:
        passed = (c.emitter - c.phase_start) * c.direction
        c.phase_start = c.emitter
        if c.calibration_pass <= PASS_FAST_RIGHT:
            c.window_us += FAST_WINDOW_US
            total = passed
        else:
            c.window_us += SLOW_WINDOW_US
            total = c.window_total + passed if c.windows >= 0 else 0
        c.window_total = min(max(total, -LONGEST), LONGEST)
        c.windows = min(c.windows + 1, WINDOWS)


@step
def end_pass(p: HeadParams, c: HeadComputer) -> None:
    """Zero speed after a pass: book the measured speed; after the last one compute both lines."""
    line = line_of(c, c.direction)
    number = c.calibration_pass
    if number <= PASS_FAST_RIGHT:
        line.speed_fast = c.window_total
    elif c.windows > 0:
        line.speed_slow = (c.window_total + 2 * c.windows) // (4 * c.windows)
    if number < PASS_SLOW_RIGHT:
        begin_pass(p, c, number + 1)
        return
    c.calibration_pass = 0
    fast = steady_drive(p.slope_default, p.friction_default, p.run_speed)
    slow = steady_drive(p.slope_default, p.friction_default, HIGH_SPEED)
    right = identify(c.right, p.plausible, fast, slow)
    left = identify(c.left, p.plausible, fast, slow)
    finish(p, c, OK if right and left else IMPLAUSIBLE, False)


@step
def finish(p: HeadParams, c: HeadComputer, code: int, turn: bool) -> None:
    """Answer the running command and begin the next one; `turn` allows a turn-around instead of a stop."""
    send(c.status, code)
    c.operation = NO_OPERATION
    begin_next(p, c, turn)


@step
@bounded(QUEUE, "commands that wait")
def begin_next(p: HeadParams, c: HeadComputer, turn: bool) -> None:
    """Execute waiting commands until one moves the head; without one the drive is switched off."""
    while c.queue.waiting > 0:
        take_next(c)
        if is_motion(c.operation):
            if begin_motion(p, c, turn):
                return
        elif c.operation == CALCULATE:
            begin_calculation(p, c)
            return
        elif c.operation == SET_SPEED:
            send(c.status, set_speed(c))
        elif c.operation == REFUSED:
            answer(c, c.start)
        else:
            send_position(c)
        c.operation = NO_OPERATION
    stand(p, c, c.state if c.state in (POWER_ON, FAULT) else IDLE)


@step
def begin_motion(p: HeadParams, c: HeadComputer, turn: bool) -> bool:
    """Begin the running motion command from the present position; False when it was answered without motion."""
    if not c.homed:
        send(c.status, NOT_CALIBRATED)
        return False
    plan_command(p, c, c.operation, c.start, c.end, c.emitter)
    q = c.plan
    if q.code != OK or q.distance == 0:
        send(c.status, q.code)
        return False
    c.repositioning = q.reposition
    if q.reposition:
        c.repositions += 1
    continues = turn and q.speed == c.speed and q.direction == -c.direction
    if not continues:
        stand(p, c, IDLE)
    begin_move(p, c, continues)
    return True


@step
def at_zero_speed(p: HeadParams, c: HeadComputer) -> None:
    """The head has come to rest: next pass, the print after its run back, a turn-around, or the next command."""
    c.columns.active = 0
    c.columns.fire_us = NEVER
    turn = c.state in (HIGH_TRANSITION, HIGH_REVERSE) and c.calibration_pass == 0
    c.expected_stop = c.emitter
    if c.calibration_pass:
        end_pass(p, c)
    elif c.repositioning:
        c.repositioned = 1
        if not begin_motion(p, c, turn):
            c.operation = NO_OPERATION
            begin_next(p, c, False)
    else:
        finish(p, c, OK, turn)


@hot_step
def on_emitter(p: HeadParams, c: HeadComputer, when: int, change: int) -> None:
    """Emitter interrupt: `when` in microseconds, `change` 1 right or -1 left."""
    c.emitter = min(max(c.emitter + change, -FAR), FAR)
    c.interval_us = when - c.last_emitter_us if c.emitter_seen and change == c.last_step else 0
    c.last_emitter_us = when
    c.emitter_seen = 1
    c.last_step = change
    c.too_fast = c.too_fast + 1 if 0 < c.interval_us < RUNAWAY_US else 0
    c.against = c.against + 1 if change != c.direction else 0
    if c.state in (POWER_ON, IDLE, FAULT):
        return
    if c.too_fast >= RUNAWAY_EMITTERS:
        fault(p, c, OBSTRUCTION)
    elif c.state in (LOW_STOP, HIGH_TRANSITION, HIGH_REVERSE):
        if change != c.direction:
            at_zero_speed(p, c)
    elif c.against >= BACKWARD:
        fault(p, c, OBSTRUCTION)
    elif c.state in (HOME_LEFT, HOME_RIGHT):
        c.next_ramp_us = c.now_us + p.zero_speed_us
    else:
        was_accelerating = c.state == HIGH_ACCEL
        move_emitter(p, c)
        if was_accelerating and c.state == HIGH_STEADY and c.calibration_pass:
            begin_windows(c)


@step
def on_reverse_edge(p: HeadParams, c: HeadComputer) -> None:
    """A quadrature edge against the motion: during a stop the head has passed zero speed (3.9)."""
    at_speed = 0 < c.interval_us < REVERSAL_US
    if c.state in (LOW_STOP, HIGH_TRANSITION, HIGH_REVERSE) and not at_speed:
        at_zero_speed(p, c)


@step
def stalled(c: HeadComputer, quiet: int) -> bool:
    """No emitter for 50 ms with drive to spare (7.3), or for a second with any drive."""
    to_spare = abs(c.drive_cmd) > line_of(c, c.direction).friction + STALL_MARGIN
    return quiet >= DEAD_US or (quiet >= STALL_US and to_spare)


@step
def on_timer(p: HeadParams, c: HeadComputer) -> None:
    """Timers that are due in the present state."""
    if c.state in (HOME_LEFT, HOME_RIGHT):
        homing_timer(p, c)
        return
    quiet = c.now_us - c.last_emitter_us
    if c.state in (LOW_STOP, HIGH_TRANSITION, HIGH_REVERSE):
        if quiet >= p.zero_speed_us:
            at_zero_speed(p, c)
            return
    elif stalled(c, quiet):
        fault(p, c, OBSTRUCTION)
        return
    was_accelerating = c.state == HIGH_ACCEL
    if c.calibration_pass and c.state == HIGH_STEADY:
        window_timer(c)
        if is_creeping(c):
            give_up_pass(p, c)
    move_timer(p, c)
    if was_accelerating and c.state == HIGH_STEADY and c.calibration_pass:
        begin_windows(c)


@step
def on_command(p: HeadParams, c: HeadComputer) -> None:
    """Command interrupt; a command that finds the head at rest begins at once."""
    receive_byte(p, c)
    if c.operation == NO_OPERATION:
        if c.queue.waiting > 0:
            begin_next(p, c, False)
    else:
        plan_waiting(p, c)


@step
def forget_commands(c: HeadComputer) -> None:
    """Drop what waits, what of a command has come so far, and what is still to be answered or printed."""
    c.queue.waiting = c.queue.motions = 0
    c.receiver.left = c.command_latch.flag = 0
    c.status.waiting = c.status.latch.flag = 0
    c.columns.active = 0
    c.columns.fire_us = NEVER
    c.calibration_pass = c.repositioning = 0


@step
def halt(p: HeadParams, c: HeadComputer) -> None:
    """An operator's stop: come to rest from whatever the head does now, and answer only the command it was doing.

    It is the stop that ends every move (3.9, 3.12), only earlier: so it takes no longer way than that of its speed.
    """
    if c.state in (HOME_LEFT, HOME_RIGHT):
        c.speed = min(p.homing_speed, HIGH_SPEED - 1)
        begin_stop(p, c)
    elif c.state in (LOW_START, LOW_STEADY, HIGH_ACCEL, HIGH_STEADY):
        if c.state == LOW_START:
            c.drive = c.steady
        begin_stop(p, c)
    forget_commands(c)
    c.wake_us = next_wake(p, c)


@step
def switch_off(p: HeadParams, c: HeadComputer) -> None:
    """Drive off at once, and nothing left to do or to answer; the head rolls out, and is counted on."""
    forget_commands(c)
    c.operation = NO_OPERATION
    stand(p, c, c.state if c.state in (POWER_ON, FAULT) else IDLE)
    c.wake_us = NEVER


@step
def next_wake(p: HeadParams, c: HeadComputer) -> int:
    """Earliest time at which a timer of the present state can be due."""
    if c.state in (POWER_ON, IDLE, FAULT):
        return NEVER
    if c.state in (HOME_LEFT, HOME_RIGHT):
        return min(c.next_ramp_us, c.last_emitter_us + p.contact_us)
    if c.state == LOW_STOP:
        return c.last_emitter_us + p.zero_speed_us
    if c.state in (HIGH_TRANSITION, HIGH_REVERSE):
        return min(c.next_ramp_us, c.last_emitter_us + p.zero_speed_us)
    stall = c.last_emitter_us + STALL_US
    if c.state == LOW_START:
        return stall
    if c.state == HIGH_ACCEL:
        return min(c.next_ramp_us, stall)
    due = min(c.next_trim_us, stall)
    return min(due, c.window_us) if c.calibration_pass else due


@hot_step
def decide(p: HeadParams, c: HeadComputer) -> None:
    """The computer's turn in a tick, after the emitters: command interrupt, timers, status latch."""
    if c.command_latch.flag:
        on_command(p, c)
        c.wake_us = next_wake(p, c)
    if c.now_us >= c.wake_us:
        on_timer(p, c)
        c.wake_us = next_wake(p, c)
    if c.status.waiting > 0:
        pass_on(c.status)


@step
def power_on(p: HeadParams, c: HeadComputer) -> None:
    """State after a reset: default constants, drive off."""
    c.state = POWER_ON
    c.wake_us = NEVER
    c.maximum = p.print_speed
    c.columns.fire_us = NEVER
    c.right.slope = c.left.slope = p.slope_default
    c.right.friction = c.left.friction = p.friction_default


__all__ = ["LOW_STEADY", "decide", "halt", "next_wake", "on_emitter", "on_reverse_edge", "power_on", "switch_off"]
