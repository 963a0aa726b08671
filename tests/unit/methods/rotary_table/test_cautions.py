"""Warnings about a rotary-table axis that can be built; each value that a remedy names ends its warning."""

from functools import partial

import pytest
from tests.remedies import check_caution

from detent.methods.rotary_table.checks import find_cautions

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
        ("protection.following_error=2 deg", "protection.following_time=0 s"),
    ],
)
def test_axes_with_nothing_to_warn_about(load_text, good_text, overrides):
    assert cautions(load_text, good_text, *overrides) == {}


FORMS = [
    ((*INSIDE, "method.form=raw"), "method.form"),
    ((*FLAG, "drive.droop=0 %"), "start angle of a jog"),
    ((*FLAG, "method.task_period=60 ms"), "start angle of a jog"),
    ((*FLAG, "method.judge=actual"), "start angle of a jog"),
    ((*FLAG, "method.judge=actual", "method.guarded=true"), "start angle of a jog"),
    ((*FLAG, "method.guarded=true", "detector.fine.noise=0.05 deg"), "noise at the boundary"),
    (("method.update=flag first",), "method.update"),
    (("method.update=remaining first", "method.task_phase=0.2 ms"), "method.update"),
    (("method.update=flag first", "method.task_phase=4.2 ms", "method.task_period=20.5 ms"), "method.update"),
    (("method.signed_remaining=false",), "method.signed_remaining"),
    (("method.position_control=false",), "method.position_control"),
    ((*COMMANDED, "method.form=raw"), "position.0.angle"),
    ((*FLAG, "position.4.angle=540 deg"), "position.4.angle"),
]

DRIVE = [
    (("method.position_gain=100",), "damping of the loop"),
    (("method.position_gain=1000",), "damping of the loop"),
    (("protection.following_error=2 deg",), "following error at limits.speed"),
    (("limits.speed=127 deg/s",), "speed word at limits.speed"),
    (("limits.speed=126 deg/s",), "speed word at limits.speed"),
    (("mechanics.coulomb=1 N*m", "limits.speed=120 deg/s"), "speed word at limits.speed"),
    (
        ("drive.droop=50 %", "mechanics.coulomb=2.5 N*m", "method.position_gain=5", "drive.time_constant=0.1 s"),
        "speed word at limits.speed",
    ),
    (("drive.full_speed=3000 rpm",), "drive.full_speed"),
    (("method.fraction_bits=4",), "method.fraction_bits"),
    (("method.fraction_bits=0",), "method.fraction_bits"),
    (("method.fraction_bits=16", "position.1.speed=1e-4 deg/s"), "method.fraction_bits"),
    (("method.fraction_bits=7", "limits.acceleration=50 deg/s^2"), "method.fraction_bits"),
    (("limits.effort=0.5 N*m",), "acceleration torque"),
    (("limits.effort=0.2 N*m",), "acceleration torque"),
    (("limits.effort=30 N*m",), "limits.effort"),
    ((*LOAD, "disturbance.load.torque=250 N*m"), "disturbance.load.torque"),
    ((*LOAD, "disturbance.load.torque=-290 N*m"), "disturbance.load.torque"),
    ((*LOAD, "disturbance.load.torque=280 N*m", "method.position_control=false"), "disturbance.load.torque"),
]

REST = [
    (STUCK, "static friction"),
    (STICKY, "deviation at rest"),
    (("drive.word_bits=10",), "deviation at rest"),
    (("detector.fine.noise=0.3 deg",), "noise in position"),
    (STICKY, "stick-slip"),
    (("method.short_way=0 deg", "detector.fine.noise=0.05 deg"), "method.short_way"),
]

DETECTOR = [
    (("detector.composition=truncated",), "detector.composition"),
    (
        ("detector.coarse.backlash=1 deg", "detector.coarse.eccentricity=1 deg", "detector.coarse.noise=0.5 deg"),
        "coarse error",
    ),
]


@pytest.mark.parametrize(("overrides", "name"), [*FORMS, *DRIVE, *REST, *DETECTOR])
def test_warnings_say_value_limit_consequence_and_remedy(load_text, good_text, golden, overrides, name):
    found = cautions(load_text, good_text, *overrides)
    golden(f"{name}, {' '.join(overrides)}", found[name])
    at_bound = name != "method.short_way"  # it counts in whole counts
    check_caution(partial(cautions, load_text, good_text), overrides, name, found[name], at_bound=at_bound)


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
    bench.r.plant.train.motor.angle += 6.283185 / 4096
    bench.run(0.002).go(2).run(8)
    assert bench.travel == pytest.approx(travel, abs=0.01)


@pytest.mark.compiled
@pytest.mark.parametrize(("update", "spike"), [("flag first", 362.1), ("remaining first", 357.9), ("atomic", 2.2)])
def test_an_interrupted_rollover_jumps_as_far_as_the_warning_says(bench_of, update, spike):
    bench = bench_of((f"method.update={update}", "method.task_phase=0.2 ms")).run(0.1).jog(1)
    largest = 0.0
    for _ in range(3300):
        bench.run(0.002)
        largest = max(largest, abs(bench.r.controller.positioner.dr) / 65_536 * 360 / bench.spec.period)
    assert bench.r.controller.positioner.rollovers == 1
    assert spike - 0.5 < largest < spike + 0.5
