"""The stepper envelope's good axis files."""

import pytest
from tests.bad_files import example_text
from tests.unit.methods.stepper_envelope.players import MM, Played, moves, play

from detent.methods.stepper_envelope.stage_job import StageJog, StageMove


@pytest.fixture(scope="session")
def good_text():
    """Text of the zoom, without its head comment (line 1 is ``[axis]``)."""
    return example_text("zoom")


@pytest.fixture(scope="session")
def stage_text():
    """Text of the stage, whose motors come from the catalogue."""
    return example_text("stage")


@pytest.fixture(scope="session")
def zoom() -> Played:
    """A move of both lens groups, one that turns on its way, a manual run, and a short move with a dwell."""
    together = StageMove(1, 1, targets={"group_a": 12 * MM, "group_b": 2 * MM}, label="in")
    return play("zoom.toml", moves(
        together,
        StageMove(2, 2, targets={"group_a": 5 * MM}, turn=14 * MM, label="back"),
        StageJog(3, 3, "group_b", 5 * MM, 0.1),
        StageMove(4, 4, by={"group_b": 0.25 * MM}, dwell=0.05),
    ))  # fmt: skip
