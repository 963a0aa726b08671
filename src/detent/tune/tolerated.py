"""`detent tolerance`: a job on many machines of one axis file, how many are good, and why others are not."""

import time
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import cpu_count
from pathlib import Path
from typing import Any

from detent.analysis.sensitivity import Index, Sensitivity, sensitivity
from detent.errors import DetentError
from detent.files.screen import Block, OnScreen, Screen
from detent.files.text import check_target, write_errors
from detent.methods.load import AxisFile
from detent.methods.method import untold
from detent.record.machine import Progress
from detent.tune.batch import (
    DONE,
    MOST_WATCHED,
    STARTS,
    Chunk,
    Question,
    chunk_size,
    default_limits,
    quantities,
    run_chunk,
    run_chunks,
)
from detent.tune.judged import PASSED, Figure, Judged, Yield, parse_limit
from detent.tune.store import Store, joined, opened
from detent.tune.total import scheme_of, totals
from detent.tune.workers import machine
from detent.tune.worst import Worst, is_sought, worst, write_worst
from detent.units import format_quantity

TRIED = 20  # cases that tell how long all will take
LONGEST = 3600.0  # that is done unasked [s]
WORST = "worst"  # folder of axis files, in the store
MOST = 10_000_000  # cases
CAUSES = "What a key explains alone, and its rank correlation"


@dataclass(frozen=True, repr=False)
class Tolerated(OnScreen):
    """What `detent tolerance` has found.

    Attributes
    ----------
    question : Question
        What was asked: axis file, job, tolerances, seed.
    judged : Judged
        The cases with their values and results, and what of them passes.
    folder : Path or None
        The store.
    worst : sequence of Worst
        The worst machine found of each quantity; empty where none was sought.
    total : mapping
        Total index of every key by quantity, where it was asked for.
    """

    question: Question
    judged: Judged
    folder: Path | None = None
    worst: Sequence[Worst] = ()
    total: Mapping[str, Mapping[str, Index]] = field(default_factory=dict[str, Mapping[str, Index]])

    @property
    def done(self) -> bool:
        """True where all cases pass."""
        return bool(self.judged.good.all())

    @property
    def yields(self) -> Sequence[Yield]:
        """Of all limits together, then of each: how many cases keep them."""
        return self.judged.yields

    @property
    def figures(self) -> Mapping[str, Figure]:
        """How each quantity spreads."""
        return self.judged.figures

    @property
    def cases(self) -> Chunk:
        """Values, results and reasons of all cases, by their numbers."""
        return self.judged.cases

    @cached_property
    def sensitivities(self) -> dict[str, Sensitivity]:
        """What each toleranced key does to each quantity that varies, `passed` among them."""
        outcomes = self.judged.outcomes(self.cases)
        found = {name: sensitivity(self.cases.values, outcome) for name, outcome in outcomes.items()}
        return {name: one for name, one in found.items() if one is not None}

    @property
    def sentence(self) -> str:
        """What came of it."""
        name, whole = self.question.file.spec.axis.name, self.yields[0]
        if self.done:
            return f"{name}: all of {whole.of} cases pass; the yield is above {100 * whole.interval[0]:.4g} %."
        return f"{name}: {whole.good} of {whole.of} cases pass, {whole}."

    @property
    def quantity_rows(self) -> list[tuple[str, ...]]:
        """How each quantity spreads, as people read it."""
        rows, units = list[tuple[str, ...]](), self.judged.units
        for one in self.judged.told:
            figure = self.figures[one.name]
            shown = (figure.nominal, figure.mean, figure.low, figure.high, figure.most)
            if one.name != DONE:
                rows.append((one.name, *(format_quantity(value, units[one.name], 3) for value in shown)))
        return rows

    @property
    def cause_rows(self) -> list[tuple[str, ...]]:
        """What decides each limited quantity: the keys that explain most of it."""
        limited = [limit.quantity for limit in self.judged.limits if limit.quantity in self.sensitivities]
        limited += [PASSED] if PASSED in self.sensitivities else []
        rows = list[tuple[str, ...]]()
        for name in dict.fromkeys(limited):
            found = self.sensitivities[name]
            for key in found.order[:3]:
                share, rank = found.share[key], found.rank[key]
                row = name, key, f"{100 * share.value:.0f} %", f"{rank.value:+.2f}"
                total = (f"{100 * self.total[name][key].value:.0f} %" if name in self.total else "",)
                rows.append(row + total if self.total else row)
        return rows

    @property
    def worst_rows(self) -> list[tuple[str, ...]]:
        """The worst case of the sample, and what the search from there has found."""
        units = self.judged.units
        return [
            (one.quantity, *(format_quantity(value, units[one.quantity], 3) for value in (one.sampled, one.value)))
            for one in self.worst
        ]

    @property
    def blocks(self) -> list[Block]:
        """Tables for a terminal."""
        yields = [(one.name, f"{one.good} of {one.of}", str(one)) for one in self.yields]
        failures = [(one.kind, f"{one.number}", ", ".join(map(str, one.cases))) for one in self.judged.failures]
        causes = ("", "key", "share", "rank", *(["total"] if self.total else []))
        return [
            Block("", ("passes", "cases", "yield, 95 % interval"), yields),
            Block("", ("", "nominal", "mean", "5 %", "95 %", "largest"), self.quantity_rows, 14),
            *([Block(CAUSES, causes, self.cause_rows, 12)] if self.cause_rows else []),
            *([Block("The worst machine found", ("", "sample", "worst"), self.worst_rows, 12)] if self.worst else []),
            *([Block("Why cases fail", ("", "cases", "the first"), failures, 6)] if failures else []),
        ]

    def screen(self) -> Screen:
        """Yields, how the quantities spread, what decides, and why cases fail."""
        return Screen(self.sentence, self.blocks, ".cases  .sensitivities  .report(FILE)")

    def report(self, path: str | Path, *, force: bool = False) -> Path:
        """Write the report, one self-contained HTML file.

        Parameters
        ----------
        path : path
            HTML file.
        force : bool
            Replace a file that detent did not write.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        DetentError
            The file cannot be written.
        """
        from detent.page.render import write_page
        from detent.tune.tolerance_page import tolerance_page

        target = check_target(path, (".html",), "a report", force=force)
        write_page(target, tolerance_page(self), force=force)
        return target

    def save(self, path: str | Path, *, force: bool = False) -> Path:
        """Write a row for each case, in SI units: values, results, whether it passes, and which of `failures` it is.

        The suffix chooses HDF5, CSV or Parquet; `force` replaces a file that is not detent's.
        """
        from detent.record.trace_files import Table, save_table

        table = self.judged.table({one.key: one.unit for one in self.question.tolerance})
        told = {"axis": self.question.file.spec.axis.name, "job": self.question.job.name, "hash": self.question.hash}
        save_table(Table(*table, {**told, "seed": str(self.question.seed)}), path, force=force)
        return Path(path)

    def to_dict(self) -> dict[str, Any]:
        """Plain data, as ``--json`` prints it."""
        whole = self.yields[0]
        return {
            "sentence": self.sentence, "cases": whole.of, "seed": self.question.seed, "hash": self.question.hash,
            "yields": [
                {"name": one.name, "good": one.good, "yield": one.share, "low": one.interval[0],
                 "high": one.interval[1]} for one in self.yields
            ],
            "more": whole.more,
            "quantities": {
                name: {"unit": self.judged.units[name], **one._asdict()} for name, one in self.figures.items()
            },
            "failures": [one._asdict() for one in self.judged.failures],
            "sensitivities": {
                name: {
                    "share": {key: [index.value, index.low, index.high] for key, index in one.share.items()},
                    "rank": {key: [index.value, index.low, index.high] for key, index in one.rank.items()},
                    "together": [one.together.value, one.together.low, one.together.high], "cases": one.cases,
                }
                for name, one in self.sensitivities.items()
            },
            "worst": [{"quantity": one.quantity, "value": one.value, "sampled": one.sampled, "case": one.case,
                       "values": dict(one.values), "file": str(one.file)} for one in self.worst],
            "total": {
                name: {key: [index.value, index.low, index.high] for key, index in one.items()}
                for name, one in self.total.items()
            },
            "store": None if self.folder is None else str(self.folder),
        }  # fmt: skip


