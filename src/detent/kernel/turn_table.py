"""A quantity over one turn, as a table: no sine inside a step, so every machine gives the same bits.

Phases are integers of 2^-32 turn. Between the entries the quantity is linear.
"""

from collections.abc import Callable

from detent.kernel.registers import Registers, i4_array, register, u1
from detent.kernel.step import hot_step

TURN = 1 << 32
FRACTION = TURN - 1
POINTS = 256  # entries per turn; the last repeats the first


class TurnTable(Registers):
    """Values at equal distances over one turn."""

    used: u1 = register("1 when not all entries are zero")
    value: i4_array = register("entries from phase 0 to one turn", unit="turn/2^32", length=POINTS + 1)


@hot_step
def at_phase(p: TurnTable, phase: int) -> int:
    """Value at a phase in [0, 2^32)."""
    k = phase >> 24
    share = phase & 0xFFFFFF
    return p.value[k] + ((p.value[k + 1] - p.value[k]) * share >> 24)


def fill_table(p: TurnTable, value: Callable[[float], float]) -> None:
    """Fill the table from `value`, which gives turns for a phase in [0, 1) turns; magnitudes below half a turn."""
    for k in range(POINTS + 1):
        p.value[k] = round(value(k % POINTS / POINTS) * TURN)
    p.used = 1 if any(p.value) else 0
