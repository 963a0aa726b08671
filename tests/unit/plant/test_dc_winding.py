import math

import pytest

from detent.plant.dc_winding import WindingParams, current_rate, flowing_current, motor_force

R, L, KT, KE = 2.0, 4e-3, 10.0, 9.0


def winding(**changes: float) -> WindingParams:
    p = WindingParams(used=1, resistance=R, inductance=L, force_constant=KT, emf_constant=KE, max_current=math.inf)
    for name, value in changes.items():
        setattr(p, name, value)
    return p


def test_without_a_winding_the_effort_is_the_force():
    p = winding(used=0)
    assert motor_force(p, 12.5, 3.0, 7.0) == 12.5
    assert flowing_current(p, 12.5, 3.0, 7.0) == 0.0
    assert current_rate(p, 12.5, 3.0, 7.0) == 0.0


def test_with_inductance_the_current_is_a_state():
    p = winding()
    assert motor_force(p, 24.0, 3.0, 0.5) == KT * 3.0
    assert current_rate(p, 24.0, 3.0, 0.5) == pytest.approx((24.0 - R * 3.0 - KE * 0.5) / L, rel=1e-15)


def test_without_inductance_the_current_follows_at_once():
    p = winding(inductance=0.0)
    assert flowing_current(p, 24.0, 99.0, 0.5) == (24.0 - KE * 0.5) / R
    assert motor_force(p, 24.0, 99.0, 0.5) == KT * (24.0 - KE * 0.5) / R
    assert current_rate(p, 24.0, 3.0, 0.5) == 0.0


@pytest.mark.parametrize("sign", [1, -1])
def test_the_amplifier_limits_the_current(sign):
    p = winding(inductance=0.0, max_current=5.0)
    assert flowing_current(p, sign * 24.0, 0.0, 0.0) == sign * 5.0
    assert motor_force(p, sign * 24.0, 0.0, 0.0) == sign * 5.0 * KT
    p = winding(max_current=5.0)
    assert current_rate(p, sign * 24.0, sign * 5.0, 0.0) == 0.0, "at the limit it goes no further"
    back = current_rate(p, -sign * 24.0, sign * 5.0, 0.0)
    assert back * sign < 0.0, "but back"
    assert motor_force(p, 0.0, sign * 5.5, 0.0) == sign * 5.0 * KT
