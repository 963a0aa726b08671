"""The evidence of a run: all that it was made from and hashes of all that it gave, so that anybody can repeat it.

It is made once for a run. The report carries it as JSON, the HDF5 trace as a text beside its columns, ``--json`` as it
is. Figures and columns are hashed one by one, so that a repetition can say what differs; the date is in no hash.
"""

import base64
import hashlib
import json
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from detent.errors import InputError
from detent.files.text import read_head, refuse_longer, shown

FORMAT = 1
ELEMENT = "run-evidence"  # id of the JSON in a report
LARGEST = 20_000_000  # bytes of a job that are carried along; a longer one is told by its hash
LONGEST_REPORT = 200_000_000  # bytes that are read of one; it has a few million, and the job
_IN_REPORT = re.compile(rf'<script type="application/json" id="{ELEMENT}">(.*?)</script>', re.DOTALL)


def now() -> datetime:
    """The date of a run: of ``SOURCE_DATE_EPOCH`` where the environment states one, else that of the clock."""
    stated = os.environ.get("SOURCE_DATE_EPOCH", "")
    return datetime.fromtimestamp(int(stated), UTC) if stated.isdecimal() else datetime.now(UTC)


def digest(content: bytes) -> str:
    """Hash of some bytes."""
    return hashlib.sha256(content).hexdigest()


@dataclass(frozen=True, slots=True)
class Kept:
    """A file as it was read: its bytes as text where a page can show them as they are, else in base 64."""

    name: str  # of the file, as the user named it
    sha256: str
    text: str = ""
    base64: str = ""

    @classmethod
    def of(cls, name: str, content: bytes) -> "Kept":
        """A file that was read."""
        try:
            text = content.decode("utf-8")
        except UnicodeDecodeError:
            text = "\0"
        if shown(text) == text and "\r" not in text:
            return cls(shown(name), digest(content), text=text)
        return cls(shown(name), digest(content), base64=base64.b64encode(content).decode())

    @classmethod
    def of_file(cls, path: Path) -> "Kept":
        """A file; a recording may be longer than the memory."""
        with path.open("rb") as stream:
            content = stream.read(LARGEST + 1)
            if len(content) <= LARGEST:
                return cls.of(str(path), content)
            stream.seek(0)
            return cls(shown(str(path)), hashlib.file_digest(stream, "sha256").hexdigest())

    @property
    def content(self) -> bytes:
        """The bytes; `InputError` where they are not those that were read."""
        content = base64.b64decode(self.base64) if self.base64 else self.text.encode()
        if digest(content) != self.sha256:
            raise InputError.of_file(
                self.name, "a text that does not match its hash", "the evidence unchanged",
                "take the report or the trace as detent wrote it; a job above 20 MB is not carried along",
            )  # fmt: skip
        return content


@dataclass(frozen=True, slots=True)
class RunEvidence:
    """What a run was made from, and hashes of what it gave."""

    version: str  # of detent
    date: str
    axis: Kept
    overrides: Sequence[str]
    changes: Mapping[str, Any]  # values of a program over those of the file, by table and key
    effective: Mapping[str, str]  # every effective value, by its key
    job: Kept | None  # None for a job that came from no file, or a recording
    seed: int
    signals: Sequence[str]  # that were recorded
    every: int  # base ticks between two rows; 0: nothing was recorded
    figures: Mapping[str, str] = field(default_factory=dict[str, str])  # hash of each figure of the JSON
    trace: Mapping[str, str] = field(default_factory=dict[str, str])  # hash of each column of the trace
    format: int = FORMAT

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)


def hash_figures(figures: Mapping[str, Any]) -> dict[str, str]:
    """Hash of each figure of a run."""
    return {name: digest(json.dumps(value, sort_keys=True).encode()) for name, value in figures.items()}


def first_difference(before: RunEvidence, after: RunEvidence) -> str:
    """What of a run came out otherwise than in the one before; empty if nothing did."""
    for kind, old, new in (
        ("the effective values", before.effective, after.effective),
        ("the figures", before.figures, after.figures),
        ("the columns of the trace", before.trace, after.trace),
    ):
        for name in dict.fromkeys([*old, *new]):
            if old.get(name) != new.get(name):
                return f"{name}, of {kind}"
    return ""


def _check_types(made: RunEvidence) -> None:
    """Whoever wrote a file: TypeError where it holds something else than a run leaves."""
    kept = [one for one in (made.axis, made.job) if one]
    texts = [getattr(one, name) for one in kept for name in Kept.__slots__]
    texts += [made.version, made.date, *made.overrides, *made.signals, *made.effective.values()]
    texts += [*made.figures.values(), *made.trace.values()]
    every: Any = made.every
    plain = isinstance(made.changes, dict) and all(isinstance(text, str) for text in texts)
    if not plain or not isinstance(every, int) or every < 0:
        raise TypeError("not the output of a run")


def read_evidence(path: Path) -> RunEvidence:
    """Evidence in a report or an HDF5 trace."""
    allowed, remedy = "a report (.html) or a trace (.h5) that detent wrote", "name the output of a run"
    if not path.is_file():
        raise InputError.of_file(str(path), "no such file", allowed, remedy)
    if path.suffix.lower() in {".h5", ".hdf5"}:
        from detent.record.trace_files import read_note

        text = read_note(path, ELEMENT)
    else:
        content = read_head(path, LONGEST_REPORT, allowed, remedy)
        refuse_longer(path, content, LONGEST_REPORT, remedy)
        found = _IN_REPORT.search(content.decode("utf-8", "replace"))
        text = found[1] if found else ""
    if not text:
        raise InputError.of_file(str(path), "a file without the evidence of a run", allowed, remedy)
    try:
        data = json.loads(text)
        job = data.pop("job")
        made = RunEvidence(axis=Kept(**data.pop("axis")), job=job and Kept(**job), **data)
        _check_types(made)
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise InputError.of_file(str(path), "evidence that cannot be read", allowed, remedy) from error
    return made
