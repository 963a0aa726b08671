"""Operation of an axis under somebody's hand: states, commands, who commands, and when a command is done.

It stands between those who ask (a panel, a program, a fieldbus; they write `Request`) and the controller of a method,
which is told by `Demand` what to do and says by `Answer` how it is. It is a step of the controller: it knows neither
who sits at the other end of the wires nor what time it is, only looks. `commands` takes what is asked, `move_commands`
the part of it that moves the axis.

A command has an id and ends exactly once: done, aborted by another, refused, or failed. Done means: inside the window
for the window's time while the commanded point rests; a move of no length takes that time, too. Stop and off are
taken in every state, from everybody. A stop raises the epoch: what was asked before it is not done after it.
"""

from detent.control.axis_states import (
    DISABLE_VOLTAGE,
    ENABLED,
    FAULT,
    FAULT_REACTION,
    NOT_READY,
    QUICK_STOP,
    SHUTDOWN,
    SWITCH_ON_DISABLED,
    ordered,
)
from detent.control.reaction import DOUBTS, IN_MOTION, LETS_GO, LOSES, is_among
from detent.control.stream import CLOSED, POSITION, VELOCITY, Stream, advance_stream, is_lost
from detent.kernel.registers import Registers, block, f8, i2_array, i8, i8_array, register, u1, u1_array, u2
from detent.kernel.step import hot_step, step

# ---- what may be asked
(
    ENABLE, OFF, STOP, RESET, MOVE_TO, MOVE_BY, JOG, GO, HOME, KEEP, CONFIRM, TAKE, ORDER, TRUST, LEAVE, JOB, FEED,
    LOWER, UPPER, PAUSE, RESUME, STREAM_POSITION, STREAM_VELOCITY, STREAM_EFFORT, POINT, POINT_IN_TURN, LAST_POINT,
) = COMMANDS = tuple(range(1, 28))  # fmt: skip
COMMAND_NAMES = (
    "enable", "off", "stop", "reset", "move to", "move by", "jog", "go", "home", "keep", "confirm", "take", "order",
    "trust", "leave", "job", "feed", "lower end", "upper end", "pause", "resume", "stream position", "stream velocity",
    "stream effort", "point", "point in turn", "last point",
)  # fmt: skip
STREAMS = STREAM_POSITION, STREAM_VELOCITY, STREAM_EFFORT
POINTS = POINT, POINT_IN_TURN, LAST_POINT  # parts of a stream, under its id: they have no ending of their own
MANAGED = ENABLE, OFF, STOP, RESET, KEEP, CONFIRM, TAKE, ORDER, TRUST, LEAVE  # of every method; the others move it
NEEDS_ID = 1  # smallest id of a command; 0 is none

# ---- how a command ends
DONE, ABORTED, REFUSED, FAILED = range(1, 5)
ENDINGS = ("", "done", "aborted", "refused", "failed")

# ---- why it was refused, or failed; below 100 as in the table of faults, `errors.REFUSAL_TEXT`
NOT_ENABLED, IN_FAULT, NO_FAULT, UNKNOWN, NOT_OFFERED, MOVING, BUSY, UNREADY, NO_JOB, NOT_CONFIRMED = range(101, 111)
NOT_SETTLED, BEYOND, UNREFERENCED, LEASE_LOST, SECOND, STALE, NOT_FINITE = 13, 31, 35, 41, 43, 44, 52

# ---- trust in the position
NOT_KNOWN, RESTORED, REFERENCED = range(3)

# ---- what the method's controller is told to do
REST_OFF, HOLD, TRAVEL, RUN, HALT, SEEK, NUMBERED, WORK, FOLLOW = range(9)

ENDS = 256  # endings that are kept until the host has read them


class Request(Registers):
    """One record of the mailbox."""

    number: i8 = register("place in the sequence of all requests, from 1", unit="count")
    kind: i8 = register("what is asked, `COMMANDS`", unit="code")
    id: i8 = register("of the command, from 1; how it ends is told under it", unit="code")
    epoch: i8 = register("number of stops that whoever asks knows of", unit="count")
    client: i8 = register("who asks", unit="code")
    value: f8 = register("target, way or velocity", unit="m")
    speed: f8 = register("share of the largest speed, above 0 to 1", unit="1")
    check: i8 = register("sum over the record, so that a torn one is seen", unit="code")


