"""What is asked of an operation: each request is refused, or taken."""

from detent.control.axis_states import (
    ENABLE_OPERATION,
    ENABLED,
    FAULT,
    FAULT_REACTION,
    HALT_QUICKLY,
    QUICK_STOP,
    RESET_FAULT,
    SHUTDOWN,
    SWITCH_ON,
    SWITCHED_ON,
    ordered,
)
from detent.control.move_commands import begin_motion, can_move_end, move_end, take_set_point, why_not_move
from detent.control.operation import (
    ABORTED,
    BEYOND,
    CONFIRM,
    DONE,
    ENABLE,
    FEED,
    GO,
    HOLD,
    HOME,
    IN_FAULT,
    JOB,
    JOG,
    KEEP,
    LAST_POINT,
    LEAVE,
    LOWER,
    MOVE_BY,
    MOVE_TO,
    MOVING,
    NEEDS_ID,
    NO_FAULT,
    NO_JOB,
    NOT_FINITE,
    NOT_OFFERED,
    OFF,
    ORDER,
    PAUSE,
    REFUSED,
    RESET,
    RESUME,
    SECOND,
    STALE,
    STOP,
    TAKE,
    TRUST,
    UNKNOWN,
    UNREADY,
    UPPER,
    Operation,
    OperationParams,
    Request,
    end,
    end_running,
    halt,
    is_point,
    is_stream,
    leave_torque,
    off,
    stop,
    tell,
)
from detent.kernel.compiled import bits_of
from detent.kernel.step import step

SUM = (1 << 62) - 1  # bits that the sum over a request keeps


@step
def sum_of(number: int, kind: int, command: int, epoch: int, client: int, value: float, speed: float) -> int:
    """Sum over a request, each word with an odd factor of its own, so that a torn record is seen."""
    words = number * 3 + kind * 5 + command * 7 + epoch * 11 + client * 13
    first, second = bits_of(value), bits_of(speed)  # folded, for the sum keeps 62 bits
    return (words + (first ^ first >> 32) * 17 + (second ^ second >> 32) * 19) & SUM


@step
def obey(q: OperationParams, o: Operation, r: Request) -> None:
    """Take one request."""
    o.taken += 1
    if r.kind == STOP:
        stop(o, r.id)
        o.running, o.kind = r.id, STOP  # done at rest
        return
    if r.kind == OFF:
        off(o, r.id)
        end(o, r.id, DONE, 0, 0)
        return
    if is_point(r.kind):
        take_set_point(o, r)
        return
    why = why_not(q, o, r)
    if why:
        end(o, r.id, REFUSED, why, 0)
    elif r.kind in (MOVE_TO, MOVE_BY, JOG, GO, HOME, JOB) or is_stream(r.kind):
        begin_motion(q, o, r)
    else:
        manage(q, o, r)
        if r.kind == ENABLE and o.opening:  # done once its brake is open
            end_running(o, ABORTED, 0, r.id)
            o.running, o.kind = r.id, ENABLE
        else:
            end(o, r.id, DONE, 0, 0)


@step
def why_not(q: OperationParams, o: Operation, r: Request) -> int:
    """Reason to refuse a request, 0 for none; stop and off are never refused."""
    if not (1 <= r.kind <= LAST_POINT) or r.id < NEEDS_ID:
        return UNKNOWN
    if not (abs(r.value) < 1e12 and 0.0 < r.speed <= 1.0):  # neither infinite nor no number
        return NOT_FINITE
    if (q.takes >> r.kind & 1) == 0:
        return NOT_OFFERED
    if r.epoch != o.epoch:
        return STALE
    if o.client not in (0, r.client) and r.kind not in (TAKE, PAUSE, RESUME):  # who leads a job waits for its end
        return SECOND
    if r.kind in (TAKE, LEAVE):  # in a fault, too: who takes over may reset
        return 0
    if r.kind == RESET:
        return 0 if o.state == FAULT else NO_FAULT
    return IN_FAULT if o.state in (FAULT, FAULT_REACTION) else why_not_now(q, o, r)


