"""The states of a drive and the orders that lead from one to another, as CiA 402 names and numbers them.

The transitions are those of CiA 402 part 2 (IEC 61800-7-201), by their numbers:

    1  not ready -> switch on disabled                 9  enabled -> switch on disabled
    2  switch on disabled -> ready                    10  switched on -> switch on disabled
    3  ready -> switched on                           11  enabled -> quick stop active
    4  switched on -> operation enabled               12  quick stop active -> switch on disabled
    5  enabled -> switched on                         13  any -> fault reaction active
    6  switched on -> ready                           14  fault reaction active -> fault
    7  ready -> switch on disabled                    15  fault -> switch on disabled
    8  enabled -> ready                               16  quick stop active -> enabled

1, 13 and 14 are the drive's own.
"""

from detent.kernel.step import hot_step

NOT_READY, SWITCH_ON_DISABLED, READY, SWITCHED_ON, ENABLED, QUICK_STOP, FAULT_REACTION, FAULT = range(8)
STATE_NAMES = (
    "not ready to switch on", "switch on disabled", "ready to switch on", "switched on", "operation enabled",
    "quick stop active", "fault reaction active", "fault",
)  # fmt: skip

SHUTDOWN, SWITCH_ON, ENABLE_OPERATION, DISABLE_OPERATION, DISABLE_VOLTAGE, HALT_QUICKLY, RESET_FAULT = range(7)
ORDER_NAMES = (
    "shutdown", "switch on", "enable operation", "disable operation", "disable voltage", "quick stop", "fault reset",
)  # fmt: skip

# A row per order, a column per state: the state that follows. An order that a state does not know changes nothing.
_FOLLOWS = (
    0, 2, 2, 2, 2, 5, 6, 7,
    0, 1, 3, 3, 4, 5, 6, 7,
    0, 1, 2, 4, 4, 4, 6, 7,
    0, 1, 2, 3, 3, 5, 6, 7,
    0, 1, 1, 1, 1, 1, 6, 7,
    0, 1, 1, 1, 5, 5, 6, 7,
    0, 1, 2, 3, 4, 5, 6, 1,
)  # fmt: skip


@hot_step
def ordered(state: int, order: int) -> int:
    """State that follows an order."""
    return _FOLLOWS[order * 8 + state]
