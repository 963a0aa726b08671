import pytest
from tests.difference import diff

from detent.control.phase_sequencer import (
    ACQUIRE,
    HOLD,
    NEVER,
    POSITION_MODE,
    SETTLE_BUSY,
    SETTLE_READY,
    SPEED,
    SPEED_MODE,
    Sequencer,
    SequencerParams,
    count_pulses,
    enter_position,
    hear_tracker,
    next_timer,
    run_timers,
    setpoint,
    take_command,
)

READY_TICKS, STOP_TICKS = 30, 200


def params(**changes: int) -> SequencerParams:
    """A table whose entries tell their places: 100 and one more each."""
    p = SequencerParams(threshold=8, last=20, ready_ticks=READY_TICKS, stop_ticks=STOP_TICKS)
    for n in range(21):
        p.table[n] = 100 + n
    for name, value in changes.items():
        setattr(p, name, value)
    return p


@pytest.mark.parametrize(
    ("plus", "minus", "distance", "remaining", "position"),
    [(1, 0, 9, -11, 6), (0, 1, 9, -9, 4), (1, 1, 8, -10, 5), (3, 1, 6, -12, 7), (0, 0, 10, -10, 5)],
)
def test_the_down_counter_takes_either_sign_the_others_their_own(plus, minus, distance, remaining, position):
    r = Sequencer(distance=10, remaining=-10, position=5)
    count_pulses(r, plus, minus)
    assert (r.distance, r.remaining, r.position) == (distance, remaining, position)


def test_the_down_counter_has_16_bits_and_wraps():
    r = Sequencer(distance=1)
    count_pulses(r, 2, 0)
    assert r.distance == 65535


@pytest.mark.parametrize(("backward", "direction"), [(0, 1), (1, -1)])
@pytest.mark.parametrize("state", [SETTLE_READY, HOLD])
def test_a_command_after_ready_begins_a_move(state, backward, direction):
    r = Sequencer(state=state, mode=POSITION_MODE, ready=1, stop=1, remaining=3, distance=65000)
    r.strobe, r.command, r.backward = 1, 640, backward
    assert take_command(r)
    assert (r.state, r.mode, r.ready, r.stop, r.strobe, r.refused) == (SPEED, SPEED_MODE, 0, 0, 0, 0)
    assert (r.distance, r.direction) == (640, direction)
    assert r.remaining == 3 + 640 * direction  # the servo of the comparison keeps its residual from move to move


@pytest.mark.parametrize("state", [ACQUIRE, SPEED, SETTLE_BUSY])
def test_a_command_before_ready_is_refused_and_changes_nothing_else(state):
    r = Sequencer(state=state, mode=POSITION_MODE, distance=5, direction=1, remaining=2)
    before = r.copy()
    r.strobe, r.command, r.backward = 1, 640, 1
    assert not take_command(r)
    assert set(diff(r, before)) == {"refused", "command", "backward"}
    assert r.refused == 1


def test_without_a_strobe_nothing_is_taken():
    r = Sequencer(state=HOLD, command=640)
    before = r.snapshot()
    assert not take_command(r)
    assert r.snapshot() == before


def test_both_one_shots_begin_with_position_mode_and_raise_ready_and_stop():
    p, r = params(), Sequencer(state=SPEED, mode=SPEED_MODE)
    enter_position(p, r, 1000)
    assert (r.state, r.mode, r.switched) == (SETTLE_BUSY, POSITION_MODE, 1000)
    changes = []
    for tick in range(1000, 1300):
        before = (r.state, r.ready, r.stop, r.event)
        run_timers(r, tick)
        after = (r.state, r.ready, r.stop, r.event)
        if after != before:
            changes.append((tick, *after))
    assert changes == [(1030, SETTLE_READY, 1, 0, 1), (1200, HOLD, 1, 1, 1)]


def test_entered_again_the_one_shots_begin_again():
    p, r = params(), Sequencer(state=HOLD)
    enter_position(p, r, 1000)
    run_timers(r, 1030)
    r.strobe, r.command = 1, 4
    assert take_command(r)
    enter_position(p, r, 1100)  # a move so short that the table is passed at once
    for tick in range(1100, 1130):
        run_timers(r, tick)
        assert (r.ready, r.stop) == (0, 0)
    run_timers(r, 1200)  # where the first one-shot 109 would have run out
    assert (r.ready, r.stop) == (1, 0)
    run_timers(r, 1300)
    assert r.stop == 1


def test_the_next_timer_is_that_of_the_state():
    p, r = params(), Sequencer()
    assert next_timer(r) == NEVER
    enter_position(p, r, 50)
    assert next_timer(r) == 80
    run_timers(r, 80)
    assert next_timer(r) == 250
    run_timers(r, 250)
    assert next_timer(r) == NEVER


def test_the_setpoint_is_a_signed_velocity_in_speed_mode_and_the_error_in_position_mode():
    p, r = params(), Sequencer(mode=SPEED_MODE, distance=9, direction=1, remaining=-7)
    assert setpoint(p, r, 4) == 109
    r.direction = -1
    assert setpoint(p, r, 4) == -109
    for distance in (20, 21, 4095, 4096, 65535):  # the last entry stands for all larger distances
        r.distance = distance
        assert setpoint(p, r, 4) == -120
    r.mode = POSITION_MODE
    assert setpoint(p, r, 4) == 4
    assert setpoint(params(incremental=1), r, 4) == -7


def test_a_pulse_that_takes_back_the_one_before_does_not_break_the_silence():
    r = Sequencer()
    for tick, sign in ((5, -1), (9, -1), (20, 1), (31, -1), (40, 1)):
        hear_tracker(r, sign, tick)
    assert r.last_pulse == 9
    hear_tracker(r, 1, 50)  # two of a sign: the tracker still follows something
    assert r.last_pulse == 50
