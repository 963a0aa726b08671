"""What does not go together in a rotary-table axis.

Line numbers are those of the packaged example without its head comment: [axis] stands in line 1, [limits] in 5.
"""

from dataclasses import replace

import pytest
from tests.bad_files import added, check_bad_file, edit, given, params
from tests.remedies import broken_rules, check_rule, named_value

from detent.errors import InputError
from detent.methods.rotary_table import checks
from detent.methods.rotary_table.checks import RULES

LONG_STROBE = ("mechanics.gear_ratio=2", "method.task_period=100 ms", "detector.fine.counts=65536")
COARSEST = (
    "method.strobe_period=0.2 ms",
    "method.interrupt_delay=0.1 ms",
    "mechanics.gear_ratio=2",
    "detector.fine.counts=16",
    "detector.clock=100 MHz",
)
FINE_COUNTS = ("mechanics.gear_ratio=1000", "detector.fine.counts=1000000", "detector.clock=1 GHz")
SLOW = ("limits.speed=5 deg/s", "position.1.speed=0.1 deg/s")


def without_position_speed(bad):
    """The same without the one position that states a speed: all have that of the limit."""
    return replace(bad, edits=(('speed = "30 deg/s"\n', ""),))


# The nearest whole number: its neighbours would do as well.
WHOLE = [
    edit("part of a turn", "gear_ratio = 90 ", "gear_ratio = 90.4 ", "20:1", "mechanics.gear_ratio"),
    given("nearly two", "mechanics.gear_ratio=2.2", key="mechanics.gear_ratio"),
    given("phase of the task", "method.task_phase=0.03 ms", key="method.task_phase"),
]

DETECTOR = [
    given("reduction", "detector.coarse.reduction=80.5", key="detector.coarse.reduction"),
    given(
        "registers",
        "mechanics.gear_ratio=1100",
        "detector.fine.counts=1000000",
        "detector.clock=1 GHz",
        *SLOW,
        key="detector.fine.counts",
    ),
    given("coarse word", "mechanics.gear_ratio=2500", "motor.max_speed=50000 rpm", key="mechanics.gear_ratio"),
    given(
        "no coarse word is enough",
        "mechanics.gear_ratio=600000",
        "detector.fine.counts=16",
        "limits.speed=0.01 deg/s",
        "position.1.speed=0.01 deg/s",
        key="mechanics.gear_ratio",
    ),
    given("clock", "detector.clock=1 MHz", key="detector.clock"),
    given("coarse conversion", "detector.coarse.counts=65536", key="detector.coarse.counts"),
    given(
        "coarse comparator",
        "detector.coarse.gain_error=-50 %",
        "detector.coarse.quadrature_error=20 deg",
        "detector.coarse.offset_error=-45 %",
        key="detector.coarse.offset_error",
    ),
    given(
        "fine comparator",
        "detector.fine.offset_error=44 %",
        "detector.fine.gain_error=-50 %",
        "detector.fine.quadrature_error=-20 deg",
        key="detector.fine.offset_error",
    ),
]

CLOCKS = [
    *(
        given(key, f"method.{key}={value}", key=f"method.{key}")
        for key, value, nearest in (
            ("strobe_period", "2.03 ms", "2 ms"),
            ("interrupt_delay", "0.16 ms", "200 us"),
            ("task_period", "20.04 ms", "20 ms"),
        )
    ),
    given("delay", "method.interrupt_delay=2.5 ms", key="method.interrupt_delay"),
    given("long delay", "method.interrupt_delay=100 ms", "method.task_period=200 ms", key="method.interrupt_delay"),
    given("task", "method.task_period=1 ms", key="method.task_period"),
    given("crossing", *LONG_STROBE, "method.strobe_period=100 ms", key="method.strobe_period"),
    given(
        "crossing with a long delay",
        *LONG_STROBE,
        "method.strobe_period=100 ms",
        "method.interrupt_delay=40 ms",
        key="method.strobe_period",
    ),
]

SPEEDS = [
    edit("faster than the motor", 'speed = "60 deg/s"', 'speed = "140 deg/s"', "6:1", "limits.speed"),
    given("faster than the word", "limits.speed=140 deg/s", "drive.full_speed=1900 rpm", key="limits.speed"),
    given("slow position", "position.1.speed=1e-6 deg/s", key="position.1.speed"),
    without_position_speed(given("slow limit", "limits.speed=0.1 deg/s", "method.fraction_bits=0", key="limits.speed")),
    without_position_speed(
        given(
            "no speed is fast enough",
            *COARSEST,
            "motor.max_speed=2000 rad/s",
            "limits.speed=0.001 deg/s",
            "limits.acceleration=10000 rad/s^2",
            "method.fraction_bits=0",
            key="limits.speed",
            others=1,
        )
    ),
    given(
        "fast word", *FINE_COUNTS, *SLOW, "method.strobe_period=100 ms", "method.task_period=100 ms", key="limits.speed"
    ),
    given("acceleration", "limits.acceleration=20 deg/s^2", "method.fraction_bits=2", key="limits.acceleration"),
    without_position_speed(
        given(
            "no acceleration is enough",
            *COARSEST,
            "method.fraction_bits=6",
            "motor.max_speed=30000 deg/s",
            "limits.acceleration=9000 rad/s^2",
            "limits.speed=5000 deg/s",
            key="limits.acceleration",
        )
    ),
    given("braking", "limits.acceleration=5 deg/s^2", key="limits.acceleration"),
    given(
        "braking, judged by the lagging table",
        "limits.acceleration=5.1 deg/s^2",
        "method.task_period=100 ms",
        "method.judge=actual",
        key="limits.acceleration",
    ),
    given(
        "a turn between two passes",
        "limits.speed=133 deg/s",
        "limits.acceleration=100 deg/s^2",
        "method.position_gain=0.4",
        "method.guarded=true",
        key="limits.acceleration",
    ),
    given(
        "no speed is slow enough",
        "method.position_gain=0.01",
        "mechanics.coulomb=2 N*m",
        "method.judge=actual",
        key="method.position_gain",
    ),
]

