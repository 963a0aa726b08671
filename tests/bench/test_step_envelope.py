"""What a stepper's envelope costs: to build it, to change it, and per step; none of it may depend on the travel."""

import time

import pytest
from tests.stepper_rig import COARSE_FINE, MAX_HZ, NO_TRACE, RAMP, Rig

from detent.planning.step_envelope import StepEnvelope, ZoneMap
from detent.systems.stepper import advance

BUILD_BAR = 0.05
"""Seconds to build a table of a million steps."""

SPREAD = 0.3
"""How far the time per step may differ between travels of 10^3 and 10^6 steps (acceptance test 10)."""

SIZES = (10**3, 10**4, 10**5, 10**6)


def test_building_a_million_steps(benchmark):
    zones = ZoneMap(10**6, MAX_HZ, COARSE_FINE)
    benchmark(StepEnvelope, RAMP, zones)
    if not benchmark.disabled:
        assert benchmark.stats.stats.median < BUILD_BAR


@pytest.mark.parametrize("steps", SIZES)
def test_moving_a_stop(benchmark, steps):
    table = StepEnvelope(RAMP, ZoneMap(steps, MAX_HZ))
    places = iter(range(10**9))
    benchmark(lambda: table.move_stop(500 + next(places) % 400))


def seconds_per_step(steps: int) -> float:
    """Best of several runs there and back, a million steps in all."""
    rig = Rig(steps)
    best = float("inf")
    for _ in range(7):
        made, begin = 0, time.perf_counter()
        while made < 10**6:
            rig.start(1 if rig.position == 0 else -1)
            made += advance(rig.p, rig.r, *rig.tables, 10**7, *NO_TRACE)
        best = min(best, (time.perf_counter() - begin) / made)
    return best


def test_the_time_per_step_does_not_depend_on_the_travel(benchmark):
    seconds_per_step(1000)
    found = {steps: seconds_per_step(steps) for steps in SIZES}
    benchmark.extra_info.update({f"ns per step, N = {steps}": round(1e9 * s, 2) for steps, s in found.items()})
    rig = Rig(10**6)

    def run():
        rig.start(1 if rig.position == 0 else -1)
        advance(rig.p, rig.r, *rig.tables, 10**7, *NO_TRACE)

    benchmark(run)
    if not benchmark.disabled:
        middle = sorted(found.values())[len(found) // 2]
        assert all(abs(s / middle - 1) < SPREAD for s in found.values()), found
