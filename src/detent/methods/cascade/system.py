"""The cascade axis, wired as its block diagram: the usual servo of today, which the five methods are compared with.

    reference -> position loop -> velocity loop -> amplifier -> motor -> coupling -> load
                     ^                 ^           (delay)        |                    |
                     +-----------------+------- sensors <---------+--------------------+

One tick is a substep of the mechanics; a sample of the loops comes every so many ticks. The order of a tick with a
sample is: sample, decide, actuate, move. Reference, sensors and law rest between samples; the output of the amplifier
holds.
"""

import numpy as np
from numpy.typing import NDArray

from detent.control.cascade_law import CascadeLaw, CascadeLawParams, CascadeReference, control
from detent.drive.effort_source import MEMORY as SOURCE_MEMORY
from detent.drive.effort_source import EffortSource, EffortSourceParams, take_command
from detent.kernel.elementary import one_less_exp
from detent.kernel.loop import HostArray, lay_ready, ticks
from detent.kernel.registers import Registers, block, i8, register, u1
from detent.kernel.step import hot_step, step
from detent.plant.push import Push, push_force
from detent.plant.two_mass import TwoMass, TwoMassParams, fastest_rate, stand_masses
from detent.plant.two_mass_motion import move_masses
from detent.sensing.gauge import Gauge, read_gauge
from detent.sensing.position_sensor import MEMORY as SENSOR_MEMORY
from detent.sensing.position_sensor import PositionSensor, PositionSensorParams, read_position, stand_sensor

Numbers = NDArray[np.float64]

MAX_RATE = 1.0
"""Fastest rate of the plant times the tick, at most; see `plant.two_mass.fastest_rate`."""


class FeedbackParams(Registers):
    """Which sensor the loops use."""

    position_on_load: u1 = register("position loop: 0 sensor of the motor, 1 of the load")
    velocity_on_load: u1 = register("velocity loop: 0 sensor of the motor, 1 of the load")


class CascadeParams(Registers):
    """Everything about the axis that does not change while it runs."""

    sample_ticks: i8 = register("ticks between two samples", unit="tick")
    motor_sensor: PositionSensorParams = block("encoder of the motor")
    load_sensor: PositionSensorParams = block("encoder of the load")
    feedback: FeedbackParams = block("which sensor the loops use")
    law: CascadeLawParams = block("position and velocity loop")
    source: EffortSourceParams = block("amplifier")
    machine: TwoMassParams = block("motor, coupling and load")
    push: Push = block("disturbing force on the load")


class Cascade(Registers):
    """State of the whole axis."""

    tick: i8 = register("ticks since power-on", unit="tick")
    wake: i8 = register("tick of the next sample", unit="tick")
    entry: i8 = register("entry of the reference or command that the next sample takes", unit="count")
    reference: CascadeReference = block("what the axis should do")
    motor_sensor: PositionSensor = block("encoder of the motor")
    load_sensor: PositionSensor = block("encoder of the load")
    law: CascadeLaw = block("position and velocity loop")
    source: EffortSource = block("amplifier")
    machine: TwoMass = block("motor, coupling and load")
    gauge: Gauge = block("what an observer sees of the move of the load")


@step
def sample(p: CascadeParams, r: Cascade, machine: TwoMass) -> None:
    """Read both encoders."""
    read_position(p.motor_sensor, r.motor_sensor, machine.motor.position)
    read_position(p.load_sensor, r.load_sensor, machine.load.position)


@step
def decide(p: CascadeParams, r: Cascade) -> None:
    """Position and velocity loop, on the sensors chosen for them."""
    position = r.load_sensor.position if p.feedback.position_on_load else r.motor_sensor.position
    velocity = r.load_sensor.velocity if p.feedback.velocity_on_load else r.motor_sensor.velocity
    control(p.law, r.law, r.reference, position, velocity)


@hot_step
def take_reference(r: Cascade, position: HostArray, velocity: HostArray, acceleration: HostArray) -> None:
    """Take the next entry; behind the last one the reference stands where that is."""
    entries = len(position)
    if r.entry < entries:
        r.reference.position = position[r.entry]
        r.reference.velocity = velocity[r.entry]
        r.reference.acceleration = acceleration[r.entry]
        r.entry += 1
    elif entries > 0:
        r.reference.velocity = r.reference.acceleration = 0.0


