"""Motors that turn what they move: the same machine in rad for m, and nothing of it in millimetres."""

import math
import re

import numpy as np
import pytest
from tests.remedies import check_caution
from tests.unit.methods.stepper_envelope.players import Played, play

import detent
from detent.errors import InputError
from detent.files.keys import key_rows
from detent.methods.load import load_spec
from detent.methods.registry import METHODS
from detent.methods.stepper_envelope.build import build_stepper, make_tables
from detent.methods.stepper_envelope.checks import find_cautions
from detent.methods.stepper_envelope.comparison import compare_jerk, compare_steps
from detent.methods.stepper_envelope.derive import derive
from detent.methods.stepper_envelope.envelope_files import Envelope, envelope_tables
from detent.methods.stepper_envelope.page import stage_page
from detent.methods.stepper_envelope.run import run_stage
from detent.methods.stepper_envelope.stage_job import StageJob, StageJog, StageMove, StopChange, load_stage_job
from detent.methods.stepper_envelope.stage_plan import tile_plan
from detent.methods.stepper_envelope.summary import StageFigures, stage_summary_rows

LENGTHS = re.compile(r"(?<![\w/])(?:[\d.]+|\[)[\s\u202f]*(?:[mnuµk]?m|m/s|mm/s)(?![\w·*²³])|\bmm\b|\bµm\b")
"""A length, a speed in m or a heading in one; torques in N m and times in ms are none."""

BOTH = """\
[axis]
name = "dial"
method = "stepper_envelope"

[stepper.dial]
motion = "{motion}"

[stepper.dial.limits]
travel = "3.5 {m}"
speed = "20 {m}/s"
acceleration = "150 {m}/s^2"

[stepper.dial.motor]
steps_per_turn = 200
holding_torque = "270 mN*m"
rotor_inertia = "35 g*cm^2"
resistance = "5.3 ohm"
inductance = "6.6 mH"
rated_current = "1 A"

[stepper.dial.mechanics]
{mechanics}
friction_torque = "12 mN*m"
lower_end = "-0.5 {m}"
start_position = "0 {m}"

[stepper.dial.extremes]
stop = "0.1 {m}"

[stepper.dial.zone.slow]
begin = "1 {m}"
end = "1.3 {m}"
speed = "10 {m}/s"
"""
SLIDES = 'travel_per_revolution = "{per_turn!r} m"\nmoving_mass = "0.00025 kg"\nscrew_inertia = "3 g*cm^2"'
TURNS = 'gear_ratio = {ratio}\nload_inertia = "0.00025 kg*m^2"\ngear_inertia = "3 g*cm^2"'
D = "stepper.dial"


def text_of(*, turns: bool, ratio: float = 1.0) -> str:
    mechanics = TURNS.format(ratio=ratio) if turns else SLIDES.format(per_turn=2 * math.pi / ratio)
    return BOTH.format(motion="rotary" if turns else "linear", m="rad" if turns else "m", mechanics=mechanics)


def lengths_in(text: str) -> list[str]:
    return [found.group() for found in LENGTHS.finditer(text.replace("\\u202f", " "))]


@pytest.mark.parametrize(
    "text", ["12 mm", "5\u202fµm a step", "speed [mm/s]", "x [m]", "0 m.", "at 3 m/s,", r"2\u202fmm"]
)
def test_lengths_are_found(text):
    assert lengths_in(text)
    assert not lengths_in("60 mN*m 5 ms 2 kg*m^2 [ms] 3.1 MHz 0.1 N*m 45 deg/s 12 m_t torque [mN·m] 1 turn")


@pytest.fixture
def dial(load_text):
    return load_text(text_of(turns=True)).spec


# ---- the same machine


@pytest.mark.parametrize("ratio", [1.0, 2.0, 7.3, 30.0])
def test_where_a_radian_is_a_metre_registers_and_tables_are_the_same(load_text, ratio):
    made = []
    for turns in (False, True):
        speeds = [f"{D}.{key}={20 / ratio} {'rad' if turns else 'm'}/s" for key in ("limits.speed", "zone.slow.speed")]
        spec = load_text(text_of(turns=turns, ratio=ratio), *(speeds if ratio > 1 else ())).spec
        tables = make_tables(spec.stepper["dial"])
        p = build_stepper(spec, "dial", tables)
        made.append((bytes(p), tables.up.entries.tobytes(), tables.down.entries.tobytes(), tables.ramp.hz.tobytes()))
    assert made[0] == made[1]


