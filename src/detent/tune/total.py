"""What each key does to a quantity alone and together with others: total indices, by a scheme of runs of its own."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np

from detent.analysis.sensitivity import Index, interval_of
from detent.errors import DetentError
from detent.tune.batch import MOST_WATCHED, Chunk, chunks_of, run_chunks
from detent.tune.cases import Numbers, Question

LEAST, MOST = 64, 2**20  # points of a sample
RESAMPLES = 100
SEED = 2


def scheme_of(question: Question, points: int) -> tuple[Question, int]:
    """The question about the machines of the scheme, and how many these are; refused where no share is a key's own."""
    if not (LEAST <= points <= MOST and points & (points - 1) == 0):
        raise DetentError(f"--total: got {points}; expected: a power of 2 from {LEAST} to {MOST}; take 1024")
    joint = [one.key for one in question.tolerance if one.correlation]
    if joint:
        raise DetentError(
            f"--total: got {joint[0]}, which varies together with another key; expected: keys that are independent of "
            "one another; leave out `correlation`, or --total"
        )
    cases = points * (len(question.tolerance) + 2)
    if question.hunt and cases > MOST_WATCHED:
        raise DetentError(
            f"--total: got {points} with --hunt, which makes {cases} machines to be watched at standstill; expected: "
            f"at most {MOST_WATCHED}; ask for fewer points, or leave out --hunt"
        )
    return replace(question, scheme=points), cases


def totals(
    asked: Question, cases: int, outcomes_of: Callable[[Chunk], Mapping[str, Numbers]], workers: int = 0, dask: str = ""
) -> dict[str, dict[str, Index]]:
    """Total index of every key for each quantity that all machines of a scheme have."""
    found = dict[str, list[Numbers]]()
    for chunk in sorted(run_chunks(asked, chunks_of(asked, cases), workers, dask), key=lambda one: one.first):
        for name, outcome in outcomes_of(chunk).items():
            found.setdefault(name, []).append(outcome)
    whole = {name: np.concatenate(parts) for name, parts in found.items()}
    keys = [one.key for one in asked.tolerance]
    return {
        name: total_indices(keys, outcome.reshape(-1, asked.scheme))
        for name, outcome in whole.items()
        if np.isfinite(outcome).all() and outcome.min() < outcome.max()
    }


def total_indices(keys: list[str], outcome: Numbers) -> dict[str, Index]:
    """Total index of each key, with the interval of 100 resamples.

    The outcome is that of the scheme of `cases.exchanged`, shape (keys + 2, points).
    """
    stats: Any = import_module("scipy.stats")
    points = outcome.shape[1]
    scaled = (outcome - outcome[:2].mean()) / outcome.std()
    taken = np.random.Generator(np.random.Philox(key=SEED)).integers(0, points, (RESAMPLES, points))
    rows = list[Any]()
    for which in [None, *range(RESAMPLES)]:
        of = slice(None) if which is None else taken[which]
        first, second, *mixed = scaled[:, None, of]
        told = stats.sobol_indices(func={"f_A": first, "f_B": second, "f_AB": np.array(mixed)}, n=points)
        rows.append(np.ravel(told.total_order))
    found = np.array(rows)
    return {key: interval_of(found[:, k], 0.0, np.inf) for k, key in enumerate(keys)}
