"""Frequency response from a recording: what an axis answers to each frequency.

A periodic excitation is averaged over its periods (`average_periods`), any other over windows
(`average_windows`). Both assume an axis that stays as it is through the recording. Dry friction and
backlash are no noise: they come back in each period, so that neither coherence nor scatter show them.

Of windows ``H1 = S_uy / S_uu`` (J. S. Bendat, A. G. Piersol, "Random Data", 4th ed., Wiley 2010, chapters 9 and 11).
Noise of the excitation makes the response too small, and a loop that feeds the position back draws it towards the
negative inverse of the controller: a periodic excitation is better wherever one can be recorded.
"""

from dataclasses import replace

import numpy as np

from detent.errors import DetentError
from detent.identify.analyse.average_periods import average_periods
from detent.identify.analyse.excitation_period import FEWEST, cut_periods
from detent.identify.analyse.frequency_response import FrequencyResponse, response_deviation
from detent.logs.log import Log, Values
from detent.logs.stamps import stretches
from detent.logs.windows import scipy

WEAKEST_BAND = 1e-4  # power density of an excited frequency, as a part of the strongest
OVERLAP = 0.5  # overlap of two windows
WINDOWS = 8  # windows that a recording is long, where no frequency step is asked for
FEWEST_ROWS = 64  # samples below which there is no response to speak of


def measure_response(t: Values, excitation: Values, answer: Values) -> FrequencyResponse:
    """Measure a frequency response, by periods where the excitation has some, otherwise by windows."""
    t, excitation, answer = _longest_stretch(t, excitation, answer)
    periods = cut_periods(t, excitation, [answer])
    is_periodic = periods is not None and len(periods.signals[0]) >= FEWEST
    return average_periods(periods) if periods and is_periodic else average_windows(t, excitation, answer)


def response_of(log: Log, effort: str = "", position: str = "position") -> FrequencyResponse:
    """Measure the response of the position to the effort in a log."""
    chosen = log.effort(effort)
    log.need(position)
    found = measure_response(log.t, log.signals[chosen], log.signals[position])
    return replace(found, input_unit=log.units.get(chosen, ""), output_unit=log.units.get(position, ""))


def _longest_stretch(t: Values, excitation: Values, answer: Values) -> tuple[Values, Values, Values]:
    """The longest part without a gap."""
    if not len(t) == len(excitation) == len(answer) or len(t) < FEWEST_ROWS:
        raise DetentError(
            f"identify: came {len(t)} times, {len(excitation)} values of the input, {len(answer)} of the output; "
            f"allowed: as many of each, {FEWEST_ROWS} or more; record longer"
        )
    part = max(stretches(t), key=lambda part: part.stop - part.start)
    if part.stop - part.start < FEWEST_ROWS:
        raise DetentError(
            f"identify: came {part.stop - part.start} samples between two gaps; allowed: {FEWEST_ROWS} or more; record "
            "without missing rows"
        )
    return t[part], excitation[part], answer[part]


def average_windows(t: Values, excitation: Values, answer: Values, step_hz: float | None = None) -> FrequencyResponse:
    """Response by Welch's method: Hann windows that overlap by half, ``H1 = S_uy / S_uu``."""
    mean, excitation, answer, grid = _even(t, excitation, answer)
    rows = len(excitation) // WINDOWS if step_hz is None else round(1.0 / (step_hz * mean))
    if not FEWEST_ROWS // WINDOWS <= rows <= len(excitation) // 2 or not np.ptp(excitation) > 0:
        raise DetentError(
            f"identify: came {len(excitation)} samples for windows of {rows}, with an excitation over "
            f"{np.ptp(excitation):g}; allowed: two windows or more of {FEWEST_ROWS // WINDOWS} samples or more, and an "
            "excitation that changes; record longer, with a chirp or a multisine"
        )
    how = {"fs": 1.0 / mean, "window": "hann", "nperseg": rows, "noverlap": int(OVERLAP * rows), "detrend": "linear"}
    frequency, power = scipy("signal").welch(excitation, **how)
    power_out = scipy("signal").welch(answer, **how)[1]
    cross = scipy("signal").csd(excitation, answer, **how)[1]
    chosen = (power > WEAKEST_BAND * power.max()) & (frequency > 0) & (frequency < 0.5 / mean)
    coherence = np.abs(cross[chosen]) ** 2 / np.maximum(power[chosen] * power_out[chosen], 1e-300)
    averages = independent_windows(len(excitation), rows)
    said = f"H1 by Welch: Hann windows of {rows * mean:.4g} s, overlap {OVERLAP:.0%}, {averages:.1f} independent ones"
    return FrequencyResponse(
        np.asarray(frequency[chosen], dtype=np.float64),
        np.asarray(cross[chosen] / power[chosen], dtype=np.complex128),
        np.minimum(coherence, 1.0),
        response_deviation(coherence, averages),
        averages,
        1.5 / (rows * mean),
        f"{said}; {grid}" if grid else said,
    )


def independent_windows(rows: int, window: int) -> float:
    """Independent averages in Hann windows that overlap by half.

    P. D. Welch, IEEE Transactions on Audio and Electroacoustics 15 (1967) 70, equation for the variance with overlap:
    neighbours share a sixth of their values' products.

    >>> round(independent_windows(1000, 125), 1)
    13.3
    """
    count = (rows - window) // (window - int(OVERLAP * window)) + 1
    return count / (1.0 + 2.0 * (count - 1) / count / 36.0)


def _even(t: Values, excitation: Values, answer: Values) -> tuple[float, Values, Values, str]:
    """Time between samples, signals on an even grid, and what was done for it."""
    steps = np.diff(t)
    mean = float(t[-1] - t[0]) / len(steps)
    if float(np.std(steps)) <= 1e-6 * mean:
        return mean, excitation, answer, ""
    even: Values = t[0] + mean * np.arange(len(t), dtype=np.float64)
    said = f"stamps {1e3 * steps.min():.4g} to {1e3 * steps.max():.4g} ms apart, put on an even grid by straight lines"
    return mean, np.interp(even, t, excitation), np.interp(even, t, answer), said
