"""Identification of recorded axes: a servo that lifts a pendulum, and a motor sampled ten times a second.

The recordings are not part of the project; where they are not at hand, their tests are skipped. What is known of them
stands in the SOURCE.md beside each.
"""

import gzip
import json
from pathlib import Path

import numpy as np
import pytest
from tests.places import DATA

from detent.identify.fit.constants import Constants, constants_of
from detent.identify.fit.equations import Run, make_run
from detent.identify.fit.free_run import Plant
from detent.identify.fit.identification import Identification, choose_windows, identify
from detent.identify.fit.ladder import RUNGS, extended
from detent.identify.fit.output_error import cut_stretches, fit_output_error
from detent.identify.fit.regression import fit_equations
from detent.logs.read_log import read_log

SERVOS = DATA / "servo_pendulum_bam" / "xl330"
MOTORS = DATA / "arduino_dc_motor"

pytestmark = pytest.mark.compiled

SERVO_COLUMNS = ("position=position [rad]", "reference=goal_position [rad]", "velocity=")


@pytest.fixture(scope="module")
def servos() -> dict[bool, list[Path]]:
    """Recordings at gains of 100 and 200 (False), and at 400 (True)."""
    if not SERVOS.exists():
        pytest.skip("the recordings are not at hand")
    found: dict[bool, list[Path]] = {False: [], True: []}
    for path in sorted(SERVOS.glob("*.json.gz")):
        with gzip.open(path) as file:
            found[json.load(file)["kp"] == 400].append(path)
    return found


@pytest.fixture(scope="module")
def lifted(servos: dict[bool, list[Path]]) -> Identification:
    """What the default way makes of the eight recordings at low gain, and simulation makes of that."""
    logs = [read_log(path, options=SERVO_COLUMNS) for path in servos[False]]
    return identify(logs, method="output error")


def errors_over_two_seconds(constants: Constants, runs: list[Run]) -> np.ndarray:
    """Simulated less recorded angle [rad] of all stretches in which the drive is on."""
    plant_of = {run.name: Plant(constants, run.step) for run in runs}
    missed = []
    for s in cut_stretches(runs, 2.0):
        q = s.run.position[s.begin : s.begin + s.samples]
        missed.append(plant_of[s.run.name].run(s.run.effort, s.begin, s.samples, float(q[0]), s.velocity) - q)
    return np.concatenate(missed)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def test_a_servo_with_a_pendulum_loses_a_share_of_its_torque(lifted: Identification):
    """A pendulum of 0.49 kg at 0.1 m; its gear carries much of it by friction, which grows with the load."""
    assert lifted.rung is not None
    assert lifted.rung.name == "loss"
    assert "pendulum" in lifted.rung.terms
    assert lifted.constants is not None
    assert 0.3 < lifted.constants.value("loss") < 0.95


def test_a_loss_that_six_seconds_do_not_tell(servos: dict[bool, list[Path]]):
    """60 windows: a loss of 0.81 left a mass of 2.3 +- 3.8 s^2/rad, and Coulomb friction of 5.9 +- 14 was trusted.

    Parts of the same log say 85 to 105.
    """
    (path,) = (path for path in servos[False] if "28m10" in path.name)
    found = identify([read_log(path, options=SERVO_COLUMNS)])
    assert found.rung is not None
    assert found.rung.name != "loss"
    assert all(e.holds(95.0) for e in found.estimates if e.name.startswith("coulomb"))


def test_gains_of_100_and_200_predict_400(servos: dict[bool, list[Path]], lifted: Identification):
    """At most 0.8 times the error of a Coulomb-viscous model, which has had the same fit by simulation."""
    unseen = [make_run(read_log(path, options=SERVO_COLUMNS)) for path in servos[True]]
    parts = choose_windows(lifted.runs)
    plain = extended(RUNGS[1], ("pendulum",))
    start = constants_of(fit_equations(parts, plain.terms))
    viscous = fit_output_error(lifted.runs, start, 1.5)
    assert lifted.constants is not None
    ours, theirs = (rms(errors_over_two_seconds(c, unseen)) for c in (lifted.constants, viscous))
    assert 0.02 < ours < 0.09, "rad; an encoder of 12 bits has steps of 0.0015 rad"
    assert ours < 0.8 * theirs, f"{ours:.4f} rad against {theirs:.4f} rad"


@pytest.mark.parametrize(
    "name", ["exp1.csv", "expdata_20201120_214756.csv", "expdata_20201120_215727.csv", "expdata_20201120_220230.csv"]
)
def test_a_motor_sampled_slowly_gives_friction_and_no_mass(name: str):
    """Ramps of 100 s tell nothing of a mass that follows within 0.2 s; its refusal does not take the rest along."""
    if not MOTORS.exists():
        pytest.skip("the recordings are not at hand")
    found = identify([read_log(MOTORS / name, options=["command=-inputSignal"])])
    assert found.verdict == "partly trusted"
    trusted = {e.name: e.value for e in found.trusted}
    assert "mass" not in trusted
    assert 120 < trusted["coulomb.positive"] < 165, "of 255 counts of the duty cycle"
    assert 120 < trusted["coulomb.negative"] < 165


def test_motor_constants_agree_between_logs():
    """Four runs of one motor on four days at three sample rates: constants per direction lie in each other's limits."""
    if not MOTORS.exists():
        pytest.skip("the recordings are not at hand")
    names = ("exp1.csv", "expdata_20201120_214756.csv", "expdata_20201120_215727.csv")
    found = [identify([read_log(MOTORS / name, options=["command=-inputSignal"])]) for name in names]
    for constant in ("coulomb.positive", "viscous.positive"):
        limits = [next(e for e in f.estimates if e.name == constant) for f in found]
        assert max(e.low for e in limits) < min(e.high for e in limits) * 1.1


def test_a_sign_against_the_motion_is_refused():
    if not MOTORS.exists():
        pytest.skip("the recordings are not at hand")
    found = identify([read_log(MOTORS / "exp1.csv")])
    assert found.verdict == "refused"
    assert any(r.subject == "wrong sign" for r in found.refusals)
