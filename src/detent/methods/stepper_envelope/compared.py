"""A stepper driven by a method that the envelope is compared with: another controller on the same lines and plant.

It keeps to the registers of the envelope's control unit and timer (`control.step_comparison`), and has no tables.
"""

from detent.control.step_comparison import Comparison, ComparisonParams, next_compared_step
from detent.kernel.loop import ticks
from detent.kernel.registers import Registers, block, i8, register
from detent.kernel.step import hot_step, step
from detent.methods.stepper_envelope.controller import (
    StepperController,
    StepperControllerParams,
    StepperLines,
    begin_period,
    put_out,
)
from detent.methods.stepper_envelope.plant import StepperPlant, StepperPlantParams, move
from detent.methods.stepper_envelope.system import Stepper, StepperParams
from detent.planning.step_envelope import ZoneMap


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


@step
def actuate_compared(p: ComparedParams, r: Compared) -> bool:
    """The same, and drive the lines; False at rest."""
    if r.controller.timer.period == 0:
        r.controller.timer.expires = r.controller.now
    return put_out(r.controller, r.lines, step_compared(p, r))


@ticks(ComparedParams)
@hot_step
def tick_compared(p: ComparedParams, r: Compared) -> bool:
    """One time step of the rotor; none while the controller has an event for its host."""
    if r.controller.rule.event:
        return False
    r.lines.pulse = 0
    if r.controller.timer.expires <= r.controller.now:
        actuate_compared(p, r)
    r.controller.now += p.controller.instant_ticks
    move(p.plant, r.tick, r.lines, r.plant)
    r.tick += 1
    return True


def take_over(  # noqa: PLR0913 - a run of the methods, which know no table
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
