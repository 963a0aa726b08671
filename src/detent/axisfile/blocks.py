"""From tables that methods share to the parameters of blocks: drive train, encoder, disturbances, guard.

The guard's defaults are those of drives in the field (speed a tenth above its limit, command at its limit for a
second); the effort under which a standing sensor counts as stuck is twice what breaks the machine loose.
"""

import math
from typing import Any

import numpy as np

from detent.axisfile.elementwise import is_array, most, nearest, up
from detent.axisfile.tables import (
    EncoderTable,
    FrictionTables,
    HomeTable,
    InterferenceTable,
    MotionProtectionTable,
    MotorTable,
    ProtectionTable,
    PushTable,
    ScrewTable,
    TurnProtectionTable,
)
from detent.control.guard import Guard, GuardParams
from detent.control.homing import HomingParams
from detent.errors import GUARD_TEXT
from detent.plant.drive_train import DriveTrainParams, fill_period
from detent.plant.push import Push
from detent.sensing.encoder import EncoderParams
from detent.sensing.home_marks import HomeMarksParams
from detent.sensing.interference import CORRUPT, INSERT_MINUS, INSERT_PLUS, LOSE_SAMPLE, REMOVE, InterferenceParams
from detent.units import format_quantity

SUBSTEP_SHARE = 0.25  # longest substep of the power series, as a share of the fastest time constant
WAYS = "contact", "switch", "index"  # as the block of homing numbers them
LAG = 1e-4  # share of the travel by which a commanded point ahead of an axis that stands tells of a hard stop

KINDS = {"+": INSERT_PLUS, "-": INSERT_MINUS, "remove": REMOVE, "lose sample": LOSE_SAMPLE, "corrupt": CORRUPT}


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


def fill_interference(p: InterferenceParams, table: InterferenceTable, tick: float) -> None:
    """Fill rates and list; `tick` is the base tick [s]."""
    for k, rate in enumerate((table.removed, table.lost_samples, table.corrupted, table.inserted)):
        p.mean_ticks[k] = 1 / (rate * tick) if rate > 0 else 0.0
    burst = table.burst
    if burst is None:
        return
    ticks = burst.ticks
    if burst.at is not None:
        ticks = [round((burst.at + k * burst.spacing) / tick) for k in range(burst.count)]
    p.entries = len(ticks)
    for k, moment in enumerate(sorted(ticks)):
        p.tick[k], p.kind[k] = moment, KINDS[burst.kind]


def fill_push(p: Push, table: PushTable | None, tick: Any) -> None:
    """Fill the disturbing force; `tick` is the base tick [s]."""
    if table is not None:
        p.force = table.force
        p.begin, p.end = nearest(table.at / tick), nearest((table.at + table.duration) / tick)


def fill_marks(p: HomeMarksParams, home: HomeTable, pitch: float) -> None:
    """Switch and marks lie where the file says that the axis finds them; a mark comes every `pitch` [m]."""
    p.present, p.side, p.edge = 1, home.side, home.position
    if home.by == "index":
        p.mark, p.pitch = home.position, pitch
        p.edge += home.side * home.edge_to_index


def homing_params(  # noqa: PLR0913 - what a search depends on
    home: HomeTable, *, travel: float, pitch: float, count: float, look: float, pressed: float
) -> HomingParams:
    """How a controller that looks every `look` [s] and counts by `count` [m] looks for its reference.

    What stands for `pressed` [s], the commanded point ahead of it, is held by something.
    """
    return HomingParams(
        way=WAYS.index(home.by), side=home.side, place=home.position, speed=home.speed, creep=home.creep,
        back=home.back_off, longest=1.2 * travel + home.back_off, pitch=1.2 * pitch,
        lag=max(LAG * travel, 10 * count), grain=1.5 * count, slack=0.1 * pressed,
        still=max(1, round(pressed / look)),
    )  # fmt: skip


def fill_guard(p: GuardParams, table: ProtectionTable, *, sample: float, speed: float) -> None:
    """Guard of a controller that samples every `sample` [s] an axis of at most `speed` [count/s]."""
    p.saturated, p.stuck = samples(table.saturation_time, sample), samples(table.stuck_time, sample)
    if not isinstance(table, TurnProtectionTable):
        return
    most = speed * sample
    p.speed = math.ceil(table.overspeed * most) + 1 if table.overspeed else 0
    p.jump = math.ceil(table.jump * most) + 2 if table.jump else 0
    p.reversed = samples(table.reversed_time, sample)
    p.travel = isinstance(table, MotionProtectionTable) and table.travel


def samples(time: Any, sample: float) -> Any:
    """Samples in a time [s], rounded up; 0 for none.

    >>> samples(1.0, 0.3), samples(0.1, 0.3), samples(0.0, 0.3)
    (4, 1, 0)
    """
    if is_array(time):
        return np.where(time > 0.0, most(1, up(time / sample - 1e-9)), 0)
    return max(1, math.ceil(time / sample - 1e-9)) if time > 0.0 else 0


def describe_fault(
    guard: Guard, table: ProtectionTable, speed: str = "", lower: str = "", upper: str = "", **more: str
) -> str:
    """What a fault of the guard means and what to do, by the keys of the file; largest speed and ends for people."""
    limits = {"stuck": format_quantity(table.stuck_time, "s"), "saturated": format_quantity(table.saturation_time, "s")}
    limits |= {"side": "upper", "end": upper} if guard.side > 0 else {"side": "lower", "end": lower}
    if isinstance(table, TurnProtectionTable):
        limits |= {"reversed": format_quantity(table.reversed_time, "s"), "speed": f"{table.overspeed:g} x {speed}"}
    return GUARD_TEXT[guard.code].format(**limits | more)
