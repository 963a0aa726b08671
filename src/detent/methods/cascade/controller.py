"""The controller of a cascade axis: a reference, two encoders read at each sample, two loops, and a word to the drive.

It counts its own ticks from sample to sample; between two of them it does nothing. At each sample it looks after
itself: a fault takes the command away in that sample. A fault, or an axis in position, is an event that the host is to
answer.
"""

from detent.control.cascade_law import CascadeLaw, CascadeLawParams, CascadeReference
from detent.control.cascade_law import control as control_law
from detent.control.guard import (
    Guard,
    GuardParams,
    await_arrival,
    enable_guard,
    is_overdue,
    lasting,
    watch,
    weigh_effort,
)
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

ARRIVED, FAULT = 1, 2  # events


class FeedbackParams(Registers):
    """Which encoder the loops use."""

    position_on_load: u1 = register("position loop: 0 encoder of the motor, 1 of the load")
    velocity_on_load: u1 = register("velocity loop: 0 encoder of the motor, 1 of the load")


class LimitParams(Registers):
    """What the guard compares with."""

    following_error: f8 = register("largest magnitude of the position error", unit="m")
    lowest: f8 = register("lower end of the travel, with the window", unit="m")
    highest: f8 = register("upper end of the travel, with the window", unit="m")
    place_on_load: u1 = register("ends of the travel: 0 encoder of the motor, 1 of the load")
    breaking: f8 = register("magnitude of the command that breaks the axis loose", unit="V")
    window: f8 = register("position error that counts as in position", unit="m")
    arrival: i8 = register("samples in the window until the axis is in position", unit="count")


class CascadeControllerParams(Registers):
    """Everything about the controller that does not change while it runs."""

    sample_ticks: i8 = register("ticks between two samples", unit="tick")
    motor_sensor: PositionSensorParams = block("encoder of the motor")
    load_sensor: PositionSensorParams = block("encoder of the load")
    feedback: FeedbackParams = block("which encoder the loops use")
    law: CascadeLawParams = block("position and velocity loop")
    limits: LimitParams = block("what the guard compares with")
    guard: GuardParams = block("how long something may be wrong")


class Peaks(Registers):
    """Largest magnitudes since the host cleared them."""

    following: f8 = register("position error", unit="m")
    command: f8 = register("command", unit="V")
    limited: i8 = register("samples with the command at its limit", unit="count")


class CascadeController(Registers):
    """What the controller holds."""

    left: i8 = register("ticks until the next sample", unit="tick")
    samples: i8 = register("samples since power-on", unit="count")
    on: u1 = register("mailbox: 1 while the drive is on, 0 lets the axis coast; a fault clears it")
    guarded: u1 = register("mailbox: 1 while faults switch off")
    event: u1 = register("mailbox: 1 in position, 2 fault; nothing goes on until the host has cleared it")
    entry: i8 = register("mailbox: entry of the reference or command that the next sample takes", unit="count")
    reference: CascadeReference = block("what the axis should do")
    motor_sensor: PositionSensor = block("encoder of the motor")
    load_sensor: PositionSensor = block("encoder of the load")
    law: CascadeLaw = block("position and velocity loop")
    guard: Guard = block("what is wrong")
    count: i8 = register("motor's encoder at the last sample, for the guard", unit="count")
    within: i8 = register("samples in the window up to this one", unit="count")
    peaks: Peaks = block("largest magnitudes")


class CascadeLines(Registers):
    """Wires between controller and plant."""

    motor: EncoderWord = block("encoder of the motor", by=PLANT)
    load: EncoderWord = block("encoder of the load", by=PLANT)
    sync: u1 = register("1 where the encoders latch in the next tick, and the amplifier then takes over", by=CONTROLLER)
    enable: u1 = register("0: the amplifier takes no command", by=CONTROLLER)
    command: f8 = register("command to the amplifier", unit="V", by=CONTROLLER)


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
def note_peaks(c: CascadeController) -> None:
    """Remember the largest magnitudes."""
    c.peaks.following = max(c.peaks.following, abs(c.law.position_error))
    c.peaks.command = max(c.peaks.command, abs(c.law.command))
    if c.law.limited:
        c.peaks.limited += 1


@step
def beyond_ends(p: CascadeControllerParams, c: CascadeController) -> int:
    """End of the travel that has been passed, 1 upper, -1 lower; what is no number has passed one too."""
    place = c.load_sensor.position if p.limits.place_on_load else c.motor_sensor.position
    if not place <= p.limits.highest:
        return 1
    return -1 if not place >= p.limits.lowest else 0


@step
def find_fault(p: CascadeControllerParams, c: CascadeController, count: int) -> int:
    """One sample of the guard; the code of the fault, 0 while there is none."""
    late = not abs(c.law.position_error) <= p.limits.following_error
    pushing = 0
    if abs(c.law.command) >= p.limits.breaking:
        pushing = 1 if c.law.command > 0.0 else -1
    moved = count - c.count
    c.count = count
    weigh_effort(c.guard, c.law.command, moved)
    return watch(p.guard, c.guard, late, beyond_ends(p, c), c.law.limited > 0, pushing, moved)


@step
def find_arrival(p: CascadeControllerParams, c: CascadeController) -> int:
    """One sample of an axis that is to come into position: the event that it makes, 0 none."""
    c.within = lasting(abs(c.law.position_error) <= p.limits.window, c.within)
    if c.within >= p.limits.arrival:
        return ARRIVED
    return FAULT if is_overdue(c.guard) else 0


@step
def look_after(p: CascadeControllerParams, c: CascadeController, count: int) -> None:
    """Guard and arrival; a fault switches off, and comes before an arrival in the same sample."""
    if find_fault(p, c, count) != 0:
        c.event = FAULT
    elif c.guard.awaited:
        c.event = find_arrival(p, c)
    if c.event != 0:
        c.guard.awaited = 0
    if c.event == FAULT:
        c.on = 0


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
    c.samples += 1
    read_word(p.motor_sensor, c.motor_sensor, lines.motor)
    read_word(p.load_sensor, c.load_sensor, lines.load)
    output, entries = 0.0, len(command)
    if c.on and entries > 0:
        output = command[c.entry] if c.entry < entries else 0.0
        c.entry += 1
    elif c.on:
        refer(c, position, velocity, acceleration)
        output = decide(p, c)
        note_peaks(c)
        if c.guarded:
            look_after(p, c, lines.motor.count)
            output = output if c.on else 0.0
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
    c.count = lines.motor.count
    c.on = lines.enable = lines.sync = 1


def follow(c: CascadeController) -> None:
    """What the host has laid ready is taken from its first entry on, from the next sample on."""
    c.entry = 0


def guard_axis(c: CascadeController) -> None:
    """From the next sample on, faults switch off."""
    enable_guard(c.guard)
    c.guarded = 1


def await_position(c: CascadeController, samples: int) -> None:
    """The axis must be in position within so many samples, which is an event, or not, which is a fault."""
    c.within = 0
    await_arrival(c.guard, samples)


def acknowledge(c: CascadeController) -> int:
    """Take the event, 0 if there is none; the axis goes on."""
    event, c.event = c.event, 0
    return event


def clear_peaks(c: CascadeController) -> None:
    """Remember from the next sample on."""
    c.peaks = Peaks()


def switch_off(c: CascadeController) -> None:
    """Take the drive's command away at the next sample; the axis coasts."""
    c.on = 0
