"""What does not go together in a phase-servo axis, and the nearest value that would do: tracker, approach and table.

Line numbers are those of the packaged example without its head comment: [axis] stands in line 1, [limits] in 5.
"""

import pytest
from tests.bad_files import edit, given, params
from tests.remedies import broken_rules, check_rule

from detent.errors import InputError
from detent.methods.phase_servo import checks, schema

SPEED = 'speed = "0.35 m/s"'

TRACKER = [
    given("steps", "detector.counts=60", key="detector.counts"),
    edit("too fast", SPEED, 'speed = "0.41 m/s"', "7:1", "limits.speed"),
    given("slow clock", "clock.oscillator=6 MHz", key="clock.oscillator"),
    edit("no pulse in a sample", SPEED, 'speed = "10 mm/s"', "7:1", "limits.speed"),
    given(
        "coarse detector",
        "detector.pitches_per_revolution=1",
        "detector.counts=16",
        "method.threshold=3",
        "method.expected_spurious=3",
        "clock.sample_tap=4",
        "clock.oscillator=100 MHz",
        key="clock.sample_tap",
    ),
    given(
        "detector of no use",
        "detector.pitches_per_revolution=1",
        "clock.sample_tap=4",
        "limits.speed=0.1 um/s",
        key="limits.speed",
    ),
    given("speed word", "method.speed_bits=5", key="method.speed_bits"),
    given("reference between two points", "home.position=10 mm", key="home.position"),
    given(
        "long sample",
        "clock.sample_tap=24",
        "clock.oscillator=100 MHz",
        "method.table_acceleration=9999 m/s^2",
        "method.speed_bits=13",
        key="method.speed_bits",
    ),
    given(
        "beyond any speed word", "clock.sample_tap=24", "method.table_acceleration=9999 m/s^2", key="clock.sample_tap"
    ),
]

APPROACH = [
    given("threshold", "method.threshold=16", "method.expected_spurious=2", key="method.threshold"),
    given("threshold beyond the pitch", "method.threshold=40", "method.expected_spurious=0", key="method.threshold"),
    given("protection", "method.expected_spurious=24", key="method.expected_spurious"),
    given("no protection", "method.expected_spurious=500", key="method.expected_spurious"),
    given("coarse steps", "detector.counts=16", "method.threshold=3", key="method.threshold"),
    given("drive word", "method.position_gains=[8, 16, 1]", key="method.position_gains"),
    given("narrow drive word", "drive.pwm_bits=4", key="drive.pwm_bits"),
    given("no drive word", "method.position_gains=[4, 16, 999]", key="method.position_gains"),
    given("sums", "method.speed_gains=[1000, 1000, 1000]", "method.speed_bits=16", key="method.speed_gains"),
    given(
        "sums of the incremental servo",
        "method.position_gains=[7, 1000, 1]",
        "method.final=incremental",
        "method.speed_bits=16",
        "method.integral_limit=32767",
        "method.position_gains=[100, 16, 400]",
        "drive.pwm_bits=12",
        key="method.position_gains",
        others=1,
    ),
]

TABLE = [
    given("table too long", "method.table_acceleration=2 m/s^2", key="method.table_acceleration"),
    given(
        "table of a fast clock",
        "clock.oscillator=100 MHz",
        "clock.sample_tap=16",
        "method.speed_bits=12",
        "limits.speed=5 m/s",
        key="limits.speed",
    ),
    given(
        "table without a beginning",
        "method.table_acceleration=0.1 m/s^2",
        "limits.speed=0.05 m/s",
        key="method.table_acceleration",
    ),
    given("one-shots", "method.stop_time=3 ms", key="method.stop_time"),
    given("late ready", "method.ready_time=1 s", key="method.ready_time"),
]


@pytest.mark.parametrize("bad", params(tracker=TRACKER, approach=APPROACH, table=TABLE))
def test_rule(bad, good_text, load_text, golden):
    check_rule(bad, good_text, load_text, golden)


def test_every_rule_is_broken_by_an_entry_above(good_text, load_text, monkeypatch):
    entries = [*TRACKER, *APPROACH, *TABLE]
    broken = broken_rules("phase_servo", entries, good_text, load_text, monkeypatch)
    assert broken >= {"_approach", "_speed_counted", "_table", "_tracker", "_words"}


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
    assert checks.LONGEST_SUBSTEP == build.SUBSTEP
