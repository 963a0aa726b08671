import json
from functools import cache

import numpy as np
import pytest
from tests.phase_servo_rig import make_spec

from detent.methods.phase_servo.comparison import compare_hold, push_force

pytestmark = pytest.mark.compiled


@cache
def compared():
    return compare_hold(make_spec())


def between(case, begin, end):
    return case.displacement[(case.t > begin) & (case.t <= end)]


def test_what_was_compared():
    found = compared()
    assert [case.name for case in found.still] == ["never in stop mode", "as in the axis file", "no dead band"]
    assert [case.name for case in found.loaded] == ["with integrator", "without integrator"]
    assert (found.push, found.push_at) == (3.0, 30e-3)
    assert found.stop_at == pytest.approx(41.5e-3, abs=0.5e-3)
    assert found.step == pytest.approx(6.6146e-6, rel=1e-4)
    for case in (*found.still, *found.loaded):
        assert case.t.shape == case.displacement.shape == case.integral.shape == case.word.shape
        assert np.diff(case.t) == pytest.approx(np.full(len(case.t) - 1, 50e-6))
        assert case.displacement[0] == pytest.approx(-8, abs=1)  # the threshold
        assert case.t[0] == pytest.approx(found.stop_at - 20e-3, abs=1e-3)
        assert case.t[-1] == pytest.approx(found.stop_at + 0.16, abs=1e-3)


def test_without_a_stop_the_axis_swings_for_ever():
    forever, _, _ = compared().still
    assert 0.7 <= forever.swing <= 1.0
    assert abs(forever.rest) < 0.5
    assert not forever.integral.any()


def test_with_dead_band_and_integrator_it_comes_to_rest():
    _, held, _ = compared().still
    assert held.swing < 0.01
    assert abs(held.rest) <= 1.0
    assert np.ptp(between(held, 0.03, 0.0415)) > 0.3  # until the stop it swings as the other does


def test_without_the_dead_band_the_integrator_hunts():
    *_, hunting = compared().still
    assert hunting.swing == pytest.approx(0.9, abs=0.1)
    late = hunting.integral[hunting.t > 0.1]
    assert (late.min(), late.max()) == (-2, 1)


def test_the_integral_takes_over_the_push():
    found = compared()
    case, _ = found.loaded
    assert 0.8 <= between(case, found.push_at, found.stop_at).max() <= 1.3
    assert case.integral[-1] == pytest.approx(-6, abs=1)  # against the force
    # When it is back depends on the phase of the swing that the push meets: 50 to 95 ms for pushes from 30 to 31.5 ms.
    assert np.abs(between(case, 0.1, 1.0)).max() <= 1.0
    assert not case.integral[case.t < found.stop_at - 1e-3].any()


def test_without_the_integrator_the_axis_stays_two_steps_off():
    _, case = compared().loaded
    assert case.rest == pytest.approx(2.0, abs=0.1)
    assert not case.integral.any()


def test_plain_data_for_json():
    found = compared()
    data = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert data["push"] == 3.0
    assert [case["name"] for case in data["still"] + data["loaded"]] == [c.name for c in found.still + found.loaded]
    hunting = data["still"][2]
    assert hunting["about"] == found.still[2].about
    assert hunting["swing"] == found.still[2].swing
    assert hunting["integral"] == [-2, 1]


def test_progress_names_each_case():
    told = []
    compare_hold(make_spec(), progress=lambda share, text: told.append((share, text)))
    assert told == [
        (0.0, "never in stop mode"), (0.2, "as in the axis file"), (0.4, "no dead band"), (0.6, "with integrator"),
        (0.8, "without integrator"),
    ]  # fmt: skip


def test_the_push_fits_the_axis():
    friction = [f"mechanics.friction.right.{kind}=2 N" for kind in ("coulomb", "static")]
    assert push_force(make_spec(friction)) == pytest.approx(6.0)
    free = [f"mechanics.friction.{side}.{kind}=0 N" for side in ("right", "left") for kind in ("coulomb", "static")]
    assert push_force(make_spec(free)) == 3.0


def test_the_push_begins_between_arrival_and_stop():
    found = compare_hold(make_spec(["method.stop_time=5 ms", "method.ready_time=1 ms"]))
    assert found.push_at == pytest.approx(found.stop_at - 2.5e-3)
    with_integrator, without = found.loaded
    before = found.push_at - 2e-4
    assert between(with_integrator, 0, before) == pytest.approx(between(without, 0, before))
    assert with_integrator.integral[-1] < 0


def test_the_file_decides_about_its_own_case_and_its_disturbances_do_not_count():
    plain = compared()
    loose = compare_hold(
        make_spec(
            [
                "method.integrator=false",
                "method.corrector=false",
                "method.stop_always_off=true",
                "disturbance.push.force=9 N",
                "disturbance.push.at=0 s",
                "disturbance.push.duration=1 s",
            ]
        )
    )
    assert not loose.still[1].integral.any()
    assert loose.still[2].integral.any()
    assert loose.push_at == plain.push_at
    assert loose.still[1].rest == pytest.approx(0, abs=2)  # test 31: without both, within 2 steps


def test_an_axis_that_cannot_move_is_compared_as_it_is():
    found = compare_hold(make_spec(["limits.effort=0.05 A"]))
    for case in found.still:
        assert case.swing < 0.01
        assert case.rest == pytest.approx(-384, abs=1)
