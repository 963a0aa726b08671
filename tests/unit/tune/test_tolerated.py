"""`detent tolerance` as a command and in Python: what it says, keeps and refuses."""

import csv
import json
from itertools import count
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from tests.acceptance.test_golden_bits import EXAMPLES
from typer.testing import CliRunner

import detent
from detent.cli.app import app
from detent.errors import DetentError, InputError
from detent.files.marks import is_ours
from detent.methods.load import read_axis
from detent.tune.tolerated import PASSED, Means, tolerance

TOLERANCE = """
[tolerance]
"mechanics.load_mass" = "10 %"
"mechanics.friction.positive.viscous" = "30 %"
"""
MASS = "mechanics.load_mass"  # what decides
JOB = '[[move]]\ntarget = "130 mm"\n'
LIMIT = ["--limit", "peak_following <= 22 um"]


def run(*words: str):
    return CliRunner().invoke(app, ["tolerance", *words])


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("axis") / "slide.toml"
    made.write_text((EXAMPLES / "cascade.toml").read_text(encoding="utf-8") + TOLERANCE, encoding="utf-8")
    made.with_name("job.toml").write_text(JOB)
    return made


def words(file: Path, *more: str) -> list[str]:
    return [str(file), "--job", str(file.with_name("job.toml")), "--workers", "1", "--cases", "30", *more]


@pytest.mark.compiled
def test_the_command_says_how_many_pass_and_continues_its_store(file, tmp_path):
    store = tmp_path / "store"
    first = run(*words(file, "--store", str(store), "--json"))
    assert first.exit_code == 0, first.output
    kept = (store / "chunk-000000.npz").read_bytes()
    told = json.loads(first.stdout)
    assert told["sentence"].startswith("cascade axis: all of 30 cases pass")
    assert [one["name"] for one in told["yields"]][:2] == ["all limits", "done"]
    worst = [store / "worst" / f"{name}.toml" for name in told["quantities"] if name != "done"]
    assert told["files"] == [*map(str, worst), str(store / "report.html")]
    sought = {one["quantity"]: one["value"] for one in told["worst"]}
    assert sought["peak_following"] >= told["quantities"]["peak_following"]["most"]
    page = (store / "report.html").read_text(encoding="utf-8")
    for chart in ("spread-peak_following", "scatter"):
        assert f'"{chart}"' in page
    assert page.count('"worst case"') == sum(one["least"] < one["most"] for one in told["quantities"].values())
    again = run(*words(file, "--store", str(store), *LIMIT))
    assert again.exit_code == 1
    assert "of 30 cases pass" in again.stdout
    assert (store / "chunk-000000.npz").read_bytes() == kept


@pytest.mark.compiled
@pytest.mark.wide
@pytest.mark.parametrize(
    ("name", "job", "line"),
    [
        ("filtered_servo", "slide_moves.toml", '"mechanics.moving_mass" = "10 %"'),
        ("phase_servo", "moves.csv", '"mechanics.carriage_mass" = "10 %"'),
        ("print_head", "letter.txt", '"mechanics.carriage_mass" = "10 %"'),
        ("rotary_table", "index_sequence.toml", '"mechanics.table_inertia" = "10 %"'),
        ("zoom", "zoom_sequence.toml", '"stepper.group_a.mechanics.friction_torque" = "3 %"'),
    ],
)
def test_every_method_tells_its_yield_and_the_worst_machines(tmp_path, name, job, line):
    """That of the print head ended in a traceback: what it is to print holds a table, and could not be told again."""
    file = tmp_path / "axis.toml"
    file.write_text(f"{(EXAMPLES / f'{name}.toml').read_text(encoding='utf-8')}\n[tolerance]\n{line}\n", "utf-8")
    told = run(str(file), "--job", str(EXAMPLES / job), "--cases", "4", "--store", str(tmp_path / "store"), "--json")
    assert told.exit_code in (0, 1), told.output
    found = json.loads(told.stdout)
    for one in found["worst"]:
        values = found["quantities"][one["quantity"]]
        is_least = one["quantity"].startswith("least_")
        assert one["value"] <= values["least"] if is_least else one["value"] >= values["most"]
        assert detent.load(tmp_path / "store" / "worst" / f"{one['quantity']}.toml")
    assert found["worst"]
    assert (tmp_path / "store" / "report.html").is_file()


