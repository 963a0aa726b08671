"""What does not go together in a filtered-servo axis, and the nearest value that would do.

Line numbers are those of the packaged example without its head comment: [axis] stands in line 1, [limits] in 5. Every
value that a remedy names is tried: it is accepted, and of its two neighbours one is not.
"""

import pytest
from tests.bad_files import added, edit, params
from tests.remedies import broken_rules, check_rule, given

from detent.errors import InputError
from detent.methods.filtered_servo import rules
from detent.methods.filtered_servo.rules import RULES

COEFFICIENT = "coefficient = 0.25"
PERIOD = 'sample_period = "5 ms"'
BURST = "disturbance.lines.burst"
LIGHT = ("mechanics.moving_mass=0 kg", "motor.rotor_inertia=1e-5 g*cm^2", "drive.current_per_count=1 nA")


FILTER = [
    edit(
        "coefficient above 1",
        COEFFICIENT,
        "coefficient = 1.5",
        "38:1",
        "method.coefficient",
        "1.5",
        "from 1/4096 up to 1; 1 means no filter",
        "in this range",
    ),
    edit(
        "no coefficient",
        COEFFICIENT,
        "coefficient = 0.0",
        "38:1",
        "method.coefficient",
        "0.0",
        "from 1/4096 up to 1; 1 means no filter",
        "in this range",
    ),
    edit(
        "no power of two",
        f'filter = "float"                    # or "fixed", or "none": the conventional servo\n{COEFFICIENT}',
        'filter = "fixed"\ncoefficient = 0.3',
        "38:1",
        "method.coefficient",
        "0.3",
        "a power of two from 2^-12 to 1 where the filter is fixed-point: it shifts",
        'set method.coefficient = 0.25 or set method.filter = "float"',
    ),
    given(
        "nearly the smallest power of two",
        "method.filter=fixed",
        "method.coefficient=0.000245",
        key="method.coefficient",
        came="0.000245",
        allowed="a power of two",
        remedy='set method.coefficient = 0.000244140625 or set method.filter = "float"',
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
        came="16",
        allowed="few enough for scale x count, up to 524288, in an accumulator of 32 bits",
        remedy="set method.fraction_bits = 11",
    ),
]

SAMPLING = [
    edit(
        "no whole clocks",
        PERIOD,
        'sample_period = "1234.5678 us"',
        "40:1",
        "method.sample_period",
        '"1234.5678 us"',
        "a whole number of microseconds, the clocks of the decoder",
        'set method.sample_period = "1.235 ms"',
    ),
    edit(
        "short window",
        PERIOD,
        'sample_period = "50 us"',
        "40:1",
        "method.sample_period",
        '"50 us"',
        "from 100 us up to 100 ms, in whole microseconds",
        "in this range",
    ),
    given(
        "window",
        "method.sample_period=10 ms",
        key="method.sample_period",
        came="10 ms",
        allowed="such that a sample at limits.speed counts up to 126 pulses, here 200: a counter of 8 bits that is",
        remedy='set method.sample_period = "6300 us" or set limits.speed = "62.99 mm/s" or set method.counter_bits = 9',
    ),
    given(
        "too fast for any counter",
        "limits.speed=2.4 m/s",
        "method.position_bits=15",
        key="limits.speed",
        came="2.4 m/s",
        allowed='method.sample_period ("5 ms") such that a sample at limits.speed counts up to 126 pulses, here 2400',
        remedy='set method.sample_period = "262 us" or set limits.speed = "125.9 mm/s"',
    ),
    given(
        "pulse rate",
        "limits.speed=3 m/s",
        "method.sample_period=200 us",
        "method.counter_bits=12",
        key="limits.speed",
        came="3 m/s",
        allowed="up to 2.5 m/s: the edges keep below half the decoder's clock of 1 MHz",
        remedy='set limits.speed = "2.5 m/s" or use a coarser encoder',
    ),
    given(
        "PWM",
        "drive.pwm_frequency=30 kHz",
        key="drive.pwm_frequency",
        came="30 kHz",
        allowed="100 kHz divided by a whole number: a PWM period is a whole number of 10 us",
        remedy='set drive.pwm_frequency = "33.3333333 kHz"',
    ),
    given(
        "fast PWM",
        "drive.pwm_frequency=80 kHz",
        key="drive.pwm_frequency",
        came="80 kHz",
        allowed="100 kHz divided by a whole number",
        remedy='set drive.pwm_frequency = "100 kHz"',
    ),
]

