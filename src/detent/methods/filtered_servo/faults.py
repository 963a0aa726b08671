"""What can be put wrong between the machine of a filtered servo and its wires, and the tick while something is."""

import math
from collections.abc import Mapping

from detent.kernel.loop import disturbs
from detent.kernel.step import step
from detent.methods.filtered_servo.controller import CLOCKS, LEVELS, FilteredLines, control
from detent.methods.filtered_servo.plant import FilteredPlant, move, sense
from detent.methods.filtered_servo.schema import FilteredServoSpec
from detent.methods.filtered_servo.system import TICK, FilteredServo, FilteredServoParams
from detent.plant.injection import BLOCKED, PUSH, WORD_KINDS, WRONG, Injection, Place, spoilt, spoilt_effort

ENCODER, CHANNEL_A, DRIVE, SLIDE = range(1, 5)


@step
def spoil_levels(f: Injection, k: int, levels: int) -> int:
    """Levels of a channel in the ten clocks of a tick; what is held is the last of them."""
    settled = LEVELS if levels >> CLOCKS - 1 & 1 else 0
    return math.floor(spoilt(f, k, levels, settled, LEVELS))


@step
def spoil_encoder(f: Injection, lines: FilteredLines) -> None:
    """Both channels, or A alone; an encoder that is wrong has them swapped."""
    f.since += 1
    lines.changed = 1
    if f.place == ENCODER and f.kind == WRONG:
        lines.a, lines.b = lines.b, lines.a
        return
    lines.a = spoil_levels(f, 0, lines.a)
    if f.place == ENCODER:
        lines.b = spoil_levels(f, 1, lines.b)


@step
def spoil_drive(f: Injection, lines: FilteredLines, largest: float) -> None:
    """The drive word as it arrives at the amplifier."""
    f.since += 1
    f.true[0] = lines.word
    lines.word = spoilt_effort(f, 0, lines.word, largest)


@step
def hold_slide(f: Injection, plant: FilteredPlant) -> None:
    """The slide stays where it was when it was blocked."""
    if f.since == 0:
        f.true[0] = plant.train.position
    f.since += 1
    plant.train.position, plant.train.velocity = f.true[0], 0.0


@disturbs(FilteredServoParams)
@step
def disturbed_tick(p: FilteredServoParams, r: FilteredServo, f: Injection) -> bool:
    """Ten microseconds with something wrong: the order is that of `system.tick`."""
    if r.controller.event:
        return False
    plant, lines, push = r.plant, r.lines, p.plant.push
    sense(p.plant, plant, plant.train.position, r.tick, lines)
    if f.place in (ENCODER, CHANNEL_A):
        spoil_encoder(f, lines)
    control(p.controller, r.controller, lines)
    if f.place == DRIVE:
        spoil_drive(f, lines, p.controller.deviation.word_limit)
    force, begin, end = push.force, push.begin, push.end
    if f.place == SLIDE and f.kind == PUSH:
        push.force, push.begin, push.end = f.amount, r.tick, r.tick + 1
    move(p.plant, plant, plant.train, r.tick, lines)
    push.force, push.begin, push.end = force, begin, end
    if f.place == DRIVE:
        lines.word = f.true[0]
    if f.place == SLIDE and f.kind == BLOCKED:
        hold_slide(f, plant)
    r.tick += 1
    return True


def places(spec: FilteredServoSpec) -> Mapping[str, Place]:
    """What can be put wrong."""
    return {
        "encoder": Place(ENCODER, WORD_KINDS, TICK, time=2e-3),
        "channel A": Place(CHANNEL_A, WORD_KINDS, TICK, time=2e-3),
        "drive": Place(DRIVE, WORD_KINDS, TICK, time=2e-3),
        "slide": Place(SLIDE, (BLOCKED, PUSH), TICK, push=0.5 * spec.word_limit * spec.force_per_count),
    }
