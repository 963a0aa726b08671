"""The simulation of the held-out part is that of the identification, and its charts show it."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.identify.page.samples import identified, unfitted

from detent.identify.fit.estimate import rms
from detent.identify.page.compared import HeldOut, held_charts, hold_out
from detent.identify.page.words import Ways

pytestmark = pytest.mark.compiled


def held(count: int = 1000, away: float = 0.0) -> HeldOut:
    t = np.arange(count) * 1e-3
    measured = 0.1 * np.sin(t)
    return HeldOut(3.0 + t, measured, measured + 2e-6, measured + away * t, 0.5)


def test_the_simulation_is_that_of_the_table_of_horizons() -> None:
    (held,) = hold_out(identified())
    free = next(h for h in identified().horizons if h.name == "free run")
    assert rms(held.free - held.measured) == pytest.approx(free.rms, rel=1e-9)
    assert np.abs(held.free - held.measured).max() == pytest.approx(free.largest, rel=1e-9)


def test_only_the_last_quarter_is_simulated() -> None:
    (held,), (run,) = hold_out(identified()), identified().runs
    assert held.t[0] == pytest.approx(0.75 * run.t[-1], rel=0.01)
    assert held.t[-1] == pytest.approx(run.t[-1])
    assert np.array_equal(held.measured, run.position[-len(held.t) :])


def test_it_starts_again_from_the_recording() -> None:
    (held,) = hold_out(identified())
    samples = round(held.restart / (held.t[1] - held.t[0]))
    assert held.restart == pytest.approx(1.0)
    starts = np.arange(0, len(held.t), samples)
    assert len(starts) == 3
    assert np.array_equal(held.restarted[starts], held.measured[starts])
    assert held.rms_restarted < rms(held.free - held.measured)


def test_without_horizons_nothing_is_simulated() -> None:
    assert hold_out(replace(identified(), horizons=())) == ()
    assert hold_out(unfitted()) == ()


def test_differences_are_recorded_less_simulated_in_their_unit() -> None:
    place, restarted, free = held_charts(held(away=0.01), Ways("m"))
    assert place["x"][0] == 3.0
    assert restarted["yLabel"] == "difference [µm]"
    assert restarted["series"][0]["y"][5] == pytest.approx(-2.0)
    assert free["yLabel"] == "difference [mm]"
    assert free["series"][0]["y"][-1] == pytest.approx(-9.99, abs=0.01)
    assert "restarted from the recording every 0.5 s" in place["series"][0]["label"]


def test_a_simulation_that_runs_away_does_not_squeeze_the_rest() -> None:
    assert "yRange" not in held_charts(held(away=0.01), Ways("m"))[0]
    low, high = held_charts(held(away=100.0), Ways("m"))[0]["yRange"]
    assert (low, high) == pytest.approx((-0.5 * 84.1, 1.5 * 84.1), rel=0.01)
