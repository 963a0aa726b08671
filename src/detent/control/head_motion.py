"""Motion of the print head: what happens on an emitter, on a timer and at zero speed.

Print-head specification 3.5 to 3.13 and 4.1. The computer works in counts and microseconds; the only outputs are the
count register of the PWM timer and the right/left and transition lines.
"""

from detent.control.column_timer import set_lead, start_line
from detent.control.feed_forward import (
    low_speed_start_emitters,
    ramp_interval_us,
    steady_drive,
    stop_distance_up,
    window_reference,
)
from detent.control.head_computer import (
    HIGH_ACCEL,
    HIGH_REVERSE,
    HIGH_STEADY,
    HIGH_TRANSITION,
    LOW_START,
    LOW_STEADY,
    LOW_STOP,
    PRINT,
    HeadComputer,
    HeadParams,
    line_of,
)
from detent.control.speed_selection import HIGH_SPEED
from detent.kernel.step import step

TRIM_US = 16_000
LONG = 1 << 15  # emitter interval [us] that is slow at any speed value: slower than 20000/s, and than 320000/17 s


@step
def put_drive(p: HeadParams, c: HeadComputer, signed: int) -> None:
    """Drive with a signed value; zero keeps the direction line."""
    value = min(max(signed, -p.drive_limit), p.drive_limit)
    c.drive_cmd = value
    c.out.count = abs(value)
    c.out.transition = 0
    if value != 0:
        c.out.right_left = 1 if value > 0 else 0


@step
def put_transition(c: HeadComputer) -> None:
    """Regenerative brake: the modulator is complemented, so the mean terminal voltage stays the drive value (3.12)."""
    c.drive_cmd = c.direction * c.drive
    c.out.count = 300 - c.drive
    c.out.transition = 1
    c.out.right_left = 1 if c.direction > 0 else 0


@step
def steady_value(p: HeadParams, c: HeadComputer, direction: int, s: int) -> int:
    """Kept drive of the same direction and speed in the high-speed class, else the feedforward (3.5).

    A kept drive of another speed is forgotten: the commanded speed of that direction has changed.
    """
    line = line_of(c, direction)
    kept_speed = c.kept_speed_right if direction > 0 else c.kept_speed_left
    kept_drive = c.kept_drive_right if direction > 0 else c.kept_drive_left
    if p.memory and s >= HIGH_SPEED and kept_speed == s and c.calibration_pass == 0:
        return kept_drive
    forget_drive(c, direction)
    return steady_drive(line.slope, line.friction, s)


@step
def forget_drive(c: HeadComputer, direction: int) -> None:
    """Erase the kept drive of a direction."""
    if direction > 0:
        c.kept_speed_right = 0
    else:
        c.kept_speed_left = 0


@step
def keep_drive(c: HeadComputer) -> None:
    """Keep the trimmed drive for the next move of this direction and speed."""
    if c.direction > 0:
        c.kept_speed_right, c.kept_drive_right = c.speed, c.drive
    else:
        c.kept_speed_left, c.kept_drive_left = c.speed, c.drive


@step
def ramp_interval(p: HeadParams, c: HeadComputer, s: int) -> int:
    """Time per count for speed s, with the chosen reading of equation (10)."""
    right = steady_drive(c.right.slope, c.right.friction if p.span_steady else 0, s)
    left = steady_drive(c.left.slope, c.left.friction if p.span_steady else 0, s)
    return ramp_interval_us(right, left, s)


@step
def forget_emitters(c: HeadComputer) -> None:
    """A motion begins: the emitters of the last one say nothing about it."""
    c.last_emitter_us = c.now_us
    c.emitter_seen = 0
    c.interval_us = 0
    c.too_fast = 0
    c.against = 0


