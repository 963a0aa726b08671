"""The commands on the two servo axes: run, compare, timing, registers, and what they refuse."""

import re
from pathlib import Path

import pytest
from tests.unit.test_cli import call
from tests.vcd_reader import load_vcd

import detent
from detent.methods.filtered_servo.method import SIGNALS as FILTERED_SIGNALS
from detent.methods.phase_servo.method import SIGNALS as PHASE_SIGNALS
from detent.record.trace_files import load_trace

pytestmark = pytest.mark.compiled

PHASE, FILTERED = str(detent.example("phase_servo.toml")), str(detent.example("filtered_servo.toml"))
MOVES, SLIDE = str(detent.example("moves.csv")), str(detent.example("slide_moves.toml"))
BURST = [word for text in ("kind=+", "at=30 ms", "count=30") for word in ("--set", f"disturbance.lines.burst.{text}")]


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(
    ("axis", "job", "signals"), [(PHASE, MOVES, PHASE_SIGNALS), (FILTERED, SLIDE, FILTERED_SIGNALS)]
)
def test_run_makes_the_moves_and_leaves_report_and_trace(axis: str, job: str, signals: tuple[str, ...]) -> None:
    answer = call(
        "run",
        axis,
        "--job",
        job,
        "-o",
        "out",
        "--signals",
        "plant.encoder.edge" if axis == FILTERED else "controller.wake",
        "--trace",
        "h5,csv",
    )
    assert answer.status == 0, answer.out
    assert ": every move arrived on " in answer.out.splitlines()[0]
    assert {path.name for path in Path("out").iterdir()} == {"report.html", "trace.h5", "trace.csv"}
    assert set(load_trace(Path("out/trace.h5")).signals) >= set(signals)
    report = Path("out/report.html").read_text(encoding="utf-8")
    assert "<title>" in report
    assert Path(job).name in report


def test_a_move_that_ends_a_pitch_off_is_status_1_with_the_reason() -> None:
    answer = call("run", PHASE, "--job", MOVES, "--every", "0", "--no-compare", *BURST)
    assert answer.status == 1
    assert answer.out.startswith("Not done: move 2 to 5.08 mm: ")
    assert "on the positioning point 1 pitch off" in answer.out
    data = call("run", PHASE, "--job", MOVES, "--every", "0", "--no-compare", "--json", *BURST)
    assert data.status == 1
    assert data.data["done"] is False
    assert data.data["faults"]["inserted"] == 30


def test_a_run_as_json_has_every_move() -> None:
    data = call("run", FILTERED, "--job", SLIDE, "--json", "--no-compare", "-o", "out").data
    assert len(data["moves"]) == 24
    assert set(data["moves"][0]) == {
        "number", "label", "begin", "start", "target", "switched", "ready", "settled", "end", "overshoot", "error",
        "peak_speed",
    }  # fmt: skip
    assert data["moves"][0]["switched"] is None


def test_a_text_runs_as_character_positions() -> None:
    Path("line.txt").write_text("the quick brown fox", encoding="utf-8")
    answer = call("run", PHASE, "--job", "line.txt", "--no-compare")
    assert answer.status == 0, answer.out
    assert "characters           16 of 16" in answer.out
    assert re.search(r"time +\d\.\d+ s, \d+(\.\d+)? characters per second", answer.out), answer.out


def test_compare_shows_what_pulses_do_and_how_it_stands() -> None:
    answer = call("compare", PHASE, "--figure", "noise.svg")
    assert answer.status == 0
    assert "Where a move of 6 pitches ends" in answer.out
    assert "At rest" in answer.out
    assert Path("noise.svg").stat().st_size > 1000
    assert Path("noise-2.svg").stat().st_size > 1000


def test_compare_shows_four_ways_of_speed_feedback() -> None:
    data = call("compare", FILTERED, "--json", "--figure", "feedback.png").data
    (found,) = data["comparisons"]
    assert len(found["cases"]) == 4
    assert data["files"] == ["feedback.png"]
    text = call("compare", FILTERED).out
    assert "At 1037 pulses/s" in text
    assert "gain margin" in text


