"""Warnings about a stepper-envelope axis that can be built; each value that a remedy names ends its warning."""

import pytest
from tests.property import step_motors
from tests.remedies import alternatives

from detent.methods.stepper_envelope import cautions
from detent.methods.stepper_envelope.cautions import find_cautions

A, X = "stepper.group_a", "stepper.x"


def found_in(load_text, text, *overrides):
    return {caution.name: caution for caution in find_cautions(load_text(text, *overrides).spec)}


@pytest.mark.parametrize(
    "overrides",
    [
        (),
        (f"{A}.limits.travel=40.003 mm",),
        ("controller.words=frequency",),
        ("controller.settle_time=6 ms",),
        (f"{A}.drive.reversal_pause=0", f"{A}.drive.start_safety=4.3"),
        (f"{A}.motor.rated_current=1 A",),
        (f"{A}.extremes.turn=2.275 mm",),
        (f"{A}.zone.near.end=10.025 mm",),
        (f"{A}.limits.speed=1.9 mm/s", f"{A}.zone.near.speed=1.9 mm/s", f"{A}.zone.far.speed=1.9 mm/s"),
    ],
)
def test_axes_with_nothing_to_warn_about(load_text, good_text, overrides):
    assert found_in(load_text, good_text, *overrides) == {}


@pytest.mark.parametrize(
    "overrides",
    [
        (),
        (f"{X}.drive.current=800 mA",),
        (f"{X}.drive.bridge_resistance=500 mohm",),
        # What the catalogue says beside what a file states is no key without effect.
        (f"{X}.motor.pull_out=first order", f"{X}.motor.pull_out_torque=0.2 N*m", f"{X}.motor.corner_frequency=2 kHz"),
    ],
)
def test_stages_with_nothing_to_warn_about(load_text, stage_text, overrides):
    assert found_in(load_text, stage_text, *overrides) == {}


def test_the_margins_are_those_in_which_the_random_motors_are_drawn():
    assert pytest.approx(step_motors.START, rel=1e-4) == cautions.START_RESERVE < step_motors.START
    assert step_motors.AT_START == cautions.LEAST_NEAR_START
    assert step_motors.USED == cautions.MOST_USED
    assert step_motors.FRICTION == cautions.MOST_FRICTION
    assert 0.5 / step_motors.RELOAD_TICKS > cautions.MOST_ROUNDING


CASES = [
    (
        ["drive.start_safety=2"],
        "start frequency",
        ["424.2 Hz, 1.55 x the natural frequency of the loaded rotor", "up to 1.46 x", "drive.start_safety = 2.121 or"],
    ),
    (
        ["drive.start_safety=1.5"],
        "drive.start_safety",
        ["1.5; should be at least 2", "an old or a warm motor", "drive.start_safety = 2.0"],
    ),
    (
        ["motor.corner_frequency=800 Hz", "limits.speed=14 mm/s"],
        "torque near the start frequency",
        ["0.89 of that at standstill, at 400 Hz", "at least 0.9 of it up to 1.46 x", "less inductance"],
    ),
    (
        ["drive.reversal_pause=0"],
        "drive.reversal_pause",
        ["0 with a start frequency of 1.46 x", "above 0.73 x", "reversal_pause = 1 or", "start_safety = 4.242"],
    ),
    (
        ["limits.acceleration=0.5 m/s^2"],
        "torque used on the ramp",
        ["0.51 of what there is, at 2.713 kHz", "up to 0.45", 'acceleration = "234 mm/s^2"', 'speed = "11.78 mm/s"'],
    ),
    (
        ["mechanics.friction_torque=6.2 mN*m"],
        "friction",
        ["6.2 mN*m, 0.103 of the holding torque", "up to 0.1 of it, 6 mN*m", 'friction_torque = "6 mN*m"'],
    ),
    (
        ["drive.torque_safety=1.9"],
        "drive.torque_safety",
        ["1.9; should be at least 2", "those of a bench", "drive.torque_safety = 2.0"],
    ),
    (
        ["method.rule=literal"],
        "method.rule",
        ["does not begin at a start extreme", "loses steps", 'method.rule = "ramp-limited"'],
    ),
    (
        ["drive.start_safety=4", "zone.near.speed=1.3 mm/s"],
        "zone.near.speed",
        ["1.3 mm/s, 260 Hz", "below 219.1 Hz or above 342.4 Hz", 'speed = "1.712 mm/s" or', 'speed = "1.095 mm/s"'],
    ),
    (
        ["drive.start_safety=3", *(f"{key}.speed=1.5 mm/s" for key in ("limits", "zone.near", "zone.far"))],
        "limits.speed",
        ["1.5 mm/s, 300 Hz", "the natural frequency is 273.9 Hz", "choose another lead"],
    ),
    (
        ["extremes.turn=2 mm"],
        "way between extremes.start and extremes.turn",
        ["400 steps", "455 or more, 2.275 mm", "reaches 19.38 mm/s, 3.877 kHz", 'set stepper.group_a.limits.speed = "'],
    ),
    (
        ["extremes.stop=39 mm"],
        "way between extremes.stop and extremes.turn",
        ["200 steps", "14.21 mm/s", "or move the extremes farther apart"],
    ),
    (
        ["extremes.stop=39.95 mm"],
        "way between extremes.stop and extremes.turn",
        ["10 steps", "reaches 3.464 mm/s, 692.8 Hz", "do: move the extremes farther apart"],
    ),
    (
        ["zone.near.end=10.02 mm"],
        "zone.near",
        ["4 steps long", "at least 5 steps, 25 um", "every step that it touches"],
    ),
    (
        ["motor.rated_current=1 A", "drive.current=1.2 A"],
        "drive.current",
        ["1.2 A", "up to motor.rated_current, 1 A", "overheats", 'drive.current = "1 A"'],
    ),
    (
        ["drive.current=1 A"],
        "drive.current",
        ["stated with motor.rated_current", "the whole is assumed", "or remove drive.current"],
    ),
    (
        [
            "motor.resistance=1 ohm",
            "drive.supply=48 V",
            "drive.bridge_resistance=1 ohm",
            'motor.curve_torque=["1 N*m"]',
        ],
        "keys without effect",
        [
            "motor.curve_torque, motor.resistance, drive.supply, drive.bridge_resistance",
            'those of pull_out = "first order"',
            "from corner_frequency and pull_out_torque alone",
        ],
    ),
]


