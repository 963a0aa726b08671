"""Spikes, jumps, lost rows and copied columns, each with its rows; a clean motion has none."""

import numpy as np
import pytest

from detent.logs.jumps import find_copies, mend_jumps
from detent.logs.log import Action, Draft, Kind, Severity, Source

T = np.arange(4000) * 1e-3
COUNT = 1e-6


def draft(position, reference=None, force=None) -> Draft:
    values = {"position": np.asarray(position, float)}
    values |= {} if reference is None else {"reference": np.asarray(reference, float)}
    values |= {} if force is None else {"force": np.asarray(force, float)}
    units = {"time": "s", "position": "m", "reference": "m", "force": "N"}
    sources = {role: Source(role, units[role], 1.0) for role in units}
    count = len(values["position"])
    return Draft("made.csv", np.arange(1, count + 1), T[:count].copy(), values, units, sources)


def motion(t=T):
    return COUNT * np.round(0.1 * np.sin(2 * np.pi * 0.7 * t) / COUNT)


def test_a_clean_motion_has_none():
    force = np.sign(np.cos(2 * np.pi * 0.7 * T)) * 5 + np.random.default_rng(1).normal(size=len(T))
    made = draft(motion(), reference=0.1 * np.sin(2 * np.pi * 0.7 * (T + 0.01)), force=force)
    mend_jumps(made)
    find_copies(made)
    assert not made.findings


def test_a_spike_is_taken_out_and_named():
    spoilt = motion()
    spoilt[1000] += 5e-3
    made = draft(spoilt)
    mend_jumps(made)
    (finding,) = made.findings
    assert (finding.kind, finding.rows, finding.action) == (Kind.SPIKES, ((1001, 1001),), Action.INTERPOLATED)
    assert np.abs(made.values["position"] - motion()).max() < 5 * COUNT


def test_a_jump_is_named_and_stays():
    spoilt = motion()
    spoilt[2000:] += 5e-3
    made = draft(spoilt)
    mend_jumps(made)
    (finding,) = made.findings
    assert (finding.kind, finding.rows) == (Kind.JUMPS, ((2001, 2001),))
    assert made.values["position"] == pytest.approx(spoilt)


LOST, TWICE = (
    np.delete(np.arange(4000), [500, 1500, 2200, 3000]),
    np.sort(np.r_[np.arange(3990), [60, 1400, 2100, 3500]]),
)


@pytest.mark.parametrize(("rows", "what"), [(LOST, "lost"), (TWICE, "twice")])
def test_rows_lost_or_written_twice_without_trace(rows, what):
    made = draft(motion()[rows][:3990])
    mend_jumps(made)
    finding = next(one for one in made.findings if one.kind is Kind.DROPPED_ROWS)
    assert finding.severity is Severity.ERROR
    assert what in finding.text
    assert len(finding.rows) >= 3


def test_spikes_of_an_effort_and_rows_of_nothing():
    clean = 10 * np.cos(2 * np.pi * 0.7 * T) + 20
    spoilt = clean.copy()
    spoilt[700], spoilt[2000:2005] = 900.0, 0.0
    made = draft(motion(), force=spoilt)
    mend_jumps(made)
    (finding,) = made.findings
    assert finding.rows == ((701, 701), (2001, 2005))
    assert np.abs(made.values["force"] - clean).max() < 0.1


def test_what_gaps_of_an_effort_were_filled_with():
    """A number that comes again and again out of nothing, as a mean or an invalid mark does; a level is none."""
    rng = np.random.default_rng(5)
    clean = 10 * np.cos(2 * np.pi * 0.7 * T) + 0.05 * rng.standard_normal(len(T))
    for filler in (3.217, -99.0):
        gone = rng.random(len(T)) < 0.05
        made = draft(motion(), force=np.where(gone, filler, clean))
        mend_jumps(made)
        assert {one.kind for one in made.findings} == {Kind.SPIKES}
        assert np.abs(made.values["force"] - clean).max() < 0.5
    for level in (0.5 * np.round(2.0 * clean), np.where(np.abs(clean) > 8.0, 8.0, clean)):
        made = draft(motion(), force=level)
        mend_jumps(made)
        assert not made.findings


def test_the_top_of_an_effort_that_rises_and_falls_was_taken_for_a_spike():
    force = 5.0 * np.sin(2 * np.pi * 0.7 * T)
    force[:7] = [-0.5, 1.5, 9.6, 16.4, 17.2, 11.9, 6.4]
    made = draft(motion(), force=force)
    mend_jumps(made)
    assert not made.findings
    force[2000] += 30.0
    made = draft(motion(), force=force)
    mend_jumps(made)
    assert [(one.kind, one.rows) for one in made.findings] == [(Kind.SPIKES, ((2001, 2001),))]


@pytest.mark.parametrize("copy", [motion(), 0.1 * np.sin(2 * np.pi * 0.7 * T)])
def test_a_reference_that_is_the_position(copy):
    made = draft(motion(), reference=copy)
    find_copies(made)
    (finding,) = made.findings
    assert (finding.kind, finding.severity) == (Kind.COPIED, Severity.ERROR)
