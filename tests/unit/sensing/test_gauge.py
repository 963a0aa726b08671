import pytest

from detent.sensing.gauge import Gauge, read_gauge, set_gauge


def gauge(start: float, target: float, tolerance: float = 0.01, tick: int = 5) -> Gauge:
    r = Gauge()
    set_gauge(r, tick, start, target, tolerance)
    return r


@pytest.mark.parametrize(("start", "target", "direction"), [(0.1, 0.3, 1.0), (0.3, 0.1, -1.0), (0.2, 0.2, 1.0)])
def test_setting_takes_direction_and_distance_from_the_move(start, target, direction):
    r = gauge(start, target)
    assert r.direction == direction
    assert (r.target, r.tolerance, r.outside, r.peak_speed) == (target, 0.01, 5, 0.0)
    assert r.beyond == -abs(target - start)


def test_setting_forgets_the_move_before():
    r = gauge(0.0, 0.1)
    read_gauge(r, 9, 0.2, 3.0)
    set_gauge(r, 20, 0.2, 0.1, 0.01)
    fresh = gauge(0.2, 0.1, tick=20)
    assert bytes(r) == bytes(fresh)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    ("places", "outside"),
    [
        ((0.5, 0.75, 0.9375, 1.25, 1.125, 1.0), 13),  # overshoots last; on the edge counts as inside
        ((0.5, 1.25, 0.75, 0.875, 1.0), 12),  # comes back too far
        ((1.0, 1.0), 5),  # never away: the tick in which the move began
    ],
)
def test_outside_is_the_last_tick_beyond_the_tolerance_on_either_side(sign, places, outside):
    r = gauge(0.0, sign * 1.0, 0.125)
    for tick, place in enumerate(places, start=10):
        read_gauge(r, tick, sign * place, 0.0)
    assert r.outside == outside


@pytest.mark.parametrize("sign", [1, -1])
def test_beyond_is_the_overshoot_along_the_move(sign):
    r = gauge(0.0, sign * 1.0)
    for tick, place in enumerate((-0.5, 0.5, 0.75), start=10):
        read_gauge(r, tick, sign * place, 0.0)
    assert r.beyond == -0.25  # not yet there
    for tick, place in enumerate((1.5, 1.25, 0.5), start=20):
        read_gauge(r, tick, sign * place, 0.0)
    assert r.beyond == 0.5


def test_peak_speed_is_the_largest_of_both_directions():
    r = gauge(0.0, 1.0)
    for tick, velocity in enumerate((0.25, -0.75, 0.5), start=10):
        read_gauge(r, tick, 0.0, velocity)
    assert r.peak_speed == 0.75
