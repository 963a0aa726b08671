"""Single analyses of a recording, what to do with each result, and a report."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from detent.errors import DetentError
from detent.files.screen import OnScreen, Screen
from detent.identify.analyse.analyses import ANALYSES, Analysis, check_names
from detent.identify.analyse.analyses import analyse as ask
from detent.identify.fit import untold
from detent.identify.fit.estimate import Estimate
from detent.identify.fit.identification import identify
from detent.identify.page.words import written
from detent.identify.remarks import friction_remarks
from detent.logs.log import Log
from detent.logs.read_log import read_log
from detent.page.table import TextTable
from detent.page.words import GAP

if TYPE_CHECKING:
    from detent.record.machine import Progress

HEADS = ("", "value", "95 % interval", "unit")


@dataclass(frozen=True, repr=False)
class Analysed(OnScreen):
    """Results of the analyses of a recording.

    Attributes
    ----------
    log : Log
        What was read.
    answers : tuple of Analysis
        In the order asked, those without an answer too.
    asked : bool
        Whether the questions were named; else all there are were tried.
    remarks : tuple of str
        Where another command says something else of the same log, and why.
    """

    log: Log
    answers: tuple[Analysis, ...]
    asked: bool
    remarks: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> Analysis:
        """Give the answer to one question."""
        check_names([name])
        found = next((one for one in self.answers if one.name == name), None)
        if found is None:
            asked = ", ".join(one.name for one in self.answers)
            raise DetentError(f"{self.log.name}: {name} was not requested, only {asked}; name it in what")
        return found

    @property
    def done(self) -> bool:
        """Whether every question that was named has a trusted answer; of questions that were not, any."""
        trusted = [bool(one.estimates) and not one.reason for one in self.answers]
        return all(trusted) if self.asked else any(trusted)

    @cached_property
    def recommendations(self) -> dict[str, str]:
        """What to do with each answer, or what to record for one, by question."""
        return {one.name: one.advice for one in self.answers}

    def screen(self) -> Screen:
        """What to do with each answer."""
        title = "\n".join([f"{self.log.name}, analysed", *(f"{n}: {text}" for n, text in self.recommendations.items())])
        return Screen("\n".join([title, *self.remarks]), [], ".answers  .report('report.html')")

    def report(self, path: str | Path, *, force: bool = False) -> Path:
        """Write the report as one self-contained HTML file; `force` replaces one that detent did not write."""
        from detent.identify.page.analysed import analysed_page
        from detent.page.render import write_page

        write_page(path, analysed_page(self), force=force)
        return Path(path)

    def to_dict(self) -> dict[str, Any]:
        """Plain data, as ``--json`` prints it."""
        answers = [one.to_dict() | {"recommendation": one.advice} for one in self.answers]
        return {"log": self.log.to_dict(), "analyses": answers, "remarks": list(self.remarks), "done": self.done}


def table_of(answer: Analysis) -> TextTable:
    """Every constant of an answer with its limits, in the units of `detent identify`."""
    rows: list[tuple[str, ...]] = []
    for found in answer.estimates:
        one = _readable(found)
        text, scale = written(one), 1e3 if one.unit == "s" else 1.0
        value = f"{text.value} ± {text.half}" if one.half > 0.0 else text.value
        limits = f"{one.low * scale:.5g} to {one.high * scale:.5g}" if one.half > 0.0 else ""
        rows.append(tuple(cell.replace(GAP, " ") for cell in (one.name, value, limits, text.unit)))
    return TextTable(f"{answer.title[0].upper()}{answer.title[1:]} ({answer.name})", HEADS, rows)


def _readable(one: Estimate) -> Estimate:
    """A length in the prefix that it is read in; all else as it is."""
    if one.unit != "m":
        return one
    prefixes = ((1.0, "m"), (1e-3, "mm"), (1e-6, "µm"), (1e-9, "nm"))
    size, unit = next((held for held in prefixes if abs(one.value) >= held[0]), prefixes[2])
    factor = 1.0 / size
    error, low, high = (factor * value for value in (one.error, one.low, one.high))
    return replace(one, value=factor * one.value, unit=unit, error=error, low=low, high=high)


def analyse(  # noqa: PLR0913 - the options of `detent analyse`
    log: str | Path | Log,
    what: str | Sequence[str] = (),
    *,
    mapping: str | Path | None = None,
    columns: Sequence[str] = (),
    effort: str = "",
    mass: float = 0.0,
    progress: "Progress | None" = None,
) -> Analysed:
    """Analyse single aspects of a recording.

    Parameters
    ----------
    log : path or Log
        CSV, HDF5, Parquet, MATLAB, NPZ or JSON.
    what : str or sequence of str
        "two-speeds", "friction-map", "winding", "frequency", "steps", "sensors"; by default all.
    mapping : path, optional
        Mapping file (TOML): what the columns are; what neither it nor `columns` says is guessed.
    columns : sequence of str
        The same in short: ``"force=vir [35.15 N]"``.
    effort : str
        What drives the axis; by default the first of force, torque, current, voltage and command in the log.
    mass : float
        Effort per acceleration, for the friction map [kg where the effort is a force].
    progress : callable, optional
        ``progress(share, text)``.

    Returns
    -------
    Analysed
        Also when no question has an answer: see `Analysed.done` and `Analysed.recommendations`.

    Raises
    ------
    InputError
        The log or the mapping cannot be read.
    DetentError
        A question is unknown.
    """
    names = list(dict.fromkeys([what] if isinstance(what, str) else what)) or list(ANALYSES)
    check_names(names)
    tell = progress or untold
    read = log if isinstance(log, Log) else read_log(log, mapping, columns)
    found: list[Analysis] = []
    for k, name in enumerate(names):
        tell(0.9 * k / len(names), name)
        found.append(ask(read, name, effort, mass))
    tell(0.9, "comparing")
    frictions = [one for one in found if one.name in {"two-speeds", "friction-map"} and one.estimates]
    remarks = _compared(read, effort) if frictions else ()
    return Analysed(read, tuple(found), bool(what), remarks)


def _compared(log: Log, effort: str) -> tuple[str, ...]:
    """Where an identification of the same log tells another friction."""
    try:
        found = identify([log], effort or None)
    except DetentError:
        return ()
    named = {one.name: one for one in found.trusted}
    return tuple(one.replace(GAP, " ") for one in friction_remarks(log, found.runs[0].effort_name, named))
