"""Steps that only steps call are parts of what calls them, and can be called by Python all the same."""

import gc

import numba
import pytest

from detent.kernel.parts import is_part
from detent.kernel.registers import Registers, f8, register
from detent.kernel.step import hot_step, step

pytestmark = [
    pytest.mark.compiled,
    pytest.mark.skipif(numba.config.DISABLE_JIT, reason="about compiled code; NUMBA_DISABLE_JIT is set"),
]


class Pair(Registers):
    """Two numbers."""

    one: f8 = register("a number")
    other: f8 = register("another")


@step
def bottom(r: Pair) -> float:
    """Called by both that follow, and by the top."""
    return r.one / r.other


@step
def left(r: Pair) -> float:
    """First caller."""
    return bottom(r) + 1.0


@hot_step
def right(r: Pair) -> float:
    """Second caller, inlined."""
    return bottom(r) + left(r)


@step
def top(r: Pair) -> float:
    """What Python calls."""
    return left(r) * right(r) - bottom(r)


def library_of(function):
    """The code of the only kinds that a step was compiled for."""
    (result,) = function.overloads.values()
    return result.library


def test_what_steps_call_is_a_part_until_python_calls_it():
    pair = Pair(one=3.0, other=2.0)
    assert top(pair) == 2.5 * 4.0 - 1.5
    assert [is_part(library_of(one)) for one in (bottom, left, right, top)] == [True, True, True, False]
    assert library_of(left).get_pointer_to_function(library_of(left).name) == 0
    assert left(pair) == 2.5
    assert not is_part(library_of(left))
    assert (right(pair), bottom(pair)) == (4.0, 1.5)
    assert top(pair) == 8.5


def test_callers_come_before_what_they_call():
    top(Pair(one=1.0, other=1.0))
    parts = list(library_of(top).parts())
    for k, part in enumerate(parts):
        assert set(map(id, part.parts())) <= set(map(id, parts[k + 1 :]))


@step
def above(r: Pair) -> float:
    """A caller of what Python has called before."""
    return 2.0 * bottom(r)


def test_a_step_that_python_called_first_is_called_by_steps():
    pair = Pair(one=1.0, other=0.0)
    assert bottom(pair) == float("inf")
    assert above(pair) == float("inf")


@step
def plain(r: Pair) -> float:
    return 2.0 * bottom(r)


@pytest.mark.parametrize("is_on", [True, False])
def test_the_collector_of_garbage_is_after_compiling_as_it_was_before(is_on):
    (gc.enable if is_on else gc.disable)()
    try:
        plain.compile((numba.typeof(Pair()),))
        assert gc.isenabled() is is_on
    finally:
        gc.enable()
