"""Half bridge on a split supply with current limit (phase-servo specification 3.10; block 300).

A request switches its transistor on unless the current has passed the limit in its direction. With both transistors off
the current flows on through the opposite diode until it is zero.
"""

from detent.kernel.registers import Registers, f8, register, u1
from detent.kernel.step import hot_step


class SplitBridgeParams(Registers):
    """Supply and limit."""

    supply: f8 = register("supply of each side ES", unit="V")
    limit: f8 = register("current limit", unit="A")


class SplitBridge(Registers):
    """Comparators of the current, and the voltage that the motor sees during the tick."""

    over: u1 = register("comparator 309: current above the limit")
    under: u1 = register("comparator 310: current below the negative limit")
    positive: f8 = register("mean terminal voltage while the current is positive", unit="V")
    negative: f8 = register("mean terminal voltage while the current is negative", unit="V")


@hot_step
def sense_current(p: SplitBridgeParams, r: SplitBridge, current: float) -> None:
    """Both comparators."""
    r.over = 1 if current > p.limit else 0
    r.under = 1 if current < -p.limit else 0


@hot_step
def side_on(r: SplitBridge, request: int) -> int:
    """Transistor that conducts: 1 upper, -1 lower, 0 none."""
    if request > 0:
        return 0 if r.over else 1
    if request < 0:
        return 0 if r.under else -1
    return 0


@hot_step
def drive_two(p: SplitBridgeParams, r: SplitBridge, first: int, second: int) -> None:
    """Mean voltage of a tick of two oscillator periods with the requests `first` and `second`."""
    a, b = side_on(r, first), side_on(r, second)
    fixed = (a + b) * 0.5 * p.supply
    free = ((1 if a == 0 else 0) + (1 if b == 0 else 0)) * 0.5 * p.supply
    r.positive = fixed - free
    r.negative = fixed + free
