"""Step response: closed forms come back with intervals that hold, and recordings of a real axis as published."""

import json

import numpy as np
import pytest
from scipy.optimize import brentq
from tests.log_rig import assert_covers, coloured, make_log, quantised
from tests.places import DATA

from detent.cli.terminal import print_json
from detent.errors import DetentError
from detent.identify.analyse.analyses import analyse
from detent.identify.analyse.ringing import find_turns, fit_ringing
from detent.identify.analyse.step_metrics import find_steps, fit_local_polynomial, measure_steps
from detent.logs.read_log import read_log

DUET = DATA / "duet_closed_loop_step/step16-stable-converged_first-97ms.csv"

DT = 1e-3
SIGMA, OMEGA = 20.0, 100.0
OFF = 3e-4
STILL = np.zeros(100)


def answer(t):
    """Unit step response of a second-order system."""
    return np.where(t > 0, 1 - np.exp(-SIGMA * t) * (np.cos(OMEGA * t) + SIGMA / OMEGA * np.sin(OMEGA * t)), 0.0)


def true_values(size=0.01):
    rest = size - OFF
    low, high = (brentq(lambda t, part=part: answer(np.array(t)) - part, 1e-6, np.pi / OMEGA) for part in (0.1, 0.9))
    return {
        "rise_time": high - low,
        "overshoot": rest * (1 + np.exp(-np.pi * SIGMA / OMEGA)) - size,
        "peak_time": np.pi / OMEGA,
        "rest_error": OFF,
        "ringing_period": 2 * np.pi / OMEGA,
        "damping_ratio": SIGMA / np.hypot(SIGMA, OMEGA),
    }


def record(rng, size=0.01, noise=2e-5, grain=1e-5):
    """A step at 0.1 s whose answer ends a little short of it."""
    t = np.arange(0.0, 0.6, DT)
    x = (size - np.sign(size) * OFF) * answer(t - 0.1)
    x = quantised(x + coloured(rng, len(t), noise, 0.6), grain)
    # The sample at 0.1 s is the last one before the step.
    return make_log(t, reference=np.where(t > 0.1 + DT / 2, size, 0.0), position=x)


def test_closed_forms_come_back():
    found = measure_steps(record(np.random.default_rng(1), noise=2e-6, grain=1e-7))
    (step,) = found.steps
    assert (found.unit, found.reason, found.notes, step.notes) == ("m", "", (), ())
    assert {one.name: one.value for one in step.estimates} == pytest.approx(true_values(), rel=0.01)
    assert (step.begin, step.duration, step.target - step.start) == pytest.approx((0.1, DT, 0.01))
    rest = 0.01 - OFF
    for settling, band in ((step.settling_2, 0.02), (step.settling_5, 0.05)):
        t = np.arange(0.0, 0.4, DT)
        outside = np.abs(rest * answer(t) - rest) > band * 0.01
        assert settling == pytest.approx(t[np.flatnonzero(outside)[-1] + 1], abs=1.5 * DT)
    assert step.ringing.log_decrement == pytest.approx(2 * np.pi * SIGMA / OMEGA, rel=0.02)
    assert step.ringing.swings[0] == pytest.approx(
        rest * np.exp(-np.pi * SIGMA / OMEGA) * (1 + np.exp(-np.pi * SIGMA / OMEGA)), rel=0.01
    )


@pytest.mark.wide
def test_intervals_hold_the_true_value_as_often_as_they_say():
    true = true_values()
    hits = {name: [] for name in true}
    for seed in range(200):
        (step,) = measure_steps(record(np.random.default_rng(seed))).steps
        for one in step.estimates:
            hits[one.name].append(one.holds(true[one.name]))
    for name in true:
        assert len(hits[name]) == 200, name
        assert_covers(hits[name])


def test_a_rest_on_one_count_is_as_uncertain_as_the_count():
    hits = []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        grain = rng.uniform(1e-5, 3e-5)
        (step,) = measure_steps(record(rng, noise=1e-7, grain=grain)).steps
        hits.append(step.rest_error.holds(OFF))
        assert step.rest_error.error >= 0.28 * grain
    # Rounding is even: within 1.96 standard deviations it lies always.
    assert all(hits)


def test_a_step_to_smaller_positions_overshoots_to_its_own_side():
    (down,) = measure_steps(record(np.random.default_rng(2), size=-0.01)).steps
    assert down.target - down.start == pytest.approx(-0.01)
    assert down.overshoot.value == pytest.approx(true_values()["overshoot"], rel=0.02)
    assert down.rest_error.value == pytest.approx(-OFF, rel=0.1)


def test_several_steps_and_small_ones():
    t = np.arange(0.0, 2.0, DT)
    reference = np.select([t < 0.1, t < 0.6, t < 1.1, t < 1.6, t < 1.605], [0.0, 0.01, 0.0101, -0.01, 0.0], 0.005)
    rng = np.random.default_rng(3)
    x = np.zeros(len(t))
    for at, size in ((0.1, 0.01), (0.6, 1e-4), (1.1, -0.0201), (1.6, 0.01), (1.605, 0.005)):
        x += size * answer(t - at)
    found = measure_steps(make_log(t, reference=reference, position=x + 1e-6 * rng.standard_normal(len(t))))
    assert [(round(step.start, 4), round(step.target, 4)) for step in found.steps] == [
        (0.0, 0.01), (0.0101, -0.01), (-0.01, 0.005),
    ]  # fmt: skip
    assert found.steps[2].duration == pytest.approx(0.006, abs=DT)
    assert found.notes == ("1 steps below 5% of the largest skipped",)
    assert [step.overshoot is not None for step in found.steps] == [True] * 3


