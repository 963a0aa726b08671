"""The controller of a cascade axis: a reference, two encoders read at each sample, two loops, and a word to the drive.

It counts its own ticks from sample to sample; between two of them it does nothing.
"""

from detent.control.cascade_law import CascadeLaw, CascadeLawParams, CascadeReference
from detent.control.cascade_law import control as control_law
from detent.kernel.loop import HostArray, controls
from detent.kernel.registers import CONTROLLER, PLANT, Registers, block, f8, i8, register, u1
from detent.kernel.step import hot_step, step
from detent.sensing.position_sensor import (
    MEMORY,
    EncoderWord,
    PositionSensor,
    PositionSensorParams,
    read_word,
    stand_sensor,
)


class FeedbackParams(Registers):
    """Which encoder the loops use."""

    position_on_load: u1 = register("position loop: 0 encoder of the motor, 1 of the load")
    velocity_on_load: u1 = register("velocity loop: 0 encoder of the motor, 1 of the load")


class CascadeControllerParams(Registers):
    """Everything about the controller that does not change while it runs."""

    sample_ticks: i8 = register("ticks between two samples", unit="tick")
    motor_sensor: PositionSensorParams = block("encoder of the motor")
    load_sensor: PositionSensorParams = block("encoder of the load")
    feedback: FeedbackParams = block("which encoder the loops use")
    law: CascadeLawParams = block("position and velocity loop")


class CascadeController(Registers):
    """What the controller holds."""

    left: i8 = register("ticks until the next sample", unit="tick")
    on: u1 = register("mailbox: 1 while the drive is on, 0 lets the axis coast")
    entry: i8 = register("mailbox: entry of the reference or command that the next sample takes", unit="count")
    reference: CascadeReference = block("what the axis should do")
    motor_sensor: PositionSensor = block("encoder of the motor")
    load_sensor: PositionSensor = block("encoder of the load")
    law: CascadeLaw = block("position and velocity loop")


class CascadeLines(Registers):
    """Wires between controller and plant."""

    motor: EncoderWord = block("encoder of the motor", by=PLANT)
    load: EncoderWord = block("encoder of the load", by=PLANT)
    sync: u1 = register("1 where the encoders latch in the next tick, and the amplifier then takes over", by=CONTROLLER)
    enable: u1 = register("0: the amplifier takes no command", by=CONTROLLER)
    command: f8 = register("command to the amplifier", unit="V", by=CONTROLLER)


@step
def read_sensors(p: CascadeControllerParams, c: CascadeController, lines: CascadeLines) -> None:
    """Sample: take the words of both encoders."""
    read_word(p.motor_sensor, c.motor_sensor, lines.motor)
    read_word(p.load_sensor, c.load_sensor, lines.load)


@hot_step
def refer(c: CascadeController, position: HostArray, velocity: HostArray, acceleration: HostArray) -> None:
    """Take the next entry of the reference; behind the last one it stands where that is."""
    entries = len(position)
    if c.entry < entries:
        c.reference.position = position[c.entry]
        c.reference.velocity = velocity[c.entry]
        c.reference.acceleration = acceleration[c.entry]
        c.entry += 1
    elif entries > 0:
        c.reference.velocity = c.reference.acceleration = 0.0


@step
def decide(p: CascadeControllerParams, c: CascadeController) -> float:
    """Position and velocity loop, on the encoders chosen for them; the command [V]."""
    position = c.load_sensor.position if p.feedback.position_on_load else c.motor_sensor.position
    velocity = c.load_sensor.velocity if p.feedback.velocity_on_load else c.motor_sensor.velocity
    control_law(p.law, c.law, c.reference, position, velocity)
    return c.law.command


@step
def sample(
    p: CascadeControllerParams,
    c: CascadeController,
    lines: CascadeLines,
    position: HostArray,
    velocity: HostArray,
    acceleration: HostArray,
    command: HostArray,
) -> None:
    """Read, decide, command; where there are commands, the loops are open, and 0 comes behind the last one."""
    read_sensors(p, c, lines)
    output, entries = 0.0, len(command)
    if c.on and entries > 0:
        output = command[c.entry] if c.entry < entries else 0.0
        c.entry += 1
    elif c.on:
        refer(c, position, velocity, acceleration)
        output = decide(p, c)
    lines.enable, lines.command = c.on, output


@controls(CascadeControllerParams)
@hot_step
def control(
    p: CascadeControllerParams,
    c: CascadeController,
    lines: CascadeLines,
    position: HostArray,
    velocity: HostArray,
    acceleration: HostArray,
    command: HostArray,
) -> None:
    """One tick: a sample every so many of them."""
    if c.left > 0:
        c.left -= 1
        if c.left == 0:
            lines.sync = 1
        return
    sample(p, c, lines, position, velocity, acceleration, command)
    c.left = p.sample_ticks - 1
    lines.sync = 1 if c.left == 0 else 0


def check_memory(p: CascadeControllerParams) -> None:
    """Refuse delays that are longer than what is kept."""
    for name, s in (("motor", p.motor_sensor), ("load", p.load_sensor)):
        if s.span < 1 or s.delay < 0 or s.delay + s.span >= MEMORY:
            raise ValueError(
                f"{name} sensor: span {s.span} and delay {s.delay} samples, must be 1 or more and 0 or more, "
                f"together {MEMORY - 1} or less"
            )


def power_on(p: CascadeControllerParams, c: CascadeController, lines: CascadeLines, position: float) -> None:
    """The drive comes on at rest, its reference at `position` [m]."""
    stand_sensor(p.motor_sensor, c.motor_sensor, lines.motor)
    stand_sensor(p.load_sensor, c.load_sensor, lines.load)
    c.reference.position = position
    c.on = lines.enable = lines.sync = 1


def follow(c: CascadeController) -> None:
    """What the host has laid ready is taken from its first entry on, from the next sample on."""
    c.entry = 0


def switch_off(c: CascadeController) -> None:
    """Take the drive's command away at the next sample; the axis coasts."""
    c.on = 0