def test_it_makes_the_same_moves(load_text):
    job = StageJob("moves", "moves", (
        StageMove(1, 1, targets={"dial": 1.5}),
        StageMove(2, 2, targets={"dial": 0.2}, turn=2.0),
        StageMove(3, 3, by={"dial": 2.0}, change=StopChange(0.5, 1.0)),
        StageJog(4, 4, "dial", -3.0, 0.05),
    ), ("dial",))  # fmt: skip
    slides, turns = (run_stage(load_text(text_of(turns=turns)).spec, job) for turns in (False, True))
    assert slides.done
    assert slides.to_dict()["moves"] == turns.to_dict()["moves"]
    assert slides.lost == turns.lost


def test_a_gear_divides_the_step_and_by_its_square_the_load(load_text):
    plain_dial, geared = (load_text(text_of(turns=True, ratio=ratio)).spec.stepper["dial"] for ratio in (1, 10))
    assert plain_dial.step == 2 * math.pi / 200
    assert geared.step == pytest.approx(plain_dial.step / 10, rel=1e-15)
    # 250 g m^2 behind the gear, 3 g cm^2 of the gear itself at the shaft
    assert plain_dial.mechanics.inertia == pytest.approx(250e-6 + 3e-7)
    assert geared.mechanics.inertia == pytest.approx(2.5e-6 + 3e-7)


# ---- what is said of it


@pytest.mark.parametrize(
    "overrides",
    [
        ("limits.speed=1.2 rad/s", "zone.slow.speed=1.2 rad/s"),
        ("extremes.turn=0.6 rad", "zone.slow.end=1.05 rad"),
        ("drive.microsteps=64", "mechanics.friction_torque=60 mN*m", "limits.speed=10 rad/s"),
    ],
)
def test_figures_and_cautions_are_in_degrees(load_text, overrides):
    spec = load_text(text_of(turns=True), *(f"{D}.{one}" for one in overrides)).spec
    figures = {figure.name: figure for figure in derive(spec)}
    assert figures["dial: step"].text == ("0.02813 deg" if spec.stepper["dial"].drive.microsteps > 1 else "1.8 deg")
    assert figures["dial: step"].unit == "rad"
    assert figures["dial: step"].formula.startswith("1 turn / gear ratio")
    assert "load / gear ratio^2" in figures["dial: inertia J"].formula
    slides = load_text(text_of(turns=False), *(f"{D}.{one.replace('rad', 'm')}" for one in overrides)).spec
    assert lengths_in(" ".join(figure.text for figure in derive(slides)))
    cautions = list(map(str, find_cautions(spec)))
    assert cautions
    told = [text for f in figures.values() for text in (f.text, f.formula)] + cautions
    assert [found for text in told for found in lengths_in(text)] == []


@pytest.mark.parametrize(
    ("override", "allowed", "remedy"),
    [
        ("limits.travel=1 mrad", "at least one step, 1.8 deg", 'limits.travel = "1.8 deg"'),
        ("limits.travel=1000 rad", "", ""),
        ("limits.speed=1 mrad/s", "from 1.8 deg/s to", 'limits.speed = "1.8 deg/s"'),
        ("mechanics.start_position=5 rad", "from -28.65 deg to 171.9 deg", 'start_position = "171.8873 deg"'),
        ("extremes.turn=0.1 rad", "by a step of 1.8 deg", "extremes.turn"),
        ("zone.slow.end=0.5 rad", "above the zone's begin, 57.3 deg", "zone.slow.end"),
        ("zone.slow.begin=-30 deg", "on the travel, from -28.65 deg to 171.9 deg", 'slow.begin = "-28.64788 deg"'),
        ("zone.slow.speed=30 rad/s", "up to limits.speed, 1146 deg/s", "zone.slow.speed"),
        ("zone.slow.speed=1 deg/s", "at least the speed of the start frequency", "zone.slow.speed"),
        ("limits.acceleration=1 rad/s^2", "entries or fewer", "limits."),
    ],
)
def test_contradictions_are_told_in_degrees(load_text, override, allowed, remedy):
    if not allowed:
        assert load_text(text_of(turns=True), f"{D}.{override}").spec.stepper["dial"].limits.travel == 1000.0
        return
    with pytest.raises(InputError) as caught:
        load_text(text_of(turns=True), f"{D}.{override}")
    problems = caught.value.problems
    assert any(allowed in one.allowed and remedy in one.remedy for one in problems), problems
    assert lengths_in(" ".join(map(str, problems))) == []


