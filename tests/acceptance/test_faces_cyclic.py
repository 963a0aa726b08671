"""Faces specification, section 3, number 15: cyclic synchronous modes, with the clock of the axis in the test's hand."""

import numba
import numpy as np
import pytest
from tests.cyclic_rig import Cycle, between, following_errors, master_of, stepped

import detent
from detent.methods.cascade.build import motion_limits
from detent.methods.load import read_axis
from detent.planning.profile import plan_move

pytestmark = [
    pytest.mark.compiled,
    pytest.mark.process,
    pytest.mark.skipif(numba.config.DISABLE_JIT, reason="10 s of an axis"),
]
PERIOD, COUNT, SAMPLES, START = 1e-3, 1e-6, 4, 0.02
TEN_SECONDS = 10_000


def targets(periods: int) -> np.ndarray:
    """Moves to and fro within the limits of the axis, and rests between them, in counts; at most 0.4 m/s."""
    spec = read_axis(detent.example("cascade.toml"), ["limits.speed=0.4 m/s"]).spec
    limits, place, found = motion_limits(spec), START, []
    for target in (0.2, 0.05, 0.4, 0.021, 0.3, 0.29, 0.45, 0.02) * 4:
        found += [plan_move(place, target, limits, PERIOD).position, np.full(150, target)]
        place = target
    return np.round(np.concatenate(found)[:periods] / COUNT).astype(int)


@pytest.mark.parametrize("periods", [1_000, pytest.param(TEN_SECONDS, marks=pytest.mark.wide)])
def test_15_cyclic_synchronous_position_follows_as_detent_run_does(tmp_path, periods):
    wanted = targets(periods)
    points = wanted * (COUNT * 1e3) / 1e3  # by the unit of the face, mm, as the drive reads its counts
    with stepped(tmp_path) as axis, master_of(axis, f"fifteen {periods}") as (node, network):
        with axis.running():
            node.op_mode = "CYCLIC SYNCHRONOUS POSITION"
            node.state = "OPERATION ENABLED"
            axis.until(lambda: node.sdo[0x6041].raw & 0x1000)
        stream, cycle, errors = axis.operation.stream, Cycle(axis, node, network), []
        for target in wanted:
            cycle(int(target))
            errors.append(axis.state.controller.law.position_error)
        assert (stream.taken, stream.late, stream.dropped) == (periods, 0, 0)
        assert axis.operation.answer.commanded == points[-1]
    there = following_errors(between(points, START, PERIOD, SAMPLES), SAMPLES, before=100)
    assert np.abs(np.array(errors) - there).max() <= COUNT
    assert np.abs(there).max() > 10 * COUNT  # it has something to follow
