"""The endless angle beside a conventional one: rotary-table tests 11, 12 and 19 on an axis of its own."""

import json
import math

import numpy as np
import pytest

import detent
from detent.errors import DetentError
from detent.methods.load import load_spec
from detent.methods.rotary_table.comparison_runs import FORMS, compare_angle, crossing_speed

pytestmark = pytest.mark.compiled

FORM_NAMES = ("flag", "guarded flag", "turn counter")


def table(*overrides):
    return load_spec(detent.example("rotary_table.toml"), overrides)


@pytest.fixture(scope="module")
def ideal():
    """The model: no droop, no limit of torque, 16 bits up to 180 deg/s."""
    model = ("drive.droop=0 %", "drive.word_bits=16", "motor.max_speed=2700 rpm", "limits.effort=1000 N*m")
    return compare_angle(table(*model))


@pytest.fixture(scope="module")
def usual():
    return compare_angle(table())


def deg(angle):
    return math.degrees(angle)


def test_the_conventional_unit_runs_away_at_the_end_of_the_turn(ideal):
    """Test 11."""
    crossing = ideal.crossings[0]
    assert crossing.name == "conventional"
    assert crossing.time == pytest.approx(4.464 + 0.02, abs=0.02)  # up to a pass later
    assert deg(crossing.deviation_before) == pytest.approx(2.0, abs=0.01)
    assert deg(crossing.deviation_after) == pytest.approx(362.0, abs=0.01)
    after = crossing.t > crossing.time
    assert np.degrees(crossing.s4[after]) == pytest.approx(180, abs=0.01)
    assert deg(crossing.speed) == pytest.approx(180, abs=0.01)
    # 260 deg to the boundary, then 180 deg/s, reached with a lag of 20 ms.
    assert deg(crossing.travel) == pytest.approx(260 + 180 * (crossing.t[-1] - crossing.time) - 2.4, abs=1)
    assert crossing.t[-1] == pytest.approx(12.2, abs=0.01)


def test_the_endless_one_passes_it_with_the_same_deviation(ideal):
    crossing = ideal.crossings[1]
    assert crossing.name == "endless"
    assert crossing.time == pytest.approx(ideal.crossings[0].time, abs=1e-9)
    assert deg(crossing.deviation_before) == pytest.approx(2.0, abs=0.002)
    assert deg(crossing.deviation_after) == pytest.approx(2.0, abs=0.002)
    assert deg(crossing.speed) == pytest.approx(60, abs=0.02)
    steady = crossing.t > 0.5
    assert np.degrees(crossing.deviation[steady]) == pytest.approx(2.0, abs=0.002)
    assert np.degrees(crossing.s4[steady]) == pytest.approx(60.0, abs=0.05)


def test_the_curves_begin_with_the_start_and_run_to_the_end(ideal):
    for crossing in ideal.crossings:
        assert len({len(curve) for curve in (crossing.t, crossing.angle, crossing.deviation, crossing.s4)}) == 1
        assert 0 < crossing.t[0] <= 2e-3
        assert np.diff(crossing.t) == pytest.approx(2e-3)
        assert crossing.angle[0] == pytest.approx(0.0, abs=1e-9)
        assert crossing.angle[-1] == crossing.travel
    steady = ideal.crossings[1].t > 0.5
    slope = np.polyfit(ideal.crossings[1].t[steady], ideal.crossings[1].angle[steady], 1)[0]
    assert deg(slope) == pytest.approx(60, abs=1e-3)


def test_manual_feed_keeps_its_speed_only_with_position_control(usual):
    """Test 19: a drive with 5 % droop and 12 bits."""
    assert [deg(feed.speed) for feed in usual.feeds] == pytest.approx([0.1, 1, 60])
    assert max(abs(feed.closed) for feed in usual.feeds) < 1e-4
    assert [100 * feed.opened for feed in usual.feeds] == pytest.approx([24, -7, -5], abs=0.5)


def test_the_literal_form_is_thrown_back_from_starts_just_after_the_boundary(ideal):
    """Test 12."""
    assert deg(ideal.following_error) == pytest.approx(2.0)
    by_form = {form: [start for start in ideal.starts if start.form == form] for form in FORMS}
    assert tuple(by_form) == FORM_NAMES
    for starts in by_form.values():
        assert [deg(start.angle) for start in starts] == pytest.approx([0, 360 / 368640, 0.5, 1, 2, 3, 100])
        assert {round(deg(start.asked), 6) for start in starts} == {834}
    assert [start.thrown_back for start in by_form["flag"]] == 4 * [True] + 3 * [False]
    for start in by_form["flag"][:4]:
        assert deg(start.travel) == pytest.approx(112, abs=1.5)  # the button is seen in the first pass, 20 ms late
    for form in ("guarded flag", "turn counter"):
        assert not any(start.thrown_back for start in by_form[form])
        assert [deg(start.travel) for start in by_form[form]] == pytest.approx(7 * [832], abs=1.5)


def test_the_droop_adds_to_what_the_table_lags_by(usual):
    assert deg(usual.following_error) == pytest.approx(2 / 0.95)
    assert deg(usual.crossings[1].deviation_after) == pytest.approx(2 / 0.95, abs=0.002)
    assert [start.thrown_back for start in usual.starts if start.form == "flag"] == 4 * [True] + 3 * [False]


def test_the_axis_is_compared_by_what_it_is_not_by_its_method(usual):
    changed = (
        "method.judge=actual", "method.inclusive=true", "method.guarded=true", "method.position_control=false",
        "mechanics.start_angle=200 deg", "disturbance.load.torque=100 N*m", "disturbance.load.at=0 s",
        "disturbance.load.duration=50 s",
    )  # fmt: skip
    assert compare_angle(table(*changed)).to_dict() == usual.to_dict()


def test_speeds_are_those_the_axis_can_run_at():
    slow = table("limits.speed=10 deg/s", "position.1.speed=10 deg/s")
    found = compare_angle(slow)
    assert deg(found.speed) == pytest.approx(10)
    assert [deg(feed.speed) for feed in found.feeds] == pytest.approx([0.1, 1, 10])
    assert deg(found.crossings[0].deviation_after - found.crossings[0].deviation_before) == pytest.approx(360, abs=0.01)
    assert np.diff(found.crossings[0].t) == pytest.approx(2e-3)


def test_a_table_that_stops_slowly_crosses_slowly():
    spec = table("limits.acceleration=10 deg/s^2")
    assert deg(crossing_speed(spec)) == pytest.approx(math.sqrt(2 * 10 * 90))
    assert crossing_speed(table()) == table().limits.speed


def test_a_table_that_hardly_moves_is_not_compared():
    spec = table("limits.speed=0.05 deg/s", "position.1.speed=0.05 deg/s")
    with pytest.raises(DetentError, match=r"came a table that goes round at 0\.05 deg/s; allowed: 0\.1 deg/s or more"):
        compare_angle(spec)


def test_it_is_plain_data_and_progress_is_told():
    told = []
    spec = table("method.fraction_bits=0")  # at 0.1 deg/s the dial is at 0 (test 20)
    found = compare_angle(spec, progress=lambda share, what: told.append((share, what)))
    data = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert set(data) == {"speed", "following_error", "crossings", "feeds", "starts"}
    assert data["feeds"][0]["closed"] == pytest.approx(-1, abs=1e-9)
    assert "angle" not in data["crossings"][0]
    shares = [share for share, _ in told]
    assert shares == sorted(shares)
    assert len(told) == 2 + len(data["feeds"]) + len(data["starts"])
    assert told[-1] == (1.0, "start with turn counter")
