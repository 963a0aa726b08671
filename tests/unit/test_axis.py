import ast
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import detent
from detent import axis as axis_module
from detent.errors import DetentError, InputError
from detent.methods.moves.job import load_moves
from detent.methods.print_head.page import print_page
from detent.methods.print_head.print_job import load_job
from detent.methods.print_head.run import SIGNALS
from detent.record.recorder import ROWS

pytestmark = pytest.mark.compiled

AXIS, LETTER = detent.example("print_head.toml"), detent.example("letter.txt")


@pytest.fixture(scope="module")
def run() -> detent.Run:
    return detent.load(AXIS).run(LETTER)


def test_the_words_of_the_package_are_those_it_promises() -> None:
    for name in detent.__all__:
        assert getattr(detent, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'Gripper'; it has Analysed, Axis, Compared, "):
        _ = detent.Gripper


@pytest.mark.process
def test_completion_offers_the_words_of_the_package_before_any_is_used() -> None:
    code = (
        "import detent, sys; print(dir(detent)); assert 'detent.axis' not in sys.modules; detent.load; "
        "print(dir(detent))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, text=True)
    before, after = map(ast.literal_eval, done.stdout.splitlines())
    assert before == after
    assert {name for name in before if not name.startswith("_")} == set(detent.__all__) - {"__version__"}


def test_the_version_is_the_projects() -> None:
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8"))
    assert detent.__version__ == project["project"]["version"]


@pytest.mark.process
def test_importing_the_package_loads_nothing_heavy() -> None:
    code = (
        "import sys, detent; detent.examples(); "
        "print([n for n in ('numba', 'numpy', 'pint', 'pydantic', 'h5py', 'matplotlib', 'typer') if n in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], env={"PYTHONPATH": str(Path(detent.__file__).parents[1])}, capture_output=True,
        check=True,
    )  # fmt: skip
    assert done.stdout.strip() == b"[]"


JOBS = {
    "index_sequence.toml": "rotary_table.toml", "zoom_sequence.toml": "zoom.toml", "tiles.csv": "stage.toml",
    "turn_moves.csv": "turntable.toml", "photo_places.csv": "photo_table.toml",
}  # fmt: skip
"""Jobs that only an axis can read, and an axis they are for."""


def test_examples_are_files_that_load() -> None:
    names = [path.name for path in detent.examples()]
    assert {"print_head.toml", "letter.txt", "brochure.prn"} <= set(names)
    assert names == sorted(names)
    for path in detent.examples():
        assert detent.example(path.name) == path
        if path.suffix == ".ipynb":
            continue  # tests/docs/test_examples.py runs it
        if path.name in JOBS:
            assert detent.load(detent.example(JOBS[path.name])).load_job(path).count
        elif path.suffix == ".csv" or "moves" in path.name:
            assert load_moves(path).count
        else:
            assert detent.load(path).check().rows if path.suffix == ".toml" else load_job(path).lines


def test_an_example_that_is_not_there_is_said_with_those_that_are() -> None:
    with pytest.raises(
        DetentError,
        match=r"example 'robot\.toml': .* choose one of brochure\.prn, cascade\.ipynb, cascade\.toml, filtered_",
    ):
        detent.example("robot.toml")


def test_an_axis_has_its_name_its_values_and_their_check() -> None:
    axis = detent.load(str(AXIS), ["axis.name=left head", "drive.supply=40 V"])
    assert axis.name == "left head"
    assert axis.spec.drive.supply == 40.0
    report = axis.check()
    origins = {row.key: row.origin for row in report.rows}
    assert origins["drive.supply"] == "--set"
    assert origins["limits.travel"] == f"{AXIS} line 15"
    assert origins["method.trim"] == "default"
    assert origins["motor.resistance"].startswith("catalogue ")


def test_a_file_with_errors_tells_all_of_them(tmp_path: Path) -> None:
    text = AXIS.read_text(encoding="utf-8").replace('"14.5 in"', '"14.5 V"').replace("carriage_mass", "carriage_mas")
    (tmp_path / "bad.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        detent.load(tmp_path / "bad.toml", ["drive.supply=5 m"])
    assert {problem.key for problem in caught.value.problems} == {
        "limits.travel", "mechanics.carriage_mas", "drive.supply",
    }  # fmt: skip


def test_an_axis_with_other_values_is_the_one_that_a_file_would_give() -> None:
    cascade = detent.example("cascade.toml")
    axis = detent.load(cascade, ["limits.speed=400 mm/s"])
    other = axis.replace({"limits.travel": 0.4, "method": {"position_gain": np.float64(30.0)}}, drive={"delay": 2})
    written = ["limits.speed=400 mm/s", "limits.travel=400 mm", "method.position_gain=30", "drive.delay=2"]
    assert other.spec == detent.load(cascade, written).spec
    assert axis.spec == detent.load(cascade, ["limits.speed=400 mm/s"]).spec
    origins = {row.key: row.origin for row in other.check().rows}
    assert origins["limits.speed"] == "--set"
    assert origins["limits.travel"] == "replace"
    assert origins["limits.jerk"] == f"{cascade} line 16"
    again = other.replace({"drive.delay": 1, "limits.jerk": None})
    assert again.spec.method.position_gain == 30.0
    assert again.spec.limits.jerk == detent.load(cascade).replace({"limits.jerk": None}).spec.limits.jerk != 200.0


def test_what_follows_from_a_replaced_value_follows_from_the_new_one() -> None:
    axis = detent.load(AXIS)
    other = axis.replace(motor={"catalogue": "maxon A-max 26 110940"})
    assert other.spec.motor.resistance != axis.spec.motor.resistance
    assert other.check().to_dict()["derived"] != axis.check().to_dict()["derived"]


def test_an_axis_needs_no_file() -> None:
    tables = tomllib.loads(AXIS.read_text(encoding="utf-8"))
    axis = detent.load(tables)
    assert axis.spec == detent.load(AXIS).spec
    tables["drive"]["supply"] = 38.0
    assert detent.load(tables).spec == axis.spec
    assert {row.origin.split()[0] for row in axis.check().rows} == {"dictionary", "default", "catalogue"}
    assert axis.run(LETTER, every=0).to_dict()["file"] == "dictionary"
    with pytest.raises(InputError) as caught:
        detent.load({"axis": {"name": "a", "method": "cascade"}, "limits": {"speed": 1.0, "travell": 2.0}})
    problems = {(problem.file, problem.line, problem.key) for problem in caught.value.problems}
    assert {("dictionary", 0, "limits.travell"), ("dictionary", 0, "encoder")} <= problems


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"method.position_gian": 3.0}, r'^replace method\.position_gian: .* did you mean "position_gain"\?'),
        ({"limits.speed": "3 V"}, r"^replace limits\.speed: got 3 V; expected: a velocity"),
        ({"limits.speed": -1.0}, r"^replace limits\.speed: got -1\.0 m/s; expected: a velocity above 0"),
        ({"limits.speed": float("nan")}, r"^replace limits\.speed: got nan m/s"),
        ({"limits.speed": True}, r"^replace limits\.speed: got true"),
        ({"limits.speed": {"top": 1.0}}, r"^replace limits\.speed: got a table"),
        ({"limits": 3}, r"^replace limits: got 3; expected: the table"),
        ({"axis.method": "cascde"}, r'^replace axis\.method: .* did you mean "cascade"\?'),
        ({"limits.travel": None}, r"limits\.travel: got nothing"),
        ({"limits": 3, "limits.speed": 1.0}, r"^limits\.speed: got a value in limits, which is one itself"),
    ],
)
def test_values_that_will_not_do_are_refused_as_those_of_a_file(changes: dict[str, Any], says: str) -> None:
    with pytest.raises(DetentError, match=says):
        detent.load(detent.example("cascade.toml")).replace(changes)


