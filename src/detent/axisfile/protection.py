"""From the keys of protection to the windows and times of the controller's guard; the same for every method.

The defaults are those of drives in the field (speed a tenth above its limit, command at its limit for a second); the
effort under which a standing sensor counts as stuck is twice what breaks the machine loose.
"""

import math

from detent.axisfile.tables import MotionProtectionTable, ProtectionTable, TurnProtectionTable
from detent.control.guard import Guard, GuardParams
from detent.errors import GUARD_TEXT
from detent.units import format_quantity


def fill_guard(p: GuardParams, table: ProtectionTable, *, sample: float, speed: float) -> None:
    """Guard of a controller that samples every `sample` [s] an axis of at most `speed` [count/s]."""
    p.saturated, p.stuck = samples(table.saturation_time, sample), samples(table.stuck_time, sample)
    if not isinstance(table, TurnProtectionTable):
        return
    most = speed * sample
    p.speed = math.ceil(table.overspeed * most) + 1 if table.overspeed else 0
    p.jump = math.ceil(table.jump * most) + 2 if table.jump else 0
    p.reversed = samples(table.reversed_time, sample)
    p.travel = isinstance(table, MotionProtectionTable) and table.travel


def samples(time: float, sample: float) -> int:
    """Samples in a time [s], rounded up; 0 for none.

    >>> samples(1.0, 0.3), samples(0.1, 0.3), samples(0.0, 0.3)
    (4, 1, 0)
    """
    return max(1, math.ceil(time / sample - 1e-9)) if time > 0.0 else 0


def describe_fault(
    guard: Guard, table: ProtectionTable, speed: str = "", lower: str = "", upper: str = "", **more: str
) -> str:
    """What a fault of the guard means and what to do, by the keys of the file; largest speed and ends for people."""
    limits = {"stuck": format_quantity(table.stuck_time, "s"), "saturated": format_quantity(table.saturation_time, "s")}
    limits |= {"side": "upper", "end": upper} if guard.side > 0 else {"side": "lower", "end": lower}
    if isinstance(table, TurnProtectionTable):
        limits |= {"reversed": format_quantity(table.reversed_time, "s"), "speed": f"{table.overspeed:g} x {speed}"}
    return GUARD_TEXT[guard.code].format(**limits | more)
