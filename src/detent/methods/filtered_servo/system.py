"""The filtered servo, wired as its block diagram (filtered-servo specification 2).

    command pulses -> position counter -> E = K1 P - y -> PWM -> amplifier -> motor -> screw, slide
                            ^                    ^                                        |
                            |   speed counter -> x B -> filter                            v
                            +------ +------ decoder <------------- encoder <--------------+
                                    sample clock drives counter and filter

One tick is 10 us, ten clocks of the decoder. Its order is: sense what the encoder saw during the last tick, control,
move. The controller ends with the drive word; PWM, amplifier and the total moving mass are the plant.
"""

from detent.kernel.loop import Bytes, Offsets, ticks, write_row
from detent.kernel.registers import Registers, block, i8, register
from detent.kernel.step import Act, do, hot_step, step
from detent.methods.filtered_servo.controller import (
    CLOCKS,
    FilteredController,
    FilteredControllerParams,
    FilteredLines,
    conclude,
    control,
    control_clock,
    end_tick,
    power_on,
)
from detent.methods.filtered_servo.plant import FilteredPlant, FilteredPlantParams, hold_levels, move, sense
from detent.plant.drive_train import DriveTrain
from detent.sensing.encoder import stand_at
from detent.sensing.home_marks import stand_home
from detent.sensing.interference import start_interference

TICK = 10 * 1e-6  # base tick [s]


class FilteredServoParams(Registers):
    """Everything about the axis that does not change while it runs."""

    controller: FilteredControllerParams = block("constants of the controller")
    plant: FilteredPlantParams = block("constants of the machine")


class FilteredServo(Registers):
    """State of the whole axis."""

    tick: i8 = register("periods of 10 us since power-on", unit="tick")
    controller: FilteredController = block("controller")
    lines: FilteredLines = block("wires between controller and plant")
    plant: FilteredPlant = block("plant")


@ticks(FilteredServoParams, local="plant.train")
@hot_step
def tick(p: FilteredServoParams, r: FilteredServo, train: DriveTrain) -> bool:
    """Ten microseconds, on `train` of the plant; none while the host must look: in position, or failed."""
    if r.controller.event:
        return False
    sense(p.plant, r.plant, train.position, r.tick, r.lines)
    control(p.controller, r.controller, r.lines)
    move(p.plant, r.plant, train, r.tick, r.lines)
    r.tick += 1
    return True


@step
def advance_by_clocks(p: FilteredServoParams, r: FilteredServo, most: int, trace: Bytes, picks: Offsets) -> int:
    """The one loop with every decoder clock run and recorded, for timing diagrams: the same bits, clock by clock.

    Row ``10 tick + clock`` modulo rows of `trace` holds the registers after that clock.
    """
    train = r.plant.train
    n = 0
    while n < most and r.controller.event == 0:
        sense(p.plant, r.plant, train.position, r.tick, r.lines)
        for k in range(CLOCKS):
            control_clock(p.controller, r.controller, r.lines, k)
            write_row(r, r.tick * CLOCKS + k, trace, picks, 1)
        conclude(p.controller, r.controller, r.lines)
        end_tick(p.controller, r.controller, r.lines)
        move(p.plant, r.plant, train, r.tick, r.lines)
        r.tick += 1
        n += 1
    return n


def switch_on(
    p: FilteredServoParams, r: FilteredServo, position: float, sample_us: int, seed: int, act: Act = do
) -> None:
    """Power-on with the slide at `position` [m], the sample clock at `sample_us`; `seed` starts all noise."""
    plant = r.plant
    plant.train.position = plant.sampled = position
    stand_at(p.plant.encoder, plant.encoder, position, seed)
    start_interference(p.plant.interference, plant.interference, seed ^ 0x5DEECE66D)
    plant.amplifier.left = 1
    hold_levels(plant.encoder, r.lines)
    stand_home(p.plant.home, plant.home, r.lines.home, position)
    act(power_on, r.controller, r.lines, sample_us)
