"""Reading jobs: what a file is, where plain text stands, and what is refused."""

from dataclasses import astuple
from importlib.resources import files
from itertools import pairwise
from pathlib import Path

import pytest
from tests.places import DATA
from tools.make_brochure import brochure

from detent.errors import InputError
from detent.files.text import MAX_BYTES
from detent.methods.print_head.print_job import load_job, parse_text

EXAMPLES = files("detent") / "examples"
WORDSTAR = DATA / "workloads/daisywheel_diablo630/wsprint.prn"


def places(job, line=0):
    return [(c.char, c.column) for c in job.lines[line].characters]


def refusal(path):
    with pytest.raises(InputError) as caught:
        load_job(path)
    assert caught.value.exit_status == 2
    (problem,) = caught.value.problems
    assert problem.file in (str(path), repr(str(path)))
    assert problem.allowed
    assert problem.remedy
    return problem


# -- plain text ---------------------------------------------------------------------------------------------


def test_text_stands_at_ten_characters_and_six_lines_per_inch():
    job = parse_text("ab\n\ncd\n")
    assert [(line.number, line.baseline, line.page) for line in job.lines] == [(1, 0, 1), (2, 16, 1)]
    assert places(job) == [("a", 0), ("b", 12)]
    assert (job.lines[1].first_column, job.lines[1].last_column) == (0, 24)
    assert (job.kind, job.pages, job.length_bytes, job.characters) == ("text", 1, 7, 4)


def test_blanks_at_the_ends_of_a_line_are_no_ink():
    (line,) = parse_text("     word      \n").lines
    assert (line.first_column, line.last_column) == (60, 108)


def test_tabs_go_to_every_eighth_character():
    assert places(parse_text("\ta\tb\tc")) == [("a", 96), ("b", 192), ("c", 288)]
    assert places(parse_text("1234567\tx"))[-1] == ("x", 96)
    assert places(parse_text("12345678\tx"))[-1] == ("x", 192)


def test_form_feed_begins_the_next_page():
    job = parse_text("one\n\ftwo\n")
    assert [(line.page, line.baseline) for line in job.lines] == [(1, 0), (2, 528)]
    assert job.pages == 2


def test_a_page_has_66_lines():
    job = parse_text("x\n" * 67)
    assert [line.page for line in job.lines] == [1] * 66 + [2]
    assert job.lines[66].baseline == 528


def test_pages_count_to_the_last_ink():
    assert parse_text("one\f\f\f").pages == 1


def test_carriage_return_alone_strikes_over():
    job = parse_text("bold\rbold\r____\n")
    assert [(c.char, c.column, c.strike) for c in job.lines[0].characters][:2] == [("_", 0, 1), ("b", 0, 2)]


def test_windows_line_ends_are_line_ends():
    assert parse_text("a\r\nb\r\n").lines == parse_text("a\nb\n").lines


def test_an_accent_is_struck_over_its_letter():
    assert places(parse_text("e\N{COMBINING ACUTE ACCENT}x")) == [
        ("e", 0),
        ("\N{COMBINING ACUTE ACCENT}", 0),
        ("x", 12),
    ]


def test_a_no_break_space_is_a_blank():
    assert places(parse_text("a\N{NO-BREAK SPACE}b")) == [("a", 0), ("b", 24)]


def test_notes_count_bytes_of_the_file():
    text = "é\N{ZERO WIDTH SPACE}x\x0b"
    (hidden, vertical) = parse_text(text).notes
    assert (hidden.offset, hidden.code) == (2, "U+200B")
    assert (vertical.offset, vertical.code) == (6, "0B hex")
    assert parse_text("é\x0b", encoding="latin-1").notes[0].offset == 1


def test_text_reads_back_as_it_was_written():
    assert parse_text("A line,  with two gaps").lines[0].text == "A line,  with two gaps"


# -- files --------------------------------------------------------------------------------------------------


def test_the_letter_fits_a_page_of_eighty_columns():
    job = load_job(str(EXAMPLES / "letter.txt"))
    assert (job.name, job.kind, job.pages, job.notes) == ("letter.txt", "text", 1, ())
    assert len(job.lines) == 11
    assert max(line.last_column for line in job.lines) <= 80 * 12


def test_the_content_decides_and_not_the_name(tmp_path):
    (tmp_path / "stream.txt").write_bytes(b"\x1b6ab")
    (tmp_path / "text.prn").write_bytes(b"plain\n")
    assert load_job(tmp_path / "stream.txt").kind == "diablo630"
    assert load_job(tmp_path / "text.prn").kind == "text"


def test_a_backspace_alone_makes_a_stream(tmp_path):
    (tmp_path / "job").write_bytes(b"a\b_\r\n")
    job = load_job(tmp_path / "job")
    assert job.kind == "diablo630"
    assert places(job) == [("_", 0), ("a", 0)]


