"""What does not go together in a stepper-envelope axis, and the nearest value that would do.

Line numbers are those of the packaged zoom without its head comment: [axis] stands in line 1. Every value that a remedy
names is tried: it is accepted, and of its two neighbours one is not.
"""

import pytest
from tests.bad_files import Bad, edit, params
from tests.remedies import broken_rules, check_rule
from tests.remedies import given as given_in_full

from detent.errors import InputError
from detent.methods.stepper_envelope import rules
from detent.methods.stepper_envelope.rules import RULES
from detent.methods.stepper_envelope.torque_rules import TORQUE_RULES

A, X = "stepper.group_a", "stepper.x"


def given(name, *overrides, key, **more):
    """Overrides of the first motor of the zoom; the problem is that of its key."""
    return given_in_full(name, *(f"{A}.{text}" for text in overrides), key=f"{A}.{key}", **more)


FREQUENCIES = [
    given(
        "no word for the frequency",
        "limits.speed=1 m/s",
        key="limits.speed",
        came="1 m/s",
        allowed="from 5 um/s to 327.7 mm/s, step frequencies of 1 Hz to 65535 Hz, here 2e+05 Hz",
        remedy=f'set {A}.limits.speed = "21.42 mm/s"',
    ),
    given(
        "a start that is none",
        "motor.start_frequency=1 Hz",
        key="motor.start_frequency",
        came="1 Hz",
        allowed="such that the start frequency with load and reserve is 1 Hz or more, here 444.4 mHz",
        remedy=f'set {A}.motor.start_frequency = "2.251 Hz"',
    ),
    given(
        "a start divided away",
        "motor.start_frequency=10 Hz",
        "drive.start_safety=15",
        key="motor.start_frequency",
        came="10 Hz",
        allowed="here 628.4 mHz",
        remedy=f'set {A}.motor.start_frequency = "15.92 Hz" or set {A}.drive.start_safety = 9.425',
    ),
    given(
        "half a tooth pitch",
        "motor.steps_per_turn=202",
        key="motor.steps_per_turn",
        came="202",
        allowed="a multiple of 4: a tooth pitch has four full steps",
        remedy=f"set {A}.motor.steps_per_turn = 200",
    ),
    given(
        "a rotor without mass",
        "motor.rotor_inertia=0.001 g*cm^2",
        "mechanics.screw_inertia=0.001 g*cm^2",
        "mechanics.coupling_inertia=0 g*cm^2",
        "mechanics.moving_mass=0 kg",
        key="motor.rotor_inertia",
        came="0.001 g*cm^2",
        allowed="such that the rotor swings about its step with 7.958 kHz or less, here 19.49 kHz",
        remedy=f'set {A}.motor.rotor_inertia = "0.011 g*cm^2"',
    ),
    Bad(
        "part of a clock",
        "--set",
        "controller.timer",
        "250000.4 Hz",
        "a whole number of Hz",
        'set controller.timer = "250 kHz"',
        overrides=("controller.timer=250000.4 Hz",),
    ),
]

PLACES = [
    given(
        "too many steps",
        "limits.travel=90 m",
        key="limits.travel",
        came="90 m",
        allowed="up to 10000000 steps of 5 um: a table has an entry for each",
        remedy=f'set {A}.limits.travel = "50 m" or correct the lead',
    ),
    given(
        "start above the travel",
        "mechanics.start_position=50 mm",
        key="mechanics.start_position",
        came="50 mm",
        allowed="on the travel, from 0 m to 40 mm",
        remedy=f'set {A}.mechanics.start_position = "40 mm" or correct limits.travel or mechanics.lower_end',
    ),
    given(
        "start below the travel",
        "mechanics.start_position=-1 mm",
        key="mechanics.start_position",
        came="-1 mm",
        allowed="on the travel",
        remedy=f'set {A}.mechanics.start_position = "0 m"',
    ),
    given(
        "turn above the travel",
        "extremes.turn=41 mm",
        key="extremes.turn",
        came="41 mm",
        allowed="on the travel",
        remedy=f'set {A}.extremes.turn = "40 mm"',
    ),
    given(
        "travel moved away from an extreme",
        "mechanics.lower_end=5 mm",
        "extremes.stop=1 mm",
        key="extremes.stop",
        came="1 mm",
        allowed="from 5 mm to 45 mm",
        remedy=f'set {A}.extremes.stop = "5 mm"',
    ),
    given(
        "extremes reversed",
        "extremes.turn=1 mm",
        "extremes.start=2 mm",
        key="extremes.turn",
        came="1 mm",
        allowed="above extremes.start, 2 mm, by a step of 5 um or more",
        remedy=f'set {A}.extremes.turn = "2.005 mm" or set {A}.extremes.start = "995 um"',
    ),
    given(
        "extremes equal",
        "extremes.turn=1 mm",
        "extremes.stop=1 mm",
        key="extremes.turn",
        came="1 mm",
        allowed="above extremes.stop, 1 mm",
        remedy=f'set {A}.extremes.turn = "1.005 mm" or set {A}.extremes.stop = "995 um"',
    ),
    given(
        "both above the turn",
        "extremes.turn=1 mm",
        "extremes.start=1 mm",
        "extremes.stop=2 mm",
        key="extremes.turn",
        came="1 mm",
        allowed="above extremes.stop, 2 mm",
        remedy=f'set {A}.extremes.turn = "2.005 mm"',
    ),
    given(
        "all at the end",
        "extremes.turn=40 mm",
        "extremes.start=40 mm",
        "extremes.stop=40 mm",
        key="extremes.turn",
        came="40 mm",
        allowed="above extremes.start, 40 mm",
        remedy="move both apart",
    ),
]

