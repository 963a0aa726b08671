"""Position and velocity loop of a servo axis, sampled: cascade (P over P or PI) or position PID, with feedforward.

    cascade   velocity demand = K_p e + w v_ref, limited;   u = K_v e_v + I + FF,   I' = K_i e_v
    PID       u = K_p e + I + K_d filtered(w v_ref - v_meas) + FF,                  I' = K_i e

e = ref - meas throughout; e_v is the velocity demand less the measured velocity; w is the share of the reference's
velocity that is fed forward (in the PID: 0 the derivative acts on the measurement, 1 on the error). FF is what the
plant needs to follow: acceleration, viscous and Coulomb friction, weight.

The command is limited, and the integral then does not wind up: it does not integrate what would drive the command
further beyond its limit (clamping). Back-calculation would need one more time constant, which
nobody measures, and discharges an integral that holds a weight as soon as a fast move touches the limit.

While the reference rests, the axis stands and its error is within a dead band, the integral stays as it is: friction
and an integral would otherwise hunt. It is no dead band on the error, which would be an edge to oscillate at; all
other parts of the command act on.

In single precision (`kernel.registers.single`) the position error is the rounded difference of two positions that are
doubles, and everything behind it a single. Constants are whole numbers, for these take on either precision.

Astrom, Hagglund: Advanced PID Control (2006), sections 3.3 (derivative filter), 3.5 (windup, conditional integration).
Ellis: Control System Design Guide, 4th ed. (2012), chapters 6 (cascade of P and PI) and 8 (feedforward).
"""

from detent.kernel.elementary import sin
from detent.kernel.registers import Registers, block, f8, real, register, u1
from detent.kernel.single import alike
from detent.kernel.step import step


class VelocityLoopParams(Registers):
    """Gains of the cascade."""

    position_gain: real = register("velocity demand per position error", unit="1/s")
    max_velocity: real = register("limit of the velocity demand", unit="m/s")
    velocity_gain: real = register("command per velocity error", unit="V.s/m")
    integral_gain: real = register("command per velocity error and time; 0: P, not PI", unit="V/m")


class PidParams(Registers):
    """Gains of the position PID."""

    proportional: real = register("command per position error", unit="V/m")
    integral: real = register("command per position error and time", unit="V/(m.s)")
    derivative: real = register("command per velocity error", unit="V.s/m")
    smoothing: real = register("part of a new velocity error that is taken over at a sample; 1: no filter", unit="1")


class FeedForwardParams(Registers):
    """Command that the reference needs, by the model of the plant."""

    velocity: real = register("share of the reference's velocity in the velocity demand", unit="1")
    acceleration: real = register("command per acceleration", unit="V.s2/m")
    viscous: real = register("command per velocity", unit="V.s/m")
    coulomb_positive: real = register("command against Coulomb friction moving in the positive direction", unit="V")
    coulomb_negative: real = register("command against Coulomb friction moving in the negative direction", unit="V")
    dead_band: real = register("velocity up to which there is none against Coulomb friction", unit="m/s")
    weight: real = register("command that holds the weight", unit="V")
    pendulum: real = register("command that holds a hanging load at a quarter turn", unit="V")


class CascadeLawParams(Registers):
    """Constants of the law; its command is in volts, or in whatever the amplifier takes."""

    period: real = register("time between two samples", unit="s")
    position_pid: u1 = register("0 cascade, 1 position PID", option=True)
    cascade: VelocityLoopParams = block("position P over velocity P or PI")
    pid: PidParams = block("position PID")
    feed_forward: FeedForwardParams = block("feedforward")
    max_command: real = register("limit of the command", unit="V")
    dead_band: real = register("error up to which the integral of an axis at rest does not change; 0: none", unit="m")
    standing: real = register("velocity below which a measured one is rest", unit="m/s")


