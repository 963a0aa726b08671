"""The commands on cascade axes: moves, recordings replayed, the comparison, and what is refused."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from tests.unit.test_cli import call

import detent
from detent.methods.cascade.run import CASCADE_SIGNALS
from detent.record.trace_files import load_trace

pytestmark = pytest.mark.compiled

CASCADE, TURNTABLE = str(detent.example("cascade.toml")), str(detent.example("turntable.toml"))
SLIDE, TURN = str(detent.example("slide_moves.toml")), str(detent.example("turn_moves.csv"))
RUN = ("run", CASCADE, "--job", SLIDE, "--no-compare")
PLAIN = ("run", CASCADE, "--every", "0")


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def write_log(name: str = "log.csv", *, unit: str = "mm", scale: float = 1e3) -> str:
    """A recording of a slide that goes to and fro, 2 s at 1 kHz."""
    t = np.arange(2000) * 1e-3
    position = scale * (0.1 + 0.02 * np.sin(3 * t) * np.minimum(t, 1.0))
    rows = [f"{a:.3f},{b:.6f},{b:.6f},{np.cos(3 * a):.4f}" for a, b in zip(t, position, strict=True)]
    head = f"time [s],setpoint [{unit}],position [{unit}],u [V]"
    Path(name).write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return name


@pytest.mark.parametrize(("axis", "job", "unit"), [(CASCADE, SLIDE, "m"), (TURNTABLE, TURN, "rad")])
def test_run_makes_the_moves_and_leaves_report_and_trace(axis: str, job: str, unit: str) -> None:
    answer = call("run", axis, "--job", job, "-o", "out", "--signals", "lines.motor.count")
    assert answer.status == 0, answer.out
    assert ": every move was in position on " in answer.out.splitlines()[0]
    assert {path.name for path in Path("out").iterdir()} == {"report.html", "trace.h5", "trace.csv"}
    trace = load_trace(Path("out/trace.h5"))
    assert set(trace.signals) >= {*CASCADE_SIGNALS, "lines.motor.count"}
    assert trace.units["plant.machine.load.position"] == unit
    report = Path("out/report.html").read_text(encoding="utf-8")
    assert "Effect of profile and feedforward" in report


def test_the_same_run_leaves_the_same_bytes() -> None:
    for folder in ("a", "b"):
        assert call(*RUN, "-o", folder, "--trace", "csv").status == 0
    assert Path("a/trace.csv").read_bytes() == Path("b/trace.csv").read_bytes()


def test_a_run_as_json_has_every_move() -> None:
    data = call(*RUN, "--every", "0", "--json").data
    assert len(data["moves"]) == 24
    assert data["done"] is True
    assert data["time_off"] is None
    assert data["moves"][0]["in_position"] is True


def test_a_drive_that_goes_off_is_status_1_with_the_reason() -> None:
    wrong = ("--set", "method.following_error=15 um", "--set", "method.in_position=5 um")
    answer = call(*RUN, *wrong)
    assert answer.status == 1
    assert answer.out.startswith("Not done: move 1 to 120 mm: the following error exceeded 15 um")
    data = call(*RUN, "--every", "0", "--json", *wrong)
    assert data.status == 1
    assert data.data["time_off"] > 0
    assert data.data["moves"][0]["ready"] is None


def test_a_recording_is_replayed_and_compared() -> None:
    answer = call("run", CASCADE, "--replay", write_log(), "-o", "out")
    assert answer.status == 0, answer.err
    lines = answer.out.splitlines()
    assert lines[0] == "log.csv: replayed on cascade axis."
    assert lines[1].split() == [
        "recording",
        "2.00",
        "s,",
        "2",
        "000",
        "samples,",
        "along",
        "the",
        "recorded",
        "reference",
    ]
    assert re.search(r"^  position +rms \d", answer.out, flags=re.MULTILINE)
    assert re.search(r"^  voltage +rms \d", answer.out, flags=re.MULTILINE)
    assert "note: guessed: " in answer.out
    assert {path.name for path in Path("out").iterdir()} == {"report.html", "trace.h5", "trace.csv"}
    report = Path("out/report.html").read_text(encoding="utf-8")
    assert "Recorded and simulated" in report
    assert "Effect of profile" not in report


def test_a_replay_as_json_has_each_signal() -> None:
    data = call(*PLAIN, "--replay", write_log(), "--json").data
    assert [one["signal"] for one in data["compared"]] == ["position", "velocity", "acceleration", "voltage"]
    assert data["open_loop"] == ""
    assert data["compared"][0]["unit"] == "m"


def test_without_a_reference_the_recorded_voltage_drives_the_axis() -> None:
    data = call(*PLAIN, "--replay", write_log(), "--column", "reference=", "--json").data
    assert data["open_loop"] == "voltage"
    assert data["peak_following"] is None


def test_a_mapping_file_says_what_the_columns_are() -> None:
    text = (
        Path(write_log()).read_text(encoding="utf-8").replace("time [s],setpoint [mm],position [mm],u [V]", "a,b,c,d")
    )
    Path("plain.csv").write_text(text, encoding="utf-8")
    Path("map.toml").write_text(
        '[columns]\ntime = "a [s]"\nreference = "b [mm]"\nposition = "c [mm]"\ncurrent = {column = "d", unit = "A"}\n',
        encoding="utf-8",
    )
    data = call(*PLAIN, "--replay", "plain.csv", "--map", "map.toml", "--json").data
    assert data["compared"][-1]["signal"] == "current"


def test_the_own_trace_of_an_axis_can_be_replayed() -> None:
    assert call(*RUN, "-o", "own", "--trace", "csv").status == 0
    answer = call(*PLAIN, "--replay", "own/trace.csv", "--column", "voltage=controller.law.command", "--json")
    found = {one["signal"]: one for one in answer.data["compared"]}
    assert found["position"]["peak"] < 1e-5
    assert found["position of the load"]["peak"] < 1e-5


def test_compare_shows_a_move_in_four_ways() -> None:
    answer = call("compare", CASCADE, "--figure", "profiles.svg")
    assert answer.status == 0
    assert "A move of 250 mm at 500 mm/s, in four variants" in answer.out
    assert answer.out.count("feedforward") == 4
    assert Path("profiles.svg").stat().st_size > 1000
    data = call("compare", TURNTABLE, "--json").data
    assert len(data["comparisons"][0]["cases"]) == 4


def test_timing_and_registers_know_the_axis() -> None:
    assert call("timing", CASCADE, "--at", "60 ms", "--for", "2 ms").status == 0
    assert re.search(r"^controller\.law\.command +f8 +V ", call("registers", "cascade").out, flags=re.MULTILINE)
    assert re.search(r"^plant\.machine\.load\.position +f8 +rad ", call("registers", TURNTABLE).out, flags=re.MULTILINE)


def test_python_says_the_same() -> None:
    axis = detent.load(CASCADE)
    job = axis.load_recording(write_log(), columns=["current=", "voltage=u [V]"])
    run = axis.run(job, every=0)
    assert run.done
    assert run.summary()[0][0] == "recording"
    json.dumps(run.to_dict())


BAD = {
    "neither": (["run", CASCADE], "neither --job nor --replay"),
    "both": (["run", CASCADE, "--job", SLIDE, "--replay", "log.csv"], "--job and --replay; expected: only one of them"),
    "columns of no recording": ([*RUN, "--column", "force=f"], "--map or --column without --replay"),
    "another method": (["run", str(detent.example("filtered_servo.toml")), "--replay", "log.csv"], "expected: cascade"),
    "no log": (["run", CASCADE, "--replay", "none.csv"], "none.csv"),
    "angles on a slide": (["run", CASCADE, "--replay", "turn.csv"], "got reference in rad; expected: m, as the axis"),
    "lengths on a table": (["run", TURNTABLE, "--job", SLIDE], "expected: an angle such as"),
    "beyond the end": (["run", CASCADE, "--job", "far.csv"], r"far\.csv:2:1 target: got 700 mm; expected: a position"),
    "a bad column": (["run", CASCADE, "--replay", "log.csv", "--column", "robot=x"], "robot"),
    "nothing that drives": (["run", CASCADE, "--replay", "bare.csv"], "got neither a reference nor a force"),
}


@pytest.mark.parametrize("name", BAD)
def test_wrong_input_is_one_message_and_status_2(name: str) -> None:
    write_log()
    write_log("turn.csv", unit="deg")
    text = Path("log.csv").read_text(encoding="utf-8").replace("setpoint [mm]", "spare").replace("u [V]", "spare2")
    Path("bare.csv").write_text(text, encoding="utf-8")
    Path("far.csv").write_text("target [mm]\n700\n", encoding="utf-8")
    words, pattern = BAD[name]
    answer = call(*words)
    assert answer.status == 2
    assert answer.out == ""
    assert re.search(pattern, answer.err), answer.err
    assert "Traceback" not in answer.err


def test_a_run_says_what_check_knows_and_is_amber_by_its_own_evidence() -> None:
    unstable = ("--set", "method.velocity_gain=3000 V*s/m")
    answer = call(*RUN, *unstable, "--trace", "h5", "-o", "out")
    first, *rest = answer.out.splitlines()
    assert answer.status == 0
    assert first.startswith("slide_moves.toml: done on cascade axis, but the command was at its limit for ")
    assert any(line.split()[:3] == ["check", "3", "warnings;"] for line in rest)
    page = Path("out/report.html").read_text(encoding="utf-8")
    assert page.count("Known before the run, from detent check: ") == 3
    data = call(*RUN, *unstable, "--every", "0", "--json").data
    assert (data["level"], len(data["check"]), data["verdict"]) == ("amber", 3, first)
    assert data["warnings"][0].startswith("the command was at its limit for ")


@pytest.mark.parametrize("name", ["report.html", "trace.h5"])
def test_a_run_is_repeated_from_what_it_left(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "86400")
    for folder in ("one", "two"):
        made = call(*RUN, "--set", "method.position_gain=35", "--trace", "h5", "-o", folder, "--json")
        assert made.data["evidence"]["date"] == "1970-01-02T00:00:00+00:00"
    again = call("run", "--again", f"one/{name}")
    assert (again.status, again.out.partition(", ")[0]) == (0, f"one/{name}: byte-identical")
    assert call("run", "--again", f"one/{name}", "--json").data["same"] is True


def test_a_repetition_that_differs_says_in_what_and_is_status_1() -> None:
    assert call(*RUN, "--every", "0", "-o", "out").status == 0
    page = Path("out/report.html")
    text = page.read_text(encoding="utf-8")
    page.write_text(text.replace('"overrides":[]', '"overrides":["method.position_gain=36"]'), encoding="utf-8")
    again = call("run", "--again", str(page))
    assert again.status == 1
    assert "first in method.position_gain, of the effective values" in again.out


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("run", "--again", SLIDE), "without the evidence of a run"),
        (("run", "--again", "no.html"), "no such file"),
        (("run", CASCADE, "--again", "no.html"), "--again alone"),
        (("run",), "got no axis file"),
    ],
)
def test_what_cannot_be_repeated_is_refused(words: tuple[str, ...], says: str) -> None:
    answer = call(*words)
    assert answer.status == 2
    assert says in answer.err
