"""What a method brings to make one job on many machines at once, which differ in some keys of their file."""

import re
from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]

Machine = Callable[[int], Any]
"""The axis file of a case, by its place; an `InputError` where it would be refused."""


class Batch(Protocol):
    """A job on many machines of one axis file."""

    def run(
        self, variants: Mapping[str, Numbers], machine: Machine, count: int
    ) -> tuple[dict[str, Numbers], dict[int, str]]:
        """Make the job on each.

        `variants` gives each key that differs for all cases. Results by name, shape (count,), NaN where there is none,
        and of the cases that failed why, by their places.
        """
        ...


_MOVE = re.compile(r"^(?:move|step|after power-on)[^:]*: ")
_VALUE = re.compile(r"[-+]?\d[\d.]*(?:e[-+]?\d+)?(?: ?[%°µ\w/*^]+)?")


def kind_of(failure: str) -> str:
    """What kind of failure it is: the first clause, without whose it was and without values.

    >>> kind_of("move 3 to 0.5 m: not in position within 2 s of the end of the reference (method.timeout): its error")
    'not in position within ... of the end of the reference'
    """
    clause = re.split(r"[;,(]", _MOVE.sub("", failure))[0].strip()
    return _VALUE.sub("...", clause)


def refusal_of(problems: Any) -> str:
    """What kind of refusal the problems of a file are: the keys that they are about."""
    keys = list(dict.fromkeys(problem.key for problem in problems if problem.key))
    return f"the axis file would be refused: {', '.join(keys)}"
