"""The log itself: rows put together and told, findings as text and as data, masks."""

import json

import numpy as np
import pytest

from detent.logs.log import Action, Finding, Kind, Log, Severity, Source, row_ranges, tell_rows


@pytest.mark.parametrize(
    ("rows", "ranges", "told"),
    [
        ([], (), "all rows"),
        ([4], ((4, 4),), "row 4"),
        ([4, 5], ((4, 5),), "rows 4-5"),
        ([1, 3, 4], ((1, 1), (3, 4)), "rows 1, 3-4"),
        (range(1, 20, 2), tuple((k, k) for k in range(1, 20, 2)), "rows 1, 3, 5, 7, 9 and 5 more places"),
    ],
)
def test_rows(rows, ranges, told):
    assert row_ranges(rows) == ranges
    assert tell_rows(ranges) == told


FOUND = Finding(Kind.STUCK, "velocity", ((2, 3), (9, 9)), "stays the same", Action.LEFT, "leave it out", Severity.ERROR)
LOG = Log(
    "run.csv",
    np.array([0.0, 0.1, 0.2, 0.4]),
    {"velocity": np.zeros(4)},
    {"time": "s", "velocity": "m/s"},
    {"time": Source("t", "s", 1.0), "velocity": Source("v", "mm/s", 1e-3)},
    np.array([1, 3, 4, 9]),
    (FOUND, Finding(Kind.BROKEN_ROWS, "", ((2, 2),), "2 cells", Action.REMOVED)),
    ("time: by its name",),
)


def test_findings_as_text():
    assert str(FOUND) == "error: rows 2-3, 9, velocity: stays the same; left; try: leave it out"
    assert str(LOG.findings[1]) == "warning: row 2: 2 cells; removed"


def test_masks():
    assert LOG.mask(Kind.STUCK).tolist() == [False, True, False, True]
    assert not LOG.mask(Kind.BROKEN_ROWS, Kind.SHIFTED).any()


def test_what_a_log_says_of_itself():
    assert (len(LOG), LOG.period) == (4, pytest.approx(0.1))
    data = json.loads(json.dumps(LOG.to_dict()))
    assert data["findings"][0] == {
        "kind": "stuck", "signal": "velocity", "rows": [[2, 3], [9, 9]], "text": "stays the same", "action": "left",
        "advice": "leave it out", "severity": "error",
    }  # fmt: skip
    assert data["columns"]["velocity"] == {"column": "v", "unit": "mm/s", "factor": 1e-3, "offset": 0.0}
    assert (data["samples"], data["span"]) == (4, [0.0, 0.4])
