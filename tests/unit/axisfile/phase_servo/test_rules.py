"""What does not go together in a phase-servo axis, and the nearest value that would do.

Line numbers are those of the packaged example without its head comment: [axis] stands in line 1, [limits] in 5. Every
value that a remedy names is tried: it is accepted, and of its two neighbours one is not.
"""

from dataclasses import replace

import pytest
from tests.bad_files import Bad, added, edit, params
from tests.remedies import check_rule, is_refused

from detent.axisfile.methods import METHODS
from detent.axisfile.phase_servo import detector, rules, schema
from detent.axisfile.phase_servo.rules import RULES
from detent.errors import InputError

SPEED = 'speed = "0.35 m/s"'
TRAVEL = 'travel = "14 in"'
BURST = "disturbance.lines.burst"


def given(name, *overrides, key, came, allowed, remedy, others=0):
    return Bad(name, "--set", key, came, allowed, remedy, overrides=overrides, others=others)


TRACKER = [
    given(
        "steps",
        "detector.counts=60",
        key="detector.counts",
        came="60",
        allowed="a power of two",
        remedy="set detector.counts = 64",
    ),
    edit(
        "too fast",
        SPEED,
        'speed = "0.41 m/s"',
        "7:1",
        "limits.speed",
        '"0.41 m/s"',
        "below 407.1 mm/s: the tracker follows one step in N + 1 = 65 clocks",
        'set limits.speed = "407 mm/s" or raise clock.oscillator to "8.058 MHz"',
    ),
    given(
        "slow clock",
        "clock.oscillator=6 MHz",
        key="clock.oscillator",
        came="6 MHz",
        allowed='limits.speed ("0.35 m/s") below 305.3 mm/s',
        remedy='set limits.speed = "305.2 mm/s" or raise clock.oscillator to "6.879 MHz"',
    ),
    edit(
        "no pulse in a sample",
        SPEED,
        'speed = "10 mm/s"',
        "7:1",
        "limits.speed",
        '"10 mm/s"',
        "at least one pulse per speed sample, 12.92 mm/s",
        'set limits.speed = "12.92 mm/s" or set clock.sample_tap = 13',
    ),
    given(
        "coarse detector",
        "detector.pitches_per_revolution=1",
        "detector.counts=16",
        "method.threshold=3",
        "method.expected_spurious=3",
        "clock.sample_tap=4",
        "clock.oscillator=100 MHz",
        key="clock.sample_tap",
        came="4",
        allowed='limits.speed ("0.35 m/s") at least one pulse per speed sample, 1.984e+04 m/s',
        remedy="set clock.sample_tap = 20",
    ),
    given(
        "detector of no use",
        "detector.pitches_per_revolution=1",
        "clock.sample_tap=4",
        "limits.speed=0.1 um/s",
        key="limits.speed",
        came="0.1 um/s",
        allowed="at least one pulse per speed sample, 396.9 m/s",
        remedy="use a finer detector",
    ),
    given(
        "speed word",
        "method.speed_bits=5",
        key="method.speed_bits",
        came="5",
        allowed="the peak of the velocity table, 27 pulses per sample: 5 bits hold 15",
        remedy='set method.speed_bits = 6 or set limits.speed = "206.7 mm/s"',
    ),
    given(
        "long sample",
        "clock.sample_tap=24",
        "clock.oscillator=100 MHz",
        "method.table_acceleration=9999 m/s^2",
        "method.speed_bits=13",
        key="method.speed_bits",
        came="13",
        allowed="8877 pulses per sample: 13 bits hold 4095",
        remedy='set method.speed_bits = 15 or set limits.speed = "161.4 mm/s"',
    ),
    given(
        "beyond any speed word",
        "clock.sample_tap=24",
        "method.table_acceleration=9999 m/s^2",
        key="clock.sample_tap",
        came="24",
        allowed="method.speed_bits (its default) wide enough",
        remedy='set limits.speed = "403.7 um/s"',
    ),
]

