from dataclasses import replace

import numpy as np
import pytest
from tests.unit.methods.stepper_envelope.samples import MM, jerk_comparison

from detent.methods.stepper_envelope.comparison import Profile
from detent.methods.stepper_envelope.stage_jerk import jerk_charts, magnified, speed_at


def test_both_profiles_are_drawn_over_the_whole_way_and_both_ends() -> None:
    whole, begin, end = jerk_charts(jerk_comparison())
    assert (whole["x"][0], whole["x"][-1]) == (0.0, 2.1)
    assert whole["xLabel"] == "time since the start signal [s]"
    assert (begin["x"][0], begin["x"][-1]) == (0.0, pytest.approx(130.0))
    assert (end["x"][0], end["x"][-1]) == (pytest.approx(1970.0), 2100.0)
    assert whole["yRange"] == begin["yRange"] == end["yRange"] == [0.0, 23.0]
    assert [series["label"] for series in whole["series"]] == ["jerk limited", "envelope"]
    # The envelope begins with a step of its own, the profile at standstill.
    assert (begin["series"][1]["y"][0], begin["series"][0]["y"][0]) == (2.0, 0.0)


def test_a_profile_ends_with_its_last_point() -> None:
    *_, end = jerk_charts(jerk_comparison())
    smooth, envelope = (series["y"] for series in end["series"])
    assert smooth[-1] is not None
    assert envelope[-1] is None
    last = max(row for row, value in enumerate(envelope) if value is not None)
    assert end["x"][last] == pytest.approx(2080.0, abs=0.5)
    assert envelope[last] == 0.0


def test_steps_hold_and_profiles_change_evenly() -> None:
    found, t = jerk_comparison(), np.array([0.05, 1.0])
    assert speed_at(found.smooth, t).tolist() == pytest.approx([10 * MM, 20 * MM])
    assert speed_at(found.envelope, t, step=True).tolist() == pytest.approx([2 * MM, 20 * MM])


def test_a_short_way_is_magnified_to_its_half() -> None:
    t = np.array([0.0, 0.05, 0.1])
    short = Profile(t, t * MM, np.array([0.0, 5 * MM, 0.0]))
    assert magnified(replace(jerk_comparison(), envelope=short, smooth=short)) == 0.05
