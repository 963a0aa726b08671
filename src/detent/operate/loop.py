"""The loop in wall time: one thread of compiled code that sleeps to absolute moments and advances an axis.

Every period it takes what stands in the mailbox, lets the axis's ticks pass with a look of its operation every so many
of them, and writes a row of the ring. A period that comes late by whole periods skips these, and counts them: what was
missed is not made up for, and the next one lies on the grid again. Everything that others see or say lies in one piece
of memory, the `Board`, so that another process can map it.

The same function runs without a wall clock, as fast as it can: what was asked in a live session is done again so, bit
for bit, by handing it the same requests in the same periods.
"""

import math
from typing import Any

from detent.control.commands import obey, sum_of
from detent.control.operation import (
    DONE,
    NEEDS_ID,
    NOT_FINITE,
    REFUSED,
    Operation,
    Request,
    end,
    fail_softly,
    judge,
    look,
    lose_torque,
    off,
    stop,
)
from detent.control.program import Program, perform
from detent.errors import BROKEN, LOOP_DEAD, LOOP_OVERRUN
from detent.kernel.clock import monotonic_ns, sleep_until
from detent.kernel.compiled import byte_at
from detent.kernel.loop import Bytes, Offsets, run_disturbed, run_serve, run_stretch
from detent.kernel.registers import Registers, block, f8, f8_array, i8, i8_array, register, u1
from detent.kernel.step import step
from detent.operate.wires import Wires, give_lines, take_lines
from detent.plant.injection import Injection, begin_injection

INBOX = 1024  # requests that wait at most
AT_ONCE = 64  # of them that are taken in a period
PULLS = 64  # pulls of the stop and off lines that are kept
BINS = 32  # of the histogram of lateness: bin k holds 2^(k-1) to 2^k us, bin 0 less than 1 us
SECOND = 1_000_000_000
MOST_OVERRUNS = 3  # in a second; one more is a fault
LONGEST = 5  # periods that one overrun may last; a longer one is a fault
INJECT = (
    256  # kinds of requests from here on are for a simulated machine: the place times 16, and what goes wrong there
)
NOTES = 16  # faults whose first moment is kept until the host has read it


class Inbox(Registers):
    """Requests by one writer: it fills a place, then counts `written` up; column by column the fields of `Request`."""

    written: i8 = register("requests written", unit="count")
    number: i8_array = register("place in the sequence, from 1", length=INBOX, unit="count")
    kind: i8_array = register("what is asked", length=INBOX, unit="code")
    id: i8_array = register("of the command", length=INBOX, unit="code")
    epoch: i8_array = register("number of stops that whoever asks knows of", length=INBOX, unit="count")
    client: i8_array = register("who asks", length=INBOX, unit="code")
    value: f8_array = register("target, way or velocity", length=INBOX, unit="m")
    speed: f8_array = register("share of the largest speed", length=INBOX, unit="1")
    check: i8_array = register("sum over the record", length=INBOX, unit="code")
    period: i8_array = register("period in which it was taken", length=INBOX, unit="count")


class Loop(Registers):
    """Clock of the loop, how late it was, and the lines that need no mailbox."""

    period: i8 = register("time between two periods", unit="ns")
    ticks: f8 = register("ticks of the axis in a period", unit="tick")
    wall: u1 = register("1 in wall time, 0 as fast as it can")
    leave: u1 = register("1 ends the loop with the period that runs")
    left: u1 = register("1 when it has ended")
    stops: i8 = register("line for stop: counted up by whoever pulls it", unit="count")
    offs: i8 = register("line that takes the torque away: counted up by whoever pulls it", unit="count")
    pulls: i8 = register("pulls of these lines that the loop has seen", unit="count")
    pulled: i8_array = register("period of each of the last; negative of the off line", length=PULLS, unit="count")
    deadline: i8 = register("when the present period was due", unit="ns")
    periods: i8 = register("periods run", unit="count")
    skipped: i8 = register("periods that were never run, since one before them came too late", unit="count")
    overruns: i8 = register("periods that came late by a period or more", unit="count")
    recent: i8_array = register("when the last ones were", length=MOST_OVERRUNS + 1, unit="ns")
    worst: i8 = register("worst lateness", unit="ns")
    late: i8_array = register("periods by lateness: bin k from 2^(k-1) to 2^k us", length=BINS, unit="count")
    work: i8 = register("time that all periods have computed", unit="ns")
    longest: i8 = register("longest of them", unit="ns")
    look: i8 = register("tick of the next look", unit="tick")
    stalls: i8 = register("times that the axis waited for a host that had nothing to say", unit="count")
    delay_at: i8 = register("period that an injected delay comes before; 0 none", unit="count")
    delay: i8 = register("injected delay", unit="ns")
    rows: i8 = register("rows of the ring written", unit="count")
    alive: i8 = register("when the last period began: the heartbeat", unit="ns")
    patience: i8 = register("age of the heartbeat at which the loop is dead; 0: nobody watches it", unit="ns")
    found_dead: i8 = register("line of the watchdog: counted up when it takes the torque away", unit="count")
    found_at: i8 = register("when it last did", unit="ns")
    deaths: i8 = register("pulls of this line that the loop has seen", unit="count")
    died: i8 = register("times that the loop has stood for too long", unit="count")
    broken: u1 = register("line of the host: 1 once a part of the program has ended in an error")


