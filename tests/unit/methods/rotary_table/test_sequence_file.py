"""Files of sequences: what they say, and every slip told with its place."""

from importlib.resources import files
from types import SimpleNamespace

import pytest

from detent.errors import MOST_PROBLEMS, InputError
from detent.methods.rotary_table.sequence_file import LONGEST_JOB, find_faults, load_sequence, parse_sequence
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
from detent.units import parse_quantity

EXAMPLE = files("detent") / "examples" / "index_sequence.toml"

JOB = """# an index
[[input]]
name = "feed"
from = "1 s"
to = "2500 ms"

[[step]]
go = 2
label = "again"

  [[ step ]]   # clamp
set = "clamp"

[[step]]
wait = "20 ms"
[[step]]
clear = "clamp"
[[step]]
repeat = "again"
times = 3
[[step]]
jog = "-"
speed = "30 deg/s"
while = "feed"
[[input]]
name = "feed"
from = "9 s"
to = "10 s"
[[step]]
jog = "+"
for = "0.5 s"
[[step]]
wait_for = "feed"
[[step]]
wait_for = "feed"
level = false
"""


def read(text):
    return parse_sequence("job.toml", text)


def refusal(text):
    with pytest.raises(InputError) as caught:
        read(text)
    problems = caught.value.problems
    assert all(problem.file == "job.toml" for problem in problems)
    assert all(problem.got and problem.allowed and problem.remedy for problem in problems)
    return problems


def told(problems):
    return [(problem.line, problem.column, problem.key, problem.got) for problem in problems]


def test_each_step_is_read_with_its_line():
    job = read(JOB)
    assert job.name == "job.toml"
    assert job.steps == (
        Go(2, row=7, label="again"),
        Output("clamp", on=True, row=11),
        Wait(0.02, row=14),
        Output("clamp", on=False, row=16),
        Repeat("again", 3, row=18),
        Jog(-1, parse_quantity("30 deg/s", "rad/s"), "feed", row=21),
        Jog(1, duration=0.5, row=29),
        Wait(signal="feed", row=32),
        Wait(signal="feed", level=False, row=34),
    )
    assert job.inputs == {"feed": ((1.0, 2.5), (9.0, 10.0))}
    assert job.count == 16


@pytest.mark.parametrize("text", [JOB.replace("\n", "\r\n"), JOB.replace("[[ step ]]", '[["step"]]')])
def test_as_programs_write_it(text):
    assert read(text) == read(JOB)


def test_the_lists_in_one_value():
    job = read('step = [{go = 1}, {wait = "1 s"}]\ninput = [{name = "a", from = "0 s", to = "1 s"}]\n')
    assert job.steps == (Go(1, row=1), Wait(1.0, row=1))
    assert job.inputs == {"a": ((0.0, 1.0),)}
    problems = refusal('step = [{go = 1}, {go = 200}]\ninput = [{name = "a", from = "0 s"}]\n')
    assert told(problems) == [(1, 20, "step.go", "200"), (2, 10, "input.to", "nothing")]


def test_stretches_of_a_signal_are_joined_in_order():
    stretch = '[[input]]\nname = "a"\nfrom = "{} s"\nto = "{} s"\n'
    text = "".join(stretch.format(*ends) for ends in ((5, 6), (1, 3), (2, 4)))
    assert read(text + "[[step]]\ngo = 1\n").inputs == {"a": ((1.0, 4.0), (5.0, 6.0))}


@pytest.mark.parametrize(
    ("line", "got", "allowed", "remedy"),
    [
        ("go = 128", "128", "a position number from 0 to 127", "give go a value"),
        ("go = -1", "-1", "a position number from 0 to 127", "give go a value"),
        ("go = true", "true", "a position number", "write a whole number, as in go = 1"),
        ('go = "1"', '"1"', "a position number", "write the number without quotes"),
        ("wait = 2", "2", "a time from 0 s", "write it as text with a unit"),
        ('wait = "-1 s"', '"-1 s"', "a time from 0 s up to", "give wait a value"),
        ('wait = "2e5 s"', '"2e5 s"', "a time from 0 s up to", "give wait a value"),
        ('wait = "1 deg"', '"1 deg"', "a time", "use a unit"),
        ('wait_for = "a b"', '"a b"', "a name: a letter or digit", "give wait_for a value"),
        ("set = 1", "1", "a name: a letter or digit", "put it in quotes: set ="),
        ('clear = ""', '""', "a name: a letter or digit", "give clear a value"),
        ("goto = 3", 'the unknown key "goto"', "in [[step]]: go, jog", 'did you mean "go"?'),
        ("colour = 3", 'the unknown key "colour"', "in [[step]]: go, jog", "remove it"),
    ],
)
def test_a_value_that_will_not_do(line, got, allowed, remedy):
    (problem,) = refusal(f"[[step]]\ngo = 1\n\n[[step]]\n  {line}\n")
    assert told([problem]) == [(5, 3, f"step.{line.partition(' ')[0]}", got)]
    assert problem.allowed.startswith(allowed)
    assert problem.remedy.startswith(remedy)