class OperationParams(Registers):
    """Times and rules."""

    look: f8 = register("time between two looks", unit="s")
    window_looks: i8 = register("looks inside the window until a command is done", unit="count")
    lease_looks: i8 = register("looks that a jog lives without being kept", unit="count")
    job_looks: i8 = register("looks that a job lives without being kept", unit="count")
    settle_looks: i8 = register("looks at rest outside the window that are a fault; 0 never", unit="count")
    lowest: f8 = register("lower soft limit", unit="m")
    highest: f8 = register("upper soft limit", unit="m")
    endless: u1 = register("1: it turns for ever, and has no limits")
    careful: u1 = register("1: after enabling, a tenth of the speed until confirmed")
    creep: f8 = register("share of the largest speed while the position is not known", unit="1")
    one_at_a_time: u1 = register("1: a move under way must end before another begins")
    takes: i8 = register("what the method offers: a bit per command", unit="code")
    performs: u1 = register("1: the moves of a job are made here; 0: the method does jobs in a way of its own")


class Demand(Registers):
    """What the method's controller is told."""

    do: u1 = register("what to do", unit="code")
    fresh: u1 = register("1 in the look in which that changes")
    target: f8 = register("where to, of a move", unit="m")
    velocity: f8 = register("of a jog", unit="m/s")
    number: i8 = register("position number, or pieces of a job", unit="code")
    share: f8 = register("part of the largest speed that is allowed", unit="1")
    laid: i8 = register("pieces of the job that the host has laid ready", unit="count")
    lowest: f8 = register("lower end, where a hand has moved it", unit="m")
    highest: f8 = register("upper end, where a hand has moved it", unit="m")
    moved: u1 = register("ends that a hand has moved: bit 0 lower, bit 1 upper", unit="code")
    edited: u1 = register("1 in the look in which one has moved")


class Answer(Registers):
    """What the method's controller says."""

    position: f8 = register("as its sensor shows it", unit="m")
    velocity: f8 = register("as its sensor shows it", unit="m/s")
    commanded: f8 = register("commanded point", unit="m")
    commanded_velocity: f8 = register("its velocity", unit="m/s")
    error: f8 = register("commanded point less position", unit="m")
    effort: f8 = register("command to the actuator over its limit", unit="1")
    rests: u1 = register("1 while the commanded point is at rest")
    near: u1 = register("1 while the position is in the window")
    ready: u1 = register("1 once it can be enabled")
    closed: u1 = register("1 while a brake holds it, which is not open yet")
    limited: u1 = register("1 while the command is at its limit")
    fault: u2 = register("fault that has taken its torque away, 0 none", unit="code")
    alone: u1 = register("1 where one sensor counts the way, and nothing else says where the axis is")
    soft: u2 = register("fault of its guard at which the drive goes on, 0 none", unit="code")
    refused: u2 = register("why it does not do what it was told, 0 it does", unit="code")


class Endings(Registers):
    """How commands ended, for the host."""

    count: i8 = register("commands that have ended", unit="count")
    id: i8_array = register("of each of the last ones", length=ENDS, unit="code")
    how: u1_array = register("how each ended", length=ENDS, unit="code")
    why: i2_array = register("reason of a refusal, code of a failure", length=ENDS, unit="code")
    by: i8_array = register("id of the command that aborted it", length=ENDS, unit="code")


