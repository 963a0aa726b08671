"""Limits reach further where residuals are unlike noise, and by just as much as they are."""

import numpy as np
import pytest
from tests.log_rig import make_log
from tests.unit.identify.fit.test_steadiness import T, changes

from detent.identify.fit.constants import constants_of, further
from detent.identify.fit.doubt import LEAST_SQUARES, MOST, SHARED, USUAL, Doubt, doubt_of
from detent.identify.fit.estimate import lasting
from detent.identify.fit.identification import identify

QUIET = Doubt({"mass": 1.0, "coulomb": 1.2}, 0.0, 0.0, is_biased=False)


def made(residual, seed=1):
    """An axis of 2 kg, and what its force holds besides."""
    w = 2 * np.pi * np.array([0.23, 0.61, 1.3])
    angle, sizes = np.outer(T, w) + np.array([0.3, 1.1, 2.0]), np.array([0.06, 0.025, 0.008])
    x, v, a = np.sin(angle) @ sizes, np.cos(angle) @ (sizes * w), -np.sin(angle) @ (sizes * w**2)
    noise = np.random.default_rng(seed).normal(size=len(T))
    return make_log(T, position=x, force=2.0 * a + 1.6 * np.sign(v) + 6.0 * v + residual(noise, v, a))


def seen(log):
    parts, fit, _ = changes(log)
    return doubt_of(parts, fit, 0.0), fit


def test_noise_leaves_limits_as_they_are():
    for seed in range(5):
        doubt, fit = seen(made(lambda noise, *_: 0.02 * noise, seed))
        assert doubt.uneven < USUAL
        assert not doubt.is_biased
        assert fit.instruments == "position"
        # Windows that overlap make errors one and a half times those of independent ones.
        assert 1.0 < np.median(list(doubt.lasting.values())) < SHARED
        assert max(doubt.times.values()) < 1.1


def test_what_is_louder_where_the_axis_accelerates():
    doubt, _ = seen(made(lambda noise, _, a: 0.02 * noise * (0.2 + np.abs(a))))
    assert doubt.uneven > 0.3
    assert doubt.usual > np.exp(2.0 * (0.3 - USUAL))


def test_what_lasts():
    """A noise that remembers 30 rows, as no window explains."""

    def slow(noise, *_):
        return 0.05 * np.convolve(noise, np.exp(-np.arange(400) / 60.0), mode="same")

    doubt, _ = seen(made(slow))
    assert np.median(list(doubt.lasting.values())) > SHARED
    assert doubt.usual > 1.0


def test_errors_of_coloured_residuals_in_those_of_independent_ones():
    """Means of a residual that repeats each value four times are twice as uncertain as independent ones say."""
    rng = np.random.default_rng(3)
    column = np.ones((8000, 1))
    assert lasting(column, rng.normal(size=8000), column)[0] == pytest.approx(1.0, abs=0.25)
    assert lasting(column, np.repeat(rng.normal(size=2000), 4), column)[0] == pytest.approx(2.0, abs=0.5)
    assert lasting(column, np.zeros(8000), column)[0] == 1.0


def test_each_sign_makes_limits_reach_further_up_to_a_bound():
    assert set(QUIET.times.values()) == {1.0}
    assert Doubt({"mass": 2 * SHARED, "coulomb": 1.0}, 0.0, 0.0, is_biased=False).times == {
        "mass": MOST,
        "coulomb": 1.0,
    }
    assert Doubt(QUIET.lasting, USUAL + 0.1, 0.0, is_biased=False).usual == pytest.approx(np.exp(0.2))
    assert Doubt(QUIET.lasting, 0.0, 1.0, is_biased=False).usual == pytest.approx(np.exp(0.4))
    assert Doubt(QUIET.lasting, 0.0, 0.0, is_biased=True).usual == LEAST_SQUARES
    assert Doubt(QUIET.lasting, 0.0, 1e9, is_biased=True).usual == MOST


def test_a_sum_reaches_as_far_as_the_furthest_of_its_terms():
    _, fit, _ = changes(made(lambda noise, *_: 0.02 * noise))
    before = constants_of(fit)
    after = further(before, {"mass": 1.0, "coulomb": 2.0, "offset": 3.0, "viscous": 1.5, "delay": 1.0})
    reach = dict(zip(before.names, after.errors / before.errors, strict=True))
    assert reach == pytest.approx(
        {
            "mass": 1.0,
            "coulomb.positive": 3.0,
            "coulomb.negative": 3.0,
            "viscous.positive": 1.5,
            "viscous.negative": 1.5,
            "delay": 1.0,
        }
    )
    assert after.values.tolist() == before.values.tolist()
    assert after.correlation == pytest.approx(before.correlation)


def test_the_notes_say_how_far():
    noisy = identify([made(lambda noise, _, a: 0.02 * noise * (0.2 + np.abs(a)))])
    (told,) = [note for note in noisy.notes if "unlike noise" in note]
    assert "times as far" in told
    assert not [n for n in identify([made(lambda noise, *_: 0.02 * noise)]).notes if "limits reach 3" in n]