class FaultNotes(Registers):
    """How the axis was in the period in which each of the last faults began."""

    count: i8 = register("faults so far", unit="count")
    present: i8 = register("the one that stands, 0 none", unit="code")
    code: i8_array = register("of each", length=NOTES, unit="code")
    row: i8_array = register("rows of the ring written before", length=NOTES, unit="count")
    period: i8_array = register("period of the loop", length=NOTES, unit="count")
    position: f8_array = register("as its sensor showed it", length=NOTES, unit="m")
    velocity: f8_array = register("as its sensor showed it", length=NOTES, unit="m/s")
    error: f8_array = register("commanded point less position", length=NOTES, unit="m")
    driven: f8 = register("command to the actuator over its limit in the last period", unit="1")
    effort: f8_array = register("that in the period before the fault", length=NOTES, unit="1")
    trust: i8_array = register("in the position afterwards", length=NOTES, unit="code")


class Board(Registers):
    """All that the loop shares with those around it."""

    loop: Loop = block("clock and lines")
    operation: Operation = block("states and commands")
    inbox: Inbox = block("mailbox")
    request: Request = block("the request that is being taken")
    wires: Wires = block("lines that a driver holds")
    simulated: u1 = register("1 where the machine is simulated, and faults can be injected")
    injection: Injection = block("fault between machine and wires")
    faults: FaultNotes = block("faults so far")
    program: Program = block("job that the operation leads")


@step
def take_requests(q: Any, b: Board) -> None:
    """What stands in the mailbox; a torn record is read again in the next period, for its writer is still at it."""
    box, r, o = b.inbox, b.request, b.operation
    most = min(box.written, o.taken + AT_ONCE)
    while o.taken < most:
        k = o.taken % INBOX
        r.number, r.kind, r.id, r.epoch = box.number[k], box.kind[k], box.id[k], box.epoch[k]
        r.client, r.value, r.speed, r.check = box.client[k], box.value[k], box.speed[k], box.check[k]
        found = sum_of(r.number, r.kind, r.id, r.epoch, r.client, r.value, r.speed)
        if found != r.check or r.number != o.taken + 1:
            o.torn += 1
            return
        box.period[k] = b.loop.periods
        if r.kind >= INJECT and b.simulated:
            inject(b)
        else:
            obey(q.operation, o, r)


@step
def inject(b: Board) -> None:
    """Something goes wrong between machine and wires, or nothing any more; the controller is not asked."""
    r, o = b.request, b.operation
    o.taken += 1
    if not abs(r.value) < 1e12 or r.id < NEEDS_ID:
        end(o, r.id, REFUSED, NOT_FINITE, 0)
        return
    begin_injection(b.injection, r.kind - INJECT >> 4, r.kind - INJECT & 15, r.value)
    end(o, r.id, DONE, 0, 0)


@step
def note_fault(b: Board) -> None:
    """How the axis is where a fault begins; the first one stays until it is reset."""
    o, a, n = b.operation, b.operation.answer, b.faults
    if n.present == o.fault:
        n.driven = a.effort
        return
    n.present = o.fault
    if o.fault:
        k = n.count % NOTES
        n.code[k], n.row[k], n.period[k], n.trust[k] = o.fault, b.loop.rows, b.loop.periods, o.trust
        n.position[k], n.velocity[k], n.error[k], n.effort[k] = a.position, a.velocity, a.error, n.driven
        n.count += 1


@step
def see_lines(b: Board) -> None:
    """The lines for stop and off; whoever pulls them counts them up."""
    loop, o = b.loop, b.operation
    if loop.offs != o.offs:
        o.offs = loop.offs
        loop.pulled[loop.pulls % PULLS] = -loop.periods
        loop.pulls += 1
        off(o, 0)
    if loop.stops != o.stops:
        o.stops = loop.stops
        loop.pulled[loop.pulls % PULLS] = loop.periods
        loop.pulls += 1
        stop(o, 0)
    if loop.broken:  # for good: whoever is left might not see what the axis does
        o.barred = BROKEN
        fail_softly(o, BROKEN)


