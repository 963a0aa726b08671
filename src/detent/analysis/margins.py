"""Margins of loops that are cut open, of one axis or of many at once.

A margin holds for everything: Ms, the largest sensitivity, is the inverse of the least distance of L from -1, which
needs no crossing to be seen (Astrom, Hagglund 2006, Advanced PID Control, section 4.6). It guarantees a gain margin of
Ms/(Ms - 1) and a phase margin of 2 asin(1/(2 Ms)).

A grid of frequencies starts every crossing and every peak, root finding ends it. All of it is elementwise: what is
found of an axis does not depend on how many stand beside it.
"""

import math
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]
Phasors = NDArray[np.complex128]
Places = NDArray[np.int64]
Respond = Callable[[Numbers, Places], Phasors]
"""Loops of some axes, by their places, shape (n,), at frequencies [Hz], shape (k,) or (n, k): shape (cuts, n, k)."""

DECADES = 6.0  # of frequency, below half the sample rate
COARSE, FINE = 40, 125  # frequencies in each of the lower and of the upper half of them
AROUND = 60  # more of them inside each resonance, the closer the nearer, and as far as BESIDE of its frequency
BESIDE = 0.1
BLOCK = 500  # axes that are looked at together
UNSURE = 0.4  # of a square of a distance on the grid, in the guess how small it becomes between its neighbours
TURNS = 40  # steps to a crossing or a peak, at most
EXACT = 1e-9  # of the frequency of a crossing
NEAR = 1e-8  # of the frequency of a peak; its height is known to far more
ON_AXIS = 1e-3  # of its size, how far a loop is from the real axis that is taken for being on it
GOLDEN = 0.381966


class Margins(NamedTuple):
    """What a loop that is cut open leaves; where it never crosses a gain of 1 there is nothing to lose."""

    crossover: float  # frequency at which the gain first falls below 1 [Hz]; 0 where it never does
    phase: float  # smallest phase margin over all crossings [rad]; pi where there is none
    gain: float  # smallest factor above 1 of the gain at which L passes -1; infinite where there is none
    delay: float  # dead time that may be added until it no longer settles [s]; infinite where there is none
    sensitivity: float  # Ms, largest magnitude of 1/(1 + L)
    peak: float  # frequency of it [Hz]
    least: float = 0.0  # largest factor below 1 of the gain at which L passes -1; 0 where there is none


def usual_frequencies(dt: float) -> Numbers:
    """Frequencies of an open loop that is sampled every `dt` [s], up to half the sample rate [Hz], which is not one."""
    half, decades = math.log10(0.5 / dt), 0.5 * DECADES
    low = np.logspace(half - 2 * decades, half - decades, round(COARSE * decades), endpoint=False)
    return np.concatenate([low, np.logspace(half - decades, half, round(FINE * decades), endpoint=False)])


def around(rates: Phasors, dt: float) -> Numbers:
    """Frequencies in resonances, from modes [1/s], shape (..., m): shape (..., k), at the edge where it is none."""
    rates, highest = rates[..., None] / math.tau, 0.5 / dt
    width = np.maximum(-rates.real, 1e-6 * np.abs(rates.imag))
    with np.errstate(all="ignore"):  # of what is no resonance
        reach = np.arcsinh(np.maximum(4.0, BESIDE * rates.imag / width))
        found = np.where(
            rates.imag > 0.0, rates.imag + width * np.sinh(np.linspace(-1.0, 1.0, AROUND) * reach), highest
        )
    return np.clip(found, highest * 10**-DECADES, highest * (1.0 - 1e-9)).reshape(*rates.shape[:-2], -1)


def margins_of(respond: Respond, near: Numbers, dt: float) -> list[Margins]:
    """Margins of the loops of some axes at each cut: those of a cut are arrays of shape (n,).

    `near` are frequencies [Hz] of each axis beside the usual ones, shape (n, k), below half the sample rate.
    """
    firsts = range(0, len(near), BLOCK)
    blocks = [_Block(respond, near, dt, np.arange(k, min(k + BLOCK, len(near)))).margins for k in firsts]
    each = [np.concatenate(parts, axis=1) for parts in zip(*blocks, strict=True)]  # shape (cuts, n)
    return [Margins(*columns) for columns in zip(*each, strict=True)]


def one_of(many: Margins) -> Margins:
    """The margins of the first axis, as numbers."""
    return Margins(*(float(np.asarray(each)[0]) for each in many))


Loops = tuple[Places, Places]  # some loops of a block: of which cut, and of which axis, both of shape (m,)


