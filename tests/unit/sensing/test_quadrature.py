import itertools

import pytest

from detent.sensing.quadrature import (
    ClockedDecoder,
    Quadrature,
    clock_decoder,
    count_edge,
    edge_direction,
    is_settled,
    preset_decoder,
)

RIGHTWARD = [(1, 0), (1, 1), (0, 1), (0, 0)]
"""Levels (A, B) of the quarters of a cycle, moving right: A leads."""


def at(quarter):
    """A decoder that stands in a quarter of the cycle."""
    a, b = RIGHTWARD[quarter]
    return Quadrature(channel_a=a, channel_b=b)


@pytest.mark.parametrize("before", range(4))
@pytest.mark.parametrize("change", range(4))
def test_direction_of_every_transition(before, change):
    expected = {0: 0, 1: 1, 2: 0, 3: -1}[change]
    assert edge_direction(*RIGHTWARD[before], *RIGHTWARD[(before + change) % 4]) == expected


@pytest.mark.parametrize("start", range(4))
def test_four_counts_per_cycle_right_and_back(start):
    r = at(start)
    for n in range(1, 41):
        assert count_edge(r, *RIGHTWARD[(start + n) % 4]) == 1
        assert r.count == n
    for n in range(39, -41, -1):
        assert count_edge(r, *RIGHTWARD[(start + n) % 4]) == -1
        assert r.count == n
    assert r.illegal == 0


@pytest.mark.parametrize("start", range(4))
def test_no_change_is_no_step_and_a_double_change_is_booked_not_counted(start):
    r = at(start)
    assert count_edge(r, *RIGHTWARD[start]) == 0
    assert (r.count, r.illegal) == (0, 0)
    assert count_edge(r, *RIGHTWARD[(start + 2) % 4]) == 0
    assert (r.count, r.illegal) == (0, 1)
    assert count_edge(r, *RIGHTWARD[(start + 3) % 4]) == 1  # goes on from where it is


def test_chatter_on_one_edge_does_not_add_up():
    r = at(0)
    for _ in range(1000):
        count_edge(r, 1, 1)
        count_edge(r, 1, 0)
    assert r.count == 0


@pytest.mark.parametrize(("before", "after"), [*itertools.product(range(4), range(4))])
def test_the_clocked_decoder_shows_what_the_counting_one_counts(before, after):
    clocked, counting = ClockedDecoder(), at(before)
    preset_decoder(clocked, *RIGHTWARD[before])
    pulses = []
    for _ in range(4):
        clock_decoder(clocked, *RIGHTWARD[after])
        pulses.append(clocked.forward - clocked.reverse)
    assert pulses == [count_edge(counting, *RIGHTWARD[after]), 0, 0, 0]
    assert is_settled(clocked, *RIGHTWARD[after])


def test_a_decoder_with_an_edge_in_its_first_stage_is_not_settled():
    r = ClockedDecoder()
    preset_decoder(r, 0, 0)
    assert is_settled(r, 0, 0)
    assert not is_settled(r, 1, 0)
    clock_decoder(r, 1, 0)
    assert not is_settled(r, 1, 0)
    clock_decoder(r, 1, 0)
    assert is_settled(r, 1, 0)
