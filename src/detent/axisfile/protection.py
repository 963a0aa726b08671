"""What the axis file says of protection: windows and times of the controller's guard, the same for every method.

The defaults are those of drives in the field (following error, speed a tenth above its limit, command at its limit for
a second); the effort under which a standing sensor counts as stuck is twice what breaks the machine loose.
"""

import math

from detent.control.guard import Guard, GuardParams
from detent.errors import GUARD_TEXT
from detent.files.fields import Table, optional
from detent.files.quantities import Time
from detent.units import format_quantity


class ProtectionTable(Table, frozen=True):
    """What ends a motion that is not what was asked for; a time of 0 switches its watch off."""

    overspeed: float = optional("speed that is a fault, as a share of limits.speed; 0: any", 1.1, ge=0.0, le=100.0)
    jump: float = optional(
        "movement in one sample that is a jump of the sensor, as a share of what limits.speed makes; 0: any",
        1.5, ge=0.0, le=100.0,
    )  # fmt: skip
    saturation_time: Time = optional("how long the command may stay at its limit", 1.0, ge=0.0, le=1000.0)
    stuck_time: Time = optional("how long the sensor may stand under effort", 0.05, ge=0.0, le=10.0)
    reversed_time: Time = optional("how long the axis may speed up against its effort", 0.02, ge=0.0, le=10.0)
    stuck_effort: float = optional(
        "effort under which the axis must move, as a share of the largest", math.nan,
        derived="twice the static friction, from 0.3 to 1", ge=0.01, le=1.0,
    )  # fmt: skip


class TravelProtectionTable(ProtectionTable, frozen=True):
    """The same of an axis whose controller knows how far it has come."""

    travel: bool = optional("switch off beyond an end of the travel", default=True)


def fill_guard(p: GuardParams, table: ProtectionTable, *, sample: float, speed: float) -> None:
    """Guard of a controller that samples every `sample` [s] an axis of at most `speed` [count/s]."""
    most = speed * sample
    p.speed = math.ceil(table.overspeed * most) + 1 if table.overspeed else 0
    p.jump = math.ceil(table.jump * most) + 2 if table.jump else 0
    p.travel, p.saturated = (
        isinstance(table, TravelProtectionTable) and table.travel,
        samples(table.saturation_time, sample),
    )
    p.stuck, p.reversed = samples(table.stuck_time, sample), samples(table.reversed_time, sample)


def samples(time: float, sample: float) -> int:
    """Samples in a time [s], rounded up; 0 for none.

    >>> samples(1.0, 0.3), samples(0.1, 0.3), samples(0.0, 0.3)
    (4, 1, 0)
    """
    return max(1, math.ceil(time / sample - 1e-9)) if time > 0.0 else 0


def breaking_effort(static: float, effort: float) -> float:
    """Share of the largest effort [N or N.m] under which the axis must move, with this static friction."""
    return min(max(0.3, 2.0 * static / effort), 1.0) if effort > 0.0 else 1.0


def guard_text(code: int, **limits: str) -> str:
    """What a fault of the guard means and what to do, with the limits of the axis."""
    return GUARD_TEXT[code].format(**limits)


def describe_fault(
    guard: Guard, table: ProtectionTable, speed: str, lower: str = "", upper: str = "", **more: str
) -> str:
    """What a fault of the guard means and what to do, by the keys of the file; largest speed and ends for people."""
    return guard_text(
        guard.code,
        stuck=format_quantity(table.stuck_time, "s"),
        reversed=format_quantity(table.reversed_time, "s"),
        saturated=format_quantity(table.saturation_time, "s"),
        speed=f"{table.overspeed:g} x {speed}",
        side="upper" if guard.side > 0 else "lower",
        end=upper if guard.side > 0 else lower,
        **more,
    )
