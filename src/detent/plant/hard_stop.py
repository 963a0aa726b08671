"""A hard stop: an elastic buffer at one end of a way, which pushes and never pulls."""

from detent.kernel.registers import Registers, f8, register
from detent.kernel.step import hot_step


class HardStop(Registers):
    """Where it is, and how hard."""

    side: f8 = register("side of the way at which it stands, 1 or -1; 0: there is none", unit="1")
    place: f8 = register("where it is touched", unit="m")
    stiffness: f8 = register("force per way into it", unit="N/m")
    damping: f8 = register("force per speed into it", unit="N.s/m")


@hot_step
def stop_force(p: HardStop, position: float, velocity: float) -> float:
    """Force on what stands or runs into it [N]."""
    depth = (position - p.place) * p.side
    if depth <= 0.0:
        return 0.0
    return -p.side * max(p.stiffness * depth + p.damping * velocity * p.side, 0.0)