@pytest.mark.parametrize("place", ["60 deg", "90 deg", "57 deg", "33 deg"])
def test_a_remedy_names_round_degrees(load_text, place):
    with pytest.raises(InputError) as caught:
        load_text(text_of(turns=True), *(f"{D}.{one}" for one in (
            "zone.slow.end=150 deg", "zone.slow.begin=100 deg", f"limits.travel={place}", "mechanics.lower_end=0 deg",
            "extremes.stop=0 deg",
        )))  # fmt: skip
    remedies = " ".join(one.remedy for one in caught.value.problems)
    assert not re.search(r"\d\.\d{3,} deg", remedies)


@pytest.mark.parametrize(
    ("overrides", "name"),
    [
        (("mechanics.friction_torque=60 mN*m",), "friction"),
        (("extremes.turn=0.6 rad", "zone.slow.speed=4 rad/s"), "way between extremes.stop and extremes.turn"),
        (("drive.microsteps=64", "mechanics.friction_torque=20 mN*m", "limits.speed=10 rad/s"), "drive.microsteps"),
    ],
)
def test_a_caution_names_a_value_that_would_do(load_text, overrides, name):
    def look(*more):
        return {one.name: one for one in find_cautions(load_text(text_of(turns=True), *more).spec)}

    given = [f"{D}.{one}" for one in overrides]
    check_caution(look, given, f"dial: {name}", look(*given)[f"dial: {name}"], at_bound=False)


# ---- files that say so


@pytest.mark.parametrize(
    ("edit", "key", "allowed", "remedy"),
    [
        (('"20 rad/s"', '"20 mm/s"'), "limits.speed", "an angular velocity", f'or set {D}.motion = "linear"'),
        (('"3.5 rad"', '"3.5 mm"'), "limits.travel", "an angle", '"5 deg"'),
        (('"150 rad/s^2"', '"1 m/s^2"'), "limits.acceleration", "an angular acceleration", '"300 deg/s^2"'),
        (('"1.3 rad"', '"13 mm"'), "zone.slow.end", "an angle", '"5 deg"'),
        (("gear_ratio = 1.0", 'travel_per_revolution = "1 mm"'), "mechanics.travel_per_revolution", "gear_ratio",
         f'or set {D}.motion = "linear"'),
        (("load_inertia", "moving_mass"), "mechanics.moving_mass", "load_inertia", f'or set {D}.motion = "linear"'),
        (('"0.00025 kg*m^2"', '"2 kg"'), "mechanics.load_inertia", "a moment of inertia", "g*cm^2"),
    ],
)  # fmt: skip
def test_lengths_of_a_motor_that_turns_are_refused(load_text, edit, key, allowed, remedy):
    with pytest.raises(InputError) as caught:
        load_text(text_of(turns=True).replace(*edit))
    (problem,) = (one for one in caught.value.problems if one.key == f"{D}.{key}")
    assert allowed in problem.allowed
    assert remedy in problem.remedy


@pytest.mark.parametrize(
    ("edit", "key"),
    [(('"20 m/s"', '"20 deg/s"'), "limits.speed"), (('"3.5 m"', '"90 deg"'), "limits.travel"),
     (("moving_mass", "load_inertia"), "mechanics.load_inertia")],
)  # fmt: skip
def test_angles_of_a_motor_that_slides_are_refused_with_the_word_that_makes_it_turn(load_text, edit, key):
    with pytest.raises(InputError) as caught:
        load_text(text_of(turns=False).replace(*edit))
    problem = next(one for one in caught.value.problems if one.key == f"{D}.{key}")
    assert f'or set {D}.motion = "rotary"' in problem.remedy


