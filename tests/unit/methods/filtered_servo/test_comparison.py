import json
import math
from functools import cache

import numpy as np
import pytest
from tests.filtered_servo_rig import COMMON, EXAMPLE, PLANT_B, current_per_count, plant_a

from detent.errors import DetentError
from detent.methods.filtered_servo.comparison import compare_feedback, feedback_variants
from detent.methods.load import load_spec

pytestmark = pytest.mark.compiled

NAMES = ["conventional", "with filter", "long window", "small multiplier"]


def make_spec(*overrides, plant=None):
    return load_spec(EXAMPLE, [*COMMON, *(plant_a() if plant is None else plant), *overrides])


def change(spec, **values):
    """An axis that its file could not describe: it breaks a rule on purpose."""
    return spec.model_copy(update={"method": spec.method.model_copy(update=values)})


@cache
def comparison(rate=1037.0, plant=None):
    return compare_feedback(make_spec(plant=plant), rate=rate)


def compared(rate=1037.0, plant=None):
    return {case.name: case for case in comparison(rate, plant).cases}


def test_the_variants_come_from_the_axis_itself():
    spec = make_spec("method.scale=6", "method.sample_period=3 ms", "method.coefficient=0.5")
    variants = feedback_variants(spec)
    assert list(variants) == NAMES
    assert variants["conventional"] == change(spec, filter="none")
    assert variants["with filter"] == spec
    assert variants["long window"] == change(spec, filter="none", scale=1, sample_period=6 * 3e-3, counter_bits=16)
    assert variants["small multiplier"] == change(spec, filter="none", scale=1)


@pytest.mark.parametrize(("stated", "used"), [("none", "float"), ("fixed", "fixed"), ("float", "float")])
def test_the_filter_is_that_of_the_file_if_it_has_one(stated, used):
    assert feedback_variants(make_spec(f"method.filter={stated}"))["with filter"].method.filter == used


def test_what_was_compared():
    found = comparison(plant=PLANT_B)
    assert (found.rate, [case.name for case in found.cases]) == (1037.0, NAMES)
    assert found.gain == pytest.approx(5329, rel=1e-3)
    assert found.tau_m == pytest.approx(56e-3)
    assert [(c.sample_period, c.scale, c.coefficient) for c in found.cases] == [
        (5e-3, 4, 1.0), (5e-3, 4, 0.25), (20e-3, 1, 1.0), (5e-3, 1, 1.0),
    ]  # fmt: skip
    assert [case.kv for case in found.cases] == pytest.approx([50, 50, 50, 200])


@pytest.mark.parametrize(
    ("name", "std_speed", "std_error"),
    [
        ("conventional", 1.62, 1.75),
        ("with filter", 0.335, 0.58),
        ("long window", 100, 170),
        ("small multiplier", 0.388, 0.56),
    ],
)
def test_ripple_on_the_ideal_plant(name, std_speed, std_error):
    case = compared()[name]
    assert case.std_speed == pytest.approx(std_speed, rel=0.1)
    assert case.std_error == pytest.approx(std_error, rel=0.1)


def test_the_filter_pays():
    conventional, filtered = compared()["conventional"], compared()["with filter"]
    assert conventional.std_error >= 2.5 * filtered.std_error
    assert conventional.std_speed >= 4 * filtered.std_speed
    assert conventional.force_ripple >= 2.5 * filtered.force_ripple
    # 35.2 mA per count, 0.05 N m/A, 5 mm per turn; the PWM takes the word over every 50 us.
    per_count = current_per_count(4000) * 0.05 / (5e-3 / (2 * math.pi))
    assert filtered.force_ripple == pytest.approx(per_count * filtered.std_error, rel=0.02)
    assert filtered.error_range == pytest.approx((-1.4, 0.8), abs=0.2)
    assert compared()["long window"].error_range == pytest.approx((-204, 204), abs=2)


@pytest.mark.parametrize(
    ("name", "std_speed", "std_error"), [("conventional", 1.60, 1.74), ("with filter", 0.35, 0.60)]
)
def test_ripple_with_back_emf(name, std_speed, std_error):
    case = compared(plant=PLANT_B)[name]
    assert case.std_speed == pytest.approx(std_speed, rel=0.1)
    assert case.std_error == pytest.approx(std_error, rel=0.1)
    assert not compared(plant=PLANT_B)["long window"].stable


@pytest.mark.parametrize(
    ("name", "least", "most"), [("conventional", 0, 1), ("with filter", 1, 2), ("small multiplier", 10, 12)]
)
def test_overshoot_when_the_command_stops(name, least, most):
    case = compared(1000.0)[name]
    assert case.stable
    assert least <= case.stop_overshoot <= most


