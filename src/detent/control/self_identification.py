"""Slope and friction of one direction from two drive values and the two speeds they gave (specification 3.3)."""

from detent.kernel.registers import Registers, i4, register, u1
from detent.kernel.step import step

SLOPES = (0, 1023)
"""Slopes that an axis may have [count/256]."""

LONGEST = 1 << 20
"""Emitters of a pass that are counted: a travel has 65,535."""


class IdentifiedLine(Registers):
    """The voltage/speed line of one direction."""

    slope: i4 = register("slope K, 1/256 count per speed value", unit="count/256", range=SLOPES)
    friction: i4 = register("friction-equivalent drive Vf", unit="count", range=(0, 300))
    speed_fast: i4 = register("measured speed value of the fast pass", unit="1/6 in/s", range=(-LONGEST, LONGEST))
    speed_slow: i4 = register("measured speed value of the slow pass", unit="1/6 in/s", range=(-LONGEST, LONGEST))
    valid: u1 = register("1 after a plausible identification")


class PlausibleLimits(Registers):
    """What an identified line may be."""

    slope_min: i4 = register("smallest plausible slope", unit="count/256", range=SLOPES)
    slope_max: i4 = register("largest plausible slope", unit="count/256", range=SLOPES)
    friction_max: i4 = register("largest plausible friction", unit="count", range=(0, 300))
    rise_min: i4 = register("the measured speeds must differ by more than this", unit="1/6 in/s", range=(-100, 100))
    literal_intercept: u1 = register("1: friction from the nominal slow speed, as the patent prints it", option=True)


@step
def identify(r: IdentifiedLine, p: PlausibleLimits, drive_fast: int, drive_slow: int) -> bool:
    """Line through the two measured points; False leaves slope and friction as they were.

    K = 256 (V1 - V2) / (s1 - s2), rounded; Vf = V2 - K s2 / 256 with the measured s2 (60 when literal).
    """
    rise = r.speed_fast - r.speed_slow
    r.valid = 0
    if rise <= 0 or rise <= p.rise_min:
        return False
    slope = (512 * (drive_fast - drive_slow) + rise) // (2 * rise)
    if slope < p.slope_min or slope > p.slope_max:
        return False
    at_slow = (slope * 60) >> 8 if p.literal_intercept else (slope * r.speed_slow + 128) >> 8
    friction = drive_slow - at_slow
    if friction < 0 or friction > p.friction_max:
        return False
    r.slope = slope
    r.friction = friction
    r.valid = 1
    return True
