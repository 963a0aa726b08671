"""What does not go together in a cascade axis.

Line numbers are those of the packaged example without its head comment: [axis] stands in line 1, [limits] in 5.
"""

import pytest
from tests.bad_files import edit, given, params
from tests.remedies import broken_rules, check_rule, named_value

from detent.errors import InputError
from detent.methods.cascade import checks
from detent.methods.cascade.checks import RULES

LEAD = 'travel_per_revolution = "10 mm"     # lead of the screw\n'
MOTOR = (
    '[motor]\ntorque_constant = "0.35 N*m/A"\nresistance = "1.2 ohm"\nrotor_inertia = "600 g*cm^2"\n'
    'max_current = "6 A"\n\n'
)
WEAK = "limits.effort=1 N"

PARTS = [
    given("a motor for nothing", "drive.input=force", key="drive.input"),
    edit("no motor", MOTOR, "", "13:1", "drive.input"),
    edit("no lead", LEAD, "", "19:1", "drive.input"),
    given("nothing behind the coupling", "mechanics.load_mass=0 kg", key="mechanics.load_mass"),
    given("pendulum on a slide", "mechanics.pendulum=1 N*m", key="mechanics.pendulum"),
    given("encoder that is not there", "method.feedback.velocity=load", key="method.feedback.velocity"),
]

METHOD = [
    given("no gain", "method.velocity_gain=0 V*s/m", key="method.velocity_gain"),
    given("no outer gain", "method.position_gain=0", key="method.position_gain"),
    given("PID without gains", "method.structure=pid", key="method.structure"),
    given("velocity limit", "method.velocity_limit=0.4 m/s", key="method.velocity_limit"),
    given("following error", "method.following_error=10 um", key="method.following_error"),
    given("dead band", "method.dead_band=60 um", key="method.dead_band"),
    given("timeout", "method.timeout=20 ms", key="method.timeout"),
    given("long time in position", "method.in_position_time=3 s", key="method.in_position_time"),
    given("converter", "drive.command_step=5 V", key="drive.command_step"),
]

SENSORS = [
    given("memory", "encoder.velocity_span=40", "encoder.delay=30", key="encoder.velocity_span"),
    given(
        "memory of the second encoder",
        "load_encoder.resolution=1 um",
        "load_encoder.delay=62",
        "load_encoder.velocity_span=2",
        key="load_encoder.velocity_span",
    ),
    given("resolution", "encoder.resolution=1e-10 nm", key="encoder.resolution"),
    edit("start", 'start_position = "20 mm"', 'start_position = "0.6 m"', "29:1", "mechanics.start_position"),
    given("start below the way", "limits.lowest=30 mm", key="limits.lowest"),
]

PLANT = [
    edit("stiction", 'static = "18 N"', 'static = "1 N"', "37:1", "mechanics.friction.positive.static"),
    given(
        "damping",
        "mechanics.load_mass=1 g",
        WEAK,
        "mechanics.coupling.damping=1e8 N*s/m",
        key="mechanics.coupling.damping",
    ),
    given(
        "stiffness",
        "mechanics.load_mass=1 mg",
        "mechanics.coupling.damping=0 N*s/m",
        WEAK,
        "mechanics.coupling.stiffness=1e10 N/m",
        key="mechanics.coupling.stiffness",
    ),
    given("winding", "drive.input=voltage", "motor.inductance=1 nH", key="motor.inductance"),
    given(
        "resistance",
        "drive.input=voltage",
        "motor.torque_constant=100 N*m/A",
        "motor.resistance=1 mohm",
        key="motor.resistance",
    ),
    given("Stribeck", "mechanics.friction.positive.stribeck=1 nm/s", key="mechanics.friction.positive.stribeck"),
    given(
        "viscous",
        "mechanics.load_mass=1 g",
        "mechanics.coupling.damping=0 N*s/m",
        WEAK,
        "mechanics.load_friction.negative.viscous=1e6 N*s/m",
        key="mechanics.load_friction.negative.viscous",
    ),
    given(
        "hopeless", "mechanics.coupling.stiffness=1e12 N/m", WEAK, "mechanics.load_mass=1 mg", key="mechanics.load_mass"
    ),
    given(
        "too strong", "mechanics.load_mass=1 g", "drive.command_limit=1e6 V", "limits.effort=10 MN", key="limits.effort"
    ),
]

