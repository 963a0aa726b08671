"""Frequency response of a periodic excitation, such as a multisine or a chirp that repeats: the mean over its periods.

The response is the ratio of the means at the lines that are excited, and the scatter between the periods is its noise
(R. Pintelon, J. Schoukens, "System Identification: A Frequency Domain Approach", 2nd ed., Wiley 2012, chapter 2).
Nothing leaks, and noise that a loop feeds back into the excitation averages out as well.
"""

from typing import NamedTuple

import numpy as np

from detent.errors import DetentError
from detent.identify.analyse.excitation_period import Periods
from detent.identify.analyse.frequency_response import Complex, FrequencyResponse, response_deviation
from detent.logs.log import Values

WEAKEST = 1e-3  # amplitude of an excited line, as a part of the strongest
_GAP = 5.0
_CLEAR = 10.0
_FEWEST_LINES = 8
_FREEDOM = 40
_LEAST_NOISE = 1e-20


class _Lines(NamedTuple):
    """Spectra of the periods at the excited lines, of shapes (lines,), (periods, lines) and (periods, lines)."""

    frequency: Values
    excitation: Complex
    answer: Complex


def average_periods(periods: Periods, settle: int = 1) -> FrequencyResponse:
    """Response by the mean over periods, noise by the scatter between them.

    ``G = mean(Y) / mean(U)`` and ``var(G) = mean |Y_p - G U_p|^2 / ((P - 1) |mean(U)|^2)`` per line, p = 1..P; the
    variance of the noise is taken from neighbouring lines together, as noise of the sensor that is the same in all of
    them, and a disturbance that the axis answers to as it does to the excitation. A drift from period to period is
    taken out first.
    """
    kept = len(periods.signals[0]) - settle
    if settle < 0 or kept < 2:
        raise DetentError(
            f"identify: came {len(periods.signals[0])} periods, {settle} of them to settle; allowed: two or more "
            "behind those, and 0 or more to settle; record more periods"
        )
    lines = _excited_lines(periods, settle)
    mean = lines.excitation.mean(axis=0)
    response = lines.answer.mean(axis=0) / mean
    noise = np.sum(np.abs(lines.answer - response * lines.excitation) ** 2, axis=0) / (kept - 1)
    power = np.abs(response * mean) ** 2
    level, slope = noise_parts(noise, power, max(_FEWEST_LINES, -(-_FREEDOM // (kept - 1))))
    coherence = 1.0 / (1.0 + level / power + slope)
    said = (
        f"mean of {kept} periods of {periods.duration:.6g} s behind {settle} to settle, {len(response)} excited lines"
    )
    return FrequencyResponse(
        lines.frequency,
        response,
        coherence,
        response_deviation(coherence, kept),
        kept,
        0.0,
        f"{said}; {periods.grid}" if periods.grid else said,
    )


def _excited_lines(periods: Periods, settle: int) -> _Lines:
    """Spectra of the periods at the lines that are excited."""
    size = periods.signals[0].shape[1]
    excitation, answer = (np.fft.rfft(_without_drift(values[settle:]))[:, 1:] for values in periods.signals[:2])
    kept = len(excitation)
    strength = np.abs(excitation.mean(axis=0))
    # Of two periods a line may be alike by chance: the scatter of its neighbours tells.
    scatter = np.sqrt(_smooth(np.var(excitation, axis=0, ddof=1) / kept, _FEWEST_LINES))
    clear = (strength > WEAKEST * strength.max()) & (strength > _CLEAR * scatter)
    # Nothing is known of what lies at half the sample rate.
    clear[(size - 1) // 2 :] = False
    chosen = np.flatnonzero(clear)
    falling = np.sort(strength[chosen])[::-1]
    if len(falling) > _FEWEST_LINES:
        ratios = falling[_FEWEST_LINES - 1 : -1] / falling[_FEWEST_LINES:]
        widest = int(np.argmax(ratios))
        if ratios[widest] > _GAP:
            chosen = np.flatnonzero(clear & (strength >= falling[widest + _FEWEST_LINES - 1]))
    if not len(chosen):
        raise DetentError(
            "identify: came an excitation without a line that comes back in each period; allowed: a multisine or a "
            "chirp that repeats; record one"
        )
    frequency = np.asarray((chosen + 1.0) / periods.duration, dtype=np.float64)
    return _Lines(frequency, excitation[:, chosen], answer[:, chosen])


def _without_drift(values: Values) -> Values:
    """Periods without their mean, and without the slope that leads from one mean to the next."""
    means = values.mean(axis=1)
    slope = np.asarray(np.gradient(means), dtype=np.float64)[:, None]
    along: Values = (np.arange(values.shape[1], dtype=np.float64) + 0.5) / values.shape[1] - 0.5
    return values - means[:, None] - slope * along


def noise_parts(noise: Values, power: Values, reach: int) -> tuple[Values, Values]:
    """Noise by ``a + b |Y|^2``, a and b not negative, fitted to each line and its neighbours.

    Noise of the sensor is alike in neighbouring lines; a disturbance is answered as the excitation is. About a
    resonance that noise is as narrow as the resonance, and a mean over lines would blur it.
    """
    unit = float(power.max())
    noise, power = noise / unit, power / unit
    level, slope = _smooth(noise, reach), np.zeros_like(noise)
    for _ in range(3):
        weight = (level + slope * power + _LEAST_NOISE * power) ** -2.0
        one, p, pp, n, pn = (
            _smooth(weight * values, reach) for values in (np.ones_like(noise), power, power**2, noise, power * noise)
        )
        flat = one * pp - p * p
        slope = np.clip((one * pn - p * n) / np.where(flat > 1e-12 * one * pp, flat, np.inf), 0.0, pn / pp)
        level = np.maximum(n - slope * p, 0.0) / one
    return level * unit, slope


def _smooth(values: Values, half: int) -> Values:
    """Mean over the neighbours to both sides, fewer at the ends."""
    # Not by a running sum: weights beside a resonance differ by more than a float has digits.
    sums, counts = (
        np.convolve(series, np.ones(2 * half + 1))[half : half + len(values)]
        for series in (values, np.ones(len(values)))
    )
    return sums / counts