@step
def why_not_now(q: OperationParams, o: Operation, r: Request) -> int:
    """Reason to refuse a request of an axis without a fault, 0 for none."""
    if r.kind in (MOVE_TO, MOVE_BY, JOG, GO, HOME, CONFIRM, JOB) or is_stream(r.kind):
        return why_not_move(q, o, r)
    if r.kind in (LOWER, UPPER):
        return 0 if can_move_end(q, o, r) else BEYOND
    if r.kind in (FEED, PAUSE, RESUME):
        return 0 if o.kind == JOB else NO_JOB
    if r.kind == TRUST and o.state == ENABLED:
        return MOVING
    if r.kind == ENABLE:
        return o.barred or (UNREADY if o.answer.ready == 0 else 0)
    return 0


@step
def manage(q: OperationParams, o: Operation, r: Request) -> None:
    """What is done when it is asked, without motion."""
    if r.kind == ENABLE:
        enable(o)
        o.client = r.client
    elif r.kind == RESET:
        o.state, o.fault = ordered(o.state, RESET_FAULT), 0
        leave_torque(o)
    elif r.kind == KEEP:
        if o.kind in (JOG, JOB):
            o.lease = q.lease_looks if o.kind == JOG else q.job_looks
    elif r.kind in (PAUSE, RESUME):
        o.paused = 1 if r.kind == PAUSE else 0
    elif r.kind == CONFIRM:
        o.confirmed = 1
    elif r.kind in (TAKE, LEAVE):
        hand_over(o, r)
    elif r.kind == TRUST:
        o.trust = round(min(max(r.value, 0.0), 2.0))
    elif r.kind == ORDER:
        take_order(o, round(min(max(r.value, 0.0), 6.0)), r.id)
    elif r.kind == FEED:
        o.demand.laid = round(r.value)
    elif r.kind in (LOWER, UPPER):
        move_end(q, o, r)


@step
def enable(o: Operation) -> None:
    """All the way to operation enabled, if the method is ready; the target is where the axis is."""
    if o.state != ENABLED and o.opening == 0:
        o.state = ordered(ordered(o.state, SHUTDOWN), SWITCH_ON)
        take_torque(o)


@step
def take_torque(o: Operation) -> None:
    """Hold the axis where it is; operation is enabled at once, or where a brake is closed, when it is open."""
    if o.answer.closed and o.state == SWITCHED_ON:
        o.opening = 1
    else:
        o.state = ordered(o.state, ENABLE_OPERATION)
    if o.state == ENABLED or o.opening:
        tell(o, HOLD)


@step
def hand_over(o: Operation, r: Request) -> None:
    """Another one commands, or nobody; a motion under way is stopped first."""
    if (r.kind == TAKE and o.client != r.client) or (r.kind == LEAVE and o.running):
        stop(o, r.id)
    o.client = r.client if r.kind == TAKE else 0


@step
def take_order(o: Operation, order: int, number: int) -> None:
    """One order of the control word of CiA 402."""
    before, opening = o.state, o.opening
    if opening and order in (ENABLE_OPERATION, RESET_FAULT):
        return
    if order == ENABLE_OPERATION and (o.answer.ready == 0 or o.barred):
        return
    if order == ENABLE_OPERATION and before in (SWITCHED_ON, QUICK_STOP):
        take_torque(o)
        return
    o.state = ordered(before, order)
    if order == HALT_QUICKLY and o.state == QUICK_STOP and before == ENABLED:
        o.epoch += 1
        end_running(o, ABORTED, 0, number)
        halt(o)
    elif (before in (ENABLED, QUICK_STOP) or opening) and o.state not in (ENABLED, QUICK_STOP):
        end_running(o, ABORTED, 0, number)
        leave_torque(o)
    if before == FAULT and o.state != FAULT:
        o.fault = 0
        leave_torque(o)
