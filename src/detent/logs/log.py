"""A recorded run while it is being checked and after: signals in SI units, and what was found in their file."""

from collections.abc import Collection, Sequence
from dataclasses import asdict, dataclass, field, replace
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.errors import InputError
from detent.files.screen import OnScreen
from detent.files.text import short
from detent.logs.headings import EFFORTS, ROLES, split_heading

Values = NDArray[np.float64]  # numbers of a signal, shape (n,)
Rows = NDArray[np.int64]  # numbers of rows of a file, from 1, header lines not counted, shape (n,)
# What no instrument shows: a cell beyond it says nothing, one below it says 0. Squares of squares of what is computed
# from it stay numbers.
LARGEST, SMALLEST = 1e30, 1e-30
MOST_NAMED = 6  # columns named in a sentence
MOST_RANGES = 5  # stretches of rows named in a sentence; the finding itself holds all


class Kind(StrEnum):
    """What can be wrong with a recording."""

    BROKEN_ROWS = "broken rows"
    MISSING_VALUES = "missing values"
    ROTATED_COLUMNS = "rotated columns"
    DUPLICATED_ROWS = "duplicated rows"
    REPEATED_STAMPS = "repeated stamps"
    TIME_BACKWARDS = "time runs backwards"
    IRREGULAR_TIME = "irregular time"
    DRIFTING_CLOCK = "drifting clock"
    DROPPED_ROWS = "dropped rows"
    WRAPPED_COUNTER = "wrapped counter"
    UNSIGNED = "signed read as unsigned"
    SPIKES = "spikes"
    JUMPS = "jumps"
    COPIED = "copied"
    STUCK = "stuck"
    SATURATED = "saturated"
    WRONG_SIGN = "wrong sign"
    LOST_SIGN = "lost sign"
    WRONG_UNIT = "wrong unit"
    SHIFTED = "shifted"


class Action(StrEnum):
    """What the import did about a finding."""

    REMOVED = "removed"
    REORDERED = "reordered"
    INTERPOLATED = "interpolated"
    UNWRAPPED = "unwrapped"
    CONVERTED = "converted"
    TURNED = "inverted"
    MOVED = "moved"
    LEFT = "left"
    LEFT_OUT = "omitted"


