from dataclasses import replace

import numpy as np
import pytest
from tests.unit.methods.stepper_envelope.samples import MM, jerk_comparison

from detent import examples
from detent.methods.load import read_axis
from detent.methods.stepper_envelope.jerk_comparison import JerkComparison, Profile, compare_jerk

pytestmark = pytest.mark.compiled

ZOOM = next(path for path in examples() if path.name == "zoom.toml")


@pytest.fixture(scope="module")
def spec():
    return read_axis(ZOOM).spec


def test_both_profiles_go_the_same_way_within_the_same_limits(spec):
    found = compare_jerk(spec)
    assert found.motor == "group_a"
    assert found.way == pytest.approx(0.04)
    for profile in (found.envelope, found.smooth):
        assert (np.diff(profile.t) >= 0).all()
        assert profile.speed.max() <= found.speed * (1 + 1e-9)
    smooth, steps = found.smooth, found.envelope
    assert np.trapezoid(smooth.speed, smooth.t) == pytest.approx(found.way, rel=1e-5)
    assert np.sum(np.diff(steps.t) * steps.speed[:-1]) == pytest.approx(found.way, rel=1e-9)
    # 8000 steps without zones: 2.0839 s (acceptance test 2); the smooth one has to begin at standstill.
    assert found.envelope.seconds == pytest.approx(2.0837, abs=1e-3)
    assert found.envelope.seconds < found.smooth.seconds < 1.05 * found.envelope.seconds
    assert found.to_dict()["jerk"] == found.jerk


def test_the_smooth_profile_keeps_to_acceleration_and_jerk(spec):
    found = compare_jerk(spec, "group_b")
    t, speed = found.smooth.t, found.smooth.speed
    acceleration = np.diff(speed) / np.diff(t)
    assert np.abs(acceleration).max() <= found.acceleration * (1 + 1e-6)
    jerk = np.diff(acceleration) / np.diff(t)[1:]
    assert np.abs(jerk).max() <= found.jerk * (1 + 1e-6)


# ---- what is shown of it, made up


def charts_of(found: JerkComparison) -> list[dict]:
    return [chart for figure in found.figures() for chart in figure.charts]


def test_both_profiles_are_drawn_over_the_whole_way_and_both_ends() -> None:
    whole, begin, end = charts_of(jerk_comparison())
    assert (whole["x"][0], whole["x"][-1]) == (0.0, 2.1)
    assert whole["xLabel"] == "time since the start signal [s]"
    assert (begin["x"][0], begin["x"][-1]) == (0.0, pytest.approx(130.0))
    assert (end["x"][0], end["x"][-1]) == (pytest.approx(1970.0), 2100.0)
    assert whole["yRange"] == begin["yRange"] == end["yRange"] == [0.0, 23.0]
    assert [series["label"] for series in whole["series"]] == ["jerk limited", "envelope"]
    # The envelope begins with a step of its own, the profile at standstill.
    assert (begin["series"][1]["y"][0], begin["series"][0]["y"][0]) == (2.0, 0.0)


def test_a_profile_ends_with_its_last_point() -> None:
    *_, end = charts_of(jerk_comparison())
    smooth, envelope = (series["y"] for series in end["series"])
    assert smooth[-1] is not None
    assert envelope[-1] is None
    last = max(row for row, value in enumerate(envelope) if value is not None)
    assert end["x"][last] == pytest.approx(2080.0, abs=0.5)
    assert envelope[last] == 0.0


def test_steps_hold_and_profiles_change_evenly() -> None:
    found, t = jerk_comparison(), np.array([0.05, 1.0])
    assert found.smooth.at(t).tolist() == pytest.approx([10 * MM, 20 * MM])
    assert found.envelope.at(t).tolist() == pytest.approx([2 * MM, 20 * MM])


def test_a_short_way_is_magnified_to_its_half() -> None:
    t = np.array([0.0, 0.05, 0.1])
    short = Profile(t, np.array([0.0, 5 * MM, 0.0]))
    assert replace(jerk_comparison(), envelope=short, smooth=short).magnified == 0.05


def test_which_is_longer_and_by_how_much_is_told() -> None:
    found = jerk_comparison()
    whole, ends = found.figures()
    assert "0.96\u202f% longer" in whole.caption
    assert ends.beside
    swapped = replace(found, envelope=found.smooth, smooth=found.envelope)
    assert "0.95\u202f% shorter" in swapped.figures()[0].caption


def test_the_table_of_the_profiles_says_how_much_longer() -> None:
    title, heads, rows = jerk_comparison().table
    assert title == "Motor x: 40 mm without zones, limits 20 mm/s, 200 mm/s^2, 54.8 m/s^3"
    assert len(heads) == 4
    assert rows == [
        ("envelope", "2.08 s", "", "20 mm/s"),
        ("time-optimal, jerk limited (ruckig)", "2.1 s", "+20.0 ms, +1.0%", "20 mm/s"),
    ]
