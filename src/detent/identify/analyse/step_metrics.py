"""Step response: what the answer of an axis to steps of its reference says.

A step is a change of the reference between two rests, sudden or along a profile; times count from where the reference
leaves its rest. Words as usual in control (K. Ogata, Modern Control Engineering, 5th ed. 2010, 5-3): rise from 10 to
90 % of the way between the rests of the position, settling for good within 2 or 5 % of the size of the step about the
rest of the position. Overshoot counts from the reference, since the axis may rest elsewhere; how far off is the rest
error, reference less position. A rest is a mean, peak and crossings are polynomials fitted about them; their noise is
that of the position at rest, with its colour, and that of rounding to counts of the encoder.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from detent.errors import DetentError
from detent.identify.analyse.ringing import Ringing, fit_ringing
from detent.identify.analyse.two_speeds import mean_error
from detent.identify.fit.estimate import Estimate, estimate, known_noise_covariance
from detent.logs.differences import fill_holes, resolution, runs_of
from detent.logs.log import Log, Values

STILL = 1e-4  # change of the reference from sample to sample, as a part of its range, up to which it rests
CREEP = 0.01  # the same as a part of the largest such change
PAUSE = 10  # samples of a rest of the reference, at least; a shorter one is part of the step
SMALL = 0.05  # steps smaller than this part of the largest are skipped
LAST = 0.25  # part of a rest of the reference, its last, in which the position is taken to rest
FEWEST = 20  # samples of the answer to a step, at least
CREST = 0.2  # part of the overshoot, its highest, that the polynomial of the peak is fitted to
ABOUT = 0.08  # part of the way, to both sides of a crossing, that its polynomial is fitted to
DITHER = 2.5  # standard deviation of the position, in those of rounding, from which rounding averages out
CLEAR = 6.0  # standard deviations of the noise by which a peak or a swing stands out of it
DEGREES = ((16, 4), (9, 3), (6, 2))  # samples, at least, and the degree of the polynomial fitted to as many


@dataclass(frozen=True, slots=True, eq=False)
class LocalPolynomial:
    """A polynomial in time from its place."""

    width: float  # half the time that it was fitted over [s]; coefficients are for ``time / width``
    coefficients: Values  # by rising powers
    covariance: Values  # of the coefficients
    degrees: int  # degrees of freedom behind it
    low: float  # and high: first and last time that it was fitted over, from its place [s]
    high: float  # [s]

    def at(self, time: float, order: int = 0) -> float:
        """Value or derivative at a time from its place."""
        return float(self._powers(time, order) @ self.coefficients)

    def error_at(self, time: float, order: int = 0) -> float:
        """Standard error of `at`."""
        powers = self._powers(time, order)
        return float(np.sqrt(powers @ self.covariance @ powers))

    def summit(self) -> float:
        """Time of the largest value in the range that it was fitted over."""
        curve = np.polynomial.Polynomial(self.coefficients)
        return max([self.low, self.high, *self._inside(curve.deriv())], key=self.at)

    def solve(self, level: float) -> float:
        """Time nearest to its place at which it has a value; that of the nearest value where it does not reach it."""
        times = self._inside(np.polynomial.Polynomial(self.coefficients) - level)
        ends = (self.low, 0.0, self.high)
        return min(times, key=abs) if times else min(ends, key=lambda time: abs(self.at(time) - level))

    def _inside(self, curve: np.polynomial.Polynomial) -> list[float]:
        """Roots of a polynomial within the range."""
        roots: list[complex] = np.asarray(curve.roots(), np.complex128).tolist()
        times = [self.width * root.real for root in roots if abs(root.imag) < 1e-9]
        return [time for time in times if self.low <= time <= self.high]

    def _powers(self, time: float, order: int) -> Values:
        count = len(self.coefficients)
        columns = [np.polynomial.Polynomial.basis(k).deriv(order)(time / self.width) for k in range(count)]
        return np.array(columns, dtype=np.float64) / self.width**order


def fit_local_polynomial(
    t: Values, y: Values, place: float, noise: Values, floor: float = 0.0
) -> LocalPolynomial | None:
    """Fit a polynomial about a place; None with fewer samples than the lowest degree wants."""
    degree = next((degree for least, degree in DEGREES if len(t) >= least), 0)
    if not degree:
        return None
    width = 0.5 * float(t[-1] - t[0])
    columns = np.vander((t - place) / width, degree + 1, increasing=True)
    coefficients = np.asarray(np.linalg.lstsq(columns, y, rcond=None)[0], float)
    covariance, degrees = known_noise_covariance(columns, y - columns @ coefficients, noise, floor=floor)
    return LocalPolynomial(width, coefficients, covariance, degrees, float(t[0]) - place, float(t[-1]) - place)


@dataclass(frozen=True, slots=True)
class StepMetrics:
    """The answer to one step."""

    begin: float  # and duration: where the reference leaves its rest, and for how long it moves [s]
    duration: float  # [s]
    start: float  # and target: reference before and after
    target: float
    # from 10 to 90 % of the way between the rests [s]; None where these levels are not crossed
    rise_time: Estimate | None
    overshoot: Estimate | None  # farthest position beyond the target; None where none stands out of noise
    peak_time: Estimate | None  # of the farthest position, from `begin` [s]
    settling_2: float  # from `begin` until the position stays within 2 % of the step about its rest [s]; inf for never
    settling_5: float  # the same for 5 % [s]
    rest_error: Estimate  # reference less position at rest
    ringing: Ringing | None  # None where there are not enough swings
    notes: tuple[str, ...] = ()  # what to know about it

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """All numbers with an interval."""
        ringing = (self.ringing.period, self.ringing.damping_ratio) if self.ringing else ()
        found = (self.rise_time, self.overshoot, self.peak_time, self.rest_error, *ringing)
        return tuple(one for one in found if one is not None)


@dataclass(frozen=True, slots=True)
class StepResponse:
    """Answers to the steps of a recording."""

    unit: str  # unit of positions
    steps: tuple[StepMetrics, ...] = ()  # in order of time
    reason: str = ""  # why there is none; empty where there is one
    notes: tuple[str, ...] = ()  # what was skipped


def measure_steps(log: Log) -> StepResponse:
    """Metrics of each step of the reference of a recording."""
    log.need("reference", "position")
    unit = log.units["position"]
    if unit != log.units["reference"]:
        raise DetentError(
            f"{log.name}: got a position in {unit} and a reference in {log.units['reference']}; expected: one unit; "
            "state both, as in reference=COLUMN [0.5 um]"
        )
    moves = find_steps(log.signals["reference"])
    if not moves:
        return StepResponse(unit, reason="the reference has no step between two rests; record a step and its response")
    least = SMALL * max(abs(move.target - move.start) for move in moves)
    large = [move for move in moves if abs(move.target - move.start) >= least]
    long = [move for move in large if move.stop - move.first >= FEWEST]
    passed = {
        f"steps below {SMALL:.0%} of the largest": len(moves) - len(large),
        f"steps with a response of fewer than {FEWEST} samples": len(large) - len(long),
    }
    notes = tuple(f"{number} {which} skipped" for which, number in passed.items() if number)
    reason = "" if long else "no step is followed by rest; record longer after the step"
    return StepResponse(unit, tuple(_measure(log, move, unit) for move in long), reason, notes)


class Move(NamedTuple):
    """A step of the reference: samples where the rest before begins, it begins, it arrives, the next begins; values."""

    before: int
    first: int
    arrived: int
    stop: int
    start: float
    target: float


def find_steps(reference: Values) -> list[Move]:
    """Changes of a reference between rests."""
    if not np.ptp(reference) > 0:
        return []
    ways = np.abs(np.diff(reference))
    # A profile sampled quickly moves by little from sample to sample all the way.
    changes = ways > min(STILL * float(np.ptp(reference)), CREEP * float(ways.max()))
    runs = runs_of(fill_holes(changes, PAUSE - 1)).tolist()
    before = [0, *(stop for _, stop in runs)]
    after = [*(first for first, _ in runs[1:]), len(reference)]
    return [
        Move(begin, first, stop, end, float(reference[first]), float(reference[stop]))
        for begin, (first, stop), end in zip(before, runs, after, strict=False)
        if reference[first] != reference[stop] and end - stop >= PAUSE
    ]


class _Level(NamedTuple):
    """A position at rest, or the time at which one is first crossed: standard error, degrees of freedom, slope."""

    value: float
    error: float
    degrees: float
    slope: float = 0.0


class _Noise(NamedTuple):
    """Noise of the position at rest."""

    series: Values
    rounding: float  # to counts, standard deviation

    @property
    def size(self) -> float:
        """Standard deviation of both."""
        return float(np.hypot(self.series.std(), self.rounding))


def _measure(log: Log, move: Move, unit: str) -> StepMetrics:
    """Metrics of one step."""
    t, x = log.t, log.signals["position"]
    still = x[move.stop - max(PAUSE // 2, round(LAST * (move.stop - move.arrived))) : move.stop]
    noise = _Noise(still - still.mean(), resolution(x) / float(np.sqrt(12.0)))
    rest = _rest(still, noise)
    home = _rest(x[move.first + 1 - max(1, round(LAST * (move.first + 1 - move.before))) : move.first + 1], noise)
    after = slice(move.first, move.stop)
    since, y = t[after] - t[move.first], x[after]
    size = move.target - move.start
    least = max(CLEAR * noise.size, 0.01 * abs(size))
    overshoot, peak_time, peak = _peak(since, (y - move.target) * np.sign(size), noise, unit)
    ringing = fit_ringing(since[peak:], y[peak:], least, *noise) if overshoot else None
    settling_2, settling_5 = (_settling(since, y - rest.value, share * abs(size)) for share in (0.02, 0.05))
    rise, off = _rise(since, y, (home, rest), noise), move.target - rest.value
    rest_error = estimate("rest_error", off, unit, rest.error, "mean of the last quarter", rest.degrees)
    note = "not settled within 2 % when the record of the step ends: final value and error at rest are means"
    notes = (note,) if np.isinf(settling_2) else ()
    begin, duration = float(t[move.first]), float(t[move.arrived] - t[move.first])
    found = (rise, overshoot, peak_time, settling_2, settling_5, rest_error, ringing, notes)
    return StepMetrics(begin, duration, move.start, move.target, *found)


def _rest(x: Values, noise: _Noise) -> _Level:
    """Mean position of a stretch; a few samples are as uncertain as the noise."""
    if len(x) < 2 * PAUSE:
        return _Level(float(x.mean()), max(float(x.std()), noise.size), np.inf)
    error, degrees = mean_error(x)
    # A mean sees between the counts only where noise carries the position across them.
    rounding = noise.rounding if float(x.std()) < DITHER * noise.rounding else 0.0
    return _Level(float(x.mean()), float(np.hypot(error, rounding)), degrees)


def _settling(t: Values, off: Values, band: float) -> float:
    """Time from which a deviation stays within a band; infinite where it is still outside in the last quarter."""
    outside = np.flatnonzero(np.abs(off) > band)
    last = int(outside[-1]) + 1 if len(outside) else 0
    return float(t[last]) if last < len(t) - max(1, round(LAST * len(t))) else np.inf


def _peak(t: Values, beyond: Values, noise: _Noise, unit: str) -> tuple[Estimate | None, Estimate | None, int]:
    """Overshoot, its time and its sample, by a polynomial about the farthest position."""
    top = int(np.argmax(beyond))
    if beyond[top] < CLEAR * noise.size or top in {0, len(t) - 1}:
        return None, None, top
    near = _around(beyond > beyond[top] - max(CREST * beyond[top], CLEAR * noise.size), top)
    fit = fit_local_polynomial(t[near], beyond[near], float(t[top]), *noise)
    if fit is None:
        return *_coarse_peak(t, beyond, top, noise.size, unit), top
    method = "polynomial about the peak"
    place = fit.summit()
    late = fit.error_at(place, 1) / max(abs(fit.at(place, 2)), 1e-300)
    overshoot = estimate("overshoot", fit.at(place), unit, fit.error_at(place), method, fit.degrees)
    return overshoot, estimate("peak_time", place + float(t[top]), "s", late, method, fit.degrees), top


def _coarse_peak(t: Values, beyond: Values, top: int, least: float, unit: str) -> tuple[Estimate, Estimate]:
    """Overshoot and its time by a parabola through three samples, as uncertain as it lies off the farthest of them."""
    before, at, behind = (float(one) for one in t[top - 1 : top + 2] - t[top])
    left = (float(beyond[top - 1]) - float(beyond[top])) / (before - at)
    right = (float(beyond[top + 1]) - float(beyond[top])) / (behind - at)
    bend = (right - left) / (behind - before)
    slope = left - bend * before
    place = -0.5 * slope / bend if bend < 0 else 0.0
    gain = 0.5 * slope * place
    method = "parabola through three samples"
    overshoot = estimate("overshoot", float(beyond[top]) + gain, unit, float(np.hypot(gain, least)), method)
    return overshoot, estimate("peak_time", float(t[top]) + place, "s", 0.125 * (behind - before), method)


def _rise(t: Values, y: Values, rests: tuple[_Level, _Level], noise: _Noise) -> Estimate | None:
    """Time from 10 to 90 % of the way between two rests."""
    home, rest = rests
    way = rest.value - home.value
    if way == 0.0:
        return None
    share = (y - home.value) / way
    scaled = _Noise(noise.series / way, noise.rounding / abs(way))
    low, high = (_crossing(t, share, level, scaled) for level in (0.1, 0.9))
    if low is None or high is None:
        return None
    # Both crossings move with both rests.
    by_home = (0.1 / high.slope - 0.9 / low.slope) * home.error / way
    by_rest = (0.9 / high.slope - 0.1 / low.slope) * rest.error / way
    error = float(np.linalg.norm([low.error, high.error, by_home, by_rest]))
    return estimate(
        "rise_time", high.value - low.value, "s", error, "10 to 90 % of the distance between rests", low.degrees
    )


def _crossing(t: Values, share: Values, level: float, noise: _Noise) -> _Level | None:
    """Where a level is first crossed, by a polynomial fitted to the samples about it."""
    above = np.flatnonzero(share >= level)
    if not len(above) or above[0] == 0:
        return None
    k = int(above[0])
    near = _around(np.abs(share - level) < ABOUT, k if abs(share[k] - level) < ABOUT else k - 1)
    fit = fit_local_polynomial(t[near], share[near], float(t[k]), *noise)
    if fit is None:
        return _between(t, share, level, k, noise.size)
    place = fit.solve(level)
    slope = fit.at(place, 1)
    return _Level(place + float(t[k]), fit.error_at(place) / abs(slope), fit.degrees, slope)


def _between(t: Values, share: Values, level: float, k: int, noise: float) -> _Level:
    """Crossing between two samples by a line and the bend of the four about it, whose change is part of the error."""
    step = float(t[k] - t[k - 1])
    slope = float(share[k] - share[k - 1]) / step
    part = (level - float(share[k - 1])) / float(share[k] - share[k - 1])
    bends = np.diff(share[max(k - 2, 0) : k + 2], 2)
    sag, doubt = (float(bends.mean()), float(np.ptp(bends))) if len(bends) > 1 else (0.0, abs(slope) * step)
    below = 0.5 * part * (1.0 - part)
    # Both samples together are less noisy than one, by as much as the bend adds.
    error = float(np.hypot(noise, below * doubt)) / slope
    return _Level(float(t[k - 1]) + part * step + below * sag / slope, error, np.inf, slope)


def _around(mask: NDArray[np.bool_], place: int) -> slice:
    """Run of True about a place; the place alone where it is False."""
    runs = (slice(first, stop) for first, stop in runs_of(mask).tolist() if first <= place < stop)
    return next(runs, slice(place, place + 1))
