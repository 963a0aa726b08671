"""The loops that drove an axis, from its log: what the recorded effort is of the recorded reference and position.

A position loop P over a velocity loop P or PI, its feedforward included, says exactly what it puts out:

    u = Kv d + Ki int d + A a_ref + B v_ref + C sign(v_ref) + const,    d = Kp (r - q) + s v_ref - v

With Kp known this is linear in all others; Kp is searched. A velocity `v` is a difference of positions over some
samples, and `s` is 0 or 1 where there is an integral: each of these is tried. Loops that explain a part of the log that
the fit did not see are those of the machine as far as the log can tell; where none do, nothing is said of them.

Ljung: System Identification, Theory for the User (1999), section 13.5, direct identification of the regulator.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from detent.identify.fit.equations import Run
from detent.identify.fit.estimate import rms, significant
from detent.identify.fit.search import least_within
from detent.logs.differences import MOST_ROWS
from detent.logs.log import Values

SPANS = (1, 2, 3, 4, 6, 8, 12)  # samples that the velocity may be a difference over
SEEN = 0.7  # part of the log that is fitted; the rest tests
WORST = 0.1  # error of the effort over the effort in the rest, at most
SLIGHT = 0.01  # share of the effort below which a feedforward is none
REACH = 0.01  # to each side, in natural logarithms: between these errors the gain with the least of them is worked out
GAINS = (0.5, 2000.0)  # position gains looked at [1/s]


@dataclass(frozen=True, slots=True)
class Loops:
    """Loops as a log tells them; efforts in the unit of the log."""

    position: float  # gain of the position loop [1/s]
    velocity: float  # and integral: gains of the velocity loop: effort per velocity, and per position
    integral: float
    span: int  # number of samples of the velocity difference
    # share of the reference's velocity in the demand; without an integral it holds viscous feedforward too
    feed_velocity: float
    # feed_acceleration, feed_viscous, feed_coulomb: effort per acceleration and per velocity of the reference, and for
    # its direction
    feed_acceleration: float
    feed_viscous: float
    feed_coulomb: float
    error: float  # effort not explained over the effort, in the part that was not fitted


def motion_asked(run: Run, reference: Values) -> tuple[Values, Values]:
    """Velocity and acceleration of a reference, as the feedforward that is found belongs to them."""
    velocity = np.gradient(reference, run.step)
    return velocity, np.gradient(velocity, run.step)


def fit_loops(run: Run) -> Loops | None:
    """Find the loops that drove an axis; None without a reference, and where no such loops explain the effort."""
    if run.reference is None or len(run.position) < 10 * max(SPANS):
        return None
    found = [loops for trial in _trials(run, run.reference) if (loops := trial.solve()) and loops.error < WORST]
    return min(found, key=lambda loops: loops.error, default=None)


def _trials(run: Run, reference: Values) -> Iterator["_Trial"]:
    """Every structure that is tried, the simplest first."""
    step, count = run.step, len(reference)
    rows = np.flatnonzero(run.usable)
    rows = rows[(rows >= max(SPANS) + 3) & (rows < count - 3)]
    rows = rows[:: max(1, len(rows) // MOST_ROWS)]
    if len(rows) < 10 * max(SPANS):
        return
    velocity, acceleration = motion_asked(run, reference)
    way, late = (np.cumsum(signal)[rows] * step for signal in (velocity, reference - run.position))
    velocity, acceleration = velocity[rows], acceleration[rows]
    feeds, effort = [acceleration, velocity, np.sign(velocity), np.ones(len(rows))], run.effort[rows]
    error = reference[rows] - run.position[rows]
    for span in SPANS:
        moved = (run.position[rows] - run.position[rows - span]) / (span * step)
        gone = np.zeros(count)
        np.subtract(run.position[span:], run.position[:-span], out=gone[span:])
        gone = np.cumsum(gone, out=gone)[rows] / span
        # Without an integral a share of the velocity and a viscous feedforward are one and the same.
        for share, loops in ((0.0, 1), (0.0, 2), (1.0, 2)):
            integrals = [late, share * way - gone] if loops == 2 else []
            signals = [error, share * velocity - moved, *integrals, *feeds, effort]
            yield _Trial(np.column_stack(signals), span, share, loops)


@dataclass(frozen=True, slots=True, eq=False)
class _Trial:
    """One structure."""

    # error and demand, with an integral theirs too, then what is fed forward, and the effort, shape (n, m)
    signals: Values
    span: int  # and share: as of `Loops`
    share: float
    loops: int  # 2 with an integral, else 1

    def mix(self, gain: float, count: int) -> Values:
        """How a position gain mixes so many parts: their product are its columns."""
        loops = self.loops
        mixed = np.zeros((count, count - loops))
        for k in range(loops):
            mixed[2 * k, k], mixed[2 * k + 1, k] = gain, 1.0
        mixed[2 * loops :, loops:] = np.eye(count - 2 * loops)
        return mixed

    def solve(self) -> Loops | None:
        """The best gains, without feedforward that is slight or against the motion; None where they hold no axis."""
        seen, rest = (part.T @ part for part in np.split(self.signals, [self._cut]))
        return self._solve(seen, seen + rest, (0, 1, 2))

    @property
    def _cut(self) -> int:
        """Samples that are fitted; the rest tests."""
        return round(SEEN * len(self.signals))

    def _solve(self, seen: Values, products: Values, feeds: tuple[int, ...]) -> Loops | None:
        """The same with some of the feedforward, from the products of all signals, in the part seen and in all."""
        first, rest = self.loops, self.signals[self._cut :]
        taken = [*range(2 * first), *(2 * first + f for f in feeds), -2]
        own, told = seen[np.ix_(taken, taken)], seen[taken, -1]
        gain = self._search(own, told)
        mix = self.mix(gain, len(taken))
        theta = np.array([significant(value) for value in _solve(mix.T @ own @ mix, mix.T @ told).tolist()])
        powers = np.diag(mix.T @ products[np.ix_(taken, taken)] @ mix)
        sizes, size = np.abs(theta) * np.sqrt(np.maximum(powers, 0.0) / len(self.signals)), rms(rest[:, -1])
        if not (theta[:first] > 0.0).all() or (first == 2 and sizes[1] < SLIGHT * size):
            return None
        kept = tuple(f for k, f in enumerate(feeds, first) if theta[k] > 0.0 and sizes[k] > SLIGHT * size)
        if kept != feeds:
            return self._solve(seen, products, kept)
        # Of loops that are those of the machine next to nothing is left: products of signals would not show it.
        factors = np.zeros(rest.shape[1])
        factors[taken], factors[-1] = -mix @ theta, 1.0
        error = rms(rest @ factors) / max(size, 1e-300)
        known = dict(zip(feeds, theta[first:-1].tolist(), strict=True))
        acceleration, viscous, coulomb = (known.get(f, 0.0) for f in range(3))
        share, integral = self.share, float(theta[1])
        if first == 1:
            share, integral, viscous = viscous / float(theta[0]), 0.0, 0.0
        return Loops(gain, float(theta[0]), integral, self.span, share, acceleration, viscous, coulomb, error)

    def _search(self, products: Values, moments: Values) -> float:
        """The position gain with the least error: the best of a few, then between its neighbours."""

        def miss(logarithm: float) -> float:
            """Square of the error, less that of the effort."""
            mix = self.mix(math.exp(logarithm), len(products))
            own, told = mix.T @ products @ mix, mix.T @ moments
            return -float(told @ _solve(own, told))

        grid: list[float] = np.linspace(math.log(GAINS[0]), math.log(GAINS[1]), 9).tolist()
        best = int(np.argmin([miss(g) for g in grid]))
        around = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
        found = least_within(miss, *around, accuracy=0.1 * REACH)
        # Near its least the error is flat, and rounding decides where the search ends: its slope tells the place.
        for _ in range(2):
            less, least, more = miss(found - REACH), miss(found), miss(found + REACH)
            bend = less - 2.0 * least + more
            found += float(np.clip(0.5 * (less - more) / bend, -1.0, 1.0)) * REACH if bend > 0.0 else 0.0
        return significant(math.exp(found), 6)


def _solve(products: Values, moments: Values) -> Values:
    """Least squares by the normal equations, which are few, worked out with columns of unit length."""
    size = np.maximum(np.sqrt(np.diag(products)), 1e-150)
    linalg: Any = np.linalg
    theta: Values = linalg.lstsq(products / np.outer(size, size), moments / size, rcond=1e-12)[0]
    return theta / size
