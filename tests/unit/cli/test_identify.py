"""The command `detent identify`: what it says, what it writes, and what it refuses."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from tests.identify_files import AXIS, one_way, recorded, write_log
from tests.unit.test_cli import call

import detent

pytestmark = pytest.mark.compiled

STAGE = str(detent.example("stage.toml"))


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def bench() -> str:
    Path("bench.toml").write_text(AXIS, encoding="utf-8")
    return "bench.toml"


def test_a_trusted_log_is_status_0() -> None:
    answer = call("identify", write_log(Path("log.csv")))
    assert answer.status == 0, answer.err
    lines = answer.out.splitlines()
    assert re.fullmatch(r"Trusted: \d+ constants of log\.csv\.", lines[0])
    assert any(re.match(r"mass +[\d.]+ ± [\d.]+ +[\d.]+ to [\d.]+ +kg +yes", line) for line in lines)
    assert any(line.startswith("  guessed: time: column") for line in lines)
    assert any(re.match(r"per direction +[\d.]+% +\+[\d.]+", line) for line in lines)
    assert any(re.match(r"0\.5 s +[\d.]+\sµm", line) for line in lines)


def test_a_refused_log_is_status_1_and_says_what_to_record() -> None:
    answer = call("identify", write_log(Path("log.csv"), one_way()), "--write", "axis.toml", "--job", "job.toml")
    assert answer.status == 1
    lines = answer.out.splitlines()
    assert lines[0] == "Refused: nothing in log.csv is trusted."
    assert lines[1].startswith("  too short: ")
    assert lines[2].startswith("    -> record ")
    assert "not written: no axis file" in answer.out
    assert not Path("axis.toml").exists()
    assert Path("job.toml").exists()


def test_the_job_runs_on_the_axis() -> None:
    axis = bench()
    assert call("identify", write_log(Path("log.csv"), one_way()), "--axis", axis, "--job", "job.toml").status == 1
    answer = call("run", axis, "--job", "job.toml", "--every", "0", "--no-compare")
    assert answer.status == 0, answer.out


def test_a_written_axis_replays_the_log() -> None:
    answer = call("identify", write_log(Path("log.csv")), "--write", "new.toml")
    assert answer.status == 0
    assert answer.out.splitlines()[-1] == "written: new.toml"
    head = Path("new.toml").read_text("utf-8")
    assert "detent run THIS_FILE --replay log.csv" in head
    assert call("check", "new.toml").status == 0
    answer = call("run", "new.toml", "--replay", "log.csv", "--every", "0", "--json")
    assert answer.status == 0, answer.err
    compared = {one["signal"]: one for one in answer.data["compared"]}
    assert compared["position"]["relative"] < 1e-3


def test_options_that_read_the_log_are_part_of_the_replay() -> None:
    log = write_log(Path("log.csv"), force="u")
    answer = call("identify", log, "--column", "force=u [N]", "--write", "new.toml")
    assert answer.status == 0, answer.out
    assert "--replay log.csv --column 'force=u [N]'" in Path("new.toml").read_text("utf-8")


def test_a_mapping_file_names_the_columns() -> None:
    log = write_log(Path("log.csv"), force="u", position="p")
    Path("map.toml").write_text('[columns]\nforce = "u [N]"\nposition = "p [m]"\n', encoding="utf-8")
    answer = call("identify", log, "--map", "map.toml", "--json")
    assert answer.status == 0, answer.err
    assert answer.data["logs"][0]["columns"]["force"]["column"] == "u"


def test_stated_constants_are_held_against_the_log_and_replaced() -> None:
    axis = bench()
    text = Path(axis).read_text("utf-8").replace('"4 kg"', '"4.4 kg"')
    Path(axis).write_text(text, encoding="utf-8")
    answer = call("identify", write_log(Path("log.csv")), "--axis", axis, "--write", axis)
    assert answer.status == 0, answer.err
    assert "differs from the axis file: mass: the file states 4.4 kg, the log " in answer.out
    assert "# weighed; identified, 4.4 kg before: 95 %: " in Path(axis).read_text("utf-8")
    assert call("identify", "log.csv", "--axis", axis, "--json").data["outside"] == []


def test_json_holds_everything() -> None:
    data = call("identify", write_log(Path("log.csv")), "--axis", bench(), "--json", "--job", "job.toml").data
    assert data["verdict"] == "trusted"
    assert {"mass", "coulomb.positive", "delay"} <= {one["name"] for one in data["constants"]}
    assert data["correlation"]["matrix"][0][0] == pytest.approx(1.0)
    assert data["axis"] == "bench.toml"
    assert data["files"] == ["job.toml"]
    assert data["not_written"] == []


def test_the_report_is_one_file() -> None:
    answer = call("identify", write_log(Path("log.csv")), "--report", "report.html")
    assert answer.status == 0, answer.err
    page = Path("report.html").read_text("utf-8")
    assert "log.csv" in page
    assert "</html>" in page


def test_several_logs_are_one_axis() -> None:
    found = recorded()
    half = len(found["t [s]"]) // 2
    logs = [
        write_log(Path(f"{name}.csv"), {head: values[part] for head, values in found.items()})
        for name, part in (("a", slice(0, half)), ("b", slice(half, None)))
    ]
    answer = call("identify", *logs)
    assert answer.status == 0, answer.out
    assert answer.out.startswith("Trusted:")
    assert " of a.csv and b.csv." in answer.out.splitlines()[0]


def test_the_api_has_the_same_words() -> None:
    log = write_log(Path("log.csv"))
    seen: list[float] = []
    found = detent.identify_axis(log, progress=lambda share, _text: seen.append(share))
    assert found.verdict == "trusted"
    assert not found.refusals
    assert found.constants["mass"].holds(4.0)
    assert set(found.trusted) == set(found.constants)
    assert found.save("new.toml") == Path("new.toml")
    assert detent.load("new.toml").name == "log"
    assert found.save_job("job.toml").exists()
    assert json.loads(json.dumps(found.to_dict()))["axis"] is None
    assert 0.0 <= min(seen) <= max(seen) <= 1.0


# ---- wrong input is status 2, and a message


def wrong(name: str, content: bytes | None) -> str:
    if content is not None:
        Path(name).write_bytes(content)
    return name


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("absent.csv", None, "no such file"),
        (".", None, ""),
        ("empty.csv", b"", "empty"),
        ("rubbish.csv", bytes(range(256)) * 40, ""),
        ("rubbish.mat", bytes(range(256)) * 40, ""),
        ("rubbish.h5", b"\x89HDF\r\n\x1a\n" + bytes(500), ""),
        ("rubbish.npz", b"PK\x03\x04" + bytes(500), ""),
        ("short.csv", b"t [s],position [m],force [N]\n0,0,1\n1,2,3\n2,3,1\n", "at least 10 rows"),
        ("still.csv", b"t [s],force [N]\n" + b"".join(b"%d,%d\n" % (k, k % 7) for k in range(50)), "position"),
        ("free.csv", b"t [s],position [m]\n" + b"".join(b"%d,%d\n" % (k, k * k) for k in range(50)), "drives the axis"),
    ],
)
def test_a_log_that_is_none_is_status_2(name: str, content: bytes | None, words: str) -> None:
    answer = call("identify", wrong(name, content))
    assert answer.status == 2
    assert words in answer.err
    assert "expected" in answer.err
    assert "Traceback" not in answer.err + answer.out


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--column", "force=absent"), "absent"),
        (("--column", "force"), "SIGNAL=COLUMN"),
        (("--column", "strength=force"), "strength"),
        (("--column", "force=force [mm]"), "mm"),
        (("--map", "absent.toml"), "no such file"),
        (("--effort", "current"), "current that drives the axis"),
        (("--effort", "rubbish"), "rubbish"),
        (("--method", "guess"), "regression or output-error"),
        (("--axis", "absent.toml"), "no such file"),
        (("--axis", STAGE), "expected: cascade"),
        (("--axis", "log.csv"), "log.csv:1"),
        (("--write", "axis.txt"), "use one of .toml"),
        (("--report", "report.toml"), "use one of .html"),
        (("--job", "absent/job.toml"), "no folder absent"),
        (("--write", "same.toml", "--job", "same.toml"), "a different file"),
    ],
)
def test_a_wrong_option_is_status_2(options: tuple[str, ...], words: str) -> None:
    answer = call("identify", write_log(Path("log.csv")), *options)
    assert answer.status == 2
    assert words in answer.err
    assert not answer.out


def test_a_file_that_cannot_be_written_is_status_2_beside_what_was_found() -> None:
    Path("folder.toml").mkdir()
    answer = call("identify", write_log(Path("log.csv")), "--job", "folder.toml")
    assert answer.status == 2
    assert "it is a folder" in answer.err


def test_an_axis_of_another_motion_is_status_2() -> None:
    answer = call("identify", write_log(Path("log.csv")), "--axis", str(detent.example("turntable.toml")))
    assert answer.status == 2
    assert "got a position in m; expected: rad" in answer.err


def test_no_limits_for_a_job_leave_the_findings_and_status_2() -> None:
    found = recorded()
    rests = found | {"position [m]": 0.0 * found["position [m]"] + 0.1}
    answer = call("identify", write_log(Path("log.csv"), rests), "--job", "job.toml")
    assert answer.status == 2
    assert answer.out.startswith("Refused:")
    assert "not written: log.csv: got a log without motion" in answer.out


@pytest.mark.process
def test_an_identification_loads_nothing_that_takes_longer_than_its_fit(tmp_path: Path) -> None:
    """Of SciPy's packages these load longer than 25 s at 1 kHz to identify; the schema of axis files as long."""
    heavy = {"scipy.signal", "scipy.stats", "detent.methods.cascade.schema", "matplotlib"}
    code = (
        "import sys\nfrom detent.cli.app import main\nsys.argv = ['detent', 'identify', sys.argv[1]]\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        f"print('loaded:', sorted({heavy} & set(sys.modules)))"
    )
    command = [sys.executable, "-c", code, write_log(tmp_path / "log.csv")]
    path = os.environ | {"PYTHONPATH": str(Path(detent.__file__).parents[1])}
    done = subprocess.run(command, env=path, capture_output=True, text=True, check=True)
    assert done.stdout.startswith("Trusted: ")
    assert done.stdout.splitlines()[-1] == "loaded: []"
