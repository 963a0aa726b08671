"""The step of an encoder comes back from its positions, whatever lies between two of them; elsewhere there is none."""

import numpy as np
import pytest
from tests.places import DATA

from detent.identify.analyse.sensors import estimate_resolution
from detent.logs.read_log import read_log


def motion(seed, rows=600):
    rng = np.random.default_rng(seed)
    if seed % 2:
        return np.cumsum(rng.normal(size=rows)) * 10 ** rng.uniform(0.0, 2.5)
    return np.sin(np.arange(rows) * rng.uniform(0.003, 0.1)) * 10 ** rng.uniform(1.3, 5.0)


@pytest.mark.parametrize("seed", range(40))
def test_a_step_comes_back(seed):
    rng = np.random.default_rng(seed)
    step = 10 ** rng.uniform(-7, -3)
    positions = step * np.rint(motion(seed)) + rng.normal()
    found = estimate_resolution(positions)
    assert found.step == pytest.approx(step, rel=1e-6)
    assert found.counts == round(np.ptp(positions) / step)
    assert (found.share, found.reason) == (1.0, "")


@pytest.mark.parametrize("seed", range(20))
def test_positions_off_any_grid_have_none(seed):
    positions = motion(seed) + np.random.default_rng(seed).normal(size=600)
    found = estimate_resolution(positions)
    assert np.isnan(found.step)
    assert found.counts == 0
    assert "on no grid" in found.reason


def test_counts_that_skip():
    """No two positions are a count apart: only the greatest common divisor is left."""
    counts = np.cumsum(np.random.default_rng(1).choice([6, -9, 10, -15], 400)) * 7
    between = estimate_resolution(0.02 * counts)
    assert between.step == pytest.approx(0.14)
    alone = np.array([0, 6, 16, 31, 41, 56, 62, 72, 87, 97, 112]) * 0.25
    assert estimate_resolution(alone).step == pytest.approx(0.25)


def test_rounding_of_a_file_does_not_hide_the_counts():
    counts = np.rint(300 * np.sin(np.arange(600) * 0.03))
    assert estimate_resolution(np.round(counts * 2 * np.pi / 4096, 4)).step == pytest.approx(2 * np.pi / 4096, rel=1e-3)
    single = (counts * 2 * np.pi / 4096).astype(np.float32).astype(float)
    assert estimate_resolution(single).step == pytest.approx(2 * np.pi / 4096, rel=1e-6)


def test_some_interpolated_rows_do_not_hide_the_counts():
    positions = 1e-6 * np.rint(motion(1, 3000))
    positions[100:2900:100] += 0.4e-6
    found = estimate_resolution(positions)
    assert found.step == pytest.approx(1e-6)
    assert 0.95 <= found.share < 1.0


def test_even_travel_is_not_taken_for_a_grid():
    """Ten counts and a bit per sample: the way per sample repeats nearly, the count exactly."""
    assert estimate_resolution(np.rint(10.004 * np.arange(300))).step == pytest.approx(1.0)


@pytest.mark.parametrize("positions", [np.ones(50), np.tile([1.0, 2.0], 50), np.zeros(0)])
def test_too_few_positions_give_none(positions):
    found = estimate_resolution(positions)
    assert np.isnan(found.step)
    assert "different positions, 10 or more are needed" in found.reason


@pytest.mark.skipif(not DATA.exists(), reason="the recordings of real machines (../shared/data) are not here")
def test_encoders_of_recorded_machines():
    bench = read_log(DATA / "lsb250_two_mass/exp1.npz", options=["voltage=-input_V"])
    assert estimate_resolution(bench.signals["position"]).step == pytest.approx(0.3125e-6)
    assert estimate_resolution(bench.signals["position_load"]).step == pytest.approx(1e-6)
    assert estimate_resolution(read_log(DATA / "emps/DATA_EMPS.mat").signals["position"]).step == pytest.approx(5e-8)
