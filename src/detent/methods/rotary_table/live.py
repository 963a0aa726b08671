"""The rotary table under somebody's hand: its buttons and dial, its position numbers; it turns for ever."""

from collections.abc import Callable
from functools import partial
from typing import Any

from detent.control.guard import FOLLOWING, JUMPED, NO_ARRIVAL, OVERSPEED, SATURATED, STUCK, enable_guard
from detent.control.operation import (
    GO,
    HALT,
    HOLD,
    HOME,
    JOG,
    MOVE_TO,
    NUMBERED,
    REFERENCED,
    REST_OFF,
    RUN,
    SEEK,
    TRAVEL,
    Operation,
    OperationParams,
)  # fmt: skip
from detent.control.reaction import SOFT
from detent.control.table_positioner import HOLD as STANDS
from detent.control.table_positioner import MOVE, SHORTEST, STOPPING, braking_path, set_out
from detent.errors import DetentError
from detent.kernel.loop import serves
from detent.kernel.registers import Registers, block, f8, i8, register
from detent.kernel.step import step
from detent.methods.method import Leg, Live
from detent.methods.rotary_table.build import GUARD_PERIOD
from detent.methods.rotary_table.controller import TableController, TableControllerParams, TableLines
from detent.methods.rotary_table.faults import places
from detent.methods.rotary_table.host import TableHost
from detent.methods.rotary_table.schema import RotaryTableSpec
from detent.methods.rotary_table.sequence_job import Go, Jog, SequenceJob, Wait

BUSY = 201  # reason to refuse, `errors.REFUSAL_TEXT`


class TableLiveParams(Registers):
    """How it is operated."""

    operation: OperationParams = block("times and limits")
    look_ticks: i8 = register("ticks between two looks", unit="tick")
    count: f8 = register("angle of the table per count", unit="rad")
    dial: f8 = register("word of the dial per speed of the table", unit="count.s/rad")
    speed: f8 = register("largest speed of the table", unit="rad/s")
    seconds: f8 = register("time between two looks", unit="s")


class TableLive(Registers):
    """What it remembers."""

    position: i8 = register("position of record at the last look", unit="count")
    number: i8 = register("starts refused up to the last look", unit="count")


@step
def halt(p: TableControllerParams, c: TableController) -> None:
    """No button; a positioning ends where its interpolated target can stop, by whole counts: C stays where it is."""
    r = c.positioner
    r.plus = r.minus = r.start = 0
    if r.state == MOVE:
        f = p.positioner.interpolator.fraction
        spare = (r.interpolator.irr - braking_path(p.positioner.interpolator, r.interpolator)) >> f
        spare = max(spare, 0)
        r.interpolator.irr -= spare << f
        r.oar -= r.z * spare
        r.state = STOPPING


@step
def hold_back(q: TableLiveParams, c: TableController, o: Operation) -> None:
    """A number has a speed of its own: from the look after its start on no more of it than is allowed."""
    if o.demand.do == NUMBERED and o.demand.share < 1.0:
        c.positioner.limit = min(c.positioner.limit, round(q.speed * o.demand.share * q.dial))


