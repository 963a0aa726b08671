"""Byte protocol, command queue and the planning of a move (print-head specification 3.1, 3.4)."""

from detent.control.feed_forward import run_up, stop_distance_up
from detent.control.head_computer import (
    BYTES,
    CONTROLLED_RUN,
    ILLEGAL,
    LARGEST_END,
    NO_OPERATION,
    OK,
    OUT_OF_RANGE,
    OVERRUN,
    POSITION_HIGH,
    PRINT,
    QUEUE,
    REFUSED,
    SET_SPEED,
    HeadComputer,
    HeadParams,
    is_motion,
)
from detent.control.head_motion import forget_drive
from detent.control.latch import ROOM, read_latch, send
from detent.control.speed_selection import FLOOR, HALVINGS, fits, select_speed, slower
from detent.kernel.step import bounded, step

ACKNOWLEDGE = 0xFF
SLOWEST, FASTEST = 18, 240
RUN_UP_RESERVE = 12
"""Emitters that a run back leaves beyond the run-up: more than a stop misses its target by, 11 at most."""

CODES = (0x8D, 0x92, 0x99, 0xA2, 0x01, 0x40, 0x41)
"""First bytes, in the order of the operations from PRINT on."""


@step
def operation_of(first: int) -> int:
    """Operation of a first byte; REFUSED when it is none."""
    operation = PRINT
    for code in CODES:
        if code == first:
            return operation
        operation = min(operation + 1, REFUSED)
    return REFUSED


@step
def enqueue(c: HeadComputer, operation: int, start: int, end: int) -> None:
    """Append a command; a second waiting motion command, or one that finds the queue full, is refused as overrun.

    A refusal waits too, so that answers keep the order of the commands: the last place counts those of a full queue.
    """
    if c.queue.waiting >= QUEUE:
        k = (c.queue.first + QUEUE - 1) & (QUEUE - 1)
        c.queue.end[k] = min(c.queue.end[k] + 1, LARGEST_END)
        return
    if c.queue.waiting == QUEUE - 1 or (is_motion(operation) and c.queue.motions > 0):
        operation, start, end = REFUSED, OVERRUN, 0
    k = (c.queue.first + c.queue.waiting) & (QUEUE - 1)
    c.queue.operation[k] = operation
    c.queue.start[k] = start
    c.queue.end[k] = end
    c.queue.waiting += 1
    if is_motion(operation):
        c.queue.motions += 1


@step
def take_next(c: HeadComputer) -> None:
    """Make the oldest waiting command the running one."""
    k = c.queue.first
    c.operation = c.queue.operation[k]
    c.start = c.queue.start[k]
    c.end = c.queue.end[k]
    c.repositioned = 0
    c.repositioning = 0
    c.queue.first = (k + 1) & (QUEUE - 1)
    c.queue.waiting -= 1
    if is_motion(c.operation):
        c.queue.motions -= 1


@step
def answer(c: HeadComputer, code: int) -> None:
    """Answer the running command, which may be several refused ones."""
    times = 1 + c.end if c.operation == REFUSED else 1
    for _ in range(min(times, ROOM)):
        send(c.status, code)
    c.status.lost += max(times - ROOM, 0)


@step
def decode_command(c: HeadComputer) -> None:
    """The bytes of a command are complete: decode and queue it."""
    r = c.receiver
    operation = operation_of(r.buffer[0])
    start, end = 0, 0
    if operation == PRINT:
        start = (r.buffer[1] << 16) | (r.buffer[2] << 8) | r.buffer[3]
        end = (r.buffer[4] << 8) | r.buffer[5]
    elif is_motion(operation):
        end = (r.buffer[1] << 8) | r.buffer[2]
    elif operation == SET_SPEED:
        end = r.buffer[1]
    elif operation == REFUSED:
        start = ILLEGAL
    enqueue(c, operation, start, end)


