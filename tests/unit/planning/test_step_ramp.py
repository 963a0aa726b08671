import math
from dataclasses import replace

import numpy as np
import pytest
from tests.stepper_rig import LOAD, MOTOR, Rig, heavier

from detent.planning.step_ramp import (
    FirstOrderPullOut,
    MeasuredPullOut,
    StepRamp,
    WindingPullOut,
    make_ramp,
    natural_frequency,
)

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


def test_inertia_of_the_default_load():
    assert LOAD.inertia == pytest.approx(6.0e-8 + 5.0e-8 + 0.12 * (1e-3 / (2 * math.pi)) ** 2)
    assert MOTOR.inertia == pytest.approx(1.013e-6, rel=1e-3)


def test_a_stage_with_two_millimetres_pitch_starts_more_slowly():
    stage = heavier(LOAD, pitch=2e-3, mass=1.0)
    assert stage.inertia - 1.1e-7 == pytest.approx(1.01e-7, rel=0.01)
    assert replace(MOTOR, **stage.of_motor).start_hz(1.0) == pytest.approx(810, abs=1)
    assert replace(MOTOR, **stage.of_motor).start_hz(2.1) == pytest.approx(810 / 2.1, abs=0.5)


def test_torque_falls_with_the_step_frequency():
    assert MOTOR.pull_out(0) == 0.045
    assert MOTOR.pull_out(1200) == pytest.approx(0.045 / math.sqrt(2))
    assert MOTOR.pull_out(4000) == pytest.approx(0.0129, abs=5e-5)


def test_acceleration_is_limited_first_by_the_stated_value_then_by_the_torque():
    a = MOTOR.acceleration_limit(40_000.0)
    assert a(400) == a(3500) == 40_000
    assert a(3520) < 40_000
    assert a(4000) == pytest.approx(14_600, rel=0.01)
    assert a(4340) == pytest.approx(0, abs=200)  # of 40 000
    assert a(5000) < 0


def test_a_constant_acceleration_gives_the_closed_form_to_the_last_bit():
    ramp = make_ramp(300.0, 2000.0, lambda _: 10_000.0)
    n = np.arange(len(ramp) - 1)
    assert ramp.hz[:-1].tolist() == np.sqrt(300.0**2 + 20_000.0 * n).tolist()
    assert ramp.hz[-1] == 2000.0
    assert ramp.hz[-2] < 2000.0


def test_the_list_ends_where_the_torque_is_used_up():
    ramp = make_ramp(400.0, 10_000.0, MOTOR.acceleration_limit(40_000.0))
    assert 4200 < ramp.hz[-1] < 4340
    assert np.diff(ramp.hz).min() >= 0.5


@pytest.mark.parametrize("acceleration", [0.0, -1000.0])
def test_without_spare_torque_there_is_the_start_frequency_only(acceleration):
    assert make_ramp(400.0, 4000.0, lambda _: acceleration).hz.tolist() == [400.0]


def test_equal_start_and_largest_frequency_make_one_entry():
    assert make_ramp(400.0, 400.0, lambda _: 1e4).hz.tolist() == [400.0]


def test_index_of_a_frequency():
    ramp = make_ramp(100.0, 1000.0, lambda _: 10_000.0)
    assert ramp.index_of(1.0) == ramp.index_of(100.0) == 0
    assert ramp.index_of(100.1) == 1
    assert ramp.index_of(1000.0) == ramp.index_of(9999.0) == len(ramp) - 1
    words = ramp.words(8, reload=False)
    assert words.dtype == np.int64
    assert np.abs(words - ramp.hz).max() <= 0.5


@pytest.mark.parametrize(("start", "top"), [(0, 100), (200, 100), (100, 65536), (math.nan, 100), (100, math.inf)])
def test_bad_frequencies_are_refused(start, top):
    with pytest.raises(ValueError, match="start_hz is"):
        make_ramp(start, top, lambda _: 1.0)


@pytest.mark.compiled
def test_a_ramp_ends_where_the_torque_does_even_within_a_step():
    """Acceleration is taken at the middle of a step: the ramp once climbed past the end of a measured curve."""
    hz = [0.0, 500.0, 1000.0, 1500.0, 2000.0, 2500.0, 3000.0]
    ends = replace(MOTOR, pull_out=MeasuredPullOut(hz, [MOTOR.pull_out(f) for f in hz]))
    ramp = make_ramp(400.0, 4000.0, ends.acceleration_limit(40_000.0))
    assert 2980 < ramp.hz[-1] <= 3000
    rig = Rig(2000, ramp=ramp, motor=ends).start().run()
    assert rig.lost == 0


def test_the_unloaded_start_frequency_of_the_default_motor_is_three_times_its_natural_one():
    natural = natural_frequency(200, MOTOR.holding_torque, MOTOR.rotor_inertia)
    assert natural == pytest.approx(290.6, abs=0.1)
    assert MOTOR.unloaded_start_hz / natural == pytest.approx(3.1, abs=0.01)


def test_reload_values_are_the_nearest_periods():
    assert StepRamp(np.array([400.0, 3000.0, 4000.0])).words(1_000_000, reload=True).tolist() == [2500, 333, 250]
