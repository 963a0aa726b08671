"""Warnings about a rotary-table axis that can be built; each value that a remedy names ends its warning."""

import pytest
from tests.remedies import alternatives

from detent.methods.rotary_table.cautions import find_cautions

COMMANDED = tuple(f"position.{number}.direction=as commanded" for number in range(5))
INSIDE = (*COMMANDED, "position.0.angle=20 deg")
FLAG = (*INSIDE, "method.form=flag")
LOAD = ("disturbance.load.at=1 s", "disturbance.load.duration=1 s")
STICKY = ("mechanics.coulomb=90 mN*m", "mechanics.static=100 mN*m")
STUCK = ("drive.time_constant=1 s", "method.position_gain=1", "mechanics.static=2.9 N*m")


def cautions(load_text, text, *overrides):
    return {caution.name: caution for caution in find_cautions(load_text(text, *overrides).spec)}


def test_the_example_is_sound(load_text, good_text):
    assert cautions(load_text, good_text) == {}


@pytest.mark.parametrize(
    "overrides",
    [
        (*FLAG, "method.guarded=true"),
        ("method.judge=actual",),
        ("method.guarded=true",),
        ("method.task_phase=0.2 ms",),
        ("mechanics.coulomb=0.1 mN*m",),
        ("detector.coarse.alignment_error=1.9 deg",),
        ("detector.fine.noise=0.05 deg",),
        ("position.2.direction=shortest", "method.short_way=0 deg"),
        (*LOAD, "disturbance.load.torque=100 N*m"),
        ("drive.full_speed=1900 rpm",),
        ("method.fraction_bits=8",),
    ],
)
def test_axes_with_nothing_to_warn_about(load_text, good_text, overrides):
    assert cautions(load_text, good_text, *overrides) == {}


FORMS = [
    (
        (*INSIDE, "method.form=raw"),
        "method.form",
        ['"raw", the conventional angle', "runs away (test 11)", 'do: set method.form = "turn counter"'],
    ),
    (
        (*FLAG, "drive.droop=0 %"),
        "start angle of a jog",
        [
            "at limits.speed it fails for a + jog at less than 0.8 deg to 2 deg, a - jog as little below 360 deg",
            "throws it back a turn (trap 1, test 12)",
            'set method.form = "turn counter" or set method.guarded = true',
        ],
    ),
    (
        (*FLAG, "method.task_period=60 ms"),
        "start angle of a jog",
        ["a + jog at less than 2.105 deg, a - jog"],
    ),
    (
        (*FLAG, "method.judge=actual"),
        "start angle of a jog",
        ["a - jog at less than 1.2 deg, a + jog as little below 360 deg", "runs away (traps 1 and 2, test 13)"],
    ),
    (
        (*FLAG, "method.judge=actual", "method.guarded=true"),
        "start angle of a jog",
        ["test 13", 'set method.form = "turn counter"'],
    ),
    (
        (*FLAG, "method.guarded=true", "detector.fine.noise=0.05 deg"),
        "noise at the boundary",
        ["up to 1 count with the flag", "wrong by a turn (trap 2)", 'set method.form = "turn counter"'],
    ),
    (
        ("method.update=flag first",),
        "method.update",
        ['"flag first": no interrupt comes between as the clocks are', "a deviation of 362.1 deg", "test 15"],
    ),
    (
        ("method.update=remaining first", "method.task_phase=0.2 ms"),
        "method.update",
        ["each pass is interrupted between its halves", "a deviation of -357.9 deg"],
    ),
    (
        ("method.update=flag first", "method.task_phase=4.2 ms", "method.task_period=20.5 ms"),
        "method.update",
        ["one pass in 4 is interrupted", 'set method.update = "atomic"'],
    ),
    (
        ("method.signed_remaining=false",),
        "method.signed_remaining",
        ["|M - R|", "driven on and away (trap 4)", "set method.signed_remaining = true"],
    ),
    (
        ("method.position_control=false",),
        "method.position_control",
        ["the droop, 5 %, and by up to half a word, 0.03257 deg/s", "set method.position_control = true"],
    ),
    (
        (*COMMANDED, "method.form=raw"),
        "position.0.angle",
        ["0 deg; should be 0.06827 deg to 359.9 deg without the counter", "by its overshoot"],
    ),
    (
        (*FLAG, "position.4.angle=540 deg"),
        "position.4.angle",
        ["540 deg; should be", "meets the boundary on its way"],
    ),
]

