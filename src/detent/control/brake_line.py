"""The line of a holding brake: released with the torque, and nothing may be asked of the axis until it is open.

The brake itself says nothing. A controller that has released it waits for the time that it takes; until then what
stands under effort is held by the brake, and a command at its limit only pushes against it.
"""

from detent.kernel.registers import Registers, i4, register, u1
from detent.kernel.step import hot_step


class BrakeLineParams(Registers):
    """Whether there is a brake, and how long it takes."""

    present: u1 = register("1 where there is a brake", option=True)
    open: i4 = register("samples that it is given to open", unit="count")


class BrakeLine(Registers):
    """How far it has come."""

    left: i4 = register("samples until it counts as open", unit="count")


@hot_step
def release(p: BrakeLineParams, r: BrakeLine, on: int) -> None:
    """One sample: with torque it opens, without it closes, and has all of its way before it again."""
    if on == 0:
        r.left = p.open
    elif r.left > 0:
        r.left -= 1


@hot_step
def is_closed(p: BrakeLineParams, r: BrakeLine) -> bool:
    """True until it counts as open."""
    return p.present != 0 and r.left > 0