POSITION = [
    given(
        "position counter",
        "method.position_bits=8",
        key="method.position_bits",
        came="8",
        allowed="wide enough for the following error at limits.speed, 401 pulses: 8 bits hold 127",
        remedy='set method.position_bits = 10 or set limits.speed = "31.49 mm/s" or set method.scale = 1',
    ),
    given(
        "scale",
        "method.scale=100",
        key="method.scale",
        came="100",
        allowed="method.position_bits (its default) wide enough for the following error at limits.speed, 1e+04",
        remedy='set method.position_bits = 15 or set limits.speed = "20.45 mm/s" or set method.scale = 20',
    ),
    given(
        "small gain",
        "method.position_gain=0.01",
        "method.scale=256",
        key="method.scale",
        came="256",
        allowed="2.56e+06 pulses: 12 bits hold 2047",
        remedy='set limits.speed = "75.96 um/s"',
    ),
    given(
        "friction fills the counter",
        "mechanics.friction.right.static=1000 N",
        "mechanics.friction.right.coulomb=1000 N",
        "method.position_bits=8",
        key="method.position_bits",
        came="8",
        allowed="852.1 pulses: 8 bits hold 127",
        remedy="set method.position_bits = 11",
    ),
    given(
        "friction fills any counter",
        "mechanics.friction.right.static=1e5 N",
        "mechanics.friction.right.coulomb=1e5 N",
        "method.position_bits=12",
        key="method.position_bits",
        came="12",
        allowed="wide enough for the following error at limits.speed, 4.561e+04 pulses: 12 bits hold 2047",
        remedy="set method.position_gain = 22.29",
    ),
    given(
        "friction beyond any drive",
        "mechanics.friction.right.static=1e5 N",
        "mechanics.friction.right.coulomb=1e5 N",
        "drive.current_per_count=1 uA",
        "limits.speed=90 mm/s",
        key="limits.speed",
        came="90 mm/s",
        allowed="1.592e+09 pulses: 12 bits hold 2047",
        remedy="check the units of friction, motor and screw",
    ),
    given(
        "command",
        "method.command_acceleration=0.1 um/s^2",
        key="method.command_acceleration",
        came="0.1 um/s^2",
        allowed="0 m/s^2, or at least 0.1 pulses/s^2, 500 nm/s^2: a command that grows more slowly does not",
        remedy='set method.command_acceleration = "500 nm/s^2"',
    ),
    given(
        "timeout",
        "method.timeout=20 ms",
        "method.in_position_time=20 ms",
        key="method.timeout",
        came="20 ms",
        allowed="longer than method.in_position_time, 20 ms: no move could end",
        remedy='set method.timeout = "20.01 ms"',
    ),
    given(
        "long time in position",
        "method.in_position_time=3 s",
        key="method.in_position_time",
        came="3 s",
        allowed="method.timeout (its default) longer than method.in_position_time, 3 s",
        remedy='set method.timeout = "3.001 s"',
    ),
    edit(
        "start",
        'start_position = "20 mm"',
        'start_position = "0.6 m"',
        "23:1",
        "mechanics.start_position",
        '"0.6 m"',
        "up to limits.travel, 500 mm",
        'set mechanics.start_position = "500 mm" or correct limits.travel',
    ),
]