def test_a_run_tells_what_happened(run: detent.Run) -> None:
    assert run.done
    assert run.failure == ""
    found = run.to_dict()
    assert (found["axis"], found["file"], found["job"]) == ("print head", str(AXIS), "letter.txt")
    assert len(found["lines"]) == 11


def test_a_run_records_what_the_report_needs_every_tenth_tick(run: detent.Run) -> None:
    assert run.trace is not None
    assert run.trace.signals == SIGNALS
    np.testing.assert_allclose(np.diff(run.trace.time), 0.4e-3, rtol=1e-9)
    assert run.trace.time[-1] == pytest.approx(run.result.time_end, abs=0.4e-3)
    assert run.trace.units["plant.train.current"] == "A"
    assert run.trace.docs["controller.head.state"]
    assert run.trace.attributes == {"axis": "print head", "job": "letter.txt", "seed": 1, "fidelity": "averaged"}
    assert len(run.trace) > ROWS // 2


def test_signals_and_rows_can_be_chosen() -> None:
    done = detent.load(AXIS).run(
        load_job(LETTER), signals=["controller.head.right.*", "plant.train.energy"], every=1000
    )
    assert done.trace is not None
    assert done.trace.signals[-1] == "plant.train.energy"
    assert set(done.trace.signals[:-1]) >= {"controller.head.right.slope", "controller.head.right.friction"}
    assert done.trace["controller.head.right.slope"][-1] == done.result.identified["right"].slope
    assert np.diff(done.trace.time).min() == pytest.approx(0.04)


