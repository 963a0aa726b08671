"""`detent tolerance` as a command and in Python: what it says, keeps and refuses."""

import json
from itertools import count
from pathlib import Path

import pytest
from tests.acceptance.test_golden_bits import EXAMPLES
from typer.testing import CliRunner

import detent
from detent.cli.app import app
from detent.errors import DetentError, InputError
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
    assert told["files"] == [str(store / "report.html")]
    page = (store / "report.html").read_text(encoding="utf-8")
    for chart in ("spread-peak_following", "scatter"):
        assert f'"{chart}"' in page
    again = run(*words(file, "--store", str(store), *LIMIT))
    assert again.exit_code == 1
    assert "of 30 cases pass" in again.stdout
    assert (store / "chunk-000000.npz").read_bytes() == kept


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
