"""Many machines of one axis file, each doing the job: chunks of cases, each a function of the question alone.

A method that brings a batch (`methods.batch`) makes a chunk in one piece; of any other each machine is run for itself.
Nothing here is a closure: chunks may be made in threads, in processes of this machine, and on others.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.errors import DetentError, InputError
from detent.methods.batch import kind_of, refusal_of
from detent.tune.cases import Limit, Numbers, Question, draw

__all__ = ["Chunk", "Limit", "Quantity", "Question", "default_limits", "draw", "quantities", "run_chunk"]

DONE = "done"  # the quantity that every case has: 1 or 0


@dataclass(frozen=True, slots=True)
class Quantity:
    """What a limit may speak of."""

    name: str
    unit: str  # SI; empty for a pure number
    nominal: float  # of case 0


@dataclass(frozen=True, eq=False)
class Chunk:
    """Some cases in a row.

    Attributes
    ----------
    first : int
        Number of the first.
    values : dict of str to ndarray of float64, shape (n,)
        By key that is toleranced, SI units.
    results : dict of str to ndarray of float64, shape (n,)
        By quantity; of a case that failed `done` is 0 and all else NaN.
    reason : ndarray of str, shape (n,)
        Why a case failed: a kind, without values; empty where it did not.
    """

    first: int
    values: dict[str, Numbers]
    results: dict[str, Numbers]
    reason: NDArray[np.str_]

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
    """What is measured of each case, in order; a first run of the axis of the file tells.

    Parameters
    ----------
    question : Question
        What is asked.

    Returns
    -------
    tuple of Quantity
        `done` first.
    """
    result, spec = _nominal(question), question.file.spec
    units = dict(result.measured) | dict(result.measured_moves)
    told: Any = getattr(spec, "unit", str)
    figures = {name: value for name, value in result.figures().items() if not (result.done and math.isnan(value))}
    return tuple(Quantity(name, told(units.get(name.split(" ")[-1], "")), value) for name, value in figures.items())


def default_limits(question: Question) -> tuple[Limit, ...]:
    """What passes unless told otherwise: the job is done, within what the file says."""
    from detent.axisfile.tolerance import value_of

    kept = {name: value_of(question.file.spec, key) for name, key in _nominal(question).kept_by.items()}
    return (Limit(DONE, 1.0, least=True), *(Limit(name, value) for name, value in kept.items()))


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
    """Make the job on some machines.

    Parameters
    ----------
    question : Question
        What is asked.
    first, count : int
        The first case, and how many.

    Returns
    -------
    Chunk
        A function of the arguments alone: the same bits wherever and in whatever pieces it is made.
    """
    values = draw(question, first, count)
    names = [one.name for one in quantities(question)]
    results = {name: np.full(count, np.nan) for name in names}
    results[DONE][:] = 0.0
    reasons = [""] * count
    for k in range(count):
        case = {key: float(each[k]) for key, each in values.items()} if first + k else {}
        found, reasons[k] = run_case(question, case)
        for name in names:
            results[name][k] = found.get(name, np.nan)
    return Chunk(first, values, results, np.array(reasons, np.str_))
