"""Plant of the rotary table: resolvers with their comparators, amplifier with tachometer, motor, gears, load."""

from detent.drive.velocity_amplifier import VelocityAmplifier, VelocityAmplifierParams, drive_torque
from detent.kernel.noise import NoiseSource
from detent.kernel.registers import Registers, block, register, u4
from detent.kernel.step import hot_step, step
from detent.kernel.turn_table import FRACTION
from detent.methods.rotary_table.controller import TableLines
from detent.plant.gearing import PHASE_PER_RADIAN, Gear, GearParams, follow, output_phase
from detent.plant.rotary_motor import LoadTorque, RotaryMotor, RotaryMotorParams, load_torque, rotate
from detent.sensing.gauge import AngleGauge
from detent.sensing.resolver_counter import ResolverParams, count_phase


class TrainParams(Registers):
    """Motor and gears."""

    motor: RotaryMotorParams = block("motor 9 and what turns with it")
    gear: GearParams = block("gear 11, to the table")
    reduction: GearParams = block("reduction 14, to the second resolver")
    load: LoadTorque = block("disturbing torque")


class Train(Registers):
    """State of motor and gears."""

    motor: RotaryMotor = block("motor 9")
    gear: Gear = block("gear 11, to the table")
    reduction: Gear = block("reduction 14, to the second resolver")


class TablePlantParams(Registers):
    """Constants of the plant."""

    fine: ResolverParams = block("first resolver 13, on the motor, with comparator 17")
    coarse: ResolverParams = block("second resolver 15, with comparator 18")
    amplifier: VelocityAmplifierParams = block("D/A converter and amplifier")
    train: TrainParams = block("motor and gears")


class TablePlant(Registers):
    """State of the plant."""

    fine: NoiseSource = block("noise of comparator 17")
    coarse: NoiseSource = block("noise of comparator 18")
    amplifier: VelocityAmplifier = block("amplifier")
    train: Train = block("motor and gears")
    table: u4 = register("true angle of the table at the last strobe", unit="turn/2^32")
    gauge: AngleGauge = block("what an observer sees of the step")


@step
def latch(
    p: TablePlantParams, r: TablePlant, lines: TableLines, turns: int, angle: float, coarse_slack: float, slack: float
) -> None:
    """Both comparators, the motor at `turns` and `angle` [rad], gears with their slack [rad]; and the true angle."""
    coarse = output_phase(p.train.reduction, coarse_slack, turns, angle)
    lines.fine = count_phase(p.fine, r.fine, int(angle * PHASE_PER_RADIAN))
    lines.coarse = count_phase(p.coarse, r.coarse, coarse)
    r.table = output_phase(p.train.gear, slack, turns, angle) & FRACTION


@hot_step
def sense(p: TablePlantParams, r: TablePlant, train: Train, lines: TableLines) -> None:
    """Plant to lines."""
    if lines.strobe:
        motor = train.motor
        latch(p, r, lines, motor.turns, motor.angle, train.reduction.slack, train.gear.slack)


@hot_step
def move(p: TablePlantParams, r: TablePlant, train: Train, lines: TableLines, tick: int) -> None:
    """Lines to plant: amplifier, motor and gears through the tick; switched off, the amplifier gives no current."""
    drive, held = load_torque(p.train.load, tick), False
    if lines.enable:
        drive += drive_torque(p.amplifier, r.amplifier, lines.word, train.motor.velocity)
        held = r.amplifier.limited == 0
    else:
        r.amplifier.torque = 0.0
    travel = rotate(p.train.motor, train.motor, drive, held)
    follow(p.train.gear, train.gear, travel)
    follow(p.train.reduction, train.reduction, travel)
