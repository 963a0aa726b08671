"""No command replaces a file that detent did not write but by --force; an axis file of somebody gets values."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.identify_files import AXIS, write_log
from tests.unit.test_cli import call

import detent
from detent.errors import AxisError
from detent.files.marks import is_ours, is_signed
from detent.identify.fit.verdict import Refusal
from detent.identify.identified import Identified
from detent.record.trace import Trace
from detent.record.trace_files import save_trace

CASCADE, MOVES = str(detent.example("cascade.toml")), str(detent.example("slide_moves.toml"))
PHASE, STAGE = str(detent.example("phase_servo.toml")), str(detent.example("stage.toml"))
MINE = b"what took a day\n"
TOLD = "a file that detent did not write, or that was edited since"


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def mine(name: str) -> Path:
    path = Path(name)
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(MINE)
    return path


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("out/report.html", ["run", CASCADE, "--job", MOVES, "--output", "out"]),
        ("out/trace.parquet", ["run", CASCADE, "--job", MOVES, "--output", "out", "--trace", "h5"]),
        ("out/trace.csv", ["run", CASCADE, "--replay", "no.csv", "--output", "out"]),
        ("timing.png", ["timing", PHASE, "--at", "1 ms"]),
        ("timing.vcd", ["timing", PHASE, "--at", "1 ms"]),
        ("comparison.html", ["compare", PHASE]),
        ("a.svg", ["compare", PHASE, "--figure", "a.svg"]),
        ("out/group_a.h", ["envelope", STAGE, "--output", "out"]),
        ("axis.toml", ["new", "cascade", "axis.toml"]),
        ("out/letter.txt", ["examples", "--copy", "out"]),
        ("job.toml", ["identify", "no.csv", "--job", "job.toml"]),
        ("report.html", ["identify", "no.csv", "--report", "report.html"]),
        ("axis.toml", ["identify", "no.csv", "--axis", CASCADE, "--write", "axis.toml"]),
        ("report.html", ["analyse", "no.csv", "--report", "report.html"]),
    ],
)
def test_a_file_of_somebody_stays_and_nothing_is_begun(name: str, words: list[str]) -> None:
    """Each of them was replaced without a word; the logs of the last ones, which are not there, are not looked for."""
    if name == "out/group_a.h":
        name = f"out/{next(iter(detent.load(STAGE).envelopes()))}.h"
    path = mine(name)
    answer = call(*words)
    assert (answer.status, answer.out) == (2, "")
    assert f"{path}: got {TOLD}" in answer.err
    assert "--force" in answer.err
    assert [(one, one.read_bytes()) for one in Path().rglob("*") if one.is_file()] == [(path, MINE)]
    assert [one.name for one in path.parent.iterdir()] == [path.name]


def test_problems_for_programs_name_the_files() -> None:
    mine("out/report.html"), mine("out/trace.csv")
    answer = call("run", CASCADE, "--job", MOVES, "--output", "out", "--json")
    assert answer.status == 2
    assert [one["file"] for one in answer.data["problems"]] == ["out/report.html", "out/trace.csv"]


@pytest.mark.compiled
def test_a_run_replaces_its_own_files_and_by_force_those_of_others() -> None:
    words = ["run", PHASE, "--job", str(detent.example("moves.csv")), "--no-compare", "--output", "out"]
    words += ["--every", "9999"]
    assert [call(*words, "--trace", "h5,csv").status for _ in range(2)] == [0, 0]
    mine("out/trace.csv")
    assert call(*words, "--trace", "h5", "--force").status == 0
    assert sorted(path.name for path in Path("out").iterdir()) == ["report.html", "trace.h5"]


def test_a_picture_is_drawn_again_and_by_force_over_anything() -> None:
    save_trace(Trace(columns={"t": np.arange(3.0), "x": np.arange(3.0)}), "trace.h5")
    words = ["plot", "trace.h5", "--signals", "x", "--output", "plot.svg"]
    assert [call(*words).status for _ in range(2)] == [0, 0]
    mine("plot.svg")
    answer = call(*words)
    assert (answer.status, Path("plot.svg").read_bytes()) == (2, MINE)
    assert call(*words, "--force").status == 0
    assert is_ours(Path("plot.svg"))


def test_a_header_that_was_edited_stays() -> None:
    words = ["envelope", STAGE, "--output", "out", "--motor", next(iter(detent.load(STAGE).envelopes()))]
    assert [call(*words).status for _ in range(2)] == [0, 0]
    (header,) = Path("out").glob("*.h")
    written = header.read_bytes()
    header.write_bytes(written.replace(b"phase", b"PHASE", 1))
    assert call(*words).status == 2
    assert b"PHASE" in header.read_bytes()
    assert call(*words, "--force").status == 0
    assert header.read_bytes() == written


def test_a_starting_file_is_begun_once() -> None:
    """It is to be edited: not even one of detent's own is replaced by it unasked."""
    assert call("new", "cascade", "axis.toml").status == 0
    begun = Path("axis.toml").read_bytes()
    answer = call("new", "phase_servo", "axis.toml")
    assert answer.status == 2
    assert "--force" in answer.err
    assert Path("axis.toml").read_bytes() == begun
    assert call("new", "phase_servo", "axis.toml", "--force").status == 0
    assert b"phase_servo" in Path("axis.toml").read_bytes()


def test_examples_are_copied_over_edited_ones_by_force_only() -> None:
    assert [call("examples", "--copy", "out").status for _ in range(2)] == [0, 0]
    mine("out/letter.txt")
    assert call("examples", "--copy", "out").status == 2
    assert call("examples", "--copy", "out", "--force").status == 0
    assert Path("out/letter.txt").read_bytes() == detent.example("letter.txt").read_bytes()


