"""Files of moves: what each format says, and every slip told with its place."""

from importlib.resources import files

import pytest

from detent.errors import MOST_PROBLEMS, InputError
from detent.files.text import MAX_BYTES
from detent.methods.moves.job import MOST_MOVES, load_moves

EXAMPLES = files("detent") / "examples"
INCH = 0.0254


@pytest.fixture
def write(tmp_path, monkeypatch):
    """Writes a job beside which the test stands, so that messages name it shortly."""
    monkeypatch.chdir(tmp_path)

    def write_job(name, content):
        data = content if isinstance(content, bytes) else content.encode()
        (tmp_path / name).write_bytes(data)
        return name

    return write_job


def values(job):
    return [(move.row, move.target, move.by, move.dwell, move.speed, move.sample_period) for move in job.moves]


def refusal(path, **options):
    with pytest.raises(InputError) as caught:
        load_moves(path, **options)
    assert all(problem.got and problem.allowed and problem.remedy for problem in caught.value.problems)
    assert all(problem.file == str(path) for problem in caught.value.problems)
    return caught.value.problems


def told(problems):
    return [(problem.line, problem.column, problem.key, problem.got) for problem in problems]


# -- CSV ----------------------------------------------------------------------------------------------------


def test_csv_columns_stand_in_any_order_with_their_units(write):
    job = load_moves(
        write("job.csv", "dwell [ms], speed [in/s] ,target [mm],sample_period[us]\n20,2,25.4,500\n0,,-1e1,\n")
    )
    assert (job.name, job.kind, job.count) == ("job.csv", "moves", 2)
    assert values(job) == [(2, 0.0254, None, 0.02, 0.0508, 500e-6), (3, -0.01, None, 0.0, None, None)]


def test_csv_has_places_and_ways_in_one_table_and_repeats(write):
    job = load_moves(write("job.csv", "target [in],by [mm],repeat\n1,,\n,-2.5,3\n"))
    assert [(move.target, move.by, move.row) for move in job.moves] == [(INCH, None, 2)] + 3 * [(None, -0.0025, 3)]
    assert [move.number for move in job.moves] == [1, 2, 3, 4]


@pytest.mark.parametrize(
    "text",
    [
        "target [mm];dwell [s]\n1,5;0,25\n,5;\n",
        "target [mm];dwell [s]\n1.5;.25\n0.5\n",
        '"target [mm]","dwell [s]"\n"1.5","0.25"\n "0.5",\n',
        "\ufefftarget [mm],dwell [s]\r\n1.5,0.25\r\n0.5,\r\n",
        "target [mm],dwell [s]\r1.5,0.25\r0.5,\r",
        "# moves\n\n  # of an axis\ntarget [mm],dwell [s],,\n1.5,0.25,,\n\n ,,\n0.5,,,\n# end",
    ],
)
def test_csv_as_programs_write_it(write, text):
    job = load_moves(write("job.csv", text))
    assert [(move.target, move.dwell) for move in job.moves] == [(0.0015, 0.25), (0.0005, 0.0)]


