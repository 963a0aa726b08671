"""Motor and load on a compliant coupling with backlash, each with its friction; or both as one mass.

    m1 dv1/dt = F(u, i, v1) - f1(v1) - C                        motor
    m2 dv2/dt = C - f2(v2) - W - P sin(q2) + F_ext              load
    C = k (q1 - q2 -+ b) + d (v1 - v2)                          coupling, in contact; 0 within the gap of +-b

A transmission that passes the motor's force F on loses a share of it as friction, l |F| against the motion, which adds
to that of the motor. So does a brake on the motor: a dry friction that is there or not from tick to tick.

A stiffness of 0 means a rigid coupling: masses and frictions add up, and motor and load have one position. Everything
is in the coordinate of the axis. Units are those of a linear axis; a rotary one has rad for m, N.m for N and kg.m^2
for kg.

`flow` is one Runge-Kutta step within a regime: a direction of each mass or its standstill, contact or not. How a tick
is made of them stands in `plant.two_mass_motion`.
"""

from detent.kernel.elementary import sin
from detent.kernel.registers import Registers, block, f8, i1, register
from detent.kernel.step import hot_step
from detent.plant.dc_winding import WindingParams, current_rate, motor_force
from detent.plant.stribeck import StribeckFriction, friction_force, holding_force, is_dry

State = tuple[float, float, float, float, float]  # current [A], position [m], velocity [m/s] of the motor, of the load


class MassParams(Registers):
    """One of the two masses."""

    mass: f8 = register("the total moving mass at this end of the coupling", unit="kg")
    friction: StribeckFriction = block("its friction")


class TwoMassParams(Registers):
    """Constants of motor, coupling and load."""

    period: f8 = register("time of one tick", unit="s")
    winding: WindingParams = block("winding of the motor")
    motor: MassParams = block("motor")
    load: MassParams = block("load")
    stiffness: f8 = register("stiffness of the coupling; 0: rigid", unit="N/m")
    damping: f8 = register("damping of the coupling", unit="N.s/m")
    half_gap: f8 = register("half the backlash", unit="m")
    weight: f8 = register("weight of the load along the axis, positive pulls in the negative direction", unit="N")
    pendulum: f8 = register("weight of a load that hangs at position 0 of a rotary axis, m g l", unit="N.m")
    loss: f8 = register("friction of the transmission per force of the motor that it passes on", unit="1")


class Mass(Registers):
    """State of one mass."""

    position: f8 = register("position", unit="m")
    velocity: f8 = register("velocity", unit="m/s")
    sense: i1 = register("direction that friction acts against in this tick: 1, -1, 0 held")


class TwoMass(Registers):
    """State of motor, coupling and load."""

    effort: f8 = register("what the source puts out in this tick: voltage, or force", unit="V, N")
    external: f8 = register("force on the load from outside in this tick, positive pushes in its direction", unit="N")
    brake: f8 = register("friction of a brake on the motor in this tick, moving or at rest", unit="N")
    current: f8 = register("motor current, positive drives in the positive direction", unit="A")
    motor: Mass = block("motor")
    load: Mass = block("load")
    side: i1 = register("flank in contact, where there is backlash: 1 drives the load in its direction, -1, 0 none")


@hot_step
def load_weight(p: TwoMassParams, position: float) -> float:
    """Weight against the positive direction at a position of the load [N]."""
    return p.weight if p.pendulum == 0.0 else p.weight + p.pendulum * sin(position)


@hot_step
def coupling_force(p: TwoMassParams, side: int, twist: float, slip: float) -> float:
    """Force of the coupling on the load [N]; motor less load are `twist` [m] and `slip` [m/s]. A flank only pushes."""
    if p.half_gap == 0.0:
        return p.stiffness * twist + p.damping * slip
    if side == 0:
        return 0.0
    force = p.stiffness * (twist - side * p.half_gap) + p.damping * slip
    return force if force * side > 0.0 else 0.0


@hot_step
def held_sense(band_positive: float, band_negative: float, push: float) -> int:
    """Direction in which `push` [N] breaks a mass loose from friction that holds up to the bands [N]; 0 in none."""
    if push > band_positive:
        return 1
    return -1 if push < -band_negative else 0


@hot_step
def mass_sense(p: StribeckFriction, velocity: float, push: float, lost: float) -> int:
    """Direction of a mass, or in which the force `push` [N] sets it in motion against its friction and `lost` [N].

    0 while they hold it.
    """
    if velocity != 0.0:
        return 1 if velocity > 0.0 else -1
    if not is_dry(p) and lost == 0.0:
        return 1
    return held_sense(holding_force(p.positive) + lost, holding_force(p.negative) + lost, push - p.offset)


@hot_step
def find_rigid_sense(p: TwoMassParams, r: TwoMass) -> None:
    """Direction of the one mass in this regime."""
    m, first, second = r.motor, p.motor.friction, p.load.friction
    if m.velocity != 0.0:
        m.sense = 1 if m.velocity > 0.0 else -1
        return
    if not (is_dry(first) or is_dry(second) or p.loss > 0.0 or r.brake > 0.0):
        m.sense = 1
        return
    drive = motor_force(p.winding, r.effort, r.current, 0.0)
    push, lost = drive + r.external - load_weight(p, m.position), p.loss * abs(drive) + r.brake
    m.sense = held_sense(
        holding_force(first.positive) + holding_force(second.positive) + lost,
        holding_force(first.negative) + holding_force(second.negative) + lost,
        push - first.offset - second.offset,
    )


