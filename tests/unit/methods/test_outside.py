"""A control method of another distribution: installed into an environment of its own, it works by its entry point."""

import json
import re
import site
import subprocess
import sys
import tomllib
import zipfile

import pytest
from tests.docs.pages import blocks_of
from tests.page_reader import Reader
from tests.places import ROOT

from detent.units import parse_quantity

pytestmark = [pytest.mark.compiled, pytest.mark.early, pytest.mark.process]

PROJECT = ROOT / "tests" / "distribution" / "detent-bang-bang"
FILE, JOB = str(PROJECT / "bang_bang.toml"), str(PROJECT / "moves.csv")
PIPED = {"capture_output": True, "encoding": "utf-8"}


def wheel_of(project, folder):
    """The wheel of a distribution without anything to build; no build backend needs to be installed for it."""
    about = tomllib.loads((project / "pyproject.toml").read_text())["project"]
    stem = f"{about['name'].replace('-', '_')}-{about['version']}"
    methods = "\n".join(f"{k} = {v}" for k, v in about["entry-points"]["detent.methods"].items())
    info = {
        "METADATA": f"Metadata-Version: 2.1\nName: {about['name']}\nVersion: {about['version']}\n",
        "WHEEL": "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
        "entry_points.txt": f"[detent.methods]\n{methods}\n",
        "RECORD": "",
    }
    path = folder / f"{stem}-py3-none-any.whl"
    with zipfile.ZipFile(path, "w") as wheel:
        for source in project.rglob("*.py"):
            wheel.write(source, source.relative_to(project))
        for name, text in info.items():
            wheel.writestr(f"{stem}.dist-info/{name}", text)
    return path


@pytest.fixture(scope="module")
def python(tmp_path_factory):
    """Python of a fresh environment that sees detent, and in which the distribution is installed."""
    folder = tmp_path_factory.mktemp("outside")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder / "env"], check=True, timeout=60)
    python = folder / "env" / "bin" / "python"
    found = subprocess.run(
        [python, "-c", "import site; print(site.getsitepackages()[0])"], check=False, **PIPED, timeout=60
    )
    seen = [str(ROOT / "src"), *site.getsitepackages()]
    with open(f"{found.stdout.strip()}/seen.pth", "w", encoding="utf-8") as file:  # noqa: PTH123
        file.write("\n".join(seen))
    wheel = wheel_of(PROJECT, folder)
    options = ["--python", python, "install", "--no-index", "--no-deps", "--quiet", wheel]
    subprocess.run([sys.executable, "-m", "pip", *options], check=True, timeout=60)
    return python


PROGRAM = """
import contextlib, io, json, sys
from detent.cli import main

def said(words):
    out, err, sys.argv = io.StringIO(), io.StringIO(), ["detent", *words]
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main()
        except SystemExit as left:
            return left.code, out.getvalue(), err.getvalue()

print(json.dumps({name: said(words) for name, words in json.loads(sys.argv[1]).items()}))
"""
"""Prints what commands print. A step from outside is compiled in each process, so one process runs all that tick."""


@pytest.fixture(scope="module")
def made(python, tmp_path_factory):
    """What the commands that tick print, and the folder of their files."""
    folder = tmp_path_factory.mktemp("made")
    commands = {
        "run": ["run", FILE, "--job", JOB, "--trace", "csv", "--output", ".", "--json"],
        "compare": ["compare", FILE, "--figure", "page.html", "--json"],
        "timing": [
            *("timing", FILE, "--at", "5 ms", "--figure", "timing.png", "--vcd", "timing.vcd"),
            "--json",
        ],
    }
    done = subprocess.run([python, "-c", PROGRAM, json.dumps(commands)], check=False, cwd=folder, **PIPED, timeout=240)
    assert done.returncode == 0, done.stderr
    printed = {}
    for name, (status, out, err) in json.loads(done.stdout).items():
        assert status == 0, (name, err)
        printed[name] = json.loads(out)
    return printed, folder


def detent(python, *words):
    done = subprocess.run([python, "-m", "detent", *words], check=False, **PIPED, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_check_and_registers_know_the_method(python):
    found = json.loads(detent(python, "check", FILE, "--json"))
    assert (found["method"], found["warnings"]) == ("bang_bang", [])
    names = {row["name"] for row in json.loads(detent(python, "registers", "bang_bang", "--json"))}
    assert {"controller.speed", "lines.drive", "plant.train.position"} <= names
    assert "bang_bang: a list of moves" in " ".join(detent(python, "run", "--help").split())


def test_a_run_has_a_report_with_a_section_of_its_own_and_a_trace(made):
    printed, folder = made
    found = printed["run"]
    assert found["done"]
    assert [move["number"] for move in found["moves"]] == [1, 2, 3, 4]
    assert all(abs(move["error"]) <= found["tolerance"] for move in found["moves"])
    text = (folder / "report.html").read_text(encoding="utf-8")
    words = " ".join(Reader(text).words)
    assert "How the axis performed" in words
    assert "Braking ahead of the target" in words
    assert all(f'"{chart}"' in text for chart in ("job", "move-speed", "move-drive", "approach-place"))
    heads = (folder / "trace.csv").read_text(encoding="utf-8")
    assert "lines.drive" in heads[:2000]


def test_compare_holds_it_beside_itself_without_the_braking_rule(made):
    printed, folder = made
    ((with_braking, without),) = (one["rows"] for one in printed["compare"]["comparisons"])
    assert (with_braking["way"], without["way"]) == ("with braking", "without")
    overshoots = [parse_quantity(one["overshoot"], "m") for one in (with_braking, without)]
    assert 0.0 <= overshoots[0] < 0.2 * overshoots[1]
    assert (folder / "page.html").stat().st_size > 0


def test_timing_shows_its_lines(made):
    printed, folder = made
    assert printed["timing"]["signals"][0] == "lines.a"
    assert (folder / "timing.png").stat().st_size > 0
    assert "controller" in (folder / "timing.vcd").read_text(encoding="utf-8")


def test_no_line_of_detent_names_it():
    for source in (ROOT / "src").rglob("*.py"):
        text = source.read_text(encoding="utf-8").lower()
        assert not re.search("bang.?bang", text), source


def test_it_is_a_small_distribution():
    lines = [line.strip() for path in PROJECT.rglob("*.py") for line in path.read_text().splitlines()]
    lines += (PROJECT / "bang_bang.toml").read_text().splitlines()
    assert sum(bool(line) and not line.startswith(('"""', "#")) for line in lines) < 200


def test_the_how_to_shows_the_distribution_as_it_is():
    blocks = blocks_of(ROOT / "docs" / "how-to" / "add-a-control-method.md")
    shown = {block.marks["file"]: block.text for block in blocks if "file" in block.marks}
    del shown["detent_bang_bang-1.0.dist-info/entry_points.txt"]  # what pip writes
    files = [path for path in PROJECT.rglob("*") if path.suffix in {".py", ".toml", ".csv"}]
    assert shown == {path.relative_to(PROJECT).as_posix(): path.read_text(encoding="utf-8") for path in files}