@pytest.mark.parametrize(
    ("header", "place", "got", "remedy"),
    [
        ("target [mm],dwel [ms]", 13, 'the unknown column "dwel [ms]"', 'did you mean "dwell"?'),
        ("target [mm], Dwell [ms]", 14, 'the unknown column "Dwell [ms]"', 'did you mean "dwell"?'),
        ("target [mm],colour", 13, 'the unknown column "colour"', "remove the column"),
        ("target [mm],,dwell [ms]", 13, 'the unknown column ""', "remove the column"),
        ("target [[mm]],by [mm]", 1, 'the unknown column "target [[mm]]"', 'did you mean "target"?'),
        ("target", 1, '"target" without a unit', "write target [mm]"),
        ("by [],dwell [ms]", 1, '"by []" without a unit', "write by [mm]"),
        ("target [kg]", 1, 'the unit "kg", which measures something else, in target [kg]', "write target [mm]"),
        (
            "target [mm],dwell [mm]",
            13,
            'the unit "mm", which measures something else, in dwell [mm]',
            "write dwell [ms]",
        ),
        ("target [parrot]", 1, 'the unknown unit "parrot", in target [parrot]', "write target [mm]"),
        ("target [5 mm]", 1, 'the unknown unit "5 mm", in target [5 mm]', "write target [mm]"),
        ('"target [mm]";repeat [x]', 15, '"repeat [x]"', "write repeat"),
        ("by [mm],repeat,by [in]", 16, 'a second column "by"', "remove one of the two"),
        ("dwell [ms],repeat", 1, '"dwell [ms],repeat"', "add a column target [mm] or by [mm]"),
        ("1.5,20", 1, '"1.5,20"', "begin with a header such as target [mm],dwell [ms]"),
        ("1,5;20", 1, '"1,5;20"', "begin with a header such as target [mm];dwell [ms]"),
        ('"target [mm]', 1, '"target [mm]', "remove the quotation marks (unexpected end of data)"),
    ],
)
def test_csv_header_that_says_nothing_or_the_wrong_thing(write, header, place, got, remedy):
    (problem,) = refusal(write("job.csv", f"# a job\n{header}\n1\n"))
    assert told([problem]) == [(2, place, "", got)]
    assert problem.remedy == remedy


@pytest.mark.parametrize(
    ("line", "place", "key", "got", "allowed"),
    [
        ("x", 1, "target", '"x"', "a plain number"),
        ("1 mm", 1, "target", '"1 mm"', "a plain number"),
        ("inf", 1, "target", '"inf"', "a plain number"),
        (" nan", 2, "target", '"nan"', "a plain number"),
        ("1e999", 1, "target", "1e999 mm", "a length"),
        ('"1,5"', 1, "target", '"1,5"', "a plain number"),
        ("1_0", 1, "target", '"1_0"', "a plain number"),
        ("1,-20", 3, "dwell", "-20 ms", "a time from 0 s"),
        ("1,,,0", 5, "speed", "0 mm/s", "a velocity above 0 m/s"),
        ("1,,,,-1", 6, "sample_period", "-1 s", "a time above 0 s"),
        ("1,,0", 4, "repeat", "0", f"a whole number from 1 up to {MOST_MOVES}"),
        ("1,,-3", 4, "repeat", "-3", f"a whole number from 1 up to {MOST_MOVES}"),
        ("1,,1.0", 4, "repeat", '"1.0"', f"a whole number from 1 up to {MOST_MOVES}"),
        (f"1,,{MOST_MOVES + 1}", 4, "repeat", str(MOST_MOVES + 1), f"a whole number from 1 up to {MOST_MOVES}"),
        (f"1,,{'9' * 5000}", 4, "repeat", f'"{"9" * 60}..."', f"a whole number from 1 up to {MOST_MOVES}"),
        (",5", 1, "target", "neither target nor by", "exactly one of target"),
        ("1,,,,,2", 7, "by", "target and by", "exactly one of target"),
        ("1,,,,,,9", 8, "", "7 cells", "6 as in the header"),
        ('"1', 1, "", '"1', "cells separated by commas or semicolons"),
        ("\x01\x02", 1, "target", '"\ufffd\ufffd"', "a plain number"),
    ],
)
def test_csv_line_that_is_no_move(write, line, place, key, got, allowed):
    header = "target [mm],dwell [ms],repeat,speed [mm/s],sample_period [s],by [mm]"
    (problem,) = refusal(write("job.csv", f"{header}\n1\n{line}\n2\n"))
    assert told([problem]) == [(3, place, key, got)]
    assert problem.allowed.startswith(allowed)


def test_csv_line_too_short_to_say_where_to(write):
    (problem,) = refusal(write("job.csv", "dwell [ms],target [mm]\n5\n"))
    assert told([problem]) == [(2, 2, "target", "neither target nor by")]


