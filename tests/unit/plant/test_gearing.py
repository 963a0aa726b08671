import math

import pytest

from detent.kernel.turn_table import TURN
from detent.plant.gearing import Gear, GearParams, fill_eccentricity, follow, output_phase

RATIO = 90


def test_without_backlash_the_output_is_at_the_motor_angle_over_the_ratio():
    p, r = GearParams(ratio=RATIO), Gear()
    for turns, angle in ((0, 0.0), (1, math.pi), (89, 6.28), (90, 0.0), (-1, 0.0), (-90, 1.0), (10**15, 2.0)):
        follow(p, r, 1.0)
        wanted = ((turns % RATIO) + angle / (2 * math.pi)) / RATIO * TURN
        assert output_phase(p, r.slack, turns, angle) == pytest.approx(wanted, abs=1)
    assert r.slack == 0.0


def test_the_output_stays_while_the_flank_crosses_the_backlash():
    p, r = GearParams(ratio=RATIO, half_backlash=0.1), Gear()
    angle, places = 1.0, []
    for travel in (0.06, 0.06, 0.06, -0.05, -0.1, -0.06, -0.02, 0.03):
        angle += travel
        follow(p, r, travel)
        places.append(angle + r.slack)
    assert places == pytest.approx([1.0, 1.02, 1.08, 1.08, 1.08, 1.07, 1.05, 1.05])


def test_a_slack_at_the_boundary_is_a_phase_like_any_other():
    p = GearParams(ratio=RATIO, half_backlash=0.1)
    beyond = 0.09 / (2 * math.pi * RATIO) * TURN
    assert output_phase(p, -0.09, 0, 0.0) == pytest.approx(-beyond, abs=1)
    assert output_phase(p, 0.09, 89, 2 * math.pi - 1e-9) == pytest.approx(TURN + beyond, abs=2)


def test_eccentricity_is_one_wave_per_output_turn():
    p = GearParams(ratio=RATIO)
    fill_eccentricity(p, 1e-3, math.radians(30))
    even = GearParams(ratio=RATIO)
    lead = [output_phase(p, 0.0, turns, 0.0) - output_phase(even, 0.0, turns, 0.0) for turns in range(RATIO)]
    wave = [1e-3 * math.sin(math.radians(4 * turns - 30)) / (2 * math.pi) * TURN for turns in range(RATIO)]
    assert lead == pytest.approx(wave, abs=1e-3 / (2 * math.pi) * TURN * 1e-4)
