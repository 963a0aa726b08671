"""What does not go together in a stepper-envelope axis.

Line numbers are those of the packaged zoom without its head comment: [axis] stands in line 1.
"""

import pytest
from tests.bad_files import Bad, edit, params
from tests.bad_files import given as given_in_full
from tests.remedies import broken_rules, check_rule, named_value

from detent.errors import InputError
from detent.methods.stepper_envelope import rules
from detent.methods.stepper_envelope.rules import RULES

A, X = "stepper.group_a", "stepper.x"


def given(name, *overrides, key, **more):
    """Overrides of the first motor of the zoom; the problem is that of its key."""
    return given_in_full(name, *(f"{A}.{text}" for text in overrides), key=f"{A}.{key}", **more)


FREQUENCIES = [
    given("no word for the frequency", "limits.speed=1 m/s", key="limits.speed"),
    given("a start that is none", "motor.start_frequency=1 Hz", key="motor.start_frequency"),
    given("a start divided away", "motor.start_frequency=10 Hz", "drive.start_safety=15", key="motor.start_frequency"),
    given("search faster than the motor", "home.speed=30 mm/s", key="home.speed"),
    given("half a tooth pitch", "motor.steps_per_turn=202", key="motor.steps_per_turn"),
    given(
        "a rotor without mass",
        "motor.rotor_inertia=0.001 g*cm^2",
        "mechanics.screw_inertia=0.001 g*cm^2",
        "mechanics.coupling_inertia=0 g*cm^2",
        "mechanics.moving_mass=0 kg",
        key="motor.rotor_inertia",
    ),
    Bad("part of a clock", "--set", "controller.timer", overrides=("controller.timer=250000.4 Hz",)),
]

PLACES = [
    given("too many steps", "limits.travel=90 m", key="limits.travel"),
    given("start above the travel", "mechanics.start_position=50 mm", key="mechanics.start_position"),
    given("start below the travel", "mechanics.start_position=-1 mm", key="mechanics.start_position"),
    given("turn above the travel", "extremes.turn=41 mm", key="extremes.turn"),
    given("travel moved away from an extreme", "mechanics.lower_end=5 mm", "extremes.stop=1 mm", key="extremes.stop"),
    given("extremes reversed", "extremes.turn=1 mm", "extremes.start=2 mm", key="extremes.turn"),
    given("extremes equal", "extremes.turn=1 mm", "extremes.stop=1 mm", key="extremes.turn"),
    given(
        "both above the turn", "extremes.turn=1 mm", "extremes.start=1 mm", "extremes.stop=2 mm", key="extremes.turn"
    ),
    given("all at the end", "extremes.turn=40 mm", "extremes.start=40 mm", "extremes.stop=40 mm", key="extremes.turn"),
]


def renamed(text, first, second="group_b"):
    """The zoom with other motors."""
    return text.replace("stepper.group_a", f"stepper.{first}").replace("stepper.group_b", f"stepper.{second}")


@pytest.mark.parametrize(
    ("one", "other", "meaning"),
    [("x", "x_um", "motor x in um"), ("a_b_mm_c", "a_b", "motor a_b in mm"), ("x", "dwell_s", "dwell in s")],
)
def test_a_name_that_is_a_column_of_another_is_refused(good_text, load_text, one, other, meaning):
    """A column x_um of a list of places went to motor x, and motor x_um stood still."""
    name = max(one, other, key=len)
    with pytest.raises(InputError) as caught:
        load_text(renamed(good_text, one, other))
    (problem,) = caught.value.problems
    assert (problem.key, problem.got) == (f"stepper.{name}", "a table of this name")
    assert f'there "{name}" is {meaning}' in problem.allowed
    assert meaning.partition(" in ")[0] in problem.remedy or "dwell" in problem.allowed


@pytest.mark.parametrize("names", [("x_um", "y"), ("x", "x_u"), ("x", "xum"), ("a__b", "a_b"), ("dwell_x", "x")])
def test_names_that_are_alike_pass(good_text, load_text, names):
    load_text(renamed(good_text, *names))


