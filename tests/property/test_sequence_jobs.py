"""For every sequence: what is written is what is read, loops mean what they say, and every run ends.

No file gives anything but a job or an `InputError`.
"""

import math
from fractions import Fraction
from itertools import pairwise

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import detent
from detent.errors import InputError
from detent.methods.load import load_spec
from detent.methods.rotary_table.run import run_sequence
from detent.methods.rotary_table.sequence_file import find_faults, load_sequence
from detent.methods.rotary_table.sequence_job import (
    MOST_STEPS,
    Go,
    Jog,
    Output,
    Repeat,
    SequenceJob,
    Wait,
    join_stretches,
    next_on,
)

TIMES = {"s": Fraction(1), "ms": Fraction(1, 1000), "us": Fraction(1, 10**6)}

names = st.text("abcXYZ012_.:-é", min_size=1, max_size=12).filter(lambda text: text[0].isalnum())
times = st.tuples(st.decimals("0.01", 100, places=3).map(str), st.sampled_from(list(TIMES)))
speeds = st.decimals("0.001", 1000, places=3).map(str)


def seconds(time):
    """A time as it is read, computed exactly."""
    number, unit = time
    return float(Fraction(number) * TIMES[unit])


# -- files --------------------------------------------------------------------------------------------------


@st.composite
def written_steps(draw, inputs):
    """A step as lines of a file, and as what must be read of it but for its line."""
    kinds = ["go", "for", "wait", "set", "clear", *(["while", "wait_for"] if inputs else [])]
    kind = draw(st.sampled_from(kinds))
    if kind == "go":
        number = draw(st.integers(0, 127))
        return [f"go = {number}"], Go(number)
    if kind == "wait":
        time = draw(times)
        return [f'wait = "{" ".join(time)}"'], Wait(seconds(time))
    if kind in ("set", "clear"):
        name = draw(names.filter(lambda text: text not in inputs))
        return [f'{kind} = "{name}"'], Output(name, on=kind == "set")
    if kind == "wait_for":
        name = draw(st.sampled_from(sorted(inputs)))
        return [f'wait_for = "{name}"', "level = false"], Wait(signal=name, level=False)
    return draw(written_jogs(kind, inputs))


@st.composite
def written_jogs(draw, kind, inputs):
    """The same of a jog."""
    sign, speed = draw(st.sampled_from("+-")), draw(st.none() | speeds)
    lines, values = [f'jog = "{sign}"'], {"direction": 1 if sign == "+" else -1}
    if speed is not None:
        lines.append(f'speed = "{speed} rad/s"')
        values["speed"] = float(speed)
    if kind == "while":
        values["signal"] = draw(st.sampled_from(sorted(inputs)))
        lines.append(f'while = "{values["signal"]}"')
    else:
        time = draw(times)
        values["duration"] = seconds(time)
        lines.append(f'for = "{" ".join(time)}"')
    return draw(st.permutations(lines)), Jog(**values)


@st.composite
def written_inputs(draw):
    """Inputs as lines of a file, and as stretches by name; each comes on again after all that a job can do."""
    found, lines = {}, []
    for name in draw(st.lists(names, max_size=3, unique=True)):
        stretches = [("9e4", "1e5"), *draw(st.lists(st.tuples(st.integers(0, 50), st.integers(51, 99)), max_size=3))]
        found[name] = join_stretches((float(begin), float(end)) for begin, end in stretches)
        for begin, end in stretches:
            lines += ["[[input]]", f'to = "{end} s"', f'name = "{name}"', f'from = "{begin} s"']
    return lines, found


