"""Rotor of a stepper in the field of its coils: the judge of whether steps are lost (stepper-envelope spec 7.2).

    J th'' = T_pk(f) sin(teeth (th_cmd - th)) + B(f) (w_cmd - th') - T_fric sign(th')

Coil current rises at a limited rate, so torque and damping fall with the step frequency as the pull-out torque does.
The damping works against the field, so that it does not brake steady running. A rotor that falls out of step catches
the field again whole tooth pitches, that is four steps, later.
"""

import math
from collections.abc import Callable

from detent.kernel.elementary import sin
from detent.kernel.registers import Registers, f8, f8_array, i8, register
from detent.kernel.step import hot_step, step

INTERVALS = 256  # stretches of the torque curve; a straight line over 1/256 of the range errs by some 1e-5


class RotorParams(Registers):
    """Motor and load of one shaft."""

    dt: f8 = register("time step of the integration", unit="s")
    teeth: f8 = register("rotor teeth: periods of the torque curve per turn", unit="count")
    step_angle: f8 = register("angle of one step", unit="rad")
    inertia: f8 = register("rotor and all that turns with it", unit="kg.m2")
    torque: f8 = register("peak torque at standstill", unit="N.m")
    damping: f8 = register("damping against the field at standstill", unit="N.m.s/rad")
    intervals_per_hz: f8 = register("stretches of the torque curve per step frequency", unit="1/Hz")
    curve: f8_array = register("torque over that at standstill, 0 to 1", unit="1", length=INTERVALS + 1)
    friction: f8 = register("Coulomb friction torque", unit="N.m")


class StepperRotor(Registers):
    """Field and rotor."""

    commanded: i8 = register("position of the field: step pulses, forward less backward", unit="count")
    field_velocity: f8 = register("velocity of the field, 0 one period after the last pulse", unit="rad/s")
    strength: f8 = register("torque over that at standstill, 0 to 1", unit="1")
    angle: f8 = register("rotor angle", unit="rad")
    velocity: f8 = register("rotor velocity", unit="rad/s")
    lag: f8 = register("field less rotor, in steps", unit="count")
    peak_lag: f8 = register("largest magnitude of that so far, in steps", unit="count")


@step
def strength_at(p: RotorParams, hz: float) -> float:
    """Torque at a step frequency as a part of that at standstill; beyond the curve that of its end."""
    place = min(hz * p.intervals_per_hz, INTERVALS * 1.0)
    k = min(int(place), INTERVALS - 1)
    return p.curve[k] + (p.curve[k + 1] - p.curve[k]) * (place - k)


@step
def step_field(p: RotorParams, r: StepperRotor, direction: int, hz: float) -> None:
    """Step pulse: the field jumps by one step and goes on at the frequency of its period."""
    r.commanded += direction
    r.field_velocity = direction * hz * p.step_angle
    r.strength = strength_at(p, hz)


@step
def hold_field(r: StepperRotor) -> None:
    """The period after the last pulse is over: the field stands, with the full current."""
    r.field_velocity = 0.0
    r.strength = 1.0


@step
def free_rotor(r: StepperRotor) -> None:
    """No current: the field is nowhere, and nothing but friction holds the rotor."""
    r.field_velocity = 0.0
    r.strength = 0.0


@hot_step
def turn_rotor(p: RotorParams, r: StepperRotor) -> None:
    """One time step; friction takes speed away but never turns it round."""
    lag = r.commanded * p.step_angle - r.angle
    torque = p.torque * sin(p.teeth * lag) + p.damping * (r.field_velocity - r.velocity)
    velocity = r.velocity + p.dt * r.strength * torque / p.inertia
    loss = p.dt * p.friction / p.inertia
    if velocity > loss:
        velocity -= loss
    elif velocity < -loss:
        velocity += loss
    else:
        velocity = 0.0
    r.velocity = velocity
    r.angle += p.dt * velocity
    r.lag = r.commanded - r.angle / p.step_angle
    r.peak_lag = max(r.peak_lag, abs(r.lag))


@step
def lost_steps(p: RotorParams, r: StepperRotor, microsteps: int = 1) -> int:
    """Commanded less actual position of a rotor that has come to rest, in pulses: of whole full steps."""
    return math.floor((r.commanded - r.angle / p.step_angle) / microsteps + 0.5) * microsteps


def fill_curve(p: RotorParams, pull_out: Callable[[float], float], max_hz: float) -> None:
    """Fill the torque curve up to the largest frequency the motor is driven at."""
    p.intervals_per_hz = INTERVALS / max_hz
    standstill = pull_out(0.0)
    p.curve[:] = [pull_out(max_hz * k / INTERVALS) / standstill for k in range(INTERVALS + 1)]
