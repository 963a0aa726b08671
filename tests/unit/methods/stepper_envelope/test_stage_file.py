"""Files of stage moves: lists of places whatever their columns are called, moves and manual runs, and every slip."""

from importlib.resources import files
from itertools import pairwise

import pytest
from tests.places import DATA

from detent.errors import MOST_PROBLEMS, InputError
from detent.files.text import MAX_BYTES
from detent.methods.moves.job import MOST_MOVES
from detent.methods.stepper_envelope.stage_job import StageJog, StopChange, load_stage_job

EXAMPLES = files("detent") / "examples"
SLIDES = DATA / "workloads/stage_tiles_czi"
XY = ("x", "y")


@pytest.fixture
def write(tmp_path, monkeypatch):
    """Writes a job beside which the test stands, so that messages name it shortly."""
    monkeypatch.chdir(tmp_path)

    def write_job(name, content):
        data = content if isinstance(content, bytes) else content.encode()
        (tmp_path / name).write_bytes(data)
        return name

    return write_job


def refusal(path, motors=XY):
    with pytest.raises(InputError) as caught:
        load_stage_job(path, motors)
    assert all(problem.got and problem.allowed and problem.remedy for problem in caught.value.problems)
    assert all(problem.file == str(path) for problem in caught.value.problems)
    return caught.value.problems


def told(problems):
    return [(problem.line, problem.column, problem.key, problem.got) for problem in problems]


def places(job):
    return [(move.row, move.targets) for move in job.moves]


# -- CSV ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("header", "line"),
    [
        ("x [mm],y [mm]", "-1.5,0.25"),
        ("y [um], x[ um ]", "250,-1500"),
        ("x_um,y_mm", "-1.5e3,.25"),
        ("x_um_nominal_grid,y_m_1", "-1500,0.00025"),
        ('"x [cm]";"y_um"', '"-0,15";250,0'),
        ("y_um;x [mm];;", "250;-1.5"),
    ],
)
def test_csv_columns_belong_to_the_motor_whose_name_they_begin_with(write, header, line):
    job = load_stage_job(write("job.csv", f"# places\n{header}\n{line}\n"), XY)
    assert (job.name, job.kind, job.motors, job.notes) == ("job.csv", "moves", XY, ())
    assert places(job) == [(3, {"x": -0.0015, "y": 0.00025})]


def test_csv_of_motors_with_longer_names(write):
    job = load_stage_job(write("job.csv", "a_b_mm,a [mm],a_b_c_mm_nominal\n1,2,3\n"), ("a", "a_b", "a_b_c"))
    assert job.moves[0].targets == {"a": 0.002, "a_b": 0.001, "a_b_c": 0.003}
    job = load_stage_job(write("job.csv", "a_um [mm],a_mm\n1,\n"), ("a", "a_um", "b"))
    assert (job.moves[0].targets, job.motors) == ({"a_um": 0.001}, ("a_um",))


def test_csv_says_how_long_how_often_and_what_it_is(write):
    text = "tile,x [mm],dwell_ms,repeat,y [mm],label\n7,1,20,2,,corner A\n8,,,,2,\n,3,,,3,edge\n"
    job = load_stage_job(write("job.csv", text), XY)
    assert job.kind == "tiles"
    assert [move.number for move in job.moves] == [1, 2, 3, 4]
    assert [move.label for move in job.moves] == ["7 corner A", "7 corner A", "8", "edge"]
    assert [move.dwell for move in job.moves] == [0.02, 0.02, 0.0, 0.0]
    assert [move.targets for move in job.moves] == [{"x": 0.001}] * 2 + [{"y": 0.002}, {"x": 0.003, "y": 0.003}]


def test_csv_takes_the_nominal_of_several_columns_and_tells_which(write):
    header = "tile,x_um_reader1,y_um_reader1,x_um_nominal_grid,y_um_Nominal,focus,,x_count"
    job = load_stage_job(write("job.csv", f"{header}\n3,1,2,3,4,best,0,5\n"), XY)
    assert job.moves[0].targets == {"x": 3e-6, "y": 4e-6}
    assert (job.moves[0].label, job.kind) == ("3", "tiles")
    assert job.notes == (
        "columns x_um_nominal_grid, y_um_Nominal",
        "passed over: x_um_reader1, y_um_reader1, focus, a column without a name, x_count",
    )
    many = ",".join(f"channel {k}" for k in range(40))
    job = load_stage_job(write("job.csv", f"x [mm],{many}\n3\n"), XY)
    assert job.notes[1].endswith("channel 11 and 28 more")


