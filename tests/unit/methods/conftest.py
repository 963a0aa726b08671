"""What the findings say: one golden file, compared word by word here and nowhere else."""

import json
import os
from pathlib import Path

import pytest

GOLDEN = Path(__file__).with_name("golden_findings.txt")
REMAKE = f"if this is meant: remove {GOLDEN.name}, and GOLDEN=write python -m pytest tests/unit/methods"


@pytest.fixture
def golden(request):
    """Compare what a finding says, by its name, with the golden file; GOLDEN=write writes it there."""

    def compare(name, finding):
        # A bad file has its group in front.
        name = request.node.callspec.id if "bad" in request.fixturenames else name
        title = json.dumps(f"{request.path.parent.name} {request.path.stem.removeprefix('test_')}, {name}")
        said = str(finding)
        told = dict(line.split(" -> ", 1) for line in _lines())
        if os.environ.get("GOLDEN") == "write":
            lines = sorted(f"{one} -> {text}" for one, text in (told | {title: said}).items())
            GOLDEN.write_text("\n".join(lines) + "\n", encoding="utf-8")
        else:
            assert said == told.get(title), REMAKE

    return compare


def _lines():
    return GOLDEN.read_text(encoding="utf-8").splitlines() if GOLDEN.exists() else []
