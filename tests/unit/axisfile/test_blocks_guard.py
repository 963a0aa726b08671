import pytest
from tests.difference import values_of

from detent.axisfile.blocks import describe_fault, fill_guard, samples
from detent.axisfile.tables import MotionProtectionTable, ProtectionTable, breaking_effort
from detent.control.guard import FOLLOWING, TRAVEL, Guard, GuardParams


def guard_of(sample=1e-3, speed=10_000.0, **keys):
    p = GuardParams()
    fill_guard(
        p,
        MotionProtectionTable.model_construct(**(MotionProtectionTable().model_dump() | keys)),
        sample=sample,
        speed=speed,
    )
    return p


def test_every_watch_is_on_by_default():
    assert all(value > 0 for path, value in values_of(guard_of()).items() if path not in {"following", "softly"})


def test_windows_are_in_samples_and_speeds_in_counts_of_one():
    p = guard_of()
    assert (p.speed, p.jump, p.saturated, p.stuck, p.reversed) == (12, 17, 1000, 50, 20)


@pytest.mark.parametrize(
    ("key", "register"),
    [
        ("overspeed", "speed"),
        ("jump", "jump"),
        ("saturation_time", "saturated"),
        ("stuck_time", "stuck"),
        ("reversed_time", "reversed"),
        ("travel", "travel"),
    ],
)
def test_zero_switches_a_watch_off_and_no_other(key, register):
    off = values_of(guard_of(**{key: 0}))
    assert off[register] == 0
    assert {path: value for path, value in off.items() if path != register} == {
        path: value for path, value in values_of(guard_of()).items() if path != register
    }


def test_a_time_shorter_than_a_sample_is_one():
    assert samples(1e-5, 1e-3) == 1


@pytest.mark.parametrize(("static", "share"), [(0.0, 0.3), (20.0, 0.4), (90.0, 1.0)])
def test_the_effort_that_must_move_the_axis_follows_its_friction(static, share):
    assert breaking_effort(static, 100.0) == pytest.approx(share)


def test_a_text_names_the_limit():
    table = MotionProtectionTable()
    assert "0.5 mm" in describe_fault(Guard(code=FOLLOWING), table, following="0.5 mm")
    assert "upper end of travel, 2 m" in describe_fault(Guard(code=TRAVEL, side=1), table, lower="0 m", upper="2 m")


def test_an_axis_whose_counts_noise_may_change_watches_no_speed():
    p = GuardParams()
    fill_guard(p, ProtectionTable(), sample=1e-3, speed=10_000.0)
    assert {path for path, value in values_of(p).items() if value} == {"saturated", "stuck"}