class Operation(Registers):
    """How the axis stands, and what it is about."""

    state: u1 = register("state as CiA 402 numbers it here", unit="code")
    epoch: i8 = register("stops so far", unit="count")
    running: i8 = register("id of the command that is under way, 0 none", unit="code")
    kind: u1 = register("what it is", unit="code")
    within: i8 = register("looks in the window, the commanded point at rest", unit="count")
    outside: i8 = register("looks outside it, the commanded point at rest", unit="count")
    lease: i8 = register("looks until an unkept jog or job is stopped", unit="count")
    paused: u1 = register("1 while the job that is under way is held")
    client: i8 = register("who commands, 0 nobody", unit="code")
    fault: u2 = register("first fault since the last reset, 0 none", unit="code")
    confirmed: u1 = register("1 once the first motion since enabling has been confirmed")
    trust: u1 = register("in the position: 0 not known, 1 restored, 2 referenced", unit="code")
    taken: i8 = register("requests taken", unit="count")
    torn: i8 = register("requests whose sum was wrong", unit="count")
    stops: i8 = register("stop lines seen so far", unit="count")
    offs: i8 = register("off lines seen so far", unit="count")
    looks: i8 = register("looks since power-on", unit="count")
    last_stop: f8 = register("way of the last stop", unit="m")
    stop_from: f8 = register("commanded point at the last stop", unit="m")
    opening: u1 = register("1 from switched on, with torque, until its brake is open and it is enabled")
    halted: u1 = register("1 while a stop runs out")
    softly: u1 = register("1 while a fault lets the commanded point come to rest, and hold it")
    barred: u2 = register("why the axis may not be enabled, whatever its method says; 0 it may", unit="code")
    demand: Demand = block("what the method is told")
    answer: Answer = block("what it says")
    stream: Stream = block("set-points that the method follows")
    endings: Endings = block("how commands ended")


# ---------------------------------------------------------------------------------------------------- endings


@step
def end(o: Operation, number: int, how: int, why: int, by: int) -> None:
    """Tell how a command has ended."""
    e = o.endings
    k = e.count % ENDS
    e.id[k], e.how[k], e.why[k], e.by[k] = number, how, why, by
    e.count += 1


@step
def end_running(o: Operation, how: int, why: int, by: int) -> None:
    """End the command that is under way, if one is."""
    if o.running:
        end(o, o.running, how, why, by)
    o.running = o.kind = 0
    o.within = o.outside = o.lease = o.paused = 0


@hot_step
def is_stream(kind: int) -> bool:
    """One of `STREAMS`."""
    return STREAM_POSITION <= kind <= STREAM_EFFORT


@hot_step
def is_point(kind: int) -> bool:
    """One of `POINTS`."""
    return POINT <= kind <= LAST_POINT


@hot_step
def tell(o: Operation, do: int) -> None:
    """Tell the method to do something else."""
    o.demand.do = do
    o.demand.fresh = 1


# ---------------------------------------------------------------------------------------------------- stop and off


@step
def stop(o: Operation, by: int) -> None:
    """Come to rest from the commanded state, and drop what was asked before."""
    o.epoch += 1
    end_running(o, ABORTED, 0, by)
    if o.state == ENABLED:
        halt(o)
    elif o.opening:  # what was asked is not done: it is not enabled
        o.state = ordered(o.state, SHUTDOWN)
        leave_torque(o)


@step
def halt(o: Operation) -> None:
    """The commanded point comes to rest as soon as its limits let it."""
    o.stop_from = o.answer.commanded
    o.halted = 1
    tell(o, HALT)


@step
def off(o: Operation, by: int) -> None:
    """Take the torque away, now."""
    o.epoch += 1
    end_running(o, ABORTED, 0, by)
    o.state = ordered(o.state, DISABLE_VOLTAGE)
    leave_torque(o)


@hot_step
def leave_torque(o: Operation) -> None:
    """No torque: a motion has to be confirmed anew."""
    o.confirmed = o.halted = o.softly = o.opening = 0
    tell(o, REST_OFF)


@step
def fail(o: Operation, code: int) -> None:
    """A fault: the first one stays, the command ends, the method has taken its torque away or is told to."""
    if o.fault == 0:
        o.fault = code
    doubt(o, code)
    end_running(o, FAILED, code, 0)
    o.state = FAULT_REACTION
    leave_torque(o)


