"""The plant alone: what it makes of its lines, and what an observer sees."""

import pytest
from tests.stepper_rig import RELOAD_CLOCK_HZ, rotor_params

from detent.methods.stepper_envelope.controller import StepperLines
from detent.methods.stepper_envelope.plant import StepperPlant, StepperPlantParams, move


@pytest.fixture
def p():
    return StepperPlantParams(clock_hz=RELOAD_CLOCK_HZ, tolerance=0.5, rotor=rotor_params())


def standing() -> StepperPlant:
    plant = StepperPlant()
    plant.rotor.strength = 1.0
    return plant


@pytest.mark.parametrize("direction", [1, -1])
def test_a_pulse_moves_the_field_by_a_step_at_the_frequency_of_its_period(p, direction):
    plant = standing()
    move(p, 0, StepperLines(pulse=1, direction=direction, period=500), plant)
    assert plant.rotor.commanded == direction
    assert plant.rotor.field_velocity == pytest.approx(direction * 2000 * p.rotor.step_angle)
    assert plant.gauge.peak_hz == 2000
    move(p, 1, StepperLines(pulse=1, direction=direction, period=1000), plant)
    assert (plant.rotor.commanded, plant.gauge.peak_hz) == (2 * direction, 2000)


def test_without_a_pulse_the_field_goes_on_until_the_lines_say_hold(p):
    plant = standing()
    move(p, 0, StepperLines(pulse=1, direction=1, period=500), plant)
    moving = plant.rotor.field_velocity
    move(p, 1, StepperLines(direction=1, period=500), plant)
    assert plant.rotor.field_velocity == moving
    move(p, 2, StepperLines(direction=1), plant)
    assert (plant.rotor.field_velocity, plant.rotor.strength, plant.rotor.commanded) == (0.0, 1.0, 1)


def test_the_observer_notes_the_last_tick_outside_the_tolerance(p):
    plant = standing()
    move(p, 0, StepperLines(pulse=1, direction=1, period=2500), plant)
    for tick in range(1, 15_000):
        move(p, tick, StepperLines(), plant)
        if abs(plant.rotor.lag) > 0.5:
            last = tick + 1
    assert plant.gauge.outside == last
    assert abs(plant.rotor.lag) < 0.5


def test_without_current_nothing_but_friction_holds_the_rotor(p):
    plant = standing()
    plant.rotor.commanded = 1
    move(p, 0, StepperLines(disable=1), plant)
    assert plant.rotor.strength == 0.0
    assert plant.rotor.velocity == 0.0
    move(p, 1, StepperLines(), plant)
    assert plant.rotor.strength == 1.0
    assert plant.rotor.velocity > 0.0
