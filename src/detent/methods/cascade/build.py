"""From a checked specification to the parameters of the cascade axis, in the coordinate of the axis."""

import math
from typing import Any

from detent.axisfile.blocks import fill_guard, fill_push, samples
from detent.control.cascade_law import FeedForwardParams
from detent.methods.cascade.controller import CascadeControllerParams
from detent.methods.cascade.loop import machine_of
from detent.methods.cascade.schema import IDEAL_ENCODER, CascadeSpec, EncoderTable
from detent.methods.cascade.system import CascadeParams, fill_clocks, set_count, smoothing
from detent.planning.profile import MotionLimits
from detent.plant.linear_two_mass import fastest_rate
from detent.sensing.position_sensor import PositionSensorParams

LARGEST_ANGLE = 0.5
"""Fastest rate of the plant times the tick: a swing of that rate then loses 0.02 % of its amplitude per radian."""

LONGEST_TICK = 1e-4  # longest tick [s]: a push begins, and a record is written, at whole ticks


def build_cascade(spec: CascadeSpec) -> CascadeParams:
    """Parameters of the cascade axis."""
    p = CascadeParams()
    _fill(p.plant.machine, machine_of(spec))
    source, drive = p.plant.source, spec.drive
    source.gain = drive.voltage_gain if drive.input == "voltage" else spec.effort_per_command
    source.step, source.limit, source.delay = drive.command_step, spec.largest_command, drive.delay
    _fill_sensor(p.controller.motor_sensor, spec.encoder, spec.method.sample_period)
    _fill_sensor(p.controller.load_sensor, spec.load_encoder or IDEAL_ENCODER, spec.method.sample_period)
    set_count(p, spec.encoder.resolution, (spec.load_encoder or IDEAL_ENCODER).resolution)
    p.controller.feedback.position_on_load = spec.method.feedback.position == "load"
    p.controller.feedback.velocity_on_load = spec.method.feedback.velocity == "load"
    _fill_law(p, spec)
    _fill_limits(p.controller, spec)
    ticks = sample_ticks(spec.method.sample_period, fastest_rate(p.plant.machine))
    tick = spec.method.sample_period / ticks
    fill_push(p.plant.push, spec.disturbance.push, tick)
    fill_clocks(p, tick, ticks)
    return p


def sample_ticks(sample_period: float, rate: float) -> int:
    """Ticks in a sample."""
    return max(1, math.ceil(sample_period * max(rate / LARGEST_ANGLE, 1 / LONGEST_TICK) * (1 - 1e-9)))


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


def _fill_sensor(p: PositionSensorParams, table: EncoderTable, sample_period: float) -> None:
    p.delay, p.span = table.delay, table.velocity_span
    p.smoothing = smoothing(table.velocity_filter, sample_period)


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
    if p.guard.reversed:  # and one swing, in which the motor need not go where effort and force together send the axis
        p.guard.reversed += spec.drive.delay + spec.encoder.delay + samples(spec.swing, period)


def _fill_law(p: CascadeParams, spec: CascadeSpec) -> None:
    law, method = p.controller.law, spec.method
    law.position_pid = method.structure == "pid"
    law.max_command = spec.largest_command
    law.cascade.position_gain, law.cascade.max_velocity = method.position_gain, method.velocity_limit
    law.cascade.velocity_gain, law.cascade.integral_gain = method.velocity_gain, method.velocity_integral
    law.pid.proportional, law.pid.integral = method.proportional, method.integral
    law.pid.derivative = method.derivative
    law.pid.smoothing = smoothing(method.derivative_filter, method.sample_period)
    _fill_feed_forward(law.feed_forward, spec)


def _fill_feed_forward(p: FeedForwardParams, spec: CascadeSpec) -> None:
    shares, mechanics, per_command = spec.method.feed_forward, spec.mechanics, spec.effort_per_command
    p.velocity = shares.velocity
    p.acceleration = shares.acceleration * spec.mass / per_command
    p.viscous = shares.viscous * (spec.viscous + spec.back_emf_drag) / per_command
    p.coulomb_positive = shares.coulomb * spec.friction(1).coulomb / per_command
    p.coulomb_negative = shares.coulomb * spec.friction(-1).coulomb / per_command
    p.dead_band = shares.dead_band
    p.weight = shares.weight * mechanics.weight / per_command
    p.pendulum = shares.weight * mechanics.pendulum / per_command
