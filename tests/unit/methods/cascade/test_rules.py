"""What does not go together in a cascade axis, and the nearest value that would do.

Line numbers are those of the packaged example without its head comment: [axis] stands in line 1, [limits] in 5. Every
value that a remedy names is tried: it is accepted, and of its two neighbours one is not.
"""

import pytest
from tests.bad_files import edit, params
from tests.remedies import broken_rules, check_rule, given

from detent.errors import InputError
from detent.methods.cascade import rules
from detent.methods.cascade.rules import RULES

LEAD = 'travel_per_revolution = "10 mm"     # lead of the screw\n'
MOTOR = (
    '[motor]\ntorque_constant = "0.35 N*m/A"\nresistance = "1.2 ohm"\nrotor_inertia = "600 g*cm^2"\n'
    'max_current = "6 A"\n\n'
)
WEAK = "limits.effort=1 N"

PARTS = [
    given(
        "a motor for nothing",
        "drive.input=force",
        key="drive.input",
        came="force",
        allowed='"current" or "voltage" where there is a [motor]',
        remedy='set drive.input = "current" or remove [motor]',
    ),
    edit(
        "no motor",
        MOTOR,
        "",
        "13:1",
        "drive.input",
        '"current"',
        '"force" where there is no [motor]',
        'add [motor] with torque_constant, resistance, rotor_inertia or set drive.input = "force"',
    ),
    edit(
        "no lead",
        LEAD,
        "",
        "19:1",
        "drive.input",
        '"current"',
        "mechanics.travel_per_revolution (its default) a length where there is a [motor]",
        'add travel_per_revolution = "10 mm" in [mechanics] (lead of the screw, or circumference of the pulley)',
    ),
    given(
        "nothing behind the coupling",
        "mechanics.load_mass=0 kg",
        key="mechanics.load_mass",
        came="0 kg",
        allowed="such that what moves on the load's side of the coupling comes to at least 1e-12 kg",
        remedy="state mechanics.load_mass, or leave [mechanics.coupling] out",
    ),
    given(
        "pendulum on a slide",
        "mechanics.pendulum=1 N*m",
        key="mechanics.pendulum",
        came="1 N*m",
        allowed="0 N*m where axis.motion is linear",
        remedy='set mechanics.pendulum = "0 N*m" or state a weight as mechanics.weight',
    ),
    given(
        "encoder that is not there",
        "method.feedback.velocity=load",
        key="method.feedback.velocity",
        came="load",
        allowed='"motor" where there is no [load_encoder]',
        remedy='set method.feedback.velocity = "motor" or add [load_encoder] with resolution',
    ),
]

METHOD = [
    given(
        "no gain",
        "method.velocity_gain=0 V*s/m",
        key="method.velocity_gain",
        came="0 V*s/m",
        allowed='above 0 where method.structure is "cascade"',
        remedy='state velocity_gain in [method], such as "43 V*s/m" to begin with',
    ),
    given(
        "no outer gain",
        "method.position_gain=0",
        key="method.position_gain",
        came="0",
        allowed='above 0 where method.structure is "cascade"',
        remedy="state position_gain in [method], such as 31 to begin with",
    ),
    given(
        "PID without gains",
        "method.structure=pid",
        key="method.structure",
        came="pid",
        allowed='method.proportional (its default) above 0 where method.structure is "pid"',
        remedy='state proportional in [method], such as "1.3 kV/m" to begin with',
    ),
    given(
        "velocity limit",
        "method.velocity_limit=0.4 m/s",
        key="method.velocity_limit",
        came="0.4 m/s",
        allowed="at least limits.speed, 500 mm/s",
        remedy='set method.velocity_limit = "500 mm/s" or leave it out: it is then 1.25 x limits.speed',
    ),
    given(
        "following error",
        "method.following_error=10 um",
        key="method.following_error",
        came="10 um",
        allowed="above method.in_position, 50 um",
        remedy='set method.following_error = "50.05 um"',
    ),
    given(
        "timeout",
        "method.timeout=20 ms",
        key="method.timeout",
        came="20 ms",
        allowed="longer than method.in_position_time, 50 ms: no move could end",
        remedy='set method.timeout = "50.26 ms"',
    ),
    given(
        "long time in position",
        "method.in_position_time=3 s",
        key="method.in_position_time",
        came="3 s",
        allowed="method.timeout (its default) longer than method.in_position_time, 3 s",
        remedy='set method.timeout = "3.001 s"',
    ),
    given(
        "converter",
        "drive.command_step=5 V",
        key="drive.command_step",
        came="5 V",
        allowed="up to the largest command, 3.41 V",
        remedy='set drive.command_step = "3.41 V"',
    ),
]

