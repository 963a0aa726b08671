"""One move in four variants: what feedforward and a jerk limit bring, and what is left out of the comparison."""

import math

import numpy as np
import pytest

import detent
from detent.methods.cascade.comparison import FEEDS, SHAPES, compare_profiles, smooth_jerk
from detent.methods.load import load_spec

pytestmark = pytest.mark.compiled


def linear(*overrides):
    return load_spec(detent.example("cascade.toml"), overrides)


@pytest.fixture(scope="module")
def found():
    return compare_profiles(linear())


def test_four_cases_by_shape_then_by_feed_forward(found):
    assert [(case.shape, case.feed) for case in found.cases] == [(shape, feed) for shape in SHAPES for feed in FEEDS]
    assert found.way == 0.25
    assert found.stated
    assert found.jerk == 200.0


def test_without_feed_forward_the_axis_lags_by_its_speed_over_its_gain(found):
    spec = linear()
    for case in found.cases:
        if case.feed == FEEDS[0]:
            assert case.peak_following == pytest.approx(spec.limits.speed / spec.method.position_gain, rel=0.01)
        else:
            assert case.peak_following < 1e-4


def test_a_limited_jerk_takes_a_ramp_more_and_leaves_less_twist(found):
    trapezoid, jerk = found.cases[1], found.cases[3]
    assert jerk.duration - trapezoid.duration == pytest.approx(5.0 / 200.0, abs=1e-3)
    assert jerk.twist_after < 0.3 * trapezoid.twist_after
    assert trapezoid.speed.max() == pytest.approx(0.5)


def test_an_axis_without_a_jerk_gets_one_whose_ramp_is_a_swing():
    turning = load_spec(detent.example("turntable.toml"))
    assert 1 / turning.swing == pytest.approx(math.sqrt(900 / 0.12) / math.tau)
    assert turning.limits.acceleration / smooth_jerk(turning) == pytest.approx(turning.swing)


def test_a_rigid_axis_has_no_twist():
    spec = linear()
    rigid = spec.model_copy(update={"mechanics": spec.mechanics.model_copy(update={"coupling": None})})
    rigid = rigid.model_copy(update={"limits": spec.limits.model_copy(update={"jerk": None})})
    assert rigid.swing == 0.0
    assert smooth_jerk(rigid) == pytest.approx(5.0 / (0.25 * 0.1))
    found = compare_profiles(rigid)
    assert not found.stated
    assert all(math.isnan(case.twist_after) for case in found.cases)
    assert all(not case.twist.any() for case in found.cases)


def test_disturbances_are_left_out(found):
    push = ("disturbance.push.force=-300 N", "disturbance.push.at=0.2 s", "disturbance.push.duration=1 s")
    pushed = compare_profiles(linear(*push))
    assert all(np.array_equal(a.following, b.following) for a, b in zip(found.cases, pushed.cases, strict=True))


def test_plain_data_holds_no_curves_and_progress_is_told():
    told = []
    data = compare_profiles(linear(), progress=lambda share, text: told.append((share, text))).to_dict()
    assert set(data["cases"][0]) == {
        "shape", "feed", "duration", "peak_following", "approach", "twist_after", "peak_command",
    }  # fmt: skip
    assert [share for share, _ in told] == [0.25, 0.5, 0.75, 1.0]
    assert told[0][1] == "trapezoid, no feedforward"
