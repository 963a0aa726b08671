import pytest

from detent.control.step_comparison import (
    BRAKING_DISTANCE,
    CONSTANT_FREQUENCY,
    PERMISSIBLE_FREQUENCY,
    Comparison,
    ComparisonParams,
    braking_steps,
    next_compared_step,
)
from detent.control.step_rule import ACCEL, CRUISE, DECEL, IDLE, REST, STEP, StepRule, place_motor, start_move


def run(p: ComparisonParams, position: int = 0, heading: int = 1) -> tuple[StepRule, list[int], list[int]]:
    c, r = Comparison(), StepRule()
    place_motor(r, position)
    start_move(r, heading, 0)
    words, states = [], []
    while next_compared_step(p, c, r) == STEP:
        words.append(r.word)
        states.append(r.state)
    return r, words, states


def params(method: int, steps: int, *, begin: int = 0, top: float = 500.0) -> ComparisonParams:
    p = ComparisonParams(method=method, begin=begin, steps=steps, start_hz=100.0, acceleration=15_000.0, zones=1)
    p.limit[0] = top
    return p


RAMP = [100, 200, 265, 316, 361, 400]
"""sqrt(100^2 + 2 x 15000 n) in whole Hz."""


@pytest.mark.parametrize("method", [BRAKING_DISTANCE, PERMISSIBLE_FREQUENCY])
@pytest.mark.parametrize("steps", [1, 2, 3, 6, 11, 12])
def test_ramps_up_and_down(method, steps):
    r, words, states = run(params(method, steps))
    half = (steps + 1) // 2
    assert words == RAMP[:half] + RAMP[: steps // 2][::-1]
    assert (r.position, r.state, r.word, r.event, r.active) == (steps, REST, 0, 1, 0)
    assert states[0] == ACCEL
    if steps == 12:
        assert states == [ACCEL] * 6 + [CRUISE] + [DECEL] * 5
    if steps == 11:
        assert states == [ACCEL] * 6 + [DECEL] * 5


@pytest.mark.parametrize("method", [BRAKING_DISTANCE, PERMISSIBLE_FREQUENCY])
def test_downwards_from_any_place(method):
    r, words, _ = run(params(method, 6, begin=50), 50, -1)
    assert r.position == 44
    assert words == [100, 200, 265, 265, 200, 100]


@pytest.mark.parametrize("method", [BRAKING_DISTANCE, PERMISSIBLE_FREQUENCY])
def test_zones_clip_without_a_ramp(method):
    p = params(method, 12)
    p.zones = 3
    p.edge[0], p.edge[1], p.edge[2] = 4, 6, 12
    p.limit[0], p.limit[1], p.limit[2] = 500.0, 150.0, 500.0
    _, words, _ = run(p)
    assert words[:4] == RAMP[:4]
    assert words[4:6] == [150, 150]
    assert words[6] > 200


def test_the_naive_drive_has_one_frequency():
    r, words, states = run(params(CONSTANT_FREQUENCY, 5))
    assert words == [100] * 5
    assert states == [ACCEL] + [CRUISE] * 4
    assert r.position == 5


def test_braking_distance():
    p = params(BRAKING_DISTANCE, 10)
    assert braking_steps(p, 100.0) == pytest.approx(0, abs=1e-5)
    assert braking_steps(p, 400.0) == pytest.approx(5, abs=1e-5)


def test_without_a_start_nothing_happens():
    r = StepRule()
    place_motor(r, 0)
    assert next_compared_step(params(1, 5), Comparison(), r) == IDLE
    assert (r.position, r.event) == (0, 0)
