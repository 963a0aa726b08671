"""The commands on stepper axes: check, run, compare, timing, envelope, registers, and what they refuse."""

import re
from pathlib import Path

import pytest
from tests.unit.test_cli import call
from tests.vcd_reader import load_vcd

import detent
from detent.record.trace_files import load_trace

pytestmark = pytest.mark.compiled

ZOOM, STAGE = str(detent.example("zoom.toml")), str(detent.example("stage.toml"))
SEQUENCE, TILES = str(detent.example("zoom_sequence.toml")), str(detent.example("tiles.csv"))


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("axis", [ZOOM, STAGE])
def test_the_examples_are_without_warnings(axis: str) -> None:
    answer = call("check", axis)
    assert answer.status == 0
    assert answer.out.splitlines()[-1] == "no warnings"


def test_a_motor_of_the_catalogue_gives_its_constants_to_each_motor_that_names_it() -> None:
    rows = {row["key"]: row for row in call("check", STAGE, "--json").data["rows"]}
    for name in ("x", "y"):
        assert rows[f"stepper.{name}.motor.holding_torque"]["origin"].startswith("catalogue Trinamic")


@pytest.mark.parametrize(("axis", "job"), [(ZOOM, SEQUENCE), (STAGE, TILES)])
def test_run_does_the_job_and_leaves_report_and_trace(axis: str, job: str) -> None:
    answer = call("run", axis, "--job", job, "-o", "out")
    assert answer.status == 0, answer.out
    assert answer.out.splitlines()[0].endswith("no step was lost.")
    assert {path.name for path in Path("out").iterdir()} == {"report.html", "trace.h5", "trace.csv"}
    name = "group_b" if axis == ZOOM else "y"
    assert f"{name}.plant.rotor.lag" in load_trace(Path("out/trace.h5")).signals
    assert Path(job).name in Path("out/report.html").read_text(encoding="utf-8")


def test_lost_steps_are_status_1_with_the_reason() -> None:
    """The literal rule is safe from a start extreme only: a run by hand from mid-range jumps to full speed."""
    words = ("--set", "stepper.group_b.method.rule=literal", "--every", "0", "--no-compare")
    answer = call("run", ZOOM, "--job", SEQUENCE, *words)
    assert answer.status == 1, answer.out
    assert re.match(r"Not done: move 10: motor group_b lost \d+ steps", answer.out)
    data = call("run", ZOOM, "--job", SEQUENCE, "--json", *words).data
    assert data["lost"]["group_b"] != 0
    assert data["lost"]["group_a"] == 0
    assert len(data["moves"]) == 11


def test_compare_shows_methods_per_motor_and_the_smooth_profile() -> None:
    data = call("compare", ZOOM, "--json", "--figure", "steps.png").data
    assert data["files"] == ["steps.png", "steps-2.png", "steps-3.png"]
    assert [found.get("motor") for found in data["comparisons"]] == ["group_a", "group_b", "group_a"]
    text = call("compare", ZOOM, "--figure", "steps.svg").out
    assert "envelope" in text


def test_timing_and_registers_know_the_motors_by_name() -> None:
    words = ("--signals", "group_a.controller.timer.*,group_b.controller.rule.index", "--for", "2 ms")
    answer = call("timing", ZOOM, "--at", "10 ms", *words, "--figure", "t.png", "--vcd", "t.vcd")
    assert answer.status == 0, answer.err
    found = load_vcd(Path("t.vcd"))
    assert "group_b.controller.rule.index" in [signal.name for signal in found.signals]
    assert re.search(r"^group_b\.plant\.rotor\.lag +f8 ", call("registers", ZOOM).out, flags=re.MULTILINE)
    assert re.search(r"^plant\.rotor\.lag +f8 ", call("registers", "stepper_envelope").out, flags=re.MULTILINE)


def test_envelope_writes_table_header_and_figure_of_each_motor() -> None:
    answer = call("envelope", ZOOM)
    assert answer.status == 0, answer.err
    folder = Path("envelope/zoom")
    kinds = ("csv", "h", "png")
    assert {path.name for path in folder.iterdir()} == {f"group_{m}.{kind}" for m in "ab" for kind in kinds}
    assert (folder / "group_a.csv").read_text(encoding="utf-8").count("\n") == 8001
    assert "#define GROUP_A_STEPS INT32_C(8000)" in (folder / "group_a.h").read_text(encoding="utf-8")
    data = call("envelope", ZOOM, "--motor", "group_b", "-o", "one", "--json").data
    assert list(data) == ["group_b"]
    assert data["group_b"]["steps"] == 6000
    assert len(list(Path("one").iterdir())) == 3


BAD = {
    "no such motor": (["envelope", ZOOM, "--motor", "c"], "--motor: got 'c'; expected: group_a, group_b"),
    "a folder that is a file": (["envelope", ZOOM, "-o", "file/x"], "cannot be written"),
    "a zone below the start frequency": (
        ["check", ZOOM, "--set", "stepper.group_b.zone.fine.speed=1 mm/s"],
        r"stepper\.group_b\.zone\.fine\.speed",
    ),
    "a torque that never reaches the speed": (
        ["check", ZOOM, "--set", "stepper.group_a.limits.speed=40 mm/s"],
        r"stepper\.group_a\.limits\.speed",
    ),
    "a motor named as a job's word": (["check", "tick.toml"], 'the name "tick"'),
    "a place beyond the travel": (["run", STAGE, "--job", "far.csv"], r"far\.csv:2"),
    "an unknown motor in a job": (["run", STAGE, "--job", SEQUENCE], "group_a"),
    "signals of no motor": (["run", STAGE, "--job", TILES, "--signals", "z.plant.rotor.lag"], "z.plant.rotor.lag"),
}


@pytest.mark.parametrize("case", BAD)
def test_wrong_input_is_one_message_and_status_2(case: str) -> None:
    Path("far.csv").write_text("x [mm],y [mm]\n500,0\n", encoding="utf-8")
    Path("file").write_text("", encoding="utf-8")
    Path("tick.toml").write_text(Path(ZOOM).read_text(encoding="utf-8").replace("group_b", "tick"), encoding="utf-8")
    words, expected = BAD[case]
    answer = call(*words)
    assert answer.status == 2, answer.out
    assert re.search(expected, answer.err), answer.err
    assert "Traceback" not in answer.err
