"""Jobs of servo axes: what a move may be, repeats written out, and text as moves of a carriage."""

import dataclasses
import math

import pytest

from detent.errors import MOST_PROBLEMS, DetentError, InputError
from detent.methods.moves.job import MOST_MOVES, Move, MoveJob, expand_moves, text_job

PITCH = 0.00254


def strikes(text, **options):
    job = text_job(text, name="job.txt", pitch=PITCH, **options)
    return [(move.label, round(move.target / PITCH), move.row) for move in job.moves]


def refusal(text):
    with pytest.raises(InputError) as caught:
        text_job(text, name="some/job.txt", pitch=PITCH)
    assert caught.value.exit_status == 2
    assert all(problem.file == "some/job.txt" and problem.remedy for problem in caught.value.problems)
    return caught.value.problems


# -- moves --------------------------------------------------------------------------------------------------


def test_a_move_says_where_or_how_far_and_leaves_the_rest_to_the_axis():
    move = Move(number=1, row=2, target=0.1)
    assert (move.by, move.dwell, move.speed, move.sample_period, move.label) == (None, 0.0, None, None, "")
    assert Move(number=1, row=2, by=-0.1).target is None
    with pytest.raises(dataclasses.FrozenInstanceError):
        move.dwell = 1.0


@pytest.mark.parametrize(
    ("values", "got", "allowed"),
    [
        ({}, "neither target nor by", "exactly one"),
        ({"target": 0.1, "by": 0.2}, "target and by", "exactly one"),
        ({"target": math.nan}, "target nan m", "a length"),
        ({"by": math.inf}, "by inf m", "a length"),
        ({"by": 0.1, "dwell": -0.5}, "dwell -0.5 s", "a time from 0 s"),
        ({"by": 0.1, "dwell": math.inf}, "dwell inf s", "a time from 0 s"),
        ({"by": 0.1, "speed": 0.0}, "speed 0.0 m/s", "a velocity above 0 m/s"),
        ({"by": 0.1, "speed": math.nan}, "speed nan m/s", "a velocity above 0 m/s"),
        ({"by": 0.1, "sample_period": -1e-3}, "sample_period -0.001 s", "a time above 0 s"),
    ],
)
def test_no_move_is_what_no_axis_can_do(values, got, allowed):
    with pytest.raises(DetentError, match="move 7: got ") as caught:
        Move(number=7, row=1, **values)
    assert f"got {got}; expected: {allowed}" in str(caught.value)


# -- repeats ------------------------------------------------------------------------------------------------


def test_repeats_are_written_out_and_numbered():
    there, step = Move(1, 2, target=0.1, dwell=0.5), Move(1, 3, by=0.001)
    moves = expand_moves("job.toml", [(there, 1), (step, 2)], repeat=2)
    assert [move.number for move in moves] == [1, 2, 3, 4, 5, 6]
    assert [move.row for move in moves] == [2, 3, 3, 2, 3, 3]
    assert [(move.target, move.by, move.dwell) for move in moves] == 2 * [
        (0.1, None, 0.5),
        (None, 0.001, 0.0),
        (None, 0.001, 0.0),
    ]
    assert MoveJob("job.toml", "moves", moves).count == 6


def test_a_job_has_a_limit_and_may_reach_it():
    step = Move(1, 1, by=0.001)
    assert expand_moves("job.toml", [(step, MOST_MOVES // 2)], repeat=2)[-1].number == MOST_MOVES
    with pytest.raises(InputError) as caught:
        expand_moves("job.toml", [(step, MOST_MOVES), (step, 1)])
    (problem,) = caught.value.problems
    assert (problem.file, problem.got) == ("job.toml", f"{MOST_MOVES + 1} moves, repeats counted")
    assert problem.allowed == f"up to {MOST_MOVES} moves"


# -- text ---------------------------------------------------------------------------------------------------


def test_each_character_is_a_move_to_its_column_and_a_hammer_blow():
    job = text_job("ab c\nd\n", name="letters/short.txt", pitch=PITCH, left_margin=0.0127, hammer_time=0.008)
    assert (job.name, job.kind, job.count) == ("short.txt", "text", 4)
    assert [move.number for move in job.moves] == [1, 2, 3, 4]
    assert [move.label for move in job.moves] == ["a", "b", "c", "d"]
    assert [move.target for move in job.moves] == [0.0127 + column * PITCH for column in (0, 1, 3, 0)]
    assert {(move.dwell, move.by, move.speed, move.sample_period) for move in job.moves} == {(0.008, None, None, None)}


def test_every_line_end_takes_the_carriage_back():
    assert strikes("ab\ncd") == strikes("ab\r\ncd") == strikes("ab\rcd")
    assert strikes("ab\ncd") == [("a", 0, 1), ("b", 1, 1), ("c", 0, 2), ("d", 1, 2)]
    assert strikes("ab\fcd") == [("a", 0, 1), ("b", 1, 1), ("c", 0, 1), ("d", 1, 1)]
    assert strikes("\n\r\n\n  a") == [("a", 2, 4)]


def test_tabs_go_to_every_eighth_column():
    assert strikes("\ta\tb") == [("a", 8, 1), ("b", 16, 1)]
    assert strikes("1234567\tx")[-1] == strikes("\tx")[-1] == ("x", 8, 1)
    assert strikes("12345678\tx")[-1] == ("x", 16, 1)


def test_a_blank_of_any_kind_is_no_move():
    assert strikes("a\N{NO-BREAK SPACE}b   c  ") == [("a", 0, 1), ("b", 2, 1), ("c", 6, 1)]


def test_an_accent_is_struck_with_its_letter():
    assert strikes("e\N{COMBINING ACUTE ACCENT}\N{COMBINING CEDILLA}x") == [("e\u0301\u0327", 0, 1), ("x", 1, 1)]


@pytest.mark.parametrize("before", ["", " ", "a ", "a\n", "a\t"])
def test_an_accent_without_a_letter_is_refused(before):
    (problem,) = refusal(f"{before}\N{COMBINING ACUTE ACCENT}b")
    assert "U+0301" in problem.got


def test_a_text_of_cp_m_ends_in_sub():
    assert strikes("ab\n\x1a\x1a\x1a") == strikes("ab\n")
    assert [problem.got for problem in refusal("a\x1ab")] == ["the character 0x1A, which is not printable by itself"]


def test_every_character_that_cannot_be_printed_is_named_with_its_place():
    problems = refusal("a\x1bb\r\n\tc\x07\n\N{ZERO WIDTH SPACE}d\x85")
    places = [(problem.line, problem.column, problem.got.split()[2].rstrip(",")) for problem in problems]
    assert places == [(1, 2, "0x1B"), (2, 3, "0x07"), (3, 1, "U+200B"), (3, 3, "0x85")]
    assert all("printable characters" in problem.allowed for problem in problems)


def test_rubbish_is_not_reported_for_ever():
    assert len(refusal("\x01" * 1000)) == MOST_PROBLEMS


@pytest.mark.parametrize(
    ("text", "got"), [("", "an empty file"), (" \n\t\f\r\n", "a text without printable characters")]
)
def test_a_text_that_prints_nothing_is_refused(text, got):
    (problem,) = refusal(text)
    assert (problem.line, problem.got) == (0, got)


def test_a_text_may_be_as_long_as_a_job_and_no_longer():
    assert text_job("x" * MOST_MOVES, name="job.txt", pitch=PITCH).count == MOST_MOVES
    (problem,) = refusal("x" * (MOST_MOVES + 1))
    assert problem.got == f"more than {MOST_MOVES} characters to print"
