"""Brush DC motor on a belt-driven carriage between two frames.

Rigid belt: rotor, pulley, belt and carriage move as one mass. Between events the drive train is linear,

    L di/dt = u - R i - k v,    m dv/dt = k i - b v + F,    dx/dt = v,

with k = torque constant / pulley radius (and the back-EMF constant the same way), and is advanced by its exact
solution: over a whole period with matrices made at build time, over part of one (`flow`) by the power series of the
same solution, summed to rounding. Events are the change of the friction regime, contact with a frame, and the current
reaching zero in a bridge that lets it flow one way only.
"""

from detent.kernel.registers import Registers, block, f8, i1, i8, register
from detent.kernel.step import hot_step, step

NO_CURRENT = 1e-9  # current of a held motor that counts as none [A]: its exponential decay would otherwise never end
SERIES_TERMS = 10  # terms of the power series per substep: with |M h| <= 0.25 the remainder is below 1e-14 of the step


class Transition(Registers):
    """Exact response over one period to state, voltage and force, for one direction of friction."""

    i_i: f8 = register("current from current")
    i_v: f8 = register("current from velocity", unit="A.s/m")
    i_u: f8 = register("current from voltage", unit="A/V")
    i_f: f8 = register("current from force", unit="A/N")
    v_i: f8 = register("velocity from current", unit="m/s/A")
    v_v: f8 = register("velocity from velocity")
    v_u: f8 = register("velocity from voltage", unit="m/s/V")
    v_f: f8 = register("velocity from force", unit="m/s/N")
    x_i: f8 = register("travel from current", unit="m/A")
    x_v: f8 = register("travel from velocity", unit="s")
    x_u: f8 = register("travel from voltage", unit="m/V")
    x_f: f8 = register("travel from force", unit="m/N")


class Friction(Registers):
    """Friction of the guide, Coulomb, static and viscous, each direction its own; all values are magnitudes."""

    coulomb_right: f8 = register("Coulomb friction moving right", unit="N")
    coulomb_left: f8 = register("Coulomb friction moving left", unit="N")
    static_right: f8 = register("breakaway force to the right", unit="N")
    static_left: f8 = register("breakaway force to the left", unit="N")
    viscous_right: f8 = register("viscous friction moving right", unit="N.s/m")
    viscous_left: f8 = register("viscous friction moving left", unit="N.s/m")


class DriveTrainParams(Registers):
    """Constants of motor, transmission and load."""

    resistance: f8 = register("winding, brushes and bridge", unit="ohm")
    inductance: f8 = register("winding; 0: the current follows voltage and velocity at once", unit="H")
    force_constant: f8 = register("belt force per ampere", unit="N/A")
    emf_constant: f8 = register("back-EMF per belt velocity", unit="V.s/m")
    mass: f8 = register("the total moving mass, at the carriage", unit="kg")
    friction: Friction = block("friction of the guide")
    left_end: f8 = register("contact with the left frame or an obstacle", unit="m")
    right_end: f8 = register("contact with the right frame or an obstacle", unit="m")
    period: f8 = register("time of one tick", unit="s")
    substep: f8 = register("longest step of the power series", unit="s")
    right: Transition = block("whole period moving right")
    left: Transition = block("whole period moving left")
    coast_right: Transition = block("whole period without current moving right")
    coast_left: Transition = block("whole period without current moving left")
    held_i: f8 = register("current from current at standstill")
    held_u: f8 = register("current from voltage at standstill", unit="A/V")


class DriveTrain(Registers):
    """State of motor and carriage."""

    current: f8 = register("motor current, positive drives right", unit="A")
    velocity: f8 = register("carriage velocity, positive right", unit="m/s")
    position: f8 = register("carriage position from the left frame", unit="m")
    force: f8 = register("external force of this tick, positive pushes right", unit="N")
    voltage: f8 = register("mean motor terminal voltage of the last tick", unit="V")
    mean_current: f8 = register("mean motor current of the last tick", unit="A")
    peak_current: f8 = register("largest magnitude of the current so far", unit="A")
    energy: f8 = register("electrical energy taken by the motor so far", unit="J")
    sense: i1 = register("direction friction acts against in this tick: 1 right, -1 left, 0 held")
    ticks_held: i8 = register("ticks at standstill so far", unit="tick")