def test_the_long_window_does_not_settle():
    case = compared(1000.0)["long window"]
    assert not case.stable
    assert math.isnan(case.stop_overshoot)


@pytest.mark.parametrize(
    ("plant", "limits"),
    [(None, (16_564, 10_216, 2_742, 43_865)), (PLANT_B, (17_802, 16_923, 4_044, 48_907))],
)
def test_limits_of_the_gain(plant, limits):
    gain = 4000 if plant is None else 5329
    for case, limit in zip(compared(plant=plant).values(), limits, strict=True):
        assert case.gain_limit == pytest.approx(limit, rel=0.005)
        assert case.gain_margin == pytest.approx(limit / gain, rel=0.006)
        assert case.stable == (case.gain_margin > 1)


def test_the_curves_show_the_end_of_the_steady_run():
    for case in compared().values():
        assert case.t.shape == case.error.shape == case.speed_word.shape
        assert (case.t[0], case.t[-1]) == pytest.approx((7.8, 8.0), abs=1e-4)
        assert case.error_range[0] <= case.error.min() <= case.error.max() <= case.error_range[1]
    assert set(np.unique(compared()["conventional"].speed_word)) <= {12.0, 16.0, 20.0, 24.0, 28.0}
    assert compared()["with filter"].speed_word.mean() == pytest.approx(20.74, abs=0.1)


def test_a_longer_window_gets_a_longer_run():
    found = compare_feedback(
        make_spec("method.sample_period=10 ms", "method.counter_bits=9", plant=plant_a(1000.0)), rate=100.0
    )
    assert found.cases[0].t[[0, -1]] == pytest.approx([15.6, 16.0], abs=1e-3)
    assert found.cases[1].stable


def test_a_gentle_command_is_at_its_rate_in_time():
    slow = compare_feedback(make_spec("method.command_acceleration=1 mm/s^2"))  # 5.2 s to the rate
    assert slow.cases[0].speed_word.mean() == pytest.approx(20.74, abs=0.1)
    assert slow.cases[1].std_error == pytest.approx(0.58, rel=0.1)


def test_the_rate_ends_at_the_limit_of_the_speed():
    found = compare_feedback(make_spec("limits.speed=2 mm/s"))
    assert found.rate == pytest.approx(400)
    assert found.cases[1].speed_word.mean() == pytest.approx(8, abs=0.1)


def test_disturbances_of_the_file_do_not_count():
    noise = ("disturbance.lines.inserted=100 Hz", "disturbance.lines.lost_samples=10 Hz")
    found = compare_feedback(make_spec(*noise))
    assert [case.std_error for case in found.cases] == [case.std_error for case in compared().values()]


def test_a_fault_is_a_failure_and_no_crash():
    found = compare_feedback(change(make_spec(), position_bits=7))  # 63 pulses: the long window swings by more
    conventional, _, window, _ = found.cases
    assert conventional.stable
    assert not window.stable
    for value in (window.std_speed, window.std_error, window.force_ripple, *window.error_range, window.stop_overshoot):
        assert math.isnan(value)
    assert len(window.t) == len(window.error) == len(window.speed_word) == 0
    assert window.gain_margin == pytest.approx(2742 / 4000, rel=0.005)
    assert found.to_dict()["cases"][2]["stable"] is False
    assert found.tau_m == math.inf


def test_an_axis_beyond_the_limit_of_its_gain_is_unstable():
    found = compare_feedback(make_spec(plant=plant_a(20_000.0)))
    assert [case.stable for case in found.cases] == [False, False, False, True]


def test_plain_data_for_json():
    found = comparison(plant=PLANT_B)
    data = json.loads(json.dumps(found.to_dict()))
    assert (data["rate"], data["gain"], data["tau_m"]) == (1037.0, found.gain, found.tau_m)
    filtered = data["cases"][1]
    assert filtered["name"] == "with filter"
    assert filtered["error_range"] == list(found.cases[1].error_range)
    assert {"t", "error", "speed_word"}.isdisjoint(filtered)


def test_progress_names_each_case():
    told = []
    compare_feedback(make_spec(), progress=lambda share, text: told.append((share, text)))
    assert told == [(k / 4, name) for k, name in enumerate(NAMES)]


@pytest.mark.parametrize("rate", [0.0, -1037.0, math.nan, math.inf])
def test_a_rate_that_is_none_is_refused(rate):
    with pytest.raises(DetentError, match=r"compare_feedback: rate: got .* pulses/s; expected: above 0 and finite"):
        compare_feedback(make_spec(), rate=rate)
