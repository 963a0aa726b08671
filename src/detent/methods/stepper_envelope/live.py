"""A stepper under somebody's hand: every motion is a deflection, and the table decides how fast it may be anywhere.

A move is a deflection towards a stop at its target, a jog one towards the end of the travel; released, the motor comes
down its ramp. The stops lie in the tables, which the loop reads and writes in the same thread: they are edited in a
look, between two steps, and so no step finds half of an edit and a session repeats itself bit for bit.
"""

import math
from collections.abc import Callable, Sequence
from functools import partial

from detent.axisfile.blocks import homing_params
from detent.control.guard import FOLLOWING
from detent.control.guard import TRAVEL as END_OF_TRAVEL
from detent.control.homing import FAILED, FOUND, IDLE, ON, Homing, HomingParams, Seen, begin, is_under_way, seek
from detent.control.homing import HALT as HALT_NOW
from detent.control.homing import RUN as RUN_AT
from detent.control.move_commands import lower_end, upper_end
from detent.control.operation import (
    HALT,
    HOLD,
    HOME,
    JOG,
    LOWER,
    MOVE_BY,
    MOVE_TO,
    NOT_KNOWN,
    REFERENCED,
    REST_OFF,
    RUN,
    SEEK,
    TRAVEL,
    UPPER,
    Operation,
    OperationParams,
)  # fmt: skip
from detent.control.step_rule import AT_REST, FAULT, INFEASIBLE, OUT_OF_RANGE, REST, deflect, release
from detent.control.step_table import StepTableParams, move_stop
from detent.errors import STEP_FAULT_TEXT, DetentError
from detent.kernel.loop import serves
from detent.kernel.registers import Registers, block, f8, i4, i8, register, u1
from detent.kernel.step import step
from detent.methods.method import Leg, Live
from detent.methods.stepper_envelope.build import instant
from detent.methods.stepper_envelope.controller import (
    Entries,
    StepperController,
    StepperControllerParams,
    StepperLines,
)
from detent.methods.stepper_envelope.faults import places
from detent.methods.stepper_envelope.host import StageMotor
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec
from detent.methods.stepper_envelope.stage_job import StageJob, StageJog
from detent.planning.step_envelope import INDEX_BITS, StepEnvelope

LOOK = 1e-3  # time between two looks [s]
FAULTS = 240  # faults of the step rule: their cause on top of it
SLOWEST = 1.0  # step frequency that any deflection asks for at least [Hz]


class StepperLiveParams(Registers):
    """How a motor is operated."""

    operation: OperationParams = block("times and limits")
    look_ticks: i8 = register("ticks between two looks", unit="tick")
    step: f8 = register("travel per step", unit="m")
    lower: f8 = register("position of the first step", unit="m")
    speed: f8 = register("largest speed", unit="m/s")
    last: i4 = register("last index of the ramp", unit="count")
    up: StepTableParams = block("table of the way up")
    down: StepTableParams = block("table of the way down")
    homing: HomingParams = block("how it finds its reference")


class StepperLive(Registers):
    """What it remembers."""

    goal: i8 = register("where the present deflection leads", unit="count")
    up_stop: i8 = register("stop of the table up", unit="count")
    down_stop: i8 = register("stop of the table down", unit="count")
    jogs: u1 = register("1 while the goal is the end of the travel, wherever that is")
    word: i4 = register("word that is asked for", unit="count")
    overruns: i8 = register("ends that were moved nearer than the motor could stop", unit="count")
    homing: Homing = block("how far the search for the reference has come")
    seen: Seen = block("what the last look of it saw")
    shift: i8 = register("steps by which a search has moved its place in the tables, to have room", unit="count")


@step
def end_of(q: StepperLiveParams, o: Operation, heading: int) -> int:
    """Last step boundary inside the travel; where the position is not known, that of the table."""
    if o.trust == NOT_KNOWN:
        return q.up.steps if heading > 0 else 0
    if heading > 0:
        return math.floor((upper_end(q.operation, o) - q.lower) / q.step + 1e-6)
    return math.ceil((lower_end(q.operation, o) - q.lower) / q.step - 1e-6)