@pytest.mark.parametrize(
    ("lines", "key", "got", "allowed"),
    [
        ('jog = "*"\nfor = "1 s"', "jog", '"*"', '"+" (to larger angles) or "-"'),
        ('jog = 1\nfor = "1 s"', "jog", "1", '"+" (to larger angles) or "-"'),
        ('jog = "+"\nfor = "0 s"', "for", '"0 s"', "a time above 0 s up to"),
        ('jog = "+"\nfor = "1 s"\nspeed = "0 deg/s"', "speed", '"0 deg/s"', "an angular velocity above 0"),
        ('jog = "+"\nfor = "1 s"\nspeed = "-3 deg/s"', "speed", '"-3 deg/s"', "an angular velocity above 0"),
        ('jog = "+"\nfor = "1 s"\nspeed = 3', "speed", "3", "an angular velocity above 0"),
        ('repeat = "a"\ntimes = 0', "times", "0", f"a whole number from 1 up to {MOST_STEPS}"),
        (f'repeat = "a"\ntimes = {MOST_STEPS + 1}', "times", f"{MOST_STEPS + 1}", "a whole number from 1"),
        ('repeat = "a"\ntimes = 2.0', "times", "2.0", "a whole number"),
        ("repeat = 2\ntimes = 2", "repeat", "2", "the label of an earlier step: a letter or digit"),
        ('wait_for = "a"\nlevel = 0', "level", "0", "true (on) or false (off)"),
        ("go = 1\nlabel = 7", "label", "7", "a name: a letter or digit"),
        # keys that do not go together
        ('go = 1\nspeed = "1 deg/s"', "speed", "speed beside go", "beside go: label (speed belongs to jog)"),
        ('go = 1\nwait = "1 s"', "wait", "go and wait", "exactly one of go, jog, wait"),
        ('wait = "1 s"\nlevel = true', "level", "level beside wait", "beside wait: label (level belongs to wait_for)"),
        ('set = "x"\nfor = "1 s"', "for", "for beside set", "beside set: label (for belongs to jog)"),
        ('repeat = "a"\ntimes = 2\nlabel = "b"', "label", "label beside repeat", "beside repeat: times (label belongs"),
        ('jog = "+"', "jog", "jog without an end", "exactly one of while (a signal) and for (a time)"),
        ('jog = "+"\nfor = "1 s"\nwhile = "a"', "jog", "jog with while and for", "exactly one of while"),
        ('repeat = "a"', "repeat", "repeat without times", "a whole number of times"),
        ('label = "x"', "", "a step that does nothing", "exactly one of go, jog, wait"),
    ],
)  # fmt: skip
def test_a_step_that_will_not_do(lines, key, got, allowed):
    begin = '[[input]]\nname = "a"\nfrom = "0 s"\nto = "9 s"\n[[step]]\ngo = 1\nlabel = "a"\n'
    (problem,) = refusal(f"{begin}[[step]]\n{lines}\n")
    rows = [number for number, line in enumerate(lines.splitlines(), 9) if key and line.startswith(f"{key} =")]
    assert told([problem]) == [(rows[0] if rows else 8, 1, f"step.{key}" if key else "step", got)]
    assert problem.allowed.startswith(allowed)


@pytest.mark.parametrize(
    ("lines", "place", "got", "allowed"),
    [
        ('name = "a"\nfrom = "2 s"\nto = "1 s"', (3, "input.to"), '"1 s"', "a time after from, 2 s"),
        ('name = "a"\nfrom = "2 s"\nto = "2 s"', (3, "input.to"), '"2 s"', "a time after from, 2 s"),
        ('name = "a"\nfrom = "-1 s"\nto = "2 s"', (2, "input.from"), '"-1 s"', "a time from 0 s up to"),
        ('name = "a"\nto = "2 s"', (0, "input.from"), "nothing", "a time from 0 s"),
        ('from = "1 s"\nto = "2 s"', (0, "input.name"), "nothing", "a name: a letter"),
        ('name = "a"\nfrom = "1 s"\nto = "2 s"\non = true', (4, "input.on"), 'the unknown key "on"', "in [[input]]:"),
    ],
)
def test_an_input_that_will_not_do(lines, place, got, allowed):
    (problem,) = refusal(f"[[step]]\ngo = 1\n[[input]]\n{lines}\n")
    assert told([problem]) == [(3 + place[0], 1, place[1], got)]
    assert problem.allowed.startswith(allowed)


