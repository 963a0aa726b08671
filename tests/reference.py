"""What the documentation's generator makes: `reference_rows` gives every key of an axis file."""

import importlib.util
import sys
from pathlib import Path

_SPEC = importlib.util.spec_from_file_location(
    "docs_generate", Path(__file__).resolve().parents[1] / "docs" / "generate.py"
)
assert _SPEC is not None
assert _SPEC.loader is not None
GENERATE = sys.modules["docs_generate"] = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(GENERATE)
reference_rows = GENERATE.reference_rows