DRIVE = [
    (
        ("method.position_gain=100",),
        "damping of the loop",
        ["0.321; should be at least 0.4; the table overshoots", "set method.position_gain = 69.52 or make"],
    ),
    (
        ("method.position_gain=1000",),
        "damping of the loop",
        ["-0.0136", "the loop is unstable, spectral radius 1.0058", "set method.position_gain = 69.52"],
    ),
    (
        ("limits.speed=127 deg/s",),
        "speed word at limits.speed",
        [
            "2052 counts, 2083 after",
            "up to 2047",
            "grows for as long as a jog lasts",
            'set limits.speed = "124.7 deg/s"',
        ],
    ),
    (
        ("limits.speed=126 deg/s",),
        "speed word at limits.speed",
        ["2036 counts, 2067 after", "is clipped after each acceleration", 'set limits.speed = "124.7 deg/s"'],
    ),
    (
        ("mechanics.coulomb=1 N*m", "limits.speed=120 deg/s"),
        "speed word at limits.speed",
        ["2145 counts", 'set limits.speed = "112 deg/s"'],
    ),
    (
        ("drive.droop=50 %", "mechanics.coulomb=2.5 N*m", "method.position_gain=5", "drive.time_constant=0.1 s"),
        "speed word at limits.speed",
        ["do: raise drive.full_speed"],
    ),
    (
        ("drive.full_speed=3000 rpm",),
        "drive.full_speed",
        ["3000 rpm; should be up to motor.max_speed, 2000 rpm", 'set drive.full_speed = "2000 rpm"'],
    ),
    (
        ("method.fraction_bits=4",),
        "method.fraction_bits",
        ["limits.speed / 600 is 3.28 parts of a count", "wrong by up to 15.26 %", "set method.fraction_bits = 8"],
    ),
    (
        ("method.fraction_bits=0",),
        "method.fraction_bits",
        ["0.205 parts", "the table stays where it is (test 20)", "set method.fraction_bits = 8"],
    ),
    (
        ("method.fraction_bits=16", "position.1.speed=1e-4 deg/s"),
        "method.fraction_bits",
        ["position.1.speed is 13.4 parts", "use a longer method.strobe_period"],
    ),
    (
        ("method.fraction_bits=7", "limits.acceleration=50 deg/s^2"),
        "method.fraction_bits",
        ["7: limits.acceleration is 26.2 parts", "set method.fraction_bits = 8"],
    ),
    (
        ("limits.effort=0.5 N*m",),
        "torque of an acceleration",
        ["766.2 mN*m", 'set limits.acceleration = "149.5 deg/s^2" or set limits.effort = "766.3 mN*m"'],
    ),
    (
        ("limits.effort=0.2 N*m",),
        "torque of an acceleration",
        ["up to limits.effort, 200 mN*m", 'do: set limits.effort = "766.3 mN*m"'],
    ),
    (
        ("limits.effort=30 N*m",),
        "limits.effort",
        ["19.87 N*m, reversed from its full speed", "never acts", 'set limits.effort = "19.87 N*m"'],
    ),
    (
        (*LOAD, "disturbance.load.torque=250 N*m"),
        "disturbance.load.torque",
        ["2.778 N*m at the motor, 3.544 N*m with", "against the load falls behind", 'set limits.effort = "3.545 N*m"'],
    ),
    (
        (*LOAD, "disturbance.load.torque=-290 N*m"),
        "disturbance.load.torque",
        ["3.222 N*m at the motor", "is driven off its place", 'set limits.effort = "3.989 N*m"'],
    ),
    (
        (*LOAD, "disturbance.load.torque=280 N*m", "method.position_control=false"),
        "disturbance.load.torque",
        ["3.111 N*m at the motor, 3.111 N*m"],
    ),
]

