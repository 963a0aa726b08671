"""Counters that wrap and signed numbers without a sign: undone where they are, left where they only look so."""

import math

import numpy as np
import pytest

from detent.logs.log import Action, Draft, Kind, Source, row_ranges
from detent.logs.stamps import find_wraps, mend_counters, unwrap

T = np.arange(400.0)
SWING = np.round(30_000 * np.sin(T / 40))


def mended(unit="count", factor=1.0, bits=None, **values):
    values = {role: np.asarray(found, dtype=np.float64) for role, found in values.items()}
    n = len(next(iter(values.values())))
    units = {role: unit if role == "position" else "" for role in values}
    sources = {role: Source(role, units[role], factor) for role in values}
    draft = Draft("log.csv", np.arange(1, n + 1), np.arange(float(n)), values, units, sources, bits or {})
    mend_counters(draft)
    return draft


@pytest.mark.parametrize("start", [0, 10_000, 65_000])
def test_16_bits_without_sign(start):
    draft = mended(position=(SWING + start) % 65536)
    assert (np.diff(draft.values["position"]) == np.diff(SWING)).all()
    (finding,) = draft.findings
    assert (finding.kind, finding.action) == (Kind.WRAPPED_COUNTER, Action.UNWRAPPED)
    assert "16 bits" in finding.text


def test_16_bits_with_sign():
    true = SWING + 20_000
    draft = mended(position=(true + 32768) % 65536 - 32768)
    assert (draft.values["position"] == true).all()


def test_32_bits():
    true = np.round(3e9 * np.sin(T / 60))
    draft = mended(position=true % 2**32)
    assert (np.diff(draft.values["position"]) == np.diff(true)).all()
    assert "32 bits" in draft.findings[0].text
    assert all(first == last for first, last in draft.findings[0].rows)


def test_a_stated_width():
    true = np.round(300 * np.sin(T / 20))
    assert mended(position=true % 256).findings == []
    draft = mended(position=true % 256, bits={"position": 8})
    assert (np.diff(draft.values["position"]) == np.diff(true)).all()


@pytest.mark.parametrize(("unit", "factor", "turn"), [("rad", 1.0, math.tau), ("rad", math.pi / 180, 360.0)])
def test_angles_of_one_turn(unit, factor, turn):
    true = 3.3 * turn * np.sin(T / 80)
    draft = mended(unit, factor, position=true % turn)
    assert np.diff(draft.values["position"]) == pytest.approx(np.diff(true))
    assert "a whole turn" in draft.findings[0].text


@pytest.mark.parametrize(
    "values",
    [
        SWING,
        np.r_[np.linspace(0, 60_000, 200), np.zeros(200)].round(),  # set to zero: far from the end of the range
        np.r_[np.full(100, 60_000.0), 0, np.full(99, 60_000.0)],  # a row without a reading
        np.r_[np.zeros(200), np.full(200, 65_000.0)],  # a step: nothing moves around it
        (SWING + 40_000) * 2,  # beyond 16 bits
        SWING % 65536 + 0.5,
    ],
)
def test_jumps_that_are_no_wraps(values):
    draft = mended(position=values)
    assert draft.findings == []
    assert (draft.values["position"] == values).all()


def test_a_step_of_exactly_the_range_is_found_at_rest_too():
    values = np.r_[np.full(50, 65_535.0), np.full(50, 2.0)]
    assert find_wraps(values, np.arange(100.0), 65536.0).tolist() == [50]
    assert unwrap(values, np.array([50]), 65536.0)[50] == 65_538.0


def test_steps_count_by_the_time_they_take():
    values = np.array([40000.0, 45000, 50000, 55000, 60000, 15000, 20000]) % 65536
    t = np.array([0.0, 1, 2, 3, 4, 8.3, 9.3])
    assert find_wraps(values, t, 65536.0).tolist() == []  # 20536 is more than an eighth of the range
    assert find_wraps(values, t, 65536.0, is_stated=True).tolist() == [5]
    values[5:] = [1000, 6000]
    assert find_wraps(values, t, 65536.0).tolist() == [5]


@pytest.mark.parametrize(("bits", "size"), [(16, 900.0), (32, 1e8)])
def test_signed_read_as_unsigned(bits, size):
    true = np.round(size * np.sin(T / 30))
    draft = mended(command=true % 2**bits)
    assert (draft.values["command"] == true).all()
    (finding,) = draft.findings
    assert (finding.kind, finding.signal, finding.action) == (Kind.UNSIGNED, "command", Action.UNWRAPPED)
    assert f"negative numbers of {bits} bits" in finding.text
    assert finding.rows == row_ranges(np.flatnonzero(true < 0) + 1)


@pytest.mark.parametrize(
    "values",
    [
        np.round(900 * np.sin(T / 30)),
        np.where(T % 2 == 0, 0, 65_535),  # a switch
        np.round(30_000 + 30_000 * np.sin(T / 30)),  # values in the middle
        np.round(60_000 + 500 * np.sin(T / 30)),  # large, never near zero
        np.abs(np.round(900 * np.sin(T / 30))),
        900 * np.sin(T / 30) % 65536,
    ],
)
def test_numbers_that_are_what_they_are(values):
    assert mended(command=values).findings == []


def test_unsigned_of_a_stated_width():
    true = np.round(60 * np.sin(T / 30))
    assert mended(command=true % 256).findings == []
    assert (mended(command=true % 256, bits={"command": 8}).values["command"] == true).all()
    assert mended(command=true % 512, bits={"command": 8}).findings == []


def test_switches_are_left():
    assert mended(enabled=np.where(T > 9, 65_535, T % 3)).findings == []