APPROACH = [
    given(
        "threshold",
        "method.threshold=16",
        "method.expected_spurious=2",
        key="method.threshold",
        came="16",
        allowed="below N/4 = 16, where the absolute word folds back",
        remedy="set method.threshold = 15",
    ),
    given(
        "threshold beyond the pitch",
        "method.threshold=40",
        "method.expected_spurious=0",
        key="method.threshold",
        came="40",
        allowed="below N/4 = 16",
        remedy="set method.threshold = 15",
    ),
    given(
        "protection",
        "method.expected_spurious=24",
        key="method.expected_spurious",
        came="24",
        allowed="below N/2 - threshold = 24: with 8 + 24 steps to go, N/2 = 32 or more, the absolute word leads to the",
        remedy="set method.expected_spurious = 23 or set method.threshold = 7",
    ),
    given(
        "no protection",
        "method.expected_spurious=500",
        key="method.expected_spurious",
        came="500",
        allowed="below N/2 - threshold = 24",
        remedy="set method.expected_spurious = 23",
    ),
    given(
        "coarse steps",
        "detector.counts=16",
        "method.threshold=3",
        key="method.threshold",
        came="3",
        allowed="method.expected_spurious (its default) below N/2 - threshold = 5",
        remedy="set method.expected_spurious = 4",
    ),
    given(
        "drive word",
        "method.position_gains=[8, 16, 1]",
        key="method.position_gains",
        came="[8, 16, 1]",
        allowed="KP1 x KP3 x (N/4 + 1) = 136 fits the drive word of 8 bits, 127",
        remedy="set method.position_gains = [7, 16, 1] or set drive.pwm_bits = 9",
    ),
    given(
        "narrow drive word",
        "drive.pwm_bits=4",
        key="drive.pwm_bits",
        came="4",
        allowed="method.position_gains (its default) such that KP1 x KP3 x (N/4 + 1) = 68",
        remedy="set drive.pwm_bits = 8",
    ),
    given(
        "no drive word",
        "method.position_gains=[4, 16, 999]",
        key="method.position_gains",
        came="[4, 16, 999]",
        allowed="= 67932",
        remedy="lower KP1, KP3 or detector.counts",
    ),
    given(
        "sums",
        "method.speed_gains=[1000, 1000, 1000]",
        "method.speed_bits=16",
        key="method.speed_gains",
        came="[1000, 1000, 1000]",
        allowed="the largest sum of the arithmetic unit, here 3.28e+10, fits 32 bits",
        remedy="set method.speed_gains = [1000, 1000, 65]",
    ),
    given(
        "sums of the incremental servo",
        "method.position_gains=[7, 1000, 1]",
        "method.final=incremental",
        "method.speed_bits=16",
        "method.integral_limit=32767",
        "method.position_gains=[100, 16, 400]",
        "drive.pwm_bits=12",
        key="method.position_gains",
        came="[100, 16, 400]",
        allowed="= 680000 fits",
        remedy="",
        others=1,
    ),
]

TABLE = [
    given(
        "table too long",
        "method.table_acceleration=2 m/s^2",
        key="method.table_acceleration",
        came="2 m/s^2",
        allowed="the peak of 27 pulses per sample within the 4096 entries of the velocity table, which ends at 25",
        remedy='set method.table_acceleration = "2.164 m/s^2" or set limits.speed = "335.8 mm/s"',
    ),
    given(
        "table of a fast clock",
        "clock.oscillator=100 MHz",
        "clock.sample_tap=16",
        "method.speed_bits=12",
        "limits.speed=5 m/s",
        key="limits.speed",
        came="5 m/s",
        allowed="method.table_acceleration (its default) large enough for the peak of 495",
        remedy='set method.table_acceleration = "459.9 m/s^2" or set limits.speed = "746.8 mm/s"',
    ),
    given(
        "table without a beginning",
        "method.table_acceleration=0.1 m/s^2",
        "limits.speed=0.05 m/s",
        key="method.table_acceleration",
        came="0.1 m/s^2",
        allowed="one pulse per sample 9 steps before the end: the carriage would stop before it reaches",
        remedy='set method.table_acceleration = "350.5 mm/s^2"',
    ),
    given(
        "one-shots",
        "method.stop_time=3 ms",
        key="method.stop_time",
        came="3 ms",
        allowed="longer than method.ready_time, 3 ms: ready comes first",
        remedy='set method.stop_time = "3.001 ms"',
    ),
    given(
        "late ready",
        "method.ready_time=1 s",
        key="method.ready_time",
        came="1 s",
        allowed="method.stop_time (its default) longer than method.ready_time, 1 s",
        remedy='set method.stop_time = "1.001 s"',
    ),
]

