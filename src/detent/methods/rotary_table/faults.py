"""What can be put wrong between the machine of a rotary table and its wires, and the tick while something is."""

import math
from collections.abc import Mapping

from detent.kernel.loop import disturbs
from detent.kernel.step import step
from detent.methods.rotary_table.controller import TableLines, control
from detent.methods.rotary_table.plant import TablePlant, move, sense
from detent.methods.rotary_table.schema import RotaryTableSpec
from detent.methods.rotary_table.system import RotaryTable, RotaryTableParams
from detent.plant.injection import BLOCKED, PUSH, WORD_KINDS, Injection, Place, spoilt, spoilt_effort
from detent.sensing.gauge import read_angle_gauge

FINE, COARSE, DRIVE, TABLE = range(1, 5)


@step
def spoil_resolvers(f: Injection, lines: TableLines) -> None:
    """The word of one of the comparators."""
    f.since += 1
    if f.place == FINE:
        lines.fine = math.floor(spoilt(f, 0, lines.fine, lines.fine, 0.0))
    else:
        lines.coarse = math.floor(spoilt(f, 0, lines.coarse, lines.coarse, 0.0))


@step
def hold_table(f: Injection, plant: TablePlant) -> None:
    """The motor stays where it was when the table was blocked."""
    motor = plant.train.motor
    if f.since == 0:
        f.true[0], f.true[1] = motor.angle, motor.turns
    f.since += 1
    motor.angle, motor.turns, motor.velocity = f.true[0], math.floor(f.true[1]), 0.0


@disturbs(RotaryTableParams)
@step
def disturbed_tick(p: RotaryTableParams, r: RotaryTable, f: Injection) -> bool:
    """One substep of the drive with something wrong: the order is that of `system.tick`."""
    if r.controller.positioner.event:
        return False
    plant, lines, load = r.plant, r.lines, p.plant.train.load
    sense(p.plant, plant, plant.train, lines)
    if lines.strobe and f.place in (FINE, COARSE):
        spoil_resolvers(f, lines)
    control(p.controller, r.controller, lines)
    if lines.interrupt:
        read_angle_gauge(plant.gauge, plant.train.motor.velocity, r.controller.positioner.dr)
        if f.place == DRIVE:
            f.since += 1
            lines.word = math.floor(spoilt_effort(f, 0, lines.word, p.controller.positioner.max_word))
    torque, begin, end = load.torque, load.begin, load.end
    if f.place == TABLE and f.kind == PUSH:
        load.torque, load.begin, load.end = f.amount, r.tick, r.tick + 1
    move(p.plant, plant, plant.train, lines, r.tick)
    load.torque, load.begin, load.end = torque, begin, end
    if f.place == TABLE and f.kind == BLOCKED:
        hold_table(f, plant)
    r.tick += 1
    return True


def places(spec: RotaryTableSpec, strobe: float) -> Mapping[str, Place]:
    """What can be put wrong; the angle is taken every `strobe` [s]."""
    resolver = Place(FINE, WORD_KINDS, strobe, wrong=50 * spec.count, unit="rad", scale=spec.count, time=10 * strobe)
    return {
        "fine resolver": resolver,
        "coarse resolver": resolver._replace(number=COARSE),
        "drive": Place(DRIVE, WORD_KINDS, strobe, time=10 * strobe),
        "table": Place(TABLE, (BLOCKED, PUSH), strobe, push=0.5 * spec.limits.effort, push_unit="N.m"),
    }
