"""The print-head axis, wired as its block diagram (print-head specification 2.2).

    command latch -> head computer -> PWM timer, lines -> decoder -> H-bridge -> motor -> belt, carriage, frames
                          ^                                                          |
                          +------------ quadrature decoder <- encoder <--------------+

One tick is one PWM period of 40 us, begun by the 25 kHz trigger. Its order is: what the encoder saw during the last
period, what the controller makes of it, what the machine does with that.
"""

from detent.control.head_computer import HeadParams
from detent.kernel.loop import ticks
from detent.kernel.registers import Registers, block, i8, register
from detent.kernel.step import Act, do, hot_step
from detent.methods.print_head.controller import PERIOD_US, PrintHeadController, PrintHeadLines, control, power_on
from detent.methods.print_head.plant import PrintHeadPlant, PrintHeadPlantParams, move, observe, sense, stand
from detent.plant.drive_train import DriveTrain

TICK = PERIOD_US * 1e-6
"""Base tick [s]."""


class PrintHeadParams(Registers):
    """Everything about the axis that does not change while it runs."""

    controller: HeadParams = block("axis computer")
    plant: PrintHeadPlantParams = block("machine")


class PrintHead(Registers):
    """State of the whole axis."""

    tick: i8 = register("PWM periods since power-on", unit="tick")
    controller: PrintHeadController = block("quadrature decoder and axis computer")
    lines: PrintHeadLines = block("wires between controller and machine")
    plant: PrintHeadPlant = block("machine")


@ticks(PrintHeadParams, local="plant.train")
@hot_step
def tick(p: PrintHeadParams, r: PrintHead, train: DriveTrain) -> bool:
    """One PWM period, on `train` of `r.plant`; none while a status byte waits for the supervisor."""
    if r.controller.head.status.latch.flag:
        return False
    sense(p.plant, r.plant, train, r.lines)
    control(p.controller, r.controller, r.lines)
    observe(p.plant, r.plant, train, r.lines)
    move(p.plant, r.plant, train, r.lines, r.tick)
    r.tick += 1
    return True


def switch_on(p: PrintHeadParams, r: PrintHead, position: float, seed: int, act: Act = do) -> None:
    """Power-on with the carriage at `position` [m]; `seed` starts the encoder's noise."""
    stand(p.plant, r.plant, position, seed)
    encoder = r.plant.encoder
    quarter, a, b = encoder.edge & 3, encoder.channel_a, encoder.channel_b
    act(power_on, p.controller, r.controller, quarter, a, b, r.tick)
