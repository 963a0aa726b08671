"""What an identification found, and the files it can leave: an axis file, a job, a report."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from detent.errors import DetentError
from detent.files.marks import is_ours, is_signed, signed
from detent.files.screen import Block, OnScreen, Screen
from detent.files.source import read_source
from detent.files.text import write_text
from detent.identify.fit import untold
from detent.identify.fit.estimate import Estimate
from detent.identify.fit.identification import Identification, Method, Verdict, identify
from detent.identify.fit.verdict import Refusal
from detent.identify.remarks import remarks_of
from detent.logs.differences import with_position
from detent.logs.log import Log
from detent.logs.parts import split_tests
from detent.logs.read_log import read_log
from detent.page.table import TextTable

if TYPE_CHECKING:
    from detent.files.patch import Change
    from detent.identify.write.file_numbers import Contrast
    from detent.methods.cascade.schema import CascadeSpec
    from detent.record.machine import Progress

MOST_REFUSALS = 5  # refusals told at a prompt
_STAGES = {
    "ladder": (0.1, 0.4, "fitting models to parts of the log"),
    "output error": (0.4, 0.65, "fitting the simulation to the log"),
    "output error on the first part": (0.65, 0.85, "fitting the simulation to the first part"),
    "simulation": (0.85, 0.95, "simulating the held-out part"),
}
"""Shares of the total at which the parts of an identification begin and end, with their texts."""


@dataclass(frozen=True, repr=False)
class Identified(OnScreen):
    """What was found in the logs of an axis.

    Attributes
    ----------
    found : Identification
        Everything: models, constants with their limits, simulation errors, refusals.
    axis : str
        Text of the axis file that the constants belong to; empty where none was named.
    axis_name : str
        Name of that file.
    reading : str
        How the logs were read, as options of the command line.
    """

    found: Identification
    axis: str = ""
    axis_name: str = ""
    reading: str = ""

    @property
    def verdict(self) -> Verdict:
        """Whether the constants can be trusted."""
        return self.found.verdict

    @property
    def sentence(self) -> str:
        """The same in a sentence, with the logs that it is about."""
        from detent.page.words import count

        found = self.found
        logs = " and ".join([log.name for log in found.logs[:2]]) if len(found.logs) < 3 else f"{len(found.logs)} logs"
        number = len(found.estimates)
        if self.verdict == "trusted":
            return f"Trusted: {count(number, 'constant')} of {logs}."
        if self.verdict == "refused":
            return f"Refused: nothing in {logs} is trusted."
        names = [one.name for one in found.estimates if one not in found.trusted]
        are = "are" if len(names) > 1 else "is"
        return f"Partly trusted: {number - len(names)} of {number} constants of {logs}; {', '.join(names)} {are} not."

    @property
    def table(self) -> TextTable:
        """Every constant with its limits, and whether it is trusted; no row where nothing could be fitted."""
        from detent.identify.page.words import is_known, written

        rows: list[tuple[str, ...]] = []
        for one in self.found.estimates:
            text = written(one)
            known = is_known(one)
            scale = 1e3 if one.unit == "s" else 1.0
            limits = f"{one.low * scale:.5g} to {one.high * scale:.5g}".replace("-", "\u2212") if known else ""
            trust = "yes" if one in self.found.trusted else "no"
            value = f"{text.value} ± {text.half}" if known else "not determined by the data"
            if one.name in self.found.bounded:
                value = f"an end of the search, {text.value}"
            rows.append((one.name, value, limits, text.unit, trust))
        by = self.found.estimates[0].method if rows else ""
        title = f"Constants, by {by}" if self.trusted else f"Results by {by}; none of them is trusted"
        return TextTable(title, ("", "value", "95 % interval", "unit", "trusted"), rows)

    def screen(self) -> Screen:
        """The verdict, refusals and what to do about them, and the constants."""
        told = [f"{one.subject}: {one.text}; try: {one.record}" for one in self.refusals[:MOST_REFUSALS]]
        left = len(self.refusals) - len(told)
        told += [f"{left} more: .refusals"] if left > 0 else []
        return Screen(
            "\n".join([self.sentence, *told, *self.remarks]),
            [Block(*self.table)],
            ".constants  .refusals  .save('axis.toml')  .report('report.html')",
        )

    @property
    def constants(self) -> dict[str, Estimate]:
        """Every constant with its interval, by its name, those that are not trusted too."""
        return {one.name: one for one in self.found.estimates}

    @property
    def trusted(self) -> dict[str, Estimate]:
        """Constants that are trusted, by their names."""
        return {one.name: one for one in self.found.trusted}

    @property
    def refusals(self) -> tuple[Refusal, ...]:
        """What is not trusted, why, and what to record instead."""
        return self.found.refusals

    @cached_property
    def remarks(self) -> tuple[str, ...]:
        """What to know about constants that would be read wrongly, such as a delay below 0."""
        return remarks_of(self.found)

    def contrasts(self) -> "list[Contrast]":
        """Constants that the axis file states outside of their intervals; none without an axis file.

        Raises
        ------
        DetentError
            The axis is of another kind of motion, or has no effort like that of the logs.
        """
        if (spec := self._spec()) is None:
            return []
        from detent.identify.write.file_numbers import contrasts

        return contrasts(self.found, spec)

    def save(self, path: str | Path, *, force: bool = False) -> Path:
        """Write an axis file: that of the axis with the identified constants, or a new one.

        Into a file that somebody wrote, or has edited, only the identified values are put, in the units it has; its
        comments, order and layout stay. A file that detent wrote is replaced.

        Parameters
        ----------
        path : path
            The file.
        force : bool
            Replace whatever is there by a whole file; the file of the axis itself gets values all the same.

        Raises
        ------
        AxisError
            Nothing is trusted, or not the mass.
        DetentError
            The file cannot be written, or its axis is of another kind; or another axis file than that of the axis
            stands there, which detent did not write.
        """
        from detent.identify.write.outputs import axis_toml, patched_axis

        path = Path(path)
        base = self._base(path, force=force)
        if base is None:
            made = axis_toml(self.found, None, str(path), self.reading)
        else:
            made, _ = patched_axis(self.found, base, self._name(path))
        own = base is not None and self._is_put_into(path, force=force)
        return write_text(path, made if own and not is_signed(str(base)) else signed(made), force=force or own)

    def changes(self, path: str | Path, *, force: bool = False) -> "list[Change]":
        """What `save` changes of an axis file: each key with its value before and after; nothing of a new file."""
        from detent.identify.write.outputs import patched_axis

        base = self._base(Path(path), force=force)
        return [] if base is None else patched_axis(self.found, base, self._name(Path(path)))[1]

    def _name(self, path: Path) -> str:
        return self.axis_name or str(path)

    def _is_put_into(self, path: Path, *, force: bool) -> bool:
        """True for a file that keeps what it has but for the identified values."""
        if self.axis_name:
            return path.exists() and Path(self.axis_name).exists() and path.samefile(self.axis_name)
        return not force and not is_ours(path)

    def _base(self, path: Path, *, force: bool) -> str | None:
        """Text of the axis file that gets the values: as it stands now where it is the one that is written."""
        return _text_of(path) if self._is_put_into(path, force=force) else self.axis or None

    def save_job(self, path: str | Path, *, force: bool = False) -> Path:
        """Write a list of moves that shows what the logs did not, within the limits of axis or logs.

        Parameters
        ----------
        path : path
            The file.
        force : bool
            Replace one that detent did not write, or that was edited since.

        Raises
        ------
        DetentError
            The limits are not known, or the file cannot be written.
        """
        from detent.identify.write.outputs import excitation_job

        return write_text(path, signed(excitation_job(self.found, self._spec())), force=force)

    def report(self, path: str | Path, *, force: bool = False) -> Path:
        """Write the report as one self-contained HTML file; `force` replaces one that detent did not write."""
        from detent.identify.page.page import identify_page
        from detent.page.render import write_page

        write_page(path, identify_page(self.found, self.remarks), force=force)
        return Path(path)

    def to_dict(self) -> dict[str, Any]:
        """Plain data, as ``--json`` prints it."""
        outside = [
            {"name": c.name, "stated": c.stated, "low": c.found.low, "high": c.found.high, "unit": c.found.unit}
            for c in self.contrasts()
        ]
        return self.found.to_dict() | {
            "axis": self.axis_name or None,
            "outside": outside,
            "remarks": list(self.remarks),
        }

    def _spec(self) -> "CascadeSpec | None":
        return _spec_of(self.axis, self.axis_name) if self.axis else None


def _text_of(axis: str | Path) -> str:
    """Text of an axis file, with its line ends and its byte order mark."""
    return read_source(Path(axis)).content.decode("utf-8")


def _checked_text(axis: str | Path) -> str:
    """The same; raises where anything is wrong with it, or where it is of another method."""
    from detent.methods.load import read_axis

    read_axis(axis)
    text = _text_of(axis)
    _spec_of(text, str(axis))
    return text


def _spec_of(text: str, name: str) -> "CascadeSpec":
    # What writes axis files, and their schema, is loaded where there is one: it takes as long as a fit.
    from detent.identify.write.outputs import cascade_spec

    return cascade_spec(text, name)


def identify_axis(  # noqa: PLR0913 - the options of `detent identify`
    logs: str | Path | Sequence[str | Path],
    *,
    mapping: str | Path | None = None,
    columns: Sequence[str] = (),
    effort: str | None = None,
    method: Method = "auto",
    axis: str | Path | None = None,
    progress: "Progress | None" = None,
    reading: str = "",
) -> Identified:
    """Identify an axis from recordings of it.

    Parameters
    ----------
    logs : path or sequence of path
        CSV, HDF5, Parquet, MATLAB, NPZ or JSON.
    mapping : path, optional
        Mapping file (TOML): what the columns are; what neither it nor `columns` says is guessed.
    columns : sequence of str
        The same in short: ``"force=vir [35.15 N]"``.
    effort : str, optional
        What drives the axis: force, torque, current, voltage or command; by default the first of these in the logs.
    method : str
        "regression"; "output error", which fits the simulation to the recordings too; "auto": regression, which tries
        the simulation fit where it alone does not predict the motion, and says which is better.
    axis : path, optional
        Cascade axis file that the constants are compared with, and put into by `Identified.save`.
    progress : callable, optional
        ``progress(share, text)``.
    reading : str
        Options of a command that reads the same, as `Identified.save` notes them in the file.

    Returns
    -------
    Identified
        Also when nothing is trusted: see `Identified.verdict` and `Identified.refusals`.

    Raises
    ------
    InputError
        A log, the mapping or the axis file cannot be read, or a log holds neither position nor velocity, or nothing
        that drives the axis.
    DetentError
        The axis file is of another method.
    """
    paths = [logs] if isinstance(logs, str | Path) else list(logs)
    tell = progress or untold
    text = "" if axis is None else _checked_text(axis)
    if not paths:
        raise DetentError("identify: got no log; expected: one or more; name the recordings of the axis")
    read: list[Log] = []
    for number, path in enumerate(paths):
        tell(0.1 * number / len(paths), f"reading {Path(path).name}")  # the first tenth of the work
        read += map(with_position, split_tests(read_log(path, mapping, columns)))

    def report(stage: str, share: float) -> None:
        begin, end, text = _STAGES.get(stage, (0.4, 0.8, stage))
        tell(begin + share * (end - begin), text)

    found = identify(read, effort, method=method, report=report)
    return Identified(found, text, "" if axis is None else str(axis), reading)
