"""The controller of a cascade axis: a reference, two encoders read at each sample, two loops, and a word to the drive.

It counts its own ticks from sample to sample; between two of them it does nothing. At each sample it looks after
itself: a fault takes the command away in that sample. A fault, or an axis in position, is an event that the host is to
answer.
"""

from detent.control import guard
from detent.control.brake_line import BrakeLine, BrakeLineParams, is_closed, release
from detent.control.cascade_law import CascadeLaw, CascadeLawParams, CascadeReference
from detent.control.cascade_law import control as control_law
from detent.control.guard import (
    Guard,
    GuardParams,
    Weighing,
    await_arrival,
    begin_weighing,
    enable_guard,
    is_overdue,
    lasting,
    watch,
    watch_number,
    weigh_effort,
)
from detent.control.supervision import Supervision, SupervisionParams, supervise, warm_up
from detent.kernel.loop import HostArray, controls, f8_signal
from detent.kernel.registers import CONTROLLER, PLANT, Fit, Registers, block, f8, i8, real, register, single, u1
from detent.kernel.single import alike
from detent.kernel.step import hot_step, step
from detent.sensing.home_marks import EndWires, HomeWires
from detent.sensing.position_sensor import (
    MEMORY,
    EncoderWord,
    PositionSensor,
    PositionSensorParams,
    read_word,
    stand_sensor,
)

ARRIVED, FAULT = 1, 2  # events
CLOSED, OPEN = 1, 2  # loops, while the drive is on

Feed = tuple[HostArray, HostArray, HostArray, HostArray]
"""What the host lays ready, one entry per sample: a reference's position, velocity and acceleration, or a command."""


class FeedbackParams(Registers):
    """Which encoder the loops use."""

    position_on_load: u1 = register("position loop: 0 encoder of the motor, 1 of the load", option=True)
    velocity_on_load: u1 = register("velocity loop: 0 encoder of the motor, 1 of the load", option=True)


class LimitParams(Registers):
    """What the guard compares with."""

    following_error: real = register("largest magnitude of the position error", unit="m")
    lowest: f8 = register("lower end of the travel, with the window", unit="m")
    highest: f8 = register("upper end of the travel, with the window", unit="m")
    place_on_load: u1 = register("ends of the travel: 0 encoder of the motor, 1 of the load", option=True)
    breaking: real = register("magnitude of the command that breaks the axis loose", unit="V")
    window: real = register("position in-position window", unit="m")
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
    supervision: SupervisionParams = block("what else there is to watch")
    brake: BrakeLineParams = block("brake of the motor")


class Peaks(Registers):
    """Largest magnitudes since the host cleared them."""

    following: real = register("position error", unit="m")
    command: real = register("command", unit="V")
    limited: i8 = register("samples with the command at its limit", unit="count")


class CascadeController(Registers):
    """What the controller holds."""

    left: i8 = register("ticks until the next sample", unit="tick")
    samples: i8 = register("samples since power-on", unit="count")
    on: u1 = register("mailbox: 1 while the drive is on, 2 with open loops, 0 lets the axis coast; a fault clears it")
    guarded: u1 = register("mailbox: 1 while faults switch off")
    known: u1 = register("mailbox: 1 while the position is known: beyond an end of the travel it is then switched off")
    event: u1 = register("mailbox: 1 in position, 2 fault; nothing goes on until the host has cleared it")
    entry: i8 = register(
        "mailbox: entry of the reference or command that the next sample takes", unit="count", range=(0, (1 << 62))
    )
    reference: CascadeReference = block("what the axis should do")
    motor_sensor: PositionSensor = block("encoder of the motor")
    load_sensor: PositionSensor = block("encoder of the load")
    law: CascadeLaw = block("position and velocity loop")
    guard: Guard = block("what is wrong")
    weighing: Weighing = block("what the effort makes of a motion against it")
    supervision: Supervision = block("what was seen around the loop")
    brake: BrakeLine = block("brake of the motor")
    count: i8 = register("motor's encoder at the last sample, for the guard", unit="count")
    within: i8 = register("samples in the window up to this one", unit="count")
    peaks: Peaks = block("largest magnitudes")