@pytest.mark.parametrize(
    ("header", "place", "got", "remedy"),
    [
        ("x", 1, '"x" without a unit', "write x [mm]"),
        ("x [],y [mm]", 1, '"x []" without a unit', "write x [mm]"),
        ("x [mm],y [V]", 8, 'the unit "V", which measures something else, in y [V]', "write y [mm]"),
        ("x [parrot]", 1, 'the unknown unit "parrot", in x [parrot]', "write x [mm]"),
        ("x [mm],X_um", 8, 'the unknown column "X_um"', 'did you mean "x"?'),
        ("x [mm], Y", 9, 'the unknown column "Y"', 'did you mean "y"?'),
        ("x [mm],dwel [ms]", 8, 'the unknown column "dwel [ms]"', 'did you mean "dwell"?'),
        ("x [mm],Dwell", 8, 'the unknown column "Dwell"', 'did you mean "dwell"?'),
        ("x [mm],dwell", 8, '"dwell" without a unit', "write dwell [ms]"),
        ("x [mm],repeats", 8, 'the unknown column "repeats"', 'did you mean "repeat"?'),
        ("x [mm],dwell_s,dwell [ms]", 16, 'a second column "dwell"', "remove one of the two"),
        ("x_um_a,y_um,x_um_b", 13, "2 columns for x: x_um_a, x_um_b", "name the column of the places to go to "),
        (
            "x_um,x_nominal_um,x [mm]",
            19,
            "2 columns for x: x_um, x [mm]",
            "name the column of the places to go to x_um",
        ),
        ("x_um_nominal,x_mm_nominal_2", 14, "2 columns for x: x_um_nominal, x_mm_nominal_2", "name the column"),
        ("tile,z [mm]", 1, '"tile,z [mm]"', "begin with a header such as x [mm],y [mm]"),
        ("1.5;20", 1, '"1.5;20"', "begin with a header such as x [mm];y [mm]"),
        ('"x [mm]', 1, '"x [mm]', "remove the quotation marks (unexpected end of data)"),
    ],
)
def test_csv_header_that_says_nothing_or_the_wrong_thing(write, header, place, got, remedy):
    (problem,) = refusal(write("job.csv", f"# a job\n{header}\n1\n"))
    assert told([problem]) == [(2, place, "", got)]
    assert problem.remedy.startswith(remedy)


@pytest.mark.parametrize("name", ["well", "title", "readout", "file", "time", "z_um", "xy_um", "x_velocity_mm_s"])
def test_csv_column_of_something_else_is_passed_over(write, name):
    job = load_stage_job(write("job.csv", f"x [mm],{name}\n1,A1\n"), XY)
    assert (job.moves[0].targets, job.notes[1]) == ({"x": 0.001}, f"passed over: {name}")


@pytest.mark.parametrize(
    ("line", "place", "key", "got", "allowed"),
    [
        ("1,here", 3, "x", '"here"', "a plain number"),
        ("1,nan", 3, "x", '"nan"', "a plain number"),
        ("1,1 mm", 3, "x", '"1 mm"', "a plain number"),
        ('1,"1,5"', 3, "x", '"1,5"', "a plain number"),
        ("1,1e999", 3, "x", "1e999 mm", "a length"),
        ("1,,2,-1", 6, "dwell", "-1 ms", "a time from 0 s"),
        ("1,1,,,0", 7, "repeat", "0", f"a whole number from 1 up to {MOST_MOVES}"),
        ("1,1,,,2.5", 7, "repeat", '"2.5"', f"a whole number from 1 up to {MOST_MOVES}"),
        ("1,,,5", 3, "x", "no motor", "a place or a way for at least one of x, y"),
        ("1", 2, "x", "no motor", "a place or a way for at least one of x, y"),
        ("1,1,1,1,1,extra", 11, "", "6 cells", "5 as in the header"),
        (f"{'t' * 61},1", 1, "tile", f"{'t' * 60}...", "text of up to 60"),
        ("a\x07b,1", 1, "tile", "a\ufffdb", "text of up to 60 printable"),
        ('1,"1', 1, "", '1,"1', "cells separated by commas or semicolons"),
    ],
)
def test_csv_line_that_is_no_place(write, line, place, key, got, allowed):
    header = "tile,x [mm],y [mm],dwell [ms],repeat"
    (problem,) = refusal(write("job.csv", f"{header}\n1,1,1\n{line}\n2,2,2\n"))
    assert told([problem]) == [(3, place, key, got)]
    assert problem.allowed.startswith(allowed)


