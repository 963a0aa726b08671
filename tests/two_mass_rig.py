"""Motor and load on the bench: 0.8 kg and 1.2 kg, rigid or on a coupling, tick by tick."""

import math

import numpy as np

from detent.plant.two_mass import TwoMass, TwoMassParams, stand_masses
from detent.plant.two_mass_motion import move_masses
from tests.cascade_rig import DAMPING, STIFFNESS

M1, M2, K, D = 0.8, 1.2, STIFFNESS, DAMPING
M = M1 + M2
H = 1e-4


def machine(period: float = H, **changes: float) -> TwoMassParams:
    """Rigid, without friction, driven by a force."""
    p = TwoMassParams(period=period)
    p.motor.mass, p.load.mass, p.winding.max_current = M1, M2, math.inf
    for name, value in changes.items():
        setattr(p, name, value)
    return p


def coupled(**changes: float) -> TwoMassParams:
    return machine(**{"stiffness": K, "damping": D} | changes)


def moving(velocity: float = 0.0, position: float = 0.0, effort: float = 0.0, external: float = 0.0) -> TwoMass:
    r = TwoMass(effort=effort, external=external)
    stand_masses(r, position)
    r.motor.velocity = r.load.velocity = velocity
    return r


def run(p: TwoMassParams, r: TwoMass, ticks: int) -> TwoMass:
    for _ in range(ticks):
        move_masses(p, r)
    return r


def state(r: TwoMass) -> np.ndarray:
    return np.array([r.current, r.motor.position, r.motor.velocity, r.load.position, r.load.velocity])


def energy(p: TwoMassParams, r: TwoMass) -> float:
    strain = max(abs(r.motor.position - r.load.position) - p.half_gap, 0.0)
    kinetic = 0.5 * (p.motor.mass * r.motor.velocity**2 + p.load.mass * r.load.velocity**2)
    height = p.weight * r.load.position + p.pendulum * (1.0 - math.cos(r.load.position))
    return kinetic + 0.5 * p.stiffness * strain**2 + height


def motor(p: TwoMassParams, inductance: float = 0.0) -> TwoMassParams:
    w = p.winding
    w.used, w.resistance, w.inductance, w.force_constant, w.emf_constant = 1, 2.0, inductance, 10.0, 9.0
    return p