SENSORS = [
    given(
        "memory",
        "encoder.velocity_span=40",
        "encoder.delay=30",
        key="encoder.velocity_span",
        came="40",
        allowed="up to 63 samples together with encoder.delay",
        remedy="set encoder.velocity_span = 33",
    ),
    given(
        "memory of the second encoder",
        "load_encoder.resolution=1 um",
        "load_encoder.delay=62",
        "load_encoder.velocity_span=2",
        key="load_encoder.velocity_span",
        came="2",
        allowed="together with load_encoder.delay",
        remedy="set load_encoder.velocity_span = 1",
    ),
    given(
        "resolution",
        "encoder.resolution=1e-10 nm",
        key="encoder.resolution",
        came="1e-10 nm",
        allowed="0 m, or at least 1.11e-07 nm: more counts cannot be told apart",
        remedy='set encoder.resolution = "1.111e-07 nm"',
    ),
    edit(
        "start",
        'start_position = "20 mm"',
        'start_position = "0.6 m"',
        "29:1",
        "mechanics.start_position",
        '"0.6 m"',
        "from 0 m to 500 mm, the way of the axis",
        'set mechanics.start_position = "0.5 m" or correct limits.travel or limits.lowest',
    ),
    given(
        "start below the way",
        "limits.lowest=30 mm",
        key="limits.lowest",
        came="30 mm",
        allowed='mechanics.start_position ("20 mm") from 30 mm to 530 mm',
        remedy='set mechanics.start_position = "0.03 m"',
    ),
]

PLANT = [
    edit(
        "stiction",
        'static = "18 N"',
        'static = "1 N"',
        "37:1",
        "mechanics.friction.positive.static",
        '"1 N"',
        "at least the Coulomb friction, 14 N",
        'set mechanics.friction.positive.static = "14 N" or leave it out: it is then 1.15 x coulomb',
    ),
    given(
        "damping",
        "mechanics.load_mass=1 g",
        WEAK,
        "mechanics.coupling.damping=1e8 N*s/m",
        key="mechanics.coupling.damping",
        came="1e8 N*s/m",
        allowed="such that the fastest rate of motor, coupling and load is 1/100 ns or less, here 1/0.01 ns",
        remedy='set mechanics.coupling.damping = "10 kN*s/m" or check the units of the masses',
    ),
    given(
        "stiffness",
        "mechanics.load_mass=1 mg",
        "mechanics.coupling.damping=0 N*s/m",
        WEAK,
        "mechanics.coupling.stiffness=1e10 N/m",
        key="mechanics.coupling.stiffness",
        came="1e10 N/m",
        allowed="1/100 ns or less",
        remedy='set mechanics.coupling.stiffness = "99.99 MN/m" or check the units of the masses',
    ),
    given(
        "winding",
        "drive.input=voltage",
        "motor.inductance=1 nH",
        key="motor.inductance",
        came="1 nH",
        allowed="1/100 ns or less",
        remedy='set motor.inductance = "120 nH" or check the units of the masses',
    ),
    given(
        "resistance",
        "drive.input=voltage",
        "motor.torque_constant=100 N*m/A",
        "motor.resistance=1 mohm",
        key="motor.resistance",
        came="1 mohm",
        allowed="1/100 ns or less",
        remedy='set motor.resistance = "',
    ),
    given(
        "Stribeck",
        "mechanics.friction.positive.stribeck=1 nm/s",
        key="mechanics.friction.positive.stribeck",
        came="1 nm/s",
        allowed="1/100 ns or less",
        remedy='set mechanics.friction.positive.stribeck = "10.83 nm/s" or check the units of the masses',
    ),
    given(
        "viscous",
        "mechanics.load_mass=1 g",
        "mechanics.coupling.damping=0 N*s/m",
        WEAK,
        "mechanics.load_friction.negative.viscous=1e6 N*s/m",
        key="mechanics.load_friction.negative.viscous",
        came="1e6 N*s/m",
        allowed="1/100 ns or less",
        remedy='set mechanics.load_friction.negative.viscous = "',
    ),
    given(
        "hopeless",
        "mechanics.coupling.stiffness=1e12 N/m",
        WEAK,
        "mechanics.load_mass=1 mg",
        key="mechanics.load_mass",
        came="1 mg",
        allowed="1/100 ns or less",
        remedy="check the units of the masses",
    ),
    given(
        "too strong",
        "mechanics.load_mass=1 g",
        "drive.command_limit=1e6 V",
        "limits.effort=10 MN",
        key="limits.effort",
        came="10 MN",
        allowed="such that it moves the lightest mass by up to limits.travel in a sample, here 312.5 m",
        remedy='set limits.effort = "16 kN" or check the units of the masses',
    ),
]

