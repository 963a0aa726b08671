"""The phase servo under somebody's hand: moves by whole pitches, and a stop at the next positioning point there is."""

import math
from collections.abc import Callable
from typing import Any

from detent.axisfile.blocks import homing_params
from detent.control.guard import NO_ARRIVAL, SATURATED, STUCK
from detent.control.homing import FAILED, FOUND, IDLE, ON, Homing, HomingParams, Seen, begin, is_under_way, seek
from detent.control.homing import HALT as HALT_NOW
from detent.control.homing import RUN as RUN_AT
from detent.control.operation import (
    HALT,
    HOLD,
    HOME,
    MOVE_BY,
    MOVE_TO,
    NOT_KNOWN,
    REFERENCED,
    REST_OFF,
    SEEK,
    TRAVEL,
    Operation,
    OperationParams,
)
from detent.control.phase_sequencer import ACQUIRE, SPEED
from detent.control.phase_sequencer import HOLD as AT_STOP
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
PRESSED = 0.02  # time [s] for which a carriage stands that something holds: half as long as its guard lets it
NOT_READY, FARTHEST = 210, 65535


class PhaseLiveParams(Registers):
    """How it is operated."""

    operation: OperationParams = block("times and limits")
    look_ticks: i8 = register("ticks between two looks", unit="tick")
    step: f8 = register("travel per step", unit="m")
    pitch: i8 = register("steps between two positioning points", unit="count")
    home: f8 = register("positioning point at which it came to rest at power-on", unit="m")
    speed: f8 = register("largest speed", unit="m/s")
    window: i8 = register("steps from the target that count as arrived", unit="count")
    seconds: f8 = register("time between two looks", unit="s")
    sample: f8 = register("time between two samples of the speed", unit="s")
    homing: HomingParams = block("how it finds its reference")


class PhaseLive(Registers):
    """What it remembers."""

    base: i8 = register("steps from home to where the bridge was enabled last", unit="count")
    target: i8 = register("steps from home to the target", unit="count")
    driving: u1 = register("1 while the bridge drove at the last look")
    locked: u1 = register("1 once it has driven: before, the tracker's pulses are no motion")
    position: i8 = register("steps from home at the last look", unit="count")
    homing: Homing = block("how far the search for the reference has come")
    seen: Seen = block("what the last look of it saw")


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
def ceiling(q: PhaseLiveParams, velocity: float) -> int:
    """Whole pulses per sample up to a velocity [m/s]; no fewer than one, or it would stand."""
    return max(math.floor(abs(velocity) * q.sample / q.step + 1e-9), 1)


@step
def shift(memory: PhaseLive, steps: int) -> None:
    """The carriage stands elsewhere by so many steps than was counted."""
    memory.base += steps
    memory.position += steps


@step
def search(  # noqa: PLR0913 - as `serve`
    p: PhaseControllerParams, q: PhaseLiveParams, c: PhaseController, lines: PhaseLines, memory: PhaseLive,
    o: Operation,
) -> int:  # fmt: skip
    """One look of a homing; gives why it has failed, 0 while it has not."""
    h, s = memory.homing, memory.seen
    s.rests = 1 if c.sequencer.state == AT_STOP and c.sequencer.strobe == 0 else 0
    if s.rests:  # at a positioning point: the detector's phase says so, whatever has been counted
        shift(memory, memory.target - memory.base - c.sequencer.position)
    place = memory.base + c.sequencer.position
    s.position, s.ahead = q.home + place * q.step, (memory.target - place) * q.step
    # A mark is a positioning point: the one above it on the way up, the one below on the way down.
    s.switch, s.marks = lines.home.switch, math.floor(place / q.pitch)
    s.mark = q.home + (s.marks + (1 if h.velocity < 0.0 else 0)) * q.pitch * q.step
    if o.demand.fresh:
        o.trust = NOT_KNOWN
        told = begin(q.homing, h, s)
    else:
        told = seek(q.homing, h, s)
    if told == RUN_AT or (told == ON and s.rests and is_under_way(h)):  # the command counter holds no longer way
        run(q, c, memory, o.demand.share, h.velocity)
    elif told in (HALT_NOW, FAILED):
        stop_short(p, q, c, memory)
    if told == FAILED and c.sequencer.state == SPEED and h.still > 0:  # something holds it: lock anew, where it is
        lines.enable = 0
        acquire(c)
    elif told == FOUND:
        way = round((q.homing.place - h.latched) / (q.step * q.pitch)) * q.pitch
        shift(memory, way)
        memory.target += way
        o.trust = REFERENCED
    return h.code if told == FAILED else 0