@hot_step
def find_senses(p: TwoMassParams, r: TwoMass) -> None:
    """Directions of the masses in this regime."""
    m, n = r.motor, r.load
    if p.stiffness == 0.0:
        find_rigid_sense(p, r)
        n.sense = m.sense
        return
    force = coupling_force(p, r.side, m.position - n.position, m.velocity - n.velocity)
    push = motor_force(p.winding, r.effort, r.current, m.velocity) - force
    m.sense = mass_sense(p.motor.friction, m.velocity, push, p.loss * abs(push + force) + r.brake)
    n.sense = mass_sense(p.load.friction, n.velocity, force + r.external - load_weight(p, n.position), 0.0)


@hot_step
def rigid_acceleration(
    p: TwoMassParams, r: TwoMass, sense: int, current: float, position: float, velocity: float
) -> float:
    """Acceleration of motor and load as one mass [m/s^2]."""
    if sense == 0:
        return 0.0
    drive = motor_force(p.winding, r.effort, current, velocity)
    friction = friction_force(p.motor.friction, sense, velocity) + friction_force(p.load.friction, sense, velocity)
    push = drive - sense * p.loss * abs(drive) + r.external - load_weight(p, position)
    if r.brake > 0.0:  # asked, not added: it stands on the longest way through a tick, and most axes have none
        push -= sense * r.brake
    return (push - friction) / (p.motor.mass + p.load.mass)


@hot_step
def flow_rigid(p: TwoMassParams, r: TwoMass, h: float) -> State:
    """State of a rigid axis after `h` [s] in this regime, one Runge-Kutta step."""
    i, q, v, sense = r.current, r.motor.position, r.motor.velocity, r.motor.sense
    half = 0.5 * h
    a1, c1 = rigid_acceleration(p, r, sense, i, q, v), current_rate(p.winding, r.effort, i, v)
    i2, q2, v2 = i + half * c1, q + half * v, v + half * a1
    a2, c2 = rigid_acceleration(p, r, sense, i2, q2, v2), current_rate(p.winding, r.effort, i2, v2)
    i3, q3, v3 = i + half * c2, q + half * v2, v + half * a2
    a3, c3 = rigid_acceleration(p, r, sense, i3, q3, v3), current_rate(p.winding, r.effort, i3, v3)
    i4, q4, v4 = i + h * c3, q + h * v3, v + h * a3
    a4, c4 = rigid_acceleration(p, r, sense, i4, q4, v4), current_rate(p.winding, r.effort, i4, v4)
    sixth = h / 6.0
    i += sixth * (c1 + 2.0 * (c2 + c3) + c4)
    q += sixth * (v + 2.0 * (v2 + v3) + v4)
    v += sixth * (a1 + 2.0 * (a2 + a3) + a4)
    return i, q, v, q, v


@hot_step
def accelerations(
    p: TwoMassParams, r: TwoMass, current: float, q1: float, v1: float, q2: float, v2: float
) -> tuple[float, float]:
    """Accelerations of motor and load on their coupling [m/s^2]."""
    force = coupling_force(p, r.side, q1 - q2, v1 - v2)
    a1 = a2 = 0.0
    if r.motor.sense != 0:
        drive = motor_force(p.winding, r.effort, current, v1)
        drive -= r.motor.sense * p.loss * abs(drive)
        if r.brake > 0.0:
            drive -= r.motor.sense * r.brake
        a1 = (drive - force - friction_force(p.motor.friction, r.motor.sense, v1)) / p.motor.mass
    if r.load.sense != 0:
        drive = force + r.external - load_weight(p, q2)
        a2 = (drive - friction_force(p.load.friction, r.load.sense, v2)) / p.load.mass
    return a1, a2


@hot_step
def flow_coupled(p: TwoMassParams, r: TwoMass, h: float) -> State:
    """State of motor and load after `h` [s] in this regime, one Runge-Kutta step."""
    i, x, v, y, w = r.current, r.motor.position, r.motor.velocity, r.load.position, r.load.velocity
    half = 0.5 * h
    a1, b1 = accelerations(p, r, i, x, v, y, w)
    c1 = current_rate(p.winding, r.effort, i, v)
    i2, v2, w2 = i + half * c1, v + half * a1, w + half * b1
    a2, b2 = accelerations(p, r, i2, x + half * v, v2, y + half * w, w2)
    c2 = current_rate(p.winding, r.effort, i2, v2)
    i3, v3, w3 = i + half * c2, v + half * a2, w + half * b2
    a3, b3 = accelerations(p, r, i3, x + half * v2, v3, y + half * w2, w3)
    c3 = current_rate(p.winding, r.effort, i3, v3)
    i4, v4, w4 = i + h * c3, v + h * a3, w + h * b3
    a4, b4 = accelerations(p, r, i4, x + h * v3, v4, y + h * w3, w4)
    c4 = current_rate(p.winding, r.effort, i4, v4)
    sixth = h / 6.0
    i += sixth * (c1 + 2.0 * (c2 + c3) + c4)
    x += sixth * (v + 2.0 * (v2 + v3) + v4)
    y += sixth * (w + 2.0 * (w2 + w3) + w4)
    v += sixth * (a1 + 2.0 * (a2 + a3) + a4)
    w += sixth * (b1 + 2.0 * (b2 + b3) + b4)
    return i, x, v, y, w


@hot_step
def flow(p: TwoMassParams, r: TwoMass, h: float) -> State:
    """State after `h` [s] in this regime; `r` stays as it is."""
    return flow_rigid(p, r, h) if p.stiffness == 0.0 else flow_coupled(p, r, h)


def stand_masses(r: TwoMass, position: float) -> None:
    """At rest without current, motor and load at `position` [m]: no strain, and in the middle of the backlash."""
    r.motor.position = r.load.position = position
    r.motor.velocity = r.load.velocity = r.current = 0.0
    r.side = 0
