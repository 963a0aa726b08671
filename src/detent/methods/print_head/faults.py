"""What can be put wrong between the machine of a print head and its wires, and the tick while something is."""

import math
from collections.abc import Mapping

from detent.kernel.loop import disturbs
from detent.kernel.step import step
from detent.methods.print_head.controller import PrintHeadController, PrintHeadLines, control
from detent.methods.print_head.plant import PrintHeadPlant, move, observe, sense
from detent.methods.print_head.system import TICK, PrintHead, PrintHeadParams
from detent.plant.injection import BLOCKED, PUSH, WORD_KINDS, WRONG, Injection, Place, spoilt, spoilt_effort

ENCODER, CHANNEL_A, DRIVE, CARRIAGE = range(1, 5)
PUSH_FORCE = 5.0  # as of a hand [N]


@step
def spoil_edge(f: Injection, levels: int) -> int:
    """Levels of both channels, or those with A alone spoilt; an encoder that is wrong has them swapped."""
    if f.kind == WRONG and f.place == ENCODER:
        return levels >> 1 | (levels & 1) << 1
    if f.place == ENCODER:
        return math.floor(spoilt(f, 0, levels, levels, 3.0))
    return levels & 2 | math.floor(spoilt(f, 0, levels & 1, levels & 1, 1.0))


@step
def spoil_encoder(f: Injection, c: PrintHeadController, lines: PrintHeadLines, levels: int) -> None:
    """What the channels show: every edge of a wrong one, of others the levels at the end of the period."""
    f.since += 1
    if f.kind == WRONG:
        for k in range(lines.edges):
            lines.levels[k] = spoil_edge(f, lines.levels[k])
        return
    shown = spoil_edge(f, levels)
    lines.edges = 1 if shown != (c.quadrature.channel_a | c.quadrature.channel_b << 1) else 0
    lines.when_us[0], lines.levels[0] = 0, shown


@step
def spoil_drive(f: Injection, lines: PrintHeadLines) -> None:
    """Pulse width and direction as they arrive at the bridge; a wrong drive turns the direction round."""
    f.since += 1
    f.true[0], f.true[1] = lines.count, lines.right_left
    if f.kind == WRONG:
        lines.right_left = 1 - lines.right_left
    else:
        lines.count = math.floor(abs(spoilt_effort(f, 0, lines.count, 300.0)))


@step
def hold_carriage(f: Injection, plant: PrintHeadPlant) -> None:
    """The carriage stays where it was when it was blocked."""
    if f.since == 0:
        f.true[0] = plant.train.position
    f.since += 1
    plant.train.position, plant.train.velocity = f.true[0], 0.0


@disturbs(PrintHeadParams)
@step
def disturbed_tick(p: PrintHeadParams, r: PrintHead, f: Injection) -> bool:
    """One PWM period with something wrong: the order is that of `system.tick`."""
    if r.controller.head.status.latch.flag:
        return False
    plant, lines, push = r.plant, r.lines, p.plant.push
    sense(p.plant, plant, plant.train, lines)
    if f.place in (ENCODER, CHANNEL_A):
        spoil_encoder(f, r.controller, lines, plant.encoder.channel_a | plant.encoder.channel_b << 1)
    control(p.controller, r.controller, lines)
    observe(p.plant, plant, plant.train, lines)
    if f.place == DRIVE:
        spoil_drive(f, lines)
    force, begin, end = push.force, push.begin, push.end
    if f.place == CARRIAGE and f.kind == PUSH:
        push.force, push.begin, push.end = f.amount, r.tick, r.tick + 1
    move(p.plant, plant, plant.train, lines, r.tick)
    push.force, push.begin, push.end = force, begin, end
    if f.place == DRIVE:
        lines.count, lines.right_left = math.floor(f.true[0]), math.floor(f.true[1])
    if f.place == CARRIAGE and f.kind == BLOCKED:
        hold_carriage(f, plant)
    r.tick += 1
    return True


def places() -> Mapping[str, Place]:
    """What can be put wrong."""
    return {
        "encoder": Place(ENCODER, WORD_KINDS, TICK, time=2e-3),
        "channel A": Place(CHANNEL_A, WORD_KINDS, TICK, time=2e-3),
        "drive": Place(DRIVE, WORD_KINDS, TICK, time=2e-3),
        "carriage": Place(CARRIAGE, (BLOCKED, PUSH), TICK, push=PUSH_FORCE),
    }
