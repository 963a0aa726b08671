"""The stepper envelope's good axis files."""

import pytest
from tests.bad_files import example_text


@pytest.fixture(scope="session")
def good_text():
    """Text of the zoom, without its head comment (line 1 is ``[axis]``)."""
    return example_text("zoom")


@pytest.fixture(scope="session")
def stage_text():
    """Text of the stage, whose motors come from the catalogue."""
    return example_text("stage")
