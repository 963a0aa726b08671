"""Choice of the speed of a move from its distance (print-head specification 3.4)."""

from detent.kernel.step import bounded, step

FLOOR = 30  # 5 in/s: the search does not go below it
HIGH_SPEED = 60  # 10 in/s: from here on the high-speed algorithm
HALVINGS = 15  # of a speed value of 16 bits at most


@step
def fits(distance: int, s: int) -> bool:
    """2.5 times the stop distance is below the distance: 5 s^2 < 288 D; equality does not fit."""
    return 5 * s * s < 288 * distance


@step
def slower(s: int, maximum: int) -> int:
    """Next trial speed: half, not below the floor, and never above the commanded maximum."""
    half = s >> 1
    return half if half > FLOOR else min(FLOOR, maximum)


@step
@bounded(HALVINGS, "halves a speed value of 16 bits")
def select_speed(distance: int, maximum: int) -> int:
    """Speed value for a distance in emitters."""
    s = maximum
    while s > FLOOR and not fits(distance, s):
        s = slower(s, maximum)
    return s
