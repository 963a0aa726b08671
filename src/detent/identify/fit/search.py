"""Where a function of one number is least, and where it is 0, by Brent's methods.

SciPy has both, step by step the same. Its package takes longer to load than a log of 25 s takes to identify, and these
two are all that an identification by regression needs of it.

Brent: Algorithms for Minimization without Derivatives (1973), chapters 4 and 5.
"""

import math
from collections.abc import Callable

GOLDEN = 0.5 * (3.0 - math.sqrt(5.0))
ROUNDS = 500  # evaluations at most
NEAR = math.sqrt(2.2e-16)  # distance, over the place, within which a function is flat but for rounding
FINEST = 8.881784197001252e-16  # distance, over the place, that a root is not told any closer than


def least_within(f: Callable[[float], float], low: float, high: float, accuracy: float = 1e-5) -> float:
    """Find the place of a local minimum between two places, to an accuracy.

    >>> round(least_within(lambda x: (x - 0.3) ** 2, 0.0, 1.0), 4)
    0.3
    """
    best = second = third = low + GOLDEN * (high - low)
    f_best = f_second = f_third = f(best)
    step = before = 0.0
    for _ in range(ROUNDS):
        middle, reach = 0.5 * (low + high), NEAR * abs(best) + accuracy / 3.0
        if abs(best - middle) <= 2.0 * reach - 0.5 * (high - low):
            break
        p, q = _parabola((best, f_best), (second, f_second), (third, f_third))
        is_usable = abs(before) > reach and abs(p) < abs(0.5 * q * before)
        if is_usable and q * (low - best) < p < q * (high - best):
            before, step = step, p / q
            if best + step - low < 2.0 * reach or high - best - step < 2.0 * reach:
                step = math.copysign(reach, middle - best)
        else:
            before = (low if best >= middle else high) - best
            step = GOLDEN * before
        x = best + math.copysign(max(abs(step), reach), step)
        y = f(x)
        if y <= f_best:
            low, high = (best, high) if x >= best else (low, best)
            third, f_third, second, f_second, best, f_best = second, f_second, best, f_best, x, y
            continue
        low, high = (x, high) if x < best else (low, x)
        if y <= f_second or second == best:
            third, f_third, second, f_second = second, f_second, x, y
        elif y <= f_third or third in (best, second):
            third, f_third = x, y
    return best


def _parabola(*points: tuple[float, float]) -> tuple[float, float]:
    """Step from the first of three points to the bottom of their parabola, as two numbers whose ratio it is."""
    (x, f), (x2, f2), (x3, f3) = points
    r, q = (x - x2) * (f - f3), (x - x3) * (f - f2)
    p, q = (x - x3) * q - (x - x2) * r, 2.0 * (q - r)
    return (-p if q > 0.0 else p), abs(q)


def root_within(f: Callable[[float], float], low: float, high: float, accuracy: float = 2e-12) -> float:
    """Find the place between two of different signs at which a function is 0, to an accuracy.

    >>> round(root_within(lambda x: x**3 - 2.0, 0.0, 2.0), 9)
    1.25992105
    """
    before, x, other = low, high, 0.0
    f_before, y, f_other = f(low), f(high), 0.0
    if f_before == 0.0:
        return low
    previous = step = 0.0
    for _ in range(ROUNDS):
        if y != 0.0 and (f_before > 0.0) != (y > 0.0):
            other, f_other = before, f_before
            previous = step = x - before
        if abs(f_other) < abs(y):
            before, x, other = x, other, x
            f_before, y, f_other = y, f_other, y
        reach, half = 0.5 * (accuracy + FINEST * abs(x)), 0.5 * (other - x)
        if y == 0.0 or abs(half) < reach:
            break
        tried = math.inf
        if abs(previous) > reach and abs(y) < abs(f_before):
            if before == other:
                tried = -y * (x - before) / (y - f_before)
            else:
                one, two = (f_before - y) / (before - x), (f_other - y) / (other - x)
                tried = -y * (f_other * two - f_before * one) / (two * one * (f_other - f_before))
        if 2.0 * abs(tried) < min(abs(previous), 3.0 * abs(half) - reach):
            previous, step = step, tried
        else:
            previous = step = half
        before, f_before = x, y
        x += step if abs(step) > reach else math.copysign(reach, half)
        y = f(x)
    return x
