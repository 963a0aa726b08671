"""From a checked specification to the parameters of the cascade axis, in the coordinate of the axis."""

import math
from typing import Any

from detent.axisfile import blocks
from detent.axisfile.blocks import fill_guard, fill_push, samples
from detent.axisfile.elementwise import least, most, root, up
from detent.axisfile.tables import HomeTable
from detent.control.cascade_law import CascadeLawParams
from detent.control.homing import HomingParams
from detent.kernel.elementary import one_less_exp
from detent.methods.cascade.controller import CascadeControllerParams
from detent.methods.cascade.derive import grain
from detent.methods.cascade.loop import machine_of
from detent.methods.cascade.schema import IDEAL_ENCODER, CascadeSpec
from detent.methods.cascade.system import CascadeParams, check_clocks, set_clocks, set_count, smoothing
from detent.planning.profile import MotionLimits
from detent.plant.linear_two_mass import fastest_rate

LARGEST_ANGLE = 0.5
"""Fastest rate of the plant times the tick: a swing of that rate then loses 0.02 % of its amplitude per radian."""

CONTACT_TIME = 0.01  # time that tells of a hard stop [s], or half as long as the guard would let it
DEEPEST = 1e-4  # share of the travel by which the largest effort presses a hard stop in

LINK_TIME = 5e-3  # within which a second word that is none is a fault [s]
HALF_SWING = 0.1  # longest half swing that is part of an oscillation [s]

LONGEST_TICK = 1e-4  # longest tick [s]: a push begins, and a record is written, at whole ticks
STANDING = 0.02  # counts in a sample below which a measured velocity, as filtered, is rest


def build_cascade(spec: CascadeSpec) -> CascadeParams:
    """Parameters of the cascade axis."""
    p = spec.registers_of(CascadeParams)()
    fill_cascade(p, spec)
    check_clocks(p)
    return p


def fill_cascade(p: Any, spec: CascadeSpec) -> None:
    """Fill the parameters; where the specification holds arrays, those of many machines, each in columns."""
    drive, period = spec.drive, spec.method.sample_period
    c, source, load_encoder = p.controller, p.plant.source, spec.load_encoder or IDEAL_ENCODER
    machine = machine_of(spec)
    _fill(p.plant.machine, machine)
    source.gain = drive.voltage_gain if drive.input == "voltage" else spec.effort_per_command
    source.step, source.limit, source.delay = drive.command_step, spec.largest_command, drive.delay
    for sensor, table in ((c.motor_sensor, spec.encoder), (c.load_sensor, load_encoder)):
        sensor.delay, sensor.span = table.delay, table.velocity_span
        sensor.smoothing = smoothing(table.velocity_filter, period)
    set_count(p, spec.encoder.resolution, load_encoder.resolution)
    c.feedback.position_on_load = spec.method.feedback.position == "load"
    c.feedback.velocity_on_load = spec.method.feedback.velocity == "load"
    _fill_law(c.law, spec)
    _fill_limits(c, spec)
    _fill_supervision(c, spec)
    if spec.limit_switches is not None:
        ends, switches = p.plant.ends, spec.limit_switches
        ends.present, ends.lower, ends.upper = 1, switches.lower, switches.upper
    ticks = sample_ticks(period, fastest_rate(machine))
    _fill_brake(p, spec, period / ticks)
    fill_push(p.plant.push, spec.disturbance.push, period / ticks)
    set_clocks(p, period / ticks, ticks)
    if spec.home is not None:
        _fill_home(p, spec, spec.home)


def kept(spec: CascadeSpec) -> dict[str, float]:
    """What the controller keeps though the machine is another than that of the file, by key.

    Its feedforward reckons with the machine that it was made for, and so does its guard.
    """
    found = {f"method.feed_forward.model.{name}": value for name, value in spec.reckoned.items()}
    if spec.axis.motion == "linear":
        del found["method.feed_forward.model.pendulum"]
    return found | {f"protection.{name}": getattr(spec.protection, name) for name in ("stuck_effort", "slip")}


def _fill_brake(p: Any, spec: CascadeSpec, tick: Any) -> None:
    """The controller gives the brake its time in whole samples, so that it is open before they are over."""
    table, line, brake = spec.brake, p.controller.brake, p.plant.brake
    if table is not None:
        line.present, line.open = 1, samples(table.open_time, spec.method.sample_period)
        brake.force = table.force
        brake.open, brake.close = samples(table.open_time, tick), samples(table.close_time, tick)


def _fill_home(p: Any, spec: CascadeSpec, home: HomeTable) -> None:
    """The marks of the machine lie where the file says that the axis finds them, or the hard stop does."""
    if home.by == "contact":
        stop, period = p.plant.stop, p.plant.machine.period
        stop.side, stop.place = home.side, home.position
        mass = spec.mechanics.load_mass if spec.mechanics.coupling else spec.mass
        rate = LARGEST_ANGLE / period
        stop.stiffness = least(spec.largest_effort / (DEEPEST * spec.limits.travel), mass * (rate * rate))
        stop.damping = root(stop.stiffness * mass)
        return
    blocks.fill_marks(p.plant.home, home, spec.mechanics.travel_per_revolution or 0.0)


