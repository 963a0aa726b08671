"""Job files as moves of a live axis, of each method that has its moves made by the operation."""

from dataclasses import replace

import pytest
from tests.acceptance.test_golden_bits import EXAMPLES

from detent.control.operation import GO, JOG, MOVE_BY, MOVE_TO
from detent.errors import DetentError
from detent.methods.method import Leg
from detent.methods.moves.job import Move, MoveJob
from detent.methods.moves.legs import legs_of
from detent.methods.rotary_table.live import sequence_legs
from detent.methods.rotary_table.sequence_file import load_sequence
from detent.methods.rotary_table.sequence_job import Go, Jog, Repeat, SequenceJob, Wait
from detent.methods.stepper_envelope.live import stage_legs
from detent.methods.stepper_envelope.stage_job import StageJob, StageJog, StageMove, StopChange


def test_ways_count_from_the_target_before_and_first_from_where_the_axis_is():
    moves = Move(1, 1, by=0.01), Move(2, 2, by=0.02, speed=0.1), Move(3, 3, target=0.3, dwell=0.5), Move(4, 4, by=-0.1)
    assert legs_of(MoveJob("a", "moves", moves)) == [
        Leg(MOVE_BY, 0.01), Leg(MOVE_BY, 0.03, 0.1), Leg(MOVE_TO, 0.3, None, 0.5), Leg(MOVE_TO, pytest.approx(0.2)),
    ]  # fmt: skip


def test_what_a_live_axis_does_not_do_is_refused():
    with pytest.raises(DetentError, match="move 1: got a sample period"):
        legs_of(MoveJob("a", "moves", (Move(1, 1, by=0.01, sample_period=1e-3),)))
    with pytest.raises(DetentError, match="got a recording"):
        legs_of(StageJob("a", "moves", (), ()))


def test_a_sequence_goes_waits_and_jogs_for_a_time_as_often_as_it_repeats():
    steps = Go(2, label="a"), Wait(0.5), Repeat("a", 2), Jog(-1, duration=3.0), Jog(1, speed=0.2, duration=1.0)
    round_ = [Leg(GO, 2), Leg(0, seconds=0.5)]
    jogs = [Leg(JOG, -1.5, None, 3.0), Leg(JOG, 0.2, 0.2, 1.0)]
    assert sequence_legs(1.5, SequenceJob("a", steps)) == [*round_ * 2, *jogs]
    with pytest.raises(DetentError, match="got the signal 'clamp'"):
        sequence_legs(1.0, load_sequence(EXAMPLES / "index_sequence.toml"))


def test_a_motor_makes_its_own_moves_and_no_others():
    first, last = (StageMove(number, number, by={"x": 1e-3}) for number in (1, 3))
    moves = first, StageMove(2, 2, targets={"x": 0.02}, dwell=0.1), last
    job = StageJob("a", "moves", moves, ("x",))
    assert stage_legs("x", job) == [
        Leg(MOVE_BY, 1e-3), Leg(MOVE_TO, 0.02, None, 0.1), Leg(MOVE_TO, pytest.approx(0.021))
    ]  # fmt: skip
    jog = StageJog(4, 4, "x", -0.01, 2.0, dwell=0.3)
    assert stage_legs("x", replace(job, moves=(jog,))) == [Leg(JOG, -0.01, None, 2.0), Leg(0, seconds=0.3)]
    with pytest.raises(DetentError, match="a way from where a jog has ended"):
        stage_legs("x", replace(job, moves=(jog, moves[0])))
    with pytest.raises(DetentError, match="got moves of x"):
        stage_legs("y", job)
    turned = replace(moves[1], turn=0.03), replace(moves[1], change=StopChange(0.01, 0.015))
    for one in turned:
        with pytest.raises(DetentError, match="move 2: got a turn or a stop that is changed"):
            stage_legs("x", replace(job, moves=(one,)))