POSITIONS = [
    edit("fast position", 'speed = "30 deg/s"', 'speed = "61 deg/s"', "33:1", "position.1.speed"),
    given("shortest way without a counter", "method.form=flag", key="method.form"),
    given(
        "one position with a direction",
        *(f"position.{number}.direction=as commanded" for number in (0, 1, 3, 4)),
        "method.form=raw",
        key="method.form",
    ),
    *(
        given(
            f"{sign}far away",
            *FINE_COUNTS,
            *SLOW,
            "position.1.direction=as commanded",
            f"position.1.angle={sign}800 deg",
            key="position.1.angle",
        )
        for sign in ("", "-")
    ),
    given(
        "window",
        "detector.fine.counts=16",
        "mechanics.gear_ratio=10",
        "method.in_position=100",
        key="method.in_position",
    ),
]

MACHINE = [
    given("stiction", "mechanics.coulomb=1 N*m", "mechanics.static=0.5 N*m", key="mechanics.static"),
    given("effort", "mechanics.coulomb=3 N*m", key="mechanics.coulomb"),
    given("no effort is enough", "mechanics.coulomb=1 N*m", "mechanics.static=100000 N*m", key="mechanics.static"),
    added(
        "load",
        '[disturbance.load]\ntorque = "1 N*m"\nat = "1 s"\nduration = "1 us"',
        "48:1",
        "disturbance.load.duration",
    ),
]

ENTRIES = [*WHOLE, *DETECTOR, *CLOCKS, *SPEEDS, *POSITIONS, *MACHINE]


@pytest.mark.parametrize(
    "bad", params(detector=DETECTOR, clocks=CLOCKS, speeds=SPEEDS, positions=POSITIONS, machine=MACHINE)
)
def test_rule(bad, good_text, load_text, golden):
    check_rule(bad, good_text, load_text, golden)


@pytest.mark.parametrize("bad", params(whole=WHOLE))
def test_nearest_whole_number(bad, good_text, load_text, golden):
    problem = check_bad_file(bad, good_text, load_text, golden)
    load_text(bad.make(good_text), *bad.overrides, *named_value(problem.remedy))


def test_every_rule_is_broken_by_an_entry_above(good_text, load_text, monkeypatch):
    broken = broken_rules("rotary_table", ENTRIES, good_text, load_text, monkeypatch)
    assert broken == {rule.__name__ for rule in RULES}


@pytest.mark.parametrize(
    "overrides",
    [
        ("detector.coarse.reduction=90",),
        ("mechanics.gear_ratio=100", "detector.coarse.reduction=100"),
        ("method.task_period=20.1 ms",),  # no multiple of the strobe's
        ("method.task_phase=0.2 ms", "method.update=flag first"),
        ("detector.clock=2.048 MHz",),  # a conversion as long as the strobe's period
        ("drive.full_speed=3000 rpm",),
        ("mechanics.coulomb=1 N*m", "mechanics.static=1 N*m"),
        ("method.in_position=100000",),
        ("position.5.angle=540 deg", "position.5.direction=as commanded"),
        ("disturbance.load.torque=5 N*m", "disturbance.load.at=1 s", "disturbance.load.duration=0.1 ms"),
    ],
)
def test_what_the_rules_let_pass(good_text, load_text, overrides):
    load_text(good_text, *overrides)


@pytest.mark.parametrize("form", ["flag", "raw"])
def test_without_positions_every_form_is_allowed(good_text, load_text, form):
    text = good_text[: good_text.index("[position.0]")]
    assert load_text(text, f"method.form={form}").spec.method.form == form


def test_a_wrong_key_gives_no_problem_of_the_rules_that_look_at_it(good_text, load_text):
    with pytest.raises(InputError) as caught:
        load_text(good_text, "limits.acceleration=0 deg/s^2", "mechanics.gear_ratio=90.5", "limits.speed=200 deg/s")
    keys = [problem.key for problem in caught.value.problems]
    assert keys == ["limits.acceleration", "mechanics.gear_ratio", "limits.speed"]


def test_the_constants_are_those_of_the_blocks():
    from detent.control import table_positioner
    from detent.methods.rotary_table import system as rotary_table

    assert pytest.approx(rotary_table.TICK) == checks.TICK
    assert table_positioner.LONGEST_WAY == checks.LONGEST_WAY
