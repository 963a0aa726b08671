"""D/A converter and servo amplifier with a tachometer (rotary-table specification 2, 7; 5 to 8, 12).

The amplifier's torque is in proportion to the speed error, up to its limit. Against the inertia it is a first order
lag; against viscous friction it droops: the velocity stays behind its reference by ``b / (b + stiffness)``.
"""

from detent.kernel.registers import Registers, f8, register, u1
from detent.kernel.step import hot_step


class VelocityAmplifierParams(Registers):
    """Converter and amplifier."""

    speed_per_count: f8 = register("motor speed per count of the word", unit="rad/s")
    stiffness: f8 = register("torque per speed error", unit="N.m.s/rad")
    max_torque: f8 = register("torque at which the amplifier is at its limit", unit="N.m")


class VelocityAmplifier(Registers):
    """What it drives."""

    torque: f8 = register("torque at the beginning of the tick", unit="N.m")
    limited: u1 = register("1 while the amplifier is at its limit")


@hot_step
def drive_torque(p: VelocityAmplifierParams, r: VelocityAmplifier, word: int, velocity: float) -> float:
    """Torque that would act at standstill [N.m]: within the limit ``stiffness * reference``, at the limit the limit.

    Whether the amplifier is at its limit is asked once per tick.
    """
    reference = word * p.speed_per_count
    r.torque = p.stiffness * (reference - velocity)
    r.limited = 1 if abs(r.torque) > p.max_torque else 0
    if r.limited:
        r.torque = p.max_torque if r.torque > 0.0 else -p.max_torque
        return r.torque
    return p.stiffness * reference
