"""For every list of moves: what is written is what is read, and no file gives anything but a job or an `InputError`."""

from fractions import Fraction

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from detent.errors import InputError
from detent.methods.moves.job import load_moves, text_job

UNITS = {
    "target": {"m": Fraction(1), "mm": Fraction(1, 1000), "in": Fraction(127, 5000)},
    "by": {"m": Fraction(1), "mm": Fraction(1, 1000), "in": Fraction(127, 5000)},
    "dwell": {"s": Fraction(1), "ms": Fraction(1, 1000)},
    "speed": {"m/s": Fraction(1), "in/s": Fraction(127, 5000)},
    "sample_period": {"s": Fraction(1), "us": Fraction(1, 10**6)},
}
KEYS = [*UNITS, "repeat"]
PITCH = 0.00254

signed = st.decimals(-1000, 1000, places=4).map(str)
not_negative = st.decimals(0, 1000, places=4).map(str)
positive = st.decimals("0.0001", 1000, places=4).map(str)
scientific = st.floats(1e-9, 1e9).map(repr)
NUMBERS = {
    "target": signed | scientific,
    "by": signed | scientific,
    "dwell": not_negative | scientific,
    "speed": positive | scientific,
    "sample_period": positive | scientific,
    "repeat": st.integers(1, 4).map(str),
}


@st.composite
def rows(draw):
    """One move as texts: a number for each key it states."""
    keys = [draw(st.sampled_from(["target", "by"]))]
    keys += draw(st.lists(st.sampled_from(["dwell", "speed", "sample_period", "repeat"]), unique=True))
    return {key: draw(NUMBERS[key]) for key in draw(st.permutations(keys))}


@st.composite
def lists(draw):
    """Moves as texts, and the unit that each key has in their file."""
    units = {key: draw(st.sampled_from(list(known))) for key, known in UNITS.items()}
    return draw(st.lists(rows(), min_size=1, max_size=8)), units


def expected(moves, units, lines, repeat=1):
    """What the moves are, computed exactly: (line, values in SI units) of each, repeats written out."""
    found = []
    for line, move in zip(lines, moves, strict=True):
        si = {key: float(Fraction(move[key]) * UNITS[key][units[key]]) for key in UNITS if key in move}
        found += [(line, si)] * int(move.get("repeat", 1))
    return found * repeat


def read(path):
    """The same of a file."""
    job = load_moves(path)
    assert [move.number for move in job.moves] == list(range(1, job.count + 1))
    found = []
    for move in job.moves:
        stated = {key: getattr(move, key) for key in UNITS if getattr(move, key) is not None}
        found.append((move.row, stated))
    return found


def with_dwell(moves):
    return [(line, {"dwell": 0.0, **values}) for line, values in moves]


@given(job=lists(), repeat=st.none() | st.integers(1, 3), gap=st.integers(0, 2))
def test_toml_is_read_as_it_is_written(job, repeat, gap, tmp_path_factory):
    moves, units = job
    lines = ["# moves"] if repeat is None else [f"repeat = {repeat}"]
    starts = []
    for move in moves:
        lines += [""] * gap
        starts.append(len(lines) + 1)
        lines.append("[[move]]")
        lines += [f'{key} = "{text} {units[key]}"' if key in units else f"{key} = {text}" for key, text in move.items()]
    file = tmp_path_factory.mktemp("jobs") / "job.toml"
    file.write_text("\n".join(lines), encoding="utf-8")
    assert read(file) == with_dwell(expected(moves, units, starts, repeat or 1))


@given(
    job=lists(),
    columns=st.permutations(KEYS),
    style=st.sampled_from([(",", "."), (";", "."), (";", ",")]),
    end=st.sampled_from(["\n", "\r\n"]),
    quote=st.sampled_from(["", '"']),
    begin=st.sampled_from(["", "\ufeff", "# moves\n\n"]),
)
def test_csv_is_read_as_it_is_written(job, columns, style, end, quote, begin, tmp_path_factory):
    moves, units = job
    separator, point = style
    header = [f"{key} [{units[key]}]" if key in units else key for key in columns]
    table = [header] + [[move.get(key, "").replace(".", point) for key in columns] for move in moves]
    text = "".join(separator.join(f"{quote}{cell}{quote}" for cell in row) + end for row in table)
    file = tmp_path_factory.mktemp("jobs") / "job.csv"
    file.write_bytes(f"{begin}{text}".encode())
    first = 2 + begin.count("\n")
    assert read(file) == with_dwell(expected(moves, units, range(first, first + len(moves))))


# Rubbish alone seldom gets past the header: mixtures of what the formats are made of get further.
headers = ["target [mm]", "by [in]", "dwell [ms]", "repeat", "[[move]]\n", "[move]\n", "target = ", "repeat = "]
pieces = st.sampled_from([*headers, '"1 mm"', "-2.5", "1e3", "nan", *'1=[]{},;"# \n\r\t\f\x1aé\u0301'])
contents = st.one_of(
    st.binary(max_size=200),
    st.text(max_size=100).map(lambda text: text.encode("utf-8", errors="replace")),
    st.lists(pieces, max_size=40).map(lambda found: "".join(found).encode()),
    st.lists(pieces, max_size=20).map(lambda found: ("target [mm],repeat\n" + "".join(found)).encode()),
    st.lists(pieces, max_size=20).map(lambda found: ('[[move]]\ntarget = "1 mm"\n' + "".join(found)).encode()),
)


@settings(max_examples=150)
@given(data=contents, ending=st.sampled_from([".csv", ".toml", ".txt"]), pitch=st.sampled_from([None, PITCH]))
@example(data=b"move = " + b"[" * 3000, ending=".toml", pitch=None)
@example(data=b"[[move]]\nrepeat = " + b"9" * 5000, ending=".toml", pitch=None)
@example(data=b"target [mm]\n" + b"1" * 200_000, ending=".csv", pitch=None)
def test_any_file_gives_a_job_or_an_input_error(data, ending, pitch, tmp_path_factory):
    file = tmp_path_factory.mktemp("jobs") / f"job{ending}"
    file.write_bytes(data)
    problems, job = (), None
    try:
        job = load_moves(file, pitch=pitch)
    except InputError as error:
        problems = error.problems
    if job is None:
        assert problems
        assert all(problem.got and problem.allowed and problem.remedy for problem in problems)
        lines = len(data.decode("utf-8", errors="replace").splitlines()) + 1
        assert all(0 <= problem.line <= lines for problem in problems)
        assert all(0 <= problem.column <= len(data) + 1 for problem in problems)
    else:
        assert job.count >= 1
        assert all((move.target is None) != (move.by is None) for move in job.moves)


@given(st.text(alphabet="abcXYZ09.,; \t\n\r\f\u00e9", max_size=200), st.floats(0, 0.1), st.floats(0, 0.1))
def test_a_text_strikes_its_characters_and_no_others(text, left_margin, hammer_time):
    ink = [char for char in text if not char.isspace()]
    if not ink:
        with pytest.raises(InputError, match=r"printable|empty"):
            text_job(text, name="job.txt", pitch=PITCH)
        return
    job = text_job(text, name="job.txt", pitch=PITCH, left_margin=left_margin, hammer_time=hammer_time)
    assert [move.label for move in job.moves] == ink
    assert {move.dwell for move in job.moves} == {hammer_time}
    # Each line as a terminal would show it, the character at the column that the move goes to.
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    for move in job.moves:
        column = round((move.target - left_margin) / PITCH)
        shown = [part.expandtabs(8) for part in lines[move.row - 1].split("\f")]
        assert move.label in {part[column : column + 1] for part in shown}