@hot_step
def sense_of_motion(p: DriveTrainParams, r: DriveTrain) -> None:
    """Decide the friction regime: moving, held by static friction or a frame, or breaking loose."""
    if r.velocity > 0.0:
        r.sense = 1
    elif r.velocity < 0.0:
        r.sense = -1
    else:
        push = p.force_constant * r.current + r.force
        if push > p.friction.static_right and r.position < p.right_end:
            r.sense = 1
        elif push < -p.friction.static_left and r.position > p.left_end:
            r.sense = -1
        else:
            r.sense = 0


@hot_step
def settle_contacts(p: DriveTrainParams, r: DriveTrain) -> None:
    """After a move: motion that friction has reversed is at rest; a frame stops without rebound."""
    if r.velocity * r.sense < 0.0:
        r.velocity = 0.0
    if r.position >= p.right_end:
        r.position = p.right_end
        r.velocity = min(r.velocity, 0.0)
    elif r.position <= p.left_end:
        r.position = p.left_end
        r.velocity = max(r.velocity, 0.0)


@hot_step
def friction_force(p: DriveTrainParams, r: DriveTrain) -> float:
    """Constant force of this regime: external force less Coulomb friction."""
    if r.sense > 0:
        return r.force - p.friction.coulomb_right
    if r.sense < 0:
        return r.force + p.friction.coulomb_left
    return 0.0


@hot_step
def apply_transition(m: Transition, r: DriveTrain, u: float, force: float) -> None:
    """One whole period by its exact matrix."""
    current = m.i_i * r.current + m.i_v * r.velocity + m.i_u * u + m.i_f * force
    velocity = m.v_i * r.current + m.v_v * r.velocity + m.v_u * u + m.v_f * force
    r.position += m.x_i * r.current + m.x_v * r.velocity + m.x_u * u + m.x_f * force
    r.current = current
    r.velocity = velocity


@step
def flow(p: DriveTrainParams, r: DriveTrain, u: float, conducting: bool, duration: float) -> None:
    """Part of a period by the power series of the exact solution; `conducting` False keeps the current at zero."""
    inverse_l = 1.0 / p.inductance if conducting else 0.0
    inverse_m = 1.0 / p.mass if r.sense != 0 else 0.0
    viscous = p.friction.viscous_right if r.sense > 0 else p.friction.viscous_left
    force = friction_force(p, r)
    left = duration
    while left > 0.0:
        h = min(left, p.substep)
        left -= h
        di = (u - p.resistance * r.current - p.emf_constant * r.velocity) * inverse_l * h
        dv = (p.force_constant * r.current - viscous * r.velocity + force) * inverse_m * h
        dx = r.velocity * h
        i, v, x = r.current + di, r.velocity + dv, dx
        for n in range(2, SERIES_TERMS + 1):
            share = h / n
            dx = dv * share
            di, dv = (
                (-p.resistance * di - p.emf_constant * dv) * inverse_l * share,
                (p.force_constant * di - viscous * dv) * inverse_m * share,
            )
            i += di
            v += dv
            x += dx
        r.current = i
        r.velocity = v
        r.position += x


@hot_step
def account(p: DriveTrainParams, r: DriveTrain, voltage: float, mean_current: float) -> None:
    """Book the tick's mean voltage and current, the peak current and the energy."""
    r.voltage = voltage
    r.mean_current = mean_current
    r.energy += voltage * mean_current * p.period
    r.peak_current = max(r.peak_current, abs(r.current))


