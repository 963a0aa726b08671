"""From the tables of a DC motor, its friction and its encoder to their parameters; the same for every method."""

import math
from typing import Any

from detent.axisfile.tables import EncoderTable, FrictionTables, MotorTable, ScrewTable
from detent.plant.drive_train import DriveTrainParams, fill_period
from detent.sensing.encoder import EncoderParams

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


def fill_encoder(p: EncoderParams, table: EncoderTable, pulse: float) -> None:
    """An encoder with an edge every `pulse` [m]; zero lies between two: on one, rounding alone would make a pulse."""
    p.edge_pitch, p.origin = pulse, -pulse / 2
    p.jitter, p.missing = table.jitter / (math.pi / 2), table.missing_edges


def fill_slide(p: Any, spec: Any, period: float, bridge_resistance: float = 0.0) -> None:
    """Blocks `train` and `encoder` of a slide on a screw, with its encoder on the motor; `period` is the base tick [s].

    `spec` has the tables [motor], [mechanics] (`ScrewTable`), [encoder] and limits.travel, and the way of a `pulse`.
    """
    screw: ScrewTable = spec.mechanics
    fill_encoder(p.encoder, spec.encoder, spec.pulse)
    fill_drive_train(
        p.train, spec.motor, screw.friction, radius=screw.radius, mass=screw.mass(spec.motor),
        travel=spec.limits.travel, period=period, bridge_resistance=bridge_resistance,
    )  # fmt: skip


def fastest_rate(t: DriveTrainParams) -> float:
    """Bound of the system matrix [1/s], in scaled coordinates."""
    viscous = max(t.friction.viscous_right, t.friction.viscous_left) / t.mass
    if t.inductance == 0.0:
        return 1.0 + viscous + t.force_constant * t.emf_constant / (t.resistance * t.mass)
    coupling = math.sqrt(t.force_constant * t.emf_constant / (t.mass * t.inductance))
    return t.resistance / t.inductance + viscous + coupling
