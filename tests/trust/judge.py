"""What the identification makes of cases whose truth is known, from the file on."""

import csv
import io
import multiprocessing
import os
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from detent.errors import InputError
from detent.identify.fit.estimate import Estimate
from detent.identify.fit.identification import Identification, identify
from detent.logs.read_log import read_log
from tests.trust.plants import BAD, Case, make_case

FIRST_BAD = 1_000_000
"""Number of the first bad case."""

REFERENCE = "position ref [m]"
"""Column that is left out where least squares are to be judged."""


@dataclass(frozen=True)
class Judged:
    """What came of one case.

    Attributes
    ----------
    number : int
    bad : str
        Why it must be refused; empty for a good one.
    verdict : str
    subjects : tuple of str
        What was refused.
    inside : dict
        From a trusted constant to whether its interval holds the truth.
    width : dict
        Half of its interval over its value; for the delay, over the period of the samples.
    model : str
        The rung.
    """

    number: int
    bad: str
    verdict: str
    subjects: tuple[str, ...]
    inside: dict[str, bool]
    width: dict[str, float]
    model: str


def write_csv(case: Case, path: Path) -> None:
    """Write the log of a case."""
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(case.columns)
    writer.writerows(zip(*(np.round(v, 12).tolist() for v in case.columns.values()), strict=True))
    path.write_text(text.getvalue(), encoding="utf-8")


def judge(case: Case) -> Judged:
    """Identify the log of a case."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"case{case.number}.csv"
        write_csv(case, path)
        try:
            found = identify([read_log(path)])
        except InputError as error:
            return Judged(case.number, case.bad, "unreadable", (str(error)[:120],), {}, {}, "")
    return _compare(case, found)


def _compare(case: Case, found: Identification) -> Judged:
    trusted = {e.name: e for e in found.trusted if e.name in case.truth}
    return Judged(
        case.number,
        case.bad,
        found.verdict,
        tuple(f"{r.subject} ({', '.join(r.constants)})" if r.constants else r.subject for r in found.refusals),
        {name: bool(e.holds(case.truth[name])) for name, e in trusted.items()},
        {name: _width(e, found.runs[0].step) for name, e in trusted.items()},
        found.rung.name if found.rung else "",
    )


def _width(e: Estimate, step: float) -> float:
    """Half of an interval, as `Judged` has it."""
    scale = step if e.name == "delay" else abs(e.value)
    return 0.5 * (e.high - e.low) / scale if scale else np.inf


def judge_number(number: int, *, with_reference: bool = True) -> Judged:
    """Judge the case of a number; from `FIRST_BAD` on they are bad, one kind after the other."""
    case = make_case(number, BAD[(number - FIRST_BAD) % len(BAD)] if number >= FIRST_BAD else "")
    if not with_reference:
        case = replace(case, columns={name: v for name, v in case.columns.items() if name != REFERENCE})
    try:
        return judge(case)
    except Exception as error:
        error.add_note(f'Case {number}: python -c "from tests.trust.judge import *; print(judge_number({number}))"')
        raise


def numbers_of(good: int, bad: int, first: int = 0) -> list[int]:
    """So many good and bad cases, from a number on."""
    return [*range(first, first + good), *range(FIRST_BAD + first, FIRST_BAD + first + bad)]


def judge_all(numbers: Iterable[int], *, with_reference: bool = True, workers: int | None = None) -> list[Judged]:
    """Judge cases in processes, one thread of linear algebra in each, as many as there are processors by default.

    A single worker is this process itself.
    """
    if workers == 1:
        return [judge_number(number, with_reference=with_reference) for number in numbers]
    os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"
    # A process that starts anew reads these before it loads numpy.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers or os.cpu_count(), mp_context=context) as pool:
        return list(pool.map(partial(judge_number, with_reference=with_reference), numbers, chunksize=2))