# ---- axis files


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> str:
    return write_log(tmp_path_factory.mktemp("logs") / "bench.csv")


@pytest.fixture(scope="module")
def found(log: str) -> Identified:
    return detent.identify_axis(log)


WINDOWS = b"\xef\xbb\xbf" + AXIS.replace('"4 kg" ', "'4400 g' ").replace("\n", "\r\n").encode()


@pytest.mark.compiled
def test_an_axis_file_of_somebody_gets_the_values_and_keeps_the_rest(log: str) -> None:
    """Without --axis it was replaced as a whole, with all that was written into it by hand."""
    Path("slide.toml").write_bytes(WINDOWS)
    answer = call("identify", log, "--write", "slide.toml")
    assert answer.status == 0, answer.err
    lines = answer.out.splitlines()
    told = lines[lines.index("written: slide.toml") + 1 :]
    assert any(line.startswith("  mechanics.motor_mass: '4400 g' -> '39") for line in told)
    assert "differs from the axis file: mass: the file states 4.4 kg" in answer.out
    made = Path("slide.toml").read_bytes()
    assert made.count(b"\n") == made.count(b"\r\n")
    same = [
        line
        for line in WINDOWS.split(b"\r\n")
        if not line.startswith((b"motor_mass", b"coul", b"stat", b"visc", b"delay"))
    ]
    before, table, after = made.partition(b"\r\n[tolerance]\r\n")
    assert table
    assert b"mass" in after
    assert [line for line in before.split(b"\r\n") if line in same] == same
    assert b"# weighed; identified, 4400 g before: 95 %: " in made
    assert call("check", "slide.toml").status == 0
    data = call("identify", log, "--write", "slide.toml", "--json").data
    assert (data["changes"], data["outside"]) == ([], [])
    assert Path("slide.toml").read_bytes() == made


@pytest.mark.compiled
def test_an_axis_file_that_identify_wrote_is_replaced_until_it_is_edited(found: Identified) -> None:
    path = found.save("new.toml")
    written = path.read_text("utf-8")
    assert is_signed(written)
    assert found.changes(path) == []
    assert found.save(path).read_text("utf-8") == written
    path.write_text(written.replace("[limits]", "[limits]  # mine"), encoding="utf-8")
    assert "[limits]  # mine" in found.save(path).read_text("utf-8")
    assert found.changes(path, force=True) == []
    assert found.save(path, force=True).read_text("utf-8") == written


@pytest.mark.compiled
def test_what_is_made_from_another_axis_file_is_replaced_too(found: Identified) -> None:
    base, made = Path("bench.toml"), Path("new.toml")
    base.write_text(AXIS, encoding="utf-8")
    found = replace(found, axis=AXIS, axis_name="bench.toml")
    for _ in range(2):
        assert is_signed(found.save(made).read_text("utf-8"))
    assert base.read_text("utf-8") == AXIS
    made.write_text(AXIS, encoding="utf-8")
    with pytest.raises(detent.InputError, match=TOLD):
        found.save(made)
    assert made.read_text("utf-8") == AXIS
    assert is_signed(found.save(made, force=True).read_text("utf-8"))


@pytest.mark.compiled
def test_the_file_of_the_axis_gets_values_as_it_stands_now(found: Identified) -> None:
    """What was written into it after it had been read was lost."""
    base, link = Path("bench.toml"), Path("link.toml")
    base.write_text(f"{AXIS}# meanwhile\n", encoding="utf-8")
    link.symlink_to(base)
    replace(found, axis=AXIS, axis_name="bench.toml").save(link)
    assert link.is_symlink()
    assert "# weighed; identified" in base.read_text("utf-8")
    assert "# meanwhile\n\n[tolerance]\n" in base.read_text("utf-8")


@pytest.mark.compiled
def test_a_file_that_is_no_axis_stays(found: Identified) -> None:
    path = mine("other.toml")
    with pytest.raises(detent.InputError):
        found.save(path)
    assert path.read_bytes() == MINE
    refused = replace(found, found=replace(found.found, refusals=(Refusal("wrong sign", "", "", ()),)))
    assert refused.verdict == "refused"
    path.write_text(AXIS, encoding="utf-8")
    for force in (False, True):
        with pytest.raises(AxisError):
            refused.save(path, force=force)
        assert path.read_text("utf-8") == AXIS


@pytest.mark.compiled
def test_job_and_report_of_an_identification_keep_to_it_too(found: Identified) -> None:
    for name, write in (("job.toml", found.save_job), ("report.html", found.report)):
        mine(name)
        with pytest.raises(detent.InputError, match=TOLD):
            write(name)
        assert Path(name).read_bytes() == MINE
        write(name, force=True)
        write(name)


def test_every_word_that_writes_has_force() -> None:
    trace = Trace(columns={"t": np.arange(3.0), "x": np.arange(3.0)})
    for name in ("a.h5", "a.csv", "a.parquet"):
        mine(name)
        with pytest.raises(detent.InputError, match=TOLD):
            save_trace(trace, name)
        save_trace(trace, name, force=True)
        assert Path(name).read_bytes() != MINE
    model = detent.load(CASCADE).linear()
    mine("bode.png")
    with pytest.raises(detent.InputError, match=TOLD):
        model.bode(path="bode.png")
    model.bode(path="bode.png", force=True)
    model.bode(path="bode.png")
