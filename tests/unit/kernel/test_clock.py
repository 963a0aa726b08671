import time

from detent.kernel.clock import monotonic_ns, sleep_until
from detent.kernel.step import step


@step
def slept(nanoseconds: int) -> int:
    begin = monotonic_ns()
    sleep_until(begin + nanoseconds)
    return monotonic_ns() - begin


def test_the_clock_is_that_of_python():
    before = time.monotonic_ns()
    assert before <= monotonic_ns() <= time.monotonic_ns()


def test_a_step_sleeps_until_a_moment():
    before = time.monotonic_ns()
    assert slept(2_000_000) >= 2_000_000
    assert time.monotonic_ns() - before >= 2_000_000
    assert slept(-1_000_000) >= 0
