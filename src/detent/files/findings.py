"""What a look at a specification finds: derived figures, contradictions between keys, and cautions.

A contradiction makes the file wrong; a caution does not: the axis can be built and run, but something about it will
surprise. Each method finds its own (its `checks` and `derive`); the forms are common, so that one command shows them.
"""

from dataclasses import dataclass

from detent.files.locate import Path
from detent.units import format_quantity


@dataclass(frozen=True, slots=True)
class Derived:
    """One derived figure: `value` in `unit` (SI, or "count", "emitter"), as a person reads it, how it was computed."""

    name: str
    value: float
    unit: str
    text: str
    formula: str


def quantity_figure(name: str, value: float, unit: str, formula: str) -> Derived:
    """Figure in an SI unit, its text made by `format_quantity`."""
    return Derived(name, value, unit, format_quantity(value, unit), formula)


def count_figure(name: str, value: float, formula: str, unit: str = "count") -> Derived:
    """Figure in counts of the machine, or in counts per something ("count/V")."""
    return Derived(name, value, unit, f"{value:.4g} {unit if '/' in unit else 'counts'}", formula)


@dataclass(frozen=True, slots=True)
class Contradiction:
    """Keys that do not go together, the one to blame first in front; `allowed` and `remedy` as in `FileProblem`."""

    keys: tuple[str, ...]
    allowed: str
    remedy: str

    @property
    def paths(self) -> tuple[Path, ...]:
        """The keys as paths."""
        return tuple(tuple(key.split(".")) for key in self.keys)


def wrong(keys: str, allowed: str, remedy: str) -> Contradiction:
    """Contradiction between keys, written with spaces between them."""
    return Contradiction(tuple(keys.split()), allowed, remedy)


@dataclass(frozen=True, slots=True)
class Caution:
    """One thing that looks wrong: its figure and what it should be, what will happen, what to do about it."""

    name: str
    value: str
    limit: str
    consequence: str
    remedy: str

    def __str__(self) -> str:
        """Give the warning as one line."""
        return f"{self.name}: {self.value}; should be {self.limit}; {self.consequence}; try: {self.remedy}"
