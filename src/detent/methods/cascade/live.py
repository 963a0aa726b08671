"""The cascade axis under somebody's hand: a course of limited jerk leads it, sample by sample."""

from collections.abc import Callable
from typing import Any

import numpy as np

from detent.control.guard import FOLLOWING, JUMPED, OVERSPEED, SATURATED, STUCK
from detent.control.guard import TRAVEL as END_OF_TRAVEL
from detent.control.homing import FAILED, FOUND, GIVE_WAY, IDLE, Homing, HomingParams, Seen, begin, is_pressed, seek
from detent.control.homing import HALT as HALT_NOW
from detent.control.homing import RUN as RUN_AT
from detent.control.operation import (
    BEYOND,
    FOLLOW,
    HALT,
    HOLD,
    HOME,
    JOG,
    MOVE_BY,
    MOVE_TO,
    NOT_KNOWN,
    REFERENCED,
    REST_OFF,
    RUN,
    SEEK,
    STREAMS,
    TRAVEL,
    Operation,
    OperationParams,
)  # fmt: skip
from detent.control.reaction import SOFT
from detent.control.stream import EFFORT, POSITION, Stream
from detent.control.supervision import DISAGREE, SWINGS
from detent.errors import DRIVEN_OFF, TOO_FAR
from detent.kernel.loop import lay_ready, serves
from detent.kernel.registers import Registers, block, f8, i8, register
from detent.kernel.step import step
from detent.methods.cascade.build import homing_params, motion_limits
from detent.methods.cascade.controller import (
    OPEN,
    CascadeController,
    CascadeControllerParams,
    CascadeLines,
    close_loops,
    engage,
    open_loops,
)
from detent.methods.cascade.faults import places
from detent.methods.cascade.host import CascadeHost
from detent.methods.cascade.run import describe_cause
from detent.methods.cascade.schema import CascadeSpec
from detent.methods.cascade.system import rest_off
from detent.methods.method import Live
from detent.methods.moves.legs import legs_of
from detent.planning.course import (
    Course,
    CourseLimits,
    advance,
    begin_at,
    come_to_rest,
    drift,
    follow,
    go_to,
    is_at_rest,
    run_at,
)
from detent.sensing.position_sensor import PositionSensor, position_of, shift_positions


class CascadeLiveParams(Registers):
    """How it is operated."""

    operation: OperationParams = block("times and limits")
    look_ticks: i8 = register("ticks between two looks", unit="tick")
    period: f8 = register("time between two samples", unit="s")
    course: CourseLimits = block("what a motion may do")
    homing: HomingParams = block("how it finds its reference")
    settled: f8 = register("position error that counts as in position", unit="m")


class CascadeLive(Registers):
    """What leads the axis."""

    limits: CourseLimits = block("limits of the present motion")
    course: Course = block("the commanded point")
    homing: Homing = block("how far the search for the reference has come")
    seen: Seen = block("what the last look of it saw")


@step
def set_limits(q: CascadeLiveParams, c: CascadeController, memory: CascadeLive, o: Operation) -> None:
    """Limits of a motion: its share of the speed; no ends while nobody knows where they are, but off a limit switch."""
    m = memory.limits
    m.speed, m.acceleration, m.jerk = q.course.speed * o.demand.share, q.course.acceleration, q.course.jerk
    m.lowest, m.highest = q.course.lowest, q.course.highest
    if o.trust == NOT_KNOWN:
        m.lowest, m.highest = -1e9, 1e9
    if c.supervision.side > 0:
        m.highest = memory.course.position
    elif c.supervision.side < 0:
        m.lowest = memory.course.position


@step
def refer(c: CascadeController, memory: CascadeLive, way: float, o: Operation) -> None:
    """The reference has been found: all positions are by a way elsewhere than was thought, and nothing moves."""
    shift_positions(c.motor_sensor, way)
    shift_positions(c.load_sensor, way)
    begin_at(memory.course, memory.course.position + way)
    o.trust = REFERENCED