@pytest.mark.parametrize(
    ("text", "line", "key", "got", "remedy"),
    [
        ("[step]\ngo = 1", 1, "step", "a single table", "write [[step]], with two brackets"),
        ("step = 3", 1, "step", "3", "write [[step]], with two brackets"),
        ("go = 1\n[[step]]\ngo = 1", 1, "go", 'the unknown key "go"', "move it to [[step]]"),
        ('name = "a"\n[[step]]\ngo = 1', 1, "name", 'the unknown key "name"', "move it to [[input]]"),
        ("[[steps]]\ngo = 1", 1, "steps", "the unknown table [steps]", 'did you mean "step"?'),
        ("[[move]]\nby = 1", 1, "move", "the unknown table [move]", "remove it"),
        ("[axis]\nname = 1", 1, "axis", "the unknown table [axis]", "remove it"),
    ],
)
def test_a_file_of_something_else(text, line, key, got, remedy):
    (problem,) = refusal(text)
    assert told([problem]) == [(line, 1, key, got)]
    assert problem.remedy.startswith(remedy)


@pytest.mark.parametrize(
    ("lines", "place", "key", "got"),
    [
        ('[[step]]\nwait_for = "b"\n', (5, 1), "wait_for", 'the unknown input "b"'),
        ('[[step]]\njog = "+"\n while = "b"\n', (6, 2), "while", 'the unknown input "b"'),
        ('[[step]]\nset = "a"\n', (5, 1), "set", 'the input "a"'),
        ('[[step]]\nrepeat = "x"\ntimes = 2\n', (5, 1), "repeat", 'the label "x", which no step before has'),
        ('[[step]]\ngo = 1\nlabel = "x"\n[[step]]\ngo = 1\nlabel = "x"\n', (9, 1), "label", 'the label "x" again'),
        (
            '[[step]]\nwait = "3 s"\n[[step]]\nwait_for = "a"\n',
            (7, 1),
            "wait_for",
            '"a", which is off for good from 2 s on; the step begins at 3 s or later',
        ),
        (
            '[[step]]\nwait = "0 s"\nlabel = "x"\n[[step]]\nrepeat = "x"\ntimes = 100000\n[[step]]\ngo = 1\n',
            (9, 1),
            "times",
            "100001 steps, repeats counted",
        ),
    ],
)
def test_steps_that_do_not_go_together_are_told_with_their_place(lines, place, key, got):
    # the input stands behind the steps, so that places are counted through both lists
    text = f'# a job\n\n\n{lines}[[input]]\nname = "a"\nfrom = "1 s"\nto = "2 s"\n'
    (problem,) = refusal(text)
    assert told([problem]) == [(*place, f"step.{key}", got)]


def test_problems_come_all_at_once_those_of_syntax_too():
    text = '[[input]]\nname = 1\nfrom = "0 s"\nto = "1 s"\n[[step]]\ngo = one\n[[step]]\ngo = 999\nspeed = 1\n'
    assert told(refusal(text)) == [
        (2, 1, "input.name", "1"),
        (6, 6, "go", "`go = one`"),
        (8, 1, "step.go", "999"),
        (9, 1, "step.speed", "1"),
        (9, 1, "step.speed", "speed beside go"),
    ]


def test_a_file_of_another_kind_is_not_reported_for_ever():
    assert len(refusal("[[step]]\n" * 1000)) == MOST_PROBLEMS
    assert len(refusal("[[input]]\n" * 1000)) == MOST_PROBLEMS


def test_a_file_without_steps():
    assert told(refusal('[[input]]\nname = "a"\nfrom = "0 s"\nto = "1 s"\n')) == [(0, 0, "", "no steps")]
    assert told(refusal("# nothing\n")) == [(0, 0, "", "no steps")]


def test_headers_inside_a_text_are_none():
    (problem,) = refusal("[[step]]\ngo = 1\nlabel = '''\n[[step]]\n'''\n")
    assert (problem.line, problem.key) == (3, "step.label")


