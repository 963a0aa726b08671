"""Steps among one another: loops, signals, and what would wait for ever."""

from types import SimpleNamespace

import pytest

from detent.methods.rotary_table.sequence_file import LONGEST_JOB, find_faults
from detent.methods.rotary_table.sequence_job import (
    LONGEST_TIME,
    MOST_STEPS,
    Go,
    Jog,
    Output,
    Repeat,
    SequenceJob,
    Wait,
)

FEED = {"feed": ((1.0, 2.0), (5.0, 6.0))}


def only(steps, inputs=None):
    ((index, fault),) = find_faults(SequenceJob("job", tuple(steps), inputs or {}))
    assert fault.allowed
    assert fault.remedy
    return SimpleNamespace(index=index, key=fault.key, came=fault.came, allowed=fault.allowed)


@pytest.mark.parametrize(
    "steps",
    [
        [Go(1)],
        [Go(1, label="a"), Go(2, label="b"), Repeat("b", 2), Repeat("a", 2)],
        [Go(1, label="a"), Repeat("a", 2), Repeat("a", 2), Go(2, label="b"), Repeat("b", 2)],
        [Wait(signal="feed"), Jog(1, signal="feed"), Output("clamp", on=True)],
        [
            Wait(signal="feed", level=False),
            Wait(5.5),
            Wait(signal="feed", level=False),
            Wait(signal="feed", level=False),
        ],
    ],
)
def test_steps_that_go_together(steps):
    assert find_faults(SequenceJob("job", tuple(steps), FEED)) == []


def test_a_label_given_twice():
    fault = only([Go(1, label="a"), Go(2), Go(3, label="a")])
    assert (fault.index, fault.key, fault.came) == (2, "label", 'the label "a" again')


def test_a_loop_to_nowhere():
    fault = only([Go(1), Repeat("a", 2)])
    assert (fault.index, fault.key, fault.came) == (1, "repeat", 'the label "a", which no step before has')
    assert "none of them has one" in fault.allowed
    later = only([Go(1, label="b"), Repeat("a", 2), Go(2, label="a")])
    assert (later.index, later.allowed) == (1, 'the label of an earlier step: "b"')


def test_loops_that_cross():
    fault = only([Go(1, label="a"), Go(2, label="b"), Repeat("a", 2), Go(3), Repeat("b", 2)])
    assert (fault.index, fault.key) == (4, "repeat")
    assert "begins inside an earlier loop and ends outside it" in fault.came


def test_more_steps_than_a_job_may_have():
    assert find_faults(SequenceJob("job", (Wait(0.0, label="a"), Repeat("a", MOST_STEPS)), {})) == []
    fault = only([Wait(0.0, label="a"), Wait(0.0), Repeat("a", 2), Repeat("a", MOST_STEPS)])
    assert (fault.index, fault.key, fault.came) == (3, "times", f"{4 * MOST_STEPS} steps, repeats counted")


@pytest.mark.parametrize(("step", "key"), [(Jog(1, signal="fed"), "while"), (Wait(signal="fed"), "wait_for")])
def test_an_input_that_the_job_does_not_have(step, key):
    fault = only([Go(1), step], FEED)
    assert (fault.index, fault.key, fault.came) == (1, key, 'the unknown input "fed"')
    assert fault.allowed == 'an input of this job: "feed"'
    assert "the job has none" in only([step]).allowed


@pytest.mark.parametrize(("on", "key"), [(True, "set"), (False, "clear")])
def test_an_output_that_comes_from_outside(on, key):
    fault = only([Output("feed", on=on)], FEED)
    assert (fault.index, fault.key, fault.came) == (0, key, 'the input "feed"')


@pytest.mark.parametrize(
    ("steps", "index", "key", "begins"),
    [
        ([Wait(6.0), Jog(1, signal="feed")], 1, "while", 6),
        ([Wait(7.0), Wait(signal="feed")], 1, "wait_for", 7),
        ([Jog(1, signal="feed"), Jog(1, signal="feed"), Jog(1, signal="feed")], 2, "while", 6),
        ([Jog(1, signal="feed", label="a"), Repeat("a", 3)], 0, "while", 6),
        ([Wait(signal="feed", level=False), Wait(signal="feed"), Wait(5.5), Wait(signal="feed")], 3, "wait_for", 6.5),
        ([Jog(-1, duration=6.5), Wait(signal="feed")], 1, "wait_for", 6.5),
    ],
)  # fmt: skip
def test_a_signal_that_cannot_come_any_more(steps, index, key, begins):
    fault = only(steps, FEED)
    assert (fault.index, fault.key) == (index, key)
    assert fault.came == f'"feed", which is off for good from 6 s on; the step begins at {begins:g} s or later'


def test_a_signal_may_be_on_already_when_a_step_begins():
    assert find_faults(SequenceJob("job", (Wait(5.9), Jog(1, signal="feed")), FEED)) == []
    assert find_faults(SequenceJob("job", (Wait(5.9), Wait(signal="feed"), Wait(signal="feed")), FEED)) == []


def test_a_job_of_many_days():
    assert find_faults(SequenceJob("job", (Wait(LONGEST_TIME, label="a"), Repeat("a", 10)), {})) == []
    fault = only([Wait(LONGEST_TIME, label="a"), Go(1), Repeat("a", 11)])
    assert (fault.index, fault.came) == (0, f"a sequence of more than {LONGEST_JOB:g} s")


def test_times_are_looked_at_only_where_the_rest_is_right():
    steps = [Wait(9.0), Wait(signal="feed"), Repeat("a", 2)]
    assert [fault.key for _, fault in find_faults(SequenceJob("job", tuple(steps), FEED))] == ["repeat"]
