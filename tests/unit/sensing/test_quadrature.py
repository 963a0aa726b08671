import pytest

from detent.sensing.quadrature import Quadrature, count_edge, cycle_position

RIGHTWARD = [(1, 0), (1, 1), (0, 1), (0, 0)]
"""Levels (A, B) of the quarters of a cycle, moving right: A leads."""


def test_positions_on_the_cycle_follow_the_motion():
    assert [cycle_position(a, b) for a, b in RIGHTWARD] == [0, 1, 2, 3]


@pytest.mark.parametrize("start", range(4))
def test_four_counts_per_cycle_right_and_back(start):
    r = Quadrature(previous=start)
    for n in range(1, 41):
        assert count_edge(r, *RIGHTWARD[(start + n) % 4]) == 1
        assert r.count == n
    for n in range(39, -41, -1):
        assert count_edge(r, *RIGHTWARD[(start + n) % 4]) == -1
        assert r.count == n
    assert r.illegal == 0


@pytest.mark.parametrize("start", range(4))
def test_no_change_is_no_step_and_a_double_change_is_booked_not_counted(start):
    r = Quadrature(previous=start)
    assert count_edge(r, *RIGHTWARD[start]) == 0
    assert (r.count, r.illegal) == (0, 0)
    assert count_edge(r, *RIGHTWARD[(start + 2) % 4]) == 0
    assert (r.count, r.illegal) == (0, 1)
    assert count_edge(r, *RIGHTWARD[(start + 3) % 4]) == 1  # goes on from where it is


def test_chatter_on_one_edge_does_not_add_up():
    r = Quadrature(previous=0)
    for _ in range(1000):
        count_edge(r, 1, 1)
        count_edge(r, 1, 0)
    assert r.count == 0