@step
def nearest_stop(c: StepperController) -> int:
    """First place at which the motor can stop: an index a step."""
    return c.rule.position + c.rule.direction * max(c.rule.index, 0)


@step
def word_of(p: StepperControllerParams, hz: float) -> int:
    """The fastest word of a frequency that is not above it (`step_timer.word_within`)."""
    if p.timer.reload:
        return math.ceil(p.timer.clock_hz / max(hz, SLOWEST) - 1e-9)
    return math.floor(max(hz, SLOWEST) + 1e-9)


@step
def aim(  # noqa: PLR0913 - a motor and its tables
    q: StepperLiveParams, p: StepperControllerParams, c: StepperController, memory: StepperLive, o: Operation,
    heading: int, up: Entries, down: Entries,
) -> None:  # fmt: skip
    """Deflect towards the goal, from wherever and however fast the motor is, no farther than the end of the travel.

    Where it is too fast for that, or beyond the end already, it comes to rest as soon as it can.
    """
    end, nearest = end_of(q, o, heading), nearest_stop(c)
    if memory.jogs or (memory.goal - end) * heading > 0:
        memory.goal = end
        if (end - nearest) * heading < 0:
            memory.goal = nearest
            memory.overruns += o.demand.edited
    if c.rule.index < 0 and memory.goal == nearest:
        release(c.rule)
        return
    if heading > 0:
        move_stop(q.up, up, memory.up_stop, memory.goal)
        memory.up_stop = memory.goal
    else:
        move_stop(q.down, down, memory.down_stop, memory.goal)
        memory.down_stop = memory.goal
    deflect(p.rule, c.rule, memory.word, q.last, heading)


@step
def set_out(
    q: StepperLiveParams, p: StepperControllerParams, c: StepperController, memory: StepperLive, o: Operation
) -> int:
    """Goal and word of a move or a jog; gives the direction in which it begins, or goes on."""
    d, speed = o.demand, q.speed * o.demand.share
    memory.jogs = 1 if d.do == RUN else 0
    if memory.jogs:
        memory.word = word_of(p, min(abs(d.velocity), speed) / q.step)
        return 1 if d.velocity > 0.0 else -1
    memory.word = word_of(p, speed / q.step)
    memory.goal = min(max(round((d.target - q.lower) / q.step), 0), q.up.steps)
    way = memory.goal - nearest_stop(c)
    return c.rule.direction if way == 0 else 1 if way > 0 else -1


@step
def is_pending(c: StepperController, memory: StepperLive) -> bool:
    """A deflection that still has a way to go, though the motor may stand: it is about to start, or turns."""
    rule = c.rule
    stop = memory.up_stop if rule.heading > 0 else memory.down_stop
    return rule.manual == 1 and rule.request >= 0 and rule.state != FAULT and (stop - rule.position) * rule.heading > 0


@step
def search(  # noqa: PLR0913 - as `serve`
    q: StepperLiveParams, p: StepperControllerParams, c: StepperController, lines: StepperLines, memory: StepperLive,
    o: Operation, up: Entries, down: Entries,
) -> int:  # fmt: skip
    """One look of a homing; gives why it has failed, 0 while it has not."""
    h, s, rule = memory.homing, memory.seen, c.rule
    s.rests = 0 if rule.index >= 0 or is_pending(c, memory) else 1
    if o.demand.fresh:
        memory.shift = 0
    s.position, s.switch = q.lower + (rule.position - memory.shift) * q.step, lines.home.switch
    if o.demand.fresh:
        o.trust = NOT_KNOWN
        told = begin(q.homing, h, s)
    else:
        told = seek(q.homing, h, s)
    if told == RUN_AT or (told == ON and s.rests and is_under_way(h)):
        heading = 1 if h.velocity > 0.0 else -1
        if s.rests:  # nobody knows where in its tables it is: it takes all the room that they have
            room = 0 if heading > 0 else q.up.steps
            memory.shift += room - rule.position
            rule.position = room
        memory.jogs, memory.word = 1, word_of(p, min(abs(h.velocity), q.speed * o.demand.share) / q.step)
        aim(q, p, c, memory, o, heading, up, down)
    elif told in (HALT_NOW, FAILED):
        let_go(c, memory)
    elif told == FOUND:
        place = round((q.homing.place + s.position - h.latched - q.lower) / q.step)
        rule.position = memory.goal = min(max(place, 0), q.up.steps)
        o.trust = REFERENCED
    return h.code if told == FAILED else 0