ZONES = [
    edit(
        "zone that overlaps the next",
        'end = "13 mm"',
        'end = "26 mm"',
        "38:1",
        f"{A}.zone.far.begin",
        '"25 mm"',
        "at or above the end of zone near, 26 mm: a step has one limit in each direction",
        f'set {A}.zone.far.begin = "26 mm" or set {A}.zone.near.end = "25 mm"',
    ),
    given(
        "zone around the next",
        "zone.near.end=31 mm",
        key="zone.near.end",
        came="31 mm",
        allowed=f'{A}.zone.far.begin ("25 mm") at or above the end of zone near, 31 mm',
        remedy=f'set {A}.zone.near.end = "25 mm"',
    ),
    given(
        "zones that begin together",
        "zone.near.begin=25 mm",
        "zone.near.end=30 mm",
        key="zone.near.end",
        came="30 mm",
        allowed="at or above the end of zone near, 30 mm",
        remedy="remove zone far or zone near",
    ),
    given(
        "zone that ends before it begins",
        "zone.near.end=9 mm",
        key="zone.near.end",
        came="9 mm",
        allowed="above the zone's begin, 10 mm",
        remedy=f'set {A}.zone.near.begin = "9 mm" and {A}.zone.near.end = "10 mm"',
    ),
    given(
        "zone without length",
        "zone.near.begin=13 mm",
        key="zone.near.begin",
        came="13 mm",
        allowed=f'{A}.zone.near.end ("13 mm") above the zone\'s begin, 13 mm',
        remedy=f'set {A}.zone.near.end = "13.005 mm" or set {A}.zone.near.begin = "12.995 mm"',
    ),
    given(
        "zone that begins off the travel",
        "zone.near.begin=50 mm",
        key="zone.near.begin",
        came="50 mm",
        allowed="above the zone's begin, 50 mm",
        remedy=f'set {A}.zone.near.begin = "12.995 mm"',
    ),
    given(
        "zone with both ends off the travel",
        "zone.near.begin=50 mm",
        "zone.near.end=45 mm",
        key="zone.near.end",
        came="45 mm",
        allowed="above the zone's begin, 50 mm",
        remedy="correct begin and end",
    ),
    given(
        "zone that ends off the travel",
        "zone.far.end=41 mm",
        key="zone.far.end",
        came="41 mm",
        allowed="on the travel, from 0 m to 40 mm",
        remedy=f'set {A}.zone.far.end = "40 mm"',
    ),
    given(
        "zone beside the travel",
        "zone.far.begin=50 mm",
        "zone.far.end=60 mm",
        key="zone.far.begin",
        came="50 mm",
        allowed="on the travel, from 0 m to 40 mm; here the whole zone is not",
        remedy="remove the zone",
    ),
    given(
        "zone below the start frequency",
        "zone.near.speed=1 mm/s",
        key="zone.near.speed",
        came="1 mm/s",
        allowed="at least the speed of the start frequency, 2 mm/s at 400 Hz: no ramp leads below it",
        remedy=f'set {A}.zone.near.speed = "2 mm/s" or set {A}.drive.start_safety = 4.242',
    ),
    given(
        "zone far below the start frequency",
        "zone.near.speed=0.1 mm/s",
        key="zone.near.speed",
        came="0.1 mm/s",
        allowed="at least the speed of the start frequency",
        remedy=f'set {A}.zone.near.speed = "2 mm/s"',
    ),
    given(
        "zone faster than the motor",
        "zone.near.speed=21 mm/s",
        key="zone.near.speed",
        came="21 mm/s",
        allowed="up to limits.speed, 20 mm/s: a faster zone has no effect",
        remedy=f'set {A}.zone.near.speed = "20 mm/s" or remove the zone',
    ),
]

