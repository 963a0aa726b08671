import numpy as np
import pytest

from detent.control.step_rule import (
    ACCEL,
    CRUISE,
    DECEL,
    FAULT,
    IDLE,
    INFEASIBLE,
    OUT_OF_RANGE,
    PAUSE,
    REST,
    STEP,
    TURN,
    StepRule,
    StepRuleParams,
    compare_words,
    deflect,
    next_entry,
    next_step,
    place_motor,
    start_move,
)

HZ = [100, 200, 300, 400, 500]
TICKS = [1000, 500, 333, 333, 200]
LIMITED = 1 << 11
"""Entry bit of zone 1, whose limit is 250 Hz (400 ticks)."""

UP = np.array([0, 1, 2, 3, 4, 3, 2, 1, 0, -1], np.int16)
DOWN = np.array([-1, 0, 1, 2, 3, 4, 3, 2, 1, 0], np.int16)


def params(reload: bool = False, literal: bool = False) -> StepRuleParams:
    p = StepRuleParams(index_mask=2047, zone_shift=11, reload=reload, literal=literal)
    p.ramp[:5] = TICKS if reload else HZ
    p.limit[:2] = [1, 400] if reload else [65535, 250]
    return p


def motor(position: int = 0) -> StepRule:
    r = StepRule()
    place_motor(r, position)
    return r


def decide(p: StepRuleParams, r: StepRule, up=UP, down=DOWN) -> int:
    """Read the tables and make the next step."""
    return next_step(p, r, next_entry(r, up, down))


def words(p: StepRuleParams, r: StepRule, up=UP, down=DOWN, most: int = 100) -> list[int]:
    """Words of the steps up to rest; 0 for the wait of a reversal."""
    found = []
    for _ in range(most):
        outcome = decide(p, r, up, down)
        if outcome == IDLE:
            break
        found.append(r.word if outcome == STEP else 0)
    return found


def test_at_rest_nothing_happens():
    p, r = params(), motor()
    before = r.snapshot()
    assert decide(p, r) == IDLE
    assert r.snapshot() == before


def test_an_automatic_move_follows_the_table_and_rests_at_the_sentinel():
    p, r = params(), motor()
    start_move(r, 1, 0)
    states = []
    while decide(p, r) == STEP:
        states.append(r.state)
    assert states == [ACCEL] * 5 + [DECEL] * 4
    assert (r.state, r.position, r.index, r.word, r.active, r.event) == (REST, 9, -1, 0, 0, 1)
    start_move(r, -1, 0)
    assert words(p, r) == [100, 200, 300, 400, 500, 400, 300, 200, 100]
    assert r.position == 0


def test_equal_entries_are_a_cruise():
    p, r = params(), motor()
    start_move(r, 1, 0)
    flat = np.array([0, 0, 0, -1], np.int16)
    states = [(decide(p, r, flat, flat), r.state) for _ in range(3)]
    assert states == [(STEP, ACCEL), (STEP, CRUISE), (STEP, CRUISE)]


def test_turns_are_made_at_the_sentinels():
    p, r = params(), motor()
    start_move(r, 1, 2)
    run = [100, 200, 300, 400, 500, 400, 300, 200, 100]
    found = []
    for _ in range(40):
        outcome = decide(p, r)
        if outcome == PAUSE:
            assert (r.state, r.index, r.word) == (TURN, -1, 0)
        found.append(r.word)
    assert found[:29] == [*run, 0, *run, 0, *run]
    assert (r.position, r.state, r.turns) == (9, REST, 0)


def test_a_zone_limit_cuts_the_word_at_its_index():
    up = np.array([0, 1, LIMITED | 2, LIMITED | 2, 1, 0, -1], np.int16)
    for reload, expected in ((False, [100, 200, 250, 250, 200, 100]), (True, [1000, 500, 400, 400, 500, 1000])):
        p, r = params(reload), motor()
        start_move(r, 1, 0)
        assert words(p, r, up) == expected


def test_reloads_that_are_equal_do_not_disturb_the_comparison():
    p, r = params(reload=True), motor()
    start_move(r, 1, 0)
    assert words(p, r) == [1000, 500, 333, 333, 200, 333, 333, 500, 1000]
    assert r.position == 9


@pytest.mark.parametrize("reload", [False, True])
def test_the_literal_rule_takes_the_entry_whatever_the_speed(reload):
    p, r = params(reload, literal=True), motor()
    start_move(r, 1, 0)
    up = np.array([4, 4, 0, 4, -1], np.int16)
    slow, fast = (1000, 200) if reload else (100, 500)
    relations = []
    found = []
    while decide(p, r, up, DOWN) == STEP:
        found.append(r.word)
        relations.append((r.relation, r.state))
    assert found == [fast, fast, slow, fast]
    assert relations == [(-1, ACCEL), (0, CRUISE), (1, DECEL), (-1, ACCEL)]
    assert (r.state, r.position, r.relation) == (REST, 4, 1)


def test_words_compare_by_speed():
    assert [compare_words(params(), *pair) for pair in ((1, 2), (2, 2), (2, 1), (0, 1), (1, 0))] == [-1, 0, 1, -1, 1]
    reload = params(reload=True)
    assert [compare_words(reload, *pair) for pair in ((2, 1), (2, 2), (1, 2), (0, 1), (1, 0))] == [-1, 0, 1, -1, 1]


