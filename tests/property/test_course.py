"""A course under any sequence of commands and limits: the invariants I1 to I5 of the live controller."""

import math
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.course_rig import at_rest, checked, excursions, follow, limits, moving, state, turns
from tests.mutants import load, source_of

from detent.planning import course, speed_ramp

COMPILED = SimpleNamespace(**{**vars(speed_ramp), **vars(course)})
PLAIN = load(source_of(Path(speed_ramp.__file__), Path(course.__file__)))

PERIOD = 4e-3

magnitudes = st.floats(-1.0, 1.0).map(lambda x: 10.0**x)
limit_changes = st.one_of(
    st.tuples(st.just("speed"), magnitudes.map(lambda x: 0.5 * x)),
    st.tuples(st.just("acceleration"), magnitudes.map(lambda x: 5.0 * x)),
    st.tuples(st.just("jerk"), st.just(0.0) | magnitudes.map(lambda x: 100.0 * x)),
    st.tuples(st.just("lowest"), st.floats(-0.3, -0.01) | st.just(-math.inf)),
    st.tuples(st.just("highest"), st.floats(0.01, 0.3) | st.just(math.inf)),
    st.tuples(st.sampled_from(["speed", "acceleration", "jerk", "highest"]), st.just(math.nan) | st.just(-1.0)),
)
anything = st.floats(allow_nan=True, allow_infinity=True)
commands = st.one_of(
    st.tuples(st.just("go"), st.floats(-0.3, 0.3) | anything),
    st.tuples(st.just("run"), st.floats(-0.5, 0.5) | anything),
    st.tuples(st.just("stop"), st.none()),
    st.tuples(st.just("limit"), limit_changes),
)
sequences = st.lists(st.tuples(commands, st.integers(0, 40)), min_size=1, max_size=12)


def obey(m, p, c, what, value):
    """A command, or a change of the limits."""
    if what == "go":
        return m.go_to(p, c, value)
    if what == "run":
        return m.run_at(p, c, value)
    if what == "limit":
        setattr(p, *value)
    else:
        m.come_to_rest(p, c)
    return m.TAKEN


def within(m, p, c):
    """Excursions of a stop never grow beyond the soft limits: checks a sample, and what it leaves."""
    low, high = excursions(m, c)
    before = c.limits.lowest, c.limits.highest
    moved = not m.is_at_rest(c)
    checked(m, p, c, PERIOD)
    f, room = c.limits, 1e-11
    if moved and (f.lowest, f.highest) == before:
        new_low, new_high = excursions(m, c)
        assert new_low >= min(low, f.lowest) - room
        assert new_high <= max(high, f.highest) + room
        if f.lowest <= low:
            assert c.position >= f.lowest
        if high <= f.highest:
            assert c.position <= f.highest


@given(sequences)
def test_any_sequence_keeps_the_invariants(sequence):
    """I1 to I4: checked sample by sample in the rig; soft limits; the end exactly where it was asked for."""
    m, p, c = COMPILED, limits(COMPILED, lowest=-0.2, highest=0.2), at_rest(COMPILED)
    for (what, value), samples in sequence:
        before = bytes(c)
        code = obey(m, p, c, what, value)
        if code != m.TAKEN:
            assert bytes(c) == before
        for _ in range(samples):
            within(m, p, c)
    m.come_to_rest(p, c)
    way = m.stopping_distance(p, c)
    begin, end = c.position, c.end
    states = follow(m, p, c, PERIOD)
    if len(states) > 1:
        assert c.position == end
        assert abs(begin + way - end) <= 1e-11
    assert turns(states) <= 1


@given(sequences, st.floats(-1.0, 1.0))
def test_whatever_was_before_a_move_ends_exactly(sequence, target):
    m, p, c = COMPILED, limits(COMPILED), at_rest(COMPILED)
    for (what, value), samples in sequence:
        if what != "limit" or value[0] not in {"lowest", "highest"}:
            obey(m, p, c, what, value)
        for _ in range(samples):
            checked(m, p, c, PERIOD)
    if not m.is_usable(p):
        p = limits(m)
    assert m.go_to(p, c, target) == m.TAKEN
    follow(m, p, c, 0.05)
    assert state(c) == (target, 0.0, 0.0)


@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), magnitudes, magnitudes, st.just(0.0) | magnitudes)
def test_a_move_from_rest_is_monotone(begin, target, speed, acceleration, jerk):
    """I5: it comes nearer at every sample."""
    m = COMPILED
    p, c = limits(m, speed, acceleration, jerk), at_rest(m, begin)
    m.go_to(p, c, target)
    left = [abs(target - x) for x, _, _ in follow(m, p, c, 0.02)]
    assert all(new <= old for old, new in pairwise(left))
    assert left[-1] == 0.0


@given(st.floats(-0.5, 0.5), st.floats(-5.0, 5.0), st.floats(-0.1, 0.1), st.booleans())
def test_a_velocity_that_is_kept_needs_no_plan(velocity, acceleration, target, jerky):
    """From any velocity and acceleration, even such as limits would not have allowed."""
    m = COMPILED
    p = limits(m, 0.3, 3.0, 50.0 if jerky else 0.0)
    c = moving(m, p, 0.0, velocity, acceleration)
    assert m.go_to(p, c, target) == m.TAKEN
    follow(m, p, c, PERIOD)
    assert state(c) == (target, 0.0, 0.0)


@settings(max_examples=40)
@given(sequences)
def test_compiled_and_plain_agree_to_the_bit(sequence):
    pairs = [(m, limits(m, lowest=-0.2, highest=0.2), at_rest(m)) for m in (COMPILED, PLAIN)]
    for (what, value), samples in sequence:
        codes = {obey(m, p, c, what, value) for m, p, c in pairs}
        assert len(codes) == 1
        for _ in range(min(samples, 10)):
            for m, p, c in pairs:
                m.advance(p, c, PERIOD)
            assert bytes(pairs[0][2]) == bytes(pairs[1][2])


@pytest.mark.wide
@settings(max_examples=5_000)
@given(sequences)
def test_many_sequences_keep_the_invariants(sequence):
    test_any_sequence_keeps_the_invariants.hypothesis.inner_test(sequence)
