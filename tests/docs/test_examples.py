"""The scripts in examples/ run as they stand, and stay short enough to be read in one go."""

import ast
import json
import os
import re
import subprocess
import sys
from typing import Any

import pytest
from tests.docs.pages import ROOT

import detent

EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
NOTEBOOKS = [path for path in detent.examples() if path.suffix == ".ipynb"]


def test_there_are_examples():
    assert EXAMPLES


@pytest.mark.parametrize("script", EXAMPLES, ids=lambda path: path.name)
def test_example_runs(script, tmp_path):
    done = subprocess.run(
        [sys.executable, "-W", "error", str(script)],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT / "src"), "MPLBACKEND": "Agg"},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert not done.stderr
    told = re.findall(r"^open (\S+)$", done.stdout, flags=re.MULTILINE)
    assert told, "the example says which file to open"
    assert all((tmp_path / name).stat().st_size > 0 for name in told)


@pytest.mark.parametrize("script", EXAMPLES, ids=lambda path: path.name)
def test_example_is_short_numbered_and_in_sections(script):
    text = script.read_text(encoding="utf-8")
    assert re.match(r"\d\d_[a-z_]+\.py", script.name)
    assert len(text.splitlines()) < 60
    assert len(re.findall(r"^# %% \S", text, flags=re.MULTILINE)) >= 2


def shown(cell: str, names: dict[str, Any]) -> Any:
    """Run a cell as a notebook does: the value of its last line is what it shows."""
    body = ast.parse(cell).body
    last = body.pop() if isinstance(body[-1], ast.Expr) else None
    exec(compile(ast.Module(body, []), "cell", "exec"), names)
    return None if last is None else eval(compile(ast.Expression(last.value), "cell", "eval"), names)  # noqa: S307


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.name)
def test_every_cell_of_a_notebook_runs_and_shows_something(path, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    names: dict[str, Any] = {"__name__": "__main__"}
    for number, cell in enumerate(cells):
        if cell["cell_type"] != "code":
            continue
        assert cell["outputs"] == [], f"cell {number}: outputs are not kept in the repository"
        value = shown("".join(cell["source"]), names)
        seen = value is not None or capsys.readouterr().out
        assert seen, f"cell {number} shows nothing"
        ways = [getattr(value, way)() for way in ("_repr_html_", "_repr_png_") if hasattr(value, way)]
        assert not ways or any(ways), f"cell {number} shows nothing in a notebook"
    # What the text between the cells says of the figures.
    axis, by_ear, found = names["axis"], names["by_ear"], names["found"]
    assert by_ear.linear().margins["command"].sensitivity > 2.0
    assert axis.linear().margins["command"].sensitivity < 1.75
    assert names["errors"]["file"].std() < names["errors"]["by ear"].std()
    assert "mass" in {contrast.name for contrast in found.contrasts()}
    assert found.trusted["mass"].relative_error < 0.01


def test_there_is_a_notebook():
    assert NOTEBOOKS