class CascadeLines(Registers):
    """Wires between controller and plant."""

    motor: EncoderWord = block("encoder of the motor", by=PLANT)
    load: EncoderWord = block("encoder of the load", by=PLANT)
    home: HomeWires = block("home switch and index", by=PLANT)
    ends: EndWires = block("limit switches", by=PLANT)
    sync: u1 = register("1 where the encoders latch in the next tick, and the amplifier then takes over", by=CONTROLLER)
    enable: u1 = register("0: the amplifier takes no command", by=CONTROLLER)
    brake: u1 = register("1: the brake is released; where there is one", by=CONTROLLER)
    command: f8 = register("command to the amplifier", unit="V", by=CONTROLLER)


# ---- host actions


@step
def power_on(p: CascadeControllerParams, c: CascadeController, lines: CascadeLines, position: float) -> None:
    """At rest, the lines showing where, its brake open, the loops closed and the reference at `position` [m]."""
    stand_sensor(p.motor_sensor, c.motor_sensor, lines.motor)
    stand_sensor(p.load_sensor, c.load_sensor, lines.load)
    c.reference.position, c.count = position, lines.motor.count
    c.on = c.known = lines.enable = lines.sync = 1
    lines.brake = p.brake.present


@step
def engage(c: CascadeController) -> None:
    """The loops are closed where the axis is, and what the guard has seen is forgotten."""
    c.law.integral = 0.0
    enable_guard(c.guard)
    begin_weighing(c.weighing)
    c.on = CLOSED


@step
def open_loops(c: CascadeController, command: float) -> None:
    """The amplifier gets this command [V] until another one is given, or the loops are closed."""
    c.law.command = command
    c.on = OPEN


@step
def close_loops(c: CascadeController) -> None:
    """The loops are closed again, on the way."""
    c.law.integral = 0.0
    c.on = CLOSED


@step
def guard_axis(c: CascadeController, on: u1) -> None:
    """Faults switch off, or do not."""
    c.guarded = on


@step
def begin(c: CascadeController) -> None:
    """The next sample takes the first entry of what has been laid ready."""
    c.entry = 0


@step
def arrive_within(c: CascadeController, samples: i8) -> None:
    """The axis must be in position within so many samples: that, or a fault, is an event."""
    c.within = 0
    await_arrival(c.guard, samples)


@step
def take_event(c: CascadeController) -> int:
    """The host's look at the event, which is answered by it: 0 none."""
    event = c.event
    c.event = 0
    return event


@step
def coast(c: CascadeController) -> None:
    """Take the command away and let the axis coast."""
    c.on = 0


@step
def forget_peaks(c: CascadeController) -> None:
    """A motion begins that has peaks of its own."""
    c.peaks.following = c.peaks.command = 0.0
    c.peaks.limited = 0


@step
def forget_following(c: CascadeController) -> None:
    """Its reference stands: what follows has a peak of its own."""
    c.peaks.following = 0.0


@step
def forget_conduct(c: CascadeController) -> None:
    """A stretch begins that is to be judged for itself."""
    guard.forget_conduct(c.guard)


# ---- a sample


@hot_step
def refer(c: CascadeController, position: f8_signal, velocity: f8_signal, acceleration: f8_signal) -> None:
    """Take the next entry of the reference, of which all parts are as long; behind the last one it stands there."""
    if c.entry < len(position) and c.entry < len(velocity) and c.entry < len(acceleration):
        c.reference.position = position[c.entry]
        c.reference.velocity = velocity[c.entry]
        c.reference.acceleration = acceleration[c.entry]
        c.entry += 1
    elif len(position) > 0:
        c.reference.velocity = c.reference.acceleration = 0.0


