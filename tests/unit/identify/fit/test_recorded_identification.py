"""A recorded ball-screw axis: what the default identification makes of it, beside the benchmark's four constants."""

import json

import numpy as np
import pytest
from tests.places import DATA
from tests.published_recipe import fit_inverse_dynamics

from detent.identify.fit.constants import Constants, constants_of
from detent.identify.fit.free_run import Plant, start_velocities
from detent.identify.fit.identification import choose_windows, identify
from detent.identify.fit.regression import fit_equations
from detent.logs.mapping import Choice, ColumnMapping
from detent.logs.read_log import read_log

EMPS = DATA / "emps/DATA_EMPS.mat"

pytestmark = [
    pytest.mark.compiled,
    pytest.mark.skipif(not EMPS.exists(), reason="the recordings of real machines (../shared/data) are not here"),
]

SEEN = 0.75
"""First part of the record, which the constants may see."""


@pytest.fixture(scope="module")
def found():
    """Its record: 25 s at 1 kHz, to and fro at three speeds, under a cascade."""
    columns = {
        "time": Choice(column="t", unit="s"),
        "position": Choice(column="qm", unit="m"),
        "reference": Choice(column="qg", unit="m"),
        "force": Choice(column="vir", unit="N", factor="gtau"),
    }
    return identify([read_log(EMPS, ColumnMapping(columns))])


def value(found, name):
    return next(e.value for e in found.estimates if e.name == name)


def test_it_is_trusted(found):
    assert found.verdict == "trusted", [str(r) for r in found.refusals]
    assert found.notes[0] == "effort: force [N]"
    assert json.dumps(found.to_dict())


def test_its_friction_differs_by_direction(found):
    """The benchmark's authors find so, too: 3.1 % of the force unexplained instead of 4.1 %."""
    assert "viscous.positive" in found.fit.names
    assert found.rung.name in {"per direction", "stribeck"}
    assert value(found, "viscous.negative") > 1.3 * value(found, "viscous.positive")
    by_name = {climb.rung.name: climb.error for climb in found.climbs}
    assert by_name["per direction"] < 0.85 * by_name["viscous"]


def test_its_mass_is_the_published_one(found):
    """Least squares of the authors: 95.109 kg with a standard error of 0.11 kg for independent residuals."""
    mass = next(e for e in found.estimates if e.name == "mass")
    assert mass.value == pytest.approx(95.1, abs=0.6)
    assert 0.05 < mass.error < 1.0
    assert mass.holds(95.109)


def test_its_force_acts_when_it_is_recorded(found):
    assert value(found, "delay") == pytest.approx(0.0, abs=2e-3)


def four_constants(run):
    """The benchmark's model, fitted by its authors' recipe, in the words of the simulation."""
    fitted = fit_inverse_dynamics(run.t, run.position, run.effort).values
    offset = fitted["offset"]
    values = {
        "mass": fitted["mass"],
        "coulomb.positive": fitted["coulomb"] + offset,
        "coulomb.negative": fitted["coulomb"] - offset,
        "viscous.positive": fitted["viscous"],
        "viscous.negative": fitted["viscous"],
    }
    return Constants(
        tuple(values),
        np.array(list(values.values())),
        np.eye(len(values)),
        np.full(len(values), 10.0),
        "four constants",
    )


def free_run_error(constants, run, begin):
    """Root mean square and largest error of the rest of a run, simulated without restarts under its force [mm]."""
    position, velocity = float(run.position[begin]), float(start_velocities(run)[begin])
    made = Plant(constants, run.step).run(run.effort, begin, len(run.position) - begin, position, velocity)
    error = 1e3 * (made - run.position[begin:])
    return float(np.sqrt(np.mean(error**2))), float(np.abs(error).max())


def test_it_runs_the_rest_of_the_record_better_than_four_constants(found):
    """Both see the first three quarters only; then the force alone moves them through the last, loops open."""
    run = found.runs[0]
    cut = round(SEEN * len(run.position))
    seen = run.part(0, cut)
    parts = choose_windows([seen])
    ours = constants_of(fit_equations(parts, found.fit.model, found.fit.bend))
    rms, worst = free_run_error(ours, run, cut)
    their_rms, their_worst = free_run_error(four_constants(seen), run, cut)
    way = 1e3 * float(np.ptp(run.position[cut:]))
    figures = (
        f"free run over {run.t[-1] - run.t[cut]:.2f} s and {way:.0f} mm: {rms:.2f} mm rms, {worst:.2f} mm at most; "
        f"four constants: {their_rms:.2f} mm rms, {their_worst:.2f} mm at most"
    )
    assert rms < 0.8 * their_rms, figures
    assert worst < their_worst, figures


def test_it_simulates_what_it_did_not_see(found):
    """Windows of half a second over the last quarter, with constants from the first three."""
    by_name = {h.name: h for h in found.horizons}
    half, free = by_name["0.5 s"], by_name["free run"]
    assert half.rms < 0.1 * half.naive, f"{1e3 * half.rms:.2f} mm of {1e3 * half.naive:.2f} mm"
    assert free.rms < 0.2 * free.moved, f"free run: {1e3 * free.rms:.2f} mm rms"
