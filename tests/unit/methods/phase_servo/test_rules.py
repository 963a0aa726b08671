"""What does not go together in a phase-servo axis, and the nearest value that would do: tracker, approach and table.

Line numbers are those of the packaged example without its head comment: [axis] stands in line 1, [limits] in 5. Every
value that a remedy names is tried: it is accepted, and of its two neighbours one is not.
"""

import pytest
from tests.bad_files import edit, params
from tests.remedies import broken_rules, check_rule, given

from detent.errors import InputError
from detent.methods.phase_servo import rules, schema

SPEED = 'speed = "0.35 m/s"'

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


@pytest.mark.parametrize("bad", params(tracker=TRACKER, approach=APPROACH, table=TABLE))
def test_rule(bad, good_text, load_text):
    check_rule(bad, good_text, load_text)


def test_every_rule_is_broken_by_an_entry_above(good_text, load_text, monkeypatch):
    entries = [*TRACKER, *APPROACH, *TABLE]
    broken = broken_rules("phase_servo", entries, good_text, load_text, monkeypatch)
    assert broken >= {
        "_drive_word",
        "_one_shots",
        "_protection",
        "_speed_counted",
        "_speed_tracked",
        "_steps_per_pitch",
        "_sums",
        "_table_end",
        "_table_start",
        "_threshold",
    }


def test_a_wrong_key_gives_no_problem_of_the_rules_that_look_at_it(good_text, load_text):
    with pytest.raises(InputError) as caught:
        load_text(good_text, "method.threshold=0", "method.expected_spurious=900")
    (problem,) = caught.value.problems
    assert problem.key == "method.threshold"


def test_the_false_stop_needs_no_time_for_stop(good_text, load_text):
    load_text(good_text, "method.stop_time=1 ms", "method.stop_always_off=true")


def test_the_constants_are_those_of_the_blocks():
    from detent.control.phase_sequencer import TABLE as LENGTH
    from detent.methods.phase_servo import build

    assert schema.TABLE_ENTRIES == LENGTH
    assert rules.LONGEST_SUBSTEP == build.SUBSTEP
