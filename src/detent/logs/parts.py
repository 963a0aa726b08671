"""Several tests in one file, told apart by a column: a quasi-static and a dynamic one, forward and backward.

Such a column holds the same word or number throughout each test, and where it changes the recording breaks: the clock
starts again, or rows are missing while the axis is brought back. Both are needed. A column that changes while rows
follow one another says what a machine does, not that another recording begins.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from detent.files.text import short
from detent.logs.log import Draft, Finding, Log, Values
from detent.logs.raw_table import RawTable

MOST_TESTS = 40  # tests in a file, at most
FEWEST_ROWS = 20  # rows of a test, at least
GAP = 2.5  # usual steps between two rows from which on the recording breaks there
APART = 10.0  # usual steps put between tests whose clock starts again

Change = tuple[int, str]  # row of the file from which on a column says another word, and that word


def changes_of(cells: Sequence[str], rows: Sequence[int], before: str | None) -> list[Change]:
    """Rows at which a column of words changes; `before` is the word before the first."""
    found: list[Change] = []
    for row, cell in zip(rows, cells, strict=True):
        if cell != before:
            found.append((row, cell))
            before = cell
    return found


def find_tests(table: RawTable, time: str, used: Sequence[str]) -> list[Change]:
    """Rows at which tests begin, with what the column that tells them apart says; nothing where none does so."""
    t = table.columns[time]
    steps = np.diff(t)
    usual = float(np.median(steps[steps > 0])) if np.any(steps > 0) else 0.0
    if not usual:
        return []
    breaks = np.flatnonzero((steps <= 0) | (steps >= GAP * usual)) + 1
    for name, changes in _candidates(table, used).items():
        firsts = np.searchsorted(table.rows, [row for row, _ in changes])
        lengths = np.diff(np.r_[firsts, len(t)])
        if 1 < len(changes) <= MOST_TESTS and lengths.min() >= FEWEST_ROWS and np.isin(firsts[1:], breaks).all():
            table.notes.append(f'tests told apart by "{short(name)}": {", ".join(word for _, word in changes)}')
            return changes
    return []


def _candidates(table: RawTable, used: Sequence[str]) -> Mapping[str, list[Change]]:
    """Columns that may tell tests apart: of words, and of numbers that nothing else takes."""
    found = dict(table.words)
    for name, values in table.columns.items():
        cuts: list[int] = [0, *(np.flatnonzero(np.diff(values) != 0)[: MOST_TESTS + 1] + 1).tolist()]
        if name not in used and 1 < len(cuts) <= MOST_TESTS:
            found[name] = [(int(table.rows[cut]), f"{values[cut]:g}") for cut in cuts]
    return found


def lay_behind(draft: Draft) -> None:
    """Let the clock go on from test to test, where it starts again in each."""
    for row, _ in draft.tests[1:]:
        first = int(np.searchsorted(draft.rows, row))
        if 0 < first < len(draft) and draft.t[first] <= draft.t[first - 1]:
            usual = float(np.median(np.diff(draft.t[:first])))
            draft.t = draft.t.copy()
            draft.t[first:] += draft.t[first - 1] - draft.t[first] + APART * usual


def split_tests(log: Log) -> list[Log]:
    """The tests of a recording, each a log of its own; the recording where it holds one."""
    if len(log.tests) < 2:
        return [log]
    firsts = [int(np.searchsorted(log.rows, row)) for row, _ in log.tests]
    parts: list[Log] = []
    for first, last, (_, word) in zip(firsts, [*firsts[1:], len(log)], log.tests, strict=True):
        if last - first < FEWEST_ROWS:
            continue
        cut = slice(first, last)
        signals: dict[str, Values] = {role: values[cut] for role, values in log.signals.items()}
        findings = tuple(_within(log, cut, is_first=not parts))
        parts.append(
            replace(
                log, name=f"{log.name}, {word}", t=log.t[cut] - log.t[first], signals=signals, rows=log.rows[cut],
                findings=findings, guesses=() if parts else log.guesses, tests=(),
            )
        )  # fmt: skip
    return parts if len(parts) > 1 else [log]


def _within(log: Log, cut: slice, *, is_first: bool) -> Iterator[Finding]:
    """Findings about rows of a test, without the break before it; those about all rows stand with the first."""
    begin, end = int(log.rows[cut][0]), int(log.rows[cut][-1])
    for finding in log.findings:
        rows = tuple((a, b) for a, b in finding.rows if a <= end and b >= begin and (a, b) != (begin, begin))
        if rows or (is_first and not finding.rows):
            yield replace(finding, rows=rows)