@pytest.mark.compiled
def test_cases_do_not_depend_on_how_many_there_are(file, tmp_path):
    axis, job = detent.load(file), file.with_name("job.toml")
    few = axis.tolerance(job, cases=20, workers=1, store=tmp_path / "store")
    more = axis.tolerance(job, cases=30, workers=1, store=tmp_path / "store")
    whole = axis.tolerance(job, cases=30, workers=1)
    for name, values in whole.cases.results.items():
        assert more.cases.results[name].tobytes() == values.tobytes()
        assert few.cases.results[name].tobytes() == values[:20].tobytes()
    assert axis.tolerance(job, cases=20, workers=1, store=tmp_path / "store").cases.count == 20
    with pytest.raises(InputError, match="another seed"):
        axis.tolerance(job, cases=20, seed=2, workers=1, store=tmp_path / "store")


@pytest.mark.compiled
def test_what_decides_is_told(file):
    found = detent.load(file).tolerance(
        file.with_name("job.toml"), cases=60, workers=1, limits=["peak_following <= 22 um"]
    )
    assert not found.done
    assert 0 < found.yields[0].good < 60
    assert found.sensitivities["peak_following"].order[0] == MASS
    ranks = [found.sensitivities[name].rank[MASS].value for name in ("peak_following", PASSED)]
    assert min(map(abs, ranks)) > 0.3
    assert ranks[0] * ranks[1] < 0.0  # what makes the error larger makes fewer pass
    assert {name for name, *_ in found.cause_rows} == {"peak_following", PASSED}
    assert "not peak_following <= 22 um" in str(found)


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("more", "told"),
    [
        (["--cases", "0"], "from 1 to"),
        (["--workers", "-1"], "1 or more"),
        (["--limit", "peak_folowing <= 1 um"], "peak_following"),
        (["--seed", "-1"], "from 0"),
        (["--total", "100"], "a power of 2"),
        (["--save", "cases.txt"], ".parquet"),
        (["--hunt", "--cases", "1001"], "at most 1000"),
    ],
)
def test_what_makes_no_sense_is_refused(file, more, told):
    done = run(*words(file), *more, "--json")
    assert done.exit_code == 2
    assert told in json.loads(done.stdout)["error"]


def test_an_axis_of_which_all_is_known_is_refused():
    done = run(str(EXAMPLES / "cascade.toml"), "--json")
    assert done.exit_code == 2
    assert "[tolerance]" in json.loads(done.stdout)["error"]


def test_an_axis_of_which_something_is_not_trusted_is_refused(file, tmp_path):
    made = tmp_path / "slide.toml"
    made.write_text(f'{file.read_text()}"mechanics.motor_mass" = "not trusted"\n')
    done = run(str(made), "--json")
    assert done.exit_code == 2
    assert "mechanics.motor_mass not trusted" in json.loads(done.stdout)["error"]


@pytest.mark.compiled
def test_what_takes_more_than_an_hour_is_asked_for(file):
    """A clock by which the 20 cases that are tried take a minute each."""
    axis, minutes = read_axis(file), count(0.0, 1200.0)
    job = detent.load(file).load_job(file.with_name("job.toml"))
    means = Means(workers=1, clock=lambda: next(minutes))
    with pytest.raises(DetentError, match="--yes"):
        tolerance(axis, job=job, cases=100, means=means)
    assert tolerance(axis, job=job, cases=20, means=means).done


@pytest.mark.compiled
def test_the_worst_machine_of_the_usual_job_is_seen_again_by_its_file(file, tmp_path):
    """Where the job is no file, `detent tolerance` makes it again; case 0 of the file is the worst machine."""
    found = detent.load(file).tolerance(cases=2, workers=1, worst=tmp_path)
    one = next(one for one in found.worst if one.quantity == "peak_command")
    assert one.file == tmp_path / "peak_command.toml"
    assert f"#   detent tolerance {one.file} --cases 1 --json\n" in one.file.read_text()
    again = run(str(one.file), "--cases", "1", "--json")
    assert json.loads(again.stdout)["quantities"]["peak_command"]["nominal"] == one.value
    one.file.write_text("mine")
    done = run(str(file), "--cases", "2", "--workers", "1", "--worst", str(tmp_path), "--json")
    assert done.exit_code == 2
    assert one.file.read_text() == "mine"


