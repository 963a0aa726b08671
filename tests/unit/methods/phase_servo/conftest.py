"""The phase servo's good axis file."""

from importlib.resources import files

import pytest


@pytest.fixture(scope="session")
def good_text():
    """Text of the packaged example, without its head comment (line 1 is ``[axis]``)."""
    text = files("detent").joinpath("examples/phase_servo.toml").read_text(encoding="utf-8")
    return text[text.index("[axis]") :]
