"""What a look at a specification finds: derived figures, contradictions between keys, and cautions.

A contradiction makes the file wrong; a caution does not: the axis can be built and run, but something about it will
surprise. Each method finds its own (`methods.Method`); the forms are common, so that one command shows them all.
"""

from dataclasses import dataclass

from detent.files.locate import Path
from detent.units import format_quantity


@dataclass(frozen=True, slots=True)
class Derived:
    """One derived figure.

    Attributes
    ----------
    name : str
        What it is.
    value : float
        The figure in `unit`.
    unit : str
        SI unit, or the unit of the specification ("count", "emitter").
    text : str
        Value and unit as a person reads them.
    formula : str
        How it was computed.
    """

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
    """Keys that do not go together."""

    keys: tuple[str, ...]  # dotted keys the rule looked at, the one to blame first
    allowed: str  # and remedy: as in `FileProblem`
    remedy: str

    @property
    def paths(self) -> tuple[Path, ...]:
        """The keys as paths."""
        return tuple(tuple(key.split(".")) for key in self.keys)


def wrong(keys: str, allowed: str, remedy: str) -> Contradiction:
    """Contradiction between keys, written with spaces between them; the one to blame first is the first."""
    return Contradiction(tuple(keys.split()), allowed, remedy)


@dataclass(frozen=True, slots=True)
class Caution:
    """One thing that looks wrong.

    Attributes
    ----------
    name : str
        What it is about.
    value, limit : str
        The figure and what it should be, with units.
    consequence : str
        What will happen.
    remedy : str
        What to do about it.
    """

    name: str
    value: str
    limit: str
    consequence: str
    remedy: str

    def __str__(self) -> str:
        """Give the warning as one line."""
        return f"{self.name}: {self.value}; should be {self.limit}; {self.consequence}; do: {self.remedy}"
