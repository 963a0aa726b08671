"""The scripts in examples/ run as they stand, and stay short enough to be read in one go."""

import os
import re
import subprocess
import sys

import pytest
from tests.docs.pages import ROOT

EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


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
