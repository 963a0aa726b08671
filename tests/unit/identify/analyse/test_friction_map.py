"""Friction versus speed: known laws come back with intervals that hold, the dip is found where there is one."""

import numpy as np
import pytest
from tests.log_rig import EMPS, assert_covers, coloured, make_log, quantised, read_emps

from detent.errors import DetentError
from detent.identify.analyse.friction_map import map_friction, memory_rows

DT = 1e-3
MASS = 2.0


def line(v):
    """Coulomb and viscous friction that differ by direction."""
    return np.where(v > 0, 1.5 + 4.0 * v, -1.2 + 5.0 * v)


def dipping(v):
    """Stribeck friction: 2 N near rest, falling to 1.4 N, rising again."""
    return np.sign(v) * (1.2 + 0.9 * np.exp(-((v / 0.02) ** 2))) + 3.0 * v


def record(rng, law=line, noise=0.3, seconds=10.0, **signals):
    """A run to and fro at changing speeds."""
    t = np.arange(0.0, seconds, DT)
    w = 2 * np.pi * np.array([0.6, 1.7])[:, None]
    angle = w * t + rng.uniform(0, 2 * np.pi, (2, 1))
    size = np.array([[0.05], [0.012]])
    v, a = (size * w * np.cos(angle)).sum(0), (-size * w**2 * np.sin(angle)).sum(0)
    force = MASS * a + law(v) + coloured(rng, len(t), noise, 0.9)
    x = quantised((size * np.sin(angle)).sum(0), 1e-6)
    return make_log(t, position=x, force=quantised(force, 0.01), **signals)


def test_a_known_law_comes_back():
    found = map_friction(record(np.random.default_rng(1), noise=0.05), mass=MASS)
    assert (found.effort, found.unit, found.speed_unit, found.reason) == ("force", "N", "m/s", "")
    assert np.all(np.diff(found.speed) > 0)
    assert len(found.speed) >= 16
    assert found.friction == pytest.approx(line(found.speed), abs=0.05)
    assert np.all((found.low < found.friction) & (found.friction < found.high))
    assert found.samples.sum() > 9000
    assert np.all(found.windows >= 5)


@pytest.mark.wide
def test_intervals_hold_the_true_value_as_often_as_they_say():
    hits = []
    for seed in range(200):
        found = map_friction(record(np.random.default_rng(seed)), mass=MASS, bins=6)
        true = line(found.speed)
        hits += ((found.low <= true) & (true <= found.high)).tolist()
    assert len(hits) > 2000
    assert_covers(hits, 0.92, 0.98)


def test_the_dip_is_found_where_there_is_one_and_hardly_elsewhere():
    found = map_friction(record(np.random.default_rng(2), dipping, 0.1), mass=MASS)
    for dip in found.dips:
        assert dip.is_found
        assert 0.2 < dip.depth.value < 0.8
        assert dip.depth.low > 0
        assert 0.03 < abs(dip.speed) < 0.2
    flat = [
        dip.is_found
        for seed in range(60)
        for dip in map_friction(record(np.random.default_rng(seed), np.sign), mass=MASS, bins=6).dips
    ]
    assert np.mean(flat) <= 0.06
    assert not any(dip.is_found for dip in map_friction(record(np.random.default_rng(3)), mass=MASS).dips)


def test_without_a_mass_only_steady_stretches_count():
    rng = np.random.default_rng(4)
    knots = np.array([0.0, 0.1, 1.6, 1.7, 3.2, 3.3, 4.8])
    t = np.arange(0.0, 4.8, DT)
    v = np.interp(t, knots, [0, 0.05, 0.05, 0.2, 0.2, -0.1, -0.1])
    force = MASS * np.gradient(v, DT) + line(v) + coloured(rng, len(t), 0.1, 0.5)
    found = map_friction(make_log(t, position=quantised(np.cumsum(v) * DT, 1e-6), force=force))
    assert found.speed == pytest.approx([-0.1, 0.05, 0.2], rel=1e-3)
    assert found.friction == pytest.approx(line(found.speed), abs=0.05)
    negative = found.dips[1]
    assert (negative.direction, negative.is_found, negative.depth) == ("negative", False, None)


