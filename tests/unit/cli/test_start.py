"""`detent new` and `detent keys`: the first minutes."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from detent.cli import app, docs
from detent.files.keys import key_rows, own_rows
from detent.methods.registry import METHODS

MOVES = "target [mm],dwell [ms]\n5,10\n2,10\n"
JOBS = {
    "cascade": ("job.csv", MOVES),
    "filtered_servo": ("job.csv", MOVES),
    "phase_servo": ("job.csv", "target [mm],dwell [ms]\n6,10\n2,10\n"),  # whole pitches
    "print_head": ("job.txt", "a\n"),
    "rotary_table": ("job.toml", "[[step]]\ngo = 1\n"),
    "stepper_envelope": ("job.csv", "x [mm]\n5\n2\n"),
}


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def call(*words: str) -> tuple[int, str, str]:
    found = CliRunner().invoke(app, list(words))
    assert found.exception is None or isinstance(found.exception, SystemExit)
    return found.exit_code, found.stdout, found.stderr


@pytest.mark.compiled
@pytest.mark.parametrize("method", METHODS)
def test_a_new_file_checks_and_runs(method):
    name, text = JOBS[method]
    Path(name).write_text(text, encoding="utf-8")
    status, out, _ = call("new", method)
    assert (status, f"detent check {method}.toml" in out) == (0, True)
    status, out, _ = call("check", f"{method}.toml")
    assert (status, out.endswith("no warnings\n")) == (0, True)
    status, out, err = call("run", f"{method}.toml", "--job", name, "--no-compare", "--every", "0")
    assert (status, err) == (0, ""), out


def test_a_new_file_never_replaces_one():
    Path("cascade.toml").write_text("mine", encoding="utf-8")
    status, out, err = call("new", "cascade")
    assert (status, out) == (2, "")
    assert "cascade.toml" in err
    assert Path("cascade.toml").read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["new", "robot"], "cascade, filtered_servo"),
        (["new", "rotary-table"], 'did you mean "rotary_table"'),
        (["new", "cascade", "axis.txt"], ".toml"),
        (["new", "cascade", "nowhere/axis.toml"], "nowhere"),
        (["new", "cascade", "--set", "limits.travle=1 m"], 'did you mean "limits.travel"'),
        (["keys", "robot"], "cascade, filtered_servo"),
        (["keys", "cascade", "--search", "xyzzy"], "xyzzy"),
        (["keys", "cascade", "--search", "travle"], 'did you mean "travel"'),
    ],
)
def test_wrong_words_leave_nothing_behind(words, says, tmp_path):
    status, out, err = call(*words)
    assert (status, out) == (2, "")
    assert says in err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("method", METHODS)
def test_keys_tells_every_key_of_a_method(method):
    status, out, _ = call("keys", method, "--json")
    rows, spec = json.loads(out), METHODS[method].spec
    turned = own_rows(METHODS[method].rotary or spec, spec)
    assert status == 0
    assert [row["key"] for row in rows] == [row.key for row in key_rows(spec) + turned]
    own = ["gear_ratio", "load_inertia", "gear_inertia"] if method == "stepper_envelope" else []
    assert [row.key.rpartition(".")[2] for row in turned] == own
    assert {row["method"] for row in rows} == {method}


def test_keys_tells_those_of_every_method_and_searches_all_they_say():
    _, out, _ = call("keys", "--json")
    assert {row["method"] for row in json.loads(out)} == set(METHODS)
    _, out, _ = call("keys", "cascade", "--search", "BACKLASH")
    assert "mechanics.coupling.backlash" in out
    assert "limits.travel" not in out


def test_keys_of_an_axis_that_turns_have_its_units():
    call("new", "cascade", "turns.toml", "--set", "axis.motion=rotary")
    _, out, _ = call("keys", "turns.toml", "--search", "limits.travel", "--json")
    assert "rad" in {row["unit"] for row in json.loads(out)}


@pytest.mark.parametrize("page", docs.PAGES)
def test_docs_prints_the_page_that_the_documentation_includes(page):
    status, out, _ = call("docs", page)
    assert (status, out.rstrip("\n")) == (0, docs.PAGES[page]().rstrip("\n"))
    assert page in call("docs")[1]


def test_docs_knows_its_pages():
    status, out, err = call("docs", "moters")
    assert (status, out) == (2, "")
    assert 'did you mean "motors"' in err
