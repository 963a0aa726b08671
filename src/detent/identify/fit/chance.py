"""What chance alone reaches: the tails of Student's and Fisher's distributions, by the incomplete beta function.

SciPy has them. Its package takes longer to load than a log of 25 s takes to identify, and these tails are all that an
identification needs of it.

Lentz: Generating Bessel functions in Mie scattering calculations using continued fractions. Applied Optics 15 (1976).
NIST Digital Library of Mathematical Functions (2010), 8.17.22, the fraction, and 8.17.4, its mirror.
"""

import math
from functools import cache
from statistics import NormalDist

ROUNDS = 10_000  # terms of a fraction, and steps to a quantile, at most
NEAR = 1e-15  # change of a fraction, over it, from which on it changes no more
STEADY = 1e-7  # step to a quantile, over it, behind which the next, about its square, would be rounding
NOTHING = 1e-300  # in the place of a divisor that is 0


def beta_share(a: float, b: float, x: float) -> float:
    """Regularised incomplete beta function ``I_x(a, b)``.

    >>> round(beta_share(2.0, 3.0, 0.5), 12), beta_share(1.0, 1.0, 0.25)
    (0.6875, 0.25)
    """
    if not 0.0 < x < 1.0:
        return 0.0 if x <= 0.0 else 1.0
    if x > (a + 1.0) / (a + b + 2.0):
        return 1.0 - _beta_share(b, a, 1.0 - x, x)
    return _beta_share(a, b, x, 1.0 - x)


def _beta_share(a: float, b: float, x: float, rest: float) -> float:
    """The same where its fraction converges; `rest` is ``1 - x``, which rounding would spoil."""
    front = math.exp(math.lgamma(a + b) - math.lgamma(a) - math.lgamma(b) + a * math.log(x) + b * math.log(rest))
    return front * _fraction(a, b, x) / a


def _fraction(a: float, b: float, x: float) -> float:
    """The continued fraction, from its front on."""
    above, below = 1.0, 1.0 / ((1.0 - (a + b) * x / (a + 1.0)) or NOTHING)
    found = below
    for k in range(1, ROUNDS):
        even = k * (b - k) * x / ((a + 2.0 * k - 1.0) * (a + 2.0 * k))
        odd = -(a + k) * (a + b + k) * x / ((a + 2.0 * k) * (a + 2.0 * k + 1.0))
        change = 1.0
        for term in (even, odd):
            below = 1.0 / ((1.0 + term * below) or NOTHING)
            above = (1.0 + term / above) or NOTHING
            change = above * below
            found *= change
        if abs(change - 1.0) < NEAR:
            break
    return found


def student_tail(t: float, degrees: float) -> float:
    """Probability that Student's variable lies above `t` >= 0.

    >>> round(student_tail(1.0, 1.0), 12)
    0.25
    """
    square = t * t
    x, rest = degrees / (degrees + square), square / (degrees + square)
    a, b = 0.5 * degrees, 0.5
    if x > (a + 1.0) / (a + b + 2.0):
        return 0.5 - 0.5 * (_beta_share(b, a, rest, x) if rest > 0.0 else 0.0)
    return 0.5 * _beta_share(a, b, x, rest)


@cache
def student_reach(chance: float, degrees: float) -> float:
    """How far Student's variable reaches with a chance, 0 < chance < 0.5: ``P(T > reach) = chance``.

    >>> round(student_reach(0.025, 10.0), 6), round(student_reach(0.025, math.inf), 6)
    (2.228139, 1.959964)
    """
    normal = NormalDist().inv_cdf(1.0 - chance) if chance > 1e-3 else -NormalDist().inv_cdf(chance)
    if math.isinf(degrees):
        return normal
    # Newton's steps in the logarithms of both, in which the tail is next to straight, from the expansion of Fisher and
    # Cornish on.
    front = math.lgamma(0.5 * (degrees + 1.0)) - math.lgamma(0.5 * degrees) - 0.5 * math.log(degrees * math.pi)
    t = normal + normal * (normal**2 + 1.0) / (4.0 * degrees)
    t += normal * (5.0 * normal**4 + 16.0 * normal**2 + 3.0) / (96.0 * degrees**2)
    for _ in range(ROUNDS):
        tail = student_tail(t, degrees)
        density = math.exp(front - 0.5 * (degrees + 1.0) * math.log1p(t * t / degrees))
        step = math.log(tail / chance) * tail / (density * t)
        t *= math.exp(step)
        if abs(step) < STEADY:
            break
    return t


def fisher_tail(ratio: float, above: float, below: float) -> float:
    """Probability that Fisher's ratio, with degrees of freedom above and below the line, is larger than `ratio`.

    >>> round(fisher_tail(1.0, 2.0, 2.0), 12)
    0.5
    """
    return beta_share(0.5 * below, 0.5 * above, below / (below + above * ratio)) if ratio > 0.0 else 1.0