# ---- asking


@dataclass(frozen=True, slots=True, kw_only=True)
class Means:
    """By whom, and where to, cases are computed."""

    store: Path | None = None
    workers: int = 0  # 0: as many as there are processors
    dask: str = ""  # address of a scheduler; empty for none
    long: bool = False  # more than an hour is allowed
    worst: Path | None = None  # where axis files of the worst machines go; by default into the store
    job: str = ""  # file of the job, as the user named it
    force: bool = False  # replace files that detent did not write
    clock: Callable[[], float] = time.perf_counter


def tolerance(  # noqa: PLR0913 - what may be asked
    file: AxisFile, *, job: Any = None, cases: int = 1000, seed: int = 1, limits: Sequence[str] = (),
    margins: bool = False, hunt: bool = False, total: int = 0, means: Means | None = None,
    progress: Progress | None = None,
) -> Tolerated:  # fmt: skip
    """Make a job on many machines of an axis file; parameters as of `Axis.tolerance`."""
    means, progress = means or Means(), progress or untold
    if not 1 <= cases <= MOST:
        raise DetentError(f"cases: got {cases}; expected: a whole number from 1 to {MOST}; give one of these")
    if means.workers < 0:
        raise DetentError(f"workers: got {means.workers}; expected: 1 or more; leave it out for all processors")
    if hunt:
        _check_hunt(file, cases)
    job = _trial_job(file) if job is None else job
    question = Question.of(file, job, seed=seed, margins=margins, hunt=hunt)
    scheme = scheme_of(question, total) if total else None
    progress(0.0, "the machine of the file")
    known = quantities(question)
    stated = tuple(parse_limit(text, known) for text in limits)
    always = tuple(one for one in default_limits(question) if not stated or one.quantity == DONE)
    asked = tuple(dict.fromkeys([*always, *stated]))
    with _held(question, means.store) as held:
        found = held.all(cases, means, progress)
        question, judged = replace(question, limits=asked), Judged(found, known, asked)
        sought = _worst(question, judged, means, progress)
    indices = totals(*scheme, judged.outcomes, means.workers, means.dask) if scheme else {}
    return Tolerated(question, judged, means.store, sought, indices)


