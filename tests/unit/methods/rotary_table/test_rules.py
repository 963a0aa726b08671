"""What does not go together in a rotary-table axis, and the nearest value that would do.

Line numbers are those of the packaged example without its head comment: [axis] stands in line 1, [limits] in 5. Every
value that a remedy names is tried: it is accepted, and of its two neighbours one is not.
"""

from dataclasses import replace

import pytest
from tests.bad_files import added, check_bad_file, edit, params
from tests.remedies import alternatives, broken_rules, check_rule, given

from detent.errors import InputError
from detent.methods.rotary_table import rules
from detent.methods.rotary_table.rules import RULES

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
    edit(
        "part of a turn",
        "gear_ratio = 90 ",
        "gear_ratio = 90.4 ",
        "20:1",
        "mechanics.gear_ratio",
        "90.4",
        "a whole number: after a turn of the table the fine resolver must stand where it began",
        "set mechanics.gear_ratio = 90",
    ),
    given(
        "nearly two",
        "mechanics.gear_ratio=2.2",
        key="mechanics.gear_ratio",
        came="2.2",
        allowed="a whole number",
        remedy="set mechanics.gear_ratio = 2",
    ),
    given(
        "phase of the task",
        "method.task_phase=0.03 ms",
        key="method.task_phase",
        came="0.03 ms",
        allowed="a whole number of 0.1 ms, the base tick",
        remedy='set method.task_phase = "0 s"',
    ),
]

DETECTOR = [
    given(
        "reduction",
        "detector.coarse.reduction=80.5",
        key="detector.coarse.reduction",
        came="80.5",
        allowed="equal to mechanics.gear_ratio, 90",
        remedy="set detector.coarse.reduction = 90 or leave it out: it is then mechanics.gear_ratio",
    ),
    given(
        "registers",
        "mechanics.gear_ratio=1100",
        "detector.fine.counts=1000000",
        "detector.clock=1 GHz",
        *SLOW,
        key="detector.fine.counts",
        came="1000000",
        allowed="such that T = G x fine counts, here 1100000000, is below 2^30: a jog begins with 2 T to go",
        remedy="set detector.fine.counts = 976128",
    ),
    given(
        "coarse word",
        "mechanics.gear_ratio=2500",
        "motor.max_speed=50000 rpm",
        key="mechanics.gear_ratio",
        came="2500",
        allowed="detector.coarse.counts (its default) at least 5003: a count of the coarse word is then less than half",
        remedy="set detector.coarse.counts = 5003",
    ),
    given(
        "no coarse word is enough",
        "mechanics.gear_ratio=600000",
        "detector.fine.counts=16",
        "limits.speed=0.01 deg/s",
        "position.1.speed=0.01 deg/s",
        key="mechanics.gear_ratio",
        came="600000",
        allowed="detector.coarse.counts (its default) at least 1371429",
        remedy="choose a smaller mechanics.gear_ratio",
    ),
    given(
        "clock",
        "detector.clock=1 MHz",
        key="detector.clock",
        came="1 MHz",
        allowed="at least 2.048 MHz: a conversion of 4096 clocks, here 4.096 ms, ends in each strobe period, 2 ms",
        remedy='set detector.clock = "2.048 MHz"',
    ),
    given(
        "coarse conversion",
        "detector.coarse.counts=65536",
        key="detector.coarse.counts",
        came="65536",
        allowed="detector.clock (its default) at least 32.77 MHz: a conversion of 65536 clocks, here 3.277 ms, ends",
        remedy='set detector.clock = "32.77 MHz"',
    ),
    given(
        "coarse comparator",
        "detector.coarse.gain_error=-50 %",
        "detector.coarse.quadrature_error=20 deg",
        "detector.coarse.offset_error=-45 %",
        key="detector.coarse.offset_error",
        came="-45 %",
        allowed="up to 43.83 % in magnitude: where the windings give least, the comparator would see no zero crossing",
        remedy='set detector.coarse.offset_error = "-43.82 %"',
    ),
    given(
        "fine comparator",
        "detector.fine.offset_error=44 %",
        "detector.fine.gain_error=-50 %",
        "detector.fine.quadrature_error=-20 deg",
        key="detector.fine.offset_error",
        came="44 %",
        allowed="up to 43.83 % in magnitude",
        remedy='set detector.fine.offset_error = "43.82 %"',
    ),
]

