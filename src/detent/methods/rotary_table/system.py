"""The rotary table, wired as its block diagram (rotary-table specification 2).

    panel, sequence controller -> positioner -> register 5, D/A -> amplifier -> motor -> gear -> table
                                      ^              tachometer ----^             |
                      absolute angle  |                                           v
                   composition 19 ----+ <---- phase comparators <---- fine and coarse resolver

One tick is a substep of the drive, 100 us. Three clocks are divisions of it: the strobe of the real-time clock, every
2 ms; the interrupt, a fixed delay later; the timer task, every 20 ms. The order of a tick is: sample, decide, actuate,
move. In a tick with both, the interrupt comes in the middle of the task, where steps 118 and 120 meet. Between its
clocks the logic rests, and a tick is the exact motion of the plant.
"""

from detent.control.table_positioner import Positioner, PositionerParams, begin_pass, end_pass, interrupt
from detent.drive.velocity_amplifier import VelocityAmplifier, VelocityAmplifierParams, drive_torque
from detent.kernel.loop import ticks
from detent.kernel.registers import Registers, block, i8, register, u4
from detent.kernel.step import hot_step, step
from detent.plant.gearing import PHASE_PER_RADIAN, Gear, GearParams, follow, output_phase
from detent.plant.rotary_motor import LoadTorque, RotaryMotor, RotaryMotorParams, load_torque, rotate, stand_at
from detent.sensing.angle_composition import AbsoluteAngle, CompositionParams, compose
from detent.sensing.angle_gauge import AngleGauge, read_angle_gauge
from detent.sensing.resolver_counter import Resolver, ResolverParams, count_phase

TICK_US = 100
TICK = TICK_US * 1e-6
"""Base tick [s]."""


class TableClockParams(Registers):
    """Divisions of the base tick."""

    strobe_ticks: i8 = register("period of the strobe", unit="tick")
    delay_ticks: i8 = register("from the strobe to its interrupt, below the strobe's period", unit="tick")
    task_ticks: i8 = register("period of the timer task", unit="tick")


class TableClocks(Registers):
    """When each clock comes next."""

    strobe: i8 = register("tick of the next strobe", unit="tick")
    interrupt: i8 = register("tick of the next interrupt", unit="tick")
    task: i8 = register("tick of the next pass of the timer task", unit="tick")
    wake: i8 = register("the soonest of the three", unit="tick")


class DetectorParams(Registers):
    """Both resolvers and their composition."""

    fine: ResolverParams = block("first resolver 13, on the motor, with comparator 17")
    coarse: ResolverParams = block("second resolver 15, with comparator 18")
    composition: CompositionParams = block("unit 19")


class Detector(Registers):
    """What the angle detector shows since the last strobe."""

    fine: Resolver = block("first resolver 13 and comparator 17")
    coarse: Resolver = block("second resolver 15 and comparator 18")
    absolute: AbsoluteAngle = block("unit 19")


class MachineParams(Registers):
    """Motor and gears."""

    motor: RotaryMotorParams = block("motor 9 and what turns with it")
    gear: GearParams = block("gear 11, to the table")
    reduction: GearParams = block("reduction 14, to the second resolver")
    load: LoadTorque = block("disturbing torque")


class Machine(Registers):
    """State of motor and gears."""

    motor: RotaryMotor = block("motor 9")
    gear: Gear = block("gear 11, to the table")
    reduction: Gear = block("reduction 14, to the second resolver")


class RotaryTableParams(Registers):
    """Everything about the axis that does not change while it runs; the position table may, between two starts."""

    clocks: TableClockParams = block("clocks")
    detector: DetectorParams = block("angle detector")
    positioner: PositionerParams = block("positioner A")
    amplifier: VelocityAmplifierParams = block("D/A converter and amplifier")
    machine: MachineParams = block("motor and gears")


class RotaryTable(Registers):
    """State of the whole axis."""

    tick: i8 = register("periods of 100 us since power-on", unit="tick")
    clocks: TableClocks = block("clocks")
    detector: Detector = block("angle detector")
    positioner: Positioner = block("positioner A")
    amplifier: VelocityAmplifier = block("D/A converter and amplifier")
    machine: Machine = block("motor and gears")
    table: u4 = register("true angle of the table at the last strobe", unit="turn/2^32")
    gauge: AngleGauge = block("what an observer sees of the step")


@step
def sample(p: RotaryTableParams, r: RotaryTable, turns: int, angle: float, coarse_slack: float, slack: float) -> None:
    """Strobe: both comparators and unit 19, the motor at `turns` and `angle` [rad], gears with their slack [rad]."""
    d = r.detector
    count_phase(p.detector.fine, d.fine, int(angle * PHASE_PER_RADIAN))
    count_phase(p.detector.coarse, d.coarse, output_phase(p.machine.reduction, coarse_slack, turns, angle))
    compose(p.detector.composition, d.absolute, d.fine.word, d.coarse.word)
    r.table = output_phase(p.machine.gear, slack, turns, angle)


@step
def decide(p: RotaryTableParams, r: RotaryTable, velocity: float) -> None:
    """Interrupt and task when they are due; the interrupt comes in the middle of the task. Motor at `velocity` [rad/s].

    What an observer sees of the interrupt goes to the gauge.
    """
    task = r.tick == r.clocks.task
    if task:
        r.clocks.task += p.clocks.task_ticks
        begin_pass(p.positioner, r.positioner)
    if r.tick == r.clocks.interrupt:
        r.clocks.interrupt += p.clocks.strobe_ticks
        interrupt(p.positioner, r.positioner, r.detector.absolute.theta)
        r.amplifier.word = r.positioner.s4
        read_angle_gauge(r.gauge, velocity, r.positioner.dr)
    if task:
        end_pass(p.positioner, r.positioner)


@hot_step
def serve(p: RotaryTableParams, r: RotaryTable, machine: Machine) -> None:
    """A tick in which a clock comes."""
    c = r.clocks
    if r.tick == c.strobe:
        c.strobe += p.clocks.strobe_ticks
        sample(p, r, machine.motor.turns, machine.motor.angle, machine.reduction.slack, machine.gear.slack)
    decide(p, r, machine.motor.velocity)
    c.wake = min(c.strobe, c.interrupt, c.task)


@hot_step
def move(p: RotaryTableParams, r: RotaryTable, machine: Machine) -> None:
    """Amplifier and plant through the tick."""
    drive = drive_torque(p.amplifier, r.amplifier, machine.motor.velocity) + load_torque(p.machine.load, r.tick)
    travel = rotate(p.machine.motor, machine.motor, drive, r.amplifier.limited == 0)
    follow(p.machine.gear, machine.gear, travel)
    follow(p.machine.reduction, machine.reduction, travel)


@ticks(RotaryTableParams, local="machine")
@hot_step
def tick(p: RotaryTableParams, r: RotaryTable, machine: Machine) -> bool:
    """One substep of the drive, on `machine` of `r`; none while the host must look: at rest."""
    if r.positioner.event:
        return False
    if r.tick == r.clocks.wake:
        serve(p, r, machine)
    move(p, r, machine)
    r.tick += 1
    return True


def switch_on(p: RotaryTableParams, r: RotaryTable, turns: float, task_at: int, seed: int) -> None:
    """Power-on at rest with the motor at an angle in turns; `seed` starts the noise of both comparators."""
    stand_at(r.machine.motor, turns)
    r.detector.fine.noise.state = seed
    r.detector.coarse.noise.state = seed ^ 0x5DEECE66D
    r.clocks.interrupt = p.clocks.delay_ticks
    r.clocks.task = task_at
    r.positioner.z = 1
