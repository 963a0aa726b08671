"""What `detent check` shows: every value in effect, what follows from them, and what looks wrong.

Data only; the command line prints it.
"""

import dataclasses
from collections.abc import Iterator
from typing import Any

from detent.files.fields import held_leaves
from detent.files.findings import Caution, Derived
from detent.files.problems import dotted, format_value
from detent.methods.load import AxisFile
from detent.methods.registry import METHODS


@dataclasses.dataclass(frozen=True, slots=True)
class EffectiveRow:
    """One value in effect."""

    key: str  # dotted key
    value: str  # value with its SI unit (prefixed)
    written: str  # value as it was written; empty for a default
    origin: str  # "FILE line 12", "default", "catalogue NAME" or "--set"
    doc: str  # meaning of the key


@dataclasses.dataclass(frozen=True, slots=True)
class CheckReport:
    """Everything `detent check` has to show."""

    file: str  #: the file as the user named it
    name: str  #: name of the axis
    method: str  #: its control method
    rows: tuple[EffectiveRow, ...]  #: every value in effect, in the order of the schema
    derived: tuple[Derived, ...]  #: what follows from them
    warnings: tuple[Caution, ...]  #: what looks wrong; empty for a sound axis

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
    """Every value in effect."""
    for path, field, held in held_leaves(axis.spec):
        key = dotted(path)
        origin = axis.origins.get(key, "default")
        if origin.startswith("line "):
            origin = f"{axis.file} {origin}"
        value = format_value(field, held)
        yield EffectiveRow(key, value, axis.texts.get(key, ""), origin, field.description or "")