def _worst(question: Question, judged: Judged, means: Means, progress: Progress) -> list[Worst]:
    """The worst machines, each in an axis file, where there is a folder for them."""
    folder = means.worst or (means.store and means.store / WORST)
    if folder is None:
        return []
    found = worst(question, [judged.cases], [one.name for one in judged.told if is_sought(one)], progress)
    with write_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
    files = [folder / f"{one.quantity.replace(' ', '_')}.toml" for one in found]
    return [
        replace(one, file=write_worst(question, one, file, means.job, force=means.force))
        for one, file in zip(found, files, strict=True)
    ]


def _check_hunt(file: AxisFile, cases: int) -> None:
    """Refuse to watch more machines at standstill than one waits for, or where nothing watches them."""
    from detent.methods.registry import METHODS

    if not METHODS[file.spec.axis.method].stands:
        raise DetentError(
            f"--hunt: got an axis of the method {file.spec.axis.method}; expected: one whose loop is watched at "
            "standstill; leave it out"
        )
    if cases > MOST_WATCHED:
        raise DetentError(
            f"--hunt: got {cases} cases; expected: at most {MOST_WATCHED}, as each is watched at standstill from "
            f"{STARTS} starts; ask for fewer"
        )


def _trial_job(file: AxisFile) -> Any:
    from detent.methods.registry import METHODS

    return METHODS[file.spec.axis.method].trial_job(file.spec)


@contextmanager
def _held(question: Question, folder: Path | None) -> Generator["_Held"]:
    """The cases that are there already; what is judged by which limits changes none of them."""
    size = chunk_size(question)
    with ExitStack() as stack:
        about = {"hash": question.hash, **question.to_dict(), "made on": machine()}
        store = None if folder is None else stack.enter_context(opened(folder, about, size))
        yield _Held(question, store, store.size if store else size)


class _Held:
    """Cases of a question, in memory and in its store."""

    def __init__(self, question: Question, store: Store | None, size: int) -> None:
        self.question, self.store, self.size = question, store, size
        self.chunks = dict[int, Chunk]()

    def all(self, cases: int, means: Means, progress: Progress) -> Chunk:
        """So many cases, computed where they are not there."""
        missing = list(self._missing(cases))
        if missing and not means.dask:
            _check_time(self.question, sum(count for _, count in missing), means)
        began, total, ready = means.clock(), cases, cases - sum(count for _, count in missing)
        before = ready
        for chunk in run_chunks(self.question, missing, means.workers, means.dask):
            self._keep(chunk)
            ready += chunk.count
            left = (means.clock() - began) * (total - ready) / (ready - before)
            progress(ready / total, f"{ready} of {total} cases, {left:.0f} s left")
        return joined([self.chunks[first] for first in range(0, cases, self.size)], cases)

    def _missing(self, cases: int) -> Iterator[tuple[int, int]]:
        """First case and number of what is to be computed; what stands in the store is taken from there."""
        for first in range(0, cases, self.size):
            wanted = min(self.size, cases - first)
            kept = self.store.kept(first) if self.store else None
            if kept is not None:
                self.chunks[first] = kept
            there = kept.count if kept else 0
            if there < wanted:
                yield first + there, wanted - there

    def _keep(self, chunk: Chunk) -> None:
        """Take a chunk, behind what was there of it."""
        place = chunk.first - chunk.first % self.size
        whole = joined([self.chunks[place], chunk], self.size) if chunk.first > place else chunk
        self.chunks[place] = whole
        if self.store:
            self.store.keep(place, whole)


def _check_time(question: Question, cases: int, means: Means) -> None:
    """Refuse what would take more than an hour, unless that is allowed."""
    if means.long or cases <= TRIED:
        return
    run_chunk(question, 1, 1)  # compiles
    began = means.clock()
    run_chunk(question, 1, TRIED)
    seconds = (means.clock() - began) * cases / TRIED / (means.workers or cpu_count() or 1)
    if seconds > LONGEST:
        raise DetentError(
            f"cases: got {cases}, which take about {seconds / 3600.0:.2g} h here; expected: less than an hour; ask for "
            "fewer, or allow it with --yes (in Python: yes=True)"
        )