@settings(max_examples=60)
@given(st.data())
def test_a_sequence_is_read_as_it_is_written(tmp_path_factory, data):
    lines, inputs = data.draw(written_inputs())
    # A jog to the end of an input's last stretch ends the time in which it can be waited for: at most one of them.
    steps = data.draw(st.lists(written_steps(inputs), min_size=1, max_size=10))
    held = [place for place, (_, step) in enumerate(steps) if isinstance(step, Jog) and step.signal]
    steps = [entry for place, entry in enumerate(steps) if place not in held[1:]]
    expected = []
    for text, step in steps:
        lines += [""] * data.draw(st.integers(0, 2)) + ["[[step]]"]
        values = {name: getattr(step, name) for name in type(step).__dataclass_fields__}
        expected.append(type(step)(**(values | {"row": len(lines)})))
        lines += text
    file = tmp_path_factory.mktemp("jobs") / "job.toml"
    file.write_text("\n".join(lines), encoding="utf-8")
    job = load_sequence(file)
    assert list(job.steps) == expected
    assert job.inputs == inputs


# Rubbish alone seldom gets past the parser: mixtures of what the format is made of get further.
pieces = st.sampled_from(
    [
        "[[step]]\n", "[[input]]\n", "[step]\n", "go = ", "jog = ", "wait = ", "wait_for = ", "set = ", "repeat = ",
        "times = ", "label = ", "while = ", "for = ", "speed = ", "level = ", "name = ", "from = ", "to = ", '"+"',
        '"a"', '"1 s"', '"2 s"', '"1 deg/s"', "true", "1", "-2.5", "1e3", "nan", *'1=[]{},"# \n\t\x1aé\u0301',
    ]
)  # fmt: skip
contents = st.one_of(
    st.binary(max_size=200),
    st.text(max_size=100).map(lambda text: text.encode("utf-8", errors="replace")),
    st.lists(pieces, max_size=40).map(lambda found: "".join(found).encode()),
    st.lists(pieces, max_size=20).map(lambda found: ("[[step]]\ngo = 1\n" + "\n".join(found)).encode()),
)


@settings(max_examples=150)
@given(data=contents)
@example(data=b"step = " + b"[" * 3000)
@example(data=b"[[step]]\ngo = " + b"9" * 5000)
@example(data=b'[[step]]\nwait = "0 s"\nlabel = "a"\n' + b'[[step]]\nrepeat = "a"\ntimes = 100000\n' * 50)
@example(data=b"".join(b'[[step]]\ngo = 1\nlabel = "a%d"\n' % n for n in range(200)))
def test_any_file_gives_a_job_or_an_input_error(data, tmp_path_factory):
    file = tmp_path_factory.mktemp("jobs") / "job.toml"
    file.write_bytes(data)
    problems, job = (), None
    try:
        job = load_sequence(file)
    except InputError as error:
        problems = error.problems
    if job is None:
        assert problems
        assert all(problem.got and problem.allowed and problem.remedy for problem in problems)
        lines = len(data.decode("utf-8", errors="replace").splitlines()) + 1
        assert all(0 <= problem.line <= lines for problem in problems)
        assert all(0 <= problem.column <= len(data) + 1 for problem in problems)
    else:
        assert 1 <= job.count <= MOST_STEPS
        assert find_faults(job) == []


# -- loops and stretches --------------------------------------------------------------------------------------


@st.composite
def trees(draw, depth=3):
    """Loops inside one another: a list of leaves (None) and (times, list)."""
    leaf = st.none()
    branch = st.tuples(st.integers(1, 3), trees(depth=depth - 1)) if depth else leaf
    return [None, *draw(st.lists(leaf | branch, max_size=3))]


def flatten(tree, steps):
    """Steps of a tree; returns the indices in the order in which they are done."""
    done = []
    for entry in tree:
        if entry is None:
            done.append(len(steps))
            steps.append(Wait(0.0, label=f"n{len(steps)}"))
        else:
            times, inner = entry
            first = len(steps)
            once = flatten(inner, steps)
            steps.append(Repeat(f"n{first}", times))
            done += once * times
    return done


@given(trees())
def test_loops_inside_one_another_are_written_out(tree):
    steps = []
    done = flatten(tree, steps)
    assert [index for index, _ in SequenceJob("", tuple(steps)).actions()] == done
    assert SequenceJob("", tuple(steps)).count == len(done)
    assert find_faults(SequenceJob("", tuple(steps))) == []


