"""Steps of a sequence: what each of them may say, and the loops written out."""

import math

import pytest

from detent.errors import DetentError
from detent.methods.rotary_table.sequence_job import (
    LONGEST_TIME,
    MOST_STEPS,
    Go,
    Jog,
    Output,
    Repeat,
    SequenceJob,
    Wait,
    find_loops,
    join_stretches,
    next_on,
)


@pytest.mark.parametrize(
    ("make", "got"),
    [
        (lambda: Go(-1), "go -1"),
        (lambda: Go(128), "go 128"),
        (lambda: Go(1, label="_x"), "label '_x'"),
        (lambda: Jog(0, duration=1.0), "jog 0"),
        (lambda: Jog(1), "jog without an end"),
        (lambda: Jog(1, signal="a", duration=1.0), "jog with while and for"),
        (lambda: Jog(1, speed=0.0, duration=1.0), "speed 0.0 rad/s"),
        (lambda: Jog(1, speed=math.inf, duration=1.0), "speed inf rad/s"),
        (lambda: Jog(1, speed=math.nan, duration=1.0), "speed nan rad/s"),
        (lambda: Jog(-1, duration=0.0), "for 0.0 s"),
        (lambda: Jog(-1, duration=2 * LONGEST_TIME), "for 200000.0 s"),
        (lambda: Jog(1, signal=""), "jog without an end"),
        (Wait, "a step that does nothing"),
        (lambda: Wait(1.0, "a"), "wait and wait_for"),
        (lambda: Wait(-0.1), "wait -0.1 s"),
        (lambda: Wait(math.nan), "wait nan s"),
        (lambda: Wait(signal="a b"), "wait_for 'a b'"),
        (lambda: Output("x" * 41, on=True), f"set '{'x' * 41}'"),
        (lambda: Repeat("a", 0), "times 0"),
        (lambda: Repeat("a", MOST_STEPS + 1), f"times {MOST_STEPS + 1}"),
        (lambda: Repeat("", 2), "a step that does nothing"),
    ],
)
def test_a_step_that_means_nothing_is_refused(make, got):
    with pytest.raises(DetentError, match=r"^step: got .+; expected: .+; try: .+") as caught:
        make()
    assert f"got {got};" in str(caught.value)


def test_a_refusal_names_the_line():
    with pytest.raises(DetentError, match=r"^step of line 12: got go 300"):
        Go(300, row=12)


def test_the_bounds_themselves_will_do():
    steps = [Go(0), Go(127), Wait(0.0), Wait(LONGEST_TIME), Jog(1, duration=LONGEST_TIME), Repeat("a", MOST_STEPS)]
    assert [type(step).__name__ for step in steps] == ["Go", "Go", "Wait", "Wait", "Jog", "Repeat"]
    assert Output("clamp.2:left-x_1", on=False).signal == "clamp.2:left-x_1"
    assert Wait(signal="é").level is True


# -- loops --------------------------------------------------------------------------------------------------


def indices(*steps):
    found = [index for index, _ in SequenceJob("", tuple(steps)).actions()]
    assert len(found) == SequenceJob("", tuple(steps)).count
    assert all(steps[index] is step for index, step in SequenceJob("", tuple(steps)).actions())
    return found


def test_steps_without_loops_are_done_once():
    assert indices(Go(1), Wait(1.0), Go(2)) == [0, 1, 2]


def test_a_loop_is_done_so_many_times_altogether():
    assert indices(Go(1), Go(2, label="a"), Wait(1.0), Repeat("a", 3), Go(3)) == [0, 1, 2, 1, 2, 1, 2, 4]
    assert indices(Go(1, label="a"), Repeat("a", 1), Go(2)) == [0, 2]


def test_loops_inside_one_another_begin_anew_each_time():
    steps = [Go(1, label="outer"), Go(2, label="inner"), Repeat("inner", 2), Wait(1.0), Repeat("outer", 3)]
    assert indices(*steps) == 3 * [0, 1, 1, 3]


def test_loops_may_begin_at_the_same_step():
    assert indices(Go(1, label="a"), Repeat("a", 2), Go(2), Repeat("a", 2)) == [0, 0, 2, 0, 0, 2]
    assert indices(Go(1, label="a"), Repeat("a", 2), Repeat("a", 3)) == [0] * 6


def test_loops_after_one_another():
    assert indices(Go(1, label="a"), Repeat("a", 2), Go(2, label="b"), Repeat("b", 2)) == [0, 0, 2, 2]


def test_the_number_of_steps_is_known_without_writing_them_out():
    deep = [Go(1, label="a"), *(Repeat("a", MOST_STEPS) for _ in range(6))]
    assert SequenceJob("", tuple(deep)).count == MOST_STEPS**6


def test_a_loop_begins_at_the_first_step_of_its_label_before_it():
    steps = [Repeat("a", 2), Go(1, label="a"), Go(2, label="a"), Repeat("a", 2)]
    assert find_loops(steps) == {3: 1}
    assert indices(*steps) == [1, 2, 1, 2]


def test_a_job_knows_its_count_and_its_outputs():
    steps = (Output("b", on=True, label="x"), Output("a", on=True), Output("b", on=False), Repeat("x", 2))
    job = SequenceJob("job", steps)
    assert (job.count, job.inputs) == (6, {})
    assert [index for index, _ in job.actions()] == [0, 1, 2, 0, 1, 2]


# -- stretches ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "joined"),
    [
        ([], ()),
        ([(3.0, 4.0), (1.0, 2.0)], ((1.0, 2.0), (3.0, 4.0))),
        ([(1.0, 3.0), (2.0, 4.0)], ((1.0, 4.0),)),
        ([(1.0, 9.0), (2.0, 3.0)], ((1.0, 9.0),)),
        ([(1.0, 2.0), (2.0, 3.0)], ((1.0, 3.0),)),
    ],
)
def test_stretches_that_meet_are_one(given, joined):
    assert join_stretches(given) == joined


@pytest.mark.parametrize(
    ("time", "found"),
    [(0.0, (1.0, 2.0)), (1.0, (1.0, 2.0)), (1.9, (1.0, 2.0)), (2.0, (5.0, 6.0)), (5.5, (5.0, 6.0)), (6.0, None)],
)
def test_a_stretch_is_over_at_its_end(time, found):
    assert next_on(((1.0, 2.0), (5.0, 6.0)), time) == found
