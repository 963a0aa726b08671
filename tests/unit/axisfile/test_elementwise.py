"""One text for a number and for an array of them."""

import math

import numpy as np
import pytest

from detent.axisfile import elementwise


@pytest.mark.parametrize(
    ("function", "values"),
    [(elementwise.up, [0.0, 0.2, 3.0, 7.9]), (elementwise.nearest, [0.5, 1.5, 2.4, -0.5]),
     (elementwise.root, [0.0, 2.0, 1e9])],
)  # fmt: skip
def test_an_array_gives_what_each_number_gives(function, values):
    each = [function(value) for value in values]
    assert function(np.array(values)).tolist() == each
    assert all(type(one) in (int, float) for one in each)


def test_the_smaller_and_the_larger():
    assert (elementwise.least(1.0, 2.0), elementwise.most(1, 2)) == (1.0, 2)
    assert elementwise.least(np.array([1.0, 3.0]), 2.0).tolist() == [1.0, 2.0]
    assert elementwise.most(1.5, np.array([1.0, 3.0])).tolist() == [1.5, 3.0]
    assert elementwise.least(math.inf, np.array([4.0])).tolist() == [4.0]
    assert not elementwise.is_array(1.0, np.float64(2.0))
