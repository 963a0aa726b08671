from detent.plant.push import Push, push_force


def test_the_force_acts_from_its_first_tick_to_the_one_before_its_end():
    p = Push(force=-3.0, begin=10, end=12)
    assert [push_force(p, tick) for tick in (0, 9, 10, 11, 12, 13)] == [0.0, 0.0, -3.0, -3.0, 0.0, 0.0]


def test_without_a_stretch_nothing_pushes():
    assert push_force(Push(force=5.0), 0) == 0.0