@step
def let_go(c: StepperController, memory: StepperLive) -> None:
    """The motor comes down its ramp."""
    memory.jogs = 0
    release(c.rule)


@step
def switch_off(c: StepperController, lines: StepperLines, o: Operation) -> None:
    """No pulse and no current, now; a motor that ran then rolls out, and nobody knows how far."""
    rule = c.rule
    if rule.index >= 0:
        o.trust = NOT_KNOWN
    rule.index = rule.request = AT_REST
    rule.manual = rule.start = rule.active = rule.word = 0
    rule.state = FAULT if rule.state == FAULT else REST
    c.timer.period, c.timer.expires = 0, c.now
    lines.pulse = lines.period = 0
    lines.disable = 1


@step
def tell_how(  # noqa: PLR0913 - as `serve`
    q: StepperLiveParams, p: StepperControllerParams, c: StepperController, lines: StepperLines, memory: StepperLive,
    o: Operation,
) -> None:  # fmt: skip
    """How the motor is. It has no sensor: the position is that of its field, which it follows or loses steps."""
    a, rule = o.answer, c.rule
    a.position = a.commanded = q.lower + rule.position * q.step
    runs = rule.index >= 0 and c.timer.period > 0
    a.velocity = a.commanded_velocity = rule.direction * q.step * p.timer.clock_hz / c.timer.period if runs else 0.0
    a.effort = 1.0 - lines.disable
    a.rests = 0 if rule.index >= 0 or is_pending(c, memory) or memory.homing.phase != IDLE else 1
    a.near = a.ready = 1
    a.fault = (
        FAULTS + rule.cause if rule.state == FAULT and rule.index < 0 and o.demand.do not in (REST_OFF, HOLD) else 0
    )


@serves(StepperLiveParams)
@step
def serve(  # noqa: PLR0913 - as all of its kind
    q: StepperLiveParams, p: StepperControllerParams, c: StepperController, lines: StepperLines, memory: StepperLive,
    o: Operation, up: Entries, down: Entries,
) -> None:  # fmt: skip
    """One look."""
    d, rule = o.demand, c.rule
    rule.event = 0
    if d.fresh:
        if d.do == REST_OFF:
            switch_off(c, lines, o)
        elif d.do == HOLD:
            rule.reset, lines.disable = 1, 0
        elif d.do == TRAVEL or (d.do == RUN and d.velocity != 0.0):
            aim(q, p, c, memory, o, set_out(q, p, c, memory, o), up, down)
        elif d.do in (RUN, HALT):
            let_go(c, memory)
    elif d.edited and (memory.jogs or is_pending(c, memory)):
        aim(q, p, c, memory, o, rule.heading, up, down)
    o.answer.refused = 0
    if d.do == SEEK and (d.fresh or memory.homing.phase != IDLE):
        o.answer.refused = search(q, p, c, lines, memory, o, up, down)
    elif d.fresh:
        memory.homing.phase = IDLE
    tell_how(q, p, c, lines, memory, o)


def table_params(table: StepEnvelope) -> StepTableParams:
    """What an edit needs to know of a table."""
    q = StepTableParams(direction=table.direction, steps=table.steps, reach=len(table.ramp), shift=INDEX_BITS)
    edges, caps, numbers = table.stretches
    q.stretches = len(caps)
    q.edge[: len(edges)], q.cap[: len(caps)], q.number[: len(numbers)] = edges, caps, numbers
    return q


