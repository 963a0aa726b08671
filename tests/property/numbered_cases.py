"""Random cases by number: the same number is always the same case, so that a failing one can be run again alone.

Hypothesis finds and shrinks edge cases, but draws slowly. Here a case is drawn in well under a millisecond from a
generator that its number alone seeds, so that a test can run through thousands of them. The environment chooses how
many the long tests run, and from which number on: ``DETENT_CASES`` (20 000) and ``DETENT_FIRST_CASE`` (0).
"""

import os
from collections import Counter
from collections.abc import Callable, Iterable

import numpy as np

LONG_RUN = 20_000


def asked_numbers() -> range:
    """The cases that the environment asks the long tests to run."""
    first = int(os.environ.get("DETENT_FIRST_CASE", "0"))
    return range(first, first + int(os.environ.get("DETENT_CASES", LONG_RUN)))


def generator(number: int) -> np.random.Generator:
    """The source of everything random in a case."""
    return np.random.default_rng(number)


def run_numbers(run: Callable[[int], Counter[str]], numbers: Iterable[int]) -> Counter[str]:
    """Run cases; returns what they met, counted. An error says which case it is and how to run it alone."""
    met: Counter[str] = Counter()
    for number in numbers:
        try:
            met.update(run(number))
        except Exception as error:
            error.add_note(f'Case {number}: python -c "from {run.__module__} import *; {run.__name__}({number})"')
            raise
        met["cases"] += 1
    return met


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A number of which every octave between both ends is as likely."""
    return float(low * (high / low) ** rng.random())


def chance(rng: np.random.Generator, share: float) -> bool:
    """True in so many of all cases."""
    return bool(rng.random() < share)


def whole(rng: np.random.Generator, low: int, high: int) -> int:
    """A whole number, both ends included."""
    return low + int(rng.random() * (high - low + 1))
