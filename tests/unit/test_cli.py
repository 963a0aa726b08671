import csv
import html
import io
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.identify_files import write_log
from typer.testing import CliRunner

import detent
from detent.cli import app
from detent.methods.print_head.run import SIGNALS
from detent.page.words import GAP
from detent.record.trace_files import load_trace, save_trace

pytestmark = [pytest.mark.compiled, pytest.mark.early]

AXIS, LETTER = str(detent.example("print_head.toml")), str(detent.example("letter.txt"))
VERBS = ("examples", "new", "keys", "docs", "check", "run", "compare", "timing", "plot", "registers")
STATE = "controller.head.state"
EVIL = "a\x1b[2J\u202e\x9bb"  # clears a terminal, turns the order of reading, begins a command of a terminal
STEERING = "[\0-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e]"
OBSTACLE = ("--set", "disturbance.obstacle.position=7 in")


@dataclass(frozen=True)
class Answer:
    """What a command left behind."""

    status: int
    out: str
    err: str

    @property
    def data(self) -> Any:
        return json.loads(self.out, parse_constant=pytest.fail)  # NaN and Infinity are no JSON


def call(*words: object) -> Answer:
    found = CliRunner().invoke(app, [str(word) for word in words])
    if found.exception is not None and not isinstance(found.exception, SystemExit):
        raise found.exception
    return Answer(found.exit_code, found.stdout, found.stderr)


def shell(*words: object, cwd: Path | None = None, env: dict[str, str] | None = None) -> Answer:
    """The same as a process of its own."""
    source = {"PYTHONPATH": str(Path(detent.__file__).parents[1])}
    done = subprocess.run(
        [sys.executable, "-m", "detent", *(str(word) for word in words)], capture_output=True, check=False, cwd=cwd,
        env={**os.environ, **source, **(env or {})},
    )  # fmt: skip
    return Answer(done.returncode, done.stdout.decode(), done.stderr.decode())


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Defaults such as runs/ and plot.png must land in the test's own folder."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="module")
def trace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    assert call("run", AXIS, "--job", LETTER, "-o", folder, "--trace", "h5").status == 0
    return folder / "trace.h5"


# ---- help


@pytest.mark.parametrize("verb", ["", *VERBS])
def test_help_is_there_and_complete(verb: str) -> None:
    answer = CliRunner().invoke(app, [*([verb] if verb else []), "--help"], env={"COLUMNS": "160"})
    assert answer.exit_code == 0
    text = " ".join(answer.stdout.split())
    # What stands in square brackets is taken for markup and vanishes: then words hang loose.
    assert not re.search(r"\b(by|Start|End|in|as) [.,]", text)
    if not verb:
        assert all(name in text for name in VERBS)
        assert "Exit status: 0 done, 1 the axis did not do it (the reason is shown), 2 wrong input." in text
    elif verb != "registers":
        assert "--json" in text


@pytest.mark.process
@pytest.mark.parametrize("words", [["--help"], ["--version"], *([verb, "--help"] for verb in VERBS), ["examples"]])
def test_help_and_examples_load_nothing_heavy(words: list[str]) -> None:
    heavy = {"numba", "llvmlite", "numpy", "pint", "tree_sitter", "h5py", "pyarrow", "matplotlib"}
    if words[0].startswith("-"):
        heavy |= {"pydantic"}  # a verb's options may be pydantic's: newer versions of typer read them with it
    code = (
        "import sys\nfrom detent.cli import main\n"
        f"sys.argv[1:] = {words}\n"
        "try:\n    main()\nexcept SystemExit as end:\n    assert not end.code, end.code\n"
        f"sys.exit(', '.join(sorted({heavy} & set(sys.modules))) or None)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], env={"PYTHONPATH": str(Path(detent.__file__).parents[1])}, capture_output=True,
        check=False,
    )  # fmt: skip
    assert (done.stderr, done.returncode) == (b"", 0)


def test_the_version_is_told() -> None:
    assert call("--version") == Answer(0, f"detent {detent.__version__}\n", "")


def test_without_a_verb_there_is_help() -> None:
    answer = call()
    assert answer.status == 2
    assert "registers" in answer.out + answer.err


# ---- wrong input: one message, status 2, nothing on the output


