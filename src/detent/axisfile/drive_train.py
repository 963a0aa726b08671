"""From the tables of a DC motor and its friction to the parameters of the drive train; the same for every method."""

import math

from detent.axisfile.tables import FrictionTables, MotorTable
from detent.plant.drive_train import DriveTrainParams, fill_period

SUBSTEP_SHARE = 0.25  # longest substep of the power series, as a share of the fastest time constant


def fill_drive_train(  # noqa: PLR0913 - what a drive train is made of
    t: DriveTrainParams,
    motor: MotorTable,
    friction: FrictionTables,
    *,
    radius: float,
    mass: float,
    travel: float,
    period: float,
    bridge_resistance: float = 0.0,
    substep: float | None = None,
    start: float = 0.0,
) -> None:
    """A motor that moves `mass` [kg] by `radius` [m/rad], on a way from `start` to `travel` [m].

    `period` is the base tick [s], `substep` the longest step of the power series, by default as the constants need it.
    """
    t.resistance, t.inductance = motor.resistance + bridge_resistance, motor.inductance
    t.force_constant, t.emf_constant = motor.torque_constant / radius, motor.back_emf_constant / radius
    t.mass = mass
    for side, table in (("right", friction.right), ("left", friction.left)):
        for kind in ("coulomb", "static", "viscous"):
            setattr(t.friction, f"{kind}_{side}", getattr(table, kind))
    t.left_end, t.right_end = start, travel
    t.period, t.substep = period, substep or SUBSTEP_SHARE / fastest_rate(t)
    fill_period(t)


def fastest_rate(t: DriveTrainParams) -> float:
    """Bound of the system matrix [1/s], in scaled coordinates."""
    viscous = max(t.friction.viscous_right, t.friction.viscous_left) / t.mass
    if t.inductance == 0.0:
        return 1.0 + viscous + t.force_constant * t.emf_constant / (t.resistance * t.mass)
    coupling = math.sqrt(t.force_constant * t.emf_constant / (t.mass * t.inductance))
    return t.resistance / t.inductance + viscous + coupling
