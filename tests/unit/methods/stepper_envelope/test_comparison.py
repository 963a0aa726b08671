import numpy as np
import pytest

from detent import examples
from detent.errors import DetentError
from detent.methods.load import read_axis
from detent.methods.stepper_envelope.comparison import compare_jerk, compare_steps

pytestmark = pytest.mark.compiled

ZOOM = next(path for path in examples() if path.name == "zoom.toml")


@pytest.fixture(scope="module")
def spec():
    return read_axis(ZOOM).spec


@pytest.fixture(scope="module")
def found(spec):
    return compare_steps(spec)


def test_each_motor_has_each_method_over_each_way(found):
    a, b = found
    assert (a.motor, a.ways) == ("group_a", (100, 500, 2000, 8000))
    assert (b.motor, b.ways) == ("group_b", (100, 500, 2000))
    assert a.methods[0] == "envelope"
    assert all(len(row) == len(a.ways) for row in a.courses)
    assert a.to_dict()["methods"]["envelope"][0]["lost"] == 0


def test_times_are_those_of_the_specification(found):
    """Those of acceptance test 16."""
    a = found[0]
    envelope, constant = a.seconds(0), a.seconds(a.methods.index("start frequency"))
    assert envelope[:3] == pytest.approx([0.0841, 0.2089, 0.5839], abs=5e-4)
    assert constant == pytest.approx(np.array(a.ways) / 400, rel=1e-3)
    assert (constant[:3] / envelope[:3]).round(1).tolist() == [3.0, 6.0, 8.6]


def test_without_zones_recomputation_makes_the_same_motion(found):
    a = found[0]
    for name in ("A: braking distance per step", "B: speed per step"):
        recomputed = a.courses[a.methods.index(name)]
        for one, other in zip(a.courses[0][:3], recomputed[:3], strict=True):
            assert one.seconds == pytest.approx(other.seconds, abs=1 / 400)
            assert one.lost == other.lost == 0


def test_across_a_zone_recomputation_loses_steps_and_the_envelope_none(found):
    """Only the table knows of a zone ahead: a bare step of the frequency at its border loses steps (test 14)."""
    a = found[0]
    assert a.courses[0][-1].lost == 0
    assert a.courses[a.methods.index("B: speed per step")][-1].lost > 500


def test_the_largest_frequency_from_rest_loses_steps(found):
    assert all(course.lost > 0 for course in found[0].courses[-1])


def test_both_profiles_go_the_same_way_within_the_same_limits(spec):
    found = compare_jerk(spec)
    assert found.motor == "group_a"
    assert found.way == pytest.approx(0.04)
    for profile in (found.envelope, found.smooth):
        assert profile.position[-1] == pytest.approx(found.way, rel=1e-9)
        assert (np.diff(profile.t) > 0).all()
        assert profile.speed.max() <= found.speed * (1 + 1e-9)
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


def test_an_unknown_motor_is_refused(spec):
    with pytest.raises(DetentError, match="came 'z'; allowed: one of group_a, group_b"):
        compare_jerk(spec, "z")
