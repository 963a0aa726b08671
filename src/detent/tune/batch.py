"""Many machines of one axis file, each doing the job: chunks of cases, each a function of the question alone.

A method that brings a batch (`methods.batch`) makes a chunk in one piece; of any other each machine is run for itself.
Nothing here is a closure: chunks may be made in threads, in processes of this machine, and on others.
"""

import math
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.analysis.margins import Margins
from detent.errors import DetentError, InputError
from detent.methods.batch import kind_of, refusal_of
from detent.tune import workers as crew
from detent.tune.cases import Limit, Numbers, Question, draw

__all__ = [
    "Chunk", "Limit", "Quantity", "Question", "chunk_size", "chunks_of", "default_limits", "draw", "quantities",
    "run_chunk", "run_chunks",
]  # fmt: skip

CHUNK, CHUNK_ALONE = 1000, 50  # cases of a chunk: of a method that makes many at once, of one that makes each alone
CHUNK_WATCHED = 5  # and where each is watched at standstill, too
STARTS = 8  # of each at standstill
MOST_WATCHED = 1000  # machines there
DONE = "done"  # the quantity that every case has: 1 or 0
HUNTS = "hunts at rest"  # share of the starts of a machine that hunt
SWING = "swing at rest"


@dataclass(frozen=True, slots=True)
class Quantity:
    """What a limit may speak of."""

    name: str
    unit: str  # SI; empty for a pure number
    nominal: float  # of case 0


_OF_A_MOVE = re.compile(r"move \d+ ")


def is_of_a_move(one: Quantity) -> bool:
    """True of what one move of several does."""
    return _OF_A_MOVE.match(one.name) is not None


@dataclass(frozen=True, eq=False)
class Chunk:
    """Some cases in a row; arrays of shape (n,)."""

    first: int  # number of the first
    values: dict[str, Numbers]  # by key that is toleranced, SI units
    results: dict[str, Numbers]  # by quantity; of a case that failed `done` is 0 and all else NaN
    reason: NDArray[np.str_]  # why a case failed: a kind, without values; empty where it did not

    @property
    def count(self) -> int:
        """How many cases."""
        return len(self.reason)


@lru_cache(maxsize=8)
def _nominal(question: Question) -> Any:
    """What the axis of the file does."""
    return question.method.run(question.file.spec, question.job)


@lru_cache(maxsize=8)
def quantities(question: Question) -> tuple[Quantity, ...]:
    """What is measured of each case, `done` first; a first run of the axis of the file tells."""
    result, spec = _nominal(question), question.file.spec
    units = dict(result.measured) | dict(result.measured_moves)
    told: Any = getattr(spec, "unit", str)
    figures = {name: value for name, value in result.figures().items() if not (result.done and math.isnan(value))}
    found = [Quantity(name, told(units.get(name.split(" ")[-1], "")), value) for name, value in figures.items()]
    return (*found, *(Quantity(name, unit, value) for name, (value, unit) in _looked_at(question, spec).items()))


def _looked_at(question: Question, spec: Any) -> dict[str, tuple[float, str]]:
    """What an axis is beside its job, where that is asked: margins of its loops where each is cut, and hunting."""
    found = dict[str, tuple[float, str]]()
    if question.margins:
        found |= _told(question.method.linear(spec).margins)
    return found | _stood(question, spec)


def _told(margins: Mapping[str, Margins]) -> dict[str, tuple[Any, str]]:
    """Margins as quantities, with their units."""
    found = dict[str, tuple[Any, str]]()
    for cut, one in margins.items():
        found[f"Ms at {cut}"] = one.sensitivity, ""
        found[f"phase margin at {cut}"] = one.phase, "rad"
        found[f"gain margin at {cut}"] = one.gain, ""
    return found


def _stood(question: Question, spec: Any) -> dict[str, tuple[float, str]]:
    """What an axis does at standstill, where that is asked."""
    if not question.hunt:
        return {}
    from detent.tune.standstill import HUNTS as HUNTING
    from detent.tune.standstill import standstill

    stood = standstill(spec, STARTS, question.seed)
    return {HUNTS: (stood.shares[HUNTING], ""), SWING: (stood.swing, stood.ensemble.unit)}


def default_limits(question: Question) -> tuple[Limit, ...]:
    """What passes unless told otherwise: the job is done, within what the file says."""
    from detent.axisfile.tolerance import value_of

    kept = {name: value_of(question.file.spec, key) for name, key in _nominal(question).kept_by.items()}
    rests = (Limit(HUNTS, 0.0),) if question.hunt else ()
    return (Limit(DONE, 1.0, least=True), *(Limit(name, value) for name, value in kept.items()), *rests)