class _Block:
    """Some axes on their grids."""

    def __init__(self, respond: Respond, near: Numbers, dt: float, places: Places) -> None:
        self.respond, self.places = respond, places
        self.tops: Any = ()  # of `_peaks`
        usual = np.append(usual_frequencies(dt), 0.5 / dt)  # an alternating mode is lost at the end
        wide, near = np.broadcast_to(usual, (len(places), len(usual))), near[places]
        self.frequencies, self.loops = np.concatenate([wide, near], axis=1), respond(usual, places)
        if near.size:
            order = np.argsort(self.frequencies, axis=1, kind="stable")
            self.frequencies = np.take_along_axis(self.frequencies, order, axis=1)
            loops = np.concatenate([self.loops, respond(near, places)], axis=2)
            self.loops = np.take_along_axis(loops, order[None], axis=2)

    @property
    def margins(self) -> tuple[Numbers, ...]:
        """Of each cut of each axis, as `Margins` has them: arrays of shape (cuts, n)."""
        sensitivity, peak = self._peaks()
        shape = peak.shape
        where, at, falls = self._changes(_level)
        cut, row = where
        frequencies, phases = np.exp(at), np.angle(-self._at(where, at))
        crossover, delay = np.full(shape, np.inf), np.full(shape, np.inf)
        np.minimum.at(crossover, (cut[falls], row[falls]), frequencies[falls])
        np.minimum.at(delay, where, (phases % math.tau) / (math.tau * frequencies))
        phase, order = np.full(shape, np.pi), np.argsort(-np.abs(phases), kind="stable")  # of several the last stays
        phase[cut[order], row[order]] = phases[order]
        crosses = np.isfinite(crossover)
        gain, least = self._factors()
        crossover, phase = np.where(crosses, crossover, 0.0), np.where(crosses, phase, np.pi)
        return crossover, phase, gain, delay, sensitivity, peak, least

    def _peaks(self) -> tuple[Numbers, Numbers]:
        """Ms and where it is [Hz]; the loops there are kept."""
        squares = _distance(self.loops)
        cut, row, k = lows(squares)
        points = cut, row
        at, least = lowest(
            lambda x, which: _distance(self._at(points, x, which)), *cells(self.frequencies[row], squares[cut, row], k)
        )  # fmt: skip
        order = np.argsort(-least, kind="stable")  # of several the lowest stays
        found, peak = np.full(squares.shape[:2], np.nan), np.full(squares.shape[:2], np.nan)
        found[cut[order], row[order]], peak[cut[order], row[order]] = least[order], np.exp(at[order])
        self.tops = row, at, self.respond(np.exp(at)[:, None], self.places[row])[..., 0]
        return 1.0 / np.sqrt(np.maximum(found, 1e-300)), peak

    def _factors(self) -> tuple[Numbers, Numbers]:
        """Smallest factor above 1 and largest below 1 of the gain at which a loop passes -1."""
        where, at, _ = self._changes(lambda loops: loops.imag)
        loops, last = self._at(where, at), self.loops[:, :, -1].real
        # At a pole on the circle the sign changes, too, far from the real axis.
        passes = np.flatnonzero((loops.real < 0.0) & (np.abs(loops.imag) < ON_AXIS * np.abs(loops.real)))
        cuts, rows = (each.ravel() for each in np.indices(last.shape))
        cut, row = np.append(where[0][passes], cuts), np.append(where[1][passes], rows)
        factors = -1.0 / np.minimum(np.append(loops.real[passes], last.ravel()), -1e-300)
        gain, least = np.full(last.shape, np.inf), np.zeros(last.shape)
        more, less = np.flatnonzero((factors > 1.0) & (factors < 1e299)), np.flatnonzero(factors < 1.0)
        np.minimum.at(gain, (cut[more], row[more]), factors[more])
        np.maximum.at(least, (cut[less], row[less]), factors[less])
        return gain, least

    def _changes(self, part: Callable[[Phasors], Numbers]) -> tuple[Loops, Numbers, NDArray[np.bool_]]:
        """Where a part of the loops changes its sign, and whether it falls there."""
        values = part(self.loops)
        signs = np.signbit(values)
        cut, row, k = _nonzero(signs[..., 1:] != signs[..., :-1])
        low, high = np.log(self.frequencies[row, k]), np.log(self.frequencies[row, k + 1])
        found = [(cut, row, low, high, values[cut, row, k], values[cut, row, k + 1]), *self._twice(part, values)]
        cut, row, low, high, first, last = map(np.concatenate, zip(*found, strict=True))
        points = cut, row
        at = root(lambda x, which: part(self._at(points, x, which)), low, high, first, last)
        return points, at, first >= 0.0

    def _twice(self, part: Callable[[Phasors], Numbers], values: Numbers) -> Iterator[tuple[Any, ...]]:
        """Changes between two points of the grid that nothing tells but what is where a loop is closest to -1."""
        row, at, loops = self.tops
        k = np.sum(self.frequencies[row] <= np.exp(at)[:, None], axis=1) - 1
        k = np.clip(k, 0, values.shape[-1] - 2)
        first, here, last = values[:, row, k], part(loops), values[:, row, k + 1]
        signs = [np.signbit(each) for each in (first, here, last)]
        cut, top = np.nonzero((signs[0] != signs[1]) & (signs[1] != signs[2]))
        row, at, k = row[top], at[top], k[top]
        low, high = np.log(self.frequencies[row, k]), np.log(self.frequencies[row, k + 1])
        yield cut, row, low, at, first[cut, top], here[cut, top]
        yield cut, row, at, high, here[cut, top], last[cut, top]

    def _at(self, points: Loops, where: Numbers, which: Any = slice(None)) -> Phasors:
        """Loops of some of the points at other frequencies, given by their logarithms."""
        found = self.respond(np.exp(where)[:, None], self.places[points[1][which]])
        return found[points[0][which], np.arange(len(where)), 0]


