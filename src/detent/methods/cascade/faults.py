"""What can be put wrong between the machine of a cascade axis and its wires, and the tick while something is."""

import math
from collections.abc import Mapping

from detent.kernel.loop import HostArray, disturbs
from detent.kernel.step import step
from detent.methods.cascade.controller import control
from detent.methods.cascade.plant import CascadePlant, move, sense
from detent.methods.cascade.schema import CascadeSpec
from detent.methods.cascade.system import Cascade, CascadeParams
from detent.plant.injection import BLOCKED, PUSH, WORD_KINDS, Injection, Place, spoilt, spoilt_effort
from detent.sensing.position_sensor import EncoderWord

MOTOR, LOAD, DRIVE, MACHINE = range(1, 5)


@step
def spoil_encoder(f: Injection, word: EncoderWord, travel: float) -> None:
    """What an encoder shows: a count, or where it has none a place."""
    f.since += 1
    if travel > 0.0:
        word.count = math.floor(spoilt(f, 0, word.count, word.count, 0.0))
    else:
        word.place = spoilt(f, 0, word.place, word.place, 0.0)


@step
def hold_load(f: Injection, plant: CascadePlant) -> None:
    """Motor and load stay where they were when they were blocked."""
    machine = plant.machine
    if f.since == 0:
        f.true[0], f.true[1] = machine.motor.position, machine.load.position
    f.since += 1
    machine.motor.position, machine.load.position = f.true[0], f.true[1]
    machine.motor.velocity = machine.load.velocity = 0.0


@disturbs(CascadeParams)
@step
def disturbed_tick(p: CascadeParams, r: Cascade, f: Injection, *feed: HostArray) -> bool:
    """One substep of the mechanics with something wrong: the order is that of `system.tick`."""
    if r.controller.event:
        return False
    plant, lines, push = r.plant, r.lines, p.plant.push
    sense(p.plant, plant, plant.machine, lines)
    if plant.latched and f.place == MOTOR:
        spoil_encoder(f, lines.motor, p.plant.motor_count)
    if plant.latched and f.place == LOAD:
        spoil_encoder(f, lines.load, p.plant.load_count)
    control(p.controller, r.controller, lines, *feed)
    if plant.latched and f.place == DRIVE:
        f.since += 1
        lines.command = spoilt_effort(f, 0, lines.command, p.controller.law.max_command)
    force, begin, end = push.force, push.begin, push.end
    if f.place == MACHINE and f.kind == PUSH:
        push.force, push.begin, push.end = f.amount, r.tick, r.tick + 1
    move(p.plant, plant, plant.machine, r.tick, lines)
    push.force, push.begin, push.end = force, begin, end
    if f.place == MACHINE and f.kind == BLOCKED:
        hold_load(f, plant)
    r.tick += 1
    return True


def places(spec: CascadeSpec, params: CascadeParams, period: float) -> Mapping[str, Place]:
    """What can be put wrong; a sample of the controller takes `period` [s]."""
    unit = spec.unit("m")
    largest = 1.5 * max(spec.limits.speed, spec.method.velocity_limit) * period  # what the guard takes for a jump
    both: dict[str, Place] = {}
    encoders = [("encoder", MOTOR, params.plant.motor_count)]
    encoders += [("load encoder", LOAD, params.plant.load_count)] if spec.load_encoder is not None else []
    for name, number, travel in encoders:
        both[name] = Place(
            number, WORD_KINDS, period, wrong=4.0 * largest, unit=unit, scale=travel or 1.0, time=80 * period
        )
    push, push_unit = 0.5 * spec.limits.effort, spec.unit("N")
    return both | {
        "drive": Place(DRIVE, WORD_KINDS, period, time=80 * period),
        "load": Place(MACHINE, (BLOCKED, PUSH), period, push=push, push_unit=push_unit),
    }