def test_csv_says_what_to_do_about_a_decimal_comma(write):
    cell, excess = refusal(write("job.csv", 'target [mm]\n"1,5"\n1,5\n'))
    assert cell.remedy == "write a decimal point, or separate cells by semicolons"
    assert excess.remedy.endswith("separate cells by semicolons where numbers have decimal commas")
    (cell,) = refusal(write("job.csv", "target [mm];repeat\n1.234,5;1\n"))
    assert cell.remedy == "write the number alone; its unit, mm, stands in the header"
    (excess,) = refusal(write("job.csv", "target [mm];repeat\n1;2;3\n"))
    assert excess.remedy == "remove the cells beyond, or name their columns in the header"


def test_csv_problems_come_all_at_once(write):
    problems = refusal(write("job.csv", "target [mm],dwel [ms],repeat\nx,1,0\n# fine\n1,1,1\n,1,\n2,,-1\n"))
    assert [(problem.line, problem.column) for problem in problems] == [(1, 13), (2, 1), (2, 5), (6, 4)]


def test_csv_of_another_kind_is_not_reported_for_ever(write):
    assert len(refusal(write("job.csv", "target [mm],repeat\n" + "a,b\n" * 1000))) == MOST_PROBLEMS


@pytest.mark.parametrize("text", ["target [mm]\n", "# nothing\n", "\ufeff\n", "target [mm],by [mm]\n,\n"])
def test_csv_without_moves(write, text):
    (problem,) = refusal(write("job.csv", text))
    assert told([problem]) == [(0, 0, "", "no moves")]


def test_csv_has_as_many_moves_as_a_job(write, monkeypatch):
    monkeypatch.setattr("detent.methods.moves.job.MOST_MOVES", 1000)
    assert load_moves(write("job.csv", "by [mm]\n" + "1\n" * 1000)).count == 1000
    (problem,) = refusal(write("job.csv", "by [mm]\n" + "1\n" * 1002))
    assert problem.got == "more than 1000 moves"
    (problem,) = refusal(write("job.csv", "by [mm],repeat\n1,1000\n1,2\n"))
    assert problem.got == "1002 moves, repeats counted"


# -- TOML ---------------------------------------------------------------------------------------------------

JOB = """# two moves
repeat = 2

[[move]]
target = "25.4 mm"
dwell = "20 ms"

  [[ move ]]   # steps
by = "-0.1 in"
speed = "5 mm/s"
sample_period = "2 ms"
repeat = 2
"""


def test_toml_says_the_same_with_units_in_each_value(write):
    job = load_moves(write("job.toml", JOB))
    there, step = (4, 0.0254, None, 0.02, None, None), (8, None, -0.00254, 0.0, 0.005, 0.002)
    assert (job.name, job.kind, job.count) == ("job.toml", "moves", 6)
    assert values(job) == 2 * [there, step, step]
    assert [move.number for move in job.moves] == [1, 2, 3, 4, 5, 6]


@pytest.mark.parametrize("text", [JOB.replace("\n", "\r\n"), f"\ufeff{JOB}", JOB.replace("[[ move ]]", '[["move"]]')])
def test_toml_as_programs_write_it(write, text):
    assert values(load_moves(write("b.toml", text))) == values(load_moves(write("a.toml", JOB)))


def test_toml_with_the_list_in_one_value(write):
    job = load_moves(write("job.toml", 'repeat = 1\nmove = [{target = "1 mm"}, {by = "1 mm", repeat = 2}]\n'))
    assert [(move.row, move.target, move.by) for move in job.moves] == [(2, 0.001, None)] + 2 * [(2, None, 0.001)]
    problems = refusal(write("job.toml", f'move = [{{target = "1 mm"}}, {{by = 2, repeat = 0x{"f" * 5000}}}]\n'))
    assert told(problems) == [(1, 29, "move.by", "2"), (1, 37, "move.repeat", f"0x{'f' * 58}...")]
    (problem,) = refusal(write("job.toml", "move = [{by = [1]}]\n"))
    assert told([problem]) == [(1, 10, "move.by", "[1]")]