@step
def receive_byte(p: HeadParams, c: HeadComputer) -> None:
    """Command interrupt: collect the byte, acknowledge it, and decode when the announced number has come."""
    r = c.receiver
    byte = read_latch(c.command_latch)
    if r.left == 0:
        r.count = 0
        r.left = byte & 7 if byte & 0x80 else 0
        if byte & 0x80 and r.left == 0:
            enqueue(c, REFUSED, ILLEGAL, 0)  # multi-byte with no data bytes
            return
    else:
        r.left -= 1
    r.buffer[min(r.count, BYTES - 1)] = byte
    r.count += 1
    if r.left > 0 or (p.ack_last and r.count > 1):
        send(c.status, ACKNOWLEDGE)
    if r.left == 0:
        decode_command(c)


@step
def set_speed(c: HeadComputer) -> int:
    """SET SPEED: a new value erases the kept drives of both directions (3.5)."""
    s = c.end
    if s < SLOWEST or s > FASTEST:
        return OUT_OF_RANGE
    if s != c.maximum:
        forget_drive(c, 1)
        forget_drive(c, -1)
    c.maximum = s
    return OK


@step
def send_position(c: HeadComputer) -> None:
    """POSITION HIGH latches both halves and sends the upper one; POSITION LOW sends the other."""
    if c.operation == POSITION_HIGH:
        c.latched_position = c.emitter
        send(c.status, c.latched_position >> 8)
    else:
        send(c.status, c.latched_position & 0xFF)


@step
def plan_run(c: HeadComputer, target: int, origin: int, maximum: int) -> None:
    """Direction, speed and target of a run."""
    q = c.plan
    q.code = OK if 0 <= target <= c.width else OUT_OF_RANGE
    q.reposition = 0
    q.direction = 1 if target >= origin else -1
    q.target = target
    q.distance = abs(target - origin)
    q.speed = select_speed(q.distance, maximum)


@step
def print_distance(c: HeadComputer, start: int, end: int, origin: int, s: int) -> int:
    """Distance a print at speed s would cover: from the head if its run-up suffices, else from after a run back."""
    direction = 1 if end >= start else -1
    stop = stop_distance_up(s)
    if (start - origin) * direction >= run_up(s) or c.repositioned:
        return abs(end + direction * stop - origin)
    return abs(end - start) + run_up(s) + RUN_UP_RESERVE + stop


@step
@bounded(HALVINGS, "halves a speed value of 16 bits")
def plan_print(p: HeadParams, c: HeadComputer, start: int, end: int, origin: int) -> None:
    """Print from `start` to `end`, crossed in the steady state: stop beyond the end, run-up before the start (3.4)."""
    q = c.plan
    s = c.maximum
    while s > FLOOR and not fits(print_distance(c, start, end, origin, s), s):
        s = slower(s, c.maximum)
    q.distance = print_distance(c, start, end, origin, s)
    q.speed = s
    q.direction = 1 if end >= start else -1
    q.target = end + q.direction * stop_distance_up(s)
    q.reposition = 0
    q.code = OK if 0 <= q.target <= c.width else OUT_OF_RANGE
    if q.code != OK or c.repositioned or (start - origin) * q.direction >= run_up(s):
        return
    back = start - q.direction * (run_up(s) + RUN_UP_RESERVE)
    at_frame = min(max(back, 0), c.width)
    if (start - at_frame) * q.direction < run_up(s):
        q.code = OUT_OF_RANGE
        return
    plan_run(c, at_frame, origin, p.run_speed)
    q.reposition = 1


@step
def plan_command(p: HeadParams, c: HeadComputer, operation: int, start: int, end: int, origin: int) -> None:
    """Work out a motion command from the position the head will start at."""
    if operation == PRINT:
        plan_print(p, c, start >> 8, end, origin)
    elif operation == CONTROLLED_RUN:
        plan_run(c, end, origin, min(c.maximum, p.run_speed))
    else:
        plan_run(c, end, origin, p.run_speed)


@step
def plan_waiting(p: HeadParams, c: HeadComputer) -> None:
    """While moving: plan the waiting motion command from the expected stop of the running one (test 32)."""
    operation = c.operation
    if operation == NO_OPERATION or c.queue.motions == 0:
        return
    repositioned = c.repositioned
    c.repositioned = 0
    for n in range(c.queue.waiting):
        k = (c.queue.first + n) & (QUEUE - 1)
        if is_motion(c.queue.operation[k]):
            plan_command(p, c, c.queue.operation[k], c.queue.start[k], c.queue.end[k], c.expected_stop)
    c.repositioned = repositioned
