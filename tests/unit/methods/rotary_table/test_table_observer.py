"""The true angle of table and motor, with all turns."""

import math

import pytest
from tests.rotary_table_rig import RATIO, Rig

import detent
from detent.methods.load import load_spec
from detent.methods.rotary_table.host import TableHost, rotary_table_machine
from detent.methods.rotary_table.run import TableObserver, endless_phase
from detent.plant.gearing import fill_eccentricity, output_phase

pytestmark = pytest.mark.compiled

TURN = 2**32


def observed(*overrides):
    spec = load_spec(detent.example("rotary_table.toml"), overrides)
    host = TableHost(spec)
    host.start()
    return host, TableObserver(spec, host.machine)


@pytest.mark.parametrize("turns", [0.0, 89.999, 90.0, -0.001, -90.5, 12345.678, 9e9 + 0.25])
@pytest.mark.parametrize("slack", [0.0, 0.3, -0.3])
def test_the_phase_goes_on_beyond_a_turn(turns, slack):
    rig = Rig(0)
    fill_eccentricity(rig.p.plant.train.gear, 0.01, 0.5)
    motor = rig.r.plant.train.motor
    motor.turns, motor.angle = math.floor(turns), (turns - math.floor(turns)) * 2 * math.pi
    rig.r.plant.train.gear.slack = slack
    phase = endless_phase(rig.p, rig.r)
    assert phase % TURN == output_phase(rig.p.plant.train.gear, slack, motor.turns, motor.angle)
    assert phase / TURN == pytest.approx((turns + slack / 2 / math.pi) / RATIO, abs=0.0017)


def test_the_phase_is_as_fine_after_a_million_turns():
    rig = Rig(0)
    motor = rig.r.plant.train.motor
    phases = []
    for turns in (0, 10**6 * RATIO):
        motor.turns, motor.angle = turns, 1e-6
        phases.append(endless_phase(rig.p, rig.r))
    assert phases[1] - phases[0] == 10**6 * TURN


@pytest.mark.parametrize("degrees", [0, 10, 350, -10, -350])
def test_the_angle_at_power_on_is_that_of_the_axis_file_and_so_is_the_target(degrees):
    host, observer = observed(f"mechanics.start_angle={degrees} deg")
    count = host.spec.count
    assert observer.angle == pytest.approx(math.radians(degrees), abs=count)
    assert observer.target == pytest.approx(math.radians(degrees), abs=count)
    assert observer.miss * host.spec.detector.fine.counts == pytest.approx(-0.5)  # it stands in the middle of a count
    position = host.machine.state.controller.positioner.angle.position
    assert position == round(degrees / 360 * host.spec.period) % host.spec.period


def test_angle_and_target_stay_together_over_turns_and_boundaries():
    host, observer = observed("mechanics.start_angle=-10 deg")
    for direction, seconds in ((1, 20.0), (-1, 31.0)):
        host.press(direction, math.radians(60))
        host.machine.pass_time(seconds)
        assert observer.speed == pytest.approx(direction * math.radians(60), rel=1e-3)
        host.release()
        host.machine.pass_time(1.0)
        host.acknowledge()
        host.machine.pass_time(1.0)
        assert abs(observer.miss) * host.spec.detector.fine.counts < 2.5
        assert observer.target == pytest.approx(observer.angle, abs=2.5 * host.spec.count)
    # Each jog goes on up to the task's next pass.
    assert math.degrees(observer.angle) == pytest.approx(-10 + 20 * 60 - 31 * 60, abs=2.5)
    assert host.machine.state.controller.positioner.angle.crossings > 3


def test_a_detector_that_is_wrong_by_a_motor_turn_shows_as_a_miss():
    for error, turns in (("1.8 deg", 0), ("2.2 deg", 1), ("-2.2 deg", -1)):
        _, observer = observed(f"detector.coarse.alignment_error={error}", "mechanics.start_angle=180 deg")
        assert observer.miss == pytest.approx(turns, abs=0.001)


def test_backlash_and_eccentricity_are_in_the_angle_not_in_the_miss():
    spec = load_spec(
        detent.example("rotary_table.toml"), ["mechanics.backlash=0.4 deg", "mechanics.eccentricity=1 deg"]
    )
    machine = rotary_table_machine(spec)
    machine.pass_ticks(3)
    observer = TableObserver(spec, machine)
    state = machine.state
    state.controller.positioner.dial, state.controller.positioner.plus = round(spec.per_interrupt(1.0)), 1
    machine.pass_time(1.5)  # in the first quarter: the table leads by up to a degree, less the half backlash
    motor = (state.plant.train.motor.turns + state.plant.train.motor.angle / 2 / math.pi) * 360 / spec.ratio
    led = math.sin(math.radians(motor)) - 0.2
    assert math.degrees(observer.angle) - motor == pytest.approx(led, abs=0.01)
