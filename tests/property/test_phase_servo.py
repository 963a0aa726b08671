"""The phase servo for every move: where it ends, and what it never exceeds."""

import math
from dataclasses import dataclass

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.phase_servo_rig import Rig

from detent.control.phase_sequencer import POSITION_MODE, SPEED_MODE
from detent.sensing.interference import INSERT_MINUS, INSERT_PLUS

N = 64
"""Steps of a pitch."""

PROTECTED = 20
"""Spurious pulses in a move that leave the threshold of 8 below N/2, with room for what the count may be wrong by."""

TICKS_PER_MS = 4000


@dataclass(frozen=True)
class Move:
    """A move by whole pitches; `pulses` spurious ones come from `delay` on after its strobe [ms]."""

    pitches: int
    pulses: int
    kind: int
    delay: float
    pause: float
    """From ready to the next strobe [ms]: the host prints. A disturbed move needs longer than ready to settle."""


def moves(most_pulses: int) -> st.SearchStrategy[list[Move]]:
    """One to four moves."""
    move = st.builds(
        Move,
        pitches=st.integers(1, 12).flatmap(lambda n: st.sampled_from((n, -n))),
        pulses=st.integers(0, most_pulses),
        kind=st.sampled_from((INSERT_PLUS, INSERT_MINUS)),
        delay=st.floats(0.0, 5.0),
        pause=st.floats(8.0, 30.0),
    )
    return st.lists(move, min_size=1, max_size=4)


def make_move(rig: Rig, move: Move) -> float:
    """One move and its pause; returns how far before the target its mode was switched [steps].

    Infinite when pulses come later than two speed samples before the switch: as speed they drive the carriage away.
    """
    rig.command(move.pitches)
    begin = rig.r.tick + round(move.delay * TICKS_PER_MS)
    rig.disturb(move.kind, [begin + 96 * k for k in range(move.pulses)])
    rig.run_ticks(1)
    while rig.r.controller.sequencer.mode == SPEED_MODE:
        rig.run_ticks(N)
        assert rig.time < 1.0
    before = rig.error * (1 if move.pitches > 0 else -1)
    if move.pulses and rig.r.tick - (begin + 96 * (move.pulses - 1)) < 4096:
        before = math.inf
    while not rig.r.controller.sequencer.ready:
        rig.run_ticks(1000)
        assert rig.time < 1.0
    rig.run(move.pause * 1e-3)
    return before


def assert_within_limits(rig: Rig) -> None:
    """Current, numbers, energy."""
    train, p = rig.r.plant.train, rig.p
    rise = (p.plant.bridge.supply + p.plant.train.emf_constant * 0.45) * rig.tick / p.plant.train.inductance
    assert train.peak_current <= p.plant.bridge.limit + rise
    for value in (train.position, train.velocity, train.current, train.energy):
        assert math.isfinite(value)
    assert abs(train.energy) <= p.plant.bridge.supply * (p.plant.bridge.limit + rise) * rig.time


def offset(rig: Rig) -> float:
    """Position less target [steps]."""
    return -rig.error


def farthest_rest(jitter: float) -> float:
    """Dead band of a step, and three times the rms by which noise displaces an edge [steps]."""
    return 1 + 3 * jitter / 250


@pytest.mark.compiled
@settings(max_examples=20)
@given(chain=moves(PROTECTED))
def test_pulses_within_the_protection_never_move_the_end_of_a_move(chain):
    rig = Rig(locked=True)
    rig.run(0.25e-3)
    for move in chain:
        make_move(rig, move)
    rig.run(0.15)
    assert abs(offset(rig)) <= farthest_rest(0)
    assert rig.r.controller.sequencer.stop == 1
    assert rig.r.controller.sequencer.refused == 0
    assert_within_limits(rig)


@pytest.mark.compiled
@settings(max_examples=25)
@given(chain=moves(64), jitter=st.sampled_from((0, 5, 20)), seed=st.integers(0, 2**62))
def test_whatever_comes_on_the_lines_a_move_ends_whole_pitches_from_its_target(chain, jitter, seed):
    # Noise of the comparator adds pulses of both signs, which all count down, so it takes of the protection too.
    rig = Rig(f"detector.jitter={jitter} ns", f"detector.seed={seed}", locked=True)
    rig.run(0.25e-3)
    lost = 0
    for move in chain:
        before = make_move(rig, move)
        direction = 1 if move.pitches > 0 else -1
        within_reach = before + direction * N * lost <= N / 2
        still_lost = round(offset(rig) / N)
        assert still_lost == lost or not within_reach
        lost = still_lost
    rig.run(0.15)
    assert abs(offset(rig) - N * round(offset(rig) / N)) <= farthest_rest(jitter)
    assert_within_limits(rig)


@settings(max_examples=25)
@given(
    velocity=st.floats(-0.4, 0.4),
    current=st.floats(-6.0, 6.0),
    place=st.floats(-0.49, 0.49),
    distance=st.integers(0, 2000),
    mode=st.sampled_from((SPEED_MODE, POSITION_MODE)),
    backward=st.booleans(),
)
def test_from_any_state_no_tick_exceeds_the_limits(velocity, current, place, distance, mode, backward):
    rig = Rig(locked=True)
    r = rig.r
    r.plant.train.position += place * rig.pitch
    r.plant.train.velocity, r.plant.train.current = velocity, current
    r.controller.sequencer.distance, r.controller.sequencer.direction, r.controller.sequencer.mode = (
        distance,
        -1 if backward else 1,
        mode,
    )
    for _ in range(4):
        rig.run_ticks(70)
        assert_within_limits(rig)
        assert abs(r.controller.law.word + 0.5) <= 127.5
        # Nothing accelerates the carriage but the motor at its limit: in 70 us by at most 2.5 mm/s.
        assert (
            abs(r.plant.train.velocity)
            <= 0.4 + rig.time * 6.1 * rig.p.plant.train.force_constant / rig.p.plant.train.mass
        )
