"""Exponential and sine of a step: the C libraries round theirs differently, these give the same bits everywhere.

Nothing but sums, products, one quotient, comparisons and conversions of float64, in the order in which they stand:
plain Python, compiled steps and a firmware in C agree bit for bit, where the compiler does not fuse a product with a
sum (C: ``-ffp-contract=off``). Results are within one unit in the last place, finite input never gives a NaN, and an
exponential too large or too small is infinite or 0, as in C.

W. J. Cody, W. Waite: Software Manual for the Elementary Functions (1980): reduction by a constant in parts.
FDLIBM 5.3 (Sun Microsystems, 1993; e_exp.c, k_sin.c, k_cos.c, e_rem_pio2.c): the constants, and the sums, in the
exponential in pairs.
"""

from math import floor, inf, sqrt

from detent.kernel.compiled import power_of_two
from detent.kernel.step import bounded, step

LOG2_E = 1.44269504088896338700
LN2_HIGH, LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
HIGHEST, LOWEST = 709.782712893383973096, -745.13321910194110842  # exponents beyond which the result is infinite, or 0
TO_WHOLE = 6755399441055744.0  # 1.5 x 2^52: added and taken off again, it rounds to a whole number
TWO_OVER_PI = 6.36619772367581382433e-01
# A quarter turn in three parts of 33 bits, of which whole multiples up to 2^20 are exact, and what is left of it.
HALF_PI_1, HALF_PI_2 = 1.57079632673412561417, 6.07710050630396597660e-11
HALF_PI_3, HALF_PI_REST = 2.02226624871116645580e-21, 8.47842766036889956997e-32
# Angle up to which they suffice [rad]; beyond it whole turns are taken off first, and the turn itself is rounded.
FARTHEST = 1.6e6
FULL_TURN = 6.283185307179586


@step
def exp(x: float) -> float:
    """Exponential: x = n ln 2 + r, and a rational function of r."""
    if x > HIGHEST:
        return inf
    if x < LOWEST:
        return 0.0
    if x != x:  # noqa: PLR0124 - not a number
        return x
    n = (x * LOG2_E + TO_WHOLE) - TO_WHOLE
    high, low = x - n * LN2_HIGH, n * LN2_LOW
    r = high - low
    t = r * r
    square = t * t
    c = -2.77777777770155933842e-03 * t + 1.66666666666666019037e-01  # in pairs, which a processor sums side by side
    c += square * ((6.61375632143793436117e-05 - 1.65339022054652515390e-06 * t) + square * 4.13813679705723846039e-08)
    c = r - t * c
    y = 1.0 - ((low - (r * c) / (2.0 - c)) - high)
    k = int(n)
    if abs(k) <= 1000:
        return y * power_of_two(k)
    if k > 0:
        return y * power_of_two(k - 2) * 4.0
    return y * power_of_two(k + 200) * power_of_two(-200)  # rounded once, where it is smaller than any normal one


@step
def sin(x: float) -> float:
    """Sine of an angle [rad]: a polynomial of what is left of whole quarter turns."""
    if not abs(x) < inf:
        return x - x  # no angle, no number
    if abs(x) > FARTHEST:
        x = less_whole_turns(x) if x > 0.0 else -less_whole_turns(-x)
    n = floor(x * TWO_OVER_PI + 0.5)
    # Two differences whose rounding is known: high + low is the angle to twice the precision.
    first = x - n * HALF_PI_1
    second = first - n * HALF_PI_2
    rest = n * HALF_PI_3 + n * HALF_PI_REST - ((first - second) - n * HALF_PI_2)
    high = second - rest
    low = (second - high) - rest
    y = sine_part(high, low) if n & 1 == 0 else cosine_part(high, low)
    return y if n & 2 == 0 else -y


@step
def sine_part(x: float, low: float) -> float:
    """Sine of x + low, at most an eighth of a turn [rad]."""
    z = x * x
    v = z * x
    r = -2.50507602534068634195e-08 + z * 1.58969099521155010221e-10
    r = 8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * (2.75573137070700676789e-06 + z * r))
    return x - ((z * (0.5 * low - v * r) - low) - v * -1.66666666666666324348e-01)


@step
def cosine_part(x: float, low: float) -> float:
    """Cosine of x + low, at most an eighth of a turn [rad]."""
    z = x * x
    r = 2.08757232129817482790e-09 + z * -1.13596475577881948265e-11
    r = 2.48015872894767294178e-05 + z * (-2.75573143513906633035e-07 + z * r)
    r = z * (4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * r))
    half = 0.5 * z
    w = 1.0 - half
    return w + (((1.0 - w) - half) + (z * r - x * low))


@step
@bounded(1022, "from a turn to the largest float, by twos")
def less_whole_turns(x: float) -> float:
    """What is left of a large angle without whole turns, exactly."""
    turn = FULL_TURN
    below = turn <= 0.5 * x  # a truth value of its own: no loop counts in floats (MISRA C 14.1)
    while below:
        turn *= 2.0
        below = turn <= 0.5 * x
    beyond = x >= FULL_TURN
    while beyond:
        if x >= turn:
            x -= turn
        turn *= 0.5
        beyond = turn >= FULL_TURN and x >= FULL_TURN
    return x


SERIES_UP_TO = 0.5  # beyond it, `one_less_exp` is its difference: less than a bit and a half is lost there


def one_less_exp(x: float) -> float:
    """``1 - exp(-x)`` of x, 0 or more, by its series where the difference would cancel. For parameters: no step."""
    if x > SERIES_UP_TO:
        return 1.0 - exp(-x)
    term, total, n = x, 0.0, 1
    while total + term != total:
        total += term
        n += 1
        term *= -x / n
    return total


def angle_of(y: float, x: float) -> float:
    """Angle of a vector from -pi to pi [rad], halved until its series is short. For parameters: no step."""
    if x < 0.0:
        return (0.5 * FULL_TURN if y >= 0.0 else -0.5 * FULL_TURN) - angle_of(y, -x)
    if y == 0.0:
        return 0.0
    tangent = y / (sqrt(x * x + y * y) + x)  # of half the angle
    for _ in range(3):
        tangent /= 1.0 + sqrt(1.0 + tangent * tangent)
    square, total = tangent * tangent, 0.0
    for n in range(25, 0, -2):
        total = 1.0 / n - square * total
    return 16.0 * tangent * total