@serves(TableLiveParams)
@step
def serve(  # noqa: PLR0913 - as all of its kind
    q: TableLiveParams, p: TableControllerParams, c: TableController, lines: TableLines, memory: TableLive, o: Operation
) -> None:
    """One look."""
    d, a, r = o.demand, o.answer, c.positioner
    r.event = 0
    a.refused = 0
    if r.refused != memory.number:
        memory.number = r.refused
        a.refused = 200 + r.reason
    if d.fresh:
        if d.do == REST_OFF:
            halt(p, c)
            lines.enable = 0
        elif d.do == HOLD:  # held where it is
            r.state, r.oar, r.interpolator.irr, r.interpolator.speed = STANDS, r.angle.aar, 0, 0
            enable_guard(c.guard)
            lines.enable = 1
        elif d.do == RUN and d.velocity != 0.0:
            r.dial = round(min(abs(d.velocity), q.speed * d.share) * q.dial)
            r.plus, r.minus = (1, 0) if d.velocity > 0.0 else (0, 1)
        elif d.do == NUMBERED:
            r.number, r.start = d.number, 1
        elif d.do == SEEK and r.state == STANDS:  # its resolvers show where in the turn it stands
            o.trust = REFERENCED
        elif d.do in (TRAVEL, SEEK) and r.state != STANDS:
            a.refused = BUSY
        elif d.do == TRAVEL:
            set_out(p.positioner, r, round(d.target / q.count), SHORTEST, round(q.speed * d.share * q.dial))
        elif d.do in (RUN, HALT):
            halt(p, c)
    hold_back(q, c, o)
    place = r.angle.position
    a.position = place * q.count
    a.velocity = (place - memory.position) * q.count / q.seconds
    memory.position = place
    left = r.interpolator.irr / (1 << p.positioner.interpolator.fraction)
    a.error = (r.oar - r.angle.aar - r.z * left) * q.count
    a.commanded = a.position + a.error
    a.commanded_velocity = r.z * r.interpolator.speed / q.dial
    a.effort = r.s4 / p.positioner.max_word
    a.limited = 1 if abs(r.s4) >= p.positioner.max_word else 0
    a.rests = 1 if r.state == STANDS and r.start == 0 and r.plus == r.minus else 0
    a.near = 1 if abs(r.oar - r.angle.aar) <= p.positioner.window else 0
    a.ready = 1 if r.interrupts > 0 else 0
    a.fault = a.soft = 0
    if d.do != REST_OFF:
        a.soft = c.guard.code if lines.enable and c.guard.code != NO_ARRIVAL else 0
        a.fault = c.guard.hard if lines.enable == 0 else 0


def sequence_legs(speed: float, job: SequenceJob) -> list[Leg]:
    """The steps of a sequence, repeats written out; live there are no signals, so that none may be asked for."""
    legs: list[Leg] = []
    for _, one in job.actions():
        if isinstance(one, Go):
            legs.append(Leg(GO, one.number))
        elif isinstance(one, Jog) and one.duration is not None:
            legs.append(Leg(JOG, one.direction * (one.speed or speed), one.speed, one.duration))
        elif isinstance(one, Wait) and one.duration is not None:
            legs.append(Leg(0, seconds=one.duration))
        else:
            got = f"{job.name}, line {one.row}: got the signal {one.signal!r}"
            raise DetentError(
                f"{got}; expected, live: go, wait and jog for a time, for there are no signals; leave it out, or "
                "simulate it with: detent run"
            )
    return legs


def live(spec: RotaryTableSpec, operation: Callable[..., OperationParams]) -> dict[str, Live]:
    """The table at power-on, to be operated."""
    host = TableHost(spec)
    strobe = spec.method.strobe_period
    q = TableLiveParams(count=spec.count, dial=spec.per_interrupt(1.0), speed=spec.limits.speed, seconds=strobe)
    q.look_ticks = round(strobe / host.machine.tick)
    q.operation = operation(strobe, spec.method.in_position_time, (0.0, 0.0), JOG, GO, MOVE_TO, HOME)
    q.operation.endless = 1
    machine: Any = host.machine
    machine.params.controller.guard.softly = SOFT
    table, speed = spec.protection, spec.limits.speed
    limits = {STUCK: table.stuck_effort, SATURATED: 1.0, FOLLOWING: table.following_error,
              OVERSPEED: table.overspeed * speed, JUMPED: table.jump * speed * GUARD_PERIOD}  # fmt: skip
    made = Live(
        machine.params, machine.state, q, TableLive(), machine.tick, "rad", speed,
        spec.limits.acceleration, {"title": "Dial"},
        fault=lambda: host.failure, legs=partial(sequence_legs, speed), numbers=frozenset(map(int, spec.position)),
        places=places(spec, strobe),
        limits=limits,
    )  # fmt: skip
    return {"": made}