def test_a_file_is_named_as_the_user_named_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "job.toml").write_text("﻿[[step]]\ngo = 1\n", encoding="utf-8")
    assert load_sequence("job.toml").steps == (Go(1, row=1),)
    (tmp_path / "job.csv").write_text("go\n1\n")
    for name, got in (("absent.toml", "no such file"), ("job.csv", 'a name that ends in ".csv"')):
        with pytest.raises(InputError) as caught:
            load_sequence(name)
        (problem,) = caught.value.problems
        assert (problem.file, problem.got, problem.allowed) == (name, got, "a sequence of steps (.toml)")


def test_the_example_uses_everything():
    text = EXAMPLE.read_text(encoding="utf-8")
    job = read(text)
    assert text.startswith("# Sequence of a rotary table: ")
    assert {type(step) for step in job.steps} == {Go, Jog, Wait, Output, Repeat}
    assert {step.direction for step in job.steps if isinstance(step, Jog)} == {1, -1}
    assert any(isinstance(step, Jog) and step.duration for step in job.steps)
    assert any(isinstance(step, Wait) and step.signal for step in job.steps)


# -- steps among one another --------------------------------------------------------------------------------

FEED = {"feed": ((1.0, 2.0), (5.0, 6.0))}


def only(steps, inputs=None):
    ((index, fault),) = find_faults(SequenceJob("job", tuple(steps), inputs or {}))
    assert fault.allowed
    assert fault.remedy
    return SimpleNamespace(index=index, key=fault.key, got=fault.got, allowed=fault.allowed)


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
    assert (fault.index, fault.key, fault.got) == (2, "label", 'the label "a" again')


def test_a_loop_to_nowhere():
    fault = only([Go(1), Repeat("a", 2)])
    assert (fault.index, fault.key, fault.got) == (1, "repeat", 'the label "a", which no step before has')
    assert "none of them has one" in fault.allowed
    later = only([Go(1, label="b"), Repeat("a", 2), Go(2, label="a")])
    assert (later.index, later.allowed) == (1, 'the label of an earlier step: "b"')


def test_loops_that_cross():
    fault = only([Go(1, label="a"), Go(2, label="b"), Repeat("a", 2), Go(3), Repeat("b", 2)])
    assert (fault.index, fault.key) == (4, "repeat")
    assert "begins inside an earlier loop and ends outside it" in fault.got


def test_more_steps_than_a_job_may_have():
    assert find_faults(SequenceJob("job", (Wait(0.0, label="a"), Repeat("a", MOST_STEPS)), {})) == []
    fault = only([Wait(0.0, label="a"), Wait(0.0), Repeat("a", 2), Repeat("a", MOST_STEPS)])
    assert (fault.index, fault.key, fault.got) == (3, "times", f"{4 * MOST_STEPS} steps, repeats counted")


@pytest.mark.parametrize(("step", "key"), [(Jog(1, signal="fed"), "while"), (Wait(signal="fed"), "wait_for")])
def test_an_input_that_the_job_does_not_have(step, key):
    fault = only([Go(1), step], FEED)
    assert (fault.index, fault.key, fault.got) == (1, key, 'the unknown input "fed"')
    assert fault.allowed == 'an input of this job: "feed"'
    assert "the job has none" in only([step]).allowed


@pytest.mark.parametrize(("on", "key"), [(True, "set"), (False, "clear")])
def test_an_output_that_comes_from_outside(on, key):
    fault = only([Output("feed", on=on)], FEED)
    assert (fault.index, fault.key, fault.got) == (0, key, 'the input "feed"')


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
    assert fault.got == f'"feed", which is off for good from 6 s on; the step begins at {begins:g} s or later'


def test_a_signal_may_be_on_already_when_a_step_begins():
    assert find_faults(SequenceJob("job", (Wait(5.9), Jog(1, signal="feed")), FEED)) == []
    assert find_faults(SequenceJob("job", (Wait(5.9), Wait(signal="feed"), Wait(signal="feed")), FEED)) == []


def test_a_job_of_many_days():
    assert find_faults(SequenceJob("job", (Wait(LONGEST_TIME, label="a"), Repeat("a", 10)), {})) == []
    fault = only([Wait(LONGEST_TIME, label="a"), Go(1), Repeat("a", 11)])
    assert (fault.index, fault.got) == (0, f"a sequence of more than {LONGEST_JOB:g} s")


def test_times_are_looked_at_only_where_the_rest_is_right():
    steps = [Wait(9.0), Wait(signal="feed"), Repeat("a", 2)]
    assert [fault.key for _, fault in find_faults(SequenceJob("job", tuple(steps), FEED))] == ["repeat"]
