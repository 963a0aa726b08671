"""Commands that move the axis: what they may ask, and how they begin."""

from detent.control.axis_states import ENABLED
from detent.control.operation import (
    ABORTED,
    BEYOND,
    BUSY,
    CONFIRM,
    GO,
    HOME,
    JOB,
    JOG,
    LAST_POINT,
    LOWER,
    MOVE_BY,
    MOVE_TO,
    NOT_CONFIRMED,
    NOT_ENABLED,
    NOT_FINITE,
    NOT_KNOWN,
    NUMBERED,
    POINT,
    RUN,
    SEEK,
    STREAM_POSITION,
    STREAM_VELOCITY,
    TRAVEL,
    UNREFERENCED,
    WORK,
    Operation,
    OperationParams,
    Request,
    end_running,
    halt,
    is_stream,
    tell,
)
from detent.control.stream import open_stream, point_in_turn, point_now
from detent.kernel.step import hot_step, step

LONGEST_PERIOD = 1.0  # of a stream's interpolation [s]


@step
def why_not_move(q: OperationParams, o: Operation, r: Request) -> int:
    """Reason to refuse a motion."""
    if o.state != ENABLED:
        return NOT_ENABLED
    if q.one_at_a_time and o.running and r.kind != CONFIRM:
        return BUSY
    if o.trust == NOT_KNOWN and (r.kind in (MOVE_TO, GO, JOB) or (is_stream(r.kind) and r.kind != STREAM_VELOCITY)):
        return UNREFERENCED
    if r.kind == JOB and q.careful and not (o.confirmed or q.performs):  # it goes at speeds of its own
        return NOT_CONFIRMED
    if r.kind in (MOVE_TO, MOVE_BY) and not is_allowed(q, o, goal(o, r)):
        return BEYOND
    if is_stream(r.kind) and not 0.5 * q.look < r.value <= LONGEST_PERIOD:
        return NOT_FINITE
    return 0


@hot_step
def is_allowed(q: OperationParams, o: Operation, target: float) -> bool:
    """A target between the ends, or nearer to them than the axis is; without a reference they mean nothing."""
    lowest, highest, here = lower_end(q, o), upper_end(q, o), o.answer.commanded
    if q.endless or o.trust == NOT_KNOWN or lowest <= target <= highest:
        return True
    return here < target < lowest or highest < target < here


@hot_step
def goal(o: Operation, r: Request) -> float:
    """Where a move ends; by a way, from where the commanded point is."""
    return r.value if r.kind == MOVE_TO else o.answer.commanded + r.value


@hot_step
def lower_end(q: OperationParams, o: Operation) -> float:
    """Lower soft limit, or where a hand has moved it since."""
    return o.demand.lowest if o.demand.moved & 1 else q.lowest


@hot_step
def upper_end(q: OperationParams, o: Operation) -> float:
    """Upper soft limit, or where a hand has moved it since."""
    return o.demand.highest if o.demand.moved & 2 else q.highest


@hot_step
def can_move_end(q: OperationParams, o: Operation, r: Request) -> bool:
    """An end moves between the limit of the file and the other end."""
    if r.kind == LOWER:
        return q.lowest <= r.value < upper_end(q, o)
    return lower_end(q, o) < r.value <= q.highest


@step
def begin_motion(q: OperationParams, o: Operation, r: Request) -> None:
    """A motion takes the place of the one under way; a jog that is asked again goes on, at another velocity."""
    if not (r.kind == JOG and o.kind == JOG and o.running == r.id):
        end_running(o, ABORTED, 0, r.id)
    o.client, o.running, o.kind = r.client, r.id, r.kind
    o.within = o.outside = o.halted = 0
    d = o.demand
    d.share = allowed_share(q, o, r.speed)
    if r.kind == JOG:
        o.lease = q.lease_looks
        d.velocity = r.value
        tell(o, RUN)
    elif r.kind == GO:
        d.number = round(r.value)
        tell(o, NUMBERED)
    elif r.kind == HOME:
        tell(o, SEEK)
    elif is_stream(r.kind):
        looks = max(1, round(r.value / q.look))
        open_stream(o.stream, r.kind - STREAM_POSITION + 1, looks, looks * q.look)
        if o.answer.rests == 0:
            halt(o)
    elif r.kind == JOB:
        d.number, d.laid = round(r.value), 0
        o.lease = q.job_looks
        if q.performs == 0:
            tell(o, WORK)
        elif o.answer.rests == 0:
            halt(o)
    else:
        d.target = goal(o, r)
        tell(o, TRAVEL)


@step
def take_set_point(o: Operation, r: Request) -> None:
    """A set-point of the stream that is under way; one of another, or that is no number, is dropped and counted."""
    s = o.stream
    if not is_stream(o.kind) or r.id != o.running or r.client != o.client or not abs(r.value) < 1e12:
        s.dropped += 1
        return
    here = o.answer.commanded if o.kind == STREAM_POSITION else 0.0
    here = o.answer.commanded_velocity if o.kind == STREAM_VELOCITY else here
    if r.kind == POINT:
        point_now(s, r.value, here)
    elif not point_in_turn(s, r.value, here, 1 if r.kind == LAST_POINT else 0):
        s.dropped += 1


@hot_step
def allowed_share(q: OperationParams, o: Operation, asked: float) -> float:
    """Part of the largest speed: less at first and where the position is not known."""
    share = asked
    if o.trust == NOT_KNOWN:
        share = min(share, q.creep)
    if q.careful and not o.confirmed:
        share = min(share, 0.1)
    return share


@step
def move_end(q: OperationParams, o: Operation, r: Request) -> None:
    """An end of the travel moves under the operator's hand; a move that it cuts short is aborted, and rests there."""
    d = o.demand
    if r.kind == LOWER:
        d.lowest, d.moved = r.value, d.moved | 1
    else:
        d.highest, d.moved = r.value, d.moved | 2
    d.edited = 1
    if o.kind in (MOVE_TO, MOVE_BY) and not is_allowed(q, o, d.target):
        end_running(o, ABORTED, 0, r.id)
