"""What the command line does for people who type: completion, short options, problems as data, units of times."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import detent
from detent.cli import app, run
from detent.cli.terminal import be_quiet
from detent.errors import InputError
from detent.record.trace import Trace
from detent.record.trace_files import save_trace, size_as_csv

CASCADE = str(detent.example("cascade.toml"))


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    yield
    be_quiet(False)


def call(*words):
    found = CliRunner().invoke(app, [str(word) for word in words])
    assert found.exception is None or isinstance(found.exception, SystemExit)
    return found.exit_code, found.stdout, found.stderr


# ---- completion


def shell(words, **more):
    source = {"PYTHONPATH": str(Path(detent.__file__).parents[1])}
    program = [sys.executable, "-c", "import sys; sys.argv[0] = 'detent'; from detent.cli import main; main()", *words]
    return subprocess.run(program, capture_output=True, check=False, env={**os.environ, **source, **more})


@pytest.mark.process
@pytest.mark.parametrize(
    ("typed", "completed"), [("detent ch", "check"), ("detent plot --fr", "--from"), ("detent ke", "keys")]
)
def test_a_shell_completes_verbs_and_options(typed, completed):
    words = str(len(typed.split()) - 1)
    done = shell([], _DETENT_COMPLETE="complete_bash", COMP_WORDS=typed, COMP_CWORD=words)
    assert done.stdout.decode().split() == [completed]


@pytest.mark.process
def test_the_completion_of_a_shell_is_shown():
    # Which shell it is must not hang on the one that has started the tests.
    done = shell(["--show-completion", "bash"], _TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION="1")
    assert done.returncode == 0
    assert b"_DETENT_COMPLETE" in done.stdout


# ---- short and quiet


def test_the_version_has_a_short_option():
    assert call("-V") == call("--version") == (0, f"detent {detent.__version__}\n", "")


def test_quiet_tells_only_what_is_wrong():
    assert call("-q", "check", CASCADE) == (0, "", "")
    status, out, _ = call("-q", "check", CASCADE, "--set", "limits.effort=6 kN")
    assert status == 0
    assert all(line.startswith("warning: ") for line in out.splitlines())
    assert out
    assert call("--quiet", "check", "no.toml")[2].startswith("no.toml: ")
    assert json.loads(call("-q", "check", CASCADE, "--json")[1])["method"] == "cascade"
    assert call("check", CASCADE)[1].endswith("no warnings\n")  # the next command is not quiet


# ---- problems as data


def test_json_gives_the_problems_of_a_file_as_data():
    status, out, err = call("check", CASCADE, "--json", "--set", "limits.travel=5", "--set", "limits.speed=1 V")
    told = json.loads(out)
    assert (status, err, told["exit_status"]) == (2, "", 2)
    assert [problem["key"] for problem in told["problems"]] == ["limits.travel", "limits.speed"]
    assert set(told["problems"][0]) == {"file", "line", "column", "key", "got", "allowed", "remedy"}


@pytest.mark.parametrize(
    "words",
    [["check", "--json"], ["fly", "--json"], ["check", CASCADE, "--json", "--no-such-option"], ["new", "x", "--json"]],
)
def test_json_gives_every_other_wrong_input_as_data(words):
    status, out, err = call(*words)
    told = json.loads(out)
    assert (status, err, told["exit_status"], told["problems"]) == (2, "", 2, [])
    assert told["error"]


# ---- times, none, traces, copies


@pytest.fixture
def trace():
    t = np.arange(10.0)
    columns = {"t": t, "x": t}
    save_trace(
        Trace(columns=columns, units={"t": "s", "x": "m"}, docs={"t": "time", "x": "way"}, attributes={}), "t.h5"
    )
    return "t.h5"


@pytest.mark.parametrize("ends", [("6", "8"), ("6 s", "8000 ms"), ("0.1 min", "8e6 us")])
def test_plot_takes_a_time_with_its_unit(trace, ends, monkeypatch):
    from detent.page import plots

    seen = []
    monkeypatch.setattr(plots, "plot_signals", lambda *words, **_options: seen.append(words[-1]))
    assert call("plot", trace, "--signals", "x", "--from", ends[0], "--to", ends[1])[0] == 0
    assert seen == [pytest.approx((6.0, 8.0))]


def test_a_time_in_another_unit_is_refused(trace):
    status, out, err = call("plot", trace, "--signals", "x", "--from", "6 m")
    assert (status, out) == (2, "")
    assert "--from" in err


def test_none_takes_a_key_or_a_table_away_where_it_need_not_be_there():
    status, out, _ = call("check", CASCADE, "--set", "limits.jerk=none", "--set", "mechanics.coupling=none", "--json")
    rows = {row["key"]: row for row in json.loads(out)["rows"]}
    assert status == 0
    assert (rows["limits.jerk"]["value"], rows["limits.jerk"]["origin"]) == ("none", "--set")
    assert not any(key.startswith("mechanics.coupling") for key in rows)
    for needed in ("limits.travel", "limits.lowest"):
        assert call("check", CASCADE, "--set", f"{needed}=none")[0] == 2


def test_none_stays_a_word_where_it_is_one():
    status, out, _ = call("check", detent.example("filtered_servo.toml"), "--set", "method.filter=none", "--json")
    assert status == 0
    assert {row["key"]: row["value"] for row in json.loads(out)["rows"]}["method.filter"] == "none"


def test_the_size_of_a_trace_as_csv_is_known_beforehand(trace):
    columns = {"t": np.linspace(0, 1, 5000), "x": np.arange(5000)}
    long = Trace(columns=columns, units={"t": "s", "x": ""}, docs={"t": "", "x": ""}, attributes={})
    save_trace(long, "long.h5")
    save_trace(long, "long.csv")
    assert size_as_csv("long.h5") == pytest.approx(Path("long.csv").stat().st_size, rel=0.1)
    assert size_as_csv(trace) > 0


@pytest.mark.compiled
def test_a_large_csv_trace_is_written_only_where_asked(monkeypatch):
    monkeypatch.setattr(run, "MOST_UNASKED", 1000)
    Path("job.csv").write_text("target [mm]\n30\n", encoding="utf-8")
    words = ("run", CASCADE, "--job", "job.csv", "-o", "out", "--no-compare")
    status, out, _ = call(*words)
    assert status == 0
    assert "--trace h5,csv" in out
    assert {path.name for path in Path("out").iterdir()} == {"report.html", "trace.h5"}
    assert call(*words, "--trace", "h5,csv")[0] == 0
    assert {path.name for path in Path("out").iterdir()} == {"report.html", "trace.h5", "trace.csv"}


def test_examples_copied_twice_are_no_trouble():
    assert call("examples", "--copy", "axes")[0] == 0
    Path("axes/letter.txt").unlink()
    assert call("examples", "--copy", "axes")[0] == 0
    assert Path("axes/letter.txt").exists()
    Path("axes/zoom.toml").write_text("mine", encoding="utf-8")
    status, _, err = call("examples", "--copy", "axes")
    assert (status, "zoom.toml" in err, "letter.txt" in err) == (2, True, False)


@pytest.mark.parametrize(
    ("got", "says"),
    [
        ("limits.travel=0,5 m", 'write a decimal point: "0.5 m"'),
        ("limits.speed=500 mms", 'did you mean "mm/s"?'),
        ("limits.speed=500 ms", 'did you mean "m/s"?'),
        ("limits.acceleration=5 m/s2", 'did you mean "m/s^2"?'),
        ("motor.catalogue=maxon RE40", 'did you mean "maxon RE 40 148867" or "maxon RE 40 148877"?'),
    ],
)
def test_the_answer_fits_what_was_meant(got, says):
    status, _, err = call("check", CASCADE, "--set", got)
    assert (status, says in err) == (2, True), err


@pytest.mark.parametrize(
    "motor", ["maxon RE 35", "maxon RE 4", "maxon RE 65 353298", "Faulhaber 2657W012CXR", "Pittman 14205S004"]
)
def test_a_motor_of_another_size_is_never_the_one_that_was_meant(motor):
    _, _, err = call("check", CASCADE, "--set", f"motor.catalogue={motor}")
    assert "did you mean" not in err
    assert "another motor" in err
    assert "state its constants in [motor]: torque_constant, resistance, rotor_inertia" in err


FAR = {
    "cascade.toml": "target [mm]\n9999\n",
    "print_head.toml": "x" * 200,
    "rotary_table.toml": "[[step]]\ngo = 77\n",
    "stage.toml": "x [mm]\n9999\n",
}


@pytest.mark.compiled
@pytest.mark.parametrize("name", FAR)
def test_a_job_that_does_not_fit_is_named_by_the_path_given(name):
    job = Path("jobs") / {"print_head.toml": "job.txt", "rotary_table.toml": "job.toml"}.get(name, "job.csv")
    job.parent.mkdir()
    job.write_text(FAR[name], encoding="utf-8")
    status, _, err = call("run", detent.example(name), "--job", job)
    assert (status, err.startswith(str(job))) == (2, True), err
    with pytest.raises(InputError) as refused:
        detent.load(detent.example(name)).run(str(job), every=0)
    assert {problem.file for problem in refused.value.problems} == {str(job)}