@hot_step
def move_averaged(p: DriveTrainParams, r: DriveTrain, u_positive: float, u_negative: float) -> None:
    """One tick with the mean terminal voltage of the period.

    `u_positive` is the voltage the bridge imposes while the current is positive, `u_negative` while it is negative;
    they differ where a diode carries the current. A current that would change sign inside the tick then ends at zero:
    such a bridge lets it flow one way only.
    """
    sense_of_motion(p, r)
    emf = p.emf_constant * r.velocity
    before = r.current
    positive = before > 0.0 or (before == 0.0 and u_positive > emf)
    negative = before < 0.0 or (before == 0.0 and u_negative < emf)
    u = u_positive if positive else (u_negative if negative else emf)
    force = friction_force(p, r)
    if r.sense == 0:
        held = p.held_i * before + p.held_u * u if positive or negative else 0.0
        r.current = held if abs(held) > NO_CURRENT else 0.0
        r.ticks_held += 1
    elif positive or negative:
        apply_transition(p.right if r.sense > 0 else p.left, r, u, force)
    else:
        apply_transition(p.coast_right if r.sense > 0 else p.coast_left, r, 0.0, force)
    if (positive and r.current < 0.0) or (negative and r.current > 0.0):
        r.current = r.current if u_positive == u_negative else 0.0
    settle_contacts(p, r)
    account(p, r, u, 0.5 * (before + r.current))


@hot_step
def move_with_current(p: DriveTrainParams, r: DriveTrain, current: float) -> None:
    """One tick with the current that an amplifier of its own imposes: the winding does not matter to the motion."""
    r.current = current
    sense_of_motion(p, r)
    if r.sense == 0:
        r.ticks_held += 1
    else:
        force = p.force_constant * current + friction_force(p, r)
        apply_transition(p.coast_right if r.sense > 0 else p.coast_left, r, 0.0, force)
        r.current = current
    settle_contacts(p, r)
    account(p, r, p.resistance * current + p.emf_constant * r.velocity, current)


def fill_transition(p: DriveTrainParams, target: Transition, sense: int, *, conducting: bool) -> None:
    """Make the whole-period matrix of one regime from the exact solution of unit inputs.

    Without inductance the winding is no state: its current follows from voltage and velocity at once, and acts as the
    force ``k u / R`` and the viscous friction ``k^2 / R``.
    """
    at_once = conducting and p.inductance == 0.0
    mechanics = p.copy()
    mechanics.friction.coulomb_right = mechanics.friction.coulomb_left = 0.0  # taken as a force
    if at_once:
        drag = p.force_constant * p.emf_constant / p.resistance
        mechanics.friction.viscous_right += drag
        mechanics.friction.viscous_left += drag
    for name, current, velocity, voltage, force in (
        ("i", 1.0, 0.0, 0.0, 0.0),
        ("v", 0.0, 1.0, 0.0, 0.0),
        ("u", 0.0, 0.0, 1.0, 0.0),
        ("f", 0.0, 0.0, 0.0, 1.0),
    ):
        r = DriveTrain(velocity=velocity, force=force, sense=sense)
        if at_once:
            r.force += p.force_constant * voltage / p.resistance
            flow(mechanics, r, 0.0, False, p.period)
            r.current = (voltage - p.emf_constant * r.velocity) / p.resistance
        else:
            r.current = current if conducting else 0.0
            flow(mechanics, r, voltage, conducting, p.period)
        setattr(target, "i_" + name, r.current)
        setattr(target, "v_" + name, r.velocity)
        setattr(target, "x_" + name, r.position)


def fill_period(p: DriveTrainParams) -> None:
    """Compute every whole-period matrix of `p` from its constants."""
    for sense, driven, coasting in ((1, p.right, p.coast_right), (-1, p.left, p.coast_left)):
        fill_transition(p, driven, sense, conducting=True)
        fill_transition(p, coasting, sense, conducting=False)
    if p.inductance == 0.0:
        p.held_i, p.held_u = 0.0, 1.0 / p.resistance
        return
    for name, current, voltage in (("held_i", 1.0, 0.0), ("held_u", 0.0, 1.0)):
        r = DriveTrain(current=current)
        flow(p, r, voltage, True, p.period)
        setattr(p, name, r.current)
