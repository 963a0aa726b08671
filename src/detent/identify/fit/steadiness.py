"""Whether the constants of a log stay what they are along it: one number cannot say what changes.

Each column of a model is joined by itself times a course over the log: a straight line, or a step at a quarter, half or
three quarters of it. What these are given is by how much a constant changes to each side of its mean. Where that is
more than chance, the log is not of one axis, or not by one effort: a sensor of current that drifts, a load put on, a
second half of another axis, a clock that runs away, a friction that warms up. A slight change widens the interval; a
large one is refused with its size.

Nyblom: Testing for the constancy of parameters over time. J. American Statistical Association 84 (1989).
Andrews: Tests for parameter instability and structural change with unknown change point. Econometrica 61 (1993).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from detent.identify.fit import equations, regression
from detent.identify.fit.chance import student_reach
from detent.identify.fit.estimate import carried_degrees, coloured_covariance, quantile, rms
from detent.logs.log import Values

CHANCE = 2e-5  # probability of a change as clear by chance, in each direction, of one constant with one course
ROWS_EACH = 8  # windows for each column, at least
SLIGHT = 0.03  # change to each side, over the mass or in parts of the effort, up to which it only widens the limits
SIDE = 0.15  # share of what tells a constant that each half of a log holds, at least
STEPS = (0.0,)  # moments of a step, from -1 at the begin of a log to 1 at its end


@dataclass(frozen=True, slots=True)
class Change:
    """By how much a constant changes along a log."""

    name: str  # term of the model
    mean: float  # and amplitude: its constant, and the change to each side of it
    amplitude: float
    share: float  # the amplitude over the mass, or what it does to the effort over the effort
    course: str  # how it changes


def changes_of(parts: Sequence[regression.Prepared], fit: regression.Fit) -> list[Change]:
    """Terms of a fitted model whose constants change along the log by more than chance, the clearest course of each."""
    x, z, effort = regression.columns_of(parts, fit)
    terms = equations.terms_of(fit.model)
    if len(x) < ROWS_EACH * (x.shape[1] + 1):
        return []
    found: dict[str, tuple[float, Change]] = {}
    for course, along in _courses(parts):
        for k, name in enumerate(terms):
            power = x[:, k] ** 2
            if not SIDE < float(power[along > 0.0].sum()) / max(float(power.sum()), 1e-300) < 1.0 - SIDE:
                continue
            columns, tools = (np.column_stack([a, a[:, k] * along]) for a in (x, z))
            values = regression.solve(tools, columns, effort)
            residual = effort - regression.combine(columns, values)
            covariance, cosines = coloured_covariance(columns, residual, tools)
            degrees = float(carried_degrees(columns, residual, tools, cosines)[-1])
            amplitude, error = float(values[-1]), float(np.sqrt(max(covariance[-1, -1], 0.0)))
            own = quantile(float(fit.degrees[k])) * float(np.sqrt(max(fit.covariance[k, k], 0.0)))
            least = student_reach(CHANCE, max(degrees, 1.0))
            clear = abs(amplitude) / max(error * least, 1e-300)
            size = abs(amplitude) * rms(x[:, k]) / max(rms(effort), 1e-300)
            share = abs(amplitude / float(values[k])) if name == "mass" and values[k] else size
            if clear > max(1.0, found.get(name, (0.0,))[0]) and (abs(amplitude) > own or share > SLIGHT):
                found[name] = clear, Change(name, float(values[k]), amplitude, share, course)
    return [change for _, change in found.values()]


def _courses(parts: Sequence[regression.Prepared]) -> Iterator[tuple[str, Values]]:
    """Courses over each log, shape (m,), with what they are called."""
    places = [2.0 * p.motion.rows / len(p.run.position) - 1.0 for p in parts]
    along = np.concatenate(places)
    yield "steadily", along
    for moment in STEPS:
        if min(float(np.mean(along > moment)), float(np.mean(along <= moment))) > 0.1:
            yield f"about {0.5 + 0.5 * moment:.0%} of the way", np.where(along > moment, 1.0, -1.0)


def widen(fit: regression.Fit, changes: Sequence[Change]) -> None:
    """Let the covariance of a fit carry slight changes: a constant anywhere between both ends."""
    for change in changes:
        k = fit.names.index(change.name)
        fit.covariance[k, k] += change.amplitude**2 / 3.0
