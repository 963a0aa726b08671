"""Noise on the pulse lines: it strikes when it shall, as often as it shall, and every pulse is accounted for."""

import math
from collections import Counter
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.phase_servo_rig import START, Rig, make_spec

from detent.methods.phase_servo.build import build_phase_servo
from detent.methods.phase_servo.controller import PhaseController, PhaseLines, receive_pulses, sample_speed
from detent.methods.phase_servo.plant import PhasePlant, move, sense
from detent.methods.phase_servo.system import PhaseServoParams
from detent.sensing.interference import (
    CORRUPT,
    INSERT,
    INSERT_MINUS,
    INSERT_PLUS,
    LOSE_SAMPLE,
    RATES,
    REMOVE,
    Interference,
    InterferenceParams,
    interfere,
    start_interference,
)

TICKS = 120
"""Length of a bench run."""

seeds = st.integers(0, 2**62 - 1)
kinds = st.sampled_from((INSERT_PLUS, INSERT_MINUS, REMOVE, LOSE_SAMPLE, CORRUPT))
event_lists = st.lists(st.tuples(st.integers(0, TICKS - 1), kinds), max_size=40).map(sorted)


@cache
def default_servo() -> PhaseServoParams:
    """Parameters of the default axis; to be copied before anything is changed."""
    return build_phase_servo(make_spec())


def fill_list(p: InterferenceParams, events: list[tuple[int, int]]) -> None:
    p.entries = len(events)
    for k, (tick, kind) in enumerate(events):
        p.tick[k], p.kind[k] = tick, kind


@given(events=event_lists)
def test_a_list_strikes_at_its_ticks_and_at_no_other(events):
    p, r = InterferenceParams(), Interference()
    fill_list(p, events)
    start_interference(p, r, 1)
    got = Counter(events)
    for tick in range(TICKS + 1):
        remove, lose_sample = r.remove, r.lose_sample
        if tick >= r.next_tick:
            interfere(p, r, tick)
        assert r.plus == got[tick, INSERT_PLUS]
        assert r.minus == got[tick, INSERT_MINUS]
        assert r.remove - remove == got[tick, REMOVE]
        assert r.lose_sample - lose_sample == got[tick, LOSE_SAMPLE]
        assert r.corrupt == (1 if got[tick, CORRUPT] else 0)
    assert r.inserted == sum(kind in (INSERT_PLUS, INSERT_MINUS) for _, kind in events)
    assert r.next_entry == len(events)


@settings(max_examples=25)
@given(mean=st.floats(2.0, 1e6), kind=st.sampled_from((REMOVE, LOSE_SAMPLE, CORRUPT, INSERT)), seed=seeds)
def test_a_rate_strikes_as_often_as_it_says(mean, kind, seed):
    p, r = InterferenceParams(), Interference()
    p.mean_ticks[kind - REMOVE] = mean
    start_interference(p, r, seed)
    end, plus = int(400 * mean), 0
    while r.next_tick < end:
        interfere(p, r, r.next_tick)
        plus += r.plus
    count = r.remove + r.lose_sample + r.corrupted + r.inserted
    # Whole ticks, rounded up, of an exponential law: a geometric law with this chance per tick.
    chance = -math.expm1(-1 / mean)
    # 5.5 standard deviations of the binomial law: once in twenty-five million examples.
    assert abs(count - end * chance) < 5.5 * math.sqrt(end * chance * (1 - chance)) + 1
    if kind == INSERT:
        assert abs(plus - count / 2) < 5.5 * math.sqrt(count) / 2 + 1
    else:
        assert plus == 0


@given(mean=st.floats(2.0, 100.0), seed=seeds)
def test_no_two_random_events_of_a_kind_share_a_tick(mean, seed):
    p, r = InterferenceParams(), Interference()
    for k in range(RATES):
        p.mean_ticks[k] = mean
    start_interference(p, r, seed)
    for tick in range(200):
        before = r.copy()
        if tick >= r.next_tick:
            interfere(p, r, tick)
        for name in ("remove", "lose_sample", "corrupted", "inserted"):
            assert 0 <= getattr(r, name) - getattr(before, name) <= 1
        assert r.next_tick > tick