def test_csv_problems_come_all_at_once(write):
    problems = refusal(write("job.csv", "x [mm],dwel [ms],y [s],repeat\n?,1,1,0\n# fine\n1,1,1,1\n1,1,,-1\n"))
    assert [(problem.line, problem.column) for problem in problems] == [(1, 8), (1, 18), (2, 1), (2, 7), (5, 6)]
    assert len(refusal(write("job.csv", "x [mm],repeat\n" + "a,b\n" * 1000))) == MOST_PROBLEMS


def test_csv_without_places_and_with_too_many(write, monkeypatch):
    (problem,) = refusal(write("job.csv", "x [mm]\n\n,\n"))
    assert (told([problem]), problem.remedy) == ([(0, 0, "", "no moves")], "add a move with a place for x or y")
    assert told(refusal(write("job.csv", "# nothing\n"))) == [(0, 0, "", "no moves")]
    monkeypatch.setattr("detent.methods.stepper_envelope.stage_job.MOST_MOVES", 1000)
    monkeypatch.setattr("detent.methods.moves.job.MOST_MOVES", 1000)
    (problem,) = refusal(write("job.csv", "x [mm]\n" + "1\n" * 1002))
    assert problem.got == "more than 1000 moves"


# -- TOML ---------------------------------------------------------------------------------------------------

JOB = """# a stage
repeat = 2

[[move]]
label = "there"
x = "1.5 mm"
y = "-250 um"
dwell = "20 ms"

[[ move ]]
jog = "y"
speed = "-0.5 in/s"
duration = "0.5 s"

[[move]]
x = "0 mm"
by = {y = "1 mm"}
repeat = 2

[[move]]
by.x = "-1 mm"
turn = "4 mm"

[[move]]
x = "3 mm"
changed_at = "1 mm"
changed_to = "2 mm"
"""


def test_toml_keeps_moves_and_manual_runs_in_order(write):
    job = load_stage_job(write("job.toml", JOB), ("z", "y", "x"))
    assert (job.name, job.kind, job.count, job.motors, job.notes) == ("job.toml", "moves", 12, ("y", "x"), ())
    assert [move.number for move in job.moves] == list(range(1, 13))
    assert [move.row for move in job.moves] == 2 * [4, 10, 15, 15, 20, 24]
    there, jog, both, again, turning, changed = job.moves[:6]
    assert (there.targets, there.by, there.dwell, there.label) == ({"x": 0.0015, "y": -0.00025}, {}, 0.02, "there")
    assert jog == StageJog(2, 10, "y", -0.0127, 0.5)
    assert (both.targets, both.by) == (again.targets, again.by) == ({"x": 0.0}, {"y": 0.001})
    assert (turning.by, turning.turn, turning.change) == ({"x": -0.001}, 0.004, None)
    assert (changed.targets, changed.change) == ({"x": 0.003}, StopChange(at=0.001, to=0.002))


def test_toml_as_programs_write_it(write):
    job = load_stage_job(write("a.toml", JOB), XY)
    for text in (JOB.replace("\n", "\r\n"), f"\ufeff{JOB}", JOB.replace("by.x", 'by."x"')):
        assert load_stage_job(write("b.toml", text), XY).moves == job.moves
    table = JOB.replace('by.x = "-1 mm"\nturn = "4 mm"', 'turn = "4 mm"\n[move.by]\nx = "-1 mm"')
    assert load_stage_job(write("b.toml", table), XY).moves[4] == job.moves[4]
    job = load_stage_job(write("c.toml", 'move = [{x = "1 mm"}, {by = {y = "1 mm"}}]\n'), XY)
    assert [(move.targets, move.by, move.row) for move in job.moves] == [({"x": 0.001}, {}, 1), ({}, {"y": 0.001}, 1)]


