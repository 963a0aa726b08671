"""The model of the position loop, against its closed forms and the simulated axis."""

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.rotary_table_rig import COUNT, ONE, RATIO, TICK, Rig

from detent.methods.rotary_table.loop import HeldLoop

LOOP = HeldLoop(gain=30, share=1.0, time_constant=20e-3, period=2e-3, delay=0.2e-3)


@pytest.mark.parametrize(("gain", "lag"), [(30, 20e-3), (30, 0.1), (5, 20e-3), (200, 2e-3)])
def test_with_a_quick_clock_it_is_the_loop_of_second_order(gain, lag):
    quick = HeldLoop(gain, 1.0, lag, 1e-5, 1e-6)
    damping = 1 / (2 * math.sqrt(gain * lag))
    assert quick.damping == pytest.approx(min(damping, 1.0), rel=0.01)
    if damping < 1:
        assert quick.spectral_radius == pytest.approx(math.exp(-1e-5 / (2 * lag)), rel=1e-4)


def test_strobe_and_delay_cost_damping():
    # 0.65 without (7); a delay of half a period and of the interrupt is 1.2 ms.
    assert LOOP.damping == pytest.approx(0.622, abs=0.001)
    assert replace(LOOP, delay=1.8e-3).damping < LOOP.damping
    assert replace(LOOP, period=4e-3).damping < LOOP.damping
    assert LOOP.spectral_radius == pytest.approx(0.953, abs=0.001)


def test_the_limit_of_stability_is_where_the_phase_of_the_lag_and_the_delay_is_used_up():
    limit = LOOP.largest_gain(0.0)
    assert replace(LOOP, gain=limit * 0.999).spectral_radius < 1 < replace(LOOP, gain=limit * 1.001).spectral_radius
    omega = 1 / math.sqrt(20e-3 * 1.2e-3)  # atan(w tau) + 1.2 ms w = 90 deg, nearly
    assert limit == pytest.approx(omega * math.hypot(1, omega * 20e-3), rel=0.02)
    assert replace(LOOP, gain=3 * limit).largest_gain(0.0) == pytest.approx(limit, rel=1e-5)
    assert replace(LOOP, gain=3 * limit).damping < 0


def test_the_largest_gain_with_a_damping_has_it():
    gain = LOOP.largest_gain(0.4)
    assert replace(LOOP, gain=gain).damping == pytest.approx(0.4, abs=1e-5)
    assert gain > LOOP.gain


def test_droop_takes_its_share_of_the_gain():
    assert replace(LOOP, share=0.5, gain=60).damping == pytest.approx(LOOP.damping, rel=1e-9)


@pytest.mark.parametrize("speed", [60.0, 30.0])
def test_overshoot_and_acceleration_are_those_of_the_simulated_axis(speed):
    passed, hardest = LOOP.stop(speed / 300)
    rig = Rig(100).press(1, speed)
    seen = rig.record(3.0, ["controller.positioner.dr", "plant.train.motor.velocity"], every=1)
    assert seen["controller.positioner.dr"].max() / ONE * COUNT == pytest.approx(speed / 30 + 300 * passed, abs=0.001)
    acceleration = np.abs(np.diff(np.degrees(seen["plant.train.motor.velocity"]) / RATIO)).max() / TICK
    assert acceleration == pytest.approx(300 * hardest, rel=0.01)


def test_the_overshoot_of_test_21():
    assert 300 * LOOP.stop(30 / 300)[0] == pytest.approx(0.075, abs=0.001)


def test_a_well_damped_loop_does_not_pass_its_target():
    passed, hardest = replace(LOOP, gain=5).stop(0.5)
    assert passed == pytest.approx(0, abs=1e-4)
    assert hardest == pytest.approx(1, abs=0.02)


def test_a_loop_slower_than_its_clock_is_followed_all_the_same():
    # The same loop, all its times a thousand times longer, but for the strobe's.
    slow, quick = HeldLoop(0.03, 1.0, 20.0, 2e-3, 2e-4), replace(LOOP, period=1e-4, delay=1e-5)
    passed, hardest = slow.stop(100)
    expected, hardest_expected = quick.stop(0.1)
    assert passed == pytest.approx(1e6 * expected, rel=0.01)
    assert hardest == pytest.approx(hardest_expected, rel=0.01)


def test_a_ramp_without_end_is_the_limit_of_long_ones():
    assert LOOP.stop(math.inf) == pytest.approx(LOOP.stop(50.0), rel=1e-9)
