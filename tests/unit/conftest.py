"""The good axis file, and edits of it."""

from importlib.resources import files

import pytest

from detent.files.source import parse_source
from detent.methods.load import axis_of

EXAMPLE = files("detent").joinpath("examples/print_head.toml")


@pytest.fixture(scope="session")
def good_text():
    """Text of the packaged example, without its head comment (line 1 is ``[axis]``)."""
    text = EXAMPLE.read_text(encoding="utf-8")
    return text[text.index("[axis]") :]


@pytest.fixture(scope="session")
def load_text():
    """Load the text of an axis file as if it were axis.toml."""

    def load(text, *overrides):
        return axis_of(parse_source("axis.toml", text), overrides)

    return load