def _square(loop: Phasors) -> Numbers:
    return loop.real * loop.real + loop.imag * loop.imag


def _distance(loop: Phasors) -> Numbers:
    """Square of that from -1."""
    real = loop.real + 1.0
    return real * real + loop.imag * loop.imag


def _level(loop: Phasors) -> Numbers:
    """Above 0 where the gain is above 1; near there about twice its logarithm."""
    square = _square(loop)
    return (square - 1.0) / (square + 1.0)


# ---- of functions that are given by their places


Value = Callable[[Numbers, Places], Numbers]
"""Values of some functions, by their places, at x; both of shape (m,)."""


def lows(values: Numbers) -> tuple[Places, ...]:
    """Places of what is low on grids, shape (..., k), in their order: the least of each, and what may be below it."""
    inside = values[..., 1:-1]
    is_low = np.empty(values.shape, np.bool_)
    is_low[..., 1:-1] = (inside <= values[..., :-2]) & (inside < values[..., 2:])
    is_low[..., 0], is_low[..., -1] = values[..., 0] < values[..., 1], values[..., -1] <= values[..., -2]
    *rows, k = _nonzero(is_low)
    here, before, after = (values[(*rows, np.clip(k + step, 0, values.shape[-1] - 1))] for step in (0, -1, 1))
    with np.errstate(all="ignore"):  # the vertex of a parabola, as if they were alike far apart
        vertex = here - (after - before) ** 2 / (8.0 * (before - 2.0 * here + after))
    about = np.where(np.isfinite(vertex), vertex, here) - UNSURE * here
    least = np.min(values, axis=-1)
    may = np.flatnonzero(about <= least[tuple(rows)])
    return tuple(one[may] for one in (*rows, k))


def _nonzero(found: NDArray[np.bool_]) -> tuple[Places, ...]:
    """Places of what is true, in their order."""
    return np.unravel_index(np.flatnonzero(found), found.shape)


Three = tuple[Numbers, Numbers, Numbers]


def cells(frequencies: Numbers, values: Numbers, k: Places) -> tuple[Three, Three]:
    """Logarithms of the frequencies, and values, at a place of each grid and on both sides of it."""
    each, last = np.arange(len(k)), values.shape[1] - 1
    ends = [np.clip(k + step, 0, last) for step in (-1, 0, 1)]
    at, found = ([one[each, end] for end in ends] for one in (frequencies, values))
    return tuple(map(np.log, at)), tuple(found)  # pyright: ignore[reportReturnType] - three of each


def lowest(value: Value, at: Three, values: Three) -> tuple[Numbers, Numbers]:
    """Where functions are lowest, and how low, between three places: by parabolas, as far as they do."""
    (a, x, c), (f_a, f, f_c) = (tuple(map(np.copy, three)) for three in (at, values))
    going = np.flatnonzero(c > a)
    for _ in range(TURNS):
        if not len(going):
            break
        low, here, high = a[going], x[going], c[going]
        with np.errstate(all="ignore"):
            left, right = (here - low) * (f[going] - f_c[going]), (here - high) * (f[going] - f_a[going])
            there = here - 0.5 * ((here - low) * left - (here - high) * right) / (left - right)
        wide = np.where(here - low > high - here, low - here, high - here)
        there = np.where((there > low) & (there < high), there, here + GOLDEN * wide)
        there = np.where(np.abs(there - here) < NEAR, here + NEAR * np.sign(wide), there)  # so that it closes in
        new = value(there, going)
        _narrow((a, x, c), (f_a, f, f_c), going, there, new)
        going = going[c[going] - a[going] > 2.5 * NEAR]
    return x, f


