"""What can be put wrong between the machine of a cascade axis and its wires, and the tick while something is."""

import math
from collections.abc import Mapping

from detent.kernel.loop import HostArray, disturbs
from detent.kernel.step import step
from detent.methods.cascade.controller import CascadeLines, control
from detent.methods.cascade.plant import CascadePlant, CascadePlantParams, move, sense
from detent.methods.cascade.schema import CascadeSpec
from detent.methods.cascade.system import Cascade, CascadeParams
from detent.plant.injection import (
    BLOCKED,
    GARBAGE,
    INTERMITTENT,
    OFF,
    PUSH,
    STUCK,
    WORD_KINDS,
    Injection,
    Place,
    spoilt,
    spoilt_effort,
)
from detent.sensing.home_marks import EndWires
from detent.sensing.position_sensor import EncoderWord

MOTOR, LOAD, DRIVE, MACHINE, MOTOR_LINK, LOAD_LINK, LOWER, UPPER, BOTH, BRAKE = range(1, 11)


@step
def spoil_encoder(f: Injection, word: EncoderWord, travel: float) -> None:
    """What an encoder shows: a count, or where it has none a place."""
    f.since += 1
    if travel > 0.0:
        word.count = math.floor(spoilt(f, 0, word.count, word.count, 0.0))
    else:
        word.place = spoilt(f, 0, word.place, word.place, 0.0)


@step
def spoil_link(f: Injection, word: EncoderWord) -> None:
    """A word that fails its check is none, whatever it shows."""
    f.since += 1
    if spoilt(f, 0, 1.0, 1.0, 1.0) == 0.0:
        word.lost, word.count, word.place = 1, 0, 0.0


@step
def spoil_ends(f: Injection, ends: EndWires) -> None:
    """The wire of one limit switch, or the one that both share."""
    f.since += 1
    closed = 1 if spoilt(f, 0, 1.0, 1.0, 1.0) else 0
    if f.place != UPPER:
        ends.lower &= closed
    if f.place != LOWER:
        ends.upper &= closed


@step
def spoil_lines(p: CascadePlantParams, f: Injection, lines: CascadeLines) -> None:
    """What arrives of a sample."""
    if f.place == MOTOR:
        spoil_encoder(f, lines.motor, p.motor_count)
    elif f.place == LOAD:
        spoil_encoder(f, lines.load, p.load_count)
    elif f.place == MOTOR_LINK:
        spoil_link(f, lines.motor)
    elif f.place == LOAD_LINK:
        spoil_link(f, lines.load)
    elif f.place in (LOWER, UPPER, BOTH):
        spoil_ends(f, lines.ends)


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
    if plant.latched:
        spoil_lines(p.plant, f, lines)
    control(p.controller, r.controller, lines, *feed)
    if plant.latched and f.place == DRIVE:
        f.since += 1
        lines.command = spoilt_effort(f, 0, lines.command, p.controller.law.max_command)
    if plant.latched and f.place == BRAKE:
        f.since += 1
        lines.brake = 1 if spoilt(f, 0, lines.brake, lines.brake, 1.0) else 0
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
    links = [("encoder link", MOTOR_LINK, spec.encoder), ("load encoder link", LOAD_LINK, spec.load_encoder)]
    for name, number, table in links:
        if table is not None and table.checked:
            both[name] = Place(number, (OFF, GARBAGE, INTERMITTENT), period, time=2 * period)
    for name, number in (("lower switch", LOWER), ("upper switch", UPPER), ("both switches", BOTH)):
        if spec.limit_switches is not None:
            both[name] = Place(number, (OFF, INTERMITTENT), period, time=80 * period)
    if spec.brake is not None:
        both["brake"] = Place(BRAKE, (OFF, STUCK, INTERMITTENT), period, time=80 * period)
    push, push_unit = 0.5 * spec.limits.effort, spec.unit("N")
    return both | {
        "drive": Place(DRIVE, WORD_KINDS, period, time=80 * period),
        "load": Place(MACHINE, (BLOCKED, PUSH), period, push=push, push_unit=push_unit),
    }
