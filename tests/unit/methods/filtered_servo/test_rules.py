"""What does not go together in a filtered-servo axis.

Line numbers are those of the packaged example without its head comment: [axis] stands in line 1, [limits] in 5.
"""

import pytest
from tests.bad_files import added, edit, given, params
from tests.remedies import broken_rules, check_rule

from detent.errors import InputError
from detent.methods.filtered_servo import checks
from detent.methods.filtered_servo.checks import RULES

COEFFICIENT = "coefficient = 0.25"
PERIOD = 'sample_period = "5 ms"'
BURST = "disturbance.lines.burst"
LIGHT = ("mechanics.moving_mass=0 kg", "motor.rotor_inertia=1e-5 g*cm^2", "drive.current_per_count=1 nA")


FILTER = [
    edit("coefficient above 1", COEFFICIENT, "coefficient = 1.5", "38:1", "method.coefficient"),
    edit("no coefficient", COEFFICIENT, "coefficient = 0.0", "38:1", "method.coefficient"),
    edit(
        "no power of two",
        f'filter = "float"                    # or "fixed", or "none": the conventional servo\n{COEFFICIENT}',
        'filter = "fixed"\ncoefficient = 0.3',
        "38:1",
        "method.coefficient",
    ),
    given(
        "nearly the smallest power of two",
        "method.filter=fixed",
        "method.coefficient=0.000245",
        key="method.coefficient",
    ),
    given(
        "fraction bits",
        "method.filter=fixed",
        "method.fraction_bits=16",
        "method.scale=256",
        "method.counter_bits=12",
        "method.position_bits=15",
        "limits.speed=10 mm/s",
        key="method.fraction_bits",
    ),
]

SAMPLING = [
    edit("no whole clocks", PERIOD, 'sample_period = "1234.5678 us"', "40:1", "method.sample_period"),
    edit("short window", PERIOD, 'sample_period = "50 us"', "40:1", "method.sample_period"),
    given("window", "method.sample_period=10 ms", key="method.sample_period"),
    given("too fast for any counter", "limits.speed=2.4 m/s", "method.position_bits=15", key="limits.speed"),
    given(
        "pulse rate", "limits.speed=3 m/s", "method.sample_period=200 us", "method.counter_bits=12", key="limits.speed"
    ),
    given("PWM", "drive.pwm_frequency=30 kHz", key="drive.pwm_frequency"),
    given("fast PWM", "drive.pwm_frequency=80 kHz", key="drive.pwm_frequency"),
]

POSITION = [
    given("position counter", "method.position_bits=8", key="method.position_bits"),
    given("scale", "method.scale=100", key="method.scale"),
    given("small gain", "method.position_gain=0.01", "method.scale=256", key="method.scale"),
    given(
        "friction fills the counter",
        "mechanics.friction.right.static=1000 N",
        "mechanics.friction.right.coulomb=1000 N",
        "method.position_bits=8",
        key="method.position_bits",
    ),
    given(
        "friction fills any counter",
        "mechanics.friction.right.static=1e5 N",
        "mechanics.friction.right.coulomb=1e5 N",
        "method.position_bits=12",
        key="method.position_bits",
    ),
    given(
        "friction beyond any drive",
        "mechanics.friction.right.static=1e5 N",
        "mechanics.friction.right.coulomb=1e5 N",
        "drive.current_per_count=1 uA",
        "limits.speed=90 mm/s",
        key="limits.speed",
    ),
    given("search faster than the axis", "home.speed=0.2 m/s", key="home.speed"),
    given("mark too near to the frame", "home.position=1 mm", key="home.position"),
    given("command", "method.command_acceleration=0.1 um/s^2", key="method.command_acceleration"),
    given("timeout", "method.timeout=20 ms", "method.in_position_time=20 ms", key="method.timeout"),
    given("long time in position", "method.in_position_time=3 s", key="method.in_position_time"),
    edit("start", 'start_position = "20 mm"', 'start_position = "0.6 m"', "23:1", "mechanics.start_position"),
]

