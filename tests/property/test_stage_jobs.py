"""For every file of stage moves: what is written is what is read, and no file gives anything but a job or an error."""

from fractions import Fraction

from hypothesis import example, given, settings
from hypothesis import strategies as st

from detent.errors import InputError
from detent.methods.stepper_envelope.stage_job import StageJog, StopChange, load_stage_job

MOTORS = ("x", "y", "group_a")
LENGTHS = {"m": Fraction(1), "mm": Fraction(1, 1000), "um": Fraction(1, 10**6), "in": Fraction(127, 5000)}
TIMES = {"s": Fraction(1), "ms": Fraction(1, 1000)}
SPEEDS = {"mm/s": Fraction(1, 1000), "in/s": Fraction(127, 5000)}

numbers = st.decimals(-100000, 100000, places=4).map(str) | st.floats(1e-9, 1e9).map(repr)
not_negative = st.decimals(0, 1000, places=4).map(str)
positive = st.decimals("0.0001", 1000, places=4).map(str)
names = st.text("abcXYZ 0123456789-_", max_size=10).map(str.strip)
counts = st.integers(1, 3)


def quantities(values, units):
    """A number as text, and its unit."""
    return st.tuples(values, st.sampled_from(list(units)))


lengths = quantities(numbers, LENGTHS)
durations = quantities(positive, TIMES)
dwells = quantities(not_negative, TIMES)
speeds = quantities(positive.flatmap(lambda text: st.sampled_from([text, f"-{text}"])), SPEEDS)


def si(quantity, units):
    """The same in SI units, rounded once."""
    text, unit = quantity
    return float(Fraction(text) * units[unit])


def assigned(key, quantity):
    return f'{key} = "{quantity[0]} {quantity[1]}"'


@st.composite
def rows(draw):
    """One ``[[move]]``: its lines, and what they say (kind, values, dwell, label) in SI units; how often."""
    dwell, label, repeat = draw(st.none() | dwells), draw(names), draw(counts)
    is_jog = draw(st.booleans())
    lines, said = draw(jogs()) if is_jog else draw(moves())
    lines += [assigned("dwell", dwell)] if dwell else []
    lines += [f'label = "{label}"'] if label else []
    lines += [f"repeat = {repeat}"] if repeat > 1 else []
    found = (said, si(dwell, TIMES) if dwell else 0.0, label)
    return draw(st.permutations(lines)), [found] * repeat


@st.composite
def jogs(draw):
    motor, speed, duration = draw(st.sampled_from(MOTORS)), draw(speeds), draw(durations)
    lines = [f'jog = "{motor}"', assigned("speed", speed), assigned("duration", duration)]
    return lines, (motor, si(speed, SPEEDS), si(duration, TIMES))


@st.composite
def moves(draw):
    ways = draw(st.dictionaries(st.sampled_from(MOTORS), st.tuples(st.booleans(), lengths), min_size=1))
    targets = {motor: way for motor, (is_target, way) in ways.items() if is_target}
    by = {motor: way for motor, (is_target, way) in ways.items() if not is_target}
    lines = [assigned(motor, way) for motor, way in targets.items()]
    if draw(st.booleans()):
        lines += [assigned(f"by.{motor}", way) for motor, way in by.items()]
    elif by:
        lines.append(f"by = {{{', '.join(assigned(motor, way) for motor, way in by.items())}}}")
    turn, change = None, None
    kind = draw(st.sampled_from(["plain", "turn", "change"])) if len(ways) == 1 else "plain"
    if kind == "turn":
        place = draw(lengths)
        turn, lines = si(place, LENGTHS), [*lines, assigned("turn", place)]
    if kind == "change":
        at, to = draw(lengths), draw(lengths)
        lines += [assigned("changed_at", at), assigned("changed_to", to)]
        change = StopChange(si(at, LENGTHS), si(to, LENGTHS))
    said = [{motor: si(way, LENGTHS) for motor, way in found.items()} for found in (targets, by)]
    return lines, (*said, turn, change)


def read(path):
    """What a file says, as `rows` gives it, with the line of each move."""
    job = load_stage_job(path, MOTORS)
    assert [move.number for move in job.moves] == list(range(1, job.count + 1))
    assert job.motors == tuple(motor for motor in MOTORS if any(motor in move.motors for move in job.moves))
    found = []
    for move in job.moves:
        if isinstance(move, StageJog):
            said = (move.motor, move.speed, move.duration)
        else:
            said = (move.targets, move.by, move.turn, move.change)
        found.append((move.row, (said, move.dwell, move.label)))
    return found


@given(job=st.lists(rows(), min_size=1, max_size=6), repeat=st.none() | counts, gap=st.integers(0, 2))
def test_toml_is_read_as_it_is_written(job, repeat, gap, tmp_path_factory):
    lines = ["# moves"] if repeat is None else [f"repeat = {repeat}"]
    expected = []
    for written, found in job:
        lines += [""] * gap
        expected += [(len(lines) + 1, said) for said in found]
        lines += ["[[move]]", *written]
    file = tmp_path_factory.mktemp("jobs") / "job.toml"
    file.write_text("\n".join(lines), encoding="utf-8")
    assert read(file) == expected * (repeat or 1)


