import math

import numpy as np
import pytest

from detent.planning.pull_out import FirstOrderPullOut, MeasuredPullOut, WindingPullOut

WINDING = WindingPullOut(
    holding_torque=0.4, rated_current=1.7, current=1.7, supply=24.0, resistance=1.5, inductance=2.8e-3, teeth=50
)


def circuit_torque(motor: WindingPullOut, hz: float) -> float:
    """Largest torque over the load angle of a phase driven by a sine voltage, from its phasors."""
    omega = 2 * math.pi * hz / 4
    flux = motor.per_current / motor.teeth
    angle = np.linspace(0, 2 * np.pi, 100_001)
    voltage = 4 / math.pi * motor.supply * np.exp(1j * angle)
    current = (voltage - omega * flux) / (motor.resistance + 1j * omega * motor.inductance)
    # Two phases, half the peak values each: the power of the EMF over the mechanical speed.
    return float(np.max(motor.teeth * flux * current.real))


@pytest.mark.parametrize("hz", [4000.0, 8000.0, 12_000.0])
def test_beyond_the_chopper_a_winding_gives_what_its_circuit_gives(hz):
    assert WINDING(hz) == pytest.approx(circuit_torque(WINDING, hz), rel=1e-6)


def test_a_chopper_holds_the_current_up_to_the_voltage_it_has():
    held = WINDING.per_current * 4 / math.pi * 1.7
    assert WINDING(0) == WINDING(500) == pytest.approx(held)
    assert held == pytest.approx(0.9 * 0.4, rel=1e-3)  # 4 / pi / sqrt 2 of the holding torque
    assert WINDING(8000) < 0.5 * held


def test_more_supply_drives_faster():
    double = WindingPullOut(0.4, 1.7, 1.7, 48.0, 1.5, 2.8e-3, 50)
    assert double(5000) > 1.5 * WINDING(5000)


def test_a_winding_whose_own_voltage_exceeds_the_supply_drives_nothing():
    weak = WindingPullOut(0.4, 1.7, 1.7, 0.5, 1.5, 1e-6, 50)
    assert weak(20_000) == 0.0


def test_first_order_form():
    curve = FirstOrderPullOut(0.045, 1200)
    assert curve(0) == 0.045
    assert curve(1200) == pytest.approx(0.045 / math.sqrt(2))


def test_points_are_joined_by_straight_lines_and_end():
    curve = MeasuredPullOut((100.0, 1000.0, 2000.0), (0.4, 0.3, 0.1))
    assert [curve(hz) for hz in (0, 100, 550, 1000, 1500, 2000, 2001)] == pytest.approx(
        [0.4, 0.4, 0.35, 0.3, 0.2, 0.1, 0.0]
    )
