"""What a method brings to make one job on many machines at once, which differ in some keys of their file."""

import re
from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from detent.analysis.margins import Margins

Numbers = NDArray[np.float64]

Machine = Callable[[int], Any]
"""The axis file of a case, by its place; an `InputError` where it would be refused."""


class Batch(Protocol):
    """A job on many machines of one axis file."""

    def run(
        self, variants: Mapping[str, Any], machine: Machine, count: int
    ) -> tuple[dict[str, Numbers], dict[int, str]]:
        """Make the job on each.

        `variants` gives the values that make the machines, by key: arrays of shape (count,), or one value for all.
        Results by name as `RunRecord.figures` has them, shape (count,), NaN where there is none, and of the cases that
        failed why, by their places.
        """
        ...

    def margins(self, variants: Mapping[str, Any], count: int) -> Mapping[str, Margins] | None:
        """Margins of the loops of each, by the place of the cut: arrays of shape (count,).

        `variants` are of machines that none refuses; None where each is to be looked at for itself.
        """
        ...


_MOVE = re.compile(r"^(?:move|step|after power-on)[^:]*: ")
_VALUE = re.compile(r"[-+]?\d[\d.]*(?:e[-+]?\d+)?(?: ?[%°µ\w/*^]+)?")
_VALUES = re.compile(r"\.\.\.(?: \.\.\.)+")


def kind_of(failure: str) -> str:
    """What kind of failure it is: the first clause, without whose it was and without values.

    >>> kind_of("move 3 to 0.5 m: not in position within 2 s of the end of the reference (method.timeout): its error")
    'not in position within ... of the end of the reference'
    """
    clause = re.split(r"[;,(]", _MOVE.sub("", failure))[0].strip()
    return _VALUES.sub("...", _VALUE.sub("...", clause))


def refusal_of(problems: Any) -> str:
    """What kind of refusal the problems of a file are: the first key that they are about."""
    keys = [problem.key for problem in problems if problem.key]
    return f"refused: {keys[0] if keys else 'the whole file'}"
