"""How long an identification takes: four constants of a log of 25 s at 1 kHz, and eight of it by simulation."""

import numpy as np
from tests.bench.race import Race, timed
from tests.published_recipe import fit_inverse_dynamics

from detent.identify.fit.constants import Constants
from detent.identify.fit.equations import make_kernel, make_motion, make_run, usable_rows
from detent.identify.fit.identification import WINDOW, choose_windows, identify
from detent.identify.fit.ladder import RUNGS
from detent.identify.fit.output_error import fit_output_error
from detent.identify.fit.regression import fit_equations
from detent.logs.log import Log, Source

STEP, LOG = 1e-3, 25.0
REGRESSION_BAR, SIMULATION_BAR = 1.0, 20.0
"""Seconds of processor time for four constants, and for eight by simulation."""

TRUE = {"mass": 20.0, "viscous": 60.0, "coulomb": 9.0}


def made_log() -> Log:
    """To and fro by sines; the force is what a mass with friction needs, with some noise."""
    rng = np.random.default_rng(5)
    t = np.arange(round(LOG / STEP)) * STEP
    q = 0.05 * np.sin(2 * np.pi * 0.4 * t) + 0.01 * np.sin(2 * np.pi * 1.7 * t)
    v, a = np.gradient(q, STEP), np.gradient(np.gradient(q, STEP), STEP)
    force = TRUE["mass"] * a + TRUE["viscous"] * v + TRUE["coulomb"] * np.sign(v) + 0.3 * rng.normal(size=len(t))
    signals = {"position": np.round(q / 1e-6) * 1e-6, "reference": q, "force": force}
    units = {"time": "s", "position": "m", "reference": "m", "force": "N"}
    columns = {role: Source(role, unit, 1.0) for role, unit in units.items()}
    return Log("made", t, signals, units, columns, np.arange(1, len(t) + 1))


def start() -> Constants:
    """Eight constants to begin with, some way off."""
    names = ("mass", "coulomb.positive", "coulomb.negative", "viscous.positive", "viscous.negative")
    more = ("static.positive", "static.negative", "stribeck", "delay")
    values = np.array([16.0, 7.0, 11.0, 50.0, 75.0, 9.0, 13.0, 0.01, 0.0])
    return Constants((*names, *more), values, np.diag((0.1 * values) ** 2 + 1e-12), np.full(len(values), 10.0), "made")


def test_identifying_a_log_of_25_seconds(benchmark):
    """What limits it: the windows of the whole log, which every rung and every stretch use; the simulation test."""
    log = made_log()
    run = make_run(log)
    parts = choose_windows([run])
    kernel = make_kernel(round(WINDOW / STEP), STEP)
    found = identify([log])
    assert found.verdict == "trusted"

    def regression() -> int:
        fit_equations(parts, RUNGS[1].terms)
        return 1

    def windows() -> int:
        make_motion(run.position, run.effort, kernel, usable_rows(run, kernel))
        return 1

    def whole() -> int:
        identify([log])
        return 1

    def benchmark_recipe() -> int:
        fit_inverse_dynamics(run.t, run.position, run.effort)
        return 1

    def simulation() -> int:
        fit_output_error([run], start())
        return 1

    runs = {
        "windows": timed(windows),
        "four constants": timed(regression),
        "four constants by filtered derivatives": timed(benchmark_recipe),
        "the whole identification": timed(whole),
        "eight constants by simulation": timed(simulation),
    }
    race = Race(runs)
    if race.hold(benchmark, "four constants", 5):
        seconds = {name: value * 1e-9 for name, value in race.nanoseconds().items()}
        benchmark.extra_info |= {f"{name} [s]": round(value, 3) for name, value in seconds.items()}
        assert seconds["the whole identification"] < REGRESSION_BAR
        assert seconds["eight constants by simulation"] < SIMULATION_BAR