@pytest.mark.parametrize(("axis", "at"), [(PHASE, "6 ms"), (FILTERED, "30 ms")])
def test_timing_draws_and_writes_signals_that_read_back(axis: str, at: str) -> None:
    answer = call("timing", axis, "--at", at, "--figure", "t.png", "--vcd", "t.vcd")
    assert answer.status == 0
    assert answer.out.splitlines() == ["figure: t.png", "VCD: t.vcd"]
    assert Path("t.png").read_bytes().startswith(b"\x89PNG")
    assert len(load_vcd(Path("t.vcd")).signals) >= 16


def test_timing_takes_a_job_a_length_and_signals() -> None:
    words = ("--job", MOVES, "--at", "40 ms", "--for", "12 us", "--signals", "lines.ps,controller.law.*")
    data = call("timing", PHASE, *words, "--json").data
    assert data["signals"][:3] == ["controller.clocks.CK1", "controller.clocks.CK2", "lines.ps"]
    found = load_vcd(Path("timing.vcd"))
    assert (found.begin, found.end) == (0, 12_000_000) or found.end - found.begin <= 12_000_000


@pytest.mark.parametrize("name", ["phase_servo", "filtered_servo", PHASE])
def test_registers_are_listed_by_method_or_file(name: str) -> None:
    answer = call("registers", name)
    assert answer.status == 0
    assert re.search(r"^(plant\.)?train\.position +f8 +m ", answer.out, flags=re.MULTILINE)
    assert call("registers", name, "--json").data[0]["name"] == "tick"


BAD = {
    "a text for a slide": (["run", FILTERED, "--job", "line.txt"], "line.txt"),
    "a move beyond the end": (["run", PHASE, "--job", "far.csv"], r"far\.csv:2:1 target: got 500 mm; expected: .* 355"),
    "off the grid": (["run", PHASE, "--job", "off.csv"], "move to a positioning point"),
    "too fast for the tracker": (["check", PHASE, "--set", "limits.speed=0.5 m/s"], "limits.speed"),
    "a threshold that breaks the protection": (["check", PHASE, "--set", "method.threshold=15"], "threshold"),
    "a coefficient of no filter": (["check", FILTERED, "--set", "method.coefficient=1.5"], "method.coefficient"),
    "timing: no time": (["timing", PHASE, "--at", "5"], "--at: got '5'"),
    "timing: too late": (["timing", PHASE, "--at", "9 s"], "the run ends before"),
    "timing: too long": (["timing", PHASE, "--at", "1 ms", "--for", "1 s"], "up to 50 ms"),
    "timing: no picture": (["timing", PHASE, "--at", "1 ms", "--figure", "a.txt"], "cannot be saved as '.txt'"),
    "timing: no signal": (
        ["timing", PHASE, "--at", "1 ms", "--signals", "controller.law.wrod"],
        "did you mean 'controller.law.word'",
    ),
    "registers: no method": (["registers", "robot"], "rotary_table, stepper_envelope, or an axis"),
}


@pytest.mark.parametrize("name", BAD)
def test_wrong_input_is_one_message_and_status_2(name: str) -> None:
    Path("line.txt").write_text("abc", encoding="utf-8")
    Path("far.csv").write_text("target [mm]\n500\n", encoding="utf-8")
    Path("off.csv").write_text("target [mm]\n10\n", encoding="utf-8")
    words, pattern = BAD[name]
    answer = call(*words)
    assert answer.status == 2
    assert answer.out == ""
    assert re.search(pattern, answer.err), answer.err
    assert "Traceback" not in answer.err


def test_more_signals_than_a_picture_takes_are_in_the_vcd_file_all_the_same() -> None:
    answer = call("timing", PHASE, "--at", "6 ms", "--for", "10 us", "--signals", "*")
    assert answer.status == 2
    assert "name those that matter, or look at all of them in a VCD file" in answer.err
    assert len(load_vcd(Path("timing.vcd")).signals) > 80
