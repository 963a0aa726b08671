"""Where mutants are made, and what a reach says of itself."""

import json

import pytest

from detent.export import teeth
from detent.export.teeth import Outcome, Reach, mutants, sites, step_lines

CODE = """#define N (3)
static int helper(int a)
{
    return a < 2;
}

/* a step: a < b */
static int one(int a)
{
    if ((a < 2) && (a != 0)) {
        return 7;
    }
    return a + 1;
}

void two(int a)
{
    (void)a;
}
"""


@pytest.fixture
def folder(tmp_path):
    place = tmp_path / "out"
    place.mkdir()
    (place / "t.c").write_text(CODE)
    (place / "trace.csv").write_text("function,line,file\none,8,x.py\ntwo,16,x.py\n")
    (place / "manifest.json").write_text(json.dumps({"name": "t", "files": {}}))
    return place


def test_functions_end_where_their_brace_does(folder):
    assert step_lines(folder, "t") == [(8, 14), (16, 19)]


def test_one_thing_is_changed_inside_of_steps_alone(folder):
    found = [(CODE[begin:end], other) for begin, end, other in sites(folder, "t")]
    assert found == [
        (" < ", " <= "),
        ("2", "3"),
        (" && ", " || "),
        (" != ", " == "),
        ("0", "1"),
        ("7", "8"),
        (" + ", " - "),
        ("1", "2"),
    ]


def test_mutants_are_chosen_the_same_way_each_time_and_told_by_line(folder, monkeypatch):
    seen = []

    def found_by(place, name):
        seen.append((place / f"{name}.c").read_text())
        return "drawn" if len(seen) % 2 else ""

    monkeypatch.setattr(teeth, "_found_by", found_by)
    made = mutants(folder, 4)
    assert [one.found for one in made] == ["drawn", "", "drawn", ""]
    assert all(text != CODE and len(text.splitlines()) == len(CODE.splitlines()) for text in seen)
    for one, text in zip(made, seen, strict=True):
        assert text.splitlines()[one.line - 1] != CODE.splitlines()[one.line - 1]
        assert one.text == CODE.splitlines()[one.line - 1].strip()
    assert mutants(folder, 4) == made
    assert len(mutants(folder, 100)) == 8
    assert (folder / "t.c").read_text() == CODE


def test_the_share_of_outcomes_taken():
    assert Reach(8, (Outcome(1, "if", 0), Outcome(1, "if", 1)), 5, ()).share == 75.0
    assert Reach(0, (), 0, ()).share == 100.0