@pytest.mark.parametrize(
    ("line", "got", "allowed", "remedy"),
    [
        ("target = 12", "12", 'a length such as "12 mm"', "write it as text with a unit"),
        ("target = true", "true", 'a length such as "12 mm"', "write it as text with a unit"),
        ("by = inf", "inf", 'a length such as "12 mm"', "write it as text with a unit"),
        ('target = "12"', '"12"', 'a length such as "12 mm"', "write the unit after the number"),
        ('target = "inf mm"', '"inf mm"', "a length", "write a length"),
        ('target = "1 s"', '"1 s"', "a length", "use a unit"),
        ("target.x = 1", "a table", "a length", "write it as text with a unit"),
    ],
)
def test_toml_place_or_way_that_is_none(write, line, got, allowed, remedy):
    (problem,) = refusal(write("job.toml", f'[[move]]\nby = "1 mm"\n\n[[move]]\n  {line}\n'))
    key = line.partition(" ")[0].partition(".")[0]
    assert told([problem]) == [(5, 3, f"move.{key}", got)]
    assert problem.allowed.startswith(allowed)
    assert problem.remedy.startswith(remedy)


@pytest.mark.parametrize(
    ("line", "got", "allowed"),
    [
        ('dwell = "-1 ms"', '"-1 ms"', "a time from 0 s"),
        ('speed = "0 in/s"', '"0 in/s"', "a velocity above 0 m/s"),
        ('sample_period = "-2 ms"', '"-2 ms"', "a time above 0 s"),
        ("repeat = 0", "0", f"a whole number from 1 up to {MOST_MOVES}"),
        (f"repeat = {MOST_MOVES + 1}", str(MOST_MOVES + 1), f"a whole number from 1 up to {MOST_MOVES}"),
        ("repeat = true", "true", "a whole number"),
        ("repeat = 2.0", "2.0", "a whole number"),
        ('repeat = "3"', '"3"', "a whole number"),
        ("repeat = [\n1]", "[...", "a whole number"),
        ('dwel = "1 ms"', 'the unknown key "dwel"', "in [[move]]: target, by, dwell"),
        ('"a b" = 1', 'the unknown key "a b"', "in [[move]]: target, by, dwell"),
    ],
)
def test_toml_key_that_will_not_do(write, line, got, allowed):
    (problem,) = refusal(write("job.toml", f'[[move]]\nby = "1 mm"\n[[move]]\ntarget = "1 mm"\n{line}\n'))
    key = line.partition(" =")[0]
    assert told([problem]) == [(5, 1, f"move.{key}", got)]
    assert problem.allowed.startswith(allowed)


@pytest.mark.parametrize(
    ("text", "place", "key", "got", "remedy"),
    [
        ('[[move]]\nby = "1 m"\n[[move]]\n', (3, 1), "move.target", "neither target nor by", 'add target = "12 mm"'),
        ('[[move]]\nby = "1 m"\ntarget = "1 m"', (2, 1), "move.by", "target and by", "remove one"),
        ('[move]\nby = "1 m"', (1, 1), "move", "a single table", "write [[move]], with two"),
        ("move = 3", (1, 1), "move", "3", "write [[move]], with two"),
        ("move = [1, 2]", (1, 1), "move", "[1, 2]", "write [[move]], with two"),
        ('repeat = 0\n[[move]]\nby = "1 m"', (1, 1), "repeat", "0", "give repeat a value"),
        ('repeat = "2"\n[[move]]\nby = "1 m"', (1, 1), "repeat", '"2"', "write the number without quotes"),
        ('repeats = 2\n[[move]]\nby = "1 m"', (1, 1), "repeats", 'the unknown key "repeats"', 'did you mean "repeat"?'),
        (
            'speed = "1 m/s"\n[[move]]\nby = "1 m"',
            (1, 1),
            "speed",
            'the unknown key "speed"',
            "move it to [[move]]",
        ),
        ('colour = 1\n[[move]]\nby = "1 m"', (1, 1), "colour", 'the unknown key "colour"', "remove it"),
        ('[[moves]]\nby = "1 m"', (1, 1), "moves", "the unknown table [moves]", 'did you mean "move"?'),
        ("[limits]\ntravel = 1", (1, 1), "limits", "the unknown table [limits]", "remove it"),
    ],
)
def test_toml_that_is_no_list_of_moves(write, text, place, key, got, remedy):
    (problem,) = refusal(write("job.toml", text))
    assert told([problem]) == [(*place, key, got)]
    assert problem.remedy.startswith(remedy)


