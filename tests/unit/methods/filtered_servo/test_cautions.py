"""Warnings about a filtered-servo axis that can be built; each value that a remedy names ends its warning."""

import pytest
from tests.remedies import check_caution

from detent.methods.filtered_servo.checks import find_cautions

QUIET = ("method.coefficient=0.5",)
VOLTAGE = ("drive.amplifier=voltage", "method.command_acceleration=0.3 m/s^2", *QUIET)
WIDE = ("method.counter_bits=9", "method.position_bits=10")
LONG = ("method.filter=none", "method.scale=1", "method.sample_period=20 ms", "method.counter_bits=12")


def cautions(load_text, text, *overrides):
    return {caution.name: caution for caution in find_cautions(load_text(text, *overrides).spec)}


def test_the_worked_numbers_of_the_patent_are_lightly_damped(load_text, good_text):
    (found,) = cautions(load_text, good_text).values()
    assert (found.name, found.value) == ("damping of the loop", "0.0921, with A B / K1 = 1")


@pytest.mark.parametrize("overrides", [QUIET, VOLTAGE, ("method.filter=none",)])
def test_axes_with_nothing_to_warn_about(load_text, good_text, overrides):
    assert cautions(load_text, good_text, *overrides) == {}


CASES = [
    (LONG, "stability of the loop"),
    (["drive.current_per_count=70 mA", "drive.word_bits=9"], "stability of the loop"),
    (["drive.amplifier=voltage", "drive.supply=30 V"], "stability of the loop"),
    (
        ["mechanics.moving_mass=0 kg", "motor.rotor_inertia=1 g*cm^2", "drive.current_per_count=281 mA"],
        "stability of the loop",
    ),
    ([], "damping of the loop"),
    (VOLTAGE[:2], "damping of the loop"),
    (["method.filter=none", "method.scale=1"], "damping of the loop"),
    (["method.scale=2"], "damping of the loop"),
    (["limits.speed=4 mm/s", *QUIET], "count at limits.speed"),
    (["limits.speed=0.2 mm/s", *QUIET], "count at limits.speed"),
    (["method.filter=none", "method.scale=10"], "jump of the drive word for one pulse"),
    (["method.coefficient=0.5", "method.scale=20"], "jump of the drive word for one pulse"),
    (["method.command_acceleration=5 um/s^2"], "method.command_acceleration"),
    (["limits.speed=124 mm/s", "method.command_acceleration=2.4 m/s^2"], "count on reaching limits.speed"),
    (
        ["limits.speed=127 mm/s", "method.command_acceleration=2 m/s^2", *WIDE],
        "following error on reaching limits.speed",
    ),
    (["limits.effort=300 N"], "limits.effort"),
    ([f"mechanics.friction.{side}.static=281 N" for side in ("right", "left")], "static friction"),
    (
        [*VOLTAGE, "limits.speed=125 mm/s", "mechanics.friction.right.viscous=1000 N*s/m", "method.counter_bits=9"],
        "drive at limits.speed",
    ),
    (["method.command_acceleration=3 m/s^2"], "force for method.command_acceleration"),
    (["mechanics.friction.right.static=9 N"], "following error that friction holds"),
    (
        ["mechanics.friction.right.static=200 N", "method.position_gain=0.08", "method.position_bits=15"],
        "following error that friction holds",
    ),
    (["method.filter=fixed", "method.fraction_bits=0"], "fixed-point filter"),
    (["drive.pwm_frequency=1 kHz"], "PWM period"),
    ([*VOLTAGE, "motor.inductance=3 mH"], "electrical time constant"),
    (["motor.max_current=4 A"], "current of the largest drive word"),
    ([*VOLTAGE, "motor.max_current=3 A"], "current of the largest drive word"),
]


@pytest.mark.parametrize(("overrides", "name"), CASES)
def test_warnings_say_value_limit_consequence_and_remedy(load_text, good_text, golden, overrides, name):
    found = cautions(load_text, good_text, *overrides)
    golden(f"{name}, {' '.join(overrides)}", found[name])
    check_caution(lambda *more: cautions(load_text, good_text, *more), overrides, name, found[name])
