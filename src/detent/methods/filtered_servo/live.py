"""The filtered servo under somebody's hand: command pulses to a goal, at a rate; a jog is a goal that is far away."""

import math
from collections.abc import Callable
from typing import Any

from detent.axisfile.blocks import homing_params
from detent.control.deviation_counter import DEVIATION_RANGE, FAULT, GUARDED, RESET, SPEED_RANGE
from detent.control.guard import FOLLOWING, JUMPED, OVERSPEED, SATURATED, STUCK
from detent.control.guard import TRAVEL as END_OF_TRAVEL
from detent.control.homing import FAILED, FOUND, GIVE_WAY, IDLE, Homing, HomingParams, Seen, begin, is_pressed, seek
from detent.control.homing import HALT as HALT_NOW
from detent.control.homing import RUN as RUN_AT
from detent.control.operation import (
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
    TRAVEL,
    Operation,
    OperationParams,
)  # fmt: skip
from detent.control.pulse_generator import PER_PULSE
from detent.control.reaction import SOFT
from detent.kernel.loop import serves
from detent.kernel.registers import Registers, block, f8, i8, register
from detent.kernel.step import step
from detent.methods.filtered_servo.controller import (
    FilteredController,
    FilteredControllerParams,
    FilteredLines,
    give_way,
    go_to,
    reset,
    shift_counters,
)
from detent.methods.filtered_servo.faults import places
from detent.methods.filtered_servo.host import FilteredHost
from detent.methods.filtered_servo.schema import FilteredServoSpec
from detent.methods.method import Live
from detent.methods.moves.legs import legs_of

FAR = 1 << 50  # pulses: where a jog goes to where nothing ends it
COUNTERS = 220  # faults of its counters: their cause on top of it
LOOK = 1e-3  # time between two looks [s]
PRESSED = 0.04  # time [s] for which the slide stands at a stop: it stands for half of that where its loop swings


class FilteredLiveParams(Registers):
    """How it is operated."""

    operation: OperationParams = block("times and limits")
    look_ticks: i8 = register("ticks between two looks", unit="tick")
    pulse: f8 = register("travel per pulse", unit="m")
    home: f8 = register("where the slide stood at power-on", unit="m")
    rate: f8 = register("largest rate of the command", unit="uHz")
    seconds: f8 = register("time between two looks", unit="s")
    homing: HomingParams = block("how it finds its reference")


class FilteredLive(Registers):
    """What it remembers."""

    position: i8 = register("pulses at the last look", unit="count")
    homing: Homing = block("how far the search for the reference has come")
    seen: Seen = block("what the last look of it saw")


@step
def brake(p: FilteredControllerParams, c: FilteredController) -> None:
    """The command ends as soon as its acceleration lets it; without one, at once."""
    g, ahead = c.generator, 0
    if p.generator.acceleration > 0.0 and g.direction != 0:
        change = p.generator.acceleration * p.generator.ticks_per_second
        ahead = math.ceil(0.5 * g.present * g.present / (change * PER_PULSE) + g.phase * 1e-12)
        ahead = min(ahead, abs(g.goal - g.command)) if g.direction * (g.goal - g.command) > 0 else ahead
    go_to(c, g.command + g.direction * ahead, g.rate)


@step
def run(q: FilteredLiveParams, c: FilteredController, o: Operation, velocity: float) -> None:
    """Towards the soft limit, or for ever."""
    side = 1 if velocity > 0.0 else -1
    goal = c.generator.command + side * FAR
    if o.trust != NOT_KNOWN:
        lowest, highest = (q.operation.lowest - q.home) / q.pulse, (q.operation.highest - q.home) / q.pulse
        end = math.floor(highest) if side > 0 else math.ceil(lowest)
        goal = end if side * (end - c.generator.command) > 0 else c.generator.command
    wanted = abs(velocity) / q.pulse * PER_PULSE
    go_to(c, goal, round(min(max(wanted, 1.0), q.rate * o.demand.share)))


@step
def search(  # noqa: PLR0913 - as `serve`
    q: FilteredLiveParams, p: FilteredControllerParams, c: FilteredController, lines: FilteredLines,
    memory: FilteredLive, o: Operation,
) -> int:  # fmt: skip
    """One look of a homing; gives why it has failed, 0 while it has not."""
    h, s = memory.homing, memory.seen
    s.position, s.ahead = q.home + c.deviation.position * q.pulse, c.deviation.deviation * q.pulse
    s.rests = 1 if c.away == 0 and c.settling == 0 else 0  # a slide that still rings tells no stop from a turn
    s.switch, s.marks, s.mark = lines.home.switch, c.marks, q.home + c.mark * q.pulse
    if o.demand.fresh:
        o.trust = NOT_KNOWN
        told = begin(q.homing, h, s)
    else:
        told = seek(q.homing, h, s)
    if told == RUN_AT:
        run(q, c, o, h.velocity)
    elif told == GIVE_WAY or (told == FAILED and is_pressed(h, s)):
        give_way(c)
    elif told in (HALT_NOW, FAILED):
        brake(p, c)
    elif told == FOUND:
        pulses = round((q.homing.place - h.latched) / q.pulse)
        shift_counters(c, pulses)
        memory.position += pulses
        o.trust = REFERENCED
    return h.code if told == FAILED else 0


