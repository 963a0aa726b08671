"""Friction of one mass, each direction its own: Coulomb, viscous, static with a Stribeck velocity, and an offset.

    F(v) = offset + [Fc + (Fs - Fc) exp(-(v / vs)^2)] sign(v) + Fv v

At rest it is whatever holds the mass, up to the force that breaks it loose. The offset is a force that does not turn
round with the motion; what is left of an amplifier's zero or of a balanced weight is part of it. Units are those of a
linear axis; a rotary one has rad for m and N.m for N.

Armstrong-Helouvry, Dupont, Canudas de Wit: A survey of models, analysis tools and compensation methods for the control
of machines with friction. Automatica 30 (1994), section 2.
"""

from detent.kernel.elementary import exp
from detent.kernel.registers import Registers, block, f8, register
from detent.kernel.step import hot_step

NOTHING_LEFT = 40.0  # square of the speed, in Stribeck velocities, from which on exp(-40), 4e-18, is below rounding


class DirectionFriction(Registers):
    """Friction moving in one direction; all values are magnitudes."""

    coulomb: f8 = register("Coulomb friction", unit="N")
    static: f8 = register("breakaway force; no more than the Coulomb friction: that", unit="N")
    stribeck: f8 = register(
        "velocity at which 1/e of their difference is left; 0: it ends as motion begins", unit="m/s"
    )
    viscous: f8 = register("viscous friction", unit="N.s/m")


class StribeckFriction(Registers):
    """Friction of both directions."""

    positive: DirectionFriction = block("moving in the positive direction")
    negative: DirectionFriction = block("moving in the negative direction")
    offset: f8 = register("force against the drive that does not change with the direction", unit="N")


@hot_step
def resistance(p: DirectionFriction, speed: float) -> float:
    """Friction against motion at a speed in this direction [m/s], without the offset [N]."""
    force = p.coulomb + p.viscous * speed
    if p.stribeck > 0.0 and p.static > p.coulomb:
        ratio = speed / p.stribeck
        if ratio * ratio < NOTHING_LEFT:
            force += (p.static - p.coulomb) * exp(-ratio * ratio)
    return force


@hot_step
def friction_force(p: StribeckFriction, sense: int, velocity: float) -> float:
    """Force against the drive [N] of a mass that moves in direction `sense`, 1 or -1, at `velocity` [m/s]."""
    if sense > 0:
        return p.offset + resistance(p.positive, velocity)
    return p.offset - resistance(p.negative, -velocity)


@hot_step
def holding_force(p: DirectionFriction) -> float:
    """Largest force that moves nothing in this direction [N]."""
    return max(p.static, p.coulomb)


@hot_step
def is_dry(p: StribeckFriction) -> bool:
    """True when there is friction at standstill, so that a mass may stick."""
    return holding_force(p.positive) > 0.0 or holding_force(p.negative) > 0.0
