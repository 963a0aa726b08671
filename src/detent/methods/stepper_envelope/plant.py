"""Plant of one stepper: motor, spindle and load on the lines of its controller, and what an observer sees of them."""

from detent.kernel.registers import Registers, block, f8, i8, register
from detent.kernel.step import hot_step
from detent.methods.stepper_envelope.controller import StepperLines
from detent.plant.stepper_rotor import RotorParams, StepperRotor, free_rotor, hold_field, step_field, turn_rotor
from detent.sensing.home_marks import HomeMarks, HomeMarksParams, sense_marks


class StepperPlantParams(Registers):
    """Motor, load and observer."""

    clock_hz: i8 = register("ticks per second that a period on the lines is counted in", unit="Hz")
    tolerance: f8 = register("distance of the rotor from its field that counts as settled, in steps", unit="count")
    rotor: RotorParams = block("motor and load")
    home: HomeMarksParams = block("switch by which it finds its reference")
    origin: f8 = register("position where the rotor's angle is 0", unit="m")
    way: f8 = register("travel per angle of the rotor", unit="m/rad")


class StepperGauge(Registers):
    """What an observer notes of a motion; it clears the registers itself."""

    peak_hz: f8 = register("largest step frequency", unit="Hz")
    outside: i8 = register("tick in which the rotor was last outside its tolerance", unit="tick")


class StepperPlant(Registers):
    """Field and rotor; nothing of them is sensed, but a switch on their way."""

    rotor: StepperRotor = block("motor")
    gauge: StepperGauge = block("what an observer sees")
    home: HomeMarks = block("switch by which it finds its reference")


@hot_step
def move(p: StepperPlantParams, tick: int, lines: StepperLines, plant: StepperPlant) -> None:
    """What a pulse, or none, does to the field, and the field to the rotor."""
    if lines.pulse:
        hz = p.clock_hz / lines.period
        plant.gauge.peak_hz = max(plant.gauge.peak_hz, hz)
        step_field(p.rotor, plant.rotor, lines.direction, hz)
    elif lines.period == 0:
        hold_field(plant.rotor)
    if lines.disable:
        free_rotor(plant.rotor)
    turn_rotor(p.rotor, plant.rotor)
    if abs(plant.rotor.lag) > p.tolerance:
        plant.gauge.outside = tick + 1
    if p.home.present:
        sense_marks(p.home, plant.home, lines.home, p.origin + plant.rotor.angle * p.way)
