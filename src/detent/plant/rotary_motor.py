"""Motor with everything that turns with it, advanced by its exact solution (rotary-table specification 7).

    J dw/dt = T - c w + load - friction,    dphi/dt = w

The amplifier's torque is ``T - s w``: s is its stiffness against the tachometer while it is within its limit, 0 at the
limit; s adds to the viscous friction. So the motion over a tick is linear, and one of two matrices gives it exactly:
a first order lag of J / (b + s), or the acceleration by a constant torque. A worm is self-locking and its ratio is
large: the table is an inertia, divided by the ratio squared, and a load torque, divided by the ratio.
The angle is kept as whole turns and a rest within one turn, so that it stays exact over any number of turns.
"""

import math

from detent.kernel.elementary import exp, one_less_exp
from detent.kernel.registers import Registers, block, f8, i1, i8, register
from detent.kernel.step import hot_step

FULL_TURN = 2 * math.pi


class Response(Registers):
    """Exact response over one tick to velocity and torque."""

    v_v: f8 = register("velocity from velocity")
    v_t: f8 = register("velocity from torque", unit="rad/s/(N.m)")
    x_v: f8 = register("travel from velocity", unit="s")
    x_t: f8 = register("travel from torque", unit="rad/(N.m)")


class RotaryMotorParams(Registers):
    """Constants of motor and load, at the motor shaft."""

    inertia: f8 = register("motor, gear and table", unit="kg.m^2")
    viscous: f8 = register("viscous friction", unit="N.m.s/rad")
    coulomb: f8 = register("Coulomb friction", unit="N.m")
    static: f8 = register("torque that breaks loose", unit="N.m")
    period: f8 = register("time of one tick", unit="s")
    held: Response = block("one tick with the amplifier within its limit, its stiffness included")
    free: Response = block("one tick with a constant torque")


class RotaryMotor(Registers):
    """State of the motor."""

    velocity: f8 = register("velocity, positive increases the angle", unit="rad/s")
    angle: f8 = register("angle within the turn, 0..2 pi", unit="rad")
    turns: i8 = register("whole turns", unit="count")
    sense: i1 = register("direction friction acts against in this tick: 1, -1, 0 at rest")


class LoadTorque(Registers):
    """Torque on the motor shaft from outside during a stretch of ticks."""

    torque: f8 = register("torque, positive drives to larger angles", unit="N.m")
    begin: i8 = register("first tick of the load", unit="tick")
    end: i8 = register("first tick after it", unit="tick")


@hot_step
def load_torque(p: LoadTorque, tick: int) -> float:
    """Torque at a tick [N.m]."""
    return p.torque if p.begin <= tick < p.end else 0.0


@hot_step
def friction_torque(p: RotaryMotorParams, r: RotaryMotor, drive: float) -> float:
    """Coulomb friction of this tick; `drive` is the torque that would act at standstill [N.m]."""
    if r.velocity != 0.0:
        r.sense = 1 if r.velocity > 0.0 else -1
    elif abs(drive) > p.static:
        r.sense = 1 if drive > 0.0 else -1
    else:
        r.sense = 0
    return p.coulomb * r.sense


@hot_step
def rotate(p: RotaryMotorParams, r: RotaryMotor, drive: float, within_limit: bool) -> float:
    """One tick; `drive` is the torque at standstill [N.m]. Returns the travel [rad]."""
    torque = drive - friction_torque(p, r, drive)
    if r.sense == 0:
        return 0.0
    m = p.held if within_limit else p.free
    travel = m.x_v * r.velocity + m.x_t * torque
    r.velocity = m.v_v * r.velocity + m.v_t * torque
    if r.velocity * r.sense < 0.0 and abs(drive) <= p.static:
        r.velocity = 0.0
    r.angle += travel
    if r.angle < 0.0 or r.angle >= FULL_TURN:
        whole = math.floor(r.angle / FULL_TURN)
        r.angle -= whole * FULL_TURN
        r.turns += whole
    return travel


def fill_motor(p: RotaryMotorParams, stiffness: float) -> None:
    """Exact solutions of ``J dw/dt = T - (b + s) w`` over one tick for unit velocity and unit torque.

    In the first s is the amplifier's `stiffness`, its torque per velocity [N.m.s/rad], in the second it is 0.
    """
    h = p.period
    for target, held in ((p.held, stiffness), (p.free, 0.0)):
        lag = (p.viscous + held) / p.inertia * h
        first = one_less_exp(lag) / lag if lag > 0.0 else 1.0
        second = (1.0 - first) / lag if lag > 1e-2 else _second(lag)
        target.v_v, target.v_t = exp(-lag), h / p.inertia * first
        target.x_v, target.x_t = h * first, h * h / p.inertia * second


def _second(lag: float) -> float:
    """``(lag - 1 + exp(-lag)) / lag^2`` by its series, exact to rounding where the difference cancels."""
    term, total = 0.5, 0.5
    for n in range(3, 12):
        term *= -lag / n
        total += term
    return total


def stand_at(r: RotaryMotor, turns: float) -> None:
    """At rest at a motor angle in turns."""
    r.turns = math.floor(turns)
    r.angle = (turns - r.turns) * FULL_TURN
    r.velocity = 0.0