@step
def see_watchdog(b: Board, now: int) -> None:
    """A loop that stood for too long finds itself without torque, whether its watchdog has seen that or not."""
    loop = b.loop
    stood = 0 < loop.patience < now - loop.alive and loop.alive > 0
    if stood or loop.found_dead != loop.deaths:
        loop.deaths = loop.found_dead
        loop.died += 1
        lose_torque(b.operation, LOOP_DEAD)
    loop.alive = now


@step
def look_once(p: Any, r: Any, q: Any, memory: Any, b: Board, *feed: Any) -> None:
    """One look: what is asked and what has happened, what the method makes of it, and whether a command is done."""
    o = b.operation
    look(o)
    run_serve(q, p.controller, r.controller, r.lines, memory, o, *feed)
    judge(q.operation, o)
    perform(q.operation, o, b.program)


@step
def run_period(p: Any, r: Any, q: Any, memory: Any, b: Board, *feed: Any) -> None:
    """Let the axis's ticks of one period pass."""
    loop = b.loop
    loop.periods += 1
    see_lines(b)
    take_requests(q, b)
    due, waited = math.floor(loop.periods * loop.ticks), 0
    while r.tick < due and waited < 2:
        if r.tick >= loop.look:
            loop.look = r.tick + q.look_ticks
            look_once(p, r, q, memory, b, *feed)
        most = min(due, loop.look) - r.tick
        n = run_disturbed(p, r, b.injection, most, *feed) if b.injection.place else run_stretch(p, r, most, *feed)
        waited = 0 if n > 0 else waited + 1
        if n == 0:  # it waits for its host
            look_once(p, r, q, memory, b, *feed)
    if waited == 2:
        loop.stalls += 1
    note_fault(b)


@step
def write_ring(r: Any, b: Board, ring: Bytes, of_board: Offsets, of_axis: Offsets) -> None:
    """One row: bytes of the board, then bytes of the axis; the count goes up when it is whole."""
    row, boards = b.loop.rows % ring.shape[0], of_board.shape[0]
    for k in range(boards):
        ring[row, k] = byte_at(b, of_board[k])
    for k in range(of_axis.shape[0]):
        ring[row, boards + k] = byte_at(r, of_axis[k])
    b.loop.rows += 1


@step
def note_lateness(b: Board, late: int) -> None:
    """Count a period by how late it came, skip what it has missed, and tell a loop that cannot keep its time."""
    loop = b.loop
    loop.worst = max(loop.worst, late)
    us, k = late // 1000, 0
    while us > 0 and k < BINS - 1:
        us >>= 1
        k += 1
    loop.late[k] += 1
    missed = late // loop.period
    if missed < 1:
        return
    loop.skipped += missed
    loop.deadline += missed * loop.period
    k = loop.overruns % (MOST_OVERRUNS + 1)
    loop.overruns += 1
    before = loop.recent[(k + 1) % (MOST_OVERRUNS + 1)]
    loop.recent[k] = loop.deadline
    often = loop.overruns > MOST_OVERRUNS and loop.deadline - before < SECOND
    if often or late > LONGEST * loop.period:
        fail_softly(b.operation, LOOP_OVERRUN)


@step
def wait_for_period(b: Board) -> int:
    """Sleep to the next moment of the grid; gives the time at which the period begins [ns]."""
    loop = b.loop
    loop.deadline += loop.period
    moment = loop.deadline
    if loop.delay_at and loop.periods + 1 >= loop.delay_at:
        moment += loop.delay
        loop.delay_at = 0
    if loop.wall == 0:
        return moment
    now = monotonic_ns()
    while now < moment and sleep_until(moment) in (0, 4):  # a signal wakes it early: EINTR
        now = monotonic_ns()
    return now


@step
def run_loop(  # noqa: PLR0913 - an axis, how it is operated, and who sees it
    p: Any, r: Any, q: Any, memory: Any, b: Board, ring: Bytes, of_board: Offsets, of_axis: Offsets, most: int,
    *feed: Any,
) -> int:  # fmt: skip
    """Run periods until told to leave, `most` of them at most; gives how many."""
    loop, done = b.loop, 0
    if loop.wall and loop.deadline == 0:
        loop.deadline = monotonic_ns()
    while done < most and loop.leave == 0:
        now = wait_for_period(b)
        see_watchdog(b, now)
        note_lateness(b, now - loop.deadline)
        if b.wires.driven:
            take_lines(b.wires, b.operation, r.lines, now)
        run_period(p, r, q, memory, b, *feed)
        if b.wires.driven:
            give_lines(b.wires, b.operation, r.lines)
        write_ring(r, b, ring, of_board, of_axis)
        done += 1
        if loop.wall:
            spent = monotonic_ns() - now
            loop.work += spent
            loop.longest = max(loop.longest, spent)
    loop.left = loop.leave
    return done