@serves(FilteredLiveParams)
@step
def serve(  # noqa: PLR0913 - as all of its kind
    q: FilteredLiveParams, p: FilteredControllerParams, c: FilteredController, lines: FilteredLines,
    memory: FilteredLive, o: Operation,
) -> None:  # fmt: skip
    """One look."""
    d, a, g = o.demand, o.answer, c.generator
    a.refused = 0
    if d.fresh:
        if d.do == REST_OFF:
            g.goal = g.command  # nothing is commanded any more
            if c.deviation.state != FAULT:
                c.deviation.state, c.busy = RESET, 1
        elif d.do == HOLD:
            reset(c)
        elif d.do == TRAVEL:
            go_to(c, round((d.target - q.home) / q.pulse), round(q.rate * d.share))
        elif d.do == RUN and d.velocity != 0.0:
            run(q, c, o, d.velocity)
        elif d.do in (RUN, HALT):
            brake(p, c)
    if d.do == SEEK and (d.fresh or memory.homing.phase != IDLE):
        a.refused = search(q, p, c, lines, memory, o)
    elif d.fresh:
        memory.homing.phase = IDLE
    c.known = 0 if o.trust == NOT_KNOWN else 1
    c.event = 0
    place = c.deviation.position
    a.position = q.home + place * q.pulse
    a.velocity = (place - memory.position) * q.pulse / q.seconds
    memory.position = place
    a.commanded = q.home + g.command * q.pulse
    a.commanded_velocity = g.direction * g.present * 1e-6 * q.pulse if g.command != g.goal else 0.0
    a.error = c.deviation.deviation * q.pulse
    a.effort = lines.word / p.deviation.word_limit
    a.limited = 1 if abs(lines.word) >= p.deviation.word_limit else 0
    a.rests = 1 if g.command == g.goal and memory.homing.phase == IDLE else 0
    a.near = 1 if abs(c.deviation.deviation) <= p.window else 0
    a.ready = a.alone = 1
    a.fault = a.soft = 0
    if d.do == REST_OFF or c.deviation.reset:  # what was wrong is forgotten with the next tick
        return
    if c.deviation.state != FAULT:
        a.soft = c.guard.code
    else:
        a.fault = c.guard.hard if c.deviation.cause == GUARDED else COUNTERS + c.deviation.cause


def live(spec: FilteredServoSpec, operation: Callable[..., OperationParams]) -> dict[str, Live]:
    """The axis at power-on, to be operated."""
    host = FilteredHost(spec)
    q = FilteredLiveParams(pulse=spec.pulse, home=host.home, seconds=LOOK)
    q.look_ticks = round(LOOK / host.machine.tick)
    q.rate = spec.limits.speed / spec.pulse * PER_PULSE
    motions = (MOVE_TO, MOVE_BY, JOG) if spec.home is None else (MOVE_TO, MOVE_BY, JOG, HOME)
    q.operation = operation(LOOK, spec.method.in_position_time, (0.0, spec.limits.travel), *motions)
    if spec.home is not None:
        q.homing = homing_params(
            spec.home, travel=spec.limits.travel, pitch=spec.mechanics.travel_per_revolution,
            count=spec.pulse, look=LOOK, pressed=PRESSED,
        )  # fmt: skip
    machine: Any = host.machine
    machine.params.controller.guard.softly = SOFT
    table, speed = spec.protection, spec.limits.speed
    largest = machine.params.controller.deviation.range * spec.pulse
    limits = {STUCK: table.stuck_effort, SATURATED: 1.0, OVERSPEED: table.overspeed * speed,
              JUMPED: table.jump * speed * LOOK, END_OF_TRAVEL: spec.limits.travel,
              COUNTERS + DEVIATION_RANGE: largest}  # fmt: skip
    return {
        "": Live(
            machine.params, machine.state, q, FilteredLive(), machine.tick, speed=speed,
            view={"title": "Filtered speed"}, fault=lambda: host.failure, legs=legs_of, places=places(spec),
            limits=limits, fault_numbers={COUNTERS + DEVIATION_RANGE: FOLLOWING, COUNTERS + SPEED_RANGE: OVERSPEED},
        )
    }  # fmt: skip