def test_a_velocity_signal_serves_without_a_position():
    rng = np.random.default_rng(5)
    t = np.arange(0.0, 10.0, DT)
    v = 0.2 * np.sin(4 * t)
    force = MASS * np.gradient(v, DT) + line(v) + coloured(rng, len(t), 0.05, 0.5)
    found = map_friction(make_log(t, velocity=v + 1e-4 * rng.standard_normal(len(t)), force=force), mass=MASS, bins=5)
    assert len(found.speed) == 10
    assert found.friction == pytest.approx(line(found.speed), abs=0.05)


def test_a_bin_seen_once_is_refused_in_words():
    """One start at low speed gives one window of low speeds, however many samples it has."""
    t = np.arange(0.0, 5.0, DT)
    v = np.where(t < 0.3, 0.5 * t, 0.15 + 0.05 * np.sin(20 * t))
    force = MASS * np.gradient(v, DT) + line(v) + coloured(np.random.default_rng(6), len(t), 0.2, 0.9)
    found = map_friction(make_log(t, position=np.cumsum(v) * DT, force=force), mass=MASS)
    assert found.reason == ""
    assert "record this speed for longer or more often" in found.refused[0]
    assert found.speed.min() > 0.05


def test_what_cannot_be_mapped_has_a_reason():
    t = np.arange(0.0, 3.0, DT)
    rest = make_log(t, position=0 * t, force=0 * t)
    assert "does not move" in map_friction(rest, mass=1.0).reason
    assert "state the mass" in map_friction(rest).reason
    once = make_log(t[:400], position=0.1 * t[:400] ** 2, force=np.sin(5 * t[:400]))
    found = map_friction(once, mass=0.1)
    assert "record longer" in found.reason
    assert len(found.refused) > 0
    assert len(found.speed) == 0


def test_wrong_input_is_an_error():
    log = record(np.random.default_rng(1), seconds=1.0)
    with pytest.raises(DetentError, match="got a mass of -1"):
        map_friction(log, mass=-1.0)
    with pytest.raises(DetentError, match="got 0 bins"):
        map_friction(log, bins=0)
    with pytest.raises(DetentError, match="expected: voltage that drives the axis"):
        map_friction(log, "voltage")


def test_memory_is_that_of_the_noise_gaps_or_not():
    rng = np.random.default_rng(7)
    place = np.arange(40_000)
    residual = coloured(rng, len(place), 1.0, 0.8)
    # A process of first order remembers (1 + phi) / (1 - phi) = 9 rows.
    assert memory_rows(residual - residual.mean(), place) == pytest.approx(9.0, rel=0.15)
    kept = (place // 500) % 2 == 0
    assert memory_rows(residual[kept], place[kept]) == pytest.approx(9.0, rel=0.25)
    assert memory_rows(np.zeros(5), place[:5]) == 1.0
    assert memory_rows(np.empty(0), place[:0]) == 1.0


@pytest.mark.skipif(not EMPS.exists(), reason="the recordings of real machines (../shared/data) are not here")
def test_a_ball_screw_axis_has_no_dip():
    """Steady stretches alone and the whole run with its mass say the same where both have the speed."""
    log = read_emps()
    steady, driven = map_friction(log), map_friction(log, mass=95.11, bins=12)
    assert np.round(steady.speed, 3).tolist() == [-0.125, -0.083, -0.042, 0.042, 0.083, 0.125]
    assert steady.friction == pytest.approx([-50.34, -40.23, -31.95, 28.08, 34.35, 40.47], abs=0.3)
    assert np.interp(steady.speed[1:-1], driven.speed, driven.friction) == pytest.approx(steady.friction[1:-1], abs=0.8)
    assert len(driven.speed) >= 20
    assert np.all(np.diff(driven.friction) > 0)
    assert not any(dip.is_found for dip in (*steady.dips, *driven.dips))
