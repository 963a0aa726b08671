"""Warnings about a stepper-envelope axis that can be built; each value that a remedy names ends its warning."""

from functools import partial

import pytest
from tests.property import step_motors
from tests.remedies import check_caution

from detent.methods.stepper_envelope import checks
from detent.methods.stepper_envelope.checks import find_cautions

A, X = "stepper.group_a", "stepper.x"


def found_in(load_text, text, *overrides):
    return {caution.name: caution for caution in find_cautions(load_text(text, *overrides).spec)}


@pytest.mark.parametrize(
    "overrides",
    [
        (),
        (f"{A}.limits.travel=40.003 mm",),
        ("controller.words=frequency", "controller.timer=2 MHz"),
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
    assert pytest.approx(step_motors.START, rel=1e-4) == checks.START_RESERVE < step_motors.START
    assert step_motors.AT_START == checks.LEAST_NEAR_START
    assert step_motors.USED == checks.MOST_USED
    assert step_motors.FRICTION == checks.MOST_FRICTION
    assert 0.5 / step_motors.RELOAD_TICKS > checks.MOST_ROUNDING


CASES = [
    (["drive.start_safety=2"], "start frequency"),
    (["drive.start_safety=1.5"], "drive.start_safety"),
    (["motor.corner_frequency=800 Hz", "limits.speed=14 mm/s"], "torque near the start frequency"),
    (["drive.reversal_pause=0"], "drive.reversal_pause"),
    (["limits.acceleration=0.5 m/s^2"], "torque used on the ramp"),
    (["mechanics.friction_torque=6.2 mN*m"], "friction"),
    (["drive.torque_safety=1.9"], "drive.torque_safety"),
    (["method.rule=literal"], "method.rule"),
    (["drive.start_safety=4", "zone.near.speed=1.3 mm/s"], "zone.near.speed"),
    (
        ["drive.start_safety=3", *(f"{key}.speed=1.5 mm/s" for key in ("limits", "zone.near", "zone.far"))],
        "limits.speed",
    ),
    (["extremes.turn=2 mm"], "way between extremes.start and extremes.turn"),
    (["extremes.stop=39 mm"], "way between extremes.stop and extremes.turn"),
    (["extremes.stop=39.95 mm"], "way between extremes.stop and extremes.turn"),
    (["zone.near.end=10.02 mm"], "zone.near"),
    (["motor.rated_current=1 A", "drive.current=1.2 A"], "drive.current"),
    (["drive.current=1 A"], "drive.current"),
    (
        [
            "motor.resistance=1 ohm",
            "drive.supply=48 V",
            "drive.bridge_resistance=1 ohm",
            'motor.curve_torque=["1 N*m"]',
        ],
        "keys without effect",
    ),
]


@pytest.mark.parametrize(("overrides", "name"), CASES)
def test_warnings_say_value_limit_consequence_and_remedy(load_text, good_text, golden, overrides, name):
    given = [f"{A}.{text}" for text in overrides]
    found = found_in(load_text, good_text, *given)
    name = f"group_a: {name}"
    golden(f"{name}, {' '.join(overrides)}", found[name])
    check_caution(lambda *more: found_in(load_text, good_text, *more), given, name, found[name])


OF_THE_STAGE = [
    (
        ["motor.inductance=66 mH", "limits.speed=4 mm/s"],
        "torque near the start frequency",
    ),
    (
        ["drive.supply=4 V", "limits.speed=4 mm/s", "mechanics.friction_torque=5 mN*m"],
        "drive.supply",
    ),
    (
        ["drive.current=500 mA"],
        "friction",
    ),
    (
        ["motor.pull_out=first order", "motor.pull_out_torque=0.2 N*m", "motor.corner_frequency=2 kHz",
         "motor.inductance=7 mH"],
        "keys without effect",
    ),
    (
        ["motor.pull_out_torque=0.2 N*m"],
        "keys without effect",
    ),
    (
        ["limits.acceleration=3 m/s^2"],
        "torque used on the ramp",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("overrides", "name"), OF_THE_STAGE)
def test_warnings_about_a_motor_of_the_catalogue(load_text, stage_text, golden, overrides, name):
    given = [f"{X}.{text}" for text in overrides]
    found = found_in(load_text, stage_text, *given)
    name = f"x: {name}"
    golden(f"{name}, {' '.join(overrides)}", found[name])
    check_caution(lambda *more: found_in(load_text, stage_text, *more), given, name, found[name])


SHARED = [
    (["controller.settle_time=3 ms"], "controller.settle_time, group_a"),
    (["controller.settle_time=3 ms", "controller.tolerance=1"], "controller.settle_time, group_a"),
    (
        ["controller.settle_time=5 ms", "stepper.group_b.mechanics.screw_inertia=9 g*cm^2"],
        "controller.settle_time, group_b",
    ),
    (["controller.timer=500 kHz"], "rounding of the frequencies, group_a"),
    (["controller.words=frequency", f"{A}.drive.start_safety=6"], "rounding of the frequencies, group_a"),
    (
        [
            "controller.words=frequency",
            "controller.timer=500 kHz",
            f"{A}.drive.start_safety=6",
            "stepper.group_b.drive.start_safety=6",
        ],
        "rounding of the frequencies, group_a",
    ),
]


@pytest.mark.parametrize(("overrides", "name"), SHARED)
def test_warnings_about_what_the_motors_share(load_text, good_text, golden, overrides, name):
    found = found_in(load_text, good_text, *overrides)
    golden(f"{name}, {' '.join(overrides)}", found[name])
    assert len([other for other in found if other.startswith(name.split(",")[0])]) == 1
    at_bound = "rounding" not in name  # it jumps with the clock
    check_caution(partial(found_in, load_text, good_text), overrides, name, found[name], at_bound=at_bound)


def test_both_ways_of_a_short_run_are_one_warning(load_text, good_text):
    assert len(found_in(load_text, good_text, f"{A}.extremes.turn=2 mm")) == 1
    assert len(found_in(load_text, good_text, f"{A}.extremes.turn=2 mm", f"{A}.extremes.stop=1 mm")) == 2