def homing_params(spec: CascadeSpec, home: HomeTable) -> HomingParams:
    """How the controller looks for its reference."""
    travel, table = spec.limits.travel, spec.protection
    watches = [time for time in (table.stuck_time, table.reversed_time) if time > 0.0]
    return blocks.homing_params(
        home, travel=travel, pitch=spec.mechanics.travel_per_revolution or 0.0,
        count=spec.encoder_of("position").resolution or 1e-9 * travel, look=spec.method.sample_period,
        pressed=min([CONTACT_TIME, *(0.5 * time for time in watches)]),
    )  # fmt: skip


def sample_ticks(sample_period: float, rate: float) -> int:
    """Ticks in a sample."""
    return most(1, up(sample_period * most(rate / LARGEST_ANGLE, 1 / LONGEST_TICK) * (1 - 1e-9)))


def motion_limits(spec: CascadeSpec) -> MotionLimits:
    """What a move may do."""
    limits = spec.limits
    return MotionLimits(limits.speed, limits.acceleration, math.inf if limits.jerk is None else limits.jerk)


def _fill(p: Any, values: Any) -> None:
    """Fill registers from what has their names, block by block."""
    named: dict[str, Any] = values.__dict__
    for name, value in named.items():
        if hasattr(value, "__dict__"):
            _fill(getattr(p, name), value)
        else:
            setattr(p, name, value)


def _fill_limits(p: CascadeControllerParams, spec: CascadeSpec) -> None:
    method, table, resolution = spec.method, spec.protection, spec.encoder.resolution
    limits, period = p.limits, method.sample_period
    limits.following_error, limits.window = method.following_error, method.in_position
    limits.lowest, limits.highest = spec.limits.lowest - method.in_position, spec.highest + method.in_position
    limits.place_on_load = spec.load_encoder is not None
    limits.arrival = samples(method.in_position_time, period)
    limits.breaking = table.stuck_effort * spec.largest_command
    # The loops may ask for more than the speed of a move, to catch up.
    speed = max(spec.limits.speed, method.velocity_limit)
    fill_guard(p.guard, table, sample=period, speed=speed / resolution if resolution else 0.0)
    p.guard.following = 1
    if resolution == 0.0:  # an ideal encoder has no counts to be looked after
        p.guard.speed = p.guard.jump = p.guard.stuck = p.guard.reversed = 0
    elif table.reversed_time > 0.0:
        # And one swing, in which the motor need not go where effort and force together send the axis.
        p.guard.reversed += spec.drive.delay + spec.encoder.delay + samples(spec.swing, period)


def _fill_supervision(c: CascadeControllerParams, spec: CascadeSpec) -> None:
    p, table, period = c.supervision, spec.protection, spec.method.sample_period
    tables = (spec.encoder, spec.load_encoder)
    p.link = samples(LINK_TIME, period) if any(one.checked for one in tables if one is not None) else 0
    p.slip = table.slip if spec.load_encoder is not None else 0.0
    p.swing, p.slowest = table.oscillation, samples(HALF_SWING, period)
    p.switches = spec.limit_switches is not None
    if table.thermal_time > 0.0 and spec.motor is not None and spec.motor.max_current is not None:
        p.bears = spec.motor.max_current / spec.drive.current_per_volt
        p.warming = one_less_exp(period / table.thermal_time)


def _fill_law(p: CascadeLawParams, spec: CascadeSpec) -> None:
    method, feed, shares = spec.method, p.feed_forward, spec.method.feed_forward
    p.position_pid, p.max_command = method.structure == "pid", spec.largest_command
    count = spec.encoder_of("velocity").resolution or grain(spec)
    p.dead_band, p.standing = method.dead_band, STANDING * count / method.sample_period
    p.cascade.position_gain, p.cascade.max_velocity = method.position_gain, method.velocity_limit
    p.cascade.velocity_gain, p.cascade.integral_gain = method.velocity_gain, method.velocity_integral
    p.pid.proportional, p.pid.integral, p.pid.derivative = method.proportional, method.integral, method.derivative
    p.pid.smoothing = smoothing(method.derivative_filter, method.sample_period)
    known = spec.reckoned
    per_command = known["effort_per_volt"]
    feed.velocity, feed.dead_band = shares.velocity, shares.dead_band
    feed.acceleration = shares.acceleration * known["mass"] / per_command
    feed.viscous = shares.viscous * known["viscous"] / per_command
    feed.coulomb_positive = shares.coulomb * known["coulomb_positive"] / per_command
    feed.coulomb_negative = shares.coulomb * known["coulomb_negative"] / per_command
    feed.weight = shares.weight * known["weight"] / per_command
    feed.pendulum = shares.weight * known["pendulum"] / per_command