MACHINE = [
    given(
        "no whole word",
        "drive.whole_words=true",
        "limits.effort=2 N",
        key="limits.effort",
        came="2 N",
        allowed="at least one count of the drive word, 2.212 N, where it is whole",
        remedy='set limits.effort = "2.212 N" or set drive.whole_words = false',
    ),
    given(
        "current for a feather",
        "mechanics.moving_mass=0 kg",
        "motor.rotor_inertia=0.001 g*cm^2",
        key="mechanics.moving_mass",
        came="0 kg",
        allowed='drive.current_per_count ("35.2 mA") such that a count of the drive word moves the slide by up to 1000',
        remedy='set drive.current_per_count = "502.6 uA" or check the units of motor, screw and encoder',
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
        came="1000",
        allowed="drive.supply (its default) such that a count",
        remedy='set drive.supply = "',
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
        came="1000000",
        allowed="drive.supply (its default) such that a count",
        remedy="check the units of motor, screw and encoder",
    ),
    given(
        "winding",
        "motor.inductance=1 nH",
        key="motor.inductance",
        came="1 nH",
        allowed="such that the rates of the machine add up to 1/1 ns or less, here R / L",
        remedy='set motor.inductance = "2.001 nH" or lower motor.resistance',
    ),
    given(
        "viscous",
        *LIGHT,
        "motor.inductance=1 mH",
        "mechanics.friction.left.viscous=1e5 N*s/m",
        "mechanics.friction.right.coulomb=0 N",
        "mechanics.friction.left.coulomb=0 N",
        "limits.speed=1 nm/s",
        key="mechanics.friction.left.viscous",
        came="1e5 N*s/m",
        allowed="such that the rates of the machine add up to 1/1 ns or less, here viscous over mass",
        remedy='set mechanics.friction.left.viscous = "',
    ),
    given(
        "back-EMF without inductance",
        *LIGHT,
        "motor.torque_constant=1 N*m/A",
        "motor.resistance=1 mohm",
        "mechanics.friction.right.coulomb=0 N",
        "mechanics.friction.left.coulomb=0 N",
        key="motor.resistance",
        came="1 mohm",
        allowed="such that speed decays in 1 ns or more",
        remedy="check the units of motor, screw and mass",
    ),
    edit(
        "stiction",
        'static = "2.26 N"',
        'static = "1 N"',
        "27:1",
        "mechanics.friction.right.static",
        '"1 N"',
        "at least the Coulomb friction, 2.26 N",
        'set mechanics.friction.right.static = "2.26 N" or leave it out: it is then 1.15 x coulomb',
    ),
    added(
        "burst",
        f'[{BURST}]\nkind = "+"\nat = "1 s"\ncount = 2\nspacing = "5 us"',
        "50:1",
        f"{BURST}.spacing",
        '"5 us"',
        "at least one base tick, 10 us",
        f'set {BURST}.spacing = "10 us" or set {BURST}.count = 1',
    ),
]

ENTRIES = [*FILTER, *SAMPLING, *POSITION, *MACHINE]


@pytest.mark.parametrize("bad", params(filter=FILTER, sampling=SAMPLING, position=POSITION, machine=MACHINE))
def test_rule(bad, good_text, load_text):
    check_rule(bad, good_text, load_text)


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


def test_a_window_that_would_be_too_short_is_not_named(good_text, load_text):
    overrides = ["method.sample_period=100 us", "limits.speed=2 m/s", "encoder.cycles_per_revolution=2500"]
    with pytest.raises(InputError) as caught:
        load_text(good_text, *overrides)
    first, second = caught.value.problems
    assert first.remedy == 'set limits.speed = "629.9 mm/s" or set method.counter_bits = 10'
    assert "up to 250 mm/s" in second.allowed


def test_a_wrong_key_gives_no_problem_of_the_rules_that_look_at_it(good_text, load_text):
    with pytest.raises(InputError) as caught:
        load_text(good_text, "method.counter_bits=3", "limits.speed=1 m/s", "method.position_bits=15")
    (problem,) = caught.value.problems
    assert problem.key == "method.counter_bits"


def test_the_constants_are_those_of_the_blocks():
    from detent.control.pulse_generator import PER_PULSE
    from detent.methods.filtered_servo import system as filtered_servo

    assert pytest.approx(filtered_servo.TICK) == rules.TICK
    assert pytest.approx(filtered_servo.TICK / filtered_servo.CLOCKS) == rules.CLOCK
    assert pytest.approx(1 / PER_PULSE) == rules.RATE_UNIT