STAGE = [
    given_in_full(
        "too few ticks in the shortest period",
        "controller.timer=250 kHz",
        f"{X}.limits.speed=200 mm/s",
        f"{X}.limits.acceleration=100 m/s^2",
        f"{X}.drive.supply=1 kV",
        key="controller.timer",
        came="250 kHz",
        allowed="at least 10 ticks in the period of 40 kHz",
        remedy=f'set controller.timer = "400 kHz" or set {X}.limits.speed = "125 mm/s"',
    ),
]


@pytest.mark.parametrize("bad", params(frequency=FREQUENCIES, place=PLACES, zone=ZONES))
def test_rule(bad, good_text, load_text):
    check_rule(bad, good_text, load_text)


@pytest.mark.parametrize("bad", params(stage=STAGE))
def test_rule_of_the_stage(bad, stage_text, load_text):
    check_rule(bad, stage_text, load_text)


def test_every_rule_is_broken_by_an_entry_above(good_text, stage_text, load_text, monkeypatch):
    broken = broken_rules("stepper_envelope", [*FREQUENCIES, *PLACES, *ZONES], good_text, load_text, monkeypatch)
    broken |= broken_rules("stepper_envelope", STAGE, stage_text, load_text, monkeypatch)
    assert broken == {rule.__name__ for rule in RULES} - {rule.__name__ for rule in TORQUE_RULES}


@pytest.mark.parametrize(
    "overrides",
    [
        ("limits.travel=40.003 mm",),
        ("limits.travel=40.003 mm", "extremes.turn=40.003 mm", "mechanics.start_position=40.003 mm"),
        ("zone.near.end=25 mm",),
        ("zone.near.end=26 mm", "zone.near.direction=up", "zone.far.direction=down"),
        ("zone.near.speed=20 mm/s",),
        ("zone.near.speed=2 mm/s",),
        ("limits.speed=1 mm/s", "zone.near.speed=1 mm/s", "zone.far.speed=1 mm/s"),
        ("extremes.turn=5 um",),
        ("motor.steps_per_turn=48", "limits.speed=80 mm/s", "zone.near.speed=9 mm/s", "zone.far.speed=9 mm/s"),
    ],
)
def test_what_the_rules_let_pass(good_text, load_text, overrides):
    load_text(good_text, *(f"{A}.{text}" for text in overrides))


@pytest.mark.parametrize(
    ("travel", "remedy"), [("1 um", f'set {X}.limits.travel = "5 um" or correct the lead'), ("4 um", '"5 um"')]
)
def test_one_step_is_a_travel(stage_text, load_text, travel, remedy):
    start = f"{X}.mechanics.start_position=-55 mm"
    with pytest.raises(InputError) as caught:
        load_text(stage_text, f"{X}.limits.travel={travel}", start)
    (problem,) = caught.value.problems
    assert remedy in problem.remedy
    assert load_text(stage_text, f"{X}.limits.travel=5 um", start).spec.stepper["x"].steps == 1


def test_the_slowest_step_is_one_a_second(stage_text, load_text):
    with pytest.raises(InputError) as caught:
        load_text(stage_text, f"{X}.limits.speed=4 um/s")
    (problem,) = caught.value.problems
    assert problem.remedy == f'set {X}.limits.speed = "5 um/s"'
    load_text(stage_text, f"{X}.limits.speed=5 um/s")


def test_the_fastest_step_of_a_motor_of_unknown_torque_is_that_of_the_words(good_text, load_text):
    with pytest.raises(InputError) as caught:
        load_text(good_text, f"{A}.motor.pull_out=points", f"{A}.limits.speed=1 m/s")
    assert caught.value.problems[0].remedy == f'set {A}.limits.speed = "327.6 mm/s"'


def test_each_motor_has_its_own_problems(good_text, load_text):
    with pytest.raises(InputError) as caught:
        load_text(good_text, f"{A}.limits.speed=25 mm/s", "stepper.group_b.zone.fine.speed=1 mm/s")
    assert [problem.key for problem in caught.value.problems] == [
        f"{A}.limits.speed",
        "stepper.group_b.zone.fine.speed",
    ]


def test_both_tables_of_the_longest_travel_take_forty_megabytes():
    from detent.planning.step_envelope import ENTRY_BYTES

    assert 2 * ENTRY_BYTES * rules.MOST_STEPS == 40_000_000