def test_toml_problems_come_all_at_once_those_of_syntax_too(write):
    text = 'repeat = 0\n[[move]]\ntarget = 1 mm\ndwell = "-1 s"\n[[move]]\nby = "1 mm"\nspeed = 3\n'
    assert told(refusal(write("job.toml", text))) == [
        (1, 1, "repeat", "0"),
        (3, 12, "target", "`target = 1 mm`"),
        (4, 1, "move.dwell", '"-1 s"'),
        (7, 1, "move.speed", "3"),
    ]


def test_toml_that_is_none(write):
    (problem,) = refusal(write("job.toml", "target [mm],dwell [ms]\n1,2\n"))
    assert (problem.line, problem.got) == (1, "`target [mm],dwell [ms]`")


def test_toml_of_another_kind_is_not_reported_for_ever(write):
    assert len(refusal(write("job.toml", "[[move]]\n" * 1000))) == MOST_PROBLEMS


def test_toml_without_moves_and_with_too_many(write):
    assert told(refusal(write("job.toml", "repeat = 2\n"))) == [(0, 0, "", "no moves")]
    (problem,) = refusal(write("job.toml", f'repeat = {MOST_MOVES}\n[[move]]\nby = "1 mm"\nrepeat = {MOST_MOVES}\n'))
    assert problem.got == f"{MOST_MOVES**2} moves, repeats counted"


def test_toml_that_looks_like_moves_inside_a_text_is_none(write):
    problems = refusal(write("job.toml", "[[move]]\nby = 1\nspeed = '''\n[[move]]\n'''\n"))
    assert [(problem.line, problem.key) for problem in problems] == [(2, "move.by"), (3, "move.speed")]


# -- files --------------------------------------------------------------------------------------------------


def test_text_is_printed_by_an_axis_that_has_a_pitch(write):
    name = write("job.TXT", "\ufeffé x\r\n".encode())
    job = load_moves(name, pitch=0.002, left_margin=0.01, hammer_time=0.005)
    assert (job.name, job.kind) == ("job.TXT", "text")
    assert [(move.label, move.target, move.dwell) for move in job.moves] == [("é", 0.01, 0.005), ("x", 0.014, 0.005)]
    assert load_moves(write("job.txt", b"\xe9 x\n"), pitch=0.002).moves[0].label == "é"


def test_text_is_refused_by_an_axis_without_a_pitch(write):
    (problem,) = refusal(write("job.txt", "abc"))
    assert "this axis prints no text" in problem.got
    assert problem.allowed == "a list of moves (.csv or .toml)"


def test_text_names_the_file_as_the_user_did(write, tmp_path):
    write("job.txt", "a\x1bb")
    (problem,) = refusal(tmp_path / "job.txt", pitch=0.002)
    assert told([problem]) == [(1, 2, "", "the character 0x1B, which is not printable by itself")]


