"""What can be put wrong between the machine of a phase servo and its wires, and the tick while something is."""

import math
from collections.abc import Mapping

from detent.kernel.loop import disturbs
from detent.kernel.step import step
from detent.methods.phase_servo.controller import PhaseLines, control
from detent.methods.phase_servo.plant import PhasePlant, move, sense
from detent.methods.phase_servo.schema import PhaseServoSpec
from detent.methods.phase_servo.system import PhaseServo, PhaseServoParams
from detent.plant.injection import BLOCKED, PUSH, WORD_KINDS, Injection, Place, spoilt, spoilt_effort

DETECTOR, DRIVE, CARRIAGE = range(1, 4)


@step
def spoil_drive(f: Injection, lines: PhaseLines) -> None:
    """Requests of the PWM as they arrive at the bridge."""
    f.since += 1
    lines.first_request = math.floor(spoilt_effort(f, 0, lines.first_request, 1.5) + 0.5)
    lines.request = math.floor(spoilt_effort(f, 1, lines.request, 1.5) + 0.5)


@step
def hold_carriage(f: Injection, plant: PhasePlant) -> None:
    """The carriage stays where it was when it was blocked."""
    if f.since == 0:
        f.true[0] = plant.train.position
    f.since += 1
    plant.train.position, plant.train.velocity = f.true[0], 0.0


@disturbs(PhaseServoParams)
@step
def disturbed_tick(p: PhaseServoParams, r: PhaseServo, f: Injection) -> bool:
    """One period of the reference clocks with something wrong: the order is that of `system.tick`."""
    if r.controller.sequencer.event:
        return False
    plant, lines, push = r.plant, r.lines, p.plant.push
    sense(p.plant, plant, plant.train.position, lines, r.tick)
    if f.place == DETECTOR:
        f.since += 1
        lines.ps = math.floor(spoilt(f, 0, lines.ps, lines.ps, 1.0))
    control(p.controller, r.controller, lines)
    if f.place == DRIVE:
        spoil_drive(f, lines)
    force, begin, end = push.force, push.begin, push.end
    if f.place == CARRIAGE and f.kind == PUSH:
        push.force, push.begin, push.end = f.amount, r.tick, r.tick + 1
    move(p.plant, plant, plant.train, lines, r.tick)
    push.force, push.begin, push.end = force, begin, end
    if f.place == CARRIAGE and f.kind == BLOCKED:
        hold_carriage(f, plant)
    r.tick += 1
    return True


def places(spec: PhaseServoSpec, tick: float) -> Mapping[str, Place]:
    """What can be put wrong; a period of the reference clocks takes `tick` [s]."""
    radius = spec.mechanics.pulley_circumference / math.tau
    stall = spec.limits.effort * spec.motor.torque_constant / radius
    return {
        "detector": Place(DETECTOR, WORD_KINDS, tick, time=100 * tick),
        "drive": Place(DRIVE, WORD_KINDS, tick, time=200 * tick),
        "carriage": Place(CARRIAGE, (BLOCKED, PUSH), tick, push=0.5 * stall),
    }
