"""First-order digital low-pass y(k) = A·x(k) + (1 - A)·y(k-1): its exact properties (filtered-servo spec 3.4).

A : coefficient, 0 < A <= 1; 1 passes the input on unchanged
TS : sample period [s], above 0

What lies outside these ranges is a `DetentError`. The frequency response is that of the numbers at the sample
instants, H(z) = A/(1 - (1 - A)/z) on the unit circle; the hold that keeps y between two samples is not part of it.
"""

from math import asin, inf, log, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from detent.analysis.arguments import check_constants


def impulse_weights(coefficient: float, samples: int) -> NDArray[np.float64]:
    """Weight of the newest, the last but one, ... input in the output: A·(1 - A)^k, shape (samples,), at least one.

    The sum over all k is 1, so that a constant passes unchanged.

    >>> impulse_weights(0.25, 3).tolist()
    [0.25, 0.1875, 0.140625]
    """
    check_constants(coefficient=coefficient, samples=samples)
    return coefficient * (1.0 - coefficient) ** np.arange(samples, dtype=np.float64)


def filter_step(coefficient: float, samples: int) -> NDArray[np.float64]:
    """Output after 1, 2, ... samples, at least one, of a unit step: 1 - (1 - A)^k, shape (samples,).

    >>> filter_step(0.25, 3).tolist()
    [0.25, 0.4375, 0.578125]
    """
    check_constants(coefficient=coefficient, samples=samples)
    return 1.0 - (1.0 - coefficient) ** np.arange(1, samples + 1, dtype=np.float64)


def noise_gain(coefficient: float) -> float:
    """Standard deviation of the output over that of the input, for independent inputs: sqrt(A/(2 - A)).

    It is the root of the sum of the squared impulse weights. Count errors of neighbouring windows are not quite
    independent (what one window misses the next one counts), so that the loop does better than this.

    >>> round(noise_gain(0.25), 3)
    0.378
    """
    return sqrt(nyquist_gain(coefficient))


def nyquist_gain(coefficient: float) -> float:
    """Gain for an input that alternates at each sample, the highest frequency there is: A/(2 - A).

    >>> nyquist_gain(0.25) * 7
    1.0
    """
    check_constants(coefficient=coefficient)
    return coefficient / (2.0 - coefficient)


def equivalent_time_constant(coefficient: float, sample_period: float) -> float:
    """Time constant of the continuous lag that decays alike from sample to sample: -TS/ln(1 - A) [s].

    Not Tf = TS/A, which is what A makes of it only for A << 1; 0 for A = 1, where nothing is left after a sample.

    >>> round(equivalent_time_constant(0.25, 5e-3), 5)
    0.01738
    """
    check_constants(coefficient=coefficient, sample_period=sample_period)
    return -sample_period / log(1.0 - coefficient) if coefficient < 1 else 0.0


def cutoff_hz(coefficient: float, sample_period: float) -> float:
    """Frequency at which the gain has fallen to 1/sqrt(2), -3 dB [Hz].

    |H|² = A²/(A² + 4·(1 - A)·sin²(Ω/2)) = 1/2 with Ω = 2·pi·f·TS gives sin(Ω/2) = A/(2·sqrt(1 - A)). It lies below the
    Nyquist frequency 1/(2·TS), and is infinite where even that passes with more than 1/sqrt(2), which it does from
    A = 0.828 on.

    >>> round(cutoff_hz(0.25, 5e-3), 2)
    9.22
    """
    check_constants(coefficient=coefficient, sample_period=sample_period)
    half_chord = coefficient / (2.0 * sqrt(1.0 - coefficient)) if coefficient < 1 else inf
    return asin(half_chord) / (pi * sample_period) if half_chord <= 1 else inf
