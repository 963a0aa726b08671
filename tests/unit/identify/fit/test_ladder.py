"""The ladder: the rung that made the data is taken, by what was not seen."""

import numpy as np
import pytest
from tests.identify_rig import SYMMETRIC, TRUTH, Recorder

from detent.identify.fit.equations import make_kernel
from detent.identify.fit.ladder import RUNGS, bends_tried, best_bend, chosen_rung, climb, extended, hold_out
from detent.identify.fit.regression import prepare

WITHOUT_VISCOUS = SYMMETRIC | {"viscous.positive": 0.0, "viscous.negative": 0.0}


def parts_of(*recorders):
    return [prepare(recorder.run(), make_kernel(10, recorder.step), "reference") for recorder in recorders]


MADE = {
    "coulomb": Recorder(WITHOUT_VISCOUS, force_noise=0.3),
    "viscous": Recorder(SYMMETRIC, force_noise=0.3),
    "per direction": Recorder(TRUTH, force_noise=0.3),
    "stribeck": Recorder(TRUTH, force_noise=0.3, excess=1.2, stribeck=0.04),
}


@pytest.mark.parametrize("name", MADE)
def test_the_rung_that_made_the_data_explains_it(name):
    climbs = climb(parts_of(MADE[name]))
    names = [c.rung.name for c in climbs]
    assert names == [rung.name for rung in RUNGS]
    right = names.index(name)
    # Noise may lead a rung or two higher by chance, but no rung below is taken for it, and none above is much better.
    assert names.index(chosen_rung(climbs).name) >= right
    errors = [c.error for c in climbs]
    assert all(error > 1.02 * errors[right] for error in errors[:right])
    assert all(error > 0.97 * errors[right] for error in errors[right:])


@pytest.mark.parametrize("name", MADE)
def test_the_rung_that_made_the_data_is_taken(name):
    """Of several recordings that noise makes different, most; a rung too high by chance costs accuracy, no more."""
    recorder = MADE[name]
    taken = []
    for seed in range(10, 18):
        made = Recorder(recorder.truth, 8.0, force_noise=0.3, excess=recorder.excess, stribeck=0.04, seed=seed)
        taken.append(chosen_rung(climb(parts_of(made))).name)
    assert taken.count(name) >= 5, taken


def test_gains_are_in_standard_errors_over_the_stretches():
    first, second, *_ = climb(parts_of(MADE["per direction"]))
    assert np.isnan(first.gain)
    assert first.taken
    better = first.stretches - second.stretches
    assert second.gain == pytest.approx(better.mean() / (better.std(ddof=1) / np.sqrt(8)))


def test_friction_that_falls_towards_standstill_is_no_stribeck_friction():
    climbs = climb(parts_of(Recorder(TRUTH, force_noise=0.05, excess=-0.8, stribeck=0.04)))
    assert not climbs[-1].possible
    assert not climbs[-1].taken
    assert all(c.possible for c in climbs[:-1])
    assert climbs[-1].error < climbs[-2].error


def test_the_stribeck_velocity_is_found():
    parts = parts_of(Recorder(TRUTH, force_noise=0.05, excess=1.2, stribeck=0.04))
    assert best_bend(parts, RUNGS[-1].terms)[0] == pytest.approx(0.04, rel=0.05)


def test_speeds_tried_lie_within_the_motion():
    parts = parts_of(Recorder())
    top = np.abs(parts[0].motion.velocity).max()
    speeds = bends_tried(parts, RUNGS[-1].terms)
    assert (np.diff(speeds) > 0).all()
    assert 0.015 * top < speeds[0] < speeds[-1] < 0.5 * top


def test_stretches_are_held_out_with_all_that_shares_samples_with_them():
    parts = parts_of(Recorder(seconds=6), Recorder(seconds=4, seed=2))
    rows = np.concatenate([p.motion.rows for p in parts])
    which = np.repeat([0, 1], [len(p.motion.rows) for p in parts])
    masks = list(hold_out(parts))
    assert np.sum([inside for inside, _ in masks], axis=0) == pytest.approx(1)
    for inside, apart in masks:
        assert not (inside & apart).any()
        for run in (0, 1):
            held, seen = rows[inside & (which == run)], rows[apart & (which == run)]
            assert len(held) > 0
            assert np.abs(held[:, None] - seen[None, :]).min() > 2 * parts[0].motion.kernel.half


def test_it_tells_how_far_it_is():
    told = []
    climb(parts_of(Recorder(seconds=4)), RUNGS[:2], report=told.append)
    assert told == [0.5, 1.0]


def test_a_rung_takes_further_terms():
    rung = extended(RUNGS[0], ("spring",))
    assert rung.terms == ("mass", "coulomb", "offset", "spring")
    assert not rung.is_bent
    assert RUNGS[-1].is_bent