@given(st.integers(1, 8), st.lists(st.tuples(st.integers(0, 7), st.integers(0, 8)), min_size=1, max_size=4))
def test_loops_are_refused_exactly_where_two_of_them_cross(leaves, loops):
    # Loop k goes from a leaf to behind another; all that end behind one leaf stand there in the order given.
    loops = [(min(first, leaves - 1), min(max(first, last), leaves - 1)) for first, last in loops]
    steps, spans = [], []
    places = {}
    for leaf in range(leaves):
        places[leaf] = len(steps)
        steps.append(Wait(0.0, label=f"n{leaf}"))
        for first, last in loops:
            if last == leaf:
                spans.append((places[first], len(steps)))
                steps.append(Repeat(f"n{first}", 2))
    crossing = any(a < c <= b < d for a, b in spans for c, d in spans)
    assert bool([fault for _, fault in find_faults(SequenceJob("", tuple(steps))) if fault.key == "repeat"]) == crossing


stretches = st.lists(
    st.tuples(st.integers(0, 30), st.integers(1, 10)).map(lambda pair: (pair[0], sum(pair))), max_size=8
)


@given(stretches, st.integers(0, 45))
def test_joined_stretches_are_on_when_one_of_them_is(given_stretches, time):
    joined = join_stretches(given_stretches)
    assert list(joined) == sorted(joined)
    assert all(before[1] < after[0] for before, after in pairwise(joined))
    is_on = any(begin <= time < end for begin, end in given_stretches)
    assert any(begin <= time < end for begin, end in joined) == is_on
    found = next_on(joined, time)
    later = [stretch for stretch in joined if stretch[1] > time]
    assert found == (later[0] if later else None)


# -- runs ---------------------------------------------------------------------------------------------------

durations = st.integers(200, 12_000).map(lambda ticks: ticks * 1e-4)
actions = st.one_of(
    st.builds(Go, st.integers(0, 4)),
    st.builds(
        Jog, st.sampled_from((1, -1)), st.none() | st.floats(0.01, 60).map(math.radians), duration=durations
    ),
    st.builds(Jog, st.sampled_from((1, -1)), signal=st.just("a")),
    st.builds(Wait, durations),
    st.builds(Wait, signal=st.just("a"), level=st.booleans()),
    st.builds(Output, st.just("x"), on=st.booleans()),
)  # fmt: skip
FORMS = [
    ("turn counter", ()),
    ("flag", tuple(f"position.{number}.direction=as commanded" for number in range(5))),
    ("raw", tuple(f"position.{number}.direction=as commanded" for number in range(5))),
]


@pytest.mark.compiled
@settings(max_examples=30)
@given(
    steps=st.lists(actions, min_size=1, max_size=6),
    on=st.lists(st.tuples(st.floats(0, 9), st.floats(0.0001, 2)).map(lambda pair: (pair[0], sum(pair))), max_size=4),
    start=st.floats(-360, 360),
    form=st.sampled_from(FORMS),
)
def test_every_run_ends_and_its_records_adjoin(steps, on, start, form):
    inputs = {"a": join_stretches([*on, (500.0, 501.0)])}
    overrides = (f"method.form={form[0]}", *form[1], f"mechanics.start_angle={start} deg")
    spec = load_spec(detent.example("rotary_table.toml"), overrides)
    job = SequenceJob("job", tuple(steps), inputs)
    try:
        found = run_sequence(spec, job)
    except InputError:
        assert find_faults(job)
        return
    assert found.done != bool(found.failure)
    assert len(found.steps) == job.count if found.done else 1 <= len(found.steps) <= job.count
    times = [found.time_ready, *(time for step in found.steps for time in (step.begin, step.end)), found.time_end]
    assert times == sorted(times)
    for before, after in pairwise(found.steps):
        assert (before.end, before.stop) == (after.begin, after.start)
    if form[0] == "turn counter":
        assert found.done or "went off for good" in found.failure
        for step in found.steps:
            assert step.kind != "go" or abs(step.error) < 3 * spec.count
            assert step.kind not in ("wait", "output") or abs(step.travel) < 5 * spec.count
        assert found.peak_deviation < math.radians(2.2)
