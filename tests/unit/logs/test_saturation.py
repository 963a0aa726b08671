"""Signals that stay at their extreme value, and those that merely have one."""

import numpy as np
import pytest

from detent.logs.log import Action, Draft, Kind, Severity, Source
from detent.logs.stuck import find_saturation

T = np.arange(2000) * 0.001
RNG = np.random.default_rng(4)
WAVE = 300 * np.sin(9 * T) + 80 * np.sin(31 * T) + RNG.normal(0, 3, len(T))


def findings(values, role="command", factor=1.0):
    draft = Draft(
        "log.csv", np.arange(1, len(values) + 1), T, {role: np.asarray(values, dtype=float)},
        {role: ""}, {role: Source(role, "", factor)},
    )  # fmt: skip
    find_saturation(draft)
    return draft.findings


@pytest.mark.parametrize("limit", [255.0, 200.0])
def test_both_ends(limit):
    found = findings(np.clip(WAVE, -limit, limit))
    assert [(finding.kind, finding.action, finding.severity) for finding in found] == [
        (Kind.SATURATED, Action.LEFT, Severity.WARNING)
    ] * 2
    rows = [row for finding in found for first, last in finding.rows for row in range(first, last + 1)]
    assert sorted(rows) == (np.flatnonzero(np.abs(WAVE) >= limit) + 1).tolist()
    assert "as far as the other end" in found[0].text


@pytest.mark.parametrize(
    ("values", "factor", "severity", "why"),
    [
        (np.minimum(WAVE, 255), 1.0, Severity.WARNING, "a full scale"),
        (np.minimum(WAVE, 100), 1.0, Severity.WARNING, "a full scale"),
        (np.minimum(WAVE, 255) * 0.1, 0.1, Severity.WARNING, "a full scale"),
        (np.minimum(WAVE, 251.5), 1.0, Severity.NOTE, "clipped, or commanded so"),
        (np.maximum(WAVE, -123), 1.0, Severity.NOTE, "clipped, or commanded so"),
    ],
)
def test_one_end(values, factor, severity, why):
    (finding,) = findings(values, factor=factor)
    assert finding.severity == severity
    assert why in finding.text


@pytest.mark.parametrize(
    "values",
    [
        WAVE,
        np.round(100 * np.sin(9 * T)),  # a sine that was rounded
        np.where(np.sin(9 * T) > 0, 255, -255),  # a square wave
        np.round(np.abs((T * 700) % 510 - 255)),  # a triangle
        np.clip(WAVE, -255, 255) // 50 * 50,  # a staircase
        np.r_[np.full(9, 400.0), WAVE[9:] / 2],  # a peak of a few rows
        np.full(len(T), 255.0),
    ],
)
def test_signals_that_are_not_cut_off(values):
    assert findings(values) == []


def test_positions_may_stay_where_they_are():
    assert findings(np.clip(WAVE, -255, 255), role="position") == findings(np.clip(WAVE, -9, 9), role="velocity") == []


def test_noise_that_takes_a_signal_from_its_limit_and_back():
    """Hardly two rows at the limit follow one another, and it is left and reached by large steps."""
    noisy = WAVE + 200 * np.random.default_rng(9).normal(size=len(T))
    (finding,) = findings(np.minimum(noisy, 251.5))
    assert finding.kind is Kind.SATURATED
    assert finding.text.endswith(f"in {np.count_nonzero(noisy >= 251.5)} rows")
    assert findings(noisy) == []