@step
def run(q: PhaseLiveParams, c: PhaseController, memory: PhaseLive, share: float, velocity: float) -> None:
    """Go on at a velocity: a move as far as the command counter goes, under a ceiling."""
    c.sequencer.ceiling = ceiling(q, min(abs(velocity), q.speed * share))
    if c.sequencer.state == SPEED:
        return
    way = FARTHEST // q.pitch * q.pitch
    memory.target += way if velocity > 0.0 else -way
    command(c, way, 1 if velocity < 0.0 else 0)


@step
def set_out(q: PhaseLiveParams, c: PhaseController, memory: PhaseLive, o: Operation) -> None:
    """A move to the positioning point next to the target."""
    goal = round((o.demand.target - q.home) / (q.step * q.pitch)) * q.pitch
    way = goal - memory.target
    if c.sequencer.ready == 0 or abs(way) > FARTHEST:
        o.answer.refused = NOT_READY
        return
    memory.target = goal
    c.sequencer.ceiling = 0 if o.demand.share >= 1.0 else ceiling(q, q.speed * o.demand.share)
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
    if d.do == SEEK and (d.fresh or memory.homing.phase != IDLE):
        a.refused = search(p, q, c, lines, memory, o)
        place = memory.base + s.position
    elif d.fresh:
        memory.homing.phase = IDLE
    a.position = q.home + place * q.step
    a.velocity = (place - memory.position) * q.step / q.seconds
    memory.position = place
    a.commanded = q.home + memory.target * q.step
    a.commanded_velocity = c.law.setpoint * q.step / q.sample if s.state == SPEED else 0.0
    a.error = a.commanded - a.position
    a.effort = c.law.word / p.law.word_limit
    a.limited = 1 if abs(c.law.word) >= p.law.word_limit - 1 else 0
    a.rests = 1 if s.ready and s.strobe == 0 and memory.homing.phase == IDLE else 0
    a.near = 1 if abs(memory.target - place) <= q.window else 0
    a.ready = a.alone = 1
    a.fault = a.soft = 0
    if d.do != REST_OFF and s.state != ACQUIRE:
        a.soft = c.guard.code if lines.enable and c.guard.code != NO_ARRIVAL else 0
        a.fault = c.guard.hard if lines.enable == 0 else 0


def live(spec: PhaseServoSpec, operation: Callable[..., OperationParams]) -> dict[str, Live]:
    """The axis at power-on, to be operated."""
    host = PhaseHost(spec)
    speed = spec.limits.speed
    q = PhaseLiveParams(step=spec.step, pitch=spec.detector.counts, home=host.home, seconds=LOOK, speed=speed)
    q.look_ticks, q.sample, q.window = round(LOOK / host.machine.tick), spec.sample_period, round(spec.arrived_steps)
    # Where it stops by its phase, that tells the place within the pitch; otherwise nothing does.
    by_phase = spec.method.final == "absolute" and not spec.method.stop_always_off
    motions = (MOVE_TO, MOVE_BY) if spec.home is None or not by_phase else (MOVE_TO, MOVE_BY, HOME)
    q.operation = operation(LOOK, spec.method.stop_time - spec.method.ready_time, (0.0, spec.limits.travel), *motions)
    if spec.home is not None:
        q.homing = homing_params(
            spec.home, travel=spec.limits.travel, pitch=spec.pitch, count=spec.step, look=LOOK, pressed=PRESSED
        )
    q.operation.one_at_a_time = 1
    begin = round((spec.mechanics.start_position - host.home) / spec.step)
    machine: Any = host.machine
    machine.params.controller.guard.softly = SOFT
    memory = PhaseLive(base=begin, position=begin)
    cycle = int(machine.params.controller.converters.absolute.mask) + 1
    return {
        "": Live(
            machine.params, machine.state, q, memory, machine.tick, speed=speed,
            view={"title": "Phase", "data": {"cycle": cycle, "stop": cycle // 2}}, fault=lambda: host.failure,
            legs=legs_of, places=places(spec, spec.tick), limits={STUCK: spec.protection.stuck_effort, SATURATED: 1.0},
        )
    }  # fmt: skip
