"""One stepper of the envelope method, wired as its block diagram (stepper-envelope specification 2.2).

    host -> envelope builder -> table (up, down) -> control unit -> timer, phases -> lines -> motor, spindle, load
                                                        ^              |
                                                        +-- period over+

A tick is a time step of the rotor, the judge of whether the motor follows. The order is: decide and drive the lines,
move, record; an open-loop motor has nothing to sample. What the host has laid ready are both tables. Several motors are
several of these records, each with its own tables; nothing is shared.
"""

import numpy as np
from numpy.typing import NDArray

from detent.control.step_comparison import Comparison, ComparisonParams, next_compared_step
from detent.kernel.loop import lay_ready, ticks
from detent.kernel.registers import Registers, block, i8, register
from detent.kernel.step import Act, do, hot_step
from detent.methods.stepper_envelope.controller import (
    Entries,
    StepperController,
    StepperControllerParams,
    StepperLines,
    begin_period,
    control,
    place,
    put_out,
)
from detent.methods.stepper_envelope.plant import StepperPlant, StepperPlantParams, move
from detent.planning.step_envelope import ZoneMap
from detent.plant.stepper_rotor import hold_field


class StepperParams(Registers):
    """Everything about one motor that does not change while it runs, but its tables."""

    controller: StepperControllerParams = block("control unit and timer")
    plant: StepperPlantParams = block("motor and load")


class Stepper(Registers):
    """State of one motor with its control unit."""

    tick: i8 = register("time steps of the rotor since power-on; steps where it runs without the rotor", unit="tick")
    controller: StepperController = block("control unit and timer")
    lines: StepperLines = block("wires between controller and plant")
    plant: StepperPlant = block("motor and load")


@ticks(StepperParams)
@hot_step
def tick(p: StepperParams, r: Stepper, up: Entries, down: Entries) -> bool:
    """One time step of the rotor; none while the controller has an event for its host."""
    if r.controller.rule.event:
        return False
    control(p.controller, r.controller, r.lines, up, down)
    move(p.plant, r.tick, r.lines, r.plant)
    r.tick += 1
    return True


def tables(up: NDArray[np.int16], down: NDArray[np.int16]) -> tuple[Entries, Entries]:
    """Feed of a motor: both tables, in the memory in which the host edits them."""
    return lay_ready(up), lay_ready(down)


def switch_on(r: Stepper, position: int, step_angle: float, act: Act = do) -> None:
    """Power-on with the motor standing at `position` [step], the rotor in the middle of its field."""
    act(place, r.controller, position)
    r.plant.rotor.commanded = position
    r.plant.rotor.angle = position * step_angle
    hold_field(r.plant.rotor)


# ---- a method that the envelope is compared with: another controller on the same lines and plant
#
# It keeps to the registers of the envelope's control unit and timer (`control.step_comparison`), and has no tables.


class ComparedParams(Registers):
    """Parameters of the motor, and those of the method; the former lie as in `StepperParams`."""

    controller: StepperControllerParams = block("control unit and timer")
    plant: StepperPlantParams = block("motor and load")
    comparison: ComparisonParams = block("method that drives")


class Compared(Registers):
    """State of the motor and of the method; the former lies as in `Stepper`."""

    tick: i8 = register("time steps of the rotor since power-on", unit="tick")
    controller: StepperController = block("control unit and timer")
    lines: StepperLines = block("wires between controller and plant")
    plant: StepperPlant = block("motor and load")
    comparison: Comparison = block("method that drives")


@hot_step
def step_compared(p: ComparedParams, r: Compared) -> int:
    """The running period is over: decide by the other method, and begin the next one. Returns IDLE or STEP."""
    return begin_period(p.controller, r.controller, next_compared_step(p.comparison, r.comparison, r.controller.rule))


@ticks(ComparedParams)
@hot_step
def tick_compared(p: ComparedParams, r: Compared) -> bool:
    """One time step of the rotor; none while the controller has an event for its host."""
    if r.controller.rule.event:
        return False
    r.lines.pulse = 0
    if r.controller.timer.expires <= r.controller.now:
        if r.controller.timer.period == 0:
            r.controller.timer.expires = r.controller.now
        put_out(r.controller, r.lines, step_compared(p, r))
    r.controller.now += p.controller.instant_ticks
    move(p.plant, r.tick, r.lines, r.plant)
    r.tick += 1
    return True


def take_over(
    p: StepperParams, r: Stepper, zones: ZoneMap, way: range, *, method: int, start_hz: float, acceleration: float
) -> tuple[ComparedParams, Compared]:
    """Let another method drive a motor upwards over a way [step]."""
    c = ComparisonParams(
        method=method, begin=way.start, steps=len(way), start_hz=start_hz, acceleration=acceleration,
        zones=len(zones.numbers),
    )  # fmt: skip
    for k, number in enumerate(zones.numbers.tolist()):
        c.edge[k], c.limit[k] = int(zones.edges[k + 1]) - way.start, zones.limits[number]
    q = ComparedParams(controller=p.controller, plant=p.plant, comparison=c)
    q.controller.timer.reload = 0  # these methods work a frequency out: the timer has to divide
    return q, Compared(tick=r.tick, controller=r.controller, lines=r.lines, plant=r.plant)
