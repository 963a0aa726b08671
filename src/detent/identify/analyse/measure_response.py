"""Frequency response from a recording: what an axis answers to each frequency.

A periodic excitation is averaged over its periods, any other over windows. Dry friction and backlash are no noise: they
come back in each period, so that neither coherence nor scatter show them.

Of windows ``H1 = S_uy / S_uu`` (J. S. Bendat, A. G. Piersol, "Random Data", 4th ed., Wiley 2010, chapters 9 and 11).
Noise of the excitation makes the response too small, and a loop that feeds the position back draws it towards the
negative inverse of the controller. Of periods it is the ratio of the means at the lines that are excited, and the
scatter between the periods is its noise (R. Pintelon, J. Schoukens, "System Identification: A Frequency Domain
Approach", 2nd ed., Wiley 2012, chapter 2): nothing leaks, and noise that a loop feeds back averages out as well.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from detent.errors import DetentError
from detent.logs.differences import products_of, scipy
from detent.logs.log import Log, Values
from detent.logs.stamps import stretches

WEAKEST_BAND = 1e-4  # power density of an excited frequency, as a part of the strongest
OVERLAP = 0.5  # overlap of two windows
WINDOWS = 8  # windows that a recording is long, where no frequency step is asked for
FEWEST_ROWS = 64  # samples below which there is no response to speak of
WEAKEST = 1e-3  # amplitude of an excited line, as a part of the strongest
_GAP = 5.0
_CLEAR = 10.0
_FEWEST_LINES = 8
_FREEDOM = 40
_LEAST_NOISE = 1e-20
LIKENESS = 0.9  # correlation of an excitation with itself a period later, from which it is taken for periodic
INTERPOLATED = ", resampled to an even grid by linear interpolation"
FEWEST = 3  # periods that a recording must hold to be called periodic: one to settle, two to compare
_APART = 0.5
_AS_GOOD = 0.02
_EVEN = 1e-6
_BETTER = 1.05

COHERENT = 0.8  # coherence of a line that tells something
FEWEST_COHERENT = 10  # coherent lines without which there is no Bode plot
AGREEING = 0.9  # share of neighbouring lines whose accelerations are less than a factor of 2 apart, at least
BROADEST = 3.0  # highest over lowest coherent frequency, at least

Complex = NDArray[np.complex128]


@dataclass(frozen=True, slots=True)
class Periods:
    """Signals of a recording, cut into periods of their excitation."""

    signals: tuple[Values, ...]  # each of shape (periods, samples of a period)
    step: float  # time between two samples [s]
    # what differs between two periods of the excitation that follow one another, rms, as a part of its rms
    mismatch: float
    grid: str  # what was done to put samples on a grid, for a person

    @property
    def duration(self) -> float:
        """Duration of a period [s]."""
        return self.step * self.signals[0].shape[1]


def find_period(values: Values) -> float | None:
    """Period of a signal, by the first peak of its autocorrelation that is as high as the highest.

    The autocorrelation compares the two parts that overlap, so that noise lowers it at each lag alike. Peaks many
    periods away then give the fraction of a row.

    >>> find_period(np.sin(np.arange(1000) / 10.0)).__round__(2)
    62.83
    """
    curve = autocorrelation(values)
    apart = np.flatnonzero(curve < _APART)
    last = len(values) // FEWEST
    if not len(apart) or apart[0] + 2 > last:
        return None
    first = int(apart[0])
    inner = curve[first + 1 : last + 1]
    tops = np.flatnonzero((inner >= curve[first:last]) & (inner >= curve[first + 2 : last + 2])) + first + 1
    if not len(tops) or curve[tops].max() < LIKENESS:
        return None
    period = _summit(curve, int(tops[np.argmax(curve[tops] >= curve[tops].max() - _AS_GOOD)]))
    times = 2
    # Each peak is looked for where the one before says; so its error stays below a row.
    while times * period < 0.75 * len(values):
        about = round(times * period)
        near = np.arange(about - 2, min(about + 3, len(curve) - 1))
        period = _summit(curve, int(near[np.argmax(curve[near])])) / times
        times *= 2
    return period


def autocorrelation(values: Values) -> Values:
    """Correlation of a signal with itself, some rows later, over the part in which the two overlap."""
    centred = values - values.mean()
    products = products_of(centred, centred)[len(values) - 1 :]
    sums = np.r_[0.0, np.cumsum(centred**2)]
    early, late = sums[len(values) : 0 : -1], sums[-1] - sums[: len(values)]
    # The sums of the last rows are rounding: what is compared there says nothing.
    size = np.sqrt(np.maximum(early * late, (1e-9 * sums[-1]) ** 2))
    return products / size if sums[-1] > 0 else np.zeros(len(values))


def _summit(curve: Values, top: int) -> float:
    """Where the parabola through a peak and its neighbours is highest."""
    left, middle, right = curve[top - 1 : top + 2].tolist()
    bend = left - 2 * middle + right
    return top + (0.5 * (left - right) / bend if bend < 0 else 0.0)


def cut_periods(t: Values, excitation: Values, others: Sequence[Values] = ()) -> Periods | None:
    """Cut signals along the periods of the first of them."""
    # The excitation repeats in the clock of the machine that made it, which is not that of the stamps, or these jitter:
    # rows as they are and stamps are tried, and that is taken in which it repeats best.
    mean = float(t[-1] - t[0]) / (len(t) - 1)
    even, said = count_samples(t)
    # By counting the samples, and by their stamps where these are uneven.
    clocks = [(even, f"{said}, treated as even"), (t, f"{said}{INTERPOLATED}")] if said else [(even, "")]
    best: Periods | None = None
    for clock, grid in clocks:
        rows = find_period(np.interp(even, clock, excitation))
        if rows is None:
            continue
        whole = round(rows)
        # The samples as they are, and between them for a period with a fraction.
        between = (mean * rows / whole, f"{rows:.4f} rows per period, resampled to {whole}")
        for step, text in ((mean, ""), between):
            periods = int((len(clock) - 1 + 1e-6) * mean / step + 1) // whole
            if periods < 2:
                continue
            times = clock[0] + step * np.arange(periods * whole).reshape(periods, whole)
            told = ", ".join(part for part in (grid, text) if part)
            found = _cut(clock, times, [excitation, *others], told)
            if best is None or found.mismatch * _BETTER < best.mismatch:
                best = found
    return best


def count_samples(t: Values) -> tuple[Values, str]:
    """Times of samples by counting them, and by how much their stamps differ from that; empty where they do not."""
    steps = np.diff(t)
    mean = float(t[-1] - t[0]) / len(steps)
    said = f"stamps {1e3 * steps.min():.4g} to {1e3 * steps.max():.4g} ms apart"
    return t[0] + mean * np.arange(len(t)), "" if float(np.std(steps)) <= _EVEN * mean else said


def _cut(clock: Values, times: Values, signals: Sequence[Values], said: str) -> Periods:
    """Signals at some times, by straight lines between samples."""
    cut = tuple(np.interp(times, clock, values) for values in signals)
    excitation = cut[0]
    size = float(np.std(excitation)) or 1.0
    return Periods(cut, float(times[0, 1] - times[0, 0]), float(np.std(np.diff(excitation, axis=0))) / size, said)


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """Response of an axis at some frequencies."""

    frequency: Values  # rising [Hz], shape (n,)
    response: Complex  # output over input, shape (n,)
    coherence: Values  # part of the power of the output that the input explains, 0..1, shape (n,)
    # standard deviation of the response: of its magnitude, as a part of it, and of its phase [rad]; shape (n,)
    deviation: Values
    averages: float  # periods, or independent windows, that were averaged
    resolution: float  # width over which the response is an average [Hz]; 0 for a periodic excitation
    method: str  # how it was found, with its figures
    input_unit: str = ""  # and output_unit: units of the two, empty for a pure number
    output_unit: str = ""

    def __len__(self) -> int:
        return len(self.frequency)


def response_deviation(coherence: Values, averages: float) -> Values:
    """Standard deviation of a response by its coherence: of the magnitude, as a part of it, and of the phase [rad].

    ``sqrt((1 - g2) / (2 n g2))``: J. S. Bendat, A. G. Piersol, "Random Data", 4th ed., Wiley 2010, section 9.2.4.

    >>> response_deviation(np.array([0.9]), 10).round(4)
    array([0.0745])
    """
    safe = np.clip(coherence, 1e-12, 1.0)
    return np.sqrt((1.0 - safe) / (2.0 * averages * safe))


def average_periods(periods: Periods) -> FrequencyResponse:
    """Response by the mean over periods but the first, in which the axis settles; noise by the scatter between them.

    ``G = mean(Y) / mean(U)`` and ``var(G) = mean |Y_p - G U_p|^2 / ((P - 1) |mean(U)|^2)`` per line, p = 1..P, without
    a drift from period to period; the variance of the noise is that of neighbouring lines together (`noise_parts`).
    """
    kept = len(periods.signals[0]) - 1
    # Spectra of the periods at the excited lines, shape (periods, lines).
    spectra = [np.fft.rfft(_without_drift(values[1:]))[:, 1:] for values in periods.signals[:2]]
    chosen = _excited_lines(spectra[0], periods.signals[0].shape[1])
    excitation, answer = (values[:, chosen] for values in spectra)
    mean = excitation.mean(axis=0)
    response = answer.mean(axis=0) / mean
    noise = np.sum(np.abs(answer - response * excitation) ** 2, axis=0) / (kept - 1)
    power = np.abs(response * mean) ** 2
    level, slope = noise_parts(noise, power, max(_FEWEST_LINES, -(-_FREEDOM // (kept - 1))))
    coherence = 1.0 / (1.0 + level / power + slope)
    said = f"mean of {kept} periods of {periods.duration:.6g} s behind 1 to settle, {len(response)} excited lines"
    frequency, deviation = np.asarray((chosen + 1.0) / periods.duration, float), response_deviation(coherence, kept)
    said = f"{said}; {periods.grid}" if periods.grid else said
    return FrequencyResponse(frequency, response, coherence, deviation, kept, 0.0, said)


def _excited_lines(excitation: Complex, size: int) -> NDArray[np.intp]:
    """Lines that are excited, from the spectra of periods of so many samples, shape (periods, lines)."""
    strength = np.abs(excitation.mean(axis=0))
    # Of two periods a line may be alike by chance: the scatter of its neighbours tells.
    scatter = np.sqrt(_smooth(np.var(excitation, axis=0, ddof=1) / len(excitation), _FEWEST_LINES))
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
            "identify: got an excitation that does not repeat; expected: a periodic multisine or chirp; record one"
        )
    return chosen


def _without_drift(values: Values) -> Values:
    """Periods without their mean, and without the slope that leads from one mean to the next."""
    means = values.mean(axis=1)
    slope = np.asarray(np.gradient(means), dtype=np.float64)[:, None]
    along: Values = (np.arange(values.shape[1], dtype=np.float64) + 0.5) / values.shape[1] - 0.5
    return values - means[:, None] - slope * along


def noise_parts(noise: Values, power: Values, reach: int) -> tuple[Values, Values]:
    """Noise by ``a + b |Y|^2``, a and b not negative, fitted to each line and its neighbours."""
    # Noise of the sensor is alike in neighbouring lines; a disturbance is answered as the excitation is, and about a
    # resonance as narrow as that: a mean over lines would blur it.
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


def measure_response(t: Values, excitation: Values, answer: Values) -> FrequencyResponse:
    """Measure a response in the longest part without a gap, by periods of the excitation or else by windows."""
    if not len(t) == len(excitation) == len(answer) or len(t) < FEWEST_ROWS:
        raise DetentError(
            f"identify: got {len(t)} times, {len(excitation)} values of the input, {len(answer)} of the output; "
            f"expected: as many of each, {FEWEST_ROWS} or more; record longer"
        )
    part = max(stretches(t), key=lambda part: part.stop - part.start)
    if part.stop - part.start < FEWEST_ROWS:
        raise DetentError(
            f"identify: got {part.stop - part.start} samples between two gaps; expected: {FEWEST_ROWS} or more; record "
            "without missing rows"
        )
    t, excitation, answer = t[part], excitation[part], answer[part]
    if not np.ptp(answer) > 0.0:
        raise DetentError("identify: got a position that does not change; expected: motion; record one")
    periods = cut_periods(t, excitation, [answer])
    is_periodic = periods is not None and len(periods.signals[0]) >= FEWEST
    return average_periods(periods) if periods and is_periodic else average_windows(t, excitation, answer)


def response_of(log: Log, effort: str = "", position: str = "position") -> FrequencyResponse:
    """Measure the response of the position to the effort in a log."""
    chosen = log.effort(effort)
    log.need(position)
    found = measure_response(log.t, log.signals[chosen], log.signals[position])
    return replace(found, input_unit=log.units.get(chosen, ""), output_unit=log.units.get(position, ""))


def average_windows(t: Values, excitation: Values, answer: Values, step_hz: float | None = None) -> FrequencyResponse:
    """Response by Welch's method: Hann windows that overlap by half, ``H1 = S_uy / S_uu``."""
    mean = float(t[-1] - t[0]) / (len(t) - 1)
    even, uneven = count_samples(t)
    if uneven:
        excitation, answer = np.interp(even, t, excitation), np.interp(even, t, answer)
    rows = len(excitation) // WINDOWS if step_hz is None else round(1.0 / (step_hz * mean))
    if not FEWEST_ROWS // WINDOWS <= rows <= len(excitation) // 2 or not np.ptp(excitation) > 0:
        raise DetentError(
            f"identify: got {len(excitation)} samples for windows of {rows}, with an excitation over "
            f"{np.ptp(excitation):g}; expected: two windows or more of {FEWEST_ROWS // WINDOWS} samples or more, and "
            "an excitation that changes; record longer, with a chirp or a multisine"
        )
    how = {"fs": 1.0 / mean, "window": "hann", "nperseg": rows, "noverlap": int(OVERLAP * rows), "detrend": "linear"}
    frequency, power = scipy("signal").welch(excitation, **how)
    power_out = scipy("signal").welch(answer, **how)[1]
    cross = scipy("signal").csd(excitation, answer, **how)[1]
    chosen = (power > WEAKEST_BAND * power.max()) & (frequency > 0) & (frequency < 0.5 / mean)
    coherence = np.abs(cross[chosen]) ** 2 / np.maximum(power[chosen] * power_out[chosen], 1e-300)
    # Neighbours that overlap by half share a sixth of their values' products (P. D. Welch, IEEE Transactions on Audio
    # and Electroacoustics 15 (1967) 70).
    count = (len(excitation) - rows) // (rows - int(OVERLAP * rows)) + 1
    averages = count / (1.0 + 2.0 * (count - 1) / count / 36.0)
    said = f"H1 by Welch: Hann windows of {rows * mean:.4g} s, overlap {OVERLAP:.0%}, {averages:.1f} independent ones"
    said = f"{said}; {uneven}{INTERPOLATED}" if uneven else said
    frequency, response = np.asarray(frequency[chosen], dtype=np.float64), np.asarray(cross[chosen] / power[chosen])
    deviation, width = response_deviation(coherence, averages), 1.5 / (rows * mean)
    return FrequencyResponse(frequency, response, np.minimum(coherence, 1.0), deviation, averages, width, said)


def told_response(log: Log, effort: str, *, is_open: bool) -> FrequencyResponse | None:
    """Response of a log, where it tells one: periods, or an open loop, and enough coherent lines."""
    # Windows over a closed loop show the controller where noise drives the effort.
    try:
        response = response_of(log, effort)
    except DetentError:
        return None
    told = response.coherence >= COHERENT
    f, size = response.frequency[told], np.abs(response.response[told])
    is_open = response.resolution == 0.0 or is_open
    if not is_open or len(f) < FEWEST_COHERENT or f[-1] < BROADEST * f[0]:
        return None
    # Lines hardly excited beside strong ones hold what friction makes of these, which coherence does not show: there
    # neighbours do not agree.
    apart = np.abs(np.diff(np.log(size * f**2)))
    return response if float(np.mean(apart < math.log(2.0))) > AGREEING else None
