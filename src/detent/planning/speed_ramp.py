"""Change of a speed within an acceleration and a jerk: at most three stretches of constant jerk, in the least time.

The acceleration goes to a peak, stays there if that is the largest allowed, and goes back to zero, which it reaches
together with the speed asked for. A stop is the change to speed 0. Without a jerk limit (jerk 0) the acceleration
jumps, and there is one stretch.

Legend: `x`, `v`, `a`, `j` way, speed, acceleration and jerk; `most`, `jerk` their limits; `v1` the speed asked for.
"""

import math

from detent.kernel.step import step


@step
def passed(v: float, a: float, j: float, t: float) -> tuple[float, float]:
    """Way and speed after a time `t` of constant jerk."""
    return t * (v + t * (a / 2.0 + t * j / 6.0)), v + t * (a + t * j / 2.0)


@step
def level_speed(jerk: float, v: float, a: float) -> float:
    """Speed that is left when the acceleration is taken away at once: the speed that counts."""
    return v if jerk == 0.0 else v + a * abs(a) / (2.0 * jerk)


@step
def ramp(most: float, jerk: float, v: float, a: float, v1: float) -> tuple[float, float, float, float, float, float]:
    """Times of the three stretches, the peak of the acceleration, and the jerk of the first and the last stretch.

    With g the gain of speed beyond the level one, both along the change: without a stretch at the largest acceleration
    the peak p has p^2 = a^2 + j g if the axis speeds up that way already, and p^2 = j g if not.
    """
    if jerk == 0.0:
        change = v1 - v
        return 0.0, abs(change) / most, 0.0, most if change > 0.0 else -most, 0.0, 0.0
    level = level_speed(jerk, v, a)
    sign = 1.0 if v1 >= level else -1.0
    along, gain = sign * a, sign * (v1 - level)
    square = jerk * gain + (along * along if along > 0.0 else 0.0)
    if along > most:  # a limit that was lowered
        peak, hold = most, gain / most
    elif square > most * most:
        peak, hold = most, (square - most * most) / (jerk * most)
    else:
        peak, hold = math.sqrt(square), 0.0
    first = sign * (jerk if peak >= along else -jerk)
    return abs(peak - along) / jerk, hold, peak / jerk, sign * peak, first, -sign * jerk


@step
def way_to_rest(most: float, jerk: float, v: float, a: float) -> float:
    """Way of the shortest stop, from where it begins to where it ends."""
    first, hold, last, peak, j1, j3 = ramp(most, jerk, v, a, 0.0)
    x1, v1 = passed(v, a, j1, first)
    x2, _ = passed(v1, peak, 0.0, hold)
    return x1 + x2 + j3 * last * last * last / 6.0


@step
def way_to_turn(jerk: float, v: float, a: float) -> float:
    """Way of the stop to where it must turn: 0 if it does not.

    An acceleration against the speed that cannot be taken away before the speed is gone carries the axis back.
    """
    if v * level_speed(jerk, v, a) >= 0.0:
        return 0.0
    sign = 1.0 if v > 0.0 else -1.0
    brake, speed = -sign * a, sign * v
    t = 2.0 * speed / (brake + math.sqrt(brake * brake - 2.0 * jerk * speed))
    x, _ = passed(v, a, sign * jerk, t)
    return x


@step
def reach(most: float, jerk: float, v: float, a: float) -> tuple[float, float]:
    """Lowest and highest place that the shortest stop touches, from where it begins."""
    end, turn = way_to_rest(most, jerk, v, a), way_to_turn(jerk, v, a)
    low, high = (end, turn) if end < turn else (turn, end)
    return min(low, 0.0), max(high, 0.0)


@step
def way_with_stop(most: float, jerk: float, v: float, a: float, j: float, t: float) -> float:
    """Way of a time `t` of constant jerk and the stop after it."""
    x, v1 = passed(v, a, j, t)
    return x + way_to_rest(most, jerk, v1, a + j * t)
