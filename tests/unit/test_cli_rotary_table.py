"""The commands on the rotary table: check, run, compare, timing, registers, and what they refuse."""

import re
from pathlib import Path

import pytest
from tests.unit.test_cli import call
from tests.vcd_reader import load_vcd

import detent
from detent.methods.rotary_table.run import SEQUENCE_SIGNALS
from detent.record.trace_files import load_trace

pytestmark = pytest.mark.compiled

TABLE, SEQUENCE = str(detent.example("rotary_table.toml")), str(detent.example("index_sequence.toml"))


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_the_example_is_without_warnings() -> None:
    answer = call("check", TABLE)
    assert answer.status == 0
    assert answer.out.splitlines()[-1] == "no warnings"
    assert re.search(r"^position\.4\.angle +10 deg ", answer.out, flags=re.MULTILINE)


def test_run_does_the_sequence_and_leaves_report_and_trace() -> None:
    answer = call("run", TABLE, "--job", SEQUENCE, "-o", "out")
    assert answer.status == 0, answer.out
    assert answer.out.splitlines()[0] == "index_sequence.toml: every step was done on rotary table."
    assert {path.name for path in Path("out").iterdir()} == {"report.html", "trace.h5", "trace.csv"}
    assert set(load_trace(Path("out/trace.h5")).signals) >= set(SEQUENCE_SIGNALS)
    report = Path("out/report.html").read_text(encoding="utf-8")
    assert "index_sequence.toml" in report
    data = call("run", TABLE, "--job", SEQUENCE, "--json", "--no-compare", "--every", "0").data
    assert data["done"] is True
    assert {step["kind"] for step in data["steps"]} == {"go", "jog", "wait", "output"}


def test_the_literal_form_thrown_back_is_status_1_with_the_reason() -> None:
    Path("jog.toml").write_text('[[step]]\njog = "+"\nspeed = "60 deg/s"\nfor = "10 s"\n', encoding="utf-8")
    literal = ["method.form=flag", *(f"position.{n}.direction=as commanded" for n in range(5))]
    changes = [word for text in (*literal, "mechanics.start_angle=0.5 deg") for word in ("--set", text)]
    answer = call("run", TABLE, "--job", "jog.toml", "--every", "0", "--no-compare", *changes)
    assert answer.status == 1, answer.out
    assert answer.out.startswith("Not done: ")
    assert call("run", TABLE, "--job", "jog.toml", "--every", "0", "--no-compare").status == 0


def test_compare_shows_the_conventional_unit_and_manual_feed() -> None:
    data = call("compare", TABLE, "--json", "--figure", "angle.png").data
    assert len(data["comparisons"]) == 1
    assert Path("angle.png").read_bytes().startswith(b"\x89PNG")
    assert call("compare", TABLE, "--figure", "angle.svg").status == 0


def test_timing_and_registers() -> None:
    answer = call("timing", TABLE, "--at", "30 ms", "--figure", "t.png", "--vcd", "t.vcd")
    assert answer.status == 0, answer.err
    assert len(load_vcd(Path("t.vcd")).signals) >= 10
    assert re.search(r"^controller\.positioner\.oar +i8 +count ", call("registers", TABLE).out, flags=re.MULTILINE)


BAD = {
    "a gear that is no whole number": (["check", TABLE, "--set", "mechanics.gear_ratio=90.5"], "mechanics.gear_ratio"),
    "a position number too large": (["check", TABLE, "--set", "position.128.angle=5 deg"], "from 0 to 127"),
    "a list of moves": (["run", TABLE, "--job", str(detent.example("moves.csv"))], "moves.csv"),
    "no such position": (["run", TABLE, "--job", "go.toml"], r"go\.toml:1:1 step\.go: .* 0 to 4"),
    "an axis without tables of steps": (["envelope", TABLE], "stepper_envelope"),
}


@pytest.mark.parametrize("case", BAD)
def test_wrong_input_is_one_message_and_status_2(case: str) -> None:
    Path("go.toml").write_text("[[step]]\ngo = 99\n", encoding="utf-8")
    words, expected = BAD[case]
    answer = call(*words)
    assert answer.status == 2, answer.out
    assert re.search(expected, answer.err), answer.err
    assert "Traceback" not in answer.err