@pytest.mark.parametrize(
    ("line", "key", "got", "allowed", "remedy"),
    [
        ("y = 12", "y", "12", 'a length such as "12 mm"', "write it as text with a unit"),
        ('y = "12"', "y", '"12"', "a length", "write the unit after the number"),
        ('y = "1 s"', "y", '"1 s"', "a length", "use a unit"),
        ('by = "1 mm"', "by", '"1 mm"', "the table [move.by] with x, y", "write [move.by] on a line"),
        ('by = {z = "1 mm"}', "by.z", 'the unknown key "z"', "in [move.by]: x, y", "remove it"),
        ("by.y = 1", "by.y", "1", "a length", "write it as text with a unit"),
        ('by = {y = {a = "1 mm"}}', "by.y", '{a = "1 mm"}', "a length", "write it as text with a unit"),
        ('by = {x = "1 mm"}', "by.x", "x and by.x", "x (a place) or by.x (a way", "remove one of the two"),
        ('z = "1 mm"', "z", 'the unknown key "z"', "in [[move]]: ", "remove it"),
        ('target = "1 mm"', "target", 'the unknown key "target"', "in [[move]]: ", "remove it"),
        (
            'speed = "1 mm/s"',
            "speed",
            'the key "speed" without jog',
            "speed and duration of a jog",
            "remove it, for the tables",
        ),
        ('dwel = "1 ms"', "dwel", 'the unknown key "dwel"', "in [[move]]: ", 'did you mean "dwell"?'),
        ('dwell = "-1 ms"', "dwell", '"-1 ms"', "a time from 0 s", "give dwell a value"),
        ("repeat = 0", "repeat", "0", "a whole number from 1", "give repeat a value"),
        ('repeat = "2"', "repeat", '"2"', "a whole number", "write the number without quotes"),
        ("label = 3", "label", "3", "text of up to 60", "put it in quotes: label ="),
        (f'label = "{"a" * 61}"', "label", f'"{"a" * 59}...', "text of up to 60", "give label a value"),
        ('label = "a\\tb"', "label", '"a\\tb"', "text of up to 60 printable", "give label a value"),
        ("turn = 3", "turn", "3", "a length", "write it as text with a unit"),
    ],
)
def test_toml_key_that_will_not_do(write, line, key, got, allowed, remedy):
    (problem,) = refusal(write("job.toml", f'[[move]]\ny = "1 mm"\n\n[[move]]\nx = "1 mm"\n  {line}\n'))
    inside = line.index("{") + 1 if "." in key and "{" in line else 0
    assert told([problem]) == [(6, 3 + inside, f"move.{key}", got)]
    assert problem.allowed.startswith(allowed)
    assert problem.remedy.startswith(remedy)


@pytest.mark.parametrize(
    ("line", "key", "got", "remedy"),
    [
        ("", "duration", "no duration", 'add duration = "5 ms"'),
        (
            'duration = "0 s"',
            "duration",
            '"0 s"',
            "give duration a value in this range (how long the motor is driven by hand)",
        ),
        (
            'duration = "-1 s"',
            "duration",
            '"-1 s"',
            "give duration a value in this range (how long the motor is driven by hand)",
        ),
        ('duration = "1 s"\ny = "1 mm"', "y", 'the key "y" beside jog', "give it a [[move]] of its own"),
        ('duration = "1 s"\nturn = "1 mm"', "turn", 'the key "turn" beside jog', "give it a [[move]] of its own"),
        ('duration = "1 s"\ntarget = "1 mm"', "target", 'the unknown key "target"', "remove it"),
    ],
)
def test_toml_manual_run_that_will_not_do(write, line, key, got, remedy):
    (problem,) = refusal(write("job.toml", f'[[move]]\njog = "x"\nspeed = "1 mm/s"\n{line}\n'))
    row = 3 + len(line.splitlines()) if line else 1
    assert told([problem]) == [(row, 1, f"move.{key}", got)]
    assert problem.remedy == remedy


