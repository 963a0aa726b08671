"""A force on the carriage from outside, during a stretch of ticks."""

from detent.kernel.registers import Registers, f8, i8, register
from detent.kernel.step import hot_step


class Push(Registers):
    """External force on the carriage during a stretch of ticks."""

    force: f8 = register("force, positive pushes right", unit="N")
    begin: i8 = register("first tick of the push", unit="tick")
    end: i8 = register("first tick after it", unit="tick")


@hot_step
def push_force(p: Push, tick: int) -> float:
    """Force at a tick [N]."""
    return p.force if p.begin <= tick < p.end else 0.0
