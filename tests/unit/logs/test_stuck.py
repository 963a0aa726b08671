"""Stuck sensors: runs of equal numbers that other signals contradict, and those that mean rest."""

import numpy as np
import pytest
from tests.synthetic_logs import Recording, clean, kinds, trapezoids

from detent.logs.log import Action, Kind, Severity


def swing(n=1500, seed=5):
    """An axis that swings without rest, with a noisy current."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) * 0.001
    x = 0.1 * np.sin(2 * np.pi * 1.7 * t) + 0.03 * np.sin(2 * np.pi * 5.1 * t)
    v = np.gradient(x, t)
    columns = {
        "time": t,
        "reference": np.interp(t + 0.004, t, x),
        "position": np.round(x / 1e-6) * 1e-6,
        "velocity": v + rng.normal(0, 0.002, n),
        "current": np.round(np.gradient(v, t) + 2 * np.sign(v) + rng.normal(0, 0.2, n), 2),
    }
    return Recording(columns)


def stuck_rows(recording, role, first, last):
    recording.columns[role][first:last] = recording.columns[role][first]
    return recording


def found(log, role):
    return [finding for finding in log.findings if (finding.kind, finding.signal) == (Kind.STUCK, role)]


@pytest.mark.parametrize("role", ["position", "velocity", "current"])
@pytest.mark.parametrize(("first", "last"), [(400, 470), (0, 90), (1400, 1500), (300, 800)])
def test_stuck_for_a_while(tmp_path, role, first, last):
    log = stuck_rows(swing(), role, first, last).read(tmp_path)
    (finding,) = found(log, role)
    assert (finding.action, finding.rows) == (Action.LEFT, ((first + 1, last),))
    assert "exclude these rows" in finding.advice
    assert log.mask(Kind.STUCK).sum() == last - first


@pytest.mark.parametrize("gone", [("velocity",), ("reference",), ("velocity", "current")])
def test_one_twin_is_enough(tmp_path, gone):
    recording = stuck_rows(swing(), "position", 500, 700)
    recording.columns = {role: values for role, values in recording.columns.items() if role not in gone}
    assert found(recording.read(tmp_path), "position")


def test_two_encoders_tell_on_one_another(tmp_path):
    recording = swing()
    recording.columns["position_load"] = recording.columns["position"] * 1.001
    del recording.columns["velocity"], recording.columns["reference"]
    stuck_rows(recording, "position_load", 500, 700)
    log = recording.read(tmp_path)
    assert [finding.rows for finding in found(log, "position_load")] == [((501, 700),)]


def test_without_a_twin_nothing_is_said(tmp_path):
    recording = stuck_rows(swing(), "position", 500, 700)
    recording.columns = {role: recording.columns[role] for role in ("time", "position", "current")}
    assert found(recording.read(tmp_path), "position") == []


def test_rest_is_no_stuck_sensor(tmp_path):
    rng = np.random.default_rng(2)
    t = np.arange(3000) * 0.001
    x = 0.02 * trapezoids(rng, t)
    columns = {"time": t, "position": np.round(x / 1e-5) * 1e-5, "velocity": np.round(np.gradient(x, t), 3)}
    columns["current"] = np.round(np.sign(np.gradient(x, t)), 1)
    assert kinds(Recording(columns).read(tmp_path)) == []


@pytest.mark.parametrize(("role", "action"), [("velocity", Action.LEFT_OUT), ("current", Action.LEFT_OUT)])
def test_never_recorded(tmp_path, role, action):
    recording = swing()
    recording.columns[role][:] = 0.0
    log = recording.read(tmp_path)
    (finding,) = found(log, role)
    assert (finding.action, finding.rows) == (action, ())
    assert "in each of 1500 rows" in finding.text
    assert role not in log.signals


def test_an_axis_that_stands(tmp_path):
    recording = swing()
    recording.columns = {"time": recording.columns["time"], "position": np.full(1500, 0.25)}
    log = recording.read(tmp_path)
    (finding,) = found(log, "position")
    assert (finding.action, finding.severity) == (Action.LEFT, Severity.ERROR)
    assert "position" in log.signals


@pytest.mark.parametrize(("level", "count"), [(0.0, 1), (40.0, 0)])
def test_a_command_may_be_constant_unless_it_is_zero(tmp_path, level, count):
    recording = swing()
    recording.columns["command"] = np.full(1500, level)
    log = recording.read(tmp_path)
    assert len(found(log, "command")) == count
    assert ("command" in log.signals) == (count == 0)


def test_temperatures_and_references_may_be_constant(tmp_path):
    recording = clean(3)
    recording.columns["temperature"] = np.full(recording.count, 20.0)
    recording.columns["reference"] = np.zeros(recording.count)
    assert found(recording.read(tmp_path), "temperature") == found(recording.read(tmp_path), "reference") == []
