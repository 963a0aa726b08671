import pytest

from detent.control.position_table import AS_COMMANDED, NEGATIVE, POSITIVE, SHORTEST, way_to

T = 3600


@pytest.mark.parametrize(
    ("policy", "target", "present", "way"),
    [
        (SHORTEST, 100, 3500, 200),
        (SHORTEST, 3500, 100, -200),
        (SHORTEST, 5, 5, 0),
        (SHORTEST, 1800, 0, -1800),  # half a turn goes negative
        (SHORTEST, 0, 1800, -1800),
        (SHORTEST, 1799, 0, 1799),
        (SHORTEST, 10, -1, 11),  # from just below the boundary
        (POSITIVE, 100, 3500, 200),
        (POSITIVE, 3500, 100, 3400),
        (POSITIVE, 1800, 0, 1800),
        (POSITIVE, 5, 5, 0),
        (POSITIVE, 5, 7, -2),  # within the tolerance: back
        (POSITIVE, 5, 8, 3597),
        (NEGATIVE, 3500, 100, -200),
        (NEGATIVE, 100, 3500, -3400),
        (NEGATIVE, 1800, 0, -1800),
        (NEGATIVE, 7, 5, 2),
        (NEGATIVE, 8, 5, -3597),
        (NEGATIVE, 1, 3599, 2),
        (AS_COMMANDED, 100, 3500, -3400),
        (AS_COMMANDED, 3500, 100, 3400),
        (AS_COMMANDED, 5400, 100, 5300),
        (AS_COMMANDED, -100, 100, -200),
    ],
)
def test_way(policy, target, present, way):
    assert way_to(T, 2, policy, target, present) == way


def test_every_way_but_as_commanded_ends_at_the_target():
    for policy in (SHORTEST, POSITIVE, NEGATIVE):
        for target in range(0, T, 101):
            for present in range(-T, 2 * T, 97):
                way = way_to(T, 2, policy, target, present)
                assert (present + way - target) % T == 0
                assert abs(way) <= (T // 2 if policy == SHORTEST else T)
                assert policy == SHORTEST or abs(way) <= 2 or (way > 0) == (policy == POSITIVE)
