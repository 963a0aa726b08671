"""The filtered servo under somebody's hand: command pulses to a goal, at a rate; a jog is a goal that is far away."""

import math
from collections.abc import Callable
from typing import Any

from detent.control.deviation_counter import DEVIATION_RANGE, FAULT, GUARDED, RESET, SPEED_RANGE
from detent.control.guard import FOLLOWING, JUMPED, OVERSPEED, SATURATED, STUCK
from detent.control.guard import TRAVEL as END_OF_TRAVEL
from detent.control.operation import (
    HALT,
    HOLD,
    JOG,
    MOVE_BY,
    MOVE_TO,
    NOT_KNOWN,
    REST_OFF,
    RUN,
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
    go_to,
    reset,
)
from detent.methods.filtered_servo.faults import places
from detent.methods.filtered_servo.host import FilteredHost
from detent.methods.filtered_servo.schema import FilteredServoSpec
from detent.methods.method import Live
from detent.methods.moves.legs import legs_of

FAR = 1 << 50  # pulses: where a jog goes to where nothing ends it
COUNTERS = 220  # faults of its counters: their cause on top of it
LOOK = 1e-3  # time between two looks [s]


class FilteredLiveParams(Registers):
    """How it is operated."""

    operation: OperationParams = block("times and limits")
    look_ticks: i8 = register("ticks between two looks", unit="tick")
    pulse: f8 = register("travel per pulse", unit="m")
    home: f8 = register("where the slide stood at power-on", unit="m")
    rate: f8 = register("largest rate of the command", unit="uHz")
    seconds: f8 = register("time between two looks", unit="s")


class FilteredLive(Registers):
    """What it remembers."""

    position: i8 = register("pulses at the last look", unit="count")


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
def run(q: FilteredLiveParams, c: FilteredController, o: Operation) -> None:
    """A jog: towards the soft limit, or for ever; a velocity of 0 is a release."""
    side = 1 if o.demand.velocity > 0.0 else -1
    goal = c.generator.command + side * FAR
    if o.trust != NOT_KNOWN:
        lowest, highest = (q.operation.lowest - q.home) / q.pulse, (q.operation.highest - q.home) / q.pulse
        end = math.floor(highest) if side > 0 else math.ceil(lowest)
        goal = end if side * (end - c.generator.command) > 0 else c.generator.command
    wanted = abs(o.demand.velocity) / q.pulse * PER_PULSE
    go_to(c, goal, round(min(max(wanted, 1.0), q.rate * o.demand.share)))


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
        if d.do == REST_OFF and c.deviation.state != FAULT:
            c.deviation.state, c.busy = RESET, 1
        elif d.do == HOLD:
            reset(c)
        elif d.do == TRAVEL:
            go_to(c, round((d.target - q.home) / q.pulse), round(q.rate * d.share))
        elif d.do == RUN and d.velocity != 0.0:
            run(q, c, o)
        elif d.do in (RUN, HALT):
            brake(p, c)
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
    a.rests = 1 if g.command == g.goal else 0
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
    q.operation = operation(LOOK, spec.method.in_position_time, (0.0, spec.limits.travel), MOVE_TO, MOVE_BY, JOG)
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
