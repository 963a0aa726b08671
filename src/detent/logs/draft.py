"""A recording while it is being checked: its columns as numbers of the file first, in SI units after `convert`."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from detent.logs.log import Action, Finding, Kind, Rows, Severity, Source, Values, row_ranges


@dataclass
class Draft:
    """Columns of a recording, by their roles."""

    file: str  # the file as the user named it
    rows: Rows  # row of the file of each sample, shape (n,)
    t: Values  # time, shape (n,)
    values: dict[str, Values]  # from a role to its numbers, shape (n,)
    units: dict[str, str]  # from a role, ``time`` too, to its unit after `convert`
    sources: dict[str, Source]  # from a role, ``time`` too, to where it comes from, and how its numbers become SI units
    # from a role to the width of its counter, where stated
    bits: dict[str, int] = field(default_factory=dict[str, int])
    delays: dict[str, float] = field(default_factory=dict[str, float])  # from a role to its stated delay [s]
    guessed_units: set[str] = field(default_factory=set[str])  # roles whose unit was guessed
    findings: list[Finding] = field(default_factory=list[Finding])  # what was found so far
    guesses: list[str] = field(default_factory=list[str])  # what was guessed so far

    def __len__(self) -> int:
        return len(self.t)

    def keep(self, which: NDArray[np.bool_] | NDArray[np.intp]) -> None:
        """Keep some samples, by a mask or in the order of indices."""
        self.t, self.rows = self.t[which], self.rows[which]
        self.values = {role: values[which] for role, values in self.values.items()}

    def note(  # noqa: PLR0913 - the fields of a finding
        self,
        kind: Kind,
        signal: str,
        where: NDArray[np.bool_] | NDArray[np.intp] | Sequence[int],
        text: str,
        action: Action,
        advice: str = "",
        severity: Severity = Severity.WARNING,
    ) -> None:
        """Note a finding about samples given by a mask or by indices; all samples where there are no indices."""
        places = np.asarray(where)
        rows = self.rows[places] if len(places) else np.empty(0, dtype=np.int64)
        self.findings.append(Finding(kind, signal, row_ranges(np.sort(rows)), text, action, advice, severity))

    def convert(self) -> None:
        """Bring all numbers into SI units."""
        self.t = self.t * self.sources["time"].factor + self.sources["time"].offset
        for role, values in self.values.items():
            self.values[role] = values * self.sources[role].factor + self.sources[role].offset

    def rescale(self, role: str, factor: float) -> None:
        """Multiply a converted signal, and remember it."""
        self.values[role] = self.values[role] * factor
        source = self.sources[role]
        self.sources[role] = replace(source, factor=source.factor * factor, offset=source.offset * factor)


def tell_count(count: int, what: str) -> str:
    """A number of things in a sentence.

    >>> tell_count(1, "row"), tell_count(3, "row")
    ('1 row', '3 rows')
    """
    return f"{count} {what}{'' if count == 1 else 's'}"