@step
def begin_move(p: HeadParams, c: HeadComputer, turn: bool) -> None:
    """Start the planned move, or continue the ramp of the last one when `turn` (3.6, 3.10, 3.13)."""
    old_drive, direction, s = c.drive, c.plan.direction, c.plan.speed
    c.moves += 1
    c.direction, c.speed, c.target, c.expected_stop = direction, s, c.plan.target, c.plan.target
    forget_emitters(c)
    c.phase_start = c.emitter
    c.steady = steady_value(p, c, direction, s)
    if c.operation == PRINT and not c.repositioning:
        begin_line(p, c, turn)
    if s < HIGH_SPEED:
        c.state = LOW_START
        c.start_emitters = min(low_speed_start_emitters(s), c.plan.distance)
        c.drive = line_of(c, direction).friction + p.ir
        put_drive(p, c, direction * c.drive)
        return
    c.state = HIGH_ACCEL
    c.ramp_us = ramp_interval(p, c, s)
    c.ramp_top = min(c.steady + p.ir, p.drive_limit)
    if turn:
        c.turn_arounds += 1
        jump = c.right.friction + c.left.friction if p.friction_jump else 0
        c.drive = jump - old_drive
    else:
        c.drive = line_of(c, direction).friction + p.ir
        c.next_ramp_us = c.now_us + c.ramp_us
    put_drive(p, c, direction * c.drive)


