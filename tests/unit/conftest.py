"""The good axis file, and edits of it."""

from functools import lru_cache
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
    # Thousands of tests change the same few texts by overrides: nobody writes to a source, so one parse serves them.
    parsed = lru_cache(64)(lambda text: parse_source("axis.toml", text))

    def load(text, *overrides):
        return axis_of(parsed(text), overrides)

    return load