@pytest.mark.parametrize(
    ("line", "place", "key", "got", "allowed"),
    [
        ('jog = "z"\nspeed = "1 mm/s"', (2, 1), "move.jog", '"z"', "a motor: x, y"),
        ('jog = 1\nspeed = "1 mm/s"', (2, 1), "move.jog", "1", "text in quotes"),
        ('jog = "x"\nspeed = "0 mm/s"', (3, 1), "move.speed", '"0 mm/s"', "a velocity other than 0 mm/s"),
        ('jog = "x"\nspeed = "1 mm"', (3, 1), "move.speed", '"1 mm"', "a vel"),
        ('jog = "x"', (1, 1), "move.speed", "no speed", "speed and duration of a jog"),
    ],
)
def test_toml_manual_run_of_nothing(write, line, place, key, got, allowed):
    (problem,) = refusal(write("job.toml", f'[[move]]\n{line}\nduration = "1 s"\n'))
    assert told([problem]) == [(*place, key, got)]
    assert problem.allowed.startswith(allowed)


@pytest.mark.parametrize(
    ("text", "place", "key", "got", "allowed"),
    [
        ("", (1, 1), "move.x", "no motor", "a place or a way for at least one of x, y"),
        ("by = {}", (1, 1), "move.x", "no motor", "a place or a way for at least one of x, y"),
        ('turn = "1 mm"', (1, 1), "move.x", "no motor", "a place or a way for at least one of x, y"),
        (
            'x = "1 mm"\nby.y = "1 mm"\nturn = "3 mm"',
            (4, 1),
            "move.turn",
            "turn in a move of 2 motors",
            "turn in a move of exactly one motor",
        ),
        (
            'x = "1 mm"\ny = "1 mm"\nchanged_to = "3 mm"\nchanged_at = "3 mm"',
            (5, 1),
            "move.changed_at",
            "changed_at in a move of 2 motors",
            "changed_at in a move of exactly one motor",
        ),
        (
            'x = "1 mm"\nchanged_to = "3 mm"',
            (1, 1),
            "move.changed_at",
            "no changed_at",
            "changed_at and changed_to of a stop changed on the way",
        ),
        ('x = "1 mm"\nchanged_at = "3 mm"', (1, 1), "move.changed_to", "no changed_to", "changed_at and changed_to"),
        (
            'x = "1 mm"\nturn = "3 mm"\nchanged_at = "3 mm"\nchanged_to = "2 mm"',
            (4, 1),
            "move.changed_at",
            "turn and changed_at",
            "one of them: the motor would pass the place twice",
        ),
    ],
)
def test_toml_move_that_says_too_little_or_too_much(write, text, place, key, got, allowed):
    (problem,) = refusal(write("job.toml", f"[[move]]\n{text}\n"))
    assert told([problem]) == [(*place, key, got)]
    assert problem.allowed.startswith(allowed)


@pytest.mark.parametrize(
    ("text", "place", "key", "got", "remedy"),
    [
        ('repeat = 0\n[[move]]\nx = "1 m"', (1, 1), "repeat", "0", "give repeat a value"),
        ('x = "1 mm"\n[[move]]\nx = "1 m"', (1, 1), "x", 'the unknown key "x"', "move it to [[move]]"),
        ('[move]\nx = "1 m"', (1, 1), "move", "a single table", "write [[move]], with two"),
        ('[[jog]]\nmotor = "x"', (1, 1), "jog", "the unknown table [jog]", "move it to [[move]]"),
        ("repeat = 2", (0, 0), "", "no moves", "add a move with a place for x or y"),
    ],
)
def test_toml_that_is_no_list_of_moves(write, text, place, key, got, remedy):
    (problem,) = refusal(write("job.toml", text))
    assert told([problem]) == [(*place, key, got)]
    assert problem.remedy.startswith(remedy)


