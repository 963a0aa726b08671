"""The rotary table, wired as its block diagram (rotary-table specification 2).

    panel, sequence controller -> positioner -> register 5, D/A -> amplifier -> motor -> gear -> table
                                      ^              tachometer ----^             |
                      absolute angle  |                                           v
                   composition 19 ----+ <---- phase comparators <---- fine and coarse resolver

One tick is a substep of the drive, 100 us. Three clocks are divisions of it: the strobe of the real-time clock, every
2 ms; the interrupt, a fixed delay later; the timer task, every 20 ms. The order of a tick is: sample, decide, actuate,
move. Between its clocks the logic rests, and a tick is the exact motion of the plant.
"""

from detent.kernel.loop import ticks
from detent.kernel.registers import Registers, block, i8, register
from detent.kernel.step import Act, do, hot_step
from detent.methods.rotary_table.controller import TableController, TableControllerParams, TableLines, control, power_on
from detent.methods.rotary_table.plant import TablePlant, TablePlantParams, Train, move, sense
from detent.plant.rotary_motor import stand_at
from detent.sensing.gauge import read_angle_gauge

TICK_US = 100
TICK = TICK_US * 1e-6  # base tick [s]


class RotaryTableParams(Registers):
    """Everything about the axis that does not change while it runs; the position table may, between two starts."""

    controller: TableControllerParams = block("controller")
    plant: TablePlantParams = block("plant")


class RotaryTable(Registers):
    """State of the whole axis."""

    tick: i8 = register("periods of 100 us since power-on", unit="tick")
    controller: TableController = block("controller")
    lines: TableLines = block("wires between controller and plant")
    plant: TablePlant = block("plant")


@ticks(RotaryTableParams, local="plant.train")
@hot_step
def tick(p: RotaryTableParams, r: RotaryTable, train: Train) -> bool:
    """One substep of the drive, on `train` of the plant; none while the host must look: at rest."""
    if r.controller.positioner.event:
        return False
    sense(p.plant, r.plant, train, r.lines)
    control(p.controller, r.controller, r.lines)
    if r.lines.interrupt:  # the observer looks at both sides
        read_angle_gauge(r.plant.gauge, train.motor.velocity, r.controller.positioner.dr)
    move(p.plant, r.plant, train, r.lines, r.tick)
    r.tick += 1
    return True


def switch_on(p: RotaryTableParams, r: RotaryTable, turns: float, task_at: int, seed: int, act: Act = do) -> None:
    """Power-on at rest with the motor at an angle in turns; `seed` starts the noise of both comparators."""
    stand_at(r.plant.train.motor, turns)
    r.plant.fine.state, r.plant.coarse.state = seed, seed ^ 0x5DEECE66D
    act(power_on, p.controller, r.controller, r.lines, task_at)
