from itertools import pairwise

import pytest
from tests.difference import diff

from detent.kernel.noise import NoiseSource, uniform
from detent.sensing.interference import (
    CORRUPT,
    ENTRIES,
    INSERT,
    INSERT_MINUS,
    INSERT_PLUS,
    LOSE_SAMPLE,
    NEVER,
    RATES,
    REMOVE,
    Interference,
    InterferenceParams,
    count_losses,
    interfere,
    plan_next,
    start_interference,
    strike,
)

SEED = 5


def lines(*events: tuple[int, int], rates: tuple[float, ...] = (), seed: int = SEED):
    """Parameters and state at power-on; `events` are (tick, kind), `rates` the mean ticks of the random kinds."""
    p, r = InterferenceParams(entries=len(events)), Interference()
    for k, (tick, kind) in enumerate(events):
        p.tick[k], p.kind[k] = tick, kind
    for k, mean in enumerate(rates):
        p.mean_ticks[k] = mean
    start_interference(p, r, seed)
    return p, r


def test_the_random_kinds_follow_one_another_from_remove_on():
    assert [REMOVE + k for k in range(RATES)] == [REMOVE, LOSE_SAMPLE, CORRUPT, INSERT]


@pytest.mark.parametrize(
    ("kind", "changed"),
    [
        (INSERT_PLUS, {"plus": 1, "inserted": 1}),
        (INSERT_MINUS, {"minus": 1, "inserted": 1}),
        (REMOVE, {"remove": 1}),
        (LOSE_SAMPLE, {"lose_sample": 1}),
        (CORRUPT, {"corrupt": 1, "corrupted": 1}),
    ],
)
def test_each_kind_changes_its_own_registers_and_no_other(kind, changed):
    r = Interference()
    before = r.copy()
    strike(r, kind)
    assert diff(r, before) == {name: (value, 0) for name, value in changed.items()}


def test_the_sign_of_an_inserted_pulse_is_drawn():
    r, coin = Interference(), NoiseSource(state=SEED)
    r.noise.state = SEED
    signs = [uniform(coin) < 0.5 for _ in range(100)]
    for forward in signs:
        plus, minus = r.plus, r.minus
        strike(r, INSERT)
        assert (r.plus - plus, r.minus - minus) == ((1, 0) if forward else (0, 1))
    assert r.inserted == 100
    assert 30 < sum(signs) < 70


def test_a_quiet_line_waits_for_ever():
    _, r = lines()
    assert r.next_tick == NEVER
    assert list(r.next_random) == [NEVER] * RATES


def test_the_list_plans_its_first_event_and_the_tick_after_which_clears_it():
    p, r = lines((7, INSERT_PLUS), (7, INSERT_PLUS), (20, INSERT_MINUS))
    assert r.next_tick == 7
    interfere(p, r, 7)
    assert (r.plus, r.minus, r.inserted, r.next_tick) == (2, 0, 2, 8)
    interfere(p, r, 8)
    assert (r.plus, r.minus, r.inserted, r.next_tick) == (0, 0, 2, 20)
    interfere(p, r, 20)
    assert (r.plus, r.minus, r.inserted, r.next_tick) == (0, 1, 3, 21)
    interfere(p, r, 21)
    assert (r.plus, r.minus, r.next_tick) == (0, 0, NEVER)


def test_a_removal_or_a_lost_sample_needs_no_clearing_tick():
    p, r = lines((3, REMOVE), (3, LOSE_SAMPLE))
    interfere(p, r, 3)
    assert (r.remove, r.lose_sample, r.next_tick) == (1, 1, NEVER)


def test_events_in_neighbouring_ticks_stay_apart():
    p, r = lines((3, CORRUPT), (4, INSERT_PLUS), (5, CORRUPT))
    shown = []
    for tick in range(3, 7):
        assert tick >= r.next_tick
        interfere(p, r, tick)
        shown.append((r.corrupt, r.plus))
    assert shown == [(1, 0), (0, 1), (1, 0), (0, 0)]
    assert r.corrupted == 2


def test_the_list_may_be_full():
    p, r = lines(*((2 * k, INSERT_PLUS) for k in range(ENTRIES)))
    for tick in range(2 * ENTRIES):
        interfere(p, r, tick)
    assert r.inserted == r.next_entry == ENTRIES
    assert r.next_tick == NEVER


def test_what_the_lines_have_lost_is_counted_and_need_not_be_lost_again():
    r = Interference(remove=2, lose_sample=3)
    count_losses(r, 1, 0)
    count_losses(r, 1, 2)
    assert (r.remove, r.removed, r.lose_sample, r.lost) == (0, 2, 1, 2)


@pytest.mark.parametrize("k", range(RATES))
def test_a_rate_brings_its_own_kind_again_and_again(k):
    rates = [0.0] * RATES
    rates[k] = 10.0
    p, r = lines(rates=tuple(rates))
    moments = []
    for _ in range(50):
        # What was put in must be cleared in the tick after; a removal waits for its pulse.
        while r.next_tick < r.next_random[k]:
            interfere(p, r, r.next_tick)
        moments.append(r.next_tick)
        interfere(p, r, r.next_tick)
    assert moments[0] >= 1
    assert all(later > earlier for earlier, later in pairwise(moments))
    assert (r.remove, r.lose_sample, r.corrupted, r.inserted) == tuple(50 * (n == k) for n in range(RATES))
    assert all(r.next_random[n] == NEVER for n in range(RATES) if n != k)


def test_the_seed_decides_the_random_moments():
    rates = (50.0, 60.0, 70.0, 80.0)
    _, first = lines(rates=rates)
    _, same = lines(rates=rates)
    _, other = lines(rates=rates, seed=SEED + 1)
    assert bytes(first) == bytes(same)
    assert list(first.next_random) != list(other.next_random)
    assert first.next_tick == min(first.next_random)


def test_power_on_forgets_what_was_on_the_lines():
    p, r = lines((3, INSERT_PLUS), (9, INSERT_PLUS))
    interfere(p, r, 3)
    start_interference(p, r, SEED)
    assert (r.plus, r.next_entry, r.next_tick) == (0, 0, 3)


def test_what_comes_first_is_planned_be_it_from_the_list_or_at_random():
    p, r = lines((100, INSERT_PLUS))
    r.next_random[1] = 40
    plan_next(p, r, 10)
    assert r.next_tick == 40
    r.next_random[1] = 400
    plan_next(p, r, 10)
    assert r.next_tick == 100
    r.corrupt = 1
    plan_next(p, r, 10)
    assert r.next_tick == 11