ENTRIES = [*PARTS, *METHOD, *SENSORS, *PLANT]


@pytest.mark.parametrize("bad", params(parts=PARTS, method=METHOD, sensors=SENSORS, plant=PLANT))
def test_rule(bad, good_text, load_text):
    check_rule(bad, good_text, load_text)


def test_every_rule_is_broken_by_an_entry_above(good_text, load_text, monkeypatch):
    broken = broken_rules("cascade", ENTRIES, good_text, load_text, monkeypatch)
    assert broken == {rule.__name__ for rule in RULES}


def problem_of(load_text, text, *overrides):
    with pytest.raises(InputError) as caught:
        load_text(text, *overrides)
    (problem,) = caught.value.problems
    return problem


@pytest.mark.parametrize(
    ("overrides", "key", "allowed", "remedy"),
    [
        (
            ("mechanics.load_friction.negative.static=1 mN*m",),
            "mechanics.load_friction.negative.static",
            "at least the Coulomb friction, 60 mN*m",
            '"60 mN*m"',
        ),
        (
            ("mechanics.start_position=-400 deg",),
            "mechanics.start_position",
            "from -360 deg to 360 deg",
            '"-6.283185307179586 rad"',
        ),
        (("method.velocity_limit=10 deg/s",), "method.velocity_limit", "180 deg/s", '"180 deg/s"'),
        (("method.structure=pid",), "method.structure", "above 0", '"97 V/rad" to begin with'),
        (("motor.inductance=1 nH",), "motor.inductance", "1/100 ns or less, here 1/0.251 ns", '"399 nH"'),
        (("encoder.resolution=1e-20 deg",), "encoder.resolution", "0 rad, or at least", '"7.994e-14 deg"'),
    ],
)
def test_a_rotary_axis_is_told_in_its_units(load_text, rotary_text, overrides, key, allowed, remedy):
    problem = problem_of(load_text, rotary_text, *overrides)
    assert problem.key == key
    assert allowed in problem.allowed
    assert remedy in problem.remedy


def test_a_rigid_axis_needs_one_mass_only(load_text, short_text):
    load_text(short_text)
    load_text(short_text, "mechanics.motor_mass=1 g", "mechanics.load_mass=0 kg", "method.velocity_gain=1 V*s/m")
    problem = problem_of(load_text, short_text, "mechanics.load_mass=0 kg")
    assert problem.allowed == "such that all that moves comes to at least 1e-12 kg"
    assert problem.remedy == "state mechanics.load_mass"


def test_the_motor_counts_on_its_side_of_the_coupling(load_text, good_text):
    load_text(good_text, "mechanics.motor_mass=0 kg")


def test_what_is_needed_to_propose_a_gain_is_missing_as_well(load_text, good_text):
    text = good_text.replace(LEAD, "")
    with pytest.raises(InputError) as caught:
        load_text(text, "method.velocity_gain=0 V*s/m", "drive.command_step=5 V")
    assert [problem.key for problem in caught.value.problems] == ["drive.input", "method.velocity_gain"]
    assert caught.value.problems[1].remedy == "state velocity_gain in [method]"


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

    assert sample_ticks(0.1, rules.FASTEST) < 2**31
