"""Checks that several methods share: contradictions between keys, and cautions about drive and motor."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from detent.axisfile.tables import BurstTable, FrictionTable, FrictionTables, HomeTable, InnerHomeTable
from detent.files.findings import Caution, Contradiction, wrong
from detent.files.nearest import BARELY, UNITS, Remedies, at_least, at_most, put
from detent.units import format_quantity as text

BURST = "disturbance.lines.burst"


def static_friction(tables: Mapping[str, Any], unit: str = "N") -> Iterator[Contradiction]:
    """Static friction, `static`, is at least the Coulomb friction, `coulomb`, in each table of one direction."""
    for key, table in tables.items():
        if table.static < table.coulomb:
            least = f"at least the Coulomb friction, {text(table.coulomb, unit)}; its default is 1.15 x coulomb"
            yield wrong(f"{key}.static {key}.coulomb", least, put(f"{key}.static", at_least(table.coulomb, unit)))


def sides(friction: FrictionTables) -> dict[str, FrictionTable]:
    """Friction to the right and to the left by the keys of its tables."""
    return {"mechanics.friction.right": friction.right, "mechanics.friction.left": friction.left}


def inside_travel(positions: Mapping[str, float], travel: float) -> Iterator[Contradiction]:
    """Places of the axis, by their keys, lie on its way of `travel` [m]."""
    for key, position in positions.items():
        if position > travel:
            yield wrong(
                f"{key} limits.travel", f"up to limits.travel, {text(travel, 'm')}", put(key, at_most(travel, "m"))
            )


def home(  # noqa: PLR0913 - an axis, and how it is written
    remedy: Remedies, table: HomeTable | None, ends: tuple[float, float], speed: float, *, unit: str = "m", at: str = ""
) -> Iterator[Contradiction]:
    """A reference can be found, and lies where the axis, with `ends` [m] and a largest `speed` [m/s], may come.

    `at` is what stands before the keys of its tables.
    """
    if table is None:
        return
    for key, value, most, largest in (
        ("speed", table.speed, speed, "limits.speed"), ("creep", table.creep, table.speed, "home.speed")
    ):  # fmt: skip
        if value > most:
            allowed = f"up to {largest}, {text(most, f'{unit}/s')}"
            yield wrong(f"{at}home.{key} {at}{largest}", allowed, remedy.most(f"{at}home.{key}", most))
    end, travel = ends[1] if table.side > 0 else ends[0], ends[1] - ends[0]
    inner, contact = isinstance(table, InnerHomeTable), table.by == "contact"
    farthest = end - table.side * table.edge_to_index if inner and table.by == "index" else end
    beyond, room = (table.position - farthest) * table.side, BARELY * travel if inner else 0.5 * table.back_off
    if not -(0.0 if contact else travel) <= beyond <= room:
        place = f"{text(farthest, unit)}, the end of the travel" if contact else "within the travel"
        if farthest != end:
            place = f"within the travel, and home.edge_to_index before its end: up to {text(farthest, unit)}"
        allowed = place if inner else f"{place}, or up to half of home.back_off beyond it"
        keys = f"{at}home.position {at}home.back_off {at}limits.travel"
        yield wrong(keys, allowed, remedy.exactly(f"{at}home.position", farthest))


def end_of_move(remedy: Remedies, timeout: float, settled: float, tick: float) -> Iterator[Contradiction]:
    """A move can be in position for long enough before its time is over."""
    if timeout < settled + tick:
        yield wrong(
            "method.timeout method.in_position_time",
            f"longer than method.in_position_time, {text(settled, 's')}: no move could end",
            remedy.least("method.timeout", (settled + tick) * (1 + BARELY)),
        )


@dataclass(frozen=True, slots=True)
class Plant:
    """Constants that decide how fast a machine's state changes: ohm, H (above 0), V/(A*s), kg.

    `coupling` is the exchange between winding and mass: force constant x back-EMF constant / mass.
    """

    resistance: float
    inductance: float
    coupling: float
    mass: float


def time_constants(plant: Plant, friction: FrictionTables, fastest: float) -> Iterator[Contradiction]:
    """The rates of the machine add up to `fastest` [1/s] or less, for the exact solution of its equations."""
    resistance, coupling, mass = plant.resistance, plant.coupling, plant.mass
    side, table = max({"right": friction.right, "left": friction.left}.items(), key=lambda entry: entry[1].viscous)
    viscous, rate = f"mechanics.friction.{side}.viscous", table.viscous / mass
    electrical = resistance / plant.inductance + math.sqrt(coupling / plant.inductance)
    allowed = f"such that the rates of the machine add up to 1/{text(1 / fastest, 's')} or less, here"
    if electrical + rate <= fastest:
        return
    if rate >= fastest:
        left = (fastest - electrical) * mass * (1 - BARELY)
        remedy = put(viscous, at_most(left, "N*s/m")) if left > 0 else UNITS
        yield wrong(f"{viscous} motor.inductance", f"{allowed} viscous over mass", remedy)
    else:
        # R/L + sqrt(coupling/L) = fastest - rate is a square in 1/sqrt(L).
        root = (math.sqrt(coupling + 4 * resistance * (fastest - rate)) - math.sqrt(coupling)) / (2 * resistance)
        remedy = put("motor.inductance", at_least(1 / root**2 * (1 + BARELY), "H"))
        yield wrong(f"motor.inductance motor.resistance {viscous}", f"{allowed} R / L", remedy)


def burst(table: BurstTable | None, tick: float) -> Iterator[Contradiction]:
    """A burst is given by its first moment or by its ticks; `tick` is the base tick [s]."""
    if table is None:
        return
    ticks, spacing = table.ticks, BurstTable.model_fields["spacing"].default
    stated = [k for k, default in (("at", None), ("count", 1), ("spacing", spacing)) if getattr(table, k) != default]
    if ticks and stated:
        name, allowed = stated[0], f"left out where ticks are listed, {len(ticks)} of them here"
        yield wrong(f"{BURST}.{name} {BURST}.ticks", allowed, f"remove {name}, or remove ticks")
    elif ticks != sorted(set(ticks)):
        yield wrong(f"{BURST}.ticks", "whole numbers that rise, each once", put(f"{BURST}.ticks", sorted(set(ticks))))
    elif table.at is None and not ticks:
        keys = f"{BURST}.at {BURST}.ticks"
        yield wrong(keys, "the first moment, or ticks in its place", 'add at = "5 ms", or ticks')
    if table.at is not None and table.count > 1 and table.spacing < tick:
        yield wrong(
            f"{BURST}.spacing {BURST}.count",
            f"at least one base tick, {text(tick, 's')}: a line carries one pulse at a time",
            put(f"{BURST}.spacing", at_least(tick, "s")),
        )


def idle_effort(remedy: Remedies, effort: float, most: float, unit: str, giver: str) -> Iterator[Caution]:
    """limits.effort is not above what the drive gives."""
    if effort > most * (1 + 1e-6):
        limit, consequence = f"up to what {giver}, {text(most, unit)}", "the limit never acts: the drive is weaker"
        yield Caution("limits.effort", text(effort, unit), limit, consequence, remedy.most("limits.effort", most))


def overheating(name: str, current: float, most: float | None, remedy: str) -> Iterator[Caution]:
    """A current [A] that lasts is not above motor.max_current."""
    if most is not None and current > most * (1 + BARELY):
        limit = f"up to motor.max_current, {text(most, 'A')}"
        yield Caution(name, text(current, "A"), limit, "the motor overheats if this persists", remedy)