def test_toml_problems_come_all_at_once_those_of_syntax_too(write):
    text = 'repeat = 0\n[[move]]\nx = 1 mm\ndwell = "-1 s"\n[[move]]\njog = "x"\nspeed = 3\n[[move]]\nby.y = 2\n'
    assert told(refusal(write("job.toml", text))) == [
        (1, 1, "repeat", "0"),
        (3, 7, "x", "`x = 1 mm`"),
        (4, 1, "move.dwell", '"-1 s"'),
        (7, 1, "move.speed", "3"),
        (9, 1, "move.by.y", "2"),
    ]
    assert len(refusal(write("job.toml", "[[move]]\n" * 1000))) == MOST_PROBLEMS


def test_toml_with_too_many_moves(write):
    (problem,) = refusal(write("job.toml", f'repeat = {MOST_MOVES}\n[[move]]\nx = "1 mm"\nrepeat = 2\n'))
    assert problem.got == f"{2 * MOST_MOVES} moves, repeats counted"


# -- files --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "content", "got"),
    [
        ("job.txt", "abc", 'a name that ends in ".txt"'),
        ("job", "abc", "a name without an ending"),
        ("job.CSV", "", "an empty file"),
        ("job.toml", b"\x7fELF\0\0", "NUL bytes, as in a binary file or UTF-16"),
        ("job.toml", b"#" * (MAX_BYTES[".toml"] + 1), "more than 1000 kB"),
    ],
)
def test_file_of_another_kind(write, name, content, got):
    assert told(refusal(write(name, content))) == [(0, 0, "", got)]


def test_file_in_another_encoding_or_not_there(write):
    assert told(refusal(write("job.csv", b"# first\n# \xb5s\n"))) == [(2, 3, "", "the byte 0xB5")]
    assert told(refusal("absent.csv")) == [(0, 0, "", "no such file")]


# -- the examples, and real scans ---------------------------------------------------------------------------


def test_example_of_tiles_is_a_serpentine_around_the_middle():
    job = load_stage_job(EXAMPLES / "tiles.csv", XY)
    assert (job.kind, job.count, job.motors, job.notes) == ("tiles", 12, XY, ())
    points = [(move.targets["x"], move.targets["y"]) for move in job.moves]
    assert len(set(points)) == 12
    assert sum(x for x, _ in points) == pytest.approx(0, abs=1e-12)
    assert sum(y for _, y in points) == pytest.approx(0, abs=1e-12)
    # From each tile to the next along one side of it.
    steps = [sorted((abs(a - c), abs(b - d))) for (a, b), (c, d) in pairwise(points)]
    assert steps == [pytest.approx([0, 0.00047], abs=1e-12)] * 11
    assert {move.dwell for move in job.moves} == {0.1}


def test_example_of_a_zoom_shows_all_that_a_move_can_be():
    job = load_stage_job(EXAMPLES / "zoom_sequence.toml", ("group_a", "group_b"))
    moves = [move for move in job.moves if not isinstance(move, StageJog)]
    assert len(moves) < job.count
    assert any(len(move.targets) == 2 for move in moves)
    assert any(move.by for move in moves)
    assert any(move.turn is not None for move in moves)
    assert any(move.change is not None for move in moves)
    assert all(move.label for move in job.moves)
    for move in moves:
        assert all(0 <= place <= 0.04 for place in move.targets.values())


@pytest.mark.parametrize(
    ("name", "first"), [("tiles.csv", "# Places of a microscope stage"), ("zoom_sequence.toml", "# Moves of a zoom")]
)
def test_example_says_in_its_first_line_what_it_is(name, first):
    assert (EXAMPLES / name).read_text(encoding="utf-8").splitlines()[0].startswith(first)


@pytest.mark.skipif(not SLIDES.exists(), reason="the recorded workloads (../shared/data) are not here")
def test_real_scans_load_as_they_are():
    jobs = {path.stem: load_stage_job(path, XY) for path in sorted(SLIDES.glob("*.csv"))}
    assert len(jobs) == 5
    assert {job.kind for job in jobs.values()} == {"tiles"}
    assert {job.notes for job in jobs.values()} == {
        ("columns x_um_nominal_grid, y_um_nominal_grid", "passed over: x_um_reader1, y_um_reader1")
    }
    job = jobs["2023_11_30_RecognizedCode_27"]
    assert (job.count, job.motors) == (164, XY)
    assert job.moves[0].targets == {"x": -0.035172984, "y": 0.007335925}
    assert job.moves[0].label == "1"
