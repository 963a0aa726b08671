"""A spring-applied brake: its spring closes it, its coil opens it, each a while after the line has changed.

Closed, it is a dry friction on what it holds: at rest it bears any force up to its own, and what moves against it is
slowed by that much. Until it is wholly open it rubs as if it were closed, and until it has closed it does not rub.
"""

from detent.kernel.registers import Registers, f8, i8, register, u1
from detent.kernel.step import hot_step


class BrakeParams(Registers):
    """What it holds, and how fast it is."""

    force: f8 = register("friction while it is closed; 0: there is no brake", unit="N")
    open: i8 = register("time from its line until it is open", unit="tick")
    close: i8 = register("time from its line until it is closed", unit="tick")


class Brake(Registers):
    """How it stands."""

    closed: u1 = register("1 while it rubs")
    late: i8 = register("ticks that its line has said otherwise", unit="tick")


@hot_step
def brake_force(p: BrakeParams, r: Brake, released: int) -> float:
    """One tick with its line, 1 releases it; friction that it has in this tick [N]."""
    if (released != 0) == (r.closed == 0):
        r.late = 0
    elif r.late >= (p.open if r.closed else p.close):
        r.closed = 1 - r.closed
        r.late = 0
    else:
        r.late += 1
    return p.force if r.closed else 0.0
