"""Other readings of a log that it does not rule out: limits hold the constants of all of them.

- Steps of the time that are not even are those of a sampler that waits, whose stamps are right, or of a clock that is
  not even beside rows that are. Unless they leave more of the effort, constants by the rows, each a period behind the
  other, stand beside those by the stamps. And such a clock may run right where it is fastest, or slowest: with its
  seconds grow masses by their square, viscous frictions and delays by themselves.
- A delay of more than a few samples is none that a sampled loop has, but what a filter, or a sensor that is late in a
  part of the motion, makes of the log: it may be as well that of a loop.
- What a delay does to the effort is no straight line: on the mean of both, the longest and the shortest that its limits
  hold change the slope of the effort, which mass and friction answer to.

A log of even rows whose delay is known is left as it is.

Box: Bias in nonlinear estimation. J. Royal Statistical Society B 33 (1971).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from detent.identify.fit import equations, regression
from detent.identify.fit.constants import Constants, at_least, constants_of
from detent.identify.fit.equations import EVEN, Run, make_run
from detent.identify.fit.estimate import quantile, rms
from detent.identify.fit.verdict import USUAL_DELAY
from detent.identify.fit.windows import FEWEST, widened
from detent.logs.log import Log, Values
from detent.logs.stamps import in_usual_steps, is_gap

MOST_LATE = 5.0  # delay that limits are worked out with, in half windows: beyond it hardly anything is left to compare
WORSE = 1.05  # residual by even rows, in that by stamps, from which on the log tells that rows are not even
ROWS_EACH, MOST_PARTS = 10, 128  # rows of a part of a log whose pace is looked at, at least, and parts, at most
SECONDS = {"mass": 2.0, "viscous": 1.0, "delay": 1.0, "stribeck": -1.0}  # powers of the second that constants grow by


@dataclass(frozen=True, slots=True)
class Readings:
    """What other readings of a log do to its constants."""

    moved: tuple[dict[str, float], ...]  # by how much each moves them
    least: dict[str, float]  # how far their limits reach at least
    notes: tuple[str, ...]  # which they are

    @property
    def left_open(self) -> str:
        """What the log does not tell, in words."""
        return "how late the effort is" if len(self.moved) == 1 else "how even its clock is, and how late the effort"

    def held_by(self, constants: Constants) -> Constants:
        """Constants whose limits hold those of all readings."""
        return at_least(reduce(widened, self.moved, constants), self.least)


def read_otherwise(
    logs: Sequence[Log], parts: Sequence[regression.Prepared], fit: regression.Fit, constants: Constants
) -> Readings:
    """Other readings of the logs of a fit, and of constants of it with limits."""
    late, step = fit.value("delay"), parts[0].run.step
    beyond, by_rows, notes = max(abs(late) - USUAL_DELAY * step, 0.0), _by_rows(logs, parts, fit), list[str]()
    if beyond and constants.delay_is_told:
        notes.append(f"{1e3 * late:.3g} ms is no delay of a loop of {1e3 * step:.3g} ms: a filter may hold it")
    if by_rows:
        notes.append("the steps of the time are not even: the limits hold the constants by even rows, too")
    moved = ({"delay": beyond}, *by_rows)
    return Readings(moved, _bent_by_delay(parts, fit, reduce(widened, moved, constants)), tuple(notes))


def _bent_by_delay(parts: Sequence[regression.Prepared], fit: regression.Fit, constants: Constants) -> dict[str, float]:
    """What delays at both ends of its limits do to each constant on the mean."""
    k, late = constants.names.index("delay"), fit.value("delay")
    most = MOST_LATE * max(p.motion.kernel.half * p.run.step for p in parts)
    half = min(quantile(float(constants.degrees[k])) * float(constants.errors[k]), most)
    x, z, effort = regression.columns_of(parts, fit)
    more, less = (regression.make_effort(parts, late + side) for side in (half, -half))
    bent = regression.solve(z[:, :-1], x[:, :-1], 0.5 * (more + less) - effort)
    return _sums(fit, np.concatenate([bent, np.zeros(len(fit.values) - len(bent))]))


def _by_rows(logs: Sequence[Log], parts: Sequence[regression.Prepared], fit: regression.Fit) -> list[dict[str, float]]:
    """By how much constants change where rows, not stamps, are even, and with the pace; nothing where stamps are."""
    others = [_of_even_rows(log, p.run) for log, p in zip(logs, parts, strict=True)]
    if all(other is p.run for other, p in zip(others, parts, strict=True)):
        return []
    again = [
        regression.prepare(other, equations.make_kernel(p.motion.kernel.half, other.step), p.instruments)
        for other, p in zip(others, parts, strict=True)
    ]
    if sum(len(p.motion.rows) for p in again) < FEWEST * len(fit.names):
        return []
    other = regression.fit_equations(again, fit.model, fit.bend)
    if rms(other.residual) > WORSE * rms(fit.residual):
        return []  # the stamps are those of the motion
    rows = _sums(fit, other.values - fit.values)
    pace, own = max(map(_uneven_pace, logs)), constants_of(fit)
    powers = [SECONDS.get(name.partition(".")[0], 0.0) for name in own.names]
    return [rows, {n: by * pace * v for n, by, v in zip(own.names, powers, own.values.tolist(), strict=True)}]


def _uneven_pace(log: Log) -> float:
    """How far the steps of parts of a log are from the usual, over these, to each side; a tenth of the parts is not."""
    periods = _periods(log)
    count = min(max(len(periods) // ROWS_EACH, 1), MOST_PARTS)
    means = [float(part.mean()) for part in np.array_split(np.diff(log.t) / periods, count)]
    short, long = (float(np.quantile(means, share)) for share in (0.1, 0.9))
    return 0.5 * (long - short) / log.period


def _periods(log: Log) -> Values:
    """Periods from each row to the next: one, but where rows are missing."""
    ratio, is_uneven = in_usual_steps(log.t)
    return np.where(is_gap(ratio, is_uneven=is_uneven), np.rint(ratio), 1.0)


def _of_even_rows(log: Log, run: Run) -> Run:
    """The same run with each row a whole number of periods behind the one before; itself where it is so."""
    places = np.concatenate([[0.0], np.cumsum(_periods(log))])
    even = np.asarray(log.t[0] + places * (np.ptp(log.t) / places[-1]), np.float64)
    if float(np.abs(even - log.t).max()) < EVEN * run.step:
        return run
    other = make_run(replace(log, t=even), run.effort_name)
    count = min(len(other.position), len(run.position))
    return replace(other.part(0, count), usable=other.usable[:count] & run.usable[:count])


def _sums(fit: regression.Fit, values: Values) -> dict[str, float]:
    """Changes of the terms of a model as those of its constants."""
    found = constants_of(replace(fit, values=values))
    return dict(zip(found.names, found.values.tolist(), strict=True))