@step
def serve(
    p: CascadeParams,
    r: Cascade,
    machine: TwoMass,
    position: HostArray,
    velocity: HostArray,
    acceleration: HostArray,
    command: HostArray,
) -> None:
    """Sample, decide, actuate; where there are commands, the loops are open, and 0 comes behind the last one."""
    sample(p, r, machine)
    entries = len(command)
    if entries > 0:
        output = command[r.entry] if r.entry < entries else 0.0
        r.entry += 1
    else:
        take_reference(r, position, velocity, acceleration)
        decide(p, r)
        output = r.law.command
    take_command(p.source, r.source, output)
    machine.effort = r.source.output
    r.wake += p.sample_ticks


@hot_step
def move(p: CascadeParams, r: Cascade, machine: TwoMass) -> None:
    """The mechanics through a tick."""
    machine.external = push_force(p.push, r.tick)
    move_masses(p.machine, machine)
    r.tick += 1
    read_gauge(r.gauge, r.tick, machine.load.position, machine.load.velocity)


@ticks(CascadeParams, local="machine")
@hot_step
def tick(
    p: CascadeParams,
    r: Cascade,
    machine: TwoMass,
    position: HostArray,
    velocity: HostArray,
    acceleration: HostArray,
    command: HostArray,
) -> bool:
    """One substep of the mechanics, on `machine` of `r`; see `along` and `driven` for what the host has laid ready."""
    if r.tick == r.wake:
        serve(p, r, machine, position, velocity, acceleration, command)
    move(p, r, machine)
    return True


Feed = tuple[HostArray, HostArray, HostArray, HostArray]

_NONE = lay_ready(np.zeros(0))

STANDING: Feed = (_NONE, _NONE, _NONE, _NONE)
"""Feed of an axis whose reference stands in its registers."""


def along(position: Numbers, velocity: Numbers, acceleration: Numbers) -> Feed:
    """Feed of an axis that follows a reference [m], [m/s], [m/s^2], one entry per sample from `entry` on."""
    return lay_ready(position), lay_ready(velocity), lay_ready(acceleration), _NONE


def driven(command: Numbers) -> Feed:
    """Feed of an axis without its loops: what the amplifier gets [V], one entry per sample from `entry` on."""
    return _NONE, _NONE, _NONE, lay_ready(command)


def smoothing(time_constant: float, period: float) -> float:
    """Part of a new value that a first-order filter takes over at a sample; 1 for a time constant of 0 [s]."""
    return one_less_exp(period / time_constant) if time_constant > 0.0 else 1.0


def fill_clocks(p: CascadeParams, tick: float, sample_ticks: int) -> None:
    """Set the base tick and the period of the loops, and check what depends on them."""
    _check_memory(p)
    if sample_ticks < 1 or tick <= 0.0:
        raise ValueError(f"tick {tick:g} s and {sample_ticks} ticks per sample, must be above 0 and 1 or more")
    if p.machine.stiffness == 0.0 and p.machine.half_gap > 0.0:
        raise ValueError(f"half gap {p.machine.half_gap:g} m of a rigid coupling, must be 0; give it a stiffness")
    rate = fastest_rate(p.machine)
    if rate * tick > MAX_RATE:
        raise ValueError(
            f"tick {tick:g} s, must be {MAX_RATE / rate:.3g} s or less: the plant has a rate of {rate:.4g} /s"
        )
    p.sample_ticks = sample_ticks
    p.machine.period = tick
    p.law.period = p.motor_sensor.period = p.load_sensor.period = tick * sample_ticks


def _check_memory(p: CascadeParams) -> None:
    if not 0 <= p.source.delay < SOURCE_MEMORY:
        raise ValueError(f"delay of the amplifier {p.source.delay} samples, must be 0 to {SOURCE_MEMORY - 1}")
    for name, s in (("motor", p.motor_sensor), ("load", p.load_sensor)):
        if s.span < 1 or s.delay < 0 or s.delay + s.span >= SENSOR_MEMORY:
            raise ValueError(
                f"{name} sensor: span {s.span} and delay {s.delay} samples, must be 1 or more and 0 or more, "
                f"together {SENSOR_MEMORY - 1} or less"
            )


def switch_on(p: CascadeParams, r: Cascade, position: float) -> None:
    """Power-on at rest with motor and load at `position` [m], where the reference stands too."""
    stand_masses(r.machine, position)
    stand_sensor(p.motor_sensor, r.motor_sensor, position)
    stand_sensor(p.load_sensor, r.load_sensor, position)
    r.reference.position = position
