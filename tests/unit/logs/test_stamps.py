"""The clock: rows twice, out of order, with equal stamps, a clock that starts again, rows missing, uneven steps."""

import numpy as np
import pytest

from detent.errors import InputError
from detent.logs.log import Action, Draft, Kind, Severity
from detent.logs.stamps import look_at_clock, mend_clock, stretches


def draft_of(t, **values):
    t = np.asarray(t, dtype=np.float64)
    n = len(t)
    values = {
        role: np.asarray(v, dtype=np.float64) for role, v in (values or {"position": np.arange(n) ** 1.5}).items()
    }
    return Draft("log.csv", np.arange(1, n + 1), t, values, {"time": "s"}, {})


def mended(t, **values):
    draft = draft_of(t, **values)
    mend_clock(draft)
    assert (np.diff(draft.t) > 0).all()
    assert all(len(found) == len(draft.t) == len(draft.rows) for found in draft.values.values())
    return draft


def told(draft):
    return [(finding.kind, finding.rows, finding.action) for finding in draft.findings]


EVEN = np.arange(100) * 0.5


def test_a_good_clock_is_left_alone():
    draft = mended(EVEN)
    assert draft.t is not None
    assert draft.t.tolist() == EVEN.tolist()
    look_at_clock(draft)
    assert draft.findings == []


def test_rows_twice():
    order = np.r_[np.arange(40), 39, 39, np.arange(40, 100)]
    draft = mended(EVEN[order], position=np.sqrt(order), force=np.where(order == 39, np.nan, order))
    assert told(draft) == [(Kind.DUPLICATED_ROWS, ((41, 42),), Action.REMOVED)]
    assert draft.t.tolist() == EVEN.tolist()
    assert draft.rows[40] == 43


def test_a_block_twice():
    order = np.r_[np.arange(60), np.arange(30, 60), np.arange(60, 100)]
    draft = mended(EVEN[order], position=np.sqrt(order))
    assert told(draft) == [(Kind.DUPLICATED_ROWS, ((61, 90),), Action.REMOVED)]
    assert draft.values["position"].tolist() == np.sqrt(np.arange(100)).tolist()


def test_rows_out_of_order():
    order = np.r_[np.arange(20), 21, 22, 23, 20, np.arange(24, 50), 51, 50, np.arange(52, 100)]
    draft = mended(EVEN[order], position=np.sqrt(order))
    (finding,) = draft.findings
    assert (finding.kind, finding.action) == (Kind.TIME_BACKWARDS, Action.REORDERED)
    assert finding.rows[0] == (24, 24)
    assert draft.t.tolist() == EVEN.tolist()
    assert draft.values["position"].tolist() == np.sqrt(np.arange(100)).tolist()


@pytest.mark.parametrize("stamp", [-1e9, 0.0, 10.2, 1e9])
def test_a_stamp_that_fits_nowhere(stamp):
    t = EVEN.copy()
    t[60] = stamp
    draft = mended(t)
    assert told(draft) == [(Kind.TIME_BACKWARDS, ((61, 61),), Action.REMOVED)]
    assert draft.t.tolist() == np.delete(EVEN, 60).tolist()


def test_a_clock_that_starts_again():
    draft = mended(np.r_[EVEN[:40], EVEN[:70], EVEN[:50]], position=np.arange(160))
    (finding,) = draft.findings
    assert (finding.kind, finding.rows, finding.severity) == (
        Kind.TIME_BACKWARDS,
        ((1, 40), (111, 160)),
        Severity.ERROR,
    )
    assert "restarts at row 41, 111: 3 recordings" in finding.text
    assert draft.t.tolist() == EVEN[:70].tolist()


def test_few_stamps_twice():
    t = EVEN.copy()
    t[[10, 50]] = t[[9, 49]]
    draft = mended(t)
    assert told(draft) == [(Kind.REPEATED_STAMPS, ((11, 11), (51, 51)), Action.REMOVED)]
    look_at_clock(draft)
    assert draft.findings[1].kind == Kind.DROPPED_ROWS


def test_stamps_coarser_than_the_rows():
    true = np.arange(200) * 0.3
    draft = mended(np.floor(true))
    (finding,) = draft.findings
    assert (finding.kind, finding.action) == (Kind.REPEATED_STAMPS, Action.INTERPOLATED)
    assert "70% repeat" in finding.text
    assert np.diff(draft.t) == pytest.approx(np.full(199, 0.3), rel=0.01)


def test_coarse_stamps_of_an_uneven_clock_are_spread_between_them():
    t = np.floor(np.r_[np.arange(50) * 0.5, 100 + np.arange(50) * 0.25])
    draft = mended(t)
    assert draft.t[:4].tolist() == [0.0, 0.5, 1.0, 1.5]
    assert draft.t[50:55].tolist() == [100.0, 100.25, 100.5, 100.75, 101.0]