def test_cp_m_padding_does_not_make_a_stream(tmp_path):
    (tmp_path / "job").write_bytes(b"text\r\n" + b"\x1a" * 100)
    job = load_job(tmp_path / "job")
    assert job.kind == "text"
    assert job.account.noted == 100


def test_text_that_is_not_utf_8_is_latin_1(tmp_path):
    (tmp_path / "job").write_bytes("Größe".encode("latin-1"))
    assert load_job(tmp_path / "job").lines[0].text == "Größe"


def test_refuses_a_missing_file(tmp_path):
    assert refusal(tmp_path / "absent.txt").got == "no such file"


def test_refuses_a_folder(tmp_path):
    assert "directory" in refusal(tmp_path).got


def test_refuses_a_name_that_no_file_can_have():
    assert refusal("a\0b").got == "a name no file can have"


@pytest.mark.parametrize("name", ["job.txt", "job.prn", "job"])
def test_refuses_a_job_longer_than_any(tmp_path, name):
    (tmp_path / name).write_bytes(b"a" * (MAX_BYTES[".txt"] + 1))
    problem = refusal(tmp_path / name)
    assert (problem.got, problem.allowed) == ("more than 8000 kB", "up to 8000 kB")


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="no file without an end here")
def test_refuses_a_file_that_never_ends():
    assert refusal("/dev/zero").got == "more than 8000 kB"


@pytest.mark.parametrize(
    ("data", "got"), [(b"", "an empty file"), (b" \n\t\n", "4 bytes without a printable character")]
)
def test_refuses_a_job_without_ink(tmp_path, data, got):
    (tmp_path / "job").write_bytes(data)
    assert refusal(tmp_path / "job").got == got


@pytest.mark.parametrize(
    "data",
    [
        b"\x89PNG\r\n\x1a\n" + bytes(range(256)) * 4,
        b"\x7fELF\x02\x01\x01" + b"\0" * 200 + bytes(range(128, 256)) * 2,
        bytes(range(256)) * 8,
        b"\x04\x05\x06\x0e" * 20 + b"text",
    ],
    ids=["png", "elf", "every byte", "unknown codes"],
)
def test_refuses_what_is_no_job_and_says_where_it_shows(tmp_path, data):
    (tmp_path / "job").write_bytes(data)
    assert f"of {len(data)} bytes that mean nothing to a printer, the first at byte" in refusal(tmp_path / "job").got


# -- streams: our own, and a real one -----------------------------------------------------------------------


def test_the_brochure_is_what_its_generator_writes():
    assert (EXAMPLES / "brochure.prn").read_bytes() == brochure()


def test_the_brochure_reads_as_english():
    job = load_job(str(EXAMPLES / "brochure.prn"))
    assert [note.code for note in job.notes] == ["SUB"]
    lines = [line.text for line in job.lines]
    assert lines[0] == "T H E   C A R R I A G E"
    assert lines[2] == "What makes it precise is what it knows about itself. It measures"  # sent backwards
    assert lines[4] == "and from then on it drives every speed without having to search."  # sent backwards
    assert lines[5] == "Figures"
    assert lines[12] == "A justified line hides its spare room in the gaps between the words."
    assert max(line.last_column for line in job.lines) <= 80 * 12


def test_the_brochure_shows_every_way_to_print():
    characters = [c for line in load_job(str(EXAMPLES / "brochure.prn")).lines for c in line.characters]
    assert sum(c.strike == 2 for c in characters) == len("THECARRIAGE")
    assert sum(c.red for c in characters) == len("red")
    assert sum(c.underline for c in characters) == len("underscoredbyitself")
    assert {c.width_columns for c in characters} >= {1, 10, 11, 12, 24}
    shadows = [(a.char, b.char) for a, b in pairwise(characters) if b.column == a.column + 1]
    assert "".join(a for a, b in shadows if a == b) == "boldshadowed"


@pytest.mark.skipif(not WORDSTAR.exists(), reason="the recorded workloads (../shared/data) are not here")
def test_a_real_word_star_stream_is_understood_whole():
    job = load_job(WORDSTAR)
    (end,) = job.notes
    assert (end.code, end.offset) == ("SUB", 8888)
    assert (job.kind, len(job.lines), job.pages, job.characters) == ("diablo630", 76, 2, 2926)
    assert sum(astuple(job.account)) == job.length_bytes == 8960
    assert (job.account.printed, job.account.noted) == (3162, 72)
    assert job.lines[3].text == "WordStar is a powerful word processing system designed to meet"
    assert job.lines[4].text == "text preparation requirements for all levels of users:"  # sent backwards
    assert job.lines[-1].text.split() == ["WordStar", "Overview", "Page", "2"]
    assert max(line.last_column for line in job.lines) == 963
