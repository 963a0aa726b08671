"""The machine of a cascade axis: amplifier, motor, coupling and load, both encoders, and who watches them."""

import math

from detent.drive.effort_source import EffortSource, EffortSourceParams, take_command
from detent.kernel.registers import Registers, block, f8, register, u1
from detent.kernel.step import hot_step, step
from detent.methods.cascade.controller import CascadeLines
from detent.plant.push import Push, push_force
from detent.plant.two_mass import TwoMass, TwoMassParams
from detent.plant.two_mass_motion import move_masses
from detent.sensing.gauge import Gauge, read_gauge
from detent.sensing.position_sensor import EncoderWord


class CascadePlantParams(Registers):
    """Everything about the machine that does not change while it runs."""

    source: EffortSourceParams = block("amplifier")
    machine: TwoMassParams = block("motor, coupling and load")
    motor_count: f8 = register("travel per count of the motor's encoder; 0: it shows the position itself", unit="m")
    load_count: f8 = register("travel per count of the load's encoder; 0: it shows the position itself", unit="m")
    push: Push = block("disturbing force on the load")


class CascadePlant(Registers):
    """State of the machine."""

    latched: u1 = register("1 from the latch of the encoders until the amplifier takes its command")
    source: EffortSource = block("amplifier")
    machine: TwoMass = block("motor, coupling and load")
    gauge: Gauge = block("what an observer sees of the move of the load")


@step
def latch(word: EncoderWord, travel: float, position: float) -> None:
    """The nearest count of a scale at `position` [m], `travel` [m] per count; without counts the position itself."""
    if travel == 0.0:
        word.place = position
    else:
        word.count = math.floor(position / travel + 0.5)


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


@hot_step
def move(p: CascadePlantParams, plant: CascadePlant, machine: TwoMass, tick: int, lines: CascadeLines) -> None:
    """Lines to plant: the amplifier takes its command at each sample; the mechanics move through the tick."""
    if plant.latched:
        take_command(p.source, plant.source, lines.command if lines.enable else 0.0)
        machine.effort = plant.source.output
        plant.latched = 0
    machine.external = push_force(p.push, tick)
    move_masses(p.machine, machine)
    read_gauge(plant.gauge, tick + 1, machine.load.position, machine.load.velocity)