MACHINE = [
    edit(
        "long way",
        TRAVEL,
        'travel = "0.5 m"',
        "6:1",
        "limits.travel",
        '"0.5 m"',
        "up to 65535 steps, 433.5 mm: the command counter has 16 bits",
        'set limits.travel = "433.4 mm" or use a coarser detector',
    ),
    given(
        "fine detector",
        "detector.pitches_per_revolution=150",
        "limits.speed=0.3 m/s",
        key="detector.pitches_per_revolution",
        came="150",
        allowed='limits.travel ("14 in") up to 65535 steps, 346.8 mm',
        remedy='set limits.travel = "346.7 mm"',
    ),
    edit(
        "short way",
        TRAVEL,
        'travel = "0.4 mm"',
        "6:1",
        "limits.travel",
        '"0.4 mm"',
        "at least a pitch of the detector, 423.3 um: the axis stops at whole pitches",
        'set limits.travel = "423.4 um" or use a finer detector',
        overrides=("mechanics.start_position=0 m",),
    ),
    edit(
        "start",
        'start_position = "0.1 in"',
        'start_position = "15 in"',
        "24:1",
        "mechanics.start_position",
        '"15 in"',
        "up to limits.travel, 355.6 mm",
        'set mechanics.start_position = "355.6 mm" or correct limits.travel',
    ),
    added(
        "left margin",
        '[print]\nleft_margin = "400 mm"',
        "54:1",
        "print.left_margin",
        '"400 mm"',
        "up to limits.travel, 355.6 mm",
        'set print.left_margin = "355.6 mm"',
    ),
    added(
        "character pitch",
        '[print]\ncharacter_pitch = "2.5 mm"',
        "54:1",
        "print.character_pitch",
        '"2.5 mm"',
        "a whole number of pitches of the detector, 423.3 um: the axis stops there only; here 5.9055",
        'set print.character_pitch = "2.54 mm"',
    ),
    added(
        "small characters",
        '[print]\ncharacter_pitch = "0.1 mm"',
        "54:1",
        "print.character_pitch",
        '"0.1 mm"',
        "a whole number of pitches",
        'set print.character_pitch = "423.333333333 um"',
    ),
    given(
        "another pulley",
        "mechanics.pulley_circumference=50 mm",
        "print.character_pitch=2.54 mm",
        key="print.character_pitch",
        came="2.54 mm",
        allowed="a whole number of pitches of the detector, 416.7 um",
        remedy='set print.character_pitch = "2.5 mm"',
    ),
    given(
        "winding",
        "motor.inductance=1 uH",
        key="motor.inductance",
        came="1 uH",
        allowed="such that the rates of the machine add up to 1/1 us or less, here R / L",
        remedy='set motor.inductance = "2.009 uH" or lower motor.resistance',
    ),
    given(
        "viscous",
        "mechanics.friction.right.viscous=1e5 N*s/m",
        "mechanics.carriage_mass=0.01 kg",
        "clock.oscillator=100 kHz",
        "clock.sample_tap=8",
        "limits.speed=5 mm/s",
        "mechanics.pulley_inertia=0 kg*m^2",
        "motor.rotor_inertia=0.001 g*cm^2",
        key="mechanics.friction.right.viscous",
        came="1e5 N*s/m",
        allowed="add up to 1/40 us or less, here viscous over mass",
        remedy='set mechanics.friction.right.viscous = "',
    ),
    edit(
        "stiction",
        'static = "1.2 N"',
        'static = "0.9 N"',
        "28:1",
        "mechanics.friction.right.static",
        '"0.9 N"',
        "at least the Coulomb friction, 1 N",
        'set mechanics.friction.right.static = "1 N" or leave it out',
    ),
]

DETECTOR = [
    given(
        "lag",
        "detector.lag_counts=64",
        key="detector.lag_counts",
        came="64",
        allowed="below detector.counts, 64",
        remedy="set detector.lag_counts = 63 or leave it out: it is then N/4 - 1 = 15",
    ),
    given(
        "jitter",
        "detector.jitter=1.1 us",
        key="detector.jitter",
        came="1.1 us",
        allowed="up to 1.067 us: its peak of 3 times that and the offset displace an edge by at most 0.2 turn",
        remedy='set detector.jitter = "1.066 us"',
    ),
    given(
        "jitter with an offset",
        "detector.jitter=1 us",
        "detector.offset_error=30 %",
        key="detector.jitter",
        came="1 us",
        allowed="up to 808 ns",
        remedy='set detector.jitter = "808 ns"',
    ),
    given(
        "offset of a weak winding",
        "detector.offset_error=-44 %",
        "detector.gain_error=-50 %",
        "detector.quadrature_error=30 deg",
        key="detector.offset_error",
        came="-44 %",
        allowed="an edge is displaced by at most 0.2 turn, here 0.",
        remedy='set detector.offset_error = "-',
    ),
]