def _narrow(at: Three, values: Three, going: Places, there: Numbers, new: Numbers) -> None:
    """Take a value between three places in: the lowest stays in the middle."""
    (a, x, c), (f_a, f, f_c) = at, values
    better, above = new < f[going], there > x[going]
    for is_above, near, f_near, far, f_far in ((True, a, f_a, c, f_c), (False, c, f_c, a, f_a)):
        here = above == is_above
        k, take = going[here & better], here & better
        near[k], f_near[k], x[k], f[k] = x[k], f[k], there[take], new[take]
        k, take = going[here & ~better], here & ~better
        far[k], f_far[k] = there[take], new[take]


def root(value: Value, a: Numbers, b: Numbers, f_a: Numbers, f_b: Numbers) -> Numbers:
    """Where functions change their sign between two places (Chandrupatla 1997, Advances in Engineering Software 28)."""
    best, going = np.where(np.abs(f_b) < np.abs(f_a), b, a), np.flatnonzero(a != b)
    a, b, f_a, f_b, share = b[going], a[going], f_b[going], f_a[going], np.full(len(going), 0.5)
    for _ in range(TURNS):
        if not len(going):
            break
        x = a + share * (b - a)
        f = value(x, going)
        same = np.signbit(f) == np.signbit(f_a)
        c, f_c = np.where(same, a, b), np.where(same, f_a, f_b)
        b, f_b = np.where(same, b, a), np.where(same, f_b, f_a)
        a, f_a = x, f
        best[going] = np.where(np.abs(f_a) < np.abs(f_b), a, b)
        least = EXACT / np.maximum(np.abs(b - a), 1e-300)
        left = (least < 0.5) & (f != 0.0)
        share = np.clip(_share((a, b, c), (f_a, f_b, f_c)), np.minimum(least, 0.5), 1.0 - np.minimum(least, 0.5))
        going, share = going[left], share[left]
        a, b, f_a, f_b = a[left], b[left], f_a[left], f_b[left]
    return best


def _share(at: Three, values: Three) -> Numbers:
    """How far to go between the first two: by the inverse of a parabola through all where it is one, else half."""
    (a, b, c), (f_a, f_b, f_c) = at, values
    with np.errstate(all="ignore"):
        xi, phi = (a - b) / (c - b), (f_a - f_b) / (f_c - f_b)
        share = f_a / (f_b - f_a) * f_c / (f_b - f_c) + (c - a) / (b - a) * f_a / (f_c - f_a) * f_b / (f_c - f_b)
        return np.where((phi * phi < xi) & ((1.0 - phi) ** 2 < 1.0 - xi), share, 0.5)


def largest_level(
    level: Callable[[Numbers], Numbers], frequencies: Numbers, levels: Numbers | None = None
) -> tuple[float, float]:
    """Largest value of a positive function of frequency, looked for on a grid [Hz], and where it lies [Hz].

    `levels` are its values on the grid, where they are known already.
    """
    levels = level(frequencies) if levels is None else levels
    squares = _inverse(levels)[None]
    _, k = lows(squares)
    wide = np.broadcast_to(frequencies, (len(k), len(frequencies)))
    at, least = lowest(lambda x, _: _inverse(level(np.exp(x))), *cells(wide, squares[[0] * len(k)], k))
    best = int(np.argmin(least))
    return float(1.0 / math.sqrt(least[best])), float(np.exp(at[best]))


def _inverse(levels: Numbers) -> Numbers:
    """Squares of their inverses, which are smooth where levels have a peak."""
    return 1.0 / np.maximum(levels * levels, 1e-300)


def crossing(value: Callable[[Numbers], Numbers], low: float, high: float) -> float:
    """Frequency between two at which a function of it changes its sign [Hz]."""
    ends = np.array([low, high])
    found = value(ends)
    a, b = np.log(ends)[:, None]
    return float(np.exp(root(lambda x, _: value(np.exp(x)), a, b, found[:1], found[1:]))[0])