def test_the_key_of_another_method_says_where_it_belongs(load_text):
    text = text_of(turns=True).replace('"stepper_envelope"', '"stepper_envelope"\nmotion = "rotary"')
    with pytest.raises(InputError) as caught:
        load_text(text)
    (problem,) = caught.value.problems
    assert (problem.key, problem.remedy) == ("axis.motion", "move it to [stepper.NAME]")
    with pytest.raises(InputError) as caught:
        load_text(text_of(turns=True), "axis.motion=rotary")
    assert caught.value.problems[0].remedy == f'did you mean "{D}.motion"?'


def test_an_override_makes_it_turn(load_text):
    gear = (f"{D}.motion=rotary", f"{D}.mechanics.gear_ratio=4", f"{D}.limits.speed=90 deg/s")
    text = text_of(turns=True).replace('motion = "rotary"\n', "").replace("gear_ratio = 1.0\n", "")
    table = load_text(text, *gear, f"{D}.zone.slow.speed=80 deg/s", f"{D}.drive.start_safety=20").spec.stepper["dial"]
    assert table.turns
    assert table.limits.speed == math.pi / 2
    assert table.mechanics.gear_ratio == 4


def test_numbers_of_a_program_are_in_radians(tmp_path):
    (tmp_path / "dial.toml").write_text(text_of(turns=True))
    axis = detent.load(tmp_path / "dial.toml").replace(**{f"{D}.limits.travel": 3.25})
    assert axis.spec.stepper["dial"].limits.travel == 3.25
    assert "186.2 deg" in {row.value for row in axis.check().rows}


def test_its_keys_are_told_with_their_units():
    rows = {row.key.rpartition("NAME.")[2]: row for row in key_rows(METHODS["stepper_envelope"].rotary)}
    assert {row.unit for row in rows.values()}.isdisjoint({"m", "m/s", "m/s^2", "kg", "N"})
    assert rows["limits.speed"].unit == "rad/s"
    assert "travel_per_revolution" not in " ".join(rows)
    assert not rows["mechanics.gear_ratio"].required


# ---- jobs


@pytest.fixture
def write(tmp_path):
    def write_job(name, content):
        (tmp_path / name).write_text(content)
        return tmp_path / name

    return write_job


PHI, MIXED = frozenset({"phi"}), ("phi", "x")
RIGHT = math.pi / 2


@pytest.mark.parametrize("header", ["phi [deg],x [mm]", "phi_deg,x_mm", "phi_deg_nominal,x [mm]"])
def test_places_in_a_list_are_in_degrees(write, header):
    (move,) = load_stage_job(write("job.csv", f"{header}\n90,12\n"), MIXED, PHI).moves
    assert move.targets == {"phi": RIGHT, "x": 0.012}


@pytest.mark.parametrize("header", ["phi [mm],x [mm]", "phi_mm,x [mm]", "phi [mm]", "phi_um"])
def test_places_in_millimetres_are_refused(write, header):
    with pytest.raises(InputError) as caught:
        load_stage_job(write("job.csv", f"{header}\n90,12\n"), MIXED, PHI)
    problem = caught.value.problems[0]
    assert "an angle" in problem.allowed
    assert "phi [deg]" in problem.remedy


TURN = """\
[[move]]
phi = "90 deg"
turn = "180 deg"
[[move]]
by = {phi = "5 deg"}
changed_at = "1 rad"
changed_to = "91 deg"
"""
JOGS = '[[move]]\njog = "phi"\nspeed = "-90 deg/s"\nduration = "1 s"\n'


@pytest.mark.parametrize("motors", [("phi",), MIXED])
def test_moves_and_manual_runs_are_in_degrees(write, motors):
    moves = load_stage_job(write("job.toml", TURN + JOGS), motors, PHI).moves
    assert moves[0].targets == {"phi": RIGHT}
    assert moves[0].turn == math.pi
    assert moves[1].by == {"phi": math.radians(5)}
    assert moves[1].change.at == 1.0
    assert moves[2].speed == -RIGHT


def test_beside_it_another_motor_keeps_its_lengths(write):
    text = '[[move]]\nx = "12 mm"\nturn = "20 mm"\n[[move]]\njog = "x"\nspeed = "3 mm/s"\nduration = "1 s"\n'
    moves = load_stage_job(write("job.toml", text), MIXED, PHI).moves
    assert (moves[0].turn, moves[1].speed) == (0.02, 0.003)


