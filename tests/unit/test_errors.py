"""The errors a person meets."""

import pickle

import pytest

from detent.errors import SB1_TEXT, AxisError, DetentError, FileProblem, InputError, describe_sb1

PROBLEM = FileProblem("axis.toml", 7, 1, "mechanics.travel", "12 V", 'a length such as "1 m"', "write a length")


def test_a_problem_is_one_line_that_an_editor_can_jump_from():
    assert str(PROBLEM) == (
        'axis.toml:7:1 mechanics.travel: got 12 V; expected: a length such as "1 m"; try: write a length'
    )


def test_a_problem_without_a_place_or_a_key_names_only_the_file():
    assert str(FileProblem("job.txt", 0, 0, "", "nothing", "a job", "name one")).startswith("job.txt: got nothing;")


def test_an_override_has_no_line():
    assert str(FileProblem("--set", 0, 0, "drive.supply", "3", "a voltage", "x")).startswith("--set drive.supply: ")


def test_problems_are_told_in_the_order_of_the_file_and_overrides_last():
    first = FileProblem("a", 3, 1, "k", "c", "a", "d")
    second = FileProblem("a", 3, 9, "k", "c", "a", "d")
    third = FileProblem("a", 12, 1, "k", "c", "a", "d")
    override = FileProblem("--set", 0, 0, "k", "c", "a", "d")
    error = InputError([override, third, second, first])
    assert error.problems == (first, second, third, override)
    assert str(error).splitlines() == [str(problem) for problem in error.problems]


def test_an_error_about_a_whole_file():
    error = InputError.of_file("job.txt", "no such file", "a job", "name one")
    assert str(error) == "job.txt: no such file; expected: a job; try: name one"


@pytest.mark.parametrize(("kind", "status"), [(DetentError, 2), (InputError, 2), (AxisError, 1)])
def test_exit_status(kind, status):
    assert kind.exit_status == status
    assert issubclass(kind, DetentError)


def test_an_input_error_crosses_a_process_boundary_whole():
    error = pickle.loads(pickle.dumps(InputError([PROBLEM])))  # noqa: S301 - our own bytes
    assert error.problems == (PROBLEM,)
    assert str(error) == str(PROBLEM)


def test_every_status_bit_says_what_happened_and_what_to_do():
    assert sorted(SB1_TEXT) == [0x01, 0x02, 0x04, 0x08, 0x10, 0x20]
    for bit, text in SB1_TEXT.items():
        assert ";" in text
        assert describe_sb1(bit) == text


def test_several_bits_are_told_together_and_unknown_ones_are_not_hidden():
    assert describe_sb1(0) == "done"
    assert describe_sb1(0x0C) == f"{SB1_TEXT[0x04]}; also: {SB1_TEXT[0x08]}"
    assert "0xC0" in describe_sb1(0xC1)
    assert SB1_TEXT[0x01] in describe_sb1(0xC1)