@step
def decide(p: CascadeControllerParams, c: CascadeController) -> float:
    """Position and velocity loop, on the encoders chosen for them, or what stands in their place; the command [V]."""
    if c.on == OPEN:
        c.law.position_error = c.law.velocity_error = 0.0
        return c.law.command
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
def find_fault(p: CascadeControllerParams, c: CascadeController, count: int) -> int:
    """One sample of the guard; the code of the fault that switches off, 0 for none.

    Against a brake that still opens an effort may be at its limit, and move nothing.
    """
    error = abs(c.law.position_error)
    late = (not error <= p.limits.following_error) + (not error <= 2 * p.limits.following_error)
    pushing, held = 0, is_closed(p.brake, c.brake)
    if abs(c.law.command) >= p.limits.breaking and not held:
        pushing = 1 if c.law.command > 0.0 else -1
    place, side = c.load_sensor.position if p.limits.place_on_load else c.motor_sensor.position, 0
    if c.known and not place <= p.limits.highest:
        side = 1
    elif c.known and not place >= p.limits.lowest:
        side = -1
    moved = count - c.count
    c.count = count
    watch_number(p.guard, c.guard, error)
    watch_number(p.guard, c.guard, c.law.command)
    weigh_effort(c.weighing, c.guard, c.law.command, moved)
    return watch(p.guard, c.guard, late, side, c.law.limited > 0 and not held, pushing, moved)


@step
def look_after(p: CascadeControllerParams, c: CascadeController, count: int) -> None:
    """Guard and arrival; a fault switches off, and comes before an arrival in the same sample."""
    if find_fault(p, c, count) != 0:
        c.event = FAULT
    elif c.guard.awaited:
        c.within = lasting(abs(c.law.position_error) <= p.limits.window, c.within)
        if c.within >= p.limits.arrival:
            c.event = ARRIVED
        elif is_overdue(c.guard):
            c.event = FAULT
    if c.event != 0:
        c.guard.awaited = 0
    if c.event == FAULT:
        c.on = 0


@step
def sample(
    p: CascadeControllerParams,
    c: CascadeController,
    lines: CascadeLines,
    position: f8_signal,
    velocity: f8_signal,
    acceleration: f8_signal,
    command: f8_signal,
) -> None:
    """Read, decide, command; where there are commands, the loops are open, and 0 comes behind the last one."""
    c.samples += 1
    read_word(p.motor_sensor, c.motor_sensor, lines.motor)
    read_word(p.load_sensor, c.load_sensor, lines.load)
    output = alike(c.law.command, 0)
    if c.on and len(command) > 0:
        output = alike(c.law.command, command[c.entry]) if c.entry < len(command) else alike(c.law.command, 0)
        c.entry += 1
    elif c.on:
        refer(c, position, velocity, acceleration)
        output = decide(p, c)
        note_peaks(c)
        if c.guarded:
            lost = lines.motor.lost | lines.load.lost
            apart = alike(p.supervision.slip, c.motor_sensor.position - c.load_sensor.position)
            lower, upper, error = lines.ends.lower, lines.ends.upper, c.law.position_error
            supervise(p.supervision, c.supervision, p.guard, c.guard, lost, apart, lower, upper, error)
            # A word that is none is no jump: until the next one the motor goes on as it did.
            look_after(p, c, c.count + c.weighing.moved if lines.motor.lost else lines.motor.count)
            output = output if c.on else alike(output, 0)
    warm_up(p.supervision, c.supervision, output)
    lines.enable, lines.command = 1 if c.on else 0, output
    if p.brake.present:
        release(p.brake, c.brake, c.on)
        lines.brake = lines.enable


def fit(p: CascadeControllerParams) -> Fit:
    """How many positions both encoders keep: delay, span and the one of now, up to a power of two.

    A delay may still grow into what is left, a span may not: together they always fit.
    """
    sensors = p.motor_sensor, p.load_sensor
    delay, span = (max(getattr(one, name) for one in sensors) for name in ("delay", "span"))
    places = min(1 << (delay + span).bit_length(), MEMORY)
    unused, kind = MEMORY - places, type(p.motor_sensor)
    state = PositionSensor if kind is PositionSensorParams else single(PositionSensor)
    return Fit(
        {(state, "memory"): places},
        {
            (state, "place"): (0, places - 1), (kind, "unused"): (unused, unused),
            (kind, "delay"): (0, max(0, places - 1 - span)), (kind, "span"): (1, max(1, span)),
        },
        {(kind, "unused"): unused},
    )  # fmt: skip


@controls(CascadeControllerParams)
@hot_step
def control(
    p: CascadeControllerParams,
    c: CascadeController,
    lines: CascadeLines,
    position: f8_signal,
    velocity: f8_signal,
    acceleration: f8_signal,
    command: f8_signal,
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
