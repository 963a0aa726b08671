"""Facts that stand in two files agree: dependencies and their page, the Python that is asked for, what .ci/run does."""

import re
import sys
import tomllib

import pytest
from tests.docs.pages import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]
REQUIREMENTS = [
    r for r in [*PROJECT["dependencies"], *(r for e in EXTRAS.values() for r in e)] if not r.startswith("detent")
]


@pytest.mark.parametrize("requirement", REQUIREMENTS)
def test_each_dependency_is_explained(requirement):
    name, bound = requirement.split(">=")
    page = (ROOT / "docs" / "reference" / "dependencies.md").read_text(encoding="utf-8")
    row = rf"^\| {re.escape(name.partition('[')[0])} \| {re.escape(bound)} \| [^|]+ \| [^|]+ \|$"
    assert re.search(row, page, flags=re.MULTILINE), f"no row `{name} | {bound} | licence | reason` in dependencies.md"


def test_no_dependency_is_explained_that_is_gone():
    page = (ROOT / "docs" / "reference" / "dependencies.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| ([\w-]+) \| [\d.,<]+ \|", page, flags=re.MULTILINE)
    used = {re.split(r"[\[>]", requirement)[0] for requirement in REQUIREMENTS}
    assert set(rows) <= used | {"hatchling"}


LOCK = (ROOT / "requirements-dev.txt").read_text(encoding="utf-8")


def numbers(version):
    return tuple(int(part) for part in version.split("."))


@pytest.mark.parametrize("requirement", REQUIREMENTS)
def test_the_lock_holds_what_is_asked_for(requirement):
    name, bounds = re.sub(r"\[.*\]", "", requirement).split(">=")
    bound, _, below = bounds.partition(",<")
    found = re.findall(rf"^{re.escape(name)}==([\d.]+)", LOCK, flags=re.MULTILINE)
    assert found, f"{name} is not in requirements-dev.txt: make lock"
    assert min(map(numbers, found)) >= numbers(bound), "make lock"
    assert not below or max(map(numbers, found)) < numbers(below), "make lock"


def test_the_lock_has_checksums_and_names_no_place():
    entries = re.split(r"^(?=\S)", re.sub(r"^ *#.*\n", "", LOCK, flags=re.MULTILINE), flags=re.MULTILINE)[1:]
    assert len(entries) > len(REQUIREMENTS)
    assert [
        entry for entry in entries if not re.fullmatch(r"[^\n]* \\\n( {4}--hash=sha256:\w{64}( \\)?\n)+", entry)
    ] == []
    assert re.findall(r"https?:|file:|^-", LOCK, flags=re.MULTILINE) == []


def test_oldest_python_is_the_same_everywhere():
    tool = (ROOT / "tools" / "environment.py").read_text(encoding="utf-8")
    major, minor = re.search(r"OLDEST_PYTHON = \((\d+), (\d+)\)", tool).groups()
    assert PROJECT["requires-python"].startswith(f">={major}.{minor},")
    assert sys.version_info[:2] >= (int(major), int(minor))


def test_ci_runs_every_target_of_make_check():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    ci = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    for target in re.search(r"^check: ([a-z -]+?) ##", makefile, flags=re.MULTILINE).group(1).split():
        assert re.search(rf"^[^#\n]*\bmake {target}\b", ci, flags=re.MULTILINE), f".ci/run does not `make {target}`"


def test_every_make_target_says_what_it_does():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([a-z-]+):", makefile, flags=re.MULTILINE))
    told = set(re.findall(r"^([a-z-]+):.*## \S", makefile, flags=re.MULTILINE))
    assert targets - told == {"venv-base", "venv-test", "venv-dev"}