@pytest.mark.compiled
@pytest.mark.parametrize("suffix", ["h5", "csv", "parquet"])
def test_cases_are_written_as_traces_are(file, tmp_path, suffix):
    made = tmp_path / f"cases.{suffix}"
    done = run(*words(file), *LIMIT, "--save", str(made), "--json")
    assert json.loads(done.stdout)["files"] == [str(made)]
    assert is_ours(made)
    found = detent.load(file).tolerance(file.with_name("job.toml"), cases=30, workers=1, limits=[LIMIT[1]])
    table = columns_of(made)
    for key, values in found.cases.values.items():
        assert table[key].tolist() == values.tolist()
    assert table["results.peak_following"].tolist() == found.cases.results["peak_following"].tolist()
    assert table["case"].tolist() == list(range(30))
    assert table["results.passed"].astype(bool).tolist() == found.judged.good.tolist()
    assert table["results.failure"].astype(int).tolist() == (~found.judged.good).astype(int).tolist()  # of one kind
    assert len(found.judged.failures) == 1


def columns_of(path: Path) -> dict[str, Any]:
    """What other programs read from a file; of CSV without the units."""
    if path.suffix == ".h5":
        with h5py.File(path) as file:
            assert file["trace/results.peak_following"].attrs["unit"] == "m"
            return {name: one[()] for name, one in file["trace"].items()}
    if path.suffix == ".csv":
        heads, *rows = csv.reader(path.read_text().splitlines())
        assert "results.peak_following [m]" in heads
        return {head.partition(" ")[0]: np.array(row, float) for head, row in zip(heads, np.array(rows).T, strict=True)}
    table = pytest.importorskip("pyarrow.parquet").read_table(path)
    return {name: table.column(name).to_numpy() for name in table.column_names}


@pytest.mark.compiled
def test_total_indices_are_beside_the_shares(file):
    job = file.with_name("job.toml")
    found = detent.load(file).tolerance(job, cases=64, workers=2, total=64, limits=["peak_following <= 22 um"])
    total, share = found.total["peak_following"], found.sensitivities["peak_following"].share
    assert max(total, key=lambda key: total[key].value) == MASS
    for key, one in total.items():
        assert one.low <= one.value <= one.high
        assert one.value == pytest.approx(share[key].value, abs=0.3)  # hardly any interaction; both know few cases
    assert {row[-1] for row in found.cause_rows if row[0] == PASSED} >= {
        f"{100 * one.value:.0f} %" for one in found.total[PASSED].values()
    }
    assert found.to_dict()["total"]["peak_following"][MASS][0] == total[MASS].value


@pytest.mark.compiled
def test_total_indices_of_margins_and_not_of_too_many_that_are_watched(file):
    job = file.with_name("job.toml")
    found = detent.load(file).tolerance(job, cases=8, workers=2, total=64, margins=True, limits=["Ms at command <= 2"])
    assert set(found.total["Ms at command"]) == {one.key for one in found.question.tolerance}
    with pytest.raises(DetentError, match="watched at standstill"):
        detent.load(file).tolerance(job, cases=8, total=1024, hunt=True)


def test_keys_that_vary_together_have_no_total(file, tmp_path):
    made = tmp_path / "slide.toml"
    joint = f'"{MASS}" = {{ interval = "10 %", correlation = {{ "mechanics.friction.positive.viscous" = 0.5 }} }}'
    made.write_text(file.read_text().replace('"mechanics.load_mass" = "10 %"', joint))
    done = run(str(made), "--total", "64", "--json")
    assert done.exit_code == 2
    assert "correlation" in json.loads(done.stdout)["error"]


def test_nothing_watches_an_axis_without_a_loop_at_rest():
    with pytest.raises(DetentError, match="--hunt"):
        tolerance(read_axis(EXAMPLES / "stage.toml"), hunt=True)
