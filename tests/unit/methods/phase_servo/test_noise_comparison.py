import json
from functools import cache

import numpy as np
import pytest
from tests.phase_servo_rig import make_spec

from detent.errors import DetentError
from detent.methods.phase_servo import comparison
from detent.methods.phase_servo.comparison import compare_noise, pulse_counts, rest_point

pytestmark = pytest.mark.compiled


@cache
def compared():
    return compare_noise(make_spec())


def test_what_was_compared():
    found = compared()
    assert found.pulses == (0, 1, 2, 5, 8, 12, 16, 20, 30)
    assert found.absolute.shape == found.incremental.shape == (9, 2, 2)
    assert (found.counts, found.margin, found.pitches) == (64, 24, 6)
    assert found.step == pytest.approx(6.6146e-6, rel=1e-4)


def test_up_to_twenty_pulses_do_not_move_the_absolute_stop():
    assert np.abs(compared().absolute[:8]).max() <= 0.6


def test_thirty_pulses_end_a_whole_pitch_short():
    plus, minus = compared().absolute[8]
    for right, left in (plus, minus):  # the down counter takes either sign
        assert right == pytest.approx(-64, abs=1)
        assert left == pytest.approx(64, abs=1)


def test_the_counted_stop_moves_by_every_pulse():
    found = compared()
    moved = found.incremental - found.incremental[0]
    for k, count in enumerate(found.pulses):
        assert moved[k, 0] == pytest.approx(np.full(2, -count), abs=1)
        assert moved[k, 1] == pytest.approx(np.full(2, count), abs=1)
    # The tracker's dead zone is a step wide; the undisturbed counted stop lies at its far end.
    assert np.abs(found.incremental[0]).max() < 1.5


def test_plain_data_for_json():
    found = compared()
    data = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert {name: data[name] for name in ("step", "counts", "margin", "pitches")} == {
        "step": found.step, "counts": 64, "margin": 24, "pitches": 6,
    }  # fmt: skip
    assert len(data["rest"]) == 36
    assert data["rest"][-2] == {
        "pulses": 30, "sign": "-", "direction": "right", "absolute": found.absolute[8, 1, 0],
        "incremental": found.incremental[8, 1, 0],
    }  # fmt: skip


def test_progress_rises_and_says_what_is_being_done(monkeypatch):
    monkeypatch.setattr(comparison, "rest_point", lambda *_: 0.0)
    told = []
    compare_noise(make_spec(), progress=lambda share, text: told.append((share, text)))
    shares = [share for share, _ in told]
    assert len(told) == 72
    assert shares == sorted(set(shares))
    assert shares[0] == 0.0
    assert shares[-1] == pytest.approx(71 / 72)
    assert told[-1][1] == "30 spurious pulses"


@pytest.mark.parametrize(
    ("margin", "pulses"),
    [
        (24, (0, 1, 2, 5, 8, 12, 16, 20, 30)),
        (1, (0, 1, 2, 5, 8, 12, 16, 20, 30)),
        (52, (0, 1, 2, 5, 8, 12, 16, 20, 30, 43)),  # beyond the margin would be 65, more than the list of pulses holds
        (500, (0, 1, 2, 5, 8, 12, 16, 20, 30)),
        (-4, (0, 1, 2, 5, 8, 12, 16, 20, 30)),
    ],
)
def test_the_axis_itself_decides_what_else_to_try(margin, pulses):
    assert pulse_counts(margin) == pulses


def test_a_threshold_of_its_own_has_a_margin_of_its_own():
    spec = make_spec(["method.threshold=4", "method.expected_spurious=10"])
    assert spec.detector.counts // 2 - spec.method.threshold == 28
    assert {23, 35} <= set(pulse_counts(28))
    for sign in "+-":
        assert abs(rest_point(spec, 6, 23, sign, 5e-3)) < 1
        assert rest_point(spec, 6, 35, sign, 5e-3) == pytest.approx(-64, abs=1)


def test_in_a_short_move_the_pulses_come_on_the_way_too():
    spec = make_spec()
    begin = comparison._first_pulse(spec, 1)
    assert begin == pytest.approx(0.25e-3 + (6.7e-3 - 0.25e-3) / 4, rel=0.05)
    assert comparison._first_pulse(spec, 6) == 5e-3
    assert rest_point(spec, 1, 30, "+", begin) == pytest.approx(-64, abs=1)
    assert abs(rest_point(spec, 1, 30, "+", 20e-3)) < 1  # after the move they do nothing


def test_an_axis_that_swings_for_ever_has_a_rest_point_in_the_middle():
    swinging = rest_point(make_spec(["method.stop_always_off=true"]), 6, 8, "+", 5e-3)
    assert abs(swinging) < 0.3


def test_an_axis_that_cannot_move_is_compared_as_it_is():
    assert rest_point(make_spec(["limits.effort=0.05 A"]), 6, 5, "+", 5e-3) == pytest.approx(-384, abs=1)


@pytest.mark.parametrize("pitches", [0, -1, 1024])
def test_a_move_that_cannot_be_commanded_is_refused(pitches):
    with pytest.raises(DetentError, match=rf"got a move of {pitches} pitches; expected: 1 to 1023; choose another"):
        compare_noise(make_spec(), pitches=pitches)
