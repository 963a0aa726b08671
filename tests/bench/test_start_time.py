"""How long a person waits before anything happens: importing the package, asking for help."""

import subprocess
import sys
from pathlib import Path

import pytest

DETENT = str(Path(sys.executable).with_name("detent"))

WORDS = {
    "import detent": [sys.executable, "-c", "import detent"],
    "detent --help": [DETENT, "--help"],
}


@pytest.mark.parametrize("words", WORDS.values(), ids=WORDS.keys())
def test_start(benchmark, words):
    benchmark.pedantic(lambda: subprocess.run(words, check=True, capture_output=True), rounds=5, warmup_rounds=1)