CLOCKS = [
    *(
        given(
            key,
            f"method.{key}={value}",
            key=f"method.{key}",
            came=value,
            allowed="a whole number of 0.1 ms, the base tick",
            remedy=f'set method.{key} = "{nearest}"',
        )
        for key, value, nearest in (
            ("strobe_period", "2.03 ms", "2 ms"),
            ("interrupt_delay", "0.16 ms", "200 us"),
            ("task_period", "20.04 ms", "20 ms"),
        )
    ),
    given(
        "delay",
        "method.interrupt_delay=2.5 ms",
        key="method.interrupt_delay",
        came="2.5 ms",
        allowed="below method.strobe_period, 2 ms: each interrupt comes before the next strobe",
        remedy='set method.interrupt_delay = "1.9 ms" or set method.strobe_period = "2.6 ms"',
    ),
    given(
        "long delay",
        "method.interrupt_delay=100 ms",
        "method.task_period=200 ms",
        key="method.interrupt_delay",
        came="100 ms",
        allowed="below method.strobe_period, 2 ms",
        remedy='set method.interrupt_delay = "1.9 ms"',
    ),
    given(
        "task",
        "method.task_period=1 ms",
        key="method.task_period",
        came="1 ms",
        allowed="at least method.strobe_period, 2 ms: two passes of the task would judge the same angle",
        remedy='set method.task_period = "2 ms" or set method.strobe_period = "1 ms"',
    ),
    given(
        "crossing",
        *LONG_STROBE,
        "method.strobe_period=100 ms",
        key="method.strobe_period",
        came="100 ms",
        allowed="such that the table turns less than 180 deg in it, here 600 deg at the largest word: a change of more",
        remedy='set method.strobe_period = "29.9 ms" or set drive.full_speed = "3599 deg/s"',
    ),
    given(
        "crossing with a long delay",
        *LONG_STROBE,
        "method.strobe_period=100 ms",
        "method.interrupt_delay=40 ms",
        key="method.strobe_period",
        came="100 ms",
        allowed="such that the table turns less than 180 deg in it",
        remedy='set drive.full_speed = "3599 deg/s"',
    ),
]

SPEEDS = [
    edit(
        "faster than the motor",
        'speed = "60 deg/s"',
        'speed = "140 deg/s"',
        "6:1",
        "limits.speed",
        '"140 deg/s"',
        "up to motor.max_speed over the gear ratio, 133.3 deg/s",
        'set limits.speed = "133.3 deg/s" or use a faster drive: motor.max_speed of 2100 rpm',
    ),
    given(
        "faster than the word",
        "limits.speed=140 deg/s",
        "drive.full_speed=1900 rpm",
        key="limits.speed",
        came="140 deg/s",
        allowed="up to drive.full_speed over the gear ratio, 126.7 deg/s",
        remedy='set limits.speed = "126.6 deg/s" or use a faster drive: drive.full_speed of 2100 rpm',
    ),
    given(
        "slow position",
        "position.1.speed=1e-6 deg/s",
        key="position.1.speed",
        came="1e-6 deg/s",
        allowed="at least 7.451e-06 deg/s: the interpolator moves on by whole 2^-16 counts in an interrupt",
        remedy='set position.1.speed = "7.451e-06 deg/s"',
    ),
    without_position_speed(
        given(
            "slow limit",
            "limits.speed=0.1 deg/s",
            "method.fraction_bits=0",
            key="limits.speed",
            came="0.1 deg/s",
            allowed="at least 0.4883 deg/s: the interpolator moves on by whole counts in an interrupt",
            remedy='set limits.speed = "0.4883 deg/s" or set method.fraction_bits = 3',
        )
    ),
    without_position_speed(
        given(
            "no speed is fast enough",
            *COARSEST,
            "motor.max_speed=2000 rad/s",
            "limits.speed=0.001 deg/s",
            "limits.acceleration=10000 rad/s^2",
            "method.fraction_bits=0",
            key="limits.speed",
            came="0.001 deg/s",
            allowed="at least 9375 rpm",
            remedy="lengthen method.strobe_period",
            others=1,
        )
    ),
    given(
        "fast word",
        *FINE_COUNTS,
        *SLOW,
        "method.strobe_period=100 ms",
        "method.task_period=100 ms",
        key="limits.speed",
        came="5 deg/s",
        allowed="method.fraction_bits (its default) such that limits.speed, here 9.102e+10 parts of a count per",
        remedy='set method.fraction_bits = 10 or set limits.speed = "0.1179 deg/s"',
    ),
    given(
        "acceleration",
        "limits.acceleration=20 deg/s^2",
        "method.fraction_bits=2",
        key="limits.acceleration",
        came="20 deg/s^2",
        allowed="at least 61.04 deg/s^2: the interpolator's speed grows by whole 2^-2 counts per interrupt",
        remedy='set limits.acceleration = "61.04 deg/s^2" or set method.fraction_bits = 4',
    ),
    without_position_speed(
        given(
            "no acceleration is enough",
            *COARSEST,
            "method.fraction_bits=6",
            "motor.max_speed=30000 deg/s",
            "limits.acceleration=9000 rad/s^2",
            "limits.speed=5000 deg/s",
            key="limits.acceleration",
            came="9000 rad/s^2",
            allowed="at least 4.395e+06 deg/s^2: the interpolator's speed grows by whole 2^-6 counts per interrupt",
            remedy="set method.fraction_bits = 10",
        )
    ),
    given(
        "braking",
        "limits.acceleration=5 deg/s^2",
        key="limits.acceleration",
        came="5 deg/s^2",
        allowed="such that braking, here over 360 deg, takes less than a turn less the 1.2 deg by which a rollover",
        remedy='set limits.acceleration = "5.017 deg/s^2" or set limits.speed = "59.9 deg/s"',
    ),
    given(
        "braking, judged by the lagging table",
        "limits.acceleration=5.1 deg/s^2",
        "method.task_period=100 ms",
        "method.judge=actual",
        key="limits.acceleration",
        came="5.1 deg/s^2",
        allowed="here over 352.9 deg, takes less than a turn less the 8.105 deg",
        remedy='set limits.acceleration = "5.116 deg/s^2" or set limits.speed = "59.91 deg/s"',
    ),
    given(
        "a turn between two passes",
        "limits.speed=133 deg/s",
        "limits.acceleration=100 deg/s^2",
        "method.position_gain=0.4",
        "method.guarded=true",
        key="limits.acceleration",
        came="100 deg/s^2",
        allowed="such that braking, here over 88.44 deg, takes less than a turn less the 352.7 deg",
        remedy='set limits.acceleration = "1205 deg/s^2" or set limits.speed = "112 deg/s"',
    ),
    given(
        "no speed is slow enough",
        "method.position_gain=0.01",
        "mechanics.coulomb=2 N*m",
        "method.judge=actual",
        key="method.position_gain",
        came="0.01",
        allowed='limits.acceleration ("300 deg/s^2") such that braking, here over 6 deg',
        remedy="raise method.position_gain",
    ),
]

