"""The cascade axis, wired as its block diagram: the usual servo of today, which the five methods are compared with.

    controller                           lines            plant           brake
                                                                            |
    reference -> position loop -> velocity loop - command -> amplifier -> motor -> coupling -> load
                     ^                 ^                     (delay)        |                    |
                     +-----------------+--------- counts <- encoders <------+--------------------+

One tick is a substep of the mechanics; a sample of the loops comes every so many ticks. The order of a tick with a
sample is: the encoders latch, the controller decides, the amplifier takes over, the masses move. Controller, encoders
and amplifier rest between samples.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.drive import effort_source
from detent.kernel.elementary import one_less_exp
from detent.kernel.loop import HostArray, lay_ready, ticks
from detent.kernel.registers import Registers, block, i8, register
from detent.kernel.step import Act, do, hot_step
from detent.methods.cascade.controller import (
    CascadeController,
    CascadeControllerParams,
    CascadeLines,
    Feed,
    control,
    power_on,
)
from detent.methods.cascade.plant import CascadePlant, CascadePlantParams, latch_both, move, sense
from detent.plant.linear_two_mass import fastest_rate
from detent.plant.two_mass import TwoMass, stand_masses
from detent.sensing import position_sensor
from detent.sensing.home_marks import stand_home

Numbers = NDArray[np.float64]

MAX_RATE = 1.0  # fastest rate of the plant times the tick, at most; see `plant.linear_two_mass.fastest_rate`


class CascadeParams(Registers):
    """Everything about the axis that does not change while it runs."""

    controller: CascadeControllerParams = block("controller")
    plant: CascadePlantParams = block("plant")


class Cascade(Registers):
    """State of the whole axis."""

    tick: i8 = register("ticks since power-on", unit="tick")
    controller: CascadeController = block("controller")
    lines: CascadeLines = block("wires between controller and plant")
    plant: CascadePlant = block("plant")


@ticks(CascadeParams, local="plant.machine")
@hot_step
def tick(p: CascadeParams, r: Cascade, machine: TwoMass, *feed: HostArray) -> bool:
    """One substep of the mechanics, on `machine` of the plant; `along` and `driven` say what the host lays ready."""
    if r.controller.event:
        return False
    sense(p.plant, r.plant, machine, r.lines)
    control(p.controller, r.controller, r.lines, *feed)
    move(p.plant, r.plant, machine, r.tick, r.lines)
    r.tick += 1
    return True


_NONE = lay_ready(np.zeros(0))


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
    set_clocks(p, tick, sample_ticks)
    check_clocks(p)


def set_clocks(p: Any, tick: float, sample_ticks: int) -> None:
    """Set the base tick and the period of the loops."""
    c = p.controller
    c.sample_ticks, p.plant.machine.period = sample_ticks, tick
    c.law.period = c.motor_sensor.period = c.load_sensor.period = tick * sample_ticks


def check_clocks(p: CascadeParams) -> None:
    """Refuse what depends on the clocks and does not fit them."""
    c, machine, delay = p.controller, p.plant.machine, p.plant.source.delay
    tick, sample_ticks = machine.period, c.sample_ticks
    if not 0 <= delay < effort_source.MEMORY:
        raise ValueError(f"delay of the amplifier {delay} samples, must be 0 to {effort_source.MEMORY - 1}")
    for name, s in (("motor", c.motor_sensor), ("load", c.load_sensor)):
        if s.span < 1 or s.delay < 0 or s.delay + s.span >= position_sensor.MEMORY:
            raise ValueError(
                f"{name} sensor: span {s.span} and delay {s.delay} samples, must be 1 or more and 0 or more, "
                f"together {position_sensor.MEMORY - 1} or less"
            )
    if sample_ticks < 1 or tick <= 0.0:
        raise ValueError(f"tick {tick:g} s and {sample_ticks} ticks per sample, must be above 0 and 1 or more")
    if machine.stiffness == 0.0 and machine.half_gap > 0.0:
        raise ValueError(f"half gap {machine.half_gap:g} m of a rigid coupling, must be 0; give it a stiffness")
    rate = fastest_rate(machine)
    if rate * tick > MAX_RATE:
        raise ValueError(
            f"tick {tick:g} s, must be {MAX_RATE / rate:.3g} s or less: the plant has a rate of {rate:.4g} /s"
        )


def set_count(p: CascadeParams, motor: float, load: float) -> None:
    """Travel per count of both encoders [m], which machine and controller must both know."""
    p.plant.motor_count = p.controller.motor_sensor.resolution = motor
    p.plant.load_count = p.controller.load_sensor.resolution = load


def switch_on(p: CascadeParams, r: Cascade, position: float, act: Act = do) -> None:
    """Power-on at rest with motor and load at `position` [m], where the reference stands too."""
    lines = r.lines
    stand_masses(r.plant.machine, position)
    latch_both(p.plant, r.plant.machine, lines)
    stand_home(p.plant.home, r.plant.home, lines.home, position)
    act(power_on, p.controller, r.controller, lines, position)


def rest_off(p: CascadeParams, r: Cascade) -> None:
    """Be without torque at power-on; a brake is closed."""
    c, brake = r.controller, p.controller.brake
    c.on = 0
    if brake.present:
        c.brake.left, r.lines.brake, r.plant.brake.closed = brake.open, 0, 1


def set_off(p: CascadeParams, r: Cascade, velocity: float) -> None:
    """Be in motion [m/s] at power-on: motor, load, and what the encoders have seen so far."""
    r.plant.machine.motor.velocity = r.plant.machine.load.velocity = velocity
    way = velocity * p.controller.law.period
    for sensor in (r.controller.motor_sensor, r.controller.load_sensor):
        places = len(sensor.memory)
        # Place 0 is one sample before the first; before that lies the end of the ring.
        sensor.memory[:] = [sensor.position - way * (1 + (-k) % places) for k in range(places)]
        sensor.velocity = velocity
