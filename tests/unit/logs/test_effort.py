"""Efforts against the motion they make: a wrong sign, a lost sign, and what is neither."""

import numpy as np
import pytest
from tests.synthetic_logs import Recording, kinds

from detent.logs.log import Action, Kind, Severity

N = 3000
T = np.arange(N) * 0.001


def axis(mass=2.0, viscous=3.0, coulomb=1.0, gravity=0.0, noise=0.1, seed=1):
    """An axis moved about, and the force that this takes."""
    rng = np.random.default_rng(seed)
    x = 0.4 * np.convolve(rng.normal(size=N + 400), np.hanning(400), "same")[200:-200] / 400**0.5
    v = np.gradient(x, T)
    force = mass * np.gradient(v, T) + viscous * v + coulomb * np.sign(v) + gravity
    return {"time": T, "position": np.round(x / 1e-7) * 1e-7, "force": force + rng.normal(0, noise * np.std(force), N)}


def read(folder, columns, options=()):
    return Recording(columns).read(folder, options=options)


@pytest.mark.parametrize(
    "kind",
    [
        {},
        {"mass": 0.0},
        {"viscous": 0.0, "coulomb": 0.0},
        {"gravity": 30.0},
        {"noise": 1.0},
    ],
)
def test_right_signs_are_left_alone(tmp_path, kind):
    assert kinds(read(tmp_path, axis(**kind))) == []


@pytest.mark.parametrize(
    "kind", [{}, {"mass": 0.0}, {"viscous": 0.0, "coulomb": 0.0}, {"gravity": 30.0}, {"noise": 0.8}, {"gravity": -3.0}]
)
@pytest.mark.parametrize("turned", ["force", "position"])
def test_wrong_signs_are_told_and_left(tmp_path, kind, turned):
    columns = axis(**kind)
    columns[turned] = -columns[turned]
    log = read(tmp_path, columns)
    (finding,) = [finding for finding in log.findings if finding.severity != Severity.NOTE]
    assert (finding.kind, finding.signal, finding.action) == (Kind.WRONG_SIGN, "force", Action.LEFT)
    assert finding.severity == Severity.ERROR
    assert "force=-COLUMN" in finding.advice
    assert (log.signals["force"] == columns["force"]).all()


def test_turning_it_by_an_option_is_the_cure(tmp_path):
    columns = axis()
    columns["force"] = -columns["force"]
    assert kinds(read(tmp_path, columns, ["force=-force"])) == []


@pytest.mark.parametrize("role", ["current", "voltage", "command"])
def test_other_efforts_are_judged_alike(tmp_path, role):
    columns = axis()
    columns[role] = -0.5 * columns.pop("force") * (1 if role == "current" else 10)
    assert kinds(read(tmp_path, columns)) == [("wrong sign", role)]


def test_gaps_and_uneven_stamps_do_not_matter(tmp_path):
    rng = np.random.default_rng(2)
    columns = axis()
    columns["force"] = -columns["force"]
    keep = np.ones(N, dtype=bool)
    keep[700:720] = keep[1500:1600] = False
    columns = {role: values[keep] for role, values in columns.items()}
    columns["time"] = columns["time"] + rng.uniform(-2e-4, 2e-4, keep.sum())
    assert ("wrong sign", "force") in kinds(read(tmp_path, columns))


def test_an_effort_without_its_sign(tmp_path):
    columns = axis(mass=0.1, coulomb=0.3)
    columns["command"] = np.round(np.abs(columns.pop("force")) * 30)
    log = read(tmp_path, columns)
    (finding,) = [finding for finding in log.findings if finding.kind == Kind.LOST_SIGN]
    assert (finding.signal, finding.action, finding.severity) == ("command", Action.LEFT, Severity.ERROR)
    assert "never negative" in finding.text


def test_a_load_that_always_pulls_is_no_lost_sign(tmp_path):
    assert kinds(read(tmp_path, axis(gravity=40.0, viscous=10.0))) == []


def test_too_little_motion_proves_nothing(tmp_path):
    columns = axis()
    still = {"time": T[:40], "position": columns["position"][:40], "force": -columns["force"][:40]}
    assert kinds(read(tmp_path, still)) == []
    columns["position"] = np.round(columns["position"] * 0 + np.tile([0, 0, 1], N // 3)) * 1e-6
    assert ("wrong sign", "force") not in kinds(read(tmp_path, columns))
