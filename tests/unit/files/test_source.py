"""Reading the text of an axis file."""

import pytest

from detent.errors import InputError
from detent.files.source import MAX_BYTES, MAX_SYNTAX_PROBLEMS, parse_source, read_source


def refusal(path):
    with pytest.raises(InputError) as caught:
        read_source(path)
    (problem,) = caught.value.problems
    assert problem.remedy
    return problem


def test_no_such_file(tmp_path):
    problem = refusal(tmp_path / "none.toml")
    assert problem.got == "no such file"
    assert problem.file.endswith("none.toml")


def test_a_folder(tmp_path):
    assert "cannot be read" in refusal(tmp_path).got


def test_an_impossible_name():
    assert "no file can have" in refusal("a\x00b").got


def test_an_empty_file(tmp_path):
    (tmp_path / "a.toml").write_text(" \n\n")
    assert refusal(tmp_path / "a.toml").got == "an empty file"


def test_a_huge_file(tmp_path):
    (tmp_path / "a.toml").write_bytes(b"#" * (MAX_BYTES + 1))
    assert refusal(tmp_path / "a.toml").got == "more than 1000 kB"


def test_another_encoding_names_the_byte_and_its_line(tmp_path):
    (tmp_path / "a.toml").write_bytes(b'[axis]\nname = "K\xe4fer"\n')
    problem = refusal(tmp_path / "a.toml")
    assert (problem.line, problem.got) == (2, "the byte 0xE4")
    assert "UTF-8" in problem.remedy


def test_each_bad_line_is_told_and_the_rest_is_read():
    source = parse_source("a.toml", "a = 1\nb = 3 mm\nc = 2\nd = \n")
    assert source.tables == {"a": 1, "c": 2}
    assert [(problem.line, problem.key) for problem in source.problems] == [(2, "b"), (4, "d")]
    assert source.is_readable
    assert not source.is_whole


def test_after_a_bad_table_header_nothing_more_is_believed():
    source = parse_source("a.toml", "[a\nb = 1\n")
    assert not source.is_readable
    assert len(source.problems) == 1


def test_a_file_of_another_kind_does_not_fill_the_screen():
    source = parse_source("a.toml", "x = y z\n" * 1000)
    assert len(source.problems) == MAX_SYNTAX_PROBLEMS
    assert not source.is_readable


def test_a_good_file_has_no_problems(good_text):
    source = parse_source("a.toml", good_text)
    assert source.problems == ()
    assert source.is_whole
    assert source.is_readable


@pytest.mark.parametrize("end", ["\u2028", "\u2029", "\x85"])
def test_what_ends_a_line_for_python_alone_stays_in_its_comment(end):
    """A sign of Unicode that ends a line turned the rest of a comment into live keys."""
    source = parse_source("axis.toml", f'[axis]  # a note{end}name = "live"\r\nmethod = "cascade"\n')
    assert source.tables == {"axis": {"method": "cascade"}}
    assert source.places["axis", "method"].line == 2


def test_a_carriage_return_alone_ends_no_line():
    source = parse_source("axis.toml", "[axis]  # a note\rname = 'live'\n")
    assert source.tables == {}
    assert [problem.line for problem in source.problems] == [1]
