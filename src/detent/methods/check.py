"""What `detent check` shows: effective values, derived figures, and warnings.

Data only; the command line prints it.
"""

import dataclasses
from collections.abc import Iterator
from typing import Any

from detent.files.fields import held_leaves
from detent.files.findings import Caution, Derived
from detent.files.problems import dotted, format_value
from detent.files.screen import Block, OnScreen, Screen
from detent.methods.load import AxisFile
from detent.methods.registry import METHODS


@dataclasses.dataclass(frozen=True, slots=True)
class EffectiveRow:
    """One effective value."""

    key: str  # dotted key
    value: str  # value with its SI unit (prefixed)
    written: str  # value as it was written; empty for a default
    origin: str  # "FILE line 12", "default", "catalogue NAME" or "--set"
    doc: str  # meaning of the key


@dataclasses.dataclass(frozen=True, slots=True, repr=False)
class CheckReport(OnScreen):
    """Everything `detent check` has to show."""

    file: str  #: the file as the user named it
    name: str  #: name of the axis
    method: str  #: its control method
    rows: tuple[EffectiveRow, ...]  #: effective values, in the order of the schema
    derived: tuple[Derived, ...]  #: what follows from them
    warnings: tuple[Caution, ...]  #: what looks wrong; empty for a sound axis

    def screen(self) -> Screen:
        """Warnings, what follows from the values, and, in a notebook, the values."""
        number = len(self.warnings)
        told = f"{number} warning{'s' if number > 1 else ''}" if number else "no warnings"
        title = "\n".join([f"{self.name} ({self.method}): {told}", self.file, *map(str, self.warnings)])
        figures = [(figure.name, figure.text, figure.formula) for figure in self.derived]
        values = [(row.key, row.value, row.origin) for row in self.rows]
        blocks = [
            Block("Derived figures", ("figure", "value", "from"), figures, 24, ".derived has all"),
            Block("Every effective value", ("key", "value", "origin"), values, 0),
        ]
        return Screen(title, blocks, f"{len(values)} effective values: .rows")

    def to_dict(self) -> dict[str, Any]:
        """Give the report as plain data for ``--json``."""
        return dataclasses.asdict(self)


def check_spec(axis: AxisFile) -> CheckReport:
    """Look an axis over."""
    header = axis.spec.axis
    method = METHODS[header.method]
    warnings = tuple(method.cautions(axis.spec))
    return CheckReport(axis.file, header.name, header.method, tuple(_rows(axis)), method.derive(axis.spec), warnings)


def _rows(axis: AxisFile) -> Iterator[EffectiveRow]:
    """Every effective value."""
    for path, field, held in held_leaves(axis.spec):
        key = dotted(path)
        origin = axis.origins.get(key, "default")
        if origin.startswith("line "):
            origin = f"{axis.file} {origin}"
        value = format_value(field, held)
        yield EffectiveRow(key, value, axis.texts.get(key, ""), origin, field.description or "")
