"""The time that a brake is given, sample by sample."""

from detent.control.brake_line import BrakeLine, BrakeLineParams, is_closed, release


def test_it_counts_as_open_once_it_has_had_its_time_with_torque():
    p, r = BrakeLineParams(present=1, open=3), BrakeLine()
    release(p, r, 0)
    seen = []
    for _ in range(5):
        release(p, r, 1)
        seen.append(is_closed(p, r))
    assert seen == [True, True, False, False, False]


def test_a_sample_without_torque_takes_all_of_its_way_back():
    p, r = BrakeLineParams(present=1, open=3), BrakeLine(left=1)
    release(p, r, 0)
    assert r.left == 3
    release(p, r, 1)
    release(p, r, 0)
    assert r.left == 3


def test_without_a_brake_nothing_is_closed():
    assert not is_closed(BrakeLineParams(), BrakeLine(left=3))
