"""The cascade's good axis files: one that slides, one that turns."""

import pytest
from tests.bad_files import example_text
from tests.cascade_rig import by_hand

SHORT = """[axis]
name = "bare"
method = "cascade"

[limits]
travel = "200 mm"
speed = "1 m/s"
acceleration = "10 m/s^2"
effort = "20 N"

[mechanics]
load_mass = "2 kg"

[encoder]
resolution = "1 um"

[method]
position_gain = 60
velocity_gain = "500 V*s/m"
"""


@pytest.fixture(scope="session")
def good_text():
    """Text of the packaged linear example with gains by hand, without its head comment (line 1 is ``[axis]``)."""
    return by_hand(example_text("cascade"))


@pytest.fixture(scope="session")
def rotary_text():
    """Text of the packaged rotary example, without its head comment."""
    return example_text("turntable")


@pytest.fixture(scope="session")
def short_text():
    """Text of an axis that states no more than it must: one mass, driven by a force."""
    return SHORT


@pytest.fixture(scope="session")
def rigid_text(good_text):
    """The linear example with motor and load as one mass."""
    begin, end = good_text.index("[mechanics.coupling]"), good_text.index("[mechanics.friction.positive]")
    return good_text[:begin] + good_text[end:]
