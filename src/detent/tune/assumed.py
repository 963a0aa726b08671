"""What an axis does at standstill with friction that its file does not state: a table in place of one verdict."""

from collections.abc import Sequence
from typing import Any

from detent.methods.tuning import Ensemble
from detent.page.table import TextTable
from detent.tune.choice import Progress
from detent.tune.standstill import FLICKERS, HUNTS, OPEN, RESTS, Standstill, standstill
from detent.units import format_quantity

RATIOS = 1.0, 1.15, 1.5, 2.0  # static over Coulomb friction that is tried where the file does not say
SPEEDS = 0.0, 0.3e-3, 1e-3, 3e-3  # Stribeck velocities [m/s]
LONGEST = 10.0  # simulated time of a start in a cell [s]: hunting shows itself sooner, or in the verdict of the file

CAPTION = (
    "The file leaves static friction or the Stribeck velocity to their defaults, 1.15 times Coulomb friction and 0; "
    "the verdict depends on them. Each cell: what the axis does at standstill, and how far it swings where it hunts."
)

Assumed = Sequence[tuple[float, float, Standstill]]
"""Ratios, Stribeck velocities [m/s], and what the axis does with both; none where its file says."""


def assumed(ensemble: Ensemble, seed: int, starts: int, progress: Progress, *, on_counts: bool = False) -> Assumed:
    """The table of an axis whose file does not state how friction falls; empty where nothing is left to assume."""
    found = list[tuple[float, float, Standstill]]()
    for ratio in () if ensemble.stated else RATIOS:
        for speed in SPEEDS:
            progress(len(found) / (len(RATIOS) * len(SPEEDS)), f"static friction {ratio:g} times Coulomb friction")
            spec = ensemble.assumed(ratio, speed)
            found.append((ratio, speed, standstill(spec, starts, seed, on_counts=on_counts, longest=LONGEST)))
    return found


def in_words(found: Assumed) -> str:
    """What the table has, as the end of a sentence."""
    outcomes = [one.outcome for *_, one in found]
    seen = ", ".join(f"{name} in {outcomes.count(name)}" for name in (RESTS, OPEN, FLICKERS, HUNTS) if name in outcomes)
    return f"of {len(found)} that may be, it {seen}"


def as_table(found: Assumed, unit: str) -> TextTable:
    """Ratios by Stribeck velocities; `unit` is that of places."""
    heads = ("static / Coulomb", *(f"stribeck {format_quantity(speed, unit + '/s', 3)}" for speed in SPEEDS))
    cells = {(ratio, speed): _cell(one, unit) for ratio, speed, one in found}
    rows = [(f"{ratio:g}", *(cells[ratio, speed] for speed in SPEEDS)) for ratio in (RATIOS if cells else ())]
    return TextTable("Where the file does not say how friction falls", heads, rows)


def _cell(one: Standstill, unit: str) -> str:
    return f"{one.outcome} {format_quantity(one.swing, unit, 3)}" if one.hunts else one.outcome


def as_dicts(found: Assumed) -> list[dict[str, Any]]:
    """The same as plain data."""
    names = "ratio", "stribeck", "outcome", "swing"
    return [dict(zip(names, (*place, one.outcome, one.swing), strict=True)) for *place, one in found]