def test_a_table_that_falls_too_fast_is_a_fault_and_the_motor_comes_down():
    p, r = params(), motor()
    start_move(r, 1, 0)
    up = np.array([4, 4, 4, 4, 1, 0, -1], np.int16)
    assert words(p, r, up) == [100, 200, 300, 400, 300, 200, 100]
    assert (r.state, r.cause, r.index, r.event, r.active) == (FAULT, INFEASIBLE, -1, 1, 0)
    start_move(r, 1, 0)
    assert words(p, r, up) == []
    r.reset = 1
    assert decide(p, r, up, DOWN) == IDLE
    assert (r.state, r.reset, r.start) == (REST, 0, 0)


def test_in_fault_the_table_is_not_read_even_beyond_the_travel():
    p, r = params(), motor()
    start_move(r, 1, 0)
    up = np.array([4, 4, 4, 4, -1], np.int16)
    assert words(p, r, up) == [100, 200, 300, 400, 300, 200, 100]
    assert (r.position, r.state, r.cause) == (7, FAULT, INFEASIBLE)
    r.reset = 1
    assert decide(p, r, up, up) == IDLE
    start_move(r, -1, 0)
    assert decide(p, r, up, up) == IDLE
    assert (r.state, r.cause, r.event) == (FAULT, OUT_OF_RANGE, 1)


@pytest.mark.parametrize("position", [-1, 10])
def test_a_start_outside_the_travel_is_a_fault(position):
    p, r = params(), motor(position)
    start_move(r, 1, 0)
    assert decide(p, r) == IDLE
    assert (r.state, r.cause, r.position) == (FAULT, OUT_OF_RANGE, position)


def test_a_motor_that_runs_beyond_its_tables_comes_down():
    p, r = params(), motor()
    start_move(r, 1, 0)
    assert words(p, r, most=4) == [100, 200, 300, 400]
    assert words(p, r, UP[:3], DOWN[:3]) == [300, 200, 100]
    assert (r.state, r.cause, r.position) == (FAULT, INFEASIBLE, 7)


def test_a_start_at_the_sentinel_is_a_move_that_has_ended():
    p, r = params(), motor(9)
    start_move(r, 1, 0)
    assert decide(p, r) == IDLE
    assert (r.state, r.position, r.event, r.active) == (REST, 9, 1, 0)


@pytest.mark.parametrize(
    ("hz", "request_index", "found"),
    [(500, 4, 500), (450, 4, 450), (300, 2, 300), (250, 2, 250), (100, 0, 100), (60, 0, 60), (900, 4, 500)],
)
def test_a_request_limits_the_speed(hz, request_index, found):
    p, r = params(), motor()
    high = np.array([4] * 20 + [3, 2, 1, 0, -1], np.int16)
    deflect(p, r, hz, 4, 1)
    assert r.request == request_index
    run = words(p, r, high, high)
    assert max(run) == found
    assert run[: request_index + 1] == [*HZ[:request_index], found]
    assert words(p, r, high, high) == []  # held into the end: it stays there
    assert r.position == 24


def test_with_reloads_full_deflection_means_the_last_index():
    p, r = params(reload=True), motor()
    deflect(p, r, 333, 4, 1)
    assert r.request == 3
    deflect(p, r, 340, 4, 1)
    assert r.request == 2
    deflect(p, r, 100, 4, 1)
    assert r.request == 4
    deflect(p, r, 0, 4, 1)
    assert r.request == -1


@pytest.mark.parametrize("release", ["request", "manual"])
def test_released_the_motor_comes_down_and_rests(release):
    p, r = params(), motor()
    high = np.full(30, 4, np.int16)
    deflect(p, r, 500, 4, 1)
    assert words(p, r, high, high, 6) == [100, 200, 300, 400, 500, 500]
    if release == "request":
        deflect(p, r, 0, 4, 1)
    else:
        r.manual = 0
    assert words(p, r, high, high) == [400, 300, 200, 100]
    assert (r.state, r.event) == (REST, 1)


def test_a_lower_request_is_reached_index_by_index():
    p, r = params(), motor()
    high = np.full(30, 4, np.int16)
    deflect(p, r, 500, 4, 1)
    words(p, r, high, high, 5)
    deflect(p, r, 150, 4, 1)
    assert words(p, r, high, high, 5) == [400, 300, 150, 150, 150]


def test_the_operator_ends_an_automatic_move():
    p, r = params(), motor()
    start_move(r, 1, 0)
    words(p, r, most=3)
    deflect(p, r, 0, 4, 1)
    assert words(p, r) == [200, 100]
    r.manual = 0
    assert words(p, r) == []


def test_the_operator_ends_the_reversals_of_an_automatic_move():
    """The motor that he drives to a sentinel stands there: nothing is left of the move that would turn it."""
    p, r = params(), motor()
    start_move(r, 1, 1)
    decide(p, r)
    deflect(p, r, 500, 4, 1)
    decide(p, r)
    assert r.active == 0
    words(p, r)
    assert (r.position, r.direction, r.state, r.event) == (9, 1, REST, 1)
    assert decide(p, r) == IDLE


def test_a_reversal_slows_down_before_the_direction_line_toggles():
    p, r = params(), motor(10)
    high = np.full(40, 4, np.int16)
    deflect(p, r, 500, 4, 1)
    words(p, r, high, high, 5)
    deflect(p, r, 500, 4, -1)
    directions = []
    found = []
    for _ in range(10):
        found.append(r.word if decide(p, r, high, high) == STEP else 0)
        directions.append((r.direction, found[-1]))
    assert found[:4] == [400, 300, 200, 100]
    assert directions[3:] == [(1, 100), (-1, 0), (-1, 100), (-1, 200), (-1, 300), (-1, 400), (-1, 500)]
