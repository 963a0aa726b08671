"""The phase servo under somebody's hand: moves by whole pitches, and a stop at the next positioning point there is."""

import math
from collections.abc import Callable
from typing import Any

from detent.control.guard import NO_ARRIVAL, SATURATED, STUCK
from detent.control.operation import HALT, HOLD, MOVE_BY, MOVE_TO, REST_OFF, TRAVEL, Operation, OperationParams
from detent.control.phase_sequencer import ACQUIRE, SPEED
from detent.control.reaction import SOFT
from detent.kernel.loop import serves
from detent.kernel.registers import Registers, block, f8, i8, register, u1
from detent.kernel.step import step
from detent.methods.method import Live
from detent.methods.moves.legs import legs_of
from detent.methods.phase_servo.controller import PhaseController, PhaseControllerParams, PhaseLines, acquire, command
from detent.methods.phase_servo.faults import places
from detent.methods.phase_servo.host import PhaseHost
from detent.methods.phase_servo.schema import PhaseServoSpec

LOOK = 1e-3  # time between two looks [s]
NOT_READY, FARTHEST = 210, 65535


class PhaseLiveParams(Registers):
    """How it is operated."""

    operation: OperationParams = block("times and limits")
    look_ticks: i8 = register("ticks between two looks", unit="tick")
    step: f8 = register("travel per step", unit="m")
    pitch: i8 = register("steps between two positioning points", unit="count")
    home: f8 = register("positioning point at which it came to rest at power-on", unit="m")
    window: i8 = register("steps from the target that count as arrived", unit="count")
    seconds: f8 = register("time between two looks", unit="s")
    sample: f8 = register("time between two samples of the speed", unit="s")


class PhaseLive(Registers):
    """What it remembers."""

    base: i8 = register("steps from home to where the bridge was enabled last", unit="count")
    target: i8 = register("steps from home to the target", unit="count")
    driving: u1 = register("1 while the bridge drove at the last look")
    locked: u1 = register("1 once it has driven: before, the tracker's pulses are no motion")
    position: i8 = register("steps from home at the last look", unit="count")


@step
def stop_short(p: PhaseControllerParams, q: PhaseLiveParams, c: PhaseController, memory: PhaseLive) -> None:
    """A move ends at the first positioning point for which the table's velocities can still come down."""
    s = c.sequencer
    if s.state != SPEED:
        return
    n, speed = 0, abs(c.speed.word)
    while n < p.sequencer.last and p.sequencer.table[n] < speed:
        n += 1
    pitches = max(s.distance - n, 0) // q.pitch
    s.distance -= pitches * q.pitch
    s.remaining -= pitches * q.pitch * s.direction
    memory.target -= pitches * q.pitch * s.direction
    c.changed = 1


@step
def set_out(q: PhaseLiveParams, c: PhaseController, memory: PhaseLive, o: Operation) -> None:
    """A move to the positioning point next to the target."""
    goal = round((o.demand.target - q.home) / (q.step * q.pitch)) * q.pitch
    way = goal - memory.target
    if c.sequencer.ready == 0 or abs(way) > FARTHEST:
        o.answer.refused = NOT_READY
        return
    memory.target = goal
    command(c, abs(way), 1 if way < 0 else 0)


@serves(PhaseLiveParams)
@step
def serve(  # noqa: PLR0913 - as all of its kind
    q: PhaseLiveParams, p: PhaseControllerParams, c: PhaseController, lines: PhaseLines, memory: PhaseLive, o: Operation
) -> None:
    """One look."""
    d, a, s = o.demand, o.answer, c.sequencer
    a.refused = 0
    if lines.enable and memory.driving == 0:  # the counter has begun anew, and the nearest positioning point draws it
        memory.base = memory.position
        memory.target = q.pitch * math.floor(memory.base / q.pitch + 0.5)
        memory.locked = 1
    memory.driving = lines.enable
    place = memory.base + s.position if memory.locked else memory.base
    s.event = 0
    if d.fresh:
        if d.do == REST_OFF:
            lines.enable = 0
        elif d.do == HOLD and lines.enable == 0 and s.state != ACQUIRE:
            c.law.integral = 0  # it has grown while something held the carriage
            acquire(c)
        elif d.do == TRAVEL:
            set_out(q, c, memory, o)
        elif d.do == HALT:
            stop_short(p, q, c, memory)
    a.position = q.home + place * q.step
    a.velocity = (place - memory.position) * q.step / q.seconds
    memory.position = place
    a.commanded = q.home + memory.target * q.step
    a.commanded_velocity = c.law.setpoint * q.step / q.sample if s.state == SPEED else 0.0
    a.error = a.commanded - a.position
    a.effort = c.law.word / p.law.word_limit
    a.limited = 1 if abs(c.law.word) >= p.law.word_limit - 1 else 0
    a.rests = 1 if s.ready and s.strobe == 0 else 0
    a.near = 1 if abs(memory.target - place) <= q.window else 0
    a.ready = a.alone = 1
    a.fault = a.soft = 0
    if d.do != REST_OFF and s.state != ACQUIRE:
        a.soft = c.guard.code if lines.enable and c.guard.code != NO_ARRIVAL else 0
        a.fault = c.guard.hard if lines.enable == 0 else 0


def live(spec: PhaseServoSpec, operation: Callable[..., OperationParams]) -> dict[str, Live]:
    """The axis at power-on, to be operated."""
    host = PhaseHost(spec)
    q = PhaseLiveParams(step=spec.step, pitch=spec.detector.counts, home=host.home, seconds=LOOK)
    q.look_ticks, q.sample, q.window = round(LOOK / host.machine.tick), spec.sample_period, round(spec.arrived_steps)
    q.operation = operation(
        LOOK, spec.method.stop_time - spec.method.ready_time, (0.0, spec.limits.travel), MOVE_TO, MOVE_BY
    )
    q.operation.one_at_a_time = 1
    begin = round((spec.mechanics.start_position - host.home) / spec.step)
    machine: Any = host.machine
    machine.params.controller.guard.softly = SOFT
    memory = PhaseLive(base=begin, position=begin)
    cycle = machine.params.controller.converters.absolute.mask + 1
    return {
        "": Live(
            machine.params, machine.state, q, memory, machine.tick, speed=spec.limits.speed,
            view={"title": "Phase", "data": {"cycle": int(cycle)}}, fault=lambda: host.failure,
            legs=legs_of, places=places(spec, spec.tick), limits={STUCK: spec.protection.stuck_effort, SATURATED: 1.0},
        )
    }  # fmt: skip