class CascadeReference(Registers):
    """What the axis should do at this sample."""

    position: f8 = register("position", unit="m")
    velocity: real = register("velocity", unit="m/s")
    acceleration: real = register("acceleration", unit="m/s2")


class CascadeLaw(Registers):
    """What the law has computed at the last sample."""

    position_error: real = register("reference minus measured position", unit="m")
    velocity_error: real = register("velocity demand less measured velocity; in the PID as filtered", unit="m/s")
    integral: real = register("integral part of the command", unit="V")
    feed_forward: real = register("feedforward part of the command", unit="V")
    command: real = register("command", unit="V")
    limited: u1 = register("1 while the command is at its limit")


@step
def coulomb_part(p: FeedForwardParams, velocity: float) -> float:
    """Command against Coulomb friction at a velocity of the reference [V]."""
    if velocity > p.dead_band:
        return p.coulomb_positive
    return -p.coulomb_negative if velocity < -p.dead_band else 0


@step
def feed_forward(p: FeedForwardParams, ref: CascadeReference) -> float:
    """Command that the plant needs to follow the reference [V]."""
    weight = p.weight if p.pendulum == 0.0 else p.weight + p.pendulum * alike(p.pendulum, sin(ref.position))
    moving = p.viscous * ref.velocity + coulomb_part(p, ref.velocity)
    return p.acceleration * ref.acceleration + moving + weight


@step
def limit_command(p: CascadeLawParams, r: CascadeLaw, rest: float, increment: float) -> None:
    """Command of the integral, its `increment` [V] and the `rest` [V], without windup; what is no number stays none."""
    command = rest + r.integral + increment
    r.limited = 1 if abs(command) > p.max_command else 0
    if command > p.max_command:
        increment = min(increment, max(p.max_command - rest - r.integral, 0))
        command = p.max_command
    elif command < -p.max_command:
        increment = max(increment, min(-p.max_command - rest - r.integral, 0))
        command = -p.max_command
    r.integral += increment
    r.command = command


@step
def is_held(p: CascadeLawParams, r: CascadeLaw, ref: CascadeReference, velocity: float) -> bool:
    """True while the integral of an axis at rest within its dead band is held."""
    at_rest = ref.velocity == 0.0 and abs(velocity) < p.standing
    return p.dead_band > 0.0 and at_rest and abs(r.position_error) <= p.dead_band


@step
def control_cascade(p: CascadeLawParams, r: CascadeLaw, demand: float, velocity: float, share: int) -> None:
    """Cascade: the velocity loop at a demand [m/s] and a measured velocity [m/s]; the integral takes its `share`."""
    g = p.cascade
    r.velocity_error = min(max(demand, -g.max_velocity), g.max_velocity) - velocity
    rest = g.velocity_gain * r.velocity_error + r.feed_forward
    limit_command(p, r, rest, share * (g.integral_gain * p.period * r.velocity_error))


@step
def control_pid(p: CascadeLawParams, r: CascadeLaw, demand: float, velocity: float, share: int) -> None:
    """Position PID; `demand` is the velocity that its derivative does not act against [m/s]; `share` as above."""
    g = p.pid
    r.velocity_error += g.smoothing * (demand - velocity - r.velocity_error)
    rest = g.proportional * r.position_error + g.derivative * r.velocity_error + r.feed_forward
    limit_command(p, r, rest, share * (g.integral * p.period * r.position_error))


@step
def control(p: CascadeLawParams, r: CascadeLaw, ref: CascadeReference, position: float, velocity: float) -> None:
    """One sample, from measured position [m] and velocity [m/s] to the command."""
    r.position_error = ref.position - position
    r.feed_forward = feed_forward(p.feed_forward, ref)
    fed = p.feed_forward.velocity * ref.velocity
    share = 0 if is_held(p, r, ref, velocity) else 1
    if p.position_pid:
        control_pid(p, r, fed, velocity, share)
    else:
        control_cascade(p, r, p.cascade.position_gain * r.position_error + fed, velocity, share)