LINES = [
    added(
        "burst without a moment",
        f'[{BURST}]\nkind = "+"',
        "53:1",
        f"{BURST}.at",
        "the default",
        "the first moment, or ticks in its place",
        'add at = "5 ms", or ticks',
    ),
    added(
        "burst of both kinds",
        f'[{BURST}]\nkind = "+"\nat = "5 ms"\nticks = [20000]',
        "55:1",
        f"{BURST}.at",
        '"5 ms"',
        "left out where ticks are listed, 1 of them here",
        "remove at, or remove ticks",
    ),
    added(
        "count beside ticks",
        f'[{BURST}]\nkind = "+"\ncount = 3\nticks = [20000]',
        "55:1",
        f"{BURST}.count",
        "3",
        "left out where ticks are listed",
        "remove count",
    ),
    added(
        "falling ticks",
        f'[{BURST}]\nkind = "-"\nticks = [20000, 10000, 10000]',
        "55:1",
        f"{BURST}.ticks",
        "[20000, 10000, 10000]",
        "whole numbers that rise, each once",
        f"set {BURST}.ticks = [10000, 20000]",
    ),
    added(
        "negative ticks",
        f'[{BURST}]\nkind = "-"\nticks = [-1, 5]',
        "55:1",
        f"{BURST}.ticks",
        "-1 as element 1",
        "up to 64 whole numbers from 0, rising",
        "every number of ticks",
    ),
    added(
        "many ticks",
        f'[{BURST}]\nkind = "-"\nticks = {list(range(65))}',
        "55:1",
        f"{BURST}.ticks",
        "65 numbers",
        "up to 64 whole numbers",
        "so many numbers",
    ),
    added(
        "close burst",
        f'[{BURST}]\nkind = "+"\nat = "5 ms"\ncount = 8\nspacing = "0.2 us"',
        "57:1",
        f"{BURST}.spacing",
        '"0.2 us"',
        "at least one base tick, 250 ns: a line carries one pulse at a time",
        f'set {BURST}.spacing = "250 ns" or set {BURST}.count = 1',
    ),
]


ENTRIES = [*TRACKER, *APPROACH, *TABLE, *MACHINE, *DETECTOR, *LINES]


@pytest.mark.parametrize(
    "bad", params(tracker=TRACKER, approach=APPROACH, table=TABLE, machine=MACHINE, detector=DETECTOR, lines=LINES)
)
def test_rule(bad, good_text, load_text):
    check_rule(bad, good_text, load_text)


def test_a_wrong_key_gives_no_problem_of_the_rules_that_look_at_it(good_text, load_text):
    with pytest.raises(InputError) as caught:
        load_text(good_text, "method.threshold=0", "method.expected_spurious=900")
    (problem,) = caught.value.problems
    assert problem.key == "method.threshold"


def test_a_burst_of_one_pulse_has_no_spacing(good_text, load_text):
    load_text(good_text + f'\n[{BURST}]\nkind = "+"\nat = "5 ms"\nspacing = "0 s"\n')


def test_the_false_stop_needs_no_time_for_stop(good_text, load_text):
    load_text(good_text, "method.stop_time=1 ms", "method.stop_always_off=true")


def test_every_rule_is_broken_by_an_entry_above(good_text, load_text, monkeypatch):
    broken = set()

    def noting(rule):
        def run(spec):
            for contradiction in rule(spec):
                broken.add(rule)
                yield contradiction

        return run

    watched = replace(METHODS["phase_servo"], rules=tuple(noting(rule) for rule in RULES))
    monkeypatch.setitem(METHODS, "phase_servo", watched)
    for bad in ENTRIES:
        is_refused(load_text, bad.make(good_text), bad.overrides)
    assert broken == set(RULES)


def test_the_constants_are_those_of_the_blocks():
    from detent.axisfile.phase_servo import build
    from detent.control.phase_sequencer import TABLE as LENGTH
    from detent.kernel.noise import NoiseSource, bell
    from detent.sensing.phase_detector import JITTER_LIMIT

    assert schema.TABLE_ENTRIES == LENGTH
    assert rules.LONGEST_SUBSTEP == build.SUBSTEP
    assert detector.EDGE_LIMIT == JITTER_LIMIT
    source = NoiseSource(state=1)
    assert max(abs(bell(source)) for _ in range(2000)) <= detector.JITTER_PEAK