@step
def search(  # noqa: PLR0913 - as `serve`, and where the axis is
    q: CascadeLiveParams, p: CascadeControllerParams, c: CascadeController, lines: CascadeLines, memory: CascadeLive,
    here: PositionSensor, o: Operation,
) -> int:  # fmt: skip
    """One look of a homing; gives why it has failed, 0 while it has not."""
    h, s, d = memory.homing, memory.seen, o.demand
    s.position, s.ahead = here.position, memory.course.position - here.position
    s.rests, s.switch, s.marks = 1 if is_at_rest(memory.course) else 0, lines.home.switch, lines.home.marks
    mark = position_of(p.motor_sensor, c.motor_sensor, lines.home.mark)
    s.mark = here.position + (mark - c.motor_sensor.position)
    if d.fresh:
        o.trust = NOT_KNOWN
        set_limits(q, c, memory, o)
        told = begin(q.homing, h, s)
    else:
        told = seek(q.homing, h, s)
    if told == RUN_AT:
        top = memory.limits.speed
        h.velocity = min(max(h.velocity, -top), top)
        run_at(memory.limits, memory.course, h.velocity)
    elif told in (HALT_NOW, FAILED):
        come_to_rest(memory.limits, memory.course)
    if told == GIVE_WAY or (told == FAILED and is_pressed(h, s)):
        begin_at(memory.course, here.position)
        c.law.integral = 0.0
    elif told == FOUND:
        refer(c, memory, q.homing.place - h.latched, o)
    return h.code if told == FAILED else 0


@step
def lead(q: CascadeLiveParams, c: CascadeController, memory: CascadeLive, o: Operation) -> int:
    """What is freshly demanded; gives a reason to refuse it, 0 for none."""
    d, why = o.demand, 0
    if c.on == OPEN and not (d.do == FOLLOW and o.stream.quantity == EFFORT):
        close_loops(c)
    if d.do == REST_OFF:
        c.on = 0
    elif d.do == HOLD:
        engage(c)
    elif d.do == TRAVEL:
        set_limits(q, c, memory, o)
        why = go_to(memory.limits, memory.course, d.target)
    elif d.do == RUN:
        set_limits(q, c, memory, o)
        top = memory.limits.speed
        why = run_at(memory.limits, memory.course, min(max(d.velocity, -top), top))
    elif d.do == HALT:
        come_to_rest(memory.limits, memory.course)
    elif d.do == FOLLOW:
        set_limits(q, c, memory, o)
        if o.stream.quantity == POSITION and abs(o.stream.slope) > memory.limits.speed:
            return TOO_FAR
    return BEYOND if why else 0


@step
def go_along(  # noqa: PLR0913 - as `serve`
    q: CascadeLiveParams, p: CascadeControllerParams, c: CascadeController, memory: CascadeLive, here: PositionSensor,
    s: Stream,
) -> int:  # fmt: skip
    """One sample along a stream; gives why it goes on no longer, 0 while it does."""
    limits, course, period, rate = memory.limits, memory.course, q.period, 0.0
    if s.quantity == POSITION:
        rate = s.bend if follow(limits, course, s.value, s.slope, period) else 0.0
    elif s.quantity != EFFORT:
        rate = s.slope if follow(limits, course, course.position + s.value * period, s.value, period) else 0.0
    elif drift(limits, course, here.position, here.velocity, period):
        open_loops(c, min(max(s.value, -1.0), 1.0) * p.law.max_command)
    else:
        come_to_rest(limits, course)
        advance(limits, course, period)
        c.reference.acceleration = course.acceleration
        return DRIVEN_OFF
    c.reference.acceleration = min(max(rate, -limits.acceleration), limits.acceleration)
    return 0