headings = st.sampled_from(["{motor} [{unit}]", "{motor}_{unit}", "{motor}_{unit}_nominal_grid", "{motor}_{unit}_1"])


@st.composite
def places(draw):
    """Columns with their units, headings and decoys; and lines with the numbers in them, some empty."""
    columns = draw(st.lists(st.sampled_from(MOTORS), min_size=1, unique=True))
    units = {motor: draw(st.sampled_from(list(LENGTHS))) for motor in columns}
    head = [draw(headings).format(motor=motor, unit=units[motor]) for motor in columns]
    stated = st.fixed_dictionaries({}, optional=dict.fromkeys(columns, numbers)).filter(bool)
    table = draw(st.lists(st.tuples(stated, names, st.none() | not_negative, counts), min_size=1, max_size=6))
    return columns, units, head, table


@given(
    job=places(),
    tiles=st.booleans(),
    decoy=st.booleans(),
    style=st.sampled_from([(",", "."), (";", "."), (";", ",")]),
    end=st.sampled_from(["\n", "\r\n"]),
    quote=st.sampled_from(["", '"']),
    begin=st.sampled_from(["", "\ufeff", "# places\n\n"]),
)
def test_csv_is_read_as_it_is_written(job, tiles, decoy, style, end, quote, begin, tmp_path_factory):
    (columns, units, head, table), (separator, point) = job, style
    # What an encoder read of the first motor is skipped, where the place asked for is there too.
    has_decoy = decoy and "nominal" in head[0]
    header = ["tile" if tiles else "label", *head, *([f"{columns[0]}_um_reader1"] if has_decoy else []), "dwell_ms"]
    lines = [[*header, "repeat"]]
    expected = []
    for number, (stated, label, dwell, repeat) in enumerate(table, start=2 + begin.count("\n")):
        cells = [stated.get(motor, "") for motor in columns] + ["7"] * has_decoy
        lines.append([label, *(cell.replace(".", point) for cell in [*cells, dwell or ""]), str(repeat)])
        targets = {motor: si((stated[motor], units[motor]), LENGTHS) for motor in stated}
        said = ((targets, {}, None, None), si((dwell, "ms"), TIMES) if dwell else 0.0, label)
        expected += [(number, said)] * repeat
    text = "".join(separator.join(f"{quote}{cell}{quote}" for cell in line) + end for line in lines)
    file = tmp_path_factory.mktemp("jobs") / "job.csv"
    file.write_bytes(f"{begin}{text}".encode())
    assert read(file) == expected
    job = load_stage_job(file, MOTORS)
    assert job.kind == ("tiles" if tiles else "moves")
    assert len(job.notes) == 2 * has_decoy


# Rubbish alone seldom gets past the header: mixtures of what the formats are made of get further.
words = ["x [mm]", "x_um", "_nominal", "y", "tile", "dwell [ms]", "repeat", "[[move]]\n", "x = ", "by = ", "by.y = "]
words += ["jog = ", "speed = ", "duration = ", "turn = ", "changed_at = ", '"x"', '"1 s"', '"1 mm/s"', "label = "]
pieces = st.sampled_from([*words, '"1 mm"', "-2.5", "1e3", "nan", *'1=[]{},;"#. \n\r\t\x1aé\u0301'])
contents = st.one_of(
    st.binary(max_size=200),
    st.text(max_size=100).map(lambda text: text.encode("utf-8", errors="replace")),
    st.lists(pieces, max_size=40).map(lambda found: "".join(found).encode()),
    st.lists(pieces, max_size=20).map(lambda found: ("tile,x_um,y_um,repeat\n" + "".join(found)).encode()),
    st.lists(pieces, max_size=20).map(lambda found: ('[[move]]\nx = "1 mm"\n' + "".join(found)).encode()),
    st.lists(pieces, max_size=20).map(lambda found: ('[[move]]\njog = "x"\n' + "\n".join(found)).encode()),
)


@settings(max_examples=150)
@given(data=contents, ending=st.sampled_from([".csv", ".toml"]))
@example(data=b"move = " + b"[" * 3000, ending=".toml")
@example(data=b"[[move]]\nby = {x = " + b"9" * 5000 + b"}", ending=".toml")
@example(data=b"[[move]]\nby = {by = {by = {x = 1}}}", ending=".toml")
@example(data=b"x_um\n" + b"1" * 200_000, ending=".csv")
@example(data=b"," * 5000, ending=".csv")
def test_any_file_gives_a_job_or_an_input_error(data, ending, tmp_path_factory):
    file = tmp_path_factory.mktemp("jobs") / f"job{ending}"
    file.write_bytes(data)
    problems, job = (), None
    try:
        job = load_stage_job(file, MOTORS)
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
        assert set(job.motors) <= set(MOTORS)
        assert all(move.motors for move in job.moves)
