"""What does not go together in the torque of a stepper, and the nearest value that would do.

Line numbers are those of the packaged zoom without its head comment: [axis] stands in line 1. Every value that a remedy
names is tried: it is accepted, and of its two neighbours one is not.
"""

import time

import pytest
from tests.bad_files import edit, params
from tests.remedies import broken_rules, check_rule
from tests.remedies import given as given_in_full

from detent.errors import InputError
from detent.methods.stepper_envelope import torque_rules
from detent.methods.stepper_envelope.torque_rules import TORQUE_RULES

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
        '"winding"',
        f'{A}.motor.resistance (its default) stated, as pull_out = "winding" needs it',
        f'add resistance = "12 ohm" in [{A}.motor], or name a motor of the catalogue that has it, or choose another',
        others=2,
    ),
    edit(
        "no corner frequency",
        'corner_frequency = "1200 Hz"',
        "",
        "18:1",
        f"{A}.motor.pull_out",
        '"first order"',
        f'{A}.motor.corner_frequency (its default) stated, as pull_out = "first order" needs it',
        f'add corner_frequency = "20 kHz" in [{A}.motor], or choose another pull_out',
    ),
    given(
        "no points",
        POINTS,
        key="motor.pull_out",
        came="points",
        allowed=f'{A}.motor.curve_frequency (its default) two or more frequencies, as pull_out = "points" needs them, '
        "here 0",
        remedy='curve_frequency = ["500 Hz", "2 kHz"] and curve_torque = ["45 mN*m", "20 mN*m"]',
    ),
    given(
        "one point",
        *curve('["1 kHz"]', '["45 mN*m"]'),
        key="motor.curve_frequency",
        came='["1 kHz"]',
        allowed="two or more frequencies",
        remedy="state the points of the curve",
    ),
    given(
        "a torque is missing",
        *curve('["100 Hz", "5 kHz"]', '["45 mN*m"]'),
        key="motor.curve_torque",
        came='["45 mN*m"]',
        allowed="as many as curve_frequency has, 2, here 1",
        remedy="one torque for each frequency",
    ),
    given(
        "falling frequencies",
        *curve('["5 kHz", "100 Hz"]', '["20 mN*m", "45 mN*m"]'),
        key="motor.curve_frequency",
        came='["5 kHz", "100 Hz"]',
        allowed="frequencies that rise, each once",
        remedy=f'set {A}.motor.curve_frequency = ["100 Hz", "5 kHz"] and {A}.motor.curve_torque = '
        '["45 mN*m", "20 mN*m"]',
    ),
    given(
        "a frequency twice",
        *curve('["100 Hz", "100 Hz"]', '["20 mN*m", "45 mN*m"]'),
        key="motor.curve_frequency",
        came='["100 Hz", "100 Hz"]',
        allowed="each once",
        remedy="remove what stands there twice",
    ),
    given(
        "no torque at standstill",
        *curve('["100 Hz", "5 kHz"]', '["0 N*m", "45 mN*m"]'),
        key="motor.curve_torque",
        came='["0 N*m", "45 mN*m"]',
        allowed="above 0 N*m at the first frequency",
        remedy="the pull-out torque at standstill",
    ),
]

TORQUE = [
    given(
        "more than it holds",
        "motor.pull_out_torque=70 mN*m",
        key="motor.pull_out_torque",
        came="70 mN*m",
        allowed="up to the holding torque at the current of the drive, 60 mN*m",
        remedy=f'set {A}.motor.pull_out_torque = "60 mN*m" or set {A}.motor.holding_torque = "70 mN*m"',
    ),
    given(
        "half the current holds half the torque",
        "motor.rated_current=1 A",
        "drive.current=500 mA",
        key="drive.current",
        came="500 mA",
        allowed=f'{A}.motor.pull_out_torque ("45 mN*m") up to the holding torque at the current of the drive, 30 mN*m',
        remedy=f'set {A}.motor.holding_torque = "90 mN*m"',
    ),
    given(
        "a curve above what it holds",
        *curve('["100 Hz", "5 kHz"]', '["70 mN*m", "20 mN*m"]'),
        key="motor.curve_torque",
        came='["70 mN*m", "20 mN*m"]',
        allowed="up to the holding torque",
        remedy=f'set {A}.motor.holding_torque = "70 mN*m"',
    ),
    given(
        "no torque to accelerate with",
        "mechanics.friction_torque=25 mN*m",
        key="mechanics.friction_torque",
        came="25 mN*m",
        allowed="below 21.35 mN*m: the pull-out torque at the start frequency, 42.69 mN*m at 400 Hz, over",
        remedy=f'set {A}.mechanics.friction_torque = "6.402 mN*m"',
    ),
    given(
        "more friction than the motor holds",
        "mechanics.friction_torque=70 mN*m",
        key="mechanics.friction_torque",
        came="70 mN*m",
        allowed="nothing is left to accelerate with",
        remedy=f'set {A}.mechanics.friction_torque = "6.402 mN*m"',
    ),
    given(
        "a safety that leaves nothing",
        "drive.torque_safety=8",
        key="drive.torque_safety",
        came="8",
        allowed=f'{A}.mechanics.friction_torque ("6 mN*m") below 5.336 mN*m',
        remedy=f'set {A}.mechanics.friction_torque = "1.552 mN*m" or set {A}.drive.torque_safety = 2.132',
    ),
]

