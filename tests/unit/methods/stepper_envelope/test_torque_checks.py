"""What does not go together in the torque of a stepper.

Line numbers are those of the packaged zoom without its head comment: [axis] stands in line 1.
"""

import time

import pytest
from tests.bad_files import edit, params
from tests.bad_files import given as given_in_full
from tests.remedies import broken_rules, check_rule

from detent.errors import InputError
from detent.methods.stepper_envelope import rules

A, X = "stepper.group_a", "stepper.x"
POINTS = "motor.pull_out=points"


def given(name, *overrides, key, **more):
    """Overrides of the first motor of the zoom; the problem is that of its key."""
    return given_in_full(name, *(f"{A}.{text}" for text in overrides), key=f"{A}.{key}", **more)


def curve(hz, torque):
    return (POINTS, f"motor.curve_frequency={hz}", f"motor.curve_torque={torque}")


CONSTANTS = [
    edit(
        "winding without its constants",
        'pull_out = "first order"',
        'pull_out = "winding"',
        "18:1",
        f"{A}.motor.pull_out",
        others=2,
    ),
    edit("no corner frequency", 'corner_frequency = "1200 Hz"', "", "18:1", f"{A}.motor.pull_out"),
    given("no points", POINTS, key="motor.pull_out"),
    given("one point", *curve('["1 kHz"]', '["45 mN*m"]'), key="motor.curve_frequency"),
    given("a torque is missing", *curve('["100 Hz", "5 kHz"]', '["45 mN*m"]'), key="motor.curve_torque"),
    given("falling frequencies", *curve('["5 kHz", "100 Hz"]', '["20 mN*m", "45 mN*m"]'), key="motor.curve_frequency"),
    given("a frequency twice", *curve('["100 Hz", "100 Hz"]', '["20 mN*m", "45 mN*m"]'), key="motor.curve_frequency"),
    given("no torque at standstill", *curve('["100 Hz", "5 kHz"]', '["0 N*m", "45 mN*m"]'), key="motor.curve_torque"),
]

TORQUE = [
    given("more than it holds", "motor.pull_out_torque=70 mN*m", key="motor.pull_out_torque"),
    given(
        "half the current holds half the torque", "motor.rated_current=1 A", "drive.current=500 mA", key="drive.current"
    ),
    given(
        "a curve above what it holds", *curve('["100 Hz", "5 kHz"]', '["70 mN*m", "20 mN*m"]'), key="motor.curve_torque"
    ),
    given("no torque to accelerate with", "mechanics.friction_torque=25 mN*m", key="mechanics.friction_torque"),
    given("more friction than the motor holds", "mechanics.friction_torque=70 mN*m", key="mechanics.friction_torque"),
    given("a safety that leaves nothing", "drive.torque_safety=8", key="drive.torque_safety"),
]

RAMP = [
    given("the torque ends below the speed", "limits.speed=25 mm/s", key="limits.speed"),
    given("a motor too slow for the speed", "motor.corner_frequency=1 kHz", key="motor.corner_frequency"),
    given(
        "the points of the curve end below the speed",
        *curve('["100 Hz", "3 kHz"]', '["45 mN*m", "20 mN*m"]'),
        key="motor.pull_out",
    ),
    given("a ramp that is too long", "limits.acceleration=15 mm/s^2", key="limits.acceleration"),
    given("a ramp that gains nothing", "limits.acceleration=1 mm/s^2", key="limits.acceleration"),
]

# Of the stage: motors from the catalogue, whose torque depends on the supply.
STAGE = [
    given_in_full(
        "supply too low for the speed", f"{X}.drive.supply=10 V", f"{X}.limits.speed=40 mm/s", key=f"{X}.limits.speed"
    ),
    given_in_full(
        "friction that holds the rotor off its step", "controller.tolerance=0.04", key="controller.tolerance"
    ),
    given_in_full(
        "a rest that friction decides",
        "controller.tolerance=2",
        f"{X}.drive.torque_safety=1",
        f"{X}.mechanics.friction_torque=191 mN*m",
        f"{X}.limits.speed=3 mm/s",
        key=f"{X}.mechanics.friction_torque",
    ),
]


@pytest.mark.parametrize("bad", params(constants=CONSTANTS, torque=TORQUE, ramp=RAMP))
def test_rule(bad, good_text, load_text, golden):
    check_rule(bad, good_text, load_text, golden)


@pytest.mark.parametrize("bad", params(stage=STAGE))
def test_rule_of_the_stage(bad, stage_text, load_text, golden):
    check_rule(bad, stage_text, load_text, golden)


def test_every_rule_is_broken_by_an_entry_above(good_text, stage_text, load_text, monkeypatch):
    broken = broken_rules("stepper_envelope", [*CONSTANTS, *TORQUE, *RAMP], good_text, load_text, monkeypatch)
    broken |= broken_rules("stepper_envelope", STAGE, stage_text, load_text, monkeypatch)
    assert broken == {"_constants", "_curve", "_torques", "_ramp"}


@pytest.mark.parametrize(
    "overrides",
    [
        ("motor.pull_out_torque=60 mN*m",),
        ("motor.rated_current=1 A", "drive.current=1 A"),
        (*curve('["100 Hz", "5 kHz"]', '["45 mN*m", "20 mN*m"]'),),
    ],
)
def test_what_the_rules_let_pass(good_text, load_text, overrides):
    load_text(good_text, *(f"{A}.{text}" for text in overrides))


def test_a_wrong_key_gives_no_problem_of_the_rules_that_look_at_it(good_text, load_text):
    with pytest.raises(InputError) as caught:
        load_text(good_text, f"{A}.drive.torque_safety=0.5", f"{A}.limits.speed=25 mm/s", f"{A}.motor.pull_out=winding")
    assert {problem.key for problem in caught.value.problems} == {f"{A}.drive.torque_safety", f"{A}.motor.pull_out"}


@pytest.mark.parametrize(
    "overrides",
    [
        ("limits.speed=300 mm/s", "drive.supply=1 kV", "limits.acceleration=1 km/s^2", "mechanics.moving_mass=10 t"),
        ("limits.speed=100 m/s", "drive.torque_safety=20"),
        ("limits.acceleration=1 nm/s^2",),
    ],
)
def test_an_absurd_motor_is_refused_at_once(stage_text, load_text, overrides):
    begin = time.process_time()
    with pytest.raises(InputError):
        load_text(stage_text, *(f"{X}.{text}" for text in overrides))
    # Far more than it takes: what it must not do is to work out ramps for minutes.
    assert time.process_time() - begin < 60


def test_the_longest_ramp_is_that_of_the_control_unit():
    from detent.control.step_rule import RAMP as ROOM
    from detent.planning.step_envelope import MAX_RAMP

    assert rules.MAX_RAMP == MAX_RAMP == ROOM