def test_an_answer_without_overshoot_has_none():
    t = np.arange(0.0, 1.0, DT)
    x = np.where(t > 0.1, 1 - np.exp(-(t - 0.1) / 0.05), 0.0) + 1e-4 * np.random.default_rng(4).standard_normal(len(t))
    (step,) = measure_steps(make_log(t, reference=np.where(t > 0.1, 1.0, 0.0), position=x)).steps
    assert (step.overshoot, step.peak_time, step.ringing) == (None, None, None)
    assert step.rise_time.value == pytest.approx(0.05 * np.log(9), rel=0.02)
    assert step.settling_5 == pytest.approx(0.05 * np.log(20), abs=2 * DT)


def test_an_axis_that_does_not_settle_is_said(capsys: pytest.CaptureFixture[str]):
    t = np.arange(0.0, 1.0, DT)
    x = np.where(t > 0.1, 1 - np.cos(60 * (t - 0.1)), 0.0)
    log = make_log(t, reference=np.where(t > 0.1, 1.0, 0.0), position=x)
    (step,) = measure_steps(log).steps
    assert np.isinf(step.settling_2)
    assert "not settled" in step.notes[0]
    assert step.ringing is None
    print_json(analyse(log, "steps").to_dict())
    assert json.loads(capsys.readouterr().out)["steps"][0]["settling_2"] is None
    rest = measure_steps(make_log(t, reference=np.where(t > 0.1, 1.0, 0.0), position=0 * t)).steps[0]
    assert (rest.rise_time, rest.overshoot) == (None, None)
    assert rest.rest_error.value == 1.0


def test_few_samples_give_coarse_numbers_and_no_error():
    t = np.arange(0.0, 0.6, 8e-3)
    x = quantised(answer(t - 0.1), 0.01)
    (step,) = measure_steps(make_log(t, reference=np.where(t > 0.1, 1.0, 0.0), position=x)).steps
    assert step.overshoot.method == "parabola through three samples"
    assert step.peak_time.holds(np.pi / OMEGA + 0.1 - step.begin)
    assert step.overshoot.holds(np.exp(-np.pi * SIGMA / OMEGA))
    assert step.rise_time.holds(true_values()["rise_time"])
    assert step.rise_time.error > 2e-4


def test_what_holds_no_step_has_a_reason():
    t = np.arange(0.0, 1.0, DT)
    assert "no step" in measure_steps(make_log(t, reference=np.sin(t), position=np.sin(t))).reason
    assert "no step" in measure_steps(make_log(t, reference=0 * t, position=t)).reason
    late = np.where(t > t[-12], 1.0, 0.0)
    found = measure_steps(make_log(t, reference=late, position=late))
    assert "followed by rest" in found.reason
    assert "skipped" in found.notes[0]
    assert find_steps(np.r_[np.zeros(20), 1.0, np.zeros(20)]) == []


def test_wrong_input_is_an_error():
    t = np.arange(0.0, 1.0, DT)
    with pytest.raises(DetentError, match="reference=COLUMN"):
        measure_steps(make_log(t, position=t))
    with pytest.raises(DetentError, match="a position in count and a reference in m"):
        measure_steps(make_log(t, {"position": "count"}, position=t, reference=t))


def test_turning_points_and_records_that_do_not_ring():
    assert find_turns(np.array([0.0, 3.0, 1.0, 1.1, 0.9, 2.0, 1.9]), 0.5).tolist() == [0, 1, 4]
    t = np.arange(0.0, 1.0, 1e-2)
    assert fit_ringing(t, np.exp(-t), 0.01, STILL) is None
    assert fit_ringing(t, np.exp(t) * np.cos(40 * t), 0.01, STILL) is None
    assert fit_ringing(t[:7], np.array([1.0, -0.9, 0.8, -0.7, 0.1, 0.1, 0.1]), 0.05, STILL) is None


def test_a_polynomial_about_a_place():
    t = np.linspace(0.0, 1.0, 21)
    fit = fit_local_polynomial(t, 2 - (t - 0.3) ** 2, 0.5, STILL)
    assert fit.summit() == pytest.approx(-0.2)
    assert (fit.at(0.0), fit.at(0.0, 1), fit.at(0.0, 2)) == pytest.approx((1.96, -0.4, -2.0))
    assert fit.solve(1.96) == pytest.approx(0.0, abs=1e-9)
    assert fit.solve(9.0) == 0.0
    assert fit.error_at(0.0) < 1e-9
    assert fit_local_polynomial(t[:4], t[:4], 0.0, STILL) is None


@pytest.mark.skipif(not DUET.exists(), reason="the recordings of real machines (../shared/data) are not here")
def test_a_closed_loop_stepper():
    """Published with the recording: overshoot 1.65 steps, ring period about 30 ms, rests 0.47 step off."""
    found = measure_steps(read_log(DUET))
    (step,) = found.steps
    assert (found.unit, round(step.target - step.start, 2)) == ("count", -16.0)
    assert step.overshoot.holds(1.65)
    assert step.overshoot.value == pytest.approx(1.65, abs=0.06)
    assert step.rest_error.value == pytest.approx(-0.47, abs=0.01)
    assert step.ringing.period.value == pytest.approx(0.028, abs=0.003)
    # The published figure lies within; one and a half swings tell the period to a fifth.
    assert step.ringing.period.holds(0.030)
    assert step.ringing.period.high - step.ringing.period.low < 0.4 * 0.030
    assert 0.1 < step.ringing.damping_ratio.value < 0.3
    assert step.ringing.log_decrement == pytest.approx(2 * np.log(2.60 / 1.36), rel=0.02)
    assert step.peak_time.value == pytest.approx(0.0213, abs=0.0005)
    assert 0.05 < step.settling_2 < 0.06