RAMP = [
    given(
        "the torque ends below the speed",
        "limits.speed=25 mm/s",
        key="limits.speed",
        came="25 mm/s",
        allowed="such that the pull-out torque over torque_safety is enough for friction and for 2048 steps of ramp up "
        "to it; here it ends with entry 415 at 21.42 mm/s, 4.285 kHz",
        remedy=f'set {A}.limits.speed = "21.42 mm/s" or set {A}.drive.torque_safety = 1.727',
    ),
    given(
        "a motor too slow for the speed",
        "motor.corner_frequency=1 kHz",
        key="motor.corner_frequency",
        came="1 kHz",
        allowed=f'{A}.limits.speed ("20 mm/s") such that the pull-out torque',
        remedy=f'set {A}.limits.speed = "17.89 mm/s" or set {A}.drive.torque_safety = 1.8',
    ),
    given(
        "the points of the curve end below the speed",
        *curve('["100 Hz", "3 kHz"]', '["45 mN*m", "20 mN*m"]'),
        key="motor.pull_out",
        came="points",
        allowed="it ends with entry 111 at 14.97 mm/s, 2.993 kHz",
        remedy=f'set {A}.limits.speed = "14.99 mm/s"',
    ),
    given(
        "a ramp that is too long",
        "limits.acceleration=15 mm/s^2",
        key="limits.acceleration",
        came="15 mm/s^2",
        allowed="such that the ramp up to limits.speed has 2048 entries or fewer, each 0.5 Hz above the last; here it "
        "has 2642 entries",
        remedy=f'set {A}.limits.acceleration = "19.35 mm/s^2" or set {A}.limits.speed = "17.63 mm/s"',
    ),
    given(
        "a ramp that gains nothing",
        "limits.acceleration=1 mm/s^2",
        key="limits.acceleration",
        came="1 mm/s^2",
        allowed="here it ends with entry 1 at 2 mm/s, 400 Hz",
        remedy=f'set {A}.limits.acceleration = "19.35 mm/s^2"',
    ),
]

# Of the stage: motors from the catalogue, whose torque depends on the supply.
STAGE = [
    given_in_full(
        "supply too low for the speed",
        f"{X}.drive.supply=10 V",
        f"{X}.limits.speed=40 mm/s",
        key=f"{X}.limits.speed",
        came="40 mm/s",
        allowed="it ends with entry 400 at 21.84 mm/s, 4.369 kHz",
        remedy=f'set {X}.limits.speed = "21.84 mm/s" or set {X}.drive.torque_safety = 1.083 or '
        f'set {X}.drive.supply = "16.43 V"',
    ),
    given_in_full(
        "friction that holds the rotor off its step",
        "controller.tolerance=0.04",
        key="controller.tolerance",
        came="0.04",
        allowed=f'{X}.mechanics.friction_torque ("20 mN*m") up to 16.95 mN*m: against more the field of a resting '
        "motor does not bring the rotor within 0.04 steps",
        remedy=f'set {X}.mechanics.friction_torque = "16.95 mN*m" or set controller.tolerance = 0.0472',
    ),
    given_in_full(
        "a rest that friction decides",
        "controller.tolerance=2",
        f"{X}.drive.torque_safety=1",
        f"{X}.mechanics.friction_torque=191 mN*m",
        f"{X}.limits.speed=3 mm/s",
        key=f"{X}.mechanics.friction_torque",
        came="191 mN*m",
        allowed="up to 190.9 mN*m: against more the field of a resting motor does not bring the rotor within 0.5 steps",
        remedy=f'set {X}.mechanics.friction_torque = "190.9 mN*m"',
    ),
]


@pytest.mark.parametrize("bad", params(constants=CONSTANTS, torque=TORQUE, ramp=RAMP))
def test_rule(bad, good_text, load_text):
    check_rule(bad, good_text, load_text)


@pytest.mark.parametrize("bad", params(stage=STAGE))
def test_rule_of_the_stage(bad, stage_text, load_text):
    check_rule(bad, stage_text, load_text)


def test_every_rule_is_broken_by_an_entry_above(good_text, stage_text, load_text, monkeypatch):
    broken = broken_rules("stepper_envelope", [*CONSTANTS, *TORQUE, *RAMP], good_text, load_text, monkeypatch)
    broken |= broken_rules("stepper_envelope", STAGE, stage_text, load_text, monkeypatch)
    assert broken == {rule.__name__ for rule in TORQUE_RULES}


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
    from detent.methods.stepper_envelope.system import RAMP as ROOM
    from detent.planning.step_envelope import MAX_RAMP

    assert torque_rules.MAX_RAMP == MAX_RAMP == ROOM