POSITIONS = [
    edit(
        "fast position",
        'speed = "30 deg/s"',
        'speed = "61 deg/s"',
        "33:1",
        "position.1.speed",
        '"61 deg/s"',
        "up to limits.speed, 60 deg/s",
        'set position.1.speed = "60 deg/s" or correct limits.speed',
    ),
    given(
        "shortest way without a counter",
        "method.form=flag",
        key="method.form",
        came="flag",
        allowed='"turn counter" where a position has a direction or a shortest way: position 0, 1, 2, 3, 4; without',
        remedy='set method.form = "turn counter" or write direction = "as commanded" in each of them',
    ),
    given(
        "one position with a direction",
        *(f"position.{number}.direction=as commanded" for number in (0, 1, 3, 4)),
        "method.form=raw",
        key="method.form",
        came="raw",
        allowed='"turn counter" where a position has a direction or a shortest way: position 2; without',
        remedy='set method.form = "turn counter" or set position.2.direction = "as commanded"',
    ),
    *(
        given(
            f"{sign}far away",
            *FINE_COUNTS,
            *SLOW,
            "position.1.direction=as commanded",
            f"position.1.angle={sign}800 deg",
            key="position.1.angle",
            came=f"{sign}800 deg",
            allowed="less than 413.1 deg from 0: from any angle of the turn the way has fewer than 2^31 counts",
            remedy=f'set position.1.angle = "{sign}413 deg"',
        )
        for sign in ("", "-")
    ),
    given(
        "window",
        "detector.fine.counts=16",
        "mechanics.gear_ratio=10",
        "method.in_position=100",
        key="method.in_position",
        came="100",
        allowed="below half a turn, up to 79 counts",
        remedy="set method.in_position = 79",
    ),
]

MACHINE = [
    given(
        "stiction",
        "mechanics.coulomb=1 N*m",
        "mechanics.static=0.5 N*m",
        key="mechanics.static",
        came="0.5 N*m",
        allowed="at least the Coulomb friction, 1 N*m",
        remedy='set mechanics.static = "1 N*m" or leave it out: it is then 1.15 x coulomb',
    ),
    given(
        "effort",
        "mechanics.coulomb=3 N*m",
        key="mechanics.coulomb",
        came="3 N*m",
        allowed='limits.effort ("3 N*m") above mechanics.static, 3.45 N*m: the motor never breaks loose',
        remedy='set limits.effort = "3.451 N*m"',
    ),
    given(
        "no effort is enough",
        "mechanics.coulomb=1 N*m",
        "mechanics.static=100000 N*m",
        key="mechanics.static",
        came="100000 N*m",
        allowed='limits.effort ("3 N*m") above mechanics.static',
        remedy="lower mechanics.static",
    ),
    added(
        "load",
        '[disturbance.load]\ntorque = "1 N*m"\nat = "1 s"\nduration = "1 us"',
        "48:1",
        "disturbance.load.duration",
        '"1 us"',
        "at least a base tick, 100 us",
        'set disturbance.load.duration = "100 us"',
    ),
]

ENTRIES = [*WHOLE, *DETECTOR, *CLOCKS, *SPEEDS, *POSITIONS, *MACHINE]


@pytest.mark.parametrize(
    "bad", params(detector=DETECTOR, clocks=CLOCKS, speeds=SPEEDS, positions=POSITIONS, machine=MACHINE)
)
def test_rule(bad, good_text, load_text):
    check_rule(bad, good_text, load_text)


@pytest.mark.parametrize("bad", params(whole=WHOLE))
def test_nearest_whole_number(bad, good_text, load_text):
    check_bad_file(bad, good_text, load_text)
    (alternative,) = alternatives(bad.remedy)
    load_text(bad.make(good_text), *bad.overrides, *alternative)


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

    assert pytest.approx(rotary_table.TICK) == rules.TICK
    assert table_positioner.LONGEST_WAY == rules.LONGEST_WAY
