"""First-order digital low-pass y(k) = A·x(k) + (1 - A)·y(k-1): its exact properties (filtered-servo spec 3.4).

A : coefficient, 0 < A <= 1; 1 passes the input on unchanged
TS : sample period [s]

The frequency response is that of the numbers at the sample instants, H(z) = A/(1 - (1 - A)/z) on the unit circle; the
hold that keeps y between two samples is not part of it.
"""

from math import asin, inf, log, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from detent.analysis.arguments import require_between, require_count, require_positive

_COEFFICIENT = "A = TS/Tf, 1 for no filter"
_PERIOD = "the sample period TS"


def impulse_weights(coefficient: float, samples: int) -> NDArray[np.float64]:
    """Weight of the newest, the last but one, ... input in the output: A·(1 - A)^k.

    Parameters
    ----------
    coefficient : float
        A, 0 < A <= 1.
    samples : int
        How many weights, at least 1.

    Returns
    -------
    ndarray
        Shape (samples,); the sum over all k is 1, so that a constant passes unchanged.

    Raises
    ------
    DetentError
        The coefficient or the number of samples is out of range.

    Examples
    --------
    >>> impulse_weights(0.25, 3).tolist()
    [0.25, 0.1875, 0.140625]
    """
    _check(coefficient)
    require_count("samples", samples, 1, "how many weights to compute")
    return coefficient * (1.0 - coefficient) ** np.arange(samples, dtype=np.float64)


def filter_step(coefficient: float, samples: int) -> NDArray[np.float64]:
    """Output after 1, 2, ... samples of a unit step: 1 - (1 - A)^k.

    Parameters
    ----------
    coefficient : float
        A, 0 < A <= 1.
    samples : int
        How many outputs, at least 1.

    Returns
    -------
    ndarray
        Shape (samples,).

    Raises
    ------
    DetentError
        The coefficient or the number of samples is out of range.

    Examples
    --------
    >>> filter_step(0.25, 3).tolist()
    [0.25, 0.4375, 0.578125]
    """
    _check(coefficient)
    require_count("samples", samples, 1, "how many outputs to compute")
    return 1.0 - (1.0 - coefficient) ** np.arange(1, samples + 1, dtype=np.float64)


def noise_gain(coefficient: float) -> float:
    """Standard deviation of the output over that of the input, for independent inputs: sqrt(A/(2 - A)).

    It is the root of the sum of the squared impulse weights. Count errors of neighbouring windows are not quite
    independent (what one window misses the next one counts), so that the loop does better than this.

    Parameters
    ----------
    coefficient : float
        A, 0 < A <= 1.

    Raises
    ------
    DetentError
        The coefficient is out of range.

    Examples
    --------
    >>> round(noise_gain(0.25), 3)
    0.378
    """
    return sqrt(nyquist_gain(coefficient))


def nyquist_gain(coefficient: float) -> float:
    """Gain for an input that alternates at each sample, the highest frequency there is: A/(2 - A).

    Parameters
    ----------
    coefficient : float
        A, 0 < A <= 1.

    Raises
    ------
    DetentError
        The coefficient is out of range.

    Examples
    --------
    >>> nyquist_gain(0.25) * 7
    1.0
    """
    _check(coefficient)
    return coefficient / (2.0 - coefficient)


def equivalent_time_constant(coefficient: float, sample_period: float) -> float:
    """Time constant of the continuous lag that decays alike from sample to sample: -TS/ln(1 - A) [s].

    Not Tf = TS/A, which is what A makes of it only for A << 1; 0 for A = 1, where nothing is left after a sample.

    Parameters
    ----------
    coefficient : float
        A, 0 < A <= 1.
    sample_period : float
        TS [s].

    Raises
    ------
    DetentError
        The coefficient or the sample period is out of range.

    Examples
    --------
    >>> round(equivalent_time_constant(0.25, 5e-3), 5)
    0.01738
    """
    _check(coefficient)
    require_positive("sample_period", sample_period, "s", _PERIOD)
    return -sample_period / log(1.0 - coefficient) if coefficient < 1 else 0.0


def cutoff_hz(coefficient: float, sample_period: float) -> float:
    """Frequency at which the gain has fallen to 1/sqrt(2), -3 dB [Hz].

    |H|² = A²/(A² + 4·(1 - A)·sin²(Ω/2)) = 1/2 with Ω = 2·pi·f·TS gives sin(Ω/2) = A/(2·sqrt(1 - A)).

    Parameters
    ----------
    coefficient : float
        A, 0 < A <= 1.
    sample_period : float
        TS [s].

    Returns
    -------
    float
        Below the Nyquist frequency 1/(2·TS); infinite where even that passes with more than 1/sqrt(2), which it does
        from A = 0.828 on.

    Raises
    ------
    DetentError
        The coefficient or the sample period is out of range.

    Examples
    --------
    >>> round(cutoff_hz(0.25, 5e-3), 2)
    9.22
    """
    _check(coefficient)
    require_positive("sample_period", sample_period, "s", _PERIOD)
    half_chord = coefficient / (2.0 * sqrt(1.0 - coefficient)) if coefficient < 1 else inf
    return asin(half_chord) / (pi * sample_period) if half_chord <= 1 else inf


def _check(coefficient: float) -> None:
    require_between("coefficient", coefficient, 0.0, 1.0, _COEFFICIENT)
