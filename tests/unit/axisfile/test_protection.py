import pytest

from detent.axisfile.protection import TravelProtectionTable, breaking_effort, fill_guard, guard_text, samples
from detent.control.guard import GuardParams


def guard_of(sample=1e-3, speed=10_000.0, **keys):
    p = GuardParams()
    fill_guard(
        p,
        TravelProtectionTable.model_construct(**(TravelProtectionTable().model_dump() | keys)),
        sample=sample,
        speed=speed,
    )
    return p


def test_every_watch_is_on_by_default():
    assert all(value > 0 for path, value in guard_of().values().items() if path not in {"following", "period"})


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
    off = guard_of(**{key: 0}).values()
    assert off[register] == 0
    assert {path: value for path, value in off.items() if path != register} == {
        path: value for path, value in guard_of().values().items() if path != register
    }


def test_a_time_shorter_than_a_sample_is_one():
    assert samples(1e-5, 1e-3) == 1


@pytest.mark.parametrize(("static", "share"), [(0.0, 0.3), (20.0, 0.4), (90.0, 1.0)])
def test_the_effort_that_must_move_the_axis_follows_its_friction(static, share):
    assert breaking_effort(static, 100.0) == pytest.approx(share)


def test_a_text_names_the_limit():
    assert "0.5 mm" in guard_text(10, following="0.5 mm")
