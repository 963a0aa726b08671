"""What can be put wrong between the controller of a stepper and its machine, and the tick while something is."""

import math
from collections.abc import Mapping

from detent.kernel.loop import disturbs
from detent.kernel.step import step
from detent.methods.stepper_envelope.controller import Entries, StepperLines, control
from detent.methods.stepper_envelope.plant import StepperPlant, move
from detent.methods.stepper_envelope.system import Stepper, StepperParams
from detent.plant.injection import BLOCKED, OFF, STUCK, WORD_KINDS, WRONG, Injection, Place, spoilt

PULSE, DIRECTION, ROTOR = range(1, 4)


@step
def spoil_lines(f: Injection, lines: StepperLines) -> None:
    """Pulses that get lost on their way, come late, or the direction line.

    A line of pulses that is stuck has no edges, and so no pulses; none can arrive where the period says that none
    does. A pulse line that is wrong loses the pulses that it should carry, too.
    """
    f.since += 1
    f.true[0] = lines.direction
    if f.place == DIRECTION:
        forward = math.floor(spoilt(f, 0, 1 if lines.direction > 0 else 0, 1 if lines.direction > 0 else 0, 1.0))
        lines.direction = 1 if forward else -1
    elif f.kind in (OFF, STUCK, WRONG):
        lines.pulse = 0
    else:
        arrives = math.floor(spoilt(f, 0, lines.pulse, lines.pulse, 1.0))
        lines.pulse = 1 if arrives and lines.period > 0 else 0


@step
def hold_rotor(f: Injection, plant: StepperPlant) -> None:
    """The rotor stays where it was when it was blocked."""
    if f.since == 0:
        f.true[1] = plant.rotor.angle
    f.since += 1
    plant.rotor.angle, plant.rotor.velocity = f.true[1], 0.0


@disturbs(StepperParams)
@step
def disturbed_tick(p: StepperParams, r: Stepper, f: Injection, up: Entries, down: Entries) -> bool:
    """One time step of the rotor with something wrong: the order is that of `system.tick`."""
    if r.controller.rule.event:
        return False
    lines = r.lines
    control(p.controller, r.controller, lines, up, down)
    if f.place in (PULSE, DIRECTION):
        spoil_lines(f, lines)
    move(p.plant, r.tick, lines, r.plant)
    if f.place in (PULSE, DIRECTION):
        lines.direction = math.floor(f.true[0])
    if f.place == ROTOR:
        hold_rotor(f, r.plant)
    r.tick += 1
    return True


def places(tick: float) -> Mapping[str, Place]:
    """What can be put wrong; a time step of the rotor takes `tick` [s]."""
    return {
        "pulse": Place(PULSE, WORD_KINDS, tick, time=200 * tick),
        "direction": Place(DIRECTION, WORD_KINDS, tick, time=200 * tick),
        "rotor": Place(ROTOR, (BLOCKED,), tick),
    }