@pytest.mark.parametrize("motors", [("phi",), MIXED])
@pytest.mark.parametrize(
    ("row", "key", "allowed"),
    [
        ('phi = "9 mm"', "move.phi", "an angle"),
        ('by = {phi = "9 mm"}', "move.by.phi", "an angle"),
        ('phi = "9 deg"\nturn = "9 mm"', "move.turn", "an angle"),
        ('phi = "9 deg"\nturn = 9', "move.turn", "an angle"),
        ('phi = "9 deg"\nchanged_at = "8 mm"\nchanged_to = "9 deg"', "move.changed_at", "an angle"),
        ('jog = "phi"\nspeed = "9 mm/s"\nduration = "1 s"', "move.speed", "an angular velocity"),
        ('jog = "phi"\nspeed = "0 deg/s"\nduration = "1 s"', "move.speed", ""),
    ],
)
def test_lengths_in_a_job_are_refused(write, motors, row, key, allowed):
    with pytest.raises(InputError) as caught:
        load_stage_job(write("job.toml", f"[[move]]\n{row}\n"), motors, PHI)
    (problem,) = caught.value.problems
    assert problem.key == key
    assert problem.got
    assert allowed in problem.allowed


@pytest.mark.parametrize(
    ("row", "key", "does"),
    [
        ('x = "9 mm"\nturn = "9 deg"', "move.turn", "the motor x slides"),
        ('jog = "x"\nspeed = "9 deg/s"\nduration = "1 s"', "move.speed", "the motor x slides"),
        ('phi = "9 deg"\nturn = "9 mm"', "move.turn", "the motor phi turns"),
    ],
)
def test_the_unit_is_that_of_the_motor_that_the_move_names(write, row, key, does):
    with pytest.raises(InputError) as caught:
        load_stage_job(write("job.toml", f"[[move]]\n{row}\n"), MIXED, PHI)
    (problem,) = caught.value.problems
    assert (problem.key, problem.allowed.partition(": ")[2]) == (key, does)


def test_what_the_axis_cannot_do_is_told_in_degrees(dial):
    far = StageJob("far", "moves", (
        StageMove(1, 1, targets={"dial": 4.0}), StageMove(2, 2, targets={"dial": 1.0}, turn=2.0),
        StageMove(3, 3, targets={"dial": 0.1}, change=StopChange(2.0, 1.5)), StageJog(4, 4, "dial", 30.0, 1.0),
    ), ("dial",))  # fmt: skip
    with pytest.raises(InputError) as caught:
        run_stage(dial, far)
    assert len(caught.value.problems) == 4
    said = " ".join(map(str, caught.value.problems))
    assert lengths_in(said) == []
    assert "from -28.65 deg to 171" in said
    from_there = StageJob("far", "moves", (
        StageJog(1, 1, "dial", 3.0, 0.05), StageMove(2, 2, by={"dial": 3.2}),
    ), ("dial",))  # fmt: skip
    assert lengths_in(run_stage(dial, from_there).failure) == []
    assert "deg" in run_stage(dial, from_there).failure


# ---- reports, tables for firmware, comparisons


@pytest.fixture(scope="module")
def photo() -> Played:
    """Both motors of the example, a short way each: one that turns beside one that slides."""
    job = StageJob("short.csv", "tiles", (
        StageMove(1, 1, targets={"table": math.radians(10), "lift": 1e-3}, label="A"),
        StageMove(2, 2, targets={"table": math.radians(4)}, label="B"),
    ), ("table", "lift"))  # fmt: skip
    return play("photo_table.toml", job, "controller.settle_time=50 ms")


@pytest.fixture(scope="module")
def dials(tmp_path_factory) -> dict[bool, Played]:
    """The dial, and the same machine as one that slides."""
    job = StageJob("short.csv", "moves", (
        StageMove(1, 1, targets={"dial": 1.5}, label="A"), StageMove(2, 2, targets={"dial": 0.9}, turn=2.0),
        StageJog(3, 3, "dial", 3.0, 0.05), StageMove(4, 4, targets={"dial": 2.5}, change=StopChange(1.9, 1.92)),
    ), ("dial",))  # fmt: skip
    path = tmp_path_factory.mktemp("dial") / "dial.toml"
    made: dict[bool, Played] = {}
    for turns in (False, True):
        path.write_text(text_of(turns=turns))
        made[turns] = play(path, job)
    return made


