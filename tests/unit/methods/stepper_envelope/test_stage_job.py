"""Jobs of stepper stages: what a move, a turn, a changed stop and a manual run may be, and repeats written out."""

import dataclasses
import math

import pytest

from detent.errors import DetentError
from detent.methods.moves.job import MOST_MOVES, expand_moves
from detent.methods.stepper_envelope.stage_job import StageJob, StageJog, StageMove, StopChange


def test_a_move_names_motors_by_places_and_by_ways_and_the_others_stay():
    move = StageMove(number=1, row=2, targets={"x": 0.01}, by={"z": -0.001})
    assert move.motors == ("x", "z")
    assert (move.dwell, move.label, move.turn, move.change) == (0.0, "", None, None)
    with pytest.raises(dataclasses.FrozenInstanceError):
        move.dwell = 1.0


def test_moves_do_not_share_their_motors():
    one, other = StageMove(1, 1, by={"x": 1.0}), StageMove(2, 2, targets={"x": 1.0})
    assert one.targets == {}
    assert other.by == {}
    assert one.targets is not other.targets


def test_a_move_of_one_motor_may_turn_or_have_its_stop_changed():
    assert StageMove(1, 1, {"x": 0.01}, turn=0.03).turn == 0.03
    assert StageMove(1, 1, by={"x": 0.01}, change=StopChange(0.005, 0.02)).change == StopChange(at=0.005, to=0.02)


@pytest.mark.parametrize(
    ("values", "got", "allowed"),
    [
        ({}, "no motor", "a place or a way for at least one"),
        ({"targets": {"x": 0.1, "y": 0.1}, "by": {"y": 0.1}}, "motor y and by.motor y", "motor y (a place) or"),
        ({"targets": {"x": math.nan}}, '"motor x" nan', "a length"),
        ({"by": {"x": 0.1, "y": -math.inf}}, 'by."motor y" -inf', "a length"),
        ({"by": {"x": 0.1}, "dwell": -0.5}, "dwell -0.5 s", "a time from 0 s"),
        ({"by": {"x": 0.1}, "dwell": math.nan}, "dwell nan s", "a time from 0 s"),
        ({"by": {"x": 0.1}, "turn": math.inf}, "turn inf m", "a length"),
        ({"by": {"x": 0.1}, "change": StopChange(math.nan, 0)}, "changed_at nan m", "a length"),
        ({"by": {"x": 0.1}, "change": StopChange(0, math.inf)}, "changed_to inf m", "a length"),
        (
            {"by": {"x": 0.1, "y": 0.1}, "turn": 0.2},
            "turn in a move of 2 motors",
            "turn in a move of exactly one motor",
        ),
        (
            {"targets": {"x": 0.1}, "by": {"y": 0.1}, "change": StopChange(0, 0)},
            "changed_at in a move of 2 motors",
            "changed_at in a move",
        ),
        ({"by": {"x": 0.1}, "turn": 0.2, "change": StopChange(0, 0)}, "turn and changed_at", "one of them"),
    ],
)
def test_no_move_is_what_no_stage_can_do(values, got, allowed):
    with pytest.raises(DetentError, match="move 7: got ") as caught:
        StageMove(number=7, row=1, **values)
    assert f"got {got}" in str(caught.value)
    assert f"; expected: {allowed}" in str(caught.value)


@pytest.mark.parametrize(
    ("values", "got"),
    [
        ({"speed": 0.0}, "speed 0.0 m/s"),
        ({"speed": math.nan}, "speed nan m/s"),
        ({"speed": -math.inf}, "speed -inf m/s"),
        ({"duration": 0.0}, "duration 0.0 s"),
        ({"duration": math.inf}, "duration inf s"),
        ({"dwell": -1.0}, "dwell -1.0 s"),
    ],
)
def test_no_manual_run_is_what_no_operator_can_do(values, got):
    jog = {"motor": "x", "speed": -0.005, "duration": 0.5}
    assert StageJog(3, 1, **jog).motors == ("x",)
    with pytest.raises(DetentError, match="move 3: got ") as caught:
        StageJog(3, 1, **(jog | values))
    assert f"got {got}; expected: " in str(caught.value)


def test_repeats_of_moves_and_manual_runs_are_written_out():
    there, jog = StageMove(1, 2, {"x": 0.1}, label="there"), StageJog(1, 5, "x", 0.01, 0.5)
    moves = expand_moves("job.toml", [(there, 1), (jog, 2)], repeat=2)
    assert [move.number for move in moves] == [1, 2, 3, 4, 5, 6]
    assert [move.row for move in moves] == [2, 5, 5, 2, 5, 5]
    assert [type(move) for move in moves[:3]] == [StageMove, StageJog, StageJog]
    assert dataclasses.replace(moves[3], number=1) == there
    job = StageJob("job.toml", "moves", moves, ("x",))
    assert (job.count, job.notes) == (6, ())
    assert len(expand_moves("job.toml", [(jog, MOST_MOVES)])) == MOST_MOVES