def run_case(question: Question, values: Mapping[str, float]) -> tuple[dict[str, float], str]:
    """What one machine does: its figures, none where its file would be refused, and why it failed."""
    try:
        spec = question.machine(values).spec
        result = question.method.run(spec, question.job)
    except InputError as error:
        return {DONE: 0.0}, refusal_of(error.problems)
    except DetentError as error:
        return {DONE: 0.0}, kind_of(str(error))
    return result.figures(), kind_of(result.failure) if result.failure else ""


def run_chunk(question: Question, first: int, count: int) -> Chunk:
    """Make the job on the machines from `first` on.

    A function of the arguments alone: the same bits wherever, and in whatever pieces, it is made.
    """
    values = draw(question, first, count)
    names = [one.name for one in quantities(question)]
    found, reasons = make_cases(question, values, count)
    if question.margins or question.hunt:
        found |= _looked_at_all(question, values, reasons, count)
    empty = np.full(count, np.nan)
    return Chunk(
        first, values, {name: found.get(name, empty) for name in names},
        np.array([reasons.get(k, "") for k in range(count)], np.str_),
    )  # fmt: skip


def _looked_at_all(
    question: Question, values: Mapping[str, Numbers], reasons: Mapping[int, str], count: int
) -> dict[str, Numbers]:
    """What each machine that did the job is beside it."""
    found, good = dict[str, Numbers](), np.array([k for k in range(count) if k not in reasons], np.int64)
    together = _margins_of(question, {key: each[good] for key, each in values.items()}, len(good))
    for name, (each, _) in together.items():
        found.setdefault(name, np.full(count, np.nan))[good] = each
    if question.hunt or (question.margins and not together):
        look = _stood if together else _looked_at
        for k in good.tolist():
            spec = question.machine({key: float(each[k]) for key, each in values.items()}).spec
            for name, (value, _) in look(question, spec).items():
                found.setdefault(name, np.full(count, np.nan))[k] = value
    return found


def _margins_of(question: Question, values: Mapping[str, Numbers], count: int) -> dict[str, tuple[Any, str]]:
    """Margins of machines that nothing refuses, where those of many are found at once."""
    batch = question.method.batch(question.file.spec, question.job) if question.margins and count else None
    found = batch.margins(question.variant(values), count) if batch is not None else None
    return _told(found) if found is not None else {}


def make_cases(
    question: Question, values: Mapping[str, Numbers], count: int
) -> tuple[dict[str, Numbers], dict[int, str]]:
    """What machines with these values do: figures by name, and of those that failed why, by their places."""

    def case(k: int) -> dict[str, float]:
        return {key: float(each[k]) for key, each in values.items()}

    batch = question.method.batch(question.file.spec, question.job)
    if batch is not None:
        return batch.run(question.variant(values), lambda k: question.machine(case(k)), count)
    results, reasons = dict[str, Numbers](), dict[int, str]()
    for k in range(count):
        found, reason = run_case(question, case(k))
        if reason:
            reasons[k] = reason
        for name, value in found.items():
            results.setdefault(name, np.full(count, np.nan))[k] = value
    return results, reasons


# ---- many chunks


def chunk_size(question: Question) -> int:
    """Cases of a chunk: a second's work or so."""
    return CHUNK_WATCHED if question.hunt else CHUNK if question.method.batches else CHUNK_ALONE


def chunks_of(question: Question, count: int, size: int = 0) -> list[crew.Span]:
    """First case and number of cases of each chunk of so many cases."""
    size = size or chunk_size(question)
    return [(first, min(size, count - first)) for first in range(0, count, size)]


def run_chunks(question: Question, chunks: Iterable[crew.Span], workers: int = 0, dask: str = "") -> Iterator[Chunk]:
    """Make some chunks, given by first case and number of cases, side by side, and give them as they are done.

    Workers are threads of this process where a chunk is one compiled loop, else processes; 0: one for each processor.
    With an address of a Dask scheduler its workers make them.
    """
    spans = list(chunks)
    if not spans:
        return
    quantities(question)  # every thread finds it done, and what is compiled
    number = min(workers or os.cpu_count() or 1, len(spans))
    hands = crew.threads if question.method.batches or number == 1 else crew.processes
    with closing(crew.computed(crew.dask(dask) if dask else hands(number), run_chunk, question, spans)) as found:
        for _, chunk in found:
            yield chunk
