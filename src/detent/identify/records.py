"""Recordings of one axis against one another: which constants changed, and how far they wander from day to day."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from detent.errors import DetentError
from detent.files.screen import Block, OnScreen, Screen
from detent.identify.fit.estimate import Estimate, estimate, quantile
from detent.identify.fit.identification import Method
from detent.identify.identified import Identified, identify_axis
from detent.identify.page.words import written
from detent.logs.differences import scipy
from detent.page.table import TextTable
from detent.page.words import GAP

if TYPE_CHECKING:
    from detent.record.machine import Progress

FAR = 0.05  # chance that constants that are the same are called changed


@dataclass(frozen=True, slots=True)
class Wander:
    """A constant in several recordings.

    Attributes
    ----------
    name : str
        What it is called.
    records : tuple of Estimate or None
        As each recording alone tells it, with the 95 % interval of the record; None where it is not trusted there.
    of_the_day : Estimate
        The mean of those that are trusted; its interval is where that of one more recording is expected in 95 %.
    changed : bool
        True where the recordings differ by more than their intervals explain: Cochran's test, level 5 %.
    """

    name: str
    records: tuple[Estimate | None, ...]
    of_the_day: Estimate
    changed: bool

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "name": self.name,
            "records": [one and one.to_dict() for one in self.records],
            "of_the_day": self.of_the_day.to_dict(),
            "changed": self.changed,
        }


@dataclass(frozen=True, repr=False)
class Compared(OnScreen):
    """Several recordings of one axis, each identified alone.

    Attributes
    ----------
    each : tuple of Identified
        What each of them told.
    constants : tuple of Wander
        Every constant that two or more of them determine.
    alone : tuple of str
        Constants that only one of them determines.
    """

    each: tuple[Identified, ...]
    constants: tuple[Wander, ...]
    alone: tuple[str, ...]

    @property
    def changed(self) -> tuple[str, ...]:
        """Constants that changed between the recordings."""
        return tuple(one.name for one in self.constants if one.changed)

    @property
    def sentence(self) -> str:
        """What came of it, in a sentence."""
        logs = f"{len(self.each)} recordings"
        if not self.constants:
            return f"Not compared: no constant is trusted in two of {logs}."
        if not self.changed:
            return f"Nothing changed: {len(self.constants)} constants of {logs} agree within their intervals."
        return f"Changed between {logs}: {', '.join(self.changed)}."

    @property
    def table(self) -> TextTable:
        """Every constant by recording, and of the day."""
        names = [one.found.logs[0].name for one in self.each]
        rows: list[tuple[str, ...]] = []
        for one in self.constants:
            cells = [_cell(found) if found else "not trusted" for found in one.records]
            unit = written(one.of_the_day).unit.replace(GAP, " ")
            rows.append((one.name, *cells, _cell(one.of_the_day), unit, "changed" if one.changed else ""))
        return TextTable("Constants of each recording, 95 % intervals", ("", *names, "of the day", "unit", ""), rows)

    def screen(self) -> Screen:
        """The sentence and the table."""
        return Screen(self.sentence, [Block(*self.table)], ".constants  .changed  .each")

    def to_dict(self) -> dict[str, Any]:
        """Everything, as plain data for JSON."""
        return {
            "changed": list(self.changed),
            "constants": [one.to_dict() for one in self.constants],
            "alone": list(self.alone),
            "records": [one.to_dict() for one in self.each],
        }


def _cell(one: Estimate) -> str:
    text = written(one)
    return f"{text.value} ± {text.half}".replace(GAP, " ")


def compare_records(  # noqa: PLR0913 - the options of `detent identify --compare`
    logs: Sequence[str | Path],
    *,
    mapping: str | Path | None = None,
    columns: Sequence[str] = (),
    effort: str | None = None,
    method: Method = "auto",
    progress: "Progress | None" = None,
) -> Compared:
    """Identify each recording alone, and say which constants changed between them.

    Parameters
    ----------
    logs : sequence of path
        Two or more recordings of one axis.
    mapping, columns, effort, method, progress
        As for `identify_axis`.

    Returns
    -------
    Compared
        Also when nothing can be compared: see `Compared.constants`.

    Raises
    ------
    InputError
        A log or the mapping cannot be read.
    DetentError
        Fewer than two logs.

    Notes
    -----
    A record of minutes tells its friction to a part in a thousand and says nothing of tomorrow's: temperature,
    lubricant and load move it by more. The interval of the day is that of random effects: with the values ``x`` and
    errors ``s`` of ``k`` recordings, the variance between them is estimated from Cochran's
    ``Q = sum (x - mean)^2 / s^2`` (DerSimonian, Laird: Meta-analysis in clinical trials. Controlled Clinical Trials 7
    (1986)); the next one is expected within Student's quantile of ``k - 1`` degrees of freedom (Higgins, Thompson,
    Spiegelhalter: A re-evaluation of random-effects meta-analysis. J. R. Stat. Soc. A 172 (2009)). Two recordings
    leave one degree of freedom: their interval is wide, and rightly.
    """
    if len(logs) < 2:
        got = f"{len(logs)} log{'' if len(logs) == 1 else 's'}"
        raise DetentError(f"compare: got {got}; expected: two or more recordings of one axis; name another one")
    each: list[Identified] = []
    for number, path in enumerate(logs):
        told = partial(_share, progress, number, len(logs)) if progress else None
        each.append(identify_axis(path, mapping=mapping, columns=columns, effort=effort, method=method, progress=told))
    names = list(dict.fromkeys(name for one in each for name in one.trusted))
    rows = {name: tuple(one.trusted.get(name) for one in each) for name in names}
    both = [name for name in names if sum(one is not None for one in rows[name]) > 1]
    wanders = tuple(_wander(name, rows[name]) for name in both)
    return Compared(tuple(each), wanders, tuple(name for name in names if name not in both))


def _share(progress: "Progress", number: int, count: int, share: float, text: str) -> None:
    progress((number + share) / count, text)


def _wander(name: str, records: tuple[Estimate | None, ...]) -> Wander:
    """How a constant wanders, by random effects."""
    known = [one for one in records if one is not None]
    # An interval may reach farther than its standard error, where few rows carry it: what counts is the interval.
    errors = [max(one.half / quantile(math.inf), 1e-12 * abs(one.value), 1e-300) for one in known]
    weights = [1.0 / error**2 for error in errors]
    total, k = math.fsum(weights), len(known)
    mean = math.fsum(w * one.value for w, one in zip(weights, known, strict=True)) / total
    q = math.fsum(w * (one.value - mean) ** 2 for w, one in zip(weights, known, strict=True))
    spread = total - math.fsum(w**2 for w in weights) / total
    between = max(0.0, (q - (k - 1)) / spread)
    widened = [1.0 / (between + error**2) for error in errors]
    centre = math.fsum(w * one.value for w, one in zip(widened, known, strict=True)) / math.fsum(widened)
    error = math.sqrt(between + 1.0 / math.fsum(widened))
    changed = q > float(scipy("special").chdtri(k - 1, FAR))
    method = f"random effects over {k} recordings"
    return Wander(name, records, estimate(name, centre, known[0].unit, error, method, k - 1), changed)