ZONES = [
    edit("zone that overlaps the next", 'end = "13 mm"', 'end = "26 mm"', "41:1", f"{A}.zone.far.begin"),
    given("zone around the next", "zone.near.end=31 mm", key="zone.near.end"),
    given("zones that begin together", "zone.near.begin=25 mm", "zone.near.end=30 mm", key="zone.near.end"),
    given("zone that ends before it begins", "zone.near.end=9 mm", key="zone.near.end"),
    given("zone without length", "zone.near.begin=13 mm", key="zone.near.begin"),
    given("zone that begins off the travel", "zone.near.begin=50 mm", key="zone.near.begin"),
    given("zone with both ends off the travel", "zone.near.begin=50 mm", "zone.near.end=45 mm", key="zone.near.end"),
    given("zone that ends off the travel", "zone.far.end=41 mm", key="zone.far.end"),
    given("zone beside the travel", "zone.far.begin=50 mm", "zone.far.end=60 mm", key="zone.far.begin"),
    given("zone below the start frequency", "zone.near.speed=1 mm/s", key="zone.near.speed"),
    given("zone far below the start frequency", "zone.near.speed=0.1 mm/s", key="zone.near.speed"),
    given("zone faster than the motor", "zone.near.speed=21 mm/s", key="zone.near.speed"),
]

STAGE = [
    given_in_full(
        "too few ticks in the shortest period",
        "controller.timer=250 kHz",
        f"{X}.limits.speed=200 mm/s",
        f"{X}.limits.acceleration=100 m/s^2",
        f"{X}.drive.supply=1 kV",
        key="controller.timer",
    )
]


@pytest.mark.parametrize("bad", params(frequency=FREQUENCIES, place=PLACES, zone=ZONES))
def test_rule(bad, good_text, load_text, golden):
    check_rule(bad, good_text, load_text, golden)


@pytest.mark.parametrize("bad", params(stage=STAGE))
def test_rule_of_the_stage(bad, stage_text, load_text, golden):
    check_rule(bad, stage_text, load_text, golden)


def test_every_rule_is_broken_by_an_entry_above(good_text, stage_text, load_text, monkeypatch):
    broken = broken_rules("stepper_envelope", [*FREQUENCIES, *PLACES, *ZONES], good_text, load_text, monkeypatch)
    broken |= broken_rules("stepper_envelope", STAGE, stage_text, load_text, monkeypatch)
    assert broken == {rule.__name__ for rule in RULES} - {"_names", "_constants", "_curve", "_torques", "_ramp"}


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


@pytest.mark.parametrize("travel", ["1 um", "4 um"])
def test_one_step_is_a_travel(stage_text, load_text, travel):
    start = f"{X}.mechanics.start_position=-55 mm"
    with pytest.raises(InputError) as caught:
        load_text(stage_text, f"{X}.limits.travel={travel}", start)
    (problem,) = caught.value.problems
    assert named_value(problem.remedy) == [f'{X}.limits.travel="5 um"']
    assert load_text(stage_text, f"{X}.limits.travel=5 um", start).spec.stepper["x"].steps == 1


def test_the_slowest_step_is_one_a_second(stage_text, load_text):
    with pytest.raises(InputError) as caught:
        load_text(stage_text, f"{X}.limits.speed=4 um/s")
    (problem,) = caught.value.problems
    assert named_value(problem.remedy) == [f'{X}.limits.speed="5 um/s"']
    load_text(stage_text, f"{X}.limits.speed=5 um/s")


def test_the_fastest_step_of_a_motor_of_unknown_torque_is_that_of_the_words(good_text, load_text):
    with pytest.raises(InputError) as caught:
        load_text(good_text, f"{A}.motor.pull_out=points", f"{A}.limits.speed=1 m/s")
    assert named_value(caught.value.problems[0].remedy) == [f'{A}.limits.speed="327.6 mm/s"']


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