class Severity(StrEnum):
    """How much a finding matters: worth knowing, costs accuracy, makes results wrong."""

    NOTE = "note"
    WARNING = "warning"
    ERROR = "error"


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing wrong with a recording."""

    kind: Kind  # what it is
    signal: str  # role of the signal, or empty for whole rows
    # stretches of rows of the file, first and last, both counted from 1 below the header; empty where the finding is
    # about all of them
    rows: tuple[tuple[int, int], ...]
    text: str  # what was found, with its figures
    action: Action  # what was done
    advice: str = ""  # what the user does about it; empty where nothing is left to do
    severity: Severity = Severity.WARNING  # how much it matters

    def __str__(self) -> str:
        """Give the finding as one line."""
        where = ", ".join(part for part in (tell_rows(self.rows), self.signal) if part)
        line = f"{self.severity}: {where}: {self.text}; {self.action}"
        return f"{line}; try: {self.advice}" if self.advice else line

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {**asdict(self), "rows": [list(stretch) for stretch in self.rows]}


@dataclass(frozen=True, slots=True)
class Source:
    """Where a signal came from."""

    column: str  # column of the file
    unit: str  # unit of its numbers, as stated or guessed
    # factor, offset: ``value = factor * number + offset``, the value in SI units. A correction by a finding (a wrong
    # unit, a wrong sign) is part of them; what unwrapping a counter added is not
    factor: float
    offset: float = 0.0


@dataclass(frozen=True, eq=False, repr=False)
class Log(OnScreen):
    """A recorded run."""

    name: str  # name of the file
    t: Values  # time [s], shape (n,), strictly increasing
    # from a role of `roles.ROLES` to its values in SI units (or counts), shape (n,), all finite
    signals: dict[str, Values]
    units: dict[str, str]  # from a role, ``time`` too, to the unit of its values; empty for a pure number
    columns: dict[str, Source]  # from a role, ``time`` too, to the column it came from
    rows: Rows  # row of the file that each sample came from, from 1 below the header, shape (n,)
    findings: tuple[Finding, ...] = ()  # what was wrong, and what was done
    guesses: tuple[str, ...] = ()  # what was not stated and had to be guessed, and what was skipped
    # single numbers and texts that the file holds beside its columns
    constants: dict[str, float | str] = field(default_factory=dict[str, float | str])
    # rows of the file at which tests begin that a column tells apart, with what it says of each
    tests: tuple[tuple[int, str], ...] = ()
    unread: tuple[str, ...] = ()  # columns of the file that were taken for no signal

    def __len__(self) -> int:
        return len(self.t)

    @property
    def period(self) -> float:
        """Time between two samples [s], the median."""
        return float(np.median(np.diff(self.t)))

    def mask(self, *kinds: Kind, signals: Collection[str] | None = None) -> NDArray[np.bool_]:
        """Samples in the rows of findings of some kinds, about some signals or any."""
        found = np.zeros(len(self.t), dtype=np.bool_)
        for finding in self.findings:
            is_meant = finding.kind in kinds and (signals is None or finding.signal in signals)
            for first, last in finding.rows if is_meant else ():
                found |= (self.rows >= first) & (self.rows <= last)
        return found

    def need(self, *roles: str) -> None:
        """Refuse a question to signals that the recording does not have."""
        for role in roles:
            if role not in self.signals:
                allowed = f"a recording with {' and '.join(roles)}"
                raise InputError.of_file(self.name, self._held(), allowed, f"name the column: {self._named(role)}")

    def effort(self, asked: str = "") -> str:
        """Role of the signal that drives the axis: as asked for, or the nearest to its mechanics that there is."""
        found = [role for role in EFFORTS if role in self.signals]
        if not found or (asked and asked not in found):
            allowed = f"{asked or 'something'} that drives the axis, one of {', '.join(EFFORTS)}"
            remedy = f"name its column: {self._named(asked or 'force')}"
            raise InputError.of_file(self.name, self._held(), allowed, remedy)
        return asked or found[0]

    def _held(self) -> str:
        return f"signals {', '.join(self.signals)}"

    def _named(self, role: str) -> str:
        """What states the column of a signal; a line to paste where a column of the file was taken for none."""
        first, *others = self.unread or ("",)
        if not first:
            return f"{role}=COLUMN [UNIT]"
        more = f", or one of {', '.join(map(short, others[:MOST_NAMED]))}" if others else ""
        unit = "" if split_heading(first)[1] else f" [{ROLES[role].units[0]}]".replace(" []", "")
        return f"--column '{role}={short(first)}{unit}'{more}"

    def to_dict(self) -> dict[str, Any]:
        """What was read, as plain data for JSON: everything but the numbers."""
        return {
            "name": self.name,
            "samples": len(self),
            "span": [float(self.t[0]), float(self.t[-1])],
            "period": self.period,
            "units": dict(self.units),
            "columns": {role: asdict(source) for role, source in self.columns.items()},
            "constants": dict(self.constants),
            "findings": [finding.to_dict() for finding in self.findings],
            "guesses": list(self.guesses),
        }


@dataclass
class Draft:
    """A recording while it is being checked, by roles: numbers of the file first, in SI units after `convert`."""

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
    # rows of the file at which tests begin that a column tells apart, with what it says of each
    tests: list[tuple[int, str]] = field(default_factory=list[tuple[int, str]])

    def __len__(self) -> int:
        return len(self.t)

    def keep(self, which: NDArray[np.bool_] | NDArray[np.intp]) -> None:
        """Keep some samples, by a mask or in the order of indices."""
        if which.dtype == np.bool_ and which.all():
            return
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
        self.t = self._converted("time", self.t)
        for role, values in self.values.items():
            self.values[role] = self._converted(role, values)

    def _converted(self, role: str, values: Values) -> Values:
        """Numbers of a signal in SI units; refused where its unit or its factor makes of them what nothing shows."""
        source, unit = self.sources[role], self.units[role]
        with np.errstate(over="ignore"):
            found = values * source.factor + source.offset
        most = float(np.abs(found).max(initial=0.0))
        if not (most == 0.0 or SMALLEST <= most <= LARGEST):
            allowed = f"{role} from {SMALLEST:g} to {LARGEST:g} {unit}".rstrip()
            remedy = f"state another unit or factor of {role}"
            raise InputError.of_file(self.file, f"{role} up to {most:.3g} {unit}".rstrip(), allowed, remedy)
        return found

    def rescale(self, role: str, factor: float) -> None:
        """Multiply a converted signal, and remember it."""
        self.values[role] = self.values[role] * factor
        source = self.sources[role]
        self.sources[role] = replace(source, factor=source.factor * factor, offset=source.offset * factor)


def row_ranges(rows: Sequence[int] | NDArray[np.integer]) -> tuple[tuple[int, int], ...]:
    """Put row numbers together to stretches.

    >>> row_ranges([3, 4, 5, 9])
    ((3, 5), (9, 9))
    """
    numbers = np.asarray(rows, dtype=np.int64)
    if not len(numbers):
        return ()
    cuts = np.flatnonzero(np.diff(numbers) > 1)
    firsts = numbers[np.r_[0, cuts + 1]].tolist()
    lasts = numbers[np.r_[cuts, len(numbers) - 1]].tolist()
    return tuple(zip(firsts, lasts, strict=True))


def tell_rows(ranges: Sequence[tuple[int, int]]) -> str:
    """Name stretches of rows in a sentence.

    >>> tell_rows([(3, 5), (9, 9)])
    'rows 3-5, 9'
    >>> tell_rows([])
    'all rows'
    """
    if not ranges:
        return "all rows"
    named = [str(first) if first == last else f"{first}-{last}" for first, last in ranges[:MOST_RANGES]]
    more = f" and {len(ranges) - MOST_RANGES} more places" if len(ranges) > MOST_RANGES else ""
    word = "row" if len(ranges) == 1 and ranges[0][0] == ranges[0][1] else "rows"
    return f"{word} {', '.join(named)}{more}"


def tell_count(count: int, what: str) -> str:
    """A number of things in a sentence.

    >>> tell_count(1, "row"), tell_count(3, "row")
    ('1 row', '3 rows')
    """
    return f"{count} {what}{'' if count == 1 else 's'}"