@hot_step
def doubt(o: Operation, code: int) -> None:
    """After some faults nobody knows any more where the axis is.

    An axis that does not follow, or an effort at its limit, may be a sensor that counts no more: where that one alone
    counts the way, what it has missed is lost.
    """
    if is_among(code, LOSES) or (o.answer.alone and (code >= IN_MOTION or is_among(code, DOUBTS))):
        o.trust = NOT_KNOWN


@step
def fail_softly(o: Operation, code: int) -> None:
    """A fault that leaves the loop able to steer: the commanded point comes to rest, and is held."""
    if o.state in (ENABLED, QUICK_STOP) or o.opening:
        o.fault, o.softly, o.opening = code, 1, 0
        doubt(o, code)
        end_running(o, FAILED, code, 0)
        o.state = FAULT_REACTION
        halt(o)


@step
def lose_torque(o: Operation, code: int) -> None:
    """A fault that has taken the torque, or that leaves nobody to steer by it; without torque there is none to lose."""
    if o.state in (ENABLED, QUICK_STOP, FAULT_REACTION) or o.opening:
        fail(o, code)


# ---------------------------------------------------------------------------------------------------- a look


@step
def look(o: Operation) -> None:
    """One look before the method's: the drive's own transitions, faults, and the lease of a jog or a job."""
    o.looks += 1
    a = o.answer
    if o.state == NOT_READY:
        o.state = SWITCH_ON_DISABLED
    if o.opening and a.closed == 0:
        o.state, o.opening = ENABLED, 0
        if o.kind == ENABLE:
            end_running(o, DONE, 0, 0)
    if o.state == FAULT_REACTION and (o.softly == 0 or a.rests):
        o.state = FAULT
        if o.softly and is_among(o.fault, LETS_GO):
            leave_torque(o)
    if a.fault and (o.state != FAULT or o.softly):  # its torque has gone, also from where a ramp has led to
        fail(o, a.fault)
    if o.kind in (JOG, JOB) and o.lease > 0:
        o.lease -= 1
        if o.lease == 0:
            end_running(o, FAILED, LEASE_LOST, 0)
            halt(o)
    if is_stream(o.kind):
        lead_along(o)


@step
def lead_along(o: Operation) -> None:
    """One look of a stream: its reference is followed from the first set-point on, to the last one, or to its loss."""
    s, a = o.stream, o.answer
    here = a.commanded if s.quantity == POSITION else (a.commanded_velocity if s.quantity == VELOCITY else s.value)
    advance_stream(s, here)
    if is_lost(s):
        end_running(o, FAILED, LEASE_LOST, 0)
        halt(o)
    elif s.fresh:
        tell(o, FOLLOW)
    elif s.closing == CLOSED and o.demand.do == FOLLOW:
        halt(o)
    s.fresh = 0


@step
def judge(q: OperationParams, o: Operation) -> None:
    """After the method has answered: did it take the demand, and is the command done."""
    a, d = o.answer, o.demand
    was_led = a.refused != 0 and is_stream(o.kind)
    if a.refused:  # in the look in which it was told, or later: a controller may need time to find out
        failed = (o.kind == JOB and q.performs) or (was_led and d.fresh == 0)
        end_running(o, FAILED if failed else REFUSED, a.refused, 0)
    d.fresh = d.edited = 0
    if was_led:
        halt(o)
    if a.soft:
        fail_softly(o, a.soft)
    if not a.rests:
        o.within = 0
        return
    if o.halted:
        o.halted = 0
        o.last_stop = abs(a.commanded - o.stop_from)
    if o.kind == STOP:
        end_running(o, DONE, 0, 0)
    streams = is_stream(o.kind) and o.stream.closing != CLOSED
    if o.running and o.kind != ENABLE and not streams and not (o.kind == JOG and d.velocity != 0.0):
        o.within = o.within + 1 if a.near else 0
        o.outside = 0 if a.near else o.outside + 1
        if o.within >= q.window_looks and not (o.kind == JOB and q.performs):  # there its moves are done one by one
            end_running(o, DONE, 0, 0)
        elif 0 < q.settle_looks <= o.outside:
            fail_softly(o, NOT_SETTLED)
