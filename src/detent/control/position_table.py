"""Position table PDT and the way to an angle (rotary-table specification 3.6).

A position number names an angle, a speed and how to get there: the shortest way, always to larger or always to
smaller angles, or to the angle as commanded, counted from 0 of the present turn and without a wrap.
"""

from detent.kernel.registers import Registers, i8, i8_array, register, u1_array
from detent.kernel.step import step

SHORTEST, POSITIVE, NEGATIVE, AS_COMMANDED = 0, 1, 2, 3  # direction policies
POSITIONS = 128


class PositionTable(Registers):
    """PDT: angle and speed per position number, written by operator or program."""

    entries: i8 = register("position numbers in use, from 0", unit="count")
    angle: i8_array = register("angle", unit="count", length=POSITIONS)
    speed: i8_array = register(
        "speed per interrupt; 0 where there is no such position", unit="count/2^f", length=POSITIONS
    )
    policy: u1_array = register("0 shortest, 1 positive, 2 negative, 3 as commanded", unit="code", length=POSITIONS)
    tolerance: i8 = register(
        "a target this near is taken the short way, whatever its direction; below T/2", unit="count"
    )


@step
def way_to(period: int, tolerance: int, policy: int, target: int, present: int) -> int:
    """Signed way from the present angle to a target [count]; exactly half a turn goes negative by the shortest way.

    A table that stands a count beyond its target would go round almost a whole turn to come to it from its own side:
    within `tolerance` it goes back.
    """
    if policy == AS_COMMANDED:
        return target - present
    half = period >> 1
    way = (target - present + half) % period - half
    if policy == POSITIVE and way < -tolerance:
        return way + period
    if policy == NEGATIVE and way > tolerance:
        return way - period
    return way