REST = [
    (
        STUCK,
        "static friction",
        ["2.9 N*m; should be below the torque of the largest word, 198.7 mN*m", "never breaks loose"],
    ),
    (
        STICKY,
        "deviation at rest",
        ["up to 45 counts, 0.04395 deg", "method.in_position, 2", "friction holds", "set method.in_position = 45"],
    ),
    (
        ("drive.word_bits=10",),
        "deviation at rest",
        ["up to 4 counts", "a word that is rounded to 0 holds", "set method.in_position = 4 or raise"],
    ),
    (
        ("detector.fine.noise=0.3 deg",),
        "noise in position",
        ["up to 4 counts, with 1 at rest", "together up to method.in_position, 2", "set method.in_position = 5"],
    ),
    (
        STICKY,
        "stick-slip",
        ["4.58 counts of deviation more", "breaks loose and stands again", 'set mechanics.static = "94.36 mN*m"'],
    ),
    (
        ("method.short_way=0 deg", "detector.fine.noise=0.05 deg"),
        "method.short_way",
        ["at least 3 counts, 0.00293 deg", "a direction: 2;", "a whole turn", 'set method.short_way = "0.00293 deg"'],
    ),
]

DETECTOR = [
    (
        ("detector.composition=truncated",),
        "detector.composition",
        ["wrong by a motor turn, 4 deg", 'set detector.composition = "rounded"'],
    ),
    (
        ("detector.coarse.backlash=1 deg", "detector.coarse.eccentricity=1 deg", "detector.coarse.noise=0.5 deg"),
        "coarse error",
        [
            "up to 2 deg: backlash 0.5 deg, eccentricity 1 deg, noise 0.5 deg; should be up to 1.911 deg",
            "reads a motor turn too much or too little, 4 deg",
            "improve the largest, eccentricity",
        ],
    ),
]


@pytest.mark.parametrize(("overrides", "name", "words"), [*FORMS, *DRIVE, *REST, *DETECTOR])
def test_warnings_say_value_limit_consequence_and_remedy(load_text, good_text, overrides, name, words):
    found = cautions(load_text, good_text, *overrides)
    for word in words:
        assert word in str(found[name])
    for alternative in alternatives(found[name].remedy):
        assert name not in cautions(load_text, good_text, *overrides, *alternative), alternative


def test_what_never_moves_does_not_stick_and_slip(load_text, good_text):
    assert not {"stick-slip", "deviation at rest"} & set(cautions(load_text, good_text, *STUCK))


def test_a_raw_angle_has_no_halves_of_a_rollover(load_text, good_text):
    found = cautions(load_text, good_text, *INSIDE, "method.form=raw", "method.update=flag first")
    assert set(found) == {"method.form"}


# --------------------------------------------------------------------------------- the simulated axis, as it is warned


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("more", "start", "sign", "fails"),
    [
        ((), 0.9, 1, True),
        ((), 2.2, 1, False),
        ((), 359.2, -1, True),
        ((), 357.8, -1, False),
        (("method.guarded=true",), 0.1, 1, False),
        (("method.judge=actual",), 0.0, -1, True),
        (("method.judge=actual",), 1.3, -1, False),
        (("method.judge=actual", "method.guarded=true"), 0.0, -1, True),
    ],
)
def test_the_flag_fails_at_the_start_angles_named(bench_of, more, start, sign, fails):
    bench = bench_of((*FLAG, *more, f"mechanics.start_angle={start} deg")).run(0.1).jog(sign).run(14)
    regular = abs(sign * bench.travel - 832) < 3
    assert regular != fails


@pytest.mark.compiled
@pytest.mark.parametrize(("short_way", "travel"), [("0 deg", 360), ("0.001954 deg", 0)])
def test_a_table_a_count_beyond_its_target_goes_round(bench_of, short_way, travel):
    bench = bench_of(("mechanics.start_angle=180 deg", f"method.short_way={short_way}")).run(0.1)
    bench.r.machine.motor.angle += 6.283185 / 4096
    bench.run(0.002).go(2).run(8)
    assert bench.travel == pytest.approx(travel, abs=0.01)


@pytest.mark.compiled
@pytest.mark.parametrize(("update", "spike"), [("flag first", 362.1), ("remaining first", 357.9), ("atomic", 2.2)])
def test_an_interrupted_rollover_jumps_as_far_as_the_warning_says(bench_of, update, spike):
    bench = bench_of((f"method.update={update}", "method.task_phase=0.2 ms")).run(0.1).jog(1)
    largest = 0.0
    for _ in range(3300):
        bench.run(0.002)
        largest = max(largest, abs(bench.r.positioner.dr) / 65_536 * 360 / bench.spec.period)
    assert bench.r.positioner.rollovers == 1
    assert spike - 0.5 < largest < spike + 0.5
