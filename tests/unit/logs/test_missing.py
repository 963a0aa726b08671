"""Empty cells: rows removed, slow signals held, signals with too many left out."""

import numpy as np

from detent.logs.log import Action, Draft, Severity
from detent.logs.read_log import mend_missing

NAN = np.nan


def mended(**values):
    arrays = {role: np.asarray(found, dtype=np.float64) for role, found in values.items()}
    n = len(next(iter(arrays.values())))
    draft = Draft("log.csv", np.arange(1, n + 1), np.arange(float(n)), arrays, dict.fromkeys(arrays, ""), {})
    mend_missing(draft)
    return draft


def holes(n, *where):
    values = np.arange(float(n))
    values[list(where)] = NAN
    return values


def test_rows_with_empty_cells_go():
    draft = mended(position=holes(40, 3), force=holes(40, 3, 20, 21))
    assert draft.rows.tolist() == [row for row in range(1, 41) if row not in {4, 21, 22}]
    assert [(finding.signal, finding.rows, finding.action) for finding in draft.findings] == [
        ("position", ((4, 4),), Action.REMOVED),
        ("force", ((4, 4), (21, 22)), Action.REMOVED),
    ]


def test_slow_signals_keep_their_last_value():
    draft = mended(position=holes(12), temperature=[NAN, NAN, 20, NAN, NAN, 21, NAN, NAN, NAN, NAN, NAN, NAN])
    assert draft.values["temperature"].tolist() == [20, 20, 20, 20, 20, 21, 21, 21, 21, 21, 21, 21]
    (finding,) = draft.findings
    assert (finding.action, finding.severity) == (Action.INTERPOLATED, Severity.NOTE)
    assert len(draft) == 12


def test_signals_with_too_many_empty_cells_are_left_out():
    draft = mended(position=holes(40), force=holes(40, *range(5)), supply=np.full(40, NAN))
    assert list(draft.values) == ["position"]
    assert [(finding.signal, finding.action) for finding in draft.findings] == [
        ("force", Action.LEFT_OUT), ("supply", Action.LEFT_OUT),
    ]  # fmt: skip
    assert draft.findings[0].text == "5 cells of 40 empty"
    assert len(draft) == 40


def test_nothing_is_left():
    draft = mended(force=np.full(40, NAN))
    assert draft.values == {}
    assert len(draft) == 40
