import numpy as np
import pytest

from detent.kernel.loop import until_row, write_row
from detent.kernel.registers import Registers, i8, register, u1


class Bench(Registers):
    """Something to record."""

    tick: i8 = register("ticks", unit="tick")
    level: u1 = register("a level")


PICKS = np.array([8], np.int64)
"""The byte of the level."""


@pytest.mark.parametrize(
    ("count", "ticks", "every", "expected"), [(0, 7, 5, 5), (3, 7, 5, 2), (4, 7, 5, 1), (5, 3, 5, 3)]
)
def test_a_stretch_ends_at_the_next_row(count, ticks, every, expected):
    assert until_row(count, ticks, every) == expected


def test_without_rows_a_stretch_is_all_there_is():
    assert until_row(3, 1000, 0) == 1000


def test_rows_come_every_so_many_counts_and_go_round():
    rows = np.zeros((4, 1), np.uint8)
    r = Bench()
    for count in range(1, 13):
        r.level = count
        write_row(r, count, rows, PICKS, 2)
    assert rows[:, 0].tolist() == [8, 10, 12, 6]


def test_nothing_is_written_where_nothing_is_recorded():
    rows = np.zeros((1, 1), np.uint8)
    write_row(Bench(level=9), 0, rows, PICKS, 0)
    assert rows[0, 0] == 0