MACHINE = [
    given("no whole word", "drive.whole_words=true", "limits.effort=2 N", key="limits.effort"),
    given(
        "current for a feather",
        "mechanics.moving_mass=0 kg",
        "motor.rotor_inertia=0.001 g*cm^2",
        key="mechanics.moving_mass",
    ),
    given(
        "voltage for a feather",
        "drive.amplifier=voltage",
        "mechanics.moving_mass=0 kg",
        "motor.rotor_inertia=1e-4 g*cm^2",
        "motor.torque_constant=0.1 mN*m/A",
        "encoder.cycles_per_revolution=1000",
        "mechanics.friction.right.coulomb=0 N",
        "mechanics.friction.left.coulomb=0 N",
        "limits.speed=1 mm/s",
        key="encoder.cycles_per_revolution",
    ),
    given(
        "voltage for a mote",
        "mechanics.moving_mass=0 kg",
        "drive.amplifier=voltage",
        "motor.rotor_inertia=1e-5 g*cm^2",
        "motor.torque_constant=10 uN*m/A",
        "encoder.cycles_per_revolution=1000000",
        "limits.speed=0.01 mm/s",
        "mechanics.friction.right.coulomb=0 N",
        "mechanics.friction.left.coulomb=0 N",
        key="encoder.cycles_per_revolution",
    ),
    given("winding", "motor.inductance=1 nH", key="motor.inductance"),
    given(
        "viscous",
        *LIGHT,
        "motor.inductance=1 mH",
        "mechanics.friction.left.viscous=1e5 N*s/m",
        "mechanics.friction.right.coulomb=0 N",
        "mechanics.friction.left.coulomb=0 N",
        "limits.speed=1 nm/s",
        key="mechanics.friction.left.viscous",
    ),
    given(
        "back-EMF without inductance",
        *LIGHT,
        "motor.torque_constant=1 N*m/A",
        "motor.resistance=1 mohm",
        "mechanics.friction.right.coulomb=0 N",
        "mechanics.friction.left.coulomb=0 N",
        key="motor.resistance",
    ),
    edit("stiction", 'static = "2.26 N"', 'static = "1 N"', "27:1", "mechanics.friction.right.static"),
    added("burst", f'[{BURST}]\nkind = "+"\nat = "1 s"\ncount = 2\nspacing = "5 us"', "53:1", f"{BURST}.spacing"),
]

ENTRIES = [*FILTER, *SAMPLING, *POSITION, *MACHINE]


@pytest.mark.parametrize("bad", params(filter=FILTER, sampling=SAMPLING, position=POSITION, machine=MACHINE))
def test_rule(bad, good_text, load_text, golden):
    check_rule(bad, good_text, load_text, golden)


def test_every_rule_is_broken_by_an_entry_above(good_text, load_text, monkeypatch):
    broken = broken_rules("filtered_servo", ENTRIES, good_text, load_text, monkeypatch)
    assert broken == {rule.__name__ for rule in RULES}


@pytest.mark.parametrize(
    "overrides",
    [
        ("method.coefficient=0.3",),
        ("method.filter=none", "method.coefficient=0.3"),
        ("method.filter=fixed", "method.coefficient=1"),
        ("method.sample_period=1234 us",),
        ("drive.pwm_frequency=33.333333 kHz",),
        ("drive.pwm_frequency=100 Hz",),
        ("limits.effort=2 N",),
        ("method.command_acceleration=0 m/s^2",),
        ("mechanics.start_position=500 mm",),
        ("method.filter=none", "method.scale=1", "method.sample_period=20 ms", "method.counter_bits=12"),
    ],
)
def test_what_the_rules_let_pass(good_text, load_text, overrides):
    load_text(good_text, *overrides)


def test_a_wrong_key_gives_no_problem_of_the_rules_that_look_at_it(good_text, load_text):
    with pytest.raises(InputError) as caught:
        load_text(good_text, "method.counter_bits=3", "limits.speed=1 m/s", "method.position_bits=15")
    (problem,) = caught.value.problems
    assert problem.key == "method.counter_bits"


def test_the_constants_are_those_of_the_blocks():
    from detent.control.pulse_generator import PER_PULSE
    from detent.methods.filtered_servo import system as filtered_servo

    assert pytest.approx(filtered_servo.TICK) == checks.TICK
    assert pytest.approx(filtered_servo.TICK / filtered_servo.CLOCKS) == checks.CLOCK
    assert pytest.approx(1 / PER_PULSE) == checks.RATE_UNIT