@given(
    events=event_lists,
    pulses=st.lists(st.sampled_from((-1, 0, 0, 1)), min_size=TICKS, max_size=TICKS),
    window=st.integers(5, 40),
)
def test_the_counters_hold_what_came_on_the_lines_and_what_was_put_in_less_what_was_taken_away(events, pulses, window):
    p, plant, lines, c = default_servo().copy(), PhasePlant(), PhaseLines(), PhaseController()
    fill_list(p.plant.interference, events)
    start_interference(p.plant.interference, plant.interference, 1)
    n, s = plant.interference, c.sequencer
    s.distance = 1000
    got, put_in, taken, words = 0, 0, 0, 0
    to_take, to_lose = 0, 0
    for tick, pulse in enumerate(pulses):
        sense(p.plant, plant, plant.train.position, lines, tick)
        lines.swallowed = lines.missed = 0
        to_take += events.count((tick, REMOVE))
        to_lose += events.count((tick, LOSE_SAMPLE))
        c.converters.tracking.plus, c.converters.tracking.minus = pulse > 0, pulse < 0
        receive_pulses(p.controller, c, lines)
        got, put_in = got + pulse, put_in + n.plus - n.minus
        if pulse and to_take:
            taken, to_take = taken + pulse, to_take - 1
        if tick % window == 0:
            sample_speed(p.controller, c, lines)
            words += 0 if to_lose else c.speed.word
            to_lose -= 1 if to_lose else 0
        move(p.plant, plant, plant.train, lines, tick)
        assert (n.remove, n.lose_sample) == (to_take, to_lose)
    assert s.position == got + put_in - taken
    assert 1000 - s.distance == sum(map(abs, pulses)) + n.inserted - n.removed
    assert s.remaining == -s.position
    assert words + c.speed.count == s.position  # a lost sample delays its pulses, it does not lose them
    assert n.removed + n.remove == sum(kind == REMOVE for _, kind in events)
    assert n.lost + n.lose_sample == sum(kind == LOSE_SAMPLE for _, kind in events)


# ------------------------------------------------------------------------------------------------- the whole axis


def noisy_rig(seed: int, *overrides: str) -> Rig:
    rates = ("inserted=1500 Hz", "removed=700 Hz", "lost_samples=80 Hz", "corrupted=2 kHz")
    return Rig(f"detector.seed={seed}", *(f"disturbance.lines.{rate}" for rate in rates), *overrides, locked=True)


@pytest.mark.compiled
@settings(max_examples=15)
@given(seed=seeds)
def test_one_seed_gives_one_run_to_the_byte_and_another_seed_another_run(seed):
    first, same, other = (noisy_rig(n, "detector.jitter=20 ns").move(6, 25e-3) for n in (seed, seed, seed ^ 1))
    assert first.r.plant.interference.inserted > 0
    assert first.r.snapshot() == same.r.snapshot()
    # The generator's state differs in any case; what counts is that the axis has moved otherwise.
    assert first.r.plant.train.snapshot() != other.r.plant.train.snapshot()


@pytest.mark.compiled
@settings(max_examples=10)
@given(seed=seeds)
def test_the_distance_counter_misses_what_was_taken_away_and_holds_what_was_put_in(seed):
    rig = noisy_rig(seed)
    rig.run_until(START)
    rig.command(12)
    rig.run_ticks(1)
    before = rig.r.copy()
    names = (
        "controller.converters.tracking.plus",
        "controller.converters.tracking.minus",
        "plant.interference.plus",
        "plant.interference.minus",
    )
    lines = rig.record(10e-3, names, 1)
    plus, minus, put_plus, put_minus = (int(lines[name].sum()) for name in names)
    s, n = rig.r.controller.sequencer, rig.r.plant.interference
    removed = n.removed - before.plant.interference.removed
    assert plus > 100
    assert put_plus + put_minus == n.inserted - before.plant.interference.inserted > 0
    assert (before.controller.sequencer.distance - s.distance) % 2**16 == plus + minus + put_plus + put_minus - removed
    moved = s.position - before.controller.sequencer.position
    assert abs(moved - (plus - minus + put_plus - put_minus)) <= removed
    # Nothing backward came but the first step's dither: then all that was taken away was forward.
    if minus == 0:
        assert moved == plus + put_plus - put_minus - removed


@pytest.mark.compiled
@settings(max_examples=10)
@given(moments=st.sets(st.integers(3_000, 11_999), min_size=1, max_size=64), kind=kinds)
def test_a_list_strikes_the_running_axis_at_its_ticks(moments, kind):
    rig = Rig(locked=True)
    rig.disturb(kind, sorted(moments))
    rig.run_until(START)
    rig.command(6)
    rig.run_until(3_000 * rig.tick)
    shown = ("plus", "minus", "corrupt", "remove", "lose_sample", "removed", "lost")
    rows = rig.record(9_001 * rig.tick, [f"plant.interference.{name}" for name in shown], 1)
    plus, minus, corrupt, remove, lose_sample, removed, lost = (rows[f"plant.interference.{name}"] for name in shown)
    stock = {REMOVE: remove + removed, LOSE_SAMPLE: lose_sample + lost}
    if kind in stock:
        struck = np.diff(stock[kind], prepend=0)
    else:
        struck = {INSERT_PLUS: plus, INSERT_MINUS: minus, CORRUPT: corrupt}[kind]
    # A row stands at the end of its tick, so the first one is that of tick 3000.
    assert set(3_000 + np.flatnonzero(struck)) == moments
    assert struck.sum() == len(moments)
