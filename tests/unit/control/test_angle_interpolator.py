import itertools
import math

import pytest

from detent.control.angle_interpolator import Interpolator, InterpolatorParams, braking_path, interpolate

ONE = 1 << 16
P = InterpolatorParams(fraction=16, acceleration=80531, max_speed=1000 * ONE)


def run(r: Interpolator, limit: int, interrupts: int) -> list[int]:
    speeds = []
    for _ in range(interrupts):
        interpolate(P, r, limit)
        speeds.append(r.speed)
    return speeds


def test_it_accelerates_runs_and_stops():
    r, limit = Interpolator(irr=100_000 * ONE), 122 * ONE
    speeds = run(r, limit, 3000)
    rise = math.ceil(limit / P.acceleration)
    assert speeds[: rise - 1] == [P.acceleration * (n + 1) for n in range(rise - 1)]
    assert max(speeds) == limit
    assert (r.irr, r.speed) == (0, 0)
    assert sum(speed > 0 for speed in speeds) * limit == pytest.approx(100_000 * ONE + rise * limit, rel=0.01)
    # v = sqrt(2 a IR) is taken at the beginning of an interrupt: it brakes by a, and a little more near the end.
    falls = [before - after for before, after in itertools.pairwise(speeds) if after < before]
    assert max(falls[:-5]) < 1.2 * P.acceleration
    # The last interrupt ends on IR <= 2 a; the one before came from v^2 = 2 a (2 a + v) at most, v = (1 + sqrt 5) a.
    assert max(falls) <= (1 + math.sqrt(5)) * P.acceleration


@pytest.mark.parametrize("irr", [1, 7, ONE, 5 * ONE, 12_345_678])
def test_the_whole_way_is_used_up(irr):
    r = Interpolator(irr=irr)
    run(r, 122 * ONE, 1000)
    assert (r.irr, r.speed) == (0, 0)


def test_a_dial_turned_down_slows_down_no_faster_than_the_acceleration():
    r = Interpolator(irr=700_000 * ONE, speed=122 * ONE)
    speeds = run(r, 10 * ONE, 100)
    assert speeds[0] == 122 * ONE - P.acceleration
    assert speeds[-1] == 10 * ONE


def test_no_dial_exceeds_the_largest_speed():
    r = Interpolator(irr=700_000 * ONE)
    assert max(run(r, 5000 * ONE, 1200)) <= 1000 * ONE


def test_at_the_end_nothing_moves():
    r = Interpolator()
    assert run(r, 122 * ONE, 3) == [0, 0, 0]


def test_braking_path():
    r = Interpolator(speed=122 * ONE)
    path = braking_path(P, r)
    assert path == (122 * ONE) ** 2 // (2 * P.acceleration)
    r.irr = path
    start = r.speed
    interrupts = 0
    while r.irr > 0:
        interpolate(P, r, r.speed)
        interrupts += 1
    assert interrupts == pytest.approx(start / P.acceleration, rel=0.05)