@pytest.mark.parametrize(
    ("name", "content", "got"),
    [
        ("job.prn", "abc", 'a name that ends in ".prn"'),
        ("job", "abc", "a name without an ending"),
        ("job.csv", "", "an empty file"),
        ("job.toml", " \n", "an empty file"),
        ("job.csv", b"\x7fELF\0\0", "NUL bytes, as in a binary file or UTF-16"),
        ("job.toml", "[[move]]".encode("utf-16"), "NUL bytes, as in a binary file or UTF-16"),
        ("job.csv", b"#" * (MAX_BYTES[".csv"] + 1), "more than 8000 kB"),
        ("job.toml", b"#" * (MAX_BYTES[".toml"] + 1), "more than 1000 kB"),
    ],
)
def test_file_of_another_kind(write, name, content, got):
    assert told(refusal(write(name, content))) == [(0, 0, "", got)]


def test_file_that_is_not_there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.csv").mkdir()
    assert told(refusal("absent.csv")) == [(0, 0, "", "no such file")]
    assert "directory" in refusal("folder.csv")[0].got
    with pytest.raises(InputError) as caught:
        load_moves("a\0b.csv")
    assert caught.value.problems[0].got == "a name no file can have"


@pytest.mark.parametrize("name", ["job.csv", "job.toml"])
def test_file_of_moves_in_another_encoding(write, name):
    assert told(refusal(write(name, b"# first\n# \xb5s\n"))) == [(2, 3, "", "the byte 0xB5")]


# -- the examples -------------------------------------------------------------------------------------------


def test_example_of_a_carriage_stands_on_its_positioning_points():
    job = load_moves(EXAMPLES / "moves.csv")
    points = [move.target / INCH * 60 for move in job.moves]
    assert points == pytest.approx([round(point) for point in points], abs=1e-9)
    assert all(0 < move.target < 14 * INCH for move in job.moves)
    assert max(move.target for move in job.moves) == pytest.approx(13.2 * INCH)
    assert job.count > len({move.row for move in job.moves})  # a row is repeated


def test_example_of_a_slide_stays_on_it():
    job = load_moves(EXAMPLES / "slide_moves.toml")
    place = 0.0
    for move in job.moves:
        place = place + move.by if move.target is None else move.target
        assert 0 <= place <= 0.5
    assert {move.speed for move in job.moves} >= {None, 0.08, 0.005}
    assert sum(move.by is not None for move in job.moves) == 20


@pytest.mark.parametrize("name", ["moves.csv", "slide_moves.toml"])
def test_example_says_in_its_first_line_what_it_is(name):
    first = (EXAMPLES / name).read_text(encoding="utf-8").splitlines()[0]
    assert first.startswith("# Moves of a ")


# -- axes that turn -----------------------------------------------------------------------------------------


def test_places_ways_and_speeds_of_an_axis_that_turns_are_angles(write):
    table = load_moves(write("t.csv", "target [deg],by [turn],speed [rpm]\n180,,\n,0.25,60\n"), rotary=True)
    tables = load_moves(
        write("t.toml", '[[move]]\ntarget = "180 deg"\n[[move]]\nby = "0.25 turn"\nspeed = "60 rpm"\n'), rotary=True
    )
    for job in (table, tables):
        (first, second) = job.moves
        assert first.target == pytest.approx(3.14159265)
        assert (second.by, second.speed) == pytest.approx((1.57079633, 6.28318531))


def test_messages_about_an_axis_that_turns_suggest_degrees(write):
    (problem,) = refusal(write("a.csv", "target [mm]\n1\n"), rotary=True)
    assert problem.remedy == "write target [deg]"
    (problem,) = refusal(write("b.csv", "dwell [ms]\n1\n"), rotary=True)
    assert problem.remedy == "add a column target [deg] or by [deg]"
    (problem,) = refusal(write("c.toml", '[[move]]\ndwell = "1 ms"\n'), rotary=True)
    assert problem.remedy == 'add target = "5 deg"'
    (problem,) = refusal(write("d.toml", "[[move]]\ntarget = 3\n"), rotary=True)
    assert '"5 deg"' in problem.remedy
    (problem,) = refusal(write("e.csv", "target [deg],speed [deg/s]\n1,-2\n"), rotary=True)
    assert "deg/s" in problem.allowed