def test_all_stamps_equal():
    with pytest.raises(InputError, match="1 usable row"):
        mended(np.zeros(100))


def test_rows_without_a_time():
    t = EVEN.copy()
    t[[3, 4]] = np.nan
    draft = mended(t)
    assert told(draft) == [(Kind.MISSING_VALUES, ((4, 5),), Action.REMOVED)]


def test_too_few_rows():
    with pytest.raises(InputError, match=r"9 usable rows.*at least 10 rows"):
        mended(np.arange(9))
    with pytest.raises(InputError, match=r"3 usable rows .*without a time"):
        mended(np.r_[np.arange(3), np.full(20, np.nan)])


@pytest.mark.parametrize("bits", [16, 32])
def test_a_clock_that_wraps(bits):
    true = 2.0**bits - 500 + np.arange(100) * 10 + np.tile([0, 3], 50)
    draft = mended(true % 2**bits)
    (finding,) = draft.findings
    assert (finding.kind, finding.action) == (Kind.WRAPPED_COUNTER, Action.UNWRAPPED)
    assert finding.rows == ((51, 51),)
    assert draft.t.tolist() == true.tolist()


@pytest.mark.parametrize("gone", [[30], [30, 31, 32, 60]])
def test_dropped_rows(gone):
    draft = draft_of(np.delete(EVEN, gone))
    draft.rows = np.delete(np.arange(1, 101), gone)
    look_at_clock(draft)
    (finding,) = draft.findings
    assert (finding.kind, finding.action) == (Kind.DROPPED_ROWS, Action.LEFT)
    behind = [34, 62] if len(gone) > 1 else [32]
    assert finding.rows == tuple((row, row) for row in behind)
    assert f"about {len(gone)} row" in finding.text


def test_a_single_odd_step():
    t = EVEN.copy()
    t[40] += 0.2
    draft = draft_of(t)
    look_at_clock(draft)
    assert [(finding.kind, finding.rows, finding.severity) for finding in draft.findings] == [
        (Kind.IRREGULAR_TIME, ((41, 42),), Severity.NOTE)
    ]


def test_an_uneven_clock_loses_no_rows():
    rng = np.random.default_rng(3)
    t = np.cumsum(0.02 * rng.choice([1.0, 1.37, 1.9], 400, p=[0.8, 0.15, 0.05]))
    draft = draft_of(t)
    look_at_clock(draft)
    (finding,) = draft.findings
    assert (finding.kind, finding.severity, finding.rows) == (Kind.IRREGULAR_TIME, Severity.NOTE, ())
    assert "of the usual 20 ms" in finding.text


def drifts(steps):
    draft = draft_of(np.cumsum(steps))
    look_at_clock(draft)
    return [finding for finding in draft.findings if finding.kind is Kind.DRIFTING_CLOCK]


def test_a_clock_that_drifts_is_told_by_its_steps():
    course = np.linspace(0.0, 1.0, 800)
    (finding,) = drifts(0.01 * (1.0 + 0.05 * course))
    assert finding.severity is Severity.ERROR
    assert "steps go evenly between 10 and 10.5 ms" in finding.text
    (finding,) = drifts(0.01 * (1.0 + 0.05 * np.sin(20.0 * course)))
    assert "steps go evenly between 9.50" in finding.text


@pytest.mark.parametrize(("back", "is_set"), [(0.5, True), (3.0, False)])
def test_a_clock_that_is_set_back_is_told_from_one_that_starts_again(back, is_set):
    """Half a second before it goes on; or from its begin, as for another recording in the same file."""
    t = 0.01 * np.arange(600)
    t[300:] -= back
    draft = draft_of(t)
    mend_clock(draft)
    drifting = [finding for finding in draft.findings if finding.kind is Kind.DRIFTING_CLOCK]
    assert bool(drifting) is is_set
    for finding in drifting:
        assert "set back at row 301, by up to 0.49" in finding.text


def test_what_is_no_drift_of_a_clock():
    """Less than 2 %; a sampler that waits by chance; one that takes longer turns in a part of the run; a few rows.

    A solver that chooses its steps.
    """
    course, rng = np.linspace(0.0, 1.0, 800), np.random.default_rng(2)
    assert drifts(0.01 * (1.0 + 0.015 * course)) == []
    assert drifts(0.01 * (1.0 + 0.05 * course + 0.02 * rng.exponential(size=800))) == []
    assert drifts(0.01 * (1.0 + 0.3 * (course > 0.5))) == []
    assert drifts(0.01 * (1.0 + 0.05 * course[::12])) == []
    assert drifts(0.01 * np.exp(np.sin(20.0 * course))) == []


def test_stretches():
    t = np.r_[np.arange(5), np.arange(10, 15), np.arange(16, 20)].astype(float)
    assert stretches(t) == [slice(0, 5), slice(5, 14)]