def live_motor(spec: StepperEnvelopeSpec, name: str, operation: Callable[..., OperationParams]) -> Live:
    """One motor at power-on, without current, to be operated."""
    motor = StageMotor(spec, name)
    table, tables = motor.table, motor.tables
    if table.method.rule == "literal":
        raise DetentError(
            f"motor {name}: got method.rule literal; expected: ramp-limited, for the literal rule is safe only from an "
            "extreme of its table, and a hand may begin and stop anywhere; try: change it"
        )
    for one in (tables.up, tables.down):  # between the ends of the travel: what a hand sets lies inside
        one.move_start(0 if one.direction > 0 else one.steps)
        one.move_stop(one.steps - one.start)
    tick = instant(spec)
    q = StepperLiveParams(
        look_ticks=round(LOOK / tick), step=table.step, lower=table.mechanics.lower_end, speed=table.limits.speed,
        last=len(tables.ramp) - 1, up=table_params(tables.up), down=table_params(tables.down),
    )  # fmt: skip
    ends = table.mechanics.lower_end, table.upper_end
    motions = MOVE_TO, MOVE_BY, JOG, LOWER, UPPER, *(() if table.home is None else (HOME,))
    q.operation = operation(LOOK, spec.controller.settle_time, ends, *motions)
    if table.home is not None:
        q.homing = homing_params(
            table.home, travel=table.limits.travel, pitch=0.0, count=table.step, look=LOOK, pressed=LOOK
        )
    memory = StepperLive(goal=motor.position, up_stop=tables.up.stop, down_stop=tables.down.stop)
    motor.r.lines.disable = 1
    rule = motor.controller.rule

    def fault() -> str:
        return f"motor {name}: {STEP_FAULT_TEXT[rule.cause]}" if rule.state == FAULT else ""

    numbers = {FAULTS + INFEASIBLE: FOLLOWING, FAULTS + OUT_OF_RANGE: END_OF_TRAVEL}
    zones = tables.up.zones
    limits: Sequence[float] = zones.limits
    data: dict[str, list[float]] = {
        "edges": [table.mechanics.lower_end + edge * table.step for edge in zones.edges.tolist()],
        "speeds": [limits[number] * table.step for number in zones.numbers.tolist()],
    }
    return Live(
        motor.p,
        motor.r,
        q,
        memory,
        tick,
        speed=table.limits.speed,
        acceleration=table.limits.acceleration,
        view={"title": "Envelope", "data": data},
        feed=motor.feed,
        fault=fault,
        legs=partial(stage_legs, name),
        places=places(tick),
        fault_numbers=numbers,
    )


def stage_legs(motor: str, job: StageJob) -> list[Leg]:
    """The moves of a stage that are this motor's; of no other one, for each motor is live by itself."""
    others = [name for name in job.motors if name != motor]
    if others:
        got = f"{job.name}: got moves of {', '.join(others)}"
        raise DetentError(f"{got}; expected, live: of motor {motor} alone, which this is; leave the others out")
    legs: list[Leg] = []
    kind, place = MOVE_BY, 0.0
    for move in job.moves:
        if isinstance(move, StageJog):
            legs += [Leg(JOG, move.speed, None, move.duration), Leg(0, seconds=move.dwell)]
            kind, place = MOVE_BY, math.nan
            continue
        if move.turn is not None or move.change is not None:
            got = f"{job.name}, move {move.number}: got a turn or a stop that is changed on the way"
            raise DetentError(f"{got}; expected, live: plain moves; move the ends by hand, or simulate it: detent run")
        if motor in move.targets:
            kind, place = MOVE_TO, move.targets[motor]
        else:
            place += move.by[motor]
        if math.isnan(place):
            got = f"{job.name}, move {move.number}: got a way from where a jog has ended"
            raise DetentError(f"{got}; expected, live: a place after a jog; name one")
        legs.append(Leg(kind, place, None, move.dwell))
    return legs


def live(spec: StepperEnvelopeSpec, operation: Callable[..., OperationParams]) -> dict[str, Live]:
    """Every motor of the file: each is an axis of its own."""
    return {name: live_motor(spec, name, operation) for name in spec.stepper}
