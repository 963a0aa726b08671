"""The machine of a cascade axis: amplifier, motor, brake, coupling and load, both encoders, and who watches them."""

from detent.drive.effort_source import EffortSource, EffortSourceParams, take_command
from detent.kernel.registers import Registers, block, f8, register, u1
from detent.kernel.step import hot_step, step
from detent.methods.cascade.controller import CascadeLines
from detent.plant.brake import Brake, BrakeParams, brake_force
from detent.plant.hard_stop import HardStop, stop_force
from detent.plant.push import Push, push_force
from detent.plant.two_mass import TwoMass, TwoMassParams
from detent.plant.two_mass_motion import move_masses
from detent.sensing.gauge import Gauge, read_gauge
from detent.sensing.home_marks import (
    EndSwitchParams,
    HomeMarks,
    HomeMarksParams,
    latch,
    sense_ends,
    sense_home,
)


class CascadePlantParams(Registers):
    """Everything about the machine that does not change while it runs."""

    source: EffortSourceParams = block("amplifier")
    machine: TwoMassParams = block("motor, coupling and load")
    motor_count: f8 = register("travel per count of the motor's encoder; 0: it shows the position itself", unit="m")
    load_count: f8 = register("travel per count of the load's encoder; 0: it shows the position itself", unit="m")
    push: Push = block("disturbing force on the load")
    home: HomeMarksParams = block("switch and marks by which it finds its reference")
    ends: EndSwitchParams = block("limit switches, passed by the load")
    stop: HardStop = block("hard stop at one end of the way of the load")
    brake: BrakeParams = block("brake of the motor")


class CascadePlant(Registers):
    """State of the machine."""

    latched: u1 = register("1 from the latch of the encoders until the amplifier takes its command")
    source: EffortSource = block("amplifier")
    machine: TwoMass = block("motor, coupling and load")
    home: HomeMarks = block("switch and marks by which it finds its reference")
    gauge: Gauge = block("what an observer sees of the move of the load")
    brake: Brake = block("brake of the motor")


@step
def latch_both(p: CascadePlantParams, machine: TwoMass, lines: CascadeLines) -> None:
    """Both encoders."""
    latch(lines.motor, p.motor_count, machine.motor.position)
    latch(lines.load, p.load_count, machine.load.position)


@hot_step
def sense(p: CascadePlantParams, plant: CascadePlant, machine: TwoMass, lines: CascadeLines) -> None:
    """Plant to lines: the encoders latch when they are told to."""
    if lines.sync:
        plant.latched = 1
        latch_both(p, machine, lines)
        if p.home.present:
            sense_home(p.home, plant.home, lines.home, machine.motor.position, p.motor_count)
        if p.ends.present:
            sense_ends(p.ends, lines.ends, machine.load.position)


@hot_step
def move(p: CascadePlantParams, plant: CascadePlant, machine: TwoMass, tick: int, lines: CascadeLines) -> None:
    """Lines to plant: the amplifier takes its command at each sample; the mechanics move through the tick."""
    if plant.latched:
        take_command(p.source, plant.source, lines.command if lines.enable else 0.0)
        machine.effort = plant.source.output
        plant.latched = 0
    if p.brake.force > 0.0:
        machine.brake = brake_force(p.brake, plant.brake, lines.brake)
    machine.external = push_force(p.push, tick)
    if p.stop.side != 0.0:
        machine.external += stop_force(p.stop, machine.load.position, machine.load.velocity)
    move_masses(p.machine, machine)
    read_gauge(plant.gauge, tick + 1, machine.load.position, machine.load.velocity)