@pytest.mark.parametrize(("signals", "every", "says"), [(["no.such"], 10, "no such register"), (None, -1, "1 or more")])
def test_what_cannot_be_recorded_is_refused(signals: list[str] | None, every: int, says: str) -> None:
    with pytest.raises(DetentError, match=says):
        detent.load(AXIS).run(LETTER, signals=signals, every=every)


def test_signals_can_be_checked_before_a_run() -> None:
    axis = detent.load(AXIS)
    axis.check_signals(["controller.head.*", "all", "plant.train.current"])
    with pytest.raises(DetentError, match=r"did you mean 'plant\.train\.current'"):
        axis.check_signals(["plant.train.curent"])


def test_a_run_without_record_says_so_when_asked_for_it(tmp_path: Path) -> None:
    done = detent.load(AXIS).run(LETTER, every=0)
    assert done.done
    assert done.trace is None
    for wanted in (
        lambda: done.save(tmp_path / "t.csv"),
        lambda: done.plot(["plant.train.current"], tmp_path / "t.png"),
    ):
        with pytest.raises(DetentError, match="this run recorded nothing; run with every >= 1"):
            wanted()
    assert "Printed" in done.report(tmp_path / "r.html").read_text(encoding="utf-8")


def test_a_job_that_is_missing_is_an_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nothing\.txt"):
        detent.load(AXIS).run(tmp_path / "nothing.txt")


def test_an_axis_that_fails_gives_a_run_all_the_same() -> None:
    done = detent.load(AXIS, ["disturbance.obstacle.position=7 in"]).run(LETTER)
    assert not done.done
    assert "obstructed" in done.failure
    assert done.trace is not None
    assert done.to_dict()["done"] is False


@pytest.mark.parametrize("suffix", [".h5", ".csv", ".parquet"])
def test_a_saved_trace_is_the_recorded_one(run: detent.Run, tmp_path: Path, suffix: str) -> None:
    assert run.trace is not None
    loaded = detent.load_trace(run.save(tmp_path / f"trace{suffix}"))
    assert list(loaded) == list(run.trace)
    for name in loaded:
        np.testing.assert_array_equal(loaded[name], run.trace[name])
    assert loaded.units == run.trace.units


def test_a_streamed_trace_is_the_one_in_memory(run: detent.Run, tmp_path: Path) -> None:
    done = detent.load(AXIS).run(LETTER, trace_file=tmp_path / "stream.h5")
    run.save(tmp_path / "memory.h5")
    stream: Any
    memory: Any
    with h5py.File(tmp_path / "stream.h5") as stream, h5py.File(tmp_path / "memory.h5") as memory:
        assert dict(stream.attrs) == dict(memory.attrs)
        assert list(stream["trace"].attrs["columns"]) == list(memory["trace"].attrs["columns"])
        for name in memory["trace"]:
            np.testing.assert_array_equal(stream["trace"][name][()], memory["trace"][name][()])
    assert done.trace is not None
    assert run.trace is not None
    assert len(done.trace) == len(run.trace)


