"""Signs and units of signals that say the same motion."""

import math

import numpy as np
import pytest
from tests.synthetic_logs import Recording, kinds

from detent.logs.log import Action, Kind, Severity

N = 2000
T = np.arange(N) * 0.001


def recording(**changes):
    rng = np.random.default_rng(1)
    x = 0.05 * np.cumsum(np.convolve(rng.normal(size=N + 200), np.hanning(200), "same")[100:-100]) / 200
    v = np.gradient(x, T)
    columns = {
        "time": T,
        "reference": np.interp(T + 0.005, T, x),
        "position": np.round(x / 1e-7) * 1e-7,
        "position_load": np.round(x / 2e-7) * 2e-7,
        "velocity": v + rng.normal(0, 0.01 * np.std(v), N),
        "acceleration": np.gradient(v, T) + 9.81,
    }
    for role, change in changes.items():
        columns[role] = change(columns[role])
    return Recording(columns)


def only(log):
    (finding,) = log.findings
    return finding


def test_a_good_recording(tmp_path):
    assert recording().read(tmp_path).findings == ()


@pytest.mark.parametrize("role", ["velocity", "acceleration", "reference", "position_load"])
def test_wrong_signs_are_turned(tmp_path, role):
    log = recording(**{role: np.negative}).read(tmp_path)
    finding = only(log)
    assert (finding.kind, finding.signal, finding.action) == (Kind.WRONG_SIGN, role, Action.TURNED)
    assert finding.severity == Severity.ERROR
    assert log.signals[role] == pytest.approx(recording().columns[role])
    assert log.columns[role].factor == -1.0


def test_a_position_of_the_wrong_sign_turns_all_others(tmp_path):
    log = recording(position=np.negative).read(tmp_path)
    assert kinds(log) == [("wrong sign", role) for role in ("velocity", "acceleration", "reference", "position_load")]
    assert "if the velocity was right, invert the position: position=-COLUMN" in log.findings[0].advice


@pytest.mark.parametrize(
    ("role", "factor", "words"),
    [
        ("velocity", 1000.0, "mm for m"),
        ("velocity", 1e-3, "the reverse of thousandths"),
        ("velocity", 60e3, "mm/min"),
        ("velocity", 100.0, "cm for m"),
        ("velocity", 60.0, "minutes for seconds"),
        ("velocity", 4.0, "four edges"),
        ("velocity", 25.4 / 1000, "the reverse of inches for m"),
        ("acceleration", 1 / 9.80665, "g for m/s^2"),
        ("reference", 1000.0, "mm for m"),
        ("reference", 25.4, "the reverse of inches for mm"),
        ("position_load", 1e-3, "the reverse of thousandths"),
    ],
)
def test_known_factors_are_taken_out(tmp_path, role, factor, words):
    log = recording(**{role: lambda values: values * factor}).read(tmp_path)
    finding = only(log)
    assert (finding.kind, finding.signal, finding.action) == (Kind.WRONG_UNIT, role, Action.CONVERTED)
    assert words in finding.text
    true = recording().columns[role]
    assert log.signals[role] == pytest.approx(true, rel=1e-9, abs=1e-9 * np.ptp(true))


@pytest.mark.parametrize(
    ("role", "factor", "words"),
    [
        ("velocity", 180 / math.pi, "degrees for radians"),
        ("velocity", 60 / math.tau, "revolutions per minute"),
        ("acceleration", math.tau, "the reverse of turns for radians"),
        ("reference", 180 / math.pi, "degrees for radians"),
        ("position_load", 360.0, "degrees for turns"),
    ],
)
def test_known_factors_of_an_axis_that_turns(tmp_path, role, factor, words):
    turning = recording(**{role: lambda values: values * factor})
    for name in ("reference", "position", "position_load", "velocity", "acceleration"):
        turning.headings[name] = turning.headings[name].replace("[m", "[rad")
    finding = only(turning.read(tmp_path))
    assert (finding.kind, finding.signal, finding.action) == (Kind.WRONG_UNIT, role, Action.CONVERTED)
    assert words in finding.text


def test_degrees_are_no_matter_of_an_axis_that_moves_straight(tmp_path):
    log = recording(velocity=lambda values: values * 180 / math.pi).read(tmp_path)
    assert only(log).action == Action.LEFT or "minutes for seconds" in only(log).text


def test_sign_and_factor_together(tmp_path):
    log = recording(velocity=lambda values: -1000 * values).read(tmp_path)
    assert kinds(log) == [("wrong sign", "velocity"), ("wrong unit", "velocity")]
    assert log.signals["velocity"] == pytest.approx(recording().columns["velocity"])


@pytest.mark.parametrize("factor", [3.0, 0.5, 17.0])
def test_unknown_factors_are_told_and_left(tmp_path, factor):
    log = recording(velocity=lambda values: values * factor).read(tmp_path)
    finding = only(log)
    assert (finding.kind, finding.action) == (Kind.WRONG_UNIT, Action.LEFT)
    assert float(finding.text.split()[1]) == pytest.approx(factor, rel=1e-3)
    assert "times d(position)/dt, no known ratio of units" in finding.text


@pytest.mark.parametrize(
    ("role", "factor"), [("velocity", 1.15), ("velocity", 0.85), ("reference", 3.0), ("reference", 1.2)]
)
def test_small_deviations_and_weak_loops_are_none(tmp_path, role, factor):
    assert recording(**{role: lambda values: values * factor}).read(tmp_path).findings == ()


def test_a_guessed_unit_of_time_is_suspected_first(tmp_path):
    wrong = recording(velocity=lambda values: 1000 * values)
    wrong.headings["time"] = "t"
    finding = only(wrong.read(tmp_path))
    assert (finding.kind, finding.action) == (Kind.WRONG_UNIT, Action.LEFT)
    assert "state the units of velocity, position and time" in finding.advice


def test_signals_of_another_kind_of_motion_are_not_compared(tmp_path):
    log = recording(velocity=lambda values: -3 * values).read(tmp_path, options=["velocity=velocity [rad/s]"])
    assert log.findings == ()


def test_a_position_that_hardly_moves_proves_nothing(tmp_path):
    still = recording(position=lambda values: np.round(values / 1e-7) * 0 + np.tile([0, 1e-7], N // 2))
    assert ("wrong sign", "velocity") not in kinds(still.read(tmp_path))


def test_a_velocity_that_has_nothing_to_do_with_the_position(tmp_path):
    rng = np.random.default_rng(9)
    noisy = recording()
    for role in ("velocity", "acceleration"):
        noisy.columns[role] = rng.normal(size=N)
    assert noisy.read(tmp_path).findings == ()


def test_half_a_period_of_delay_is_no_wrong_sign(tmp_path):
    x = np.sin(2 * np.pi * T * 10)
    log = Recording({"time": T, "reference": np.sin(2 * np.pi * 10 * (T + 0.03)), "position": x}).read(tmp_path)
    assert ("wrong sign", "reference") not in kinds(log)


def test_while_the_drive_is_off_a_reference_says_nothing(tmp_path):
    swing = recording()
    off = slice(N // 2, N)
    swing.columns["reference"][off] = -5 * swing.columns["position"][off]
    swing.columns["torque enable"] = (np.arange(N) < N // 2).astype(float)
    swing.headings["torque enable"] = "torque enable"
    assert swing.read(tmp_path).findings == ()
