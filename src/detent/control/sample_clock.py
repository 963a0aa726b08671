"""Sample-clock generator with a period that may change while it runs (filtered-servo specification, block 10).

One strobe drives the speed counter and the filter: feedback gain, lag and time constant scale together (claim 1).
"""

from detent.kernel.registers import Registers, i4, register
from detent.kernel.step import hot_step


class SampleClock(Registers):
    """Period asked for, period of the running window, clocks left in it."""

    demanded: i4 = register("period of the next window, written by the host", unit="us")
    period: i4 = register("period of the running window", unit="us")
    left: i4 = register("decoder clocks until the strobe", unit="count")


@hot_step
def count_clock(r: SampleClock) -> bool:
    """One decoder clock; True at the strobe CS."""
    r.left -= 1
    if r.left > 0:
        return False
    r.period = r.demanded
    r.left = r.period
    return True