def test_memory_is_bounded_and_the_file_is_not(
    run: detent.Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert run.trace is not None
    monkeypatch.setattr(axis_module, "KEPT_ROWS", 20_000)
    done = detent.load(AXIS).run(LETTER, trace_file=tmp_path / "long.h5")
    assert done.trace is not None
    assert len(done.trace) == 20_000
    assert len(detent.load_trace(tmp_path / "long.h5")) == len(run.trace)
    # The report draws from what was kept, and from the first lines when the last ones are beyond it.
    page = print_page(done.axis.spec, done.result, done.trace)
    (errors,) = [chart for chart in page.charts if chart["id"] == "histogram"]
    assert sum(sum(series["y"]) for series in errors["series"]) == run.result.columns
    (profile,) = [figure for figure in page.figures if figure.charts and figure.charts[0]["id"] == "profile-speed"]
    assert int(profile.title.split()[1].rstrip(",")) < 11


def test_the_report_is_one_file_with_its_small_print(run: detent.Run, tmp_path: Path) -> None:
    run.settings["command"] = "detent run <here>"
    path = run.report(str(tmp_path / "report.html"))
    assert path == tmp_path / "report.html"
    text = path.read_text(encoding="utf-8")
    assert "✔ Printed" in text
    for word in ("averaged", str(AXIS), "detent run &lt;here&gt;", "<dt>seed</dt><dd>1</dd>"):
        assert word in text
    assert [entry.name for entry in tmp_path.iterdir()] == ["report.html"]


def test_signals_are_drawn(run: detent.Run, tmp_path: Path) -> None:
    run.plot(["plant.train.velocity", "controller.head.*"], tmp_path / "plot.svg", (7.0, 8.5))
    text = (tmp_path / "plot.svg").read_text(encoding="utf-8")
    for word in ("plant.train.velocity", "controller.head.drive_cmd", "[count]", "time [s]", "print head · letter.txt"):
        assert word in text


def test_a_figure_needs_no_file(run: detent.Run, tmp_path: Path) -> None:
    figure: Any = run.plot(["plant.train.velocity", "plant.train.current"], t_range=(7.0, 8.5))
    assert [area.get_ylabel().split("\n")[0] for area in figure.axes] == ["plant.train.velocity", "plant.train.current"]
    assert figure._repr_png_().startswith(b"\x89PNG")
    figure.savefig(tmp_path / "own.svg", metadata={"Date": None})
    text = (tmp_path / "own.svg").read_text(encoding="utf-8")
    assert "plant.train.velocity" in text  # text stays text, as in a file that `plot` itself writes
    assert len(run.plot(t_range=(7.0, 7.1)).axes) == len({run.trace.units[name] for name in run.trace.signals})


def test_whatever_stands_at_a_prompt_takes_one_screen(run: detent.Run) -> None:
    for name in ("print_head.toml", "cascade.toml", "stage.toml"):
        axis = detent.load(detent.example(name))
        for shown in (axis, axis.check(), axis.file):
            assert_one_screen(shown)
    for shown in (run, run.trace, run.result, run.result.job, run.axis.timing(7.6, 1e-3)):
        assert_one_screen(shown)
    assert repr(run).startswith("Printed letter.txt on print head.")
    assert "worst 5.7 µm" in repr(run)
    checked = detent.load(detent.example("cascade.toml"), ["method.position_gain=400"]).check()
    assert all(str(one)[:60] in repr(checked) for one in checked.warnings)
    assert len(checked.warnings) > 0


def assert_one_screen(shown: Any) -> None:
    lines = repr(shown).split("\n")
    assert 2 <= len(lines) <= 36
    assert max(map(len, lines)) <= 110
    page = shown._repr_html_()
    assert page.count("<table>") == page.count("</table>") > 0
    assert page.count("<tr>") >= 3


def test_progress_is_told() -> None:
    told: list[float] = []
    detent.load(AXIS).run(LETTER, every=0, progress=lambda share, _text: told.append(share))
    assert told[0] == 0.0
    assert told[-1] == 1.0


def test_three_drives_are_compared_on_the_drifted_machine() -> None:
    (found,) = detent.load(AXIS, ["disturbance.motor_constant=10 %"]).compare()
    worst = np.abs(found.errors).max(axis=(1, 2))
    assert found.methods == ("power-on default", "nominal table", "identified")
    assert worst[2] < 0.03 < worst[1] < worst[0]


def test_a_job_of_another_kind_is_refused() -> None:
    moves = load_moves(detent.example("moves.csv"))
    with pytest.raises(DetentError, match=r"print head: got a MoveJob; expected: a PrintJob"):
        detent.load(AXIS).run(moves)
    with pytest.raises(DetentError, match=r"phase servo: got a PrintJob; expected: a MoveJob"):
        detent.load(detent.example("phase_servo.toml")).timing(1e-3, 1e-6, job=load_job(LETTER))
