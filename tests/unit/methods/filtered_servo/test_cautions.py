"""Warnings about a filtered-servo axis that can be built; each value that a remedy names ends its warning."""

import pytest
from tests.remedies import alternatives

from detent.methods.filtered_servo.cautions import find_cautions

QUIET = ("method.coefficient=0.5",)
VOLTAGE = ("drive.amplifier=voltage", "method.command_acceleration=0.3 m/s^2", *QUIET)
WIDE = ("method.counter_bits=9", "method.position_bits=10")
LONG = ("method.filter=none", "method.scale=1", "method.sample_period=20 ms", "method.counter_bits=12")


def cautions(load_text, text, *overrides):
    return {caution.name: caution for caution in find_cautions(load_text(text, *overrides).spec)}


def test_the_worked_numbers_of_the_patent_are_lightly_damped(load_text, good_text):
    found = cautions(load_text, good_text)
    (text,) = (str(caution) for caution in found.values())
    assert "damping of the loop: 0.0921, with A B / K1 = 1; should be at least 0.25, A B / K1 at least 4" in text
    assert "a stop rings (trap 1)" in text
    assert 'set method.scale = 16 and method.sample_period = "1250 us", which keeps KV' in text
    assert "set method.coefficient = 0.5" in text


@pytest.mark.parametrize("overrides", [QUIET, VOLTAGE, ("method.filter=none",)])
def test_axes_with_nothing_to_warn_about(load_text, good_text, overrides):
    assert cautions(load_text, good_text, *overrides) == {}


CASES = [
    (
        LONG,
        "stability of the loop",
        ["gain margin 0.685, spectral radius 1.1525", "grows until", 'set method.sample_period = "13517 us"'],
    ),
    (
        ["drive.current_per_count=70 mA", "drive.word_bits=9"],
        "stability of the loop",
        ["gain margin 1.28", "a little more gain", "lower drive.current_per_count"],
    ),
    (
        ["drive.amplifier=voltage", "drive.supply=30 V"],
        "stability of the loop",
        ["gain margin 1.27", "lower drive.supply"],
    ),
    (
        ["mechanics.moving_mass=0 kg", "motor.rotor_inertia=1 g*cm^2", "drive.current_per_count=281 mA"],
        "stability of the loop",
        ["gain margin 0.000", "do: lower drive.current_per_count"],
    ),
    ([], "damping of the loop", ["trap 1"]),
    (VOLTAGE[:2], "damping of the loop", ["0.149", "set method.coefficient = 0.5"]),
    (
        ["method.filter=none", "method.scale=1"],
        "damping of the loop",
        ["0.156", "too weak for this gain", "set method.scale = 2, which lowers KV"],
    ),
    (
        ["method.scale=2"],
        "damping of the loop",
        ["A B / K1 = 0.5", "set method.coefficient = "],
    ),
    (
        ["limits.speed=4 mm/s", *QUIET],
        "count at limits.speed",
        ["4 pulses in a sample", "25 % of the largest speed", 'set method.sample_period = "6250 us"'],
    ),
    (
        ["limits.speed=0.2 mm/s", *QUIET],
        "count at limits.speed",
        ["0.2 pulses", "use a finer encoder"],
    ),
    (
        ["method.filter=none", "method.scale=10"],
        "jump of the drive word for one pulse",
        ["10 counts, A x B", 'set method.coefficient = 0.5 with method.filter = "float" or set method.scale = 8'],
    ),
    (
        ["method.coefficient=0.5", "method.scale=20"],
        "jump of the drive word for one pulse",
        ["10 counts", "set method.coefficient = 0.25 or set method.scale = 16"],
    ),
    (
        ["method.command_acceleration=5 um/s^2"],
        "method.command_acceleration",
        ["10 millionths of a pulse per second", "rounded down", 'set method.command_acceleration = "10 um/s^2"'],
    ),
    (
        ["limits.speed=124 mm/s", "method.command_acceleration=2.4 m/s^2"],
        "count on reaching limits.speed",
        ["pulses in a sample", "up to 126", "is a fault", "set method.counter_bits = 9"],
    ),
    (
        ["limits.speed=127 mm/s", "method.command_acceleration=2 m/s^2", *WIDE],
        "following error on reaching limits.speed",
        ["pulses", "up to 511", "leaves its range", "set method.position_bits = 11"],
    ),
    (
        ["limits.effort=300 N"],
        "limits.effort",
        ["300 N", "a full drive word gives, 280.9 N", 'set limits.effort = "280.8 N"'],
    ),
    (
        [f"mechanics.friction.{side}.static=281 N" for side in ("right", "left")],
        "static friction",
        ["281 N", "below the largest force, 280 N", "never breaks loose"],
    ),
    (
        [*VOLTAGE, "limits.speed=125 mm/s", "mechanics.friction.right.viscous=1000 N*s/m", "method.counter_bits=9"],
        "drive at limits.speed",
        ["counts", "the largest force holds 93.39 mm/s", 'set limits.speed = "93.39 mm/s"'],
    ),
    (
        ["method.command_acceleration=3 m/s^2"],
        "force for method.command_acceleration",
        ["3 m/s^2", "up to 2.512 m/s^2", 'set method.command_acceleration = "2.512 m/s^2"'],
    ),
    (
        ["mechanics.friction.right.static=9 N"],
        "following error that friction holds",
        ["up to 4 pulses", "method.in_position, 2", "set method.in_position = 4"],
    ),
    (
        ["mechanics.friction.right.static=200 N", "method.position_gain=0.08", "method.position_bits=15"],
        "following error that friction holds",
        ["up to 1130 pulses", "raise method.position_gain"],
    ),
    (
        ["method.filter=fixed", "method.fraction_bits=0"],
        "fixed-point filter",
        ["sticks up to 3 pulses below", "set method.fraction_bits = 5"],
    ),
    (
        ["drive.pwm_frequency=1 kHz"],
        "PWM period",
        ["1 ms", "a tenth of the sample period, 500 us", 'set drive.pwm_frequency = "2 kHz"'],
    ),
    (
        [*VOLTAGE, "motor.inductance=3 mH"],
        "electrical time constant",
        ["1.5 ms", "a fifth of the sample period, 1 ms", 'set motor.inductance = "2 mH"'],
    ),
    (
        ["motor.max_current=4 A"],
        "current of the largest drive word",
        ["4.456 A", "motor.max_current, 4 A", 'set limits.effort = "251.3 N"'],
    ),
    (
        [*VOLTAGE, "motor.max_current=3 A"],
        "current of the largest drive word",
        ["4.456 A", 'set limits.effort = "188.4 N"'],
    ),
]


@pytest.mark.parametrize(("overrides", "name", "words"), CASES)
def test_warnings_say_value_limit_consequence_and_remedy(load_text, good_text, overrides, name, words):
    found = cautions(load_text, good_text, *overrides)
    for word in words:
        assert word in str(found[name])
    for alternative in alternatives(found[name].remedy):
        more = ["method.filter=float"] if "with method.filter" in found[name].remedy else []
        assert name not in cautions(load_text, good_text, *overrides, *more, *alternative), alternative
