"""`detent analyse`: single questions to a recording."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from detent.cli import app

RUN = CliRunner()


@pytest.fixture(scope="module")
def steady(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two speeds each way."""
    rng = np.random.default_rng(4)
    speed = np.repeat([0.1, 0.2, -0.1, -0.2, 0.1, 0.2, -0.1, -0.2], 1500)
    force = np.where(speed > 0, 3.0 + 20.0 * speed, -4.0 + 25.0 * speed) + 0.05 * rng.normal(size=len(speed))
    table = np.column_stack([np.arange(len(speed)) * 1e-3, np.cumsum(speed) * 1e-3, force])
    path = tmp_path_factory.mktemp("logs") / "steady.csv"
    np.savetxt(path, table, delimiter=",", header="t [s],position [m],force [N]", comments="", fmt="%.9g")
    return path


def call(*words: object) -> tuple[int, str]:
    done = RUN.invoke(app, ["analyse", *map(str, words)])
    return done.exit_code, done.output


def test_a_question_with_an_answer(steady: Path):
    status, text = call(steady, "--what", "two-speeds")
    assert status == 0
    assert "slope.positive" in text
    assert "95 % interval" in text


def test_a_question_without_an_answer_says_what_is_missing(steady: Path):
    status, text = call(steady, "--what", "two-speeds", "--what", "winding")
    assert status == 1
    assert "slope.positive" in text
    assert "voltage and current" in " ".join(text.split())


def test_without_a_question_all_are_asked_and_one_answer_will_do(steady: Path):
    status, text = call(steady)
    assert status == 0
    for name in ("two-speeds", "friction-map", "winding", "frequency", "steps", "sensors"):
        assert name in text


def test_json_holds_the_details(steady: Path):
    status, text = call(steady, "--what", "friction-map", "--json")
    assert status == 0
    found = json.loads(text)
    assert found["analyses"][0]["analysis"] == "friction-map"
    assert len(found["analyses"][0]["speed"]) == 4


@pytest.mark.parametrize(
    ("words", "told"), [(("--what", "speeds"), "two-speeds, friction-map"), (("--column", "nothing"), "SIGNAL=COLUMN")]
)
def test_wrong_input_is_refused(steady: Path, words: tuple[str, ...], told: str):
    done = RUN.invoke(app, ["analyse", str(steady), *words])
    assert done.exit_code != 0
    assert told in str(done.exception) + done.output


def test_the_report_is_a_page(steady: Path, tmp_path: Path):
    status, text = call(steady, "--what", "two-speeds", "--report", tmp_path / "a.html")
    assert status == 0
    assert f"written: {tmp_path / 'a.html'}" in text
    assert "friction: use positive" in text
    assert "Friction: use positive" in (tmp_path / "a.html").read_text(encoding="utf-8")
    done = RUN.invoke(app, ["analyse", str(steady), "--report", str(tmp_path / "a.txt")])
    assert "cannot be saved as '.txt'" in str(done.exception) + done.output


def test_a_missing_file(tmp_path: Path):
    done = RUN.invoke(app, ["analyse", str(tmp_path / "none.csv")])
    assert "none.csv" in str(done.exception) + done.output
    assert done.exit_code != 0


def test_a_log_without_a_position_is_told_for_each_question(tmp_path: Path):
    """It ended in a traceback."""
    path = tmp_path / "current.csv"
    np.savetxt(
        path,
        np.column_stack([np.arange(60) * 1e-2, np.sin(np.arange(60))]),
        delimiter=",",
        header="t [s],i [A]",
        comments="",
    )
    status, text = call(path, "--column", "current=i [A]")
    assert status == 1
    assert text.count("no result") == 6
    assert "position=COLUMN" in text