@pytest.mark.parametrize(("overrides", "name", "words"), CASES)
def test_warnings_say_value_limit_consequence_and_remedy(load_text, good_text, overrides, name, words):
    given = [f"{A}.{text}" for text in overrides]
    found = found_in(load_text, good_text, *given)
    for word in words:
        assert word in str(found[f"group_a: {name}"])
    for alternative in alternatives(found[f"group_a: {name}"].remedy):
        assert f"group_a: {name}" not in found_in(load_text, good_text, *given, *alternative), alternative


OF_THE_STAGE = [
    (
        ["motor.inductance=66 mH", "limits.speed=4 mm/s"],
        "torque near the start frequency",
        ["0.53 of that at standstill, at 425.7 Hz", 'drive.supply = "40.25 V"'],
    ),
    (
        ["drive.supply=4 V", "limits.speed=4 mm/s", "mechanics.friction_torque=5 mN*m"],
        "drive.supply",
        ["4 V; should be at least current x resistance, 5.3 V", "not even at rest", 'drive.supply = "5.3 V"'],
    ),
    (
        ["drive.current=500 mA"],
        "friction",
        ["20 mN*m, 0.148 of the holding torque", "13.5 mN*m"],
    ),
    (
        ["motor.pull_out=first order", "motor.pull_out_torque=0.2 N*m", "motor.corner_frequency=2 kHz",
         "motor.inductance=7 mH"],
        "keys without effect",
        ["motor.inductance; should be", "remove them"],
    ),
    (
        ["motor.pull_out_torque=0.2 N*m"],
        "keys without effect",
        ["motor.pull_out_torque", "from inductance and resistance alone"],
    ),
    (
        ["limits.acceleration=3 m/s^2"],
        "torque used on the ramp",
        ["0.84 of what there is", 'limits.acceleration = "852 mm/s^2"', 'limits.speed = "4.939 mm/s"'],
    ),
]  # fmt: skip


@pytest.mark.parametrize(("overrides", "name", "words"), OF_THE_STAGE)
def test_warnings_about_a_motor_of_the_catalogue(load_text, stage_text, overrides, name, words):
    given = [f"{X}.{text}" for text in overrides]
    found = found_in(load_text, stage_text, *given)
    for word in words:
        assert word in str(found[f"x: {name}"])
    for alternative in alternatives(found[f"x: {name}"].remedy):
        assert f"x: {name}" not in found_in(load_text, stage_text, *given, *alternative), alternative


SHARED = [
    (
        ["controller.settle_time=3 ms"],
        "controller.settle_time, group_a",
        ["3 ms; should be at least 5.74 ms", "its decay to 0.5 steps", 'settle_time = "5.741 ms"'],
    ),
    (
        ["controller.settle_time=3 ms", "controller.tolerance=1"],
        "controller.settle_time, group_a",
        ["at least 3.726 ms", "decay to 1 steps"],
    ),
    (
        ["controller.settle_time=5 ms", "stepper.group_b.mechanics.screw_inertia=9 g*cm^2"],
        "controller.settle_time, group_b",
        ["5 ms"],
    ),
    (
        ["controller.timer=500 kHz"],
        "rounding of the frequencies, group_a",
        ["up to 0.39", "as reload words at 500 kHz", "up to 0.2 %", 'controller.timer = "1 MHz"'],
    ),
    (
        ["controller.words=frequency", f"{A}.drive.start_safety=6"],
        "rounding of the frequencies, group_a",
        ["as frequency words at 1 MHz", 'set controller.words = "reload"'],
    ),
    (
        [
            "controller.words=frequency",
            "controller.timer=500 kHz",
            f"{A}.drive.start_safety=6",
            "stepper.group_b.drive.start_safety=6",
        ],
        "rounding of the frequencies, group_a",
        ['do: set controller.timer = "1 MHz" and controller.words = "reload"'],
    ),
]


@pytest.mark.parametrize(("overrides", "name", "words"), SHARED)
def test_warnings_about_what_the_motors_share(load_text, good_text, overrides, name, words):
    found = found_in(load_text, good_text, *overrides)
    for word in words:
        assert word in str(found[name])
    assert len([other for other in found if other.startswith(name.split(",")[0])]) == 1
    for alternative in alternatives(found[name].remedy):
        assert name not in found_in(load_text, good_text, *overrides, *alternative), alternative


def test_both_ways_of_a_short_run_are_one_warning(load_text, good_text):
    assert len(found_in(load_text, good_text, f"{A}.extremes.turn=2 mm")) == 1
    assert len(found_in(load_text, good_text, f"{A}.extremes.turn=2 mm", f"{A}.extremes.stop=1 mm")) == 2