def bad_inputs() -> dict[str, tuple[Sequence[str], str]]:
    missing, folder, binary = "missing.toml", "folder", "binary.prn"
    trace = "{trace}"
    job = ("--job", LETTER)
    return {
        "no verb of that name": (["fly"], "fly"),
        "no option of that name": (["check", AXIS, "--fast"], "--fast"),
        "check: no argument": (["check"], "[Mm]issing argument"),
        "check: missing file": (["check", missing], "missing.toml: no such file; expected: an axis file"),
        "check: directory": (["check", folder], "folder: got a file that cannot be read"),
        "check: a picture": (["check", binary], "binary.prn"),
        "check: bad --set": (["check", AXIS, "--set", "drive.supply"], "--set .*KEY=VALUE"),
        "check: unknown key": (["check", AXIS, "--set", "drive.suply=3 V"], 'did you mean "drive.supply"'),
        "check: wrong unit": (["check", AXIS, "--set", "drive.supply=3 m"], "--set drive.supply: got 3 m"),
        "run: no job": (["run", AXIS], "--job"),
        "run: missing file": (["run", missing, *job], "missing.toml: no such file"),
        "run: directory": (["run", folder, *job], "folder"),
        "run: missing job": (["run", AXIS, "--job", "no.txt"], "no.txt: no such file"),
        "run: a directory as job": (["run", AXIS, "--job", folder], "folder: got a file that cannot be read"),
        "run: a binary job": (["run", AXIS, "--job", binary], "binary.prn: .*mean nothing to a printer"),
        "run: an empty job": (["run", AXIS, "--job", "empty.txt"], "empty.txt: got an empty file"),
        "run: a line too wide": (["run", AXIS, "--job", "wide.txt"], "wide.txt printed line 1: got ink from"),
        "run: unknown signal": (["run", AXIS, *job, "--signals", "plant.train.curent"], "mean 'plant.train.current'"),
        "run: unknown kind of trace": (["run", AXIS, *job, "--trace", "h5,xlsx"], "--trace: got 'xlsx'; expected: h5,"),
        "run: output is a file": (["run", AXIS, *job, "-o", binary], "--output binary.prn: cannot be written"),
        "run: output below a file": (["run", AXIS, *job, "-o", binary + "/x"], "--output .*cannot be written"),
        "run: a folder in place of the trace": (["run", AXIS, *job, "-o", "taken"], "taken.trace.h5: cannot"),
        "run: negative --every": (["run", AXIS, *job, "--every", "-1"], "--every"),
        "run: huge --every": (["run", AXIS, *job, "--every", "99999999999999999999"], "--every"),
        "run: --every in words": (["run", AXIS, *job, "--every", "often"], "--every"),
        "compare: missing file": (["compare", missing], "missing.toml: no such file"),
        "compare: no picture": (["compare", AXIS, "--figure", "a.txt"], "cannot be saved as '.txt'; use one of .html"),
        "compare: no folder": (["compare", AXIS, "--figure", "no/a.png"], "cannot be written .no folder no"),
        "compare: too slow": (["compare", AXIS, "--set", "limits.speed=5 in/s"], "comparison of drives: got .* raise"),
        "plot: missing file": (["plot", "no.h5"], "no.h5: no such file"),
        "plot: no trace": (["plot", binary], "suffix '.prn'"),
        "plot: directory": (["plot", "folder.h5"], "folder.h5"),
        "plot: not HDF5": (["plot", "text.h5"], "text.h5: got"),
        "plot: unknown signal": (["plot", trace, "--signals", "plant.train.curent"], "mean 'plant.train.current'"),
        "plot: no picture": (["plot", trace, "--signals", STATE, "-o", "p.txt"], "cannot be saved as '.txt'"),
        "plot: no folder": (["plot", trace, "--signals", STATE, "-o", "no/p.png"], "no folder no"),
        "plot: a time that is not there": (
            ["plot", trace, "--signals", STATE, "--from", "1e6"], "no rows from 1e.06 s to inf s; it holds",
        ),
        "plot: backwards": (["plot", trace, "--signals", STATE, "--from", "3", "--to", "2"], "no rows from 3 s"),
        "plot: no number": (["plot", trace, "--signals", STATE, "--from", "nan"], "no rows from nan s"),
        "plot: an empty trace": (["plot", "empty.csv", "--signals", "x"], "no rows"),
        "examples: a file in the way": (["examples", "--copy", binary], "--copy binary.prn: cannot be written"),
        "registers: too much": (["registers", "head"], "head"),
    }  # fmt: skip