def parts_of(spec, run, trace) -> dict[str, str]:
    """What is said of a run: on every part of its page, in the terminal, as its warnings."""
    compared = (*compare_steps(spec), compare_jerk(spec))
    page = stage_page(spec, run, trace, compared)
    parts = {section.title: str(section) for section in page.sections}
    parts["summary"] = str(stage_summary_rows(spec, run))
    parts["compared"] = str([(one.table.title, one.table.rows) for one in compared])
    return parts | {"warnings": " ".join(run.warnings)}


@pytest.mark.compiled
def test_a_report_of_a_motor_that_turns_has_no_lengths(dials):
    slides, turns = (parts_of(*dials[turns]) for turns in (False, True))
    assert list(slides) == list(turns)
    assert all(lengths_in(said) for said in slides.values()), "each part has some where the motor slides"
    assert {part: lengths_in(said) for part, said in turns.items()} == {part: [] for part in turns}
    assert all("deg" in said for said in turns.values())


@pytest.mark.compiled
def test_a_report_of_both_kinds_names_the_unit_of_each(photo):
    spec, run, trace = photo
    page = stage_page(spec, run, trace)
    assert run.done
    labels = " ".join(str(chart) for chart in page.charts)
    assert "table [deg]" in labels
    assert "lift [mm]" in labels
    table = next(figure for section in page.sections for figure in section.figures if figure.title.startswith("Every"))
    heads = [head for head, *_ in table.table.heads]
    assert {"from", "to", "way"} <= set(heads)
    cells = str(table.table.rows)
    assert "10.000\u202fdeg" in cells or "10.000\\u202fdeg" in cells
    assert "1.000\u202fmm" in cells or "1.000\\u202fmm" in cells
    assert dict(stage_summary_rows(spec, run))["peak"].count("/s") == 2
    assert tile_plan(StageFigures(spec, run)) is None  # degrees and millimetres have no scale in common


def test_the_example_is_sound_and_its_job_is_one_of_it():
    spec = load_spec(detent.example("photo_table.toml"))
    assert list(find_cautions(spec)) == []
    assert spec.turning == {"table"}
    job = METHODS["stepper_envelope"].load(spec, detent.example("photo_places.csv"))
    assert job.moves[2].targets == {"table": math.pi, "lift": 0.05}
    assert METHODS["stepper_envelope"].sample_job(spec).moves[0].targets["table"] == pytest.approx(math.radians(5))


def test_tables_for_firmware_are_in_radians_and_degrees(dial, tmp_path):
    tables = envelope_tables(dial, "dial")
    header = Envelope(tables).save(tmp_path / "dial.h").read_text()
    assert "111 steps of 1.8 deg: 199.8 deg; boundary 0 lies at -28.6479 deg" in header
    first, second, *_ = Envelope(tables).save(tmp_path / "dial.csv").read_text().splitlines()
    assert first.split(",")[1] == "position [rad]"
    assert float(second.split(",")[1]) == -0.5
    assert Envelope(tables).to_dict()["motion"] == "rotary"


def test_a_figure_of_the_tables_is_in_degrees(dial, tmp_path, monkeypatch):
    from contextlib import contextmanager

    from matplotlib.figure import Figure

    from detent.methods.stepper_envelope import envelope_files

    kept = Figure()
    monkeypatch.setattr(envelope_files, "new_figure", contextmanager(lambda *_, **__: iter([kept])))
    envelope_files.plot_envelope(envelope_tables(dial, "dial"), tmp_path / "dial.png")
    (area,) = kept.axes
    top, right = area.child_axes
    kept.draw_without_rendering()
    assert top.get_xlabel() == "position [deg]"
    assert right.get_ylabel() == "speed [deg/s], 1.8 deg a step"
    assert np.allclose(top.get_xlim(), (math.degrees(-0.5), math.degrees(-0.5) + 199.8))