HOME = [
    given("search faster than the axis", "home.speed=0.6 m/s", key="home.speed"),
    given("creep faster than the search", "home.creep=60 mm/s", key="home.creep"),
    given("stop inside the travel", "home.by=contact", "home.position=5 mm", key="home.position"),
    given("switch beyond the travel", "home.position=-6 mm", key="home.position"),
]

ENTRIES = [*PARTS, *METHOD, *SENSORS, *PLANT, *HOME]


@pytest.mark.parametrize("bad", params(parts=PARTS, method=METHOD, sensors=SENSORS, plant=PLANT, home=HOME))
def test_rule(bad, good_text, load_text, golden):
    check_rule(bad, good_text, load_text, golden)


def test_every_rule_is_broken_by_an_entry_above(good_text, load_text, monkeypatch):
    broken = broken_rules("cascade", ENTRIES, good_text, load_text, monkeypatch)
    assert broken == {rule.__name__ for rule in RULES}


def problem_of(load_text, text, *overrides):
    with pytest.raises(InputError) as caught:
        load_text(text, *overrides)
    (problem,) = caught.value.problems
    return problem


@pytest.mark.parametrize(
    ("overrides", "key"),
    [
        (("mechanics.load_friction.negative.static=1 mN*m",), "mechanics.load_friction.negative.static"),
        (("mechanics.start_position=-400 deg",), "mechanics.start_position"),
        (("method.velocity_limit=10 deg/s",), "method.velocity_limit"),
        (("method.structure=pid",), "method.structure"),
        (("motor.inductance=1 nH",), "motor.inductance"),
        (("encoder.resolution=1e-20 deg",), "encoder.resolution"),
    ],
)
def test_a_rotary_axis_is_told_in_its_units(load_text, rotary_text, golden, overrides, key):
    problem = problem_of(load_text, rotary_text, *overrides)
    assert problem.key == key
    golden(f"rotary, {overrides[0]}", problem)
    named = named_value(problem.remedy)
    assert not named or load_text(rotary_text, *overrides, *named)


def test_a_rigid_axis_needs_one_mass_only(load_text, short_text):
    load_text(short_text)
    load_text(short_text, "mechanics.motor_mass=1 g", "mechanics.load_mass=0 kg", "method.velocity_gain=1 V*s/m")
    problem = problem_of(load_text, short_text, "mechanics.load_mass=0 kg")
    assert problem.key == "mechanics.load_mass"


def test_the_motor_counts_on_its_side_of_the_coupling(load_text, good_text):
    load_text(good_text, "mechanics.motor_mass=0 kg")


def test_what_is_needed_to_propose_a_gain_is_missing_as_well(load_text, good_text):
    text = good_text.replace(LEAD, "")
    with pytest.raises(InputError) as caught:
        load_text(text, "method.velocity_gain=0 V*s/m", "drive.command_step=5 V")
    assert [problem.key for problem in caught.value.problems] == ["drive.input", "method.velocity_gain"]


@pytest.mark.parametrize(
    "overrides",
    [
        ("encoder.velocity_span=63",),
        ("encoder.delay=62",),
        ("encoder.resolution=0 m",),
        ("mechanics.start_position=500 mm",),
        ("mechanics.start_position=0 m",),
        ("method.velocity_limit=500 mm/s",),
        ("drive.input=voltage", "motor.inductance=0 H"),
        ("method.structure=pid", "method.proportional=1 V/m"),
    ],
)
def test_what_the_rules_let_pass(good_text, load_text, overrides):
    load_text(good_text, *overrides)


def test_the_memory_is_that_of_the_blocks():
    from detent.drive import effort_source
    from detent.methods.cascade.schema import MOST_SAMPLES
    from detent.sensing import position_sensor

    assert position_sensor.MEMORY - 1 == MOST_SAMPLES
    assert effort_source.MEMORY - 1 == MOST_SAMPLES


def test_the_fastest_plant_takes_ticks_that_can_be_counted():
    from detent.methods.cascade.build import sample_ticks

    assert sample_ticks(0.1, checks.FASTEST) < 2**31