@step
def begin_line(p: HeadParams, c: HeadComputer, turn: bool) -> None:
    """Hand the printable interval of the running PRINT command to the column timer; the next bank prints."""
    zero, pitch = p.columns.column_zero, p.columns.column_pitch
    c.columns.bank = 1 - c.columns.bank
    if c.direction > 0:
        first, last = -((zero - c.start) // pitch), (c.end * 256 - zero) // pitch
    else:
        first, last = (c.start - zero) // pitch, -((zero - c.end * 256) // pitch)
    c.buffer.speed[c.columns.bank] = c.speed
    c.buffer.direction[c.columns.bank] = c.direction
    c.buffer.turned[c.columns.bank] = 1 if turn else 0
    set_lead(p.columns, c.columns, c.speed)
    start_line(c.columns, first, last, c.direction)


@step
def begin_steady(c: HeadComputer, state: int) -> None:
    """Enter a steady phase. The first trim by count needs a whole window, by interval it comes half a period on."""
    c.state = state
    c.drive = c.steady
    c.next_trim_us = c.now_us + (TRIM_US if state == HIGH_STEADY else TRIM_US // 2)
    c.phase_start = c.emitter


@step
def must_stop(c: HeadComputer) -> bool:
    """Stop trigger: what remains is no more than the stop distance (3.4)."""
    return (c.target - c.emitter) * c.direction <= stop_distance_up(c.speed)


@step
def begin_stop(p: HeadParams, c: HeadComputer) -> None:
    """Begin the stop of the running move (3.9, 3.12)."""
    if c.speed < HIGH_SPEED:
        c.state = LOW_STOP
        put_drive(p, c, -c.direction * c.drive)
        return
    if c.state == HIGH_STEADY:
        if c.calibration_pass == 0:
            keep_drive(c)
    else:
        c.drive = c.drive - p.ir  # still accelerating: only the steady part counts
    c.drive = c.drive - p.ir
    c.next_ramp_us = c.now_us + c.ramp_us
    c.state = HIGH_TRANSITION
    put_braking(p, c)


@step
def put_braking(p: HeadParams, c: HeadComputer) -> None:
    """Transition mode while the drive value is above zero, opposite drive after it."""
    if c.drive > 0 and p.transition:
        put_transition(c)
    elif c.drive > 0:
        put_drive(p, c, c.direction * c.drive)
    else:
        c.state = HIGH_REVERSE
        put_drive(p, c, c.direction * c.drive)
        c.out.right_left = 0 if c.direction > 0 else 1


@step
def growing_interval(c: HeadComputer) -> int:
    """Latest emitter interval, or the time since that emitter once it is longer: a head that stands is not fast.

    A longer one than `LONG` compares as that at every speed value, and none is below 0.
    """
    return min(max(c.interval_us, c.now_us - c.last_emitter_us, 0), LONG)


@step
def trim_low(c: HeadComputer) -> None:
    """One count per 16 ms by the latest emitter interval against 20000/s us (3.7)."""
    interval = growing_interval(c)
    if interval * c.speed > 20_000:
        c.drive += 1
    elif 0 < interval * c.speed < 20_000 and c.interval_us > 0:
        c.drive -= 1


@step
def trim_high(c: HeadComputer) -> None:
    """One count per 16 ms by the emitters of the last 16 ms (3.11)."""
    passed = (c.emitter - c.phase_start) * c.direction
    reference = window_reference(c.speed)
    if passed > reference:
        c.drive -= 1
    elif passed < reference:
        c.drive += 1
    c.phase_start = c.emitter


@step
def put_low(p: HeadParams, c: HeadComputer) -> None:
    """Steady low-speed output: half the drive while the interval is below 16/17 of the target (3.8)."""
    fast = c.interval_us > 0 and 17 * growing_interval(c) * c.speed < 320_000
    value = c.drive >> 1 if fast and p.overspeed_test else c.drive
    put_drive(p, c, c.direction * value)


@step
def ramp_up(p: HeadParams, c: HeadComputer) -> None:
    """Counts of the acceleration ramp that are due; at its top the steady phase begins (3.10)."""
    if c.next_ramp_us <= c.now_us and c.drive < c.ramp_top:
        c.drive += 1
        c.next_ramp_us += c.ramp_us
    if c.drive >= c.ramp_top and c.next_ramp_us <= c.now_us:
        begin_steady(c, HIGH_STEADY)
    put_drive(p, c, c.direction * c.drive)


@step
def ramp_down(p: HeadParams, c: HeadComputer) -> None:
    """Counts of the braking ramp that are due (3.12)."""
    if c.next_ramp_us <= c.now_us:
        c.drive -= 1
        c.next_ramp_us += c.ramp_us
    put_braking(p, c)


@step
def speed_reached(c: HeadComputer) -> bool:
    """Second exit of the ramp: a measured emitter interval not above 20000/s us."""
    return 0 < c.interval_us <= LONG and 0 < c.interval_us * c.speed <= 20_000


@step
def steady_timer(p: HeadParams, c: HeadComputer) -> None:
    """Trim at its 16 ms boundaries."""
    if c.next_trim_us <= c.now_us:
        c.next_trim_us += TRIM_US
        if p.trim and c.calibration_pass == 0:
            if c.state == LOW_STEADY:
                trim_low(c)
            else:
                trim_high(c)
        c.drive = min(max(c.drive, 0), p.drive_limit)
    if c.state == LOW_STEADY:
        put_low(p, c)
    else:
        put_drive(p, c, c.direction * c.drive)


@step
def move_emitter(p: HeadParams, c: HeadComputer) -> None:
    """An emitter in the direction of motion during an acceleration or steady phase."""
    if c.state == LOW_START and (c.emitter - c.phase_start) * c.direction >= c.start_emitters:
        begin_steady(c, LOW_STEADY)
    elif c.state == HIGH_ACCEL and speed_reached(c):
        begin_steady(c, HIGH_STEADY)
        put_drive(p, c, c.direction * c.drive)
    if c.state == LOW_STEADY:
        put_low(p, c)
    if c.state != LOW_START and must_stop(c):
        begin_stop(p, c)


@step
def move_timer(p: HeadParams, c: HeadComputer) -> None:
    """Timers of the running move."""
    if c.state == HIGH_ACCEL:
        ramp_up(p, c)
    elif c.state in (HIGH_TRANSITION, HIGH_REVERSE):
        ramp_down(p, c)
    elif c.state in (LOW_STEADY, HIGH_STEADY):
        steady_timer(p, c)
