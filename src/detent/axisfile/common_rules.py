"""Rules between keys that several methods share."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from detent.axisfile.tables import BurstTable, FrictionTables
from detent.files.findings import Contradiction
from detent.files.nearest import BARELY, at_least, at_most, either, put
from detent.units import format_quantity

BURST = "disturbance.lines.burst"


def static_friction(friction: FrictionTables) -> Iterator[Contradiction]:
    """Static friction is at least the Coulomb friction, in each direction."""
    for direction, table in {"right": friction.right, "left": friction.left}.items():
        if table.static < table.coulomb:
            key = f"mechanics.friction.{direction}"
            yield Contradiction(
                (f"{key}.static", f"{key}.coulomb"),
                f"at least the Coulomb friction, {format_quantity(table.coulomb, 'N')}",
                either(put(f"{key}.static", at_least(table.coulomb, "N")), "leave it out: it is then 1.15 x coulomb"),
            )


def inside_travel(positions: Mapping[str, float], travel: float) -> Iterator[Contradiction]:
    """Places of the axis, by their keys, lie on its way of `travel` [m]."""
    for key, position in positions.items():
        if position > travel:
            nearest = at_most(travel, "m")
            yield Contradiction(
                (key, "limits.travel"),
                f"up to limits.travel, {format_quantity(travel, 'm')}",
                either(put(key, nearest), "correct limits.travel"),
            )


@dataclass(frozen=True, slots=True)
class Plant:
    """Constants that decide how fast a machine's state changes.

    Attributes
    ----------
    resistance : float
        Motor and bridge [ohm].
    inductance : float
        Winding [H], above 0.
    coupling : float
        Exchange between winding and mass: force constant x back-EMF constant / mass [V/(A*s)].
    mass : float
        What moves [kg].
    """

    resistance: float
    inductance: float
    coupling: float
    mass: float


def time_constants(plant: Plant, friction: FrictionTables, fastest: float) -> Iterator[Contradiction]:
    """No time constant of the machine is too short for the exact solution of its equations.

    Parameters
    ----------
    plant : Plant
        The machine.
    friction : FrictionTables
        Its viscous part decays speed.
    fastest : float
        Largest sum of the rates [1/s].
    """
    resistance, coupling, mass = plant.resistance, plant.coupling, plant.mass
    side, table = max({"right": friction.right, "left": friction.left}.items(), key=lambda entry: entry[1].viscous)
    viscous, rate = f"mechanics.friction.{side}.viscous", table.viscous / mass
    electrical = resistance / plant.inductance + math.sqrt(coupling / plant.inductance)
    if electrical + rate <= fastest:
        return
    allowed = f"such that the rates of the machine add up to 1/{format_quantity(1 / fastest, 's')} or less"
    if rate >= fastest:
        left = (fastest - electrical) * mass * (1 - BARELY)
        remedy = put(viscous, at_most(left, "N*s/m")) if left > 0 else "check the units of motor and friction"
        yield Contradiction((viscous, "motor.inductance"), f"{allowed}, here viscous over mass", remedy)
        return
    # R/L + sqrt(coupling/L) = fastest - rate is a square in 1/sqrt(L).
    root = (math.sqrt(coupling + 4 * resistance * (fastest - rate)) - math.sqrt(coupling)) / (2 * resistance)
    nearest = at_least(1 / root**2 * (1 + BARELY), "H")
    yield Contradiction(
        ("motor.inductance", "motor.resistance", viscous),
        f"{allowed}, here R / L",
        either(put("motor.inductance", nearest), "lower motor.resistance"),
    )


def burst(table: BurstTable | None, tick: float) -> Iterator[Contradiction]:
    """A burst is given by its first moment or by its ticks; `tick` is the base tick [s]."""
    if table is None:
        return
    at, ticks = f"{BURST}.at", f"{BURST}.ticks"
    if table.ticks:
        yield from _listed(table)
    elif table.at is None:
        yield Contradiction((at, ticks), "the first moment, or ticks in its place", 'add at = "5 ms", or ticks')
    if table.at is not None and table.count > 1 and table.spacing < tick:
        yield Contradiction(
            (f"{BURST}.spacing", f"{BURST}.count"),
            f"at least one base tick, {format_quantity(tick, 's')}: a line carries one pulse at a time",
            either(put(f"{BURST}.spacing", at_least(tick, "s")), put(f"{BURST}.count", 1)),
        )


def _listed(table: BurstTable) -> Iterator[Contradiction]:
    ticks = f"{BURST}.ticks"
    for name, default in (("at", None), ("count", 1), ("spacing", BurstTable.model_fields["spacing"].default)):
        if getattr(table, name) != default:
            yield Contradiction(
                (f"{BURST}.{name}", ticks),
                f"left out where ticks are listed, {len(table.ticks)} of them here",
                f"remove {name}, or remove ticks",
            )
            return
    rising = sorted(set(table.ticks))
    if rising != table.ticks:
        yield Contradiction((ticks,), "whole numbers that rise, each once", put(ticks, rising))