@serves(CascadeLiveParams)
@step
def serve(  # noqa: PLR0913 - as all of its kind
    q: CascadeLiveParams, p: CascadeControllerParams, c: CascadeController, lines: CascadeLines, memory: CascadeLive,
    o: Operation, *_feed: Any,
) -> None:  # fmt: skip
    """One look, before a sample: the next point of the course."""
    a, course, before = o.answer, memory.course, c.on
    here = c.load_sensor if p.feedback.position_on_load else c.motor_sensor
    c.event = 0
    a.refused = lead(q, c, memory, o) if o.demand.fresh else 0
    if o.demand.do == SEEK and (o.demand.fresh or memory.homing.phase != IDLE):
        a.refused = search(q, p, c, lines, memory, here, o)
    elif o.demand.fresh:
        memory.homing.phase = IDLE
    c.known = 0 if o.trust == NOT_KNOWN else 1
    if c.on == 0 or before == 0:  # the commanded point is where the axis is
        begin_at(course, here.position)
    if o.demand.do == FOLLOW and a.refused == 0:
        a.refused = go_along(q, p, c, memory, here, o.stream)
    else:
        advance(memory.limits, course, q.period)
        c.reference.acceleration = course.acceleration
    c.reference.position, c.reference.velocity = course.position, course.velocity
    a.position, a.velocity = here.position, here.velocity
    a.commanded, a.commanded_velocity = course.position, course.velocity
    a.error = course.position - here.position
    a.effort = c.law.command / p.law.max_command if c.on else 0.0
    a.limited = c.law.limited
    a.rests = 1 if is_at_rest(course) and memory.homing.phase == IDLE else 0
    a.near = 1 if abs(a.error) <= q.settled else 0
    a.ready = 1
    a.closed = 1 if p.brake.present and (c.on == 0 or c.brake.left > 0) else 0
    driven = o.demand.do != REST_OFF
    a.fault = c.guard.hard if c.on == 0 and driven else 0
    a.soft = c.guard.code if c.on and driven else 0


def live(spec: CascadeSpec, operation: Callable[..., OperationParams]) -> dict[str, Live]:
    """The axis at power-on, its drive off, to be operated."""
    return {"": live_of(CascadeHost(spec), operation)}


def live_of(host: CascadeHost, operation: Callable[..., OperationParams]) -> Live:
    """The axis of a host."""
    spec, limits = host.spec, motion_limits(host.spec)
    rest_off(host.params, host.state)
    host.params.controller.guard.softly = SOFT
    q, memory = CascadeLiveParams(look_ticks=host.sample_ticks, period=host.period), CascadeLive()
    q.settled = host.params.controller.limits.window
    ends = spec.limits.lowest, spec.highest
    motions = MOVE_TO, MOVE_BY, JOG, *STREAMS, *(() if spec.home is None else (HOME,))
    q.operation = operation(host.period, host.params.controller.limits.arrival * host.period, ends, *motions)
    if spec.home is not None:
        q.homing = homing_params(spec, spec.home)
    jerk = limits.jerk if limits.jerk < 1e12 else 0.0
    q.course = CourseLimits(
        speed=limits.speed, acceleration=limits.acceleration, jerk=jerk, lowest=ends[0], highest=ends[1]
    )
    memory.limits = q.course
    host.feed = (lay_ready(np.zeros(0)),) * 4  # what leads the axis is in its memory

    def fault() -> str:
        return describe_cause(host) if host.controller.guard.code else ""

    return Live(
        host.params, host.state, q, memory, host.tick, spec.unit("m"), spec.limits.speed,
        spec.limits.acceleration, {"title": "Cascade loop"}, host.feed, fault, legs=legs_of,
        places=places(spec, host.params, host.period), limits=guard_limits(spec),
    )  # fmt: skip


def guard_limits(spec: CascadeSpec) -> dict[int, float]:
    """What the guard compares with, by the number of the fault."""
    table, speed = spec.protection, max(spec.limits.speed, spec.method.velocity_limit)
    found = {
        STUCK: table.stuck_effort,
        FOLLOWING: spec.method.following_error,
        SATURATED: 1.0,
        END_OF_TRAVEL: spec.highest,
    }
    found |= {DISAGREE: table.slip, SWINGS: table.oscillation}
    return found | {OVERSPEED: table.overspeed * speed, JUMPED: table.jump * speed * spec.method.sample_period}