@pytest.fixture
def rubbish(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder.h5").mkdir()
    (tmp_path / "taken" / "trace.h5").mkdir(parents=True)
    (tmp_path / "binary.prn").write_bytes(bytes(range(256)) * 20)
    (tmp_path / "empty.txt").write_bytes(b"")
    (tmp_path / "wide.txt").write_bytes(b"x" * 200)
    (tmp_path / "text.h5").write_bytes(b"t [s]\n0\n")
    (tmp_path / "empty.csv").write_bytes(b"t [s],x\n")


@pytest.mark.usefixtures("rubbish")
@pytest.mark.parametrize("name", bad_inputs())
def test_wrong_input_is_one_message_and_status_2(name: str, trace: Path) -> None:
    words, says = bad_inputs()[name]
    answer = call(*(word.replace("{trace}", str(trace)) for word in words))
    assert answer.status == 2
    assert answer.out == ""
    assert re.search(says, re.sub(r"[│╭╮╰╯─\s]+", " ", answer.err)), answer.err
    assert "Traceback" not in answer.err
    assert not Path("runs").exists() or not any(Path("runs").rglob("*.html"))


@pytest.mark.parametrize("words", [["run", AXIS, "--job", "no.txt"], ["run", AXIS, "--job", LETTER, "--signals", "x"]])
def test_a_run_that_cannot_begin_leaves_nothing_behind(tmp_path: Path, words: list[str]) -> None:
    assert call(*words).status == 2
    assert list(tmp_path.iterdir()) == []


@pytest.mark.process
@pytest.mark.usefixtures("rubbish")
@pytest.mark.parametrize(
    "words",
    [
        ["check", "missing.toml"],
        ["run", AXIS, "--job", "binary.prn"],
        ["run", AXIS, "--job", LETTER, "-o", "binary.prn"],
        ["plot", "text.h5"],
        ["compare", AXIS, "--figure", "a.txt"],
        ["examples", "--copy", "binary.prn"],
    ],
)
def test_as_a_process_too_wrong_input_is_one_message_and_status_2(tmp_path: Path, words: list[str]) -> None:
    answer = shell(*words, cwd=tmp_path)
    assert answer.status == 2
    assert answer.out == ""
    assert answer.err.count("\n") == 1
    assert "Traceback" not in answer.err


# ---- examples


def test_examples_are_listed_with_what_they_are() -> None:
    answer = call("examples")
    assert answer.status == 0
    assert re.search(r"^print_head\.toml +A print-head axis: ", answer.out, flags=re.MULTILINE)
    assert re.search(r"^letter\.txt +print job, plain text$", answer.out, flags=re.MULTILINE)
    assert re.search(r"^brochure\.prn +print job, Diablo 630 stream$", answer.out, flags=re.MULTILINE)
    rows = call("examples", "--json").data
    assert [row["name"] for row in rows] == [path.name for path in detent.examples()]
    assert all(Path(row["path"]).is_file() and row["about"] for row in rows)


def test_examples_are_copied_and_work_where_they_are(tmp_path: Path) -> None:
    answer = call("examples", "--copy", "my files/start")
    assert answer.status == 0
    for path in detent.examples():
        assert (tmp_path / "my files" / "start" / path.name).read_bytes() == path.read_bytes()
    # The line it proposes is one that a shell understands.
    words = re.search(r"Try: detent (.*)", answer.out)
    assert words
    assert call(*shlex.split(words[1])).status == 0


def test_a_copy_never_overwrites(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").write_text("my own", encoding="utf-8")
    answer = call("examples", "--copy", "mine")
    assert answer.status == 2
    assert answer.err.startswith(f"{Path('mine', 'letter.txt')}: got a file that detent did not write")
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["letter.txt"]
    assert (tmp_path / "mine" / "letter.txt").read_text(encoding="utf-8") == "my own"


def test_copied_examples_are_told_as_json(tmp_path: Path) -> None:
    rows = call("examples", "--copy", "start", "--json").data
    assert [row["path"] for row in rows] == [str(Path("start") / path.name) for path in detent.examples()]
    assert len(list((tmp_path / "start").iterdir())) == len(rows)


# ---- check


def test_check_shows_values_with_their_origin() -> None:
    answer = call("check", AXIS, "--set", "drive.supply=40 V", "--set", "axis.name=head [/2]")
    assert answer.status == 0
    rows = {line.split()[0]: line for line in answer.out.splitlines() if "." in line.split(" ")[0]}
    assert re.search(r"40 V +--set$", rows["drive.supply"].rstrip())
    assert re.search(rf"368\.3 mm +{re.escape(AXIS)} line \d+$", rows["limits.travel"].rstrip())
    assert rows["method.trim"].split()[-1] == "default"
    assert "catalogue JDH" in rows["motor.resistance"]
    assert "head [/2]: effective values" in answer.out  # a name is a name, no markup
    assert re.search(r"^stop distance at top speed +400 emitters", answer.out, flags=re.MULTILINE)
    assert answer.out.endswith("no warnings\n")


def test_check_warns_and_counts() -> None:
    one = call("check", AXIS, "--set", "motor.max_current=1.2 A")
    assert one.status == 0
    assert "warning: current while accelerating: 1.393 A; should be up to motor.max_current, 1.2 A" in one.out
    assert one.out.endswith("1 warning\n")
    many = call("check", AXIS, "--set", "motor.max_current=0.1 A", "--set", "method.ir_counts=250")
    found = many.out.count("\nwarning: ")
    assert found > 1
    assert many.out.endswith(f"{found} warnings\n")


def test_check_as_json_has_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    data = call("check", AXIS, "--json", "--set", "motor.max_current=1.2 A").data
    assert set(data) == {"file", "name", "method", "rows", "derived", "warnings"}
    assert {"key": "motor.max_current", "value": "1.2 A", "written": "1.2 A", "origin": "--set"}.items() <= next(
        row for row in data["rows"] if row["key"] == "motor.max_current"
    ).items()
    assert set(data["derived"][0]) == {"name", "value", "unit", "text", "formula"}
    assert [set(warning) for warning in data["warnings"]] == [{"name", "value", "limit", "consequence", "remedy"}]
    monkeypatch.setattr("detent.methods.print_head.derive.HeadFigures.current", lambda _machine, _counts: float("inf"))
    assert None in [row["value"] for row in call("check", AXIS, "--json").data["derived"]]  # not Infinity


def test_check_tells_all_that_is_wrong(tmp_path: Path) -> None:
    text = Path(AXIS).read_text(encoding="utf-8").replace('"14.5 in"', "14.5").replace('"38 V"', '"38 m"')
    (tmp_path / "bad.toml").write_text(text, encoding="utf-8")
    answer = call("check", "bad.toml")
    assert answer.status == 2
    assert [line.split()[1].rstrip(":") for line in answer.err.splitlines()] == [
        "limits.travel", "limits.effort", "drive.supply",
    ]  # fmt: skip
    assert all(re.match(r"bad\.toml:\d+:\d+ ", line) for line in answer.err.splitlines())


# ---- run


def test_run_prints_a_job_and_leaves_report_and_trace(tmp_path: Path) -> None:
    answer = call("run", AXIS, "--job", LETTER)
    assert answer.status == 0
    folder = Path("runs") / "print_head-letter"
    lines = answer.out.splitlines()
    assert lines[0] == "Printed letter.txt on print head."
    assert lines[1] == "  lines                11 of 11, on 1 page"
    assert all(re.match(r"  \S.{19} \S", line) for line in lines[1:])
    assert [line.split()[-1] for line in lines[-3:]] == [
        str(folder / name) for name in ("report.html", "trace.h5", "trace.csv")
    ]
    assert sorted(path.name for path in (tmp_path / folder).iterdir()) == ["report.html", "trace.csv", "trace.h5"]
    report = (tmp_path / folder / "report.html").read_text(encoding="utf-8")
    assert "✔ Printed" in report
    assert "11 lines" in report.replace(GAP, " ")


def test_every_kind_of_trace_holds_the_same_with_units(tmp_path: Path) -> None:
    assert call("run", AXIS, "--job", LETTER, "-o", "out", "--trace", "parquet, h5,csv").status == 0
    traces = [load_trace(tmp_path / "out" / f"trace.{kind}") for kind in ("h5", "csv", "parquet")]
    for trace in traces:
        assert trace.signals == SIGNALS
        assert (trace.units["t"], trace.units["plant.train.current"], trace.units["plant.train.energy"]) == (
            "s",
            "A",
            "J",
        )
        for name in trace:
            np.testing.assert_array_equal(trace[name], traces[0][name])
    with (tmp_path / "out" / "trace.csv").open(encoding="utf-8", newline="") as stream:
        header = next(csv.reader(stream))
    assert header[:3] == ["t [s]", "plant.train.position [m]", "plant.train.velocity [m/s]"]
    assert traces[0].attributes["job"] == "letter.txt"


def test_a_trace_that_was_not_asked_for_is_not_there(tmp_path: Path) -> None:
    base = ("run", AXIS, "--job", LETTER, "-o", "out")
    assert call(*base).status == 0
    for options, names in (
        (("--trace", "csv"), {"report.html", "trace.csv"}),
        (("--trace", "h5"), {"report.html", "trace.h5"}),
        (("--trace", ""), {"report.html"}),
        (("--every", "0"), {"report.html"}),
    ):
        # What an earlier run left there does not stand beside the new report.
        assert call(*base, *options).status == 0
        assert {path.name for path in (tmp_path / "out").iterdir()} == names


def test_other_files_of_the_folder_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine", encoding="utf-8")
    assert call("run", AXIS, "--job", LETTER, "-o", ".").status == 0
    assert {path.name for path in tmp_path.iterdir()} == {"notes.txt", "report.html", "trace.h5", "trace.csv"}


def test_signals_come_beside_the_usual_ones(tmp_path: Path) -> None:
    words = (
        "--signals",
        "controller.head.right.slope,plant.encoder.edge",
        "--signals",
        "controller.head.queue.*",
        "--every",
        "100",
        "--trace",
        "h5",
    )
    assert call("run", AXIS, "--job", LETTER, "-o", "out", *words).status == 0
    trace = load_trace(tmp_path / "out" / "trace.h5")
    assert set(trace.signals) >= {
        *SIGNALS,
        "controller.head.right.slope",
        "plant.encoder.edge",
        "controller.head.queue.waiting",
    }
    assert np.diff(trace.time).min() == pytest.approx(4e-3)
    assert "profile-drive" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_a_run_as_json_has_every_figure_and_the_files(tmp_path: Path) -> None:
    answer = call("run", AXIS, "--job", LETTER, "-o", "out", "--json")
    assert answer.status == 0
    data = answer.data
    assert set(data) == {
        "axis", "file", "verdict", "job", "kind", "level", "pages", "done", "failure", "warnings", "check",
        "time_ready", "time_end",
        "print_time", "characters", "characters_per_second", "columns", "missed", "worst_error", "rms_error",
        "turn_arounds", "repositions", "peak_current", "energy", "width", "speeds", "identified", "lines", "notes",
        "files", "evidence",
    }  # fmt: skip
    assert set(data["lines"][0]) == {
        "number", "direction", "speed_value", "turn_around", "start", "stop", "characters", "columns", "missed",
        "worst_error", "rms_error",
    }  # fmt: skip
    assert set(data["identified"]) == {"right", "left"}
    assert all((tmp_path / path).is_file() for path in data["files"])


def test_an_obstacle_in_the_way_is_status_1_and_the_reason() -> None:
    answer = call("run", AXIS, "--job", LETTER, *OBSTACLE)
    assert answer.status == 1
    assert answer.err == ""
    first = answer.out.splitlines()[0]
    assert first.startswith("Not printed: CALCULATE PARAMETERS: the head is obstructed or stalled")
    assert "7.00 in" in first
    assert "nan" not in answer.out
    assert "Not printed" in Path("runs/print_head-letter/report.html").read_text(encoding="utf-8")
    data = call("run", AXIS, "--job", LETTER, *OBSTACLE, "--json")
    assert data.status == 1
    assert data.data["done"] is False
    assert "obstructed" in data.data["failure"]


@pytest.mark.process
def test_an_obstacle_as_a_process_of_its_own(tmp_path: Path) -> None:
    answer = shell("run", AXIS, "--job", LETTER, *OBSTACLE, "--every", "0", cwd=tmp_path)
    assert answer.status == 1
    assert answer.out.startswith("Not printed: ")
    assert "Traceback" not in answer.err


@pytest.mark.process
def test_the_report_says_how_to_make_it_again(tmp_path: Path) -> None:
    words = ("run", AXIS, "--job", LETTER, "-o", "out", "--set", "drive.supply=40 V")
    assert shell(*words, cwd=tmp_path).status == 0
    report = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert shlex.join(["detent", *words]) in html.unescape(report)


def test_what_the_job_could_not_mean_is_noted(tmp_path: Path) -> None:
    (tmp_path / "odd.prn").write_bytes(b"text that is long enough to be a job\r\n" * 4 + b"\x1bq" * 7)
    answer = call("run", AXIS, "--job", "odd.prn", "--every", "0")
    assert answer.status == 0
    assert answer.out.count("  note: byte ") == 5
    assert "2 more notes; --json shows them all" in answer.out
    assert len(call("run", AXIS, "--job", "odd.prn", "--every", "0", "--json").data["notes"]) == 7


@pytest.mark.process
@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no such file names")
@pytest.mark.parametrize("as_json", [False, True])
def test_a_file_name_no_encoding_knows_is_no_trouble(tmp_path: Path, as_json: bool) -> None:
    name = os.fsdecode(b"letter-\xff-\xc2\xb5.txt")
    shutil.copyfile(LETTER, tmp_path / name)
    answer = shell(
        "run", AXIS, "--job", name, "-o", "out", *(["--json"] if as_json else []), cwd=tmp_path,
        env={"PYTHONIOENCODING": "ascii"},
    )  # fmt: skip
    assert answer.err == ""
    assert answer.status == 0
    if as_json:
        assert answer.data["job"] == name
    else:
        assert answer.out.startswith(r"Printed letter-\udcff-\xb5.txt on print head.")


def test_a_progress_bar_needs_somebody_who_looks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")  # as if the error channel were a terminal
    shown = call("run", AXIS, "--job", LETTER, "--every", "0")
    assert "line 11 of 11" in shown.err or "homing" in shown.err or "writing" in shown.err
    assert call("run", AXIS, "--job", LETTER, "--every", "0", "--json").err == ""


# ---- compare


def test_compare_shows_three_drives_and_draws_them(tmp_path: Path) -> None:
    answer = call("compare", AXIS, "--set", "disturbance.motor_constant=10 %", "--figure", "three.svg")
    assert answer.status == 0
    lines = answer.out.splitlines()
    assert lines[0].strip() == "Steady speed error, right / left (K +10 %)"
    assert re.split(r" {2,}", lines[1].strip()) == ["speed", "power-on default", "nominal table", "identified"]
    assert [line.split(" in/s")[0] for line in lines[2:5]] == ["40", "20", "10"]
    assert lines[-1] == "figure: three.svg"
    assert "K +10 %" in (tmp_path / "three.svg").read_text(encoding="utf-8")


def test_compare_as_json(tmp_path: Path) -> None:
    data = call("compare", AXIS, "--json").data
    assert set(data) == {"comparisons", "files"}
    (data,) = data["comparisons"]
    assert set(data) == {"title", "target", "speeds", "methods"}
    assert [method["method"] for method in data["methods"]] == ["power-on default", "nominal table", "identified"]
    assert set(data["methods"][0]) == {
        "method", "constants", "errors_right", "errors_left", "mean_error", "time_to_band",
    }  # fmt: skip
    assert data["title"] == "Steady speed error, right / left (machine as in its file)"
    page = (tmp_path / "comparison.html").read_text(encoding="utf-8")
    assert "Steady speed error, right / left (machine as in its file)" in page
    assert "This file is complete" in page


def test_a_comparison_on_an_obstructed_axis_is_status_1() -> None:
    answer = call("compare", AXIS, *OBSTACLE)
    assert answer.status == 1
    assert answer.err.startswith("comparison of drives: CALCULATE PARAMETERS failed: the head is obstructed")
    assert not Path("comparison.html").exists()


# ---- plot, registers


def test_plot_without_signals_lists_them(trace: Path) -> None:
    answer = call("plot", trace)
    assert answer.status == 0
    assert re.search(r"^plant\.train\.current +A +\S", answer.out, flags=re.MULTILINE)
    assert [line.split()[0] for line in answer.out.splitlines()] == list(SIGNALS)
    rows = call("plot", trace, "--json").data
    assert [row["name"] for row in rows] == list(SIGNALS)
    assert set(rows[0]) == {"name", "unit", "doc"}


@pytest.mark.parametrize(("suffix", "magic"), [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")])
def test_plot_draws_what_was_asked_for(trace: Path, tmp_path: Path, suffix: str, magic: bytes) -> None:
    words = (
        "--signals",
        "plant.train.velocity,controller.head.dr*",
        "--signals",
        "plant.train.current",
        "-o",
        f"p.{suffix}",
    )
    assert call("plot", trace, *words, "--from", "7.5", "--to", "8") == Answer(0, f"figure: p.{suffix}\n", "")
    drawn = (tmp_path / f"p.{suffix}").read_bytes()
    assert drawn.startswith(magic)
    if suffix == "svg":
        text = drawn.decode()
        for word in ("plant.train.velocity", "controller.head.drive_cmd", "plant.train.current", "[A]", "time [ms]"):
            assert word in text


def test_plot_takes_one_end_of_the_time_and_a_default_file(trace: Path, tmp_path: Path) -> None:
    assert call("plot", trace, "--signals", STATE, "--to", "5", "--json").data == {"files": ["plot.png"]}
    assert (tmp_path / "plot.png").is_file()
    assert call("plot", trace, "--signals", STATE, "--from", "5").status == 0


def test_registers_lists_what_can_be_recorded() -> None:
    answer = call("registers")
    assert answer.status == 0
    names = [line.split()[0] for line in answer.out.splitlines()]
    assert set(SIGNALS) <= set(names)
    rows = call("registers", "--json").data
    assert [row["name"] for row in rows] == names
    assert {"name": "plant.train.current", "width": "f8", "unit": "A"}.items() <= next(
        row for row in rows if row["name"] == "plant.train.current"
    ).items()


# ---- the terminal


@pytest.mark.process
@pytest.mark.parametrize("words", [["registers"], ["check", AXIS], ["registers", "--json"], ["examples"]])
def test_a_reader_that_leaves_early_is_no_error(words: list[str]) -> None:
    source = str(Path(detent.__file__).parents[1])
    with subprocess.Popen(
        [sys.executable, "-m", "detent", *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": source},
    ) as process:  # fmt: skip
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == b""
        assert process.wait() == 0


@pytest.mark.process
def test_a_reader_that_leaves_early_does_not_hide_a_failure(tmp_path: Path) -> None:
    source = str(Path(detent.__file__).parents[1])
    words = ["run", AXIS, "--job", LETTER, "--every", "0", *OBSTACLE]
    with subprocess.Popen(
        [sys.executable, "-m", "detent", *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": source},
    ) as process:  # fmt: skip
        assert process.stdout is not None
        process.stdout.close()
        assert process.wait() == 1


@pytest.mark.process
@pytest.mark.long
def test_the_first_run_says_that_it_compiles_and_the_second_does_not(tmp_path: Path) -> None:
    words = ("run", AXIS, "--job", LETTER, "--every", "0")
    env = {"DETENT_CACHE_DIR": str(tmp_path / "cache")}
    first, second = (shell(*words, cwd=tmp_path, env=env) for _ in range(2))
    assert (first.status, second.status) == (0, 0)
    assert first.err == "First run: compiling the axis, 10 to 60 s; later runs start immediately.\n"
    assert second.err == ""
    assert first.out == second.out


@pytest.mark.process
@pytest.mark.long
def test_a_cache_that_cannot_be_made_is_said_and_the_run_is_made(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    env = {"DETENT_CACHE_DIR": str(tmp_path / "file" / "cache")}
    answer = shell("run", AXIS, "--job", LETTER, "--every", "0", cwd=tmp_path, env=env)
    assert answer.status == 0
    assert "it cannot be cached" in answer.err
    assert "set DETENT_CACHE_DIR to a folder of yours" in answer.err
    assert answer.out.startswith("Printed letter.txt")


@pytest.mark.process
def test_text_is_written_where_the_terminal_cannot_show_it(tmp_path: Path) -> None:
    answer = shell("run", AXIS, "--job", LETTER, "--every", "0", cwd=tmp_path, env={"PYTHONIOENCODING": "ascii"})
    assert answer.status == 0
    assert "um" in answer.out or "\\xb5m" in answer.out
    assert io.StringIO(answer.out).readline() == "Printed letter.txt on print head.\n"


@pytest.mark.parametrize("example", [e.name for e in detent.examples() if "[axis]" in e.read_text(errors="ignore")])
def test_no_name_steers_the_terminal(example: str, tmp_path: Path, tried: Callable[..., None]) -> None:
    """What a name, a file's name or --set held reached the terminal raw."""
    axis = tmp_path / "axis\x1b[2J.toml"
    shutil.copy(detent.example(example), axis)
    told = {"axis.name=a\x1b[2J\u202eb": "a\\x1b[2J\\u202eb", "a\x9bb=1": "a\\x9bb"}
    for override, text in told.items():
        answer = call("check", axis, "--set", override)
        assert text in answer.out + answer.err
        assert not re.search(STEERING, answer.out + answer.err)
        tried("text", "names of axes, keys and files, on the terminal", "shown, with escapes")


@pytest.mark.parametrize(
    "words",
    [
        [f"fl{EVIL}y"],
        ["check", f"--fl{EVIL}y"],
        ["run", AXIS, "--job", LETTER, "--every", "0", "--output", f"no/{EVIL}", f"one{EVIL}"],
        ["plot", f"{EVIL}.h5"],
        ["check", AXIS, "--set", EVIL],
        ["identify", f"{EVIL}.csv", "--method", EVIL],
        ["registers", EVIL],
    ],
)  # fmt: skip
def test_no_word_of_the_command_line_steers_the_terminal(words: list[str], tried: Callable[..., None]) -> None:
    """What click refuses, it showed raw."""
    answer = call(*words)
    assert answer.status == 2
    # An older click takes the code that clears the screen away itself.
    assert re.search(r"a(\\x1b\[2J)?\\u202e\\x9bb", answer.err)
    assert not re.search(STEERING, answer.err)
    tried("text", "words of the command line that are refused", "shown, with escapes")


def files_in(folder: Path) -> dict[str, bytes]:
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


# ---- full disks

ON_A_FULL_DISK = [
    ("run", AXIS, "--job", LETTER, "--output", "out", "--force"),
    ("run", AXIS, "--job", LETTER, "--every", "0", "--output", "out", "--force"),
    ("plot", "trace.h5", "--signals", "plant.train.velocity", "--output", "out/plot.png", "--force"),
    ("compare", AXIS, "--figure", "out/comparison.html", "--force"),
    ("timing", AXIS, "--at", "20 ms", "--vcd", "out/timing.vcd", "--figure", "out/timing.png", "--force"),
    ("envelope", str(detent.example("zoom.toml")), "--output", "out", "--force"),
    ("examples", "--copy", "out"),
    ("new", "cascade", "out/new.toml"),
    ("analyse", "log.csv", "--what", "steps", "--report", "out/found.html", "--force"),
    ("identify", "log.csv", "--report", "out/found.html", "--force"),
]


@pytest.fixture
def earlier(tmp_path: Path, trace: Path) -> None:
    """Files of an earlier time, beside those that the commands read."""
    (tmp_path / "out").mkdir(exist_ok=True)
    for name in ("report", "comparison", "found"):
        (tmp_path / "out" / f"{name}.html").write_text("earlier")
    for name in ("timing.vcd", "timing.png", "plot.png", "group_a.csv", "trace.h5"):
        (tmp_path / "out" / name).write_text("earlier")
    shutil.copy(trace, tmp_path / "trace.h5")
    write_log(tmp_path / "log.csv")


def check_told(words: tuple[str, ...], answer: Answer, reason: str) -> None:
    """One sentence of the place as it was given, and status 1."""
    lines = [line for line in answer.out.splitlines() + answer.err.splitlines() if "cannot be written" in line]
    assert answer.status == 1
    assert len(lines) == 1
    assert f"cannot be written ({reason}); choose another place or make room" in lines[0]
    assert re.match("(not written: )?(out/|--output out|--copy out)", lines[0])
    others = [line for line in answer.err.splitlines() if line != lines[0] and not line.startswith("First run")]
    assert others == [], words


@contextmanager
def files_up_to(size: int) -> Generator[None]:
    """No file may grow beyond a size: as a full disk, but on every machine.

    Python does not notice that the bytecode of what it imports here is cut short, and takes it at the next import.
    """
    resource = pytest.importorskip("resource")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "dont_write_bytecode", True)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.compiled
@pytest.mark.usefixtures("earlier")
@pytest.mark.parametrize("words", ON_A_FULL_DISK, ids=lambda words: f"{words[0]}{len(words)}")
def test_a_disk_that_is_full_is_one_sentence_and_leaves_what_was_there(
    words: tuple[str, ...], tried: Callable[..., None]
) -> None:
    """The earlier report was gone."""
    before = files_in(Path())
    with files_up_to(500):
        answer = call(*words)
    check_told(words, answer, "File too large")
    assert files_in(Path()) == before
    tried("disk", f"`detent {words[0]}`", "one sentence, status 1, the earlier files")


@pytest.mark.wide
@pytest.mark.usefixtures("earlier")
def test_hdf5_that_cannot_write_ends_no_process(tmp_path: Path, tried: Callable[..., None]) -> None:
    """It crashed at its end."""
    before = files_in(tmp_path)
    limit = "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (500, 500)); "
    done = subprocess.run(
        [sys.executable, "-c", f"{limit}from detent.cli import main; main()", *ON_A_FULL_DISK[0]], check=False,
        capture_output=True, text=True, cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(Path(detent.__file__).parents[1])},
    )  # fmt: skip
    check_told(ON_A_FULL_DISK[0], Answer(done.returncode, done.stdout, done.stderr), "File too large")
    assert files_in(tmp_path) == before
    tried("disk", "`detent run` as a process of its own", "one sentence, status 1, the earlier files")


@pytest.fixture
def small_disk(tmp_path: Path) -> Generator[Path]:
    """A disk of 200 kB, where the user may make one."""
    (tmp_path / "out").mkdir()
    mount = ("mount", "-t", "tmpfs", "-o", "size=200k", "detent", str(tmp_path / "out"))
    if not shutil.which("mount") or subprocess.run(mount, check=False, capture_output=True).returncode:
        pytest.skip("a disk in memory cannot be mounted here")
    yield tmp_path / "out"
    subprocess.run(("umount", str(tmp_path / "out")), check=True)  # noqa: S607


@pytest.mark.wide
@pytest.mark.parametrize("words", ON_A_FULL_DISK, ids=lambda words: f"{words[0]}{len(words)}")
def test_a_small_disk_that_is_full_is_one_sentence_too(
    words: tuple[str, ...], small_disk: Path, request: pytest.FixtureRequest, tried: Callable[..., None]
) -> None:
    request.getfixturevalue("earlier")
    with (small_disk / "filler").open("wb", buffering=0) as filler, suppress(OSError):
        while True:
            filler.write(bytes(1000))
    os.truncate(small_disk / "filler", (small_disk / "filler").stat().st_size - 8192)  # two pages: a part fits
    before = files_in(Path())
    answer = (shell if words[0] == "run" else call)(*words)
    check_told(words, answer, "No space left on device")
    assert files_in(Path()) == before
    tried("disk", f"`detent {words[0]}`, a disk of 200 kB", "one sentence, status 1, the earlier files")


@pytest.mark.parametrize("kind", ["h5", "parquet"])
def test_a_trace_that_broke_off_is_taken_only_where_asked(tmp_path: Path, trace: Path, kind: str) -> None:
    broken = tmp_path / f"broken.{kind}"
    loaded = load_trace(trace)
    loaded.attributes["complete"] = 0
    save_trace(loaded, broken)
    draw = ("plot", broken, "--signals", "plant.train.velocity", "-o", tmp_path / "plot.png")
    study = ("analyse", broken, "--column", "position=plant.train.position")
    for words, asked in ((draw, ("--incomplete",)), (study, ("--column", "incomplete=yes"))):
        refused = call(*words)
        assert refused.status == 2
        assert "the trace of an aborted run" in refused.err
        assert asked[-1] in refused.err
        assert "aborted" not in call(*words, *asked).err


@pytest.mark.process
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
@pytest.mark.parametrize("words", [("registers",), ("check", AXIS, "--json")])
def test_a_standard_output_that_is_full_is_one_sentence(words: tuple[str, ...], tried: Callable[..., None]) -> None:
    source = {"PYTHONPATH": str(Path(detent.__file__).parents[1])}
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "detent", *words], stdout=full, stderr=subprocess.PIPE, text=True, check=False,
            env={**os.environ, **source},
        )  # fmt: skip
    told = "standard output: cannot be written (No space left on device); choose another place or make room\n"
    assert done.stderr == told
    assert done.returncode == 1
    tried("disk", "standard output", "one sentence, status 1")


@pytest.mark.compiled
def test_output_through_links(tmp_path: Path, trace: Path) -> None:
    """A report took the place of the link to it; a link to a folder that is not there was "File exists"."""
    (tmp_path / "kept").mkdir()
    for name, leads_to in (("out", "kept"), ("kept/report.html", "../report"), ("later", "new"), ("loop", "loop")):
        (tmp_path / name).symlink_to(leads_to)
    for folder in ("out", "later"):
        answer = call("run", AXIS, "--job", LETTER, "--every", "0", "--no-compare", "--output", tmp_path / folder)
        assert answer.status == 0, answer.err
    assert (tmp_path / "kept" / "report.html").is_symlink()
    assert "<title>" in (tmp_path / "report").read_text(encoding="utf-8")
    assert (tmp_path / "new" / "report.html").is_file()
    looped = ("--output", tmp_path / "loop")
    (tmp_path / "loop.png").symlink_to("loop.png")
    for words in (
        ("run", AXIS, "--job", LETTER, *looped),
        ("examples", "--copy", tmp_path / "loop"),
        ("plot", trace, "--signals", "plant.train.velocity", "-o", tmp_path / "loop.png"),
    ):
        answer = call(*words)
        assert answer.status == 2
        assert answer.err.count("\n") == 1
        assert "cannot be written (Too many levels of symbolic links); choose another place" in answer.err
