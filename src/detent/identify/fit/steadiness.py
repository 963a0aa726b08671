"""Whether the constants of a log are the same throughout it: one number cannot say what changes.

Columns of a model are joined by themselves times a *course*, from -1 to 1: a straight line over the log, a step in its
middle, the sign of the effort, the direction, the speed. What such a column is given is by how much a constant changes
to each side of its mean. Where that is more than chance, the log is not of one axis, or not by one effort: a sensor of
current that drifts, a load put on, a second half of another axis, a clock that runs away, a friction that warms up; an
amplifier with another gain for each sign, a filter, a sensor that is not even. A gain of the whole effort changes all
constants alike, and is told where no single one is. A slight change widens the interval; a large one is refused with
its size.

The amplitude of one more column needs no fit of all of them: what the other columns explain of it is taken away, and
what is left explains what they leave (Frisch, Waugh: Partial time regressions. Econometrica 1 (1933)).

Nyblom: Testing for the constancy of parameters over time. J. American Statistical Association 84 (1989).
Andrews: Tests for parameter instability and structural change with unknown change point. Econometrica 61 (1993).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from detent.identify.fit import equations, regression
from detent.identify.fit.chance import student_reach
from detent.identify.fit.estimate import RANK, carried_degrees, coloured_covariance, column_sizes, quantile, rms
from detent.logs.log import Values

# Probability of a change as clear by chance, in each direction: of one constant with one course of time, and of the
# mass or the whole effort with any.
CHANCE, CHANCE_WHOLE = 2e-5, 2.5e-4
ROWS_EACH = 8  # windows for each column, at least
SLIGHT = 0.03  # change to each side, over the mass or in parts of the effort, up to which it only widens the limits
MOST_OF_MOTION = 0.1  # the same of a mass or a gain that changes with the motion, where it has a mean
MOST_HALVES = 8  # half waves of a course over a log, at most
MOST_OVER = 1.5  # size of a sample of the effort over the largest that its windows have, at most
LASTS = 1.0  # time that a creeping zero, or one that cannot stay, remembers [s]
SIDE = 0.15  # share of what tells a constant that each side of a course holds, at least
UNEVEN = 0.02  # size of an uneven effort over the effort, from which on its sizes differ
OWN = 1e-3  # part of a column that no other explains, from which on it is one of its own
SPEED, SIGN, PAST = "with the speed", "with its sign", "after what it was in the last second"
# What may change, or be off, beside the constants of the model.
GAIN, FORCE, SCALE = "gain of the effort", "zero of the effort", "scale of the position"


@dataclass(frozen=True, slots=True)
class Change:
    """By how much a constant changes within a log."""

    name: str  # term of the model, or `GAIN`, `FORCE`, `SCALE`
    mean: float  # and amplitude: its constant, and the change to each side of it
    amplitude: float
    share: float  # the amplitude over the mass or the gain, or what it does to the effort over the effort
    course: str  # with what it changes

    @property
    def is_large(self) -> bool:
        """True where it is more than an interval should carry."""
        # Friction is no straight line of the speed anyway; where sensors are too coarse for a mass, its mean holds.
        if not self.is_of_motion or self.course in {SIGN, PAST} or self.name == "delay":
            return self.share > SLIGHT
        return self.name in {"mass", GAIN} and self.share > MOST_OF_MOTION

    @property
    def is_of_motion(self) -> bool:
        """True where it changes with what the axis does, and not with time."""
        return "along the log" not in self.course


class _Look(NamedTuple):
    """A column that tells a change, and its instrument."""

    name: str
    course: str
    column: Values
    tool: Values
    mean: float
    chance: float


def changes_of(parts: Sequence[regression.Prepared], fit: regression.Fit) -> tuple[list[Change], float]:
    """Terms of a fitted model whose constants change within the log by more than chance, the clearest course each.

    Behind them how clear the clearest of all looks is, those included that are less than an interval: 1 is the end of
    chance.
    """
    x, z, effort = regression.columns_of(parts, fit)
    if len(x) < ROWS_EACH * (x.shape[1] + 1):
        return [], 0.0
    theta = regression.solve(z, x, effort)
    rest, size = effort - regression.combine(x, theta), max(rms(effort), 1e-300)
    limits = {name: quantile(d) * fit.error(name) for name, d in zip(fit.names, fit.degrees.tolist(), strict=True)}
    found: dict[str, tuple[tuple[bool, float], Change]] = {}
    clearest, others = 0.0, _Others(x, z)
    reach = max(p.motion.kernel.half * p.run.step for p in parts)  # beyond it a delay is no part of the slope
    for look in _looks(parts, fit, x, z):
        amplitude, least = _amplitude(look, others, rest)
        is_relative = look.name in {"mass", GAIN} and look.mean
        share = abs(amplitude / look.mean) if is_relative else abs(amplitude) * rms(look.column) / size
        if look.name == "delay" and abs(amplitude) > reach:
            continue
        clear = abs(amplitude) / max(least, 1e-300)
        clearest = max(clearest, clear)
        if clear > 1.0 and (abs(amplitude) > limits.get(look.name, 0.0) or share > SLIGHT):
            change = Change(look.name, look.mean, amplitude, share, look.course)
            one = (change.is_large, clear), change  # a slight one that is clearer is not to hide a large one
            found[look.name] = max(found.get(look.name, one), one, key=itemgetter(0))
    return [change for _, change in found.values()], clearest


class _Others:
    """The columns of a model and their instruments, at unit length: what they explain of one more column."""

    def __init__(self, x: Values, z: Values) -> None:
        self.x, self.z = x / column_sizes(x), z / column_sizes(z)
        self.products = regression.products(self.z, self.x)

    def left_of(self, column: Values, *, is_tool: bool = False) -> Values:
        """What they leave of a column, or of an instrument."""
        by, of, matrix = (self.x, self.z, self.products.T) if is_tool else (self.z, self.x, self.products)
        share, *_ = np.linalg.lstsq(matrix, regression.products(by, column[:, None])[:, 0], rcond=RANK)
        return column - regression.combine(of, np.asarray(share, np.float64))


def _amplitude(look: _Look, others: _Others, rest: Values) -> tuple[float, float]:
    """Constant of one more column, and the size up to which it is chance; 0 for a column that others explain."""
    column, tool = others.left_of(look.column), others.left_of(look.tool, is_tool=True)
    length = float(np.linalg.norm(tool) * np.linalg.norm(column))
    if length < OWN * float(np.linalg.norm(look.tool) * np.linalg.norm(look.column)):
        return 0.0, 1.0
    column, tool = column[:, None], tool[:, None]
    amplitude = float(regression.solve(tool, column, rest)[0])
    left = rest - amplitude * column[:, 0]
    covariance, cosines = coloured_covariance(column, left, tool, others=others.x.shape[1])
    degrees = float(carried_degrees(column, left, tool, cosines)[0])
    return amplitude, student_reach(look.chance, max(degrees, 1.0)) * float(np.sqrt(max(covariance[0, 0], 0.0)))


def _looks(parts: Sequence[regression.Prepared], fit: regression.Fit, x: Values, z: Values) -> Iterator[_Look]:
    """Columns that tell changes: of each constant with time; of the mass, the whole effort and the delay with all."""
    terms = equations.terms_of(fit.model)
    theta = fit.values[: len(terms)]
    effort, told = regression.combine(x[:, : len(terms)], theta), regression.combine(z[:, : len(terms)], theta)
    ones = np.full(len(effort), rms(effort))
    for course, along in over_time(parts):
        for k, name in enumerate((*terms, "delay")):
            if _has_sides(x[:, k], along):
                yield _Look(name, course, x[:, k] * along, z[:, k] * along, float(fit.values[k]), CHANCE)
    for course, along in (*over_time(parts), *_in_short(parts)):
        yield _Look(GAIN, course, effort * along, told * along, 1.0, CHANCE_WHOLE)
        yield _Look(FORCE, course, ones * along, ones * along, 0.0, CHANCE_WHOLE)
    yield _Look(GAIN, SIGN, np.abs(effort), np.abs(told), 1.0, CHANCE_WHOLE)
    yield _Look(FORCE, PAST, _before(parts, effort), _before(parts, told), 0.0, CHANCE_WHOLE)
    for column, tool in _bent(parts, fit, told):
        yield _Look(GAIN, "with its size", column, tool, 1.0, CHANCE_WHOLE)
    for course, along in over_place(parts):
        yield _Look(GAIN, course, effort * along, told * along, 1.0, CHANCE_WHOLE)
    for course, along in over_motion(parts):
        for k, name in enumerate(terms):
            is_looked_at = name == "mass" or (course == SPEED and name.startswith("viscous"))
            if is_looked_at and _has_sides(x[:, k], along):
                yield _Look(name, course, x[:, k] * along, z[:, k] * along, float(theta[k]), CHANCE_WHOLE)
    # Signals that come by one way are as late wherever the axis is, and whatever it does.
    k, late = len(terms), fit.value("delay")
    for course, along in (*over_motion(parts), *over_place(parts), ("with the size of the effort", level(told))):
        if _has_sides(x[:, k], along):
            yield _Look("delay", course, x[:, k] * along, z[:, k] * along, late, CHANCE_WHOLE)


def _has_sides(column: Values, along: Values) -> bool:
    """True where both sides of a course tell enough of a constant."""
    power = column**2
    return SIDE < float(power[along > 0.0].sum()) / max(float(power.sum()), 1e-300) < 1.0 - SIDE


def over_time(parts: Sequence[regression.Prepared]) -> Iterator[tuple[str, Values]]:
    """Courses over each log, shape (m,), with what they are called."""
    along = _time_of(parts)
    yield "steadily along the log", along
    if 0.1 < float(np.mean(along > 0.0)) < 0.9:
        yield "about 50% of the way along the log", np.where(along > 0.0, 1.0, -1.0)


def _in_short(parts: Sequence[regression.Prepared]) -> Iterator[tuple[str, Values]]:
    """Courses with steps at each tenth of the logs, and that come and go, as what drifts and is not one axis does."""
    along = _time_of(parts)
    for tenth in (1, 2, 3, 4, 6, 7, 8, 9):
        later = along > 0.2 * tenth - 1.0
        if 0.05 < float(np.mean(later)) < 0.95:
            yield f"about {tenth}0% of the way along the log", np.where(later, 1.0, -1.0)
    for halves in range(2, MOST_HALVES + 1):
        yield f"up and down along the log, in {halves} half waves", np.cos(0.5 * np.pi * halves * (along + 1.0))


def _time_of(parts: Sequence[regression.Prepared]) -> Values:
    """Time of the windows, from -1 at the begin of each log to 1 at its end."""
    return np.concatenate([2.0 * p.motion.rows / len(p.run.position) - 1.0 for p in parts])


def _before(parts: Sequence[regression.Prepared], effort: Values) -> Values:
    """Mean of an effort over the `LASTS` before each window, log by log: what creeps, and what cannot stay."""
    found, first = list[Values](), 0
    for p in parts:
        rows, own = p.motion.rows, effort[first : first + len(p.motion.rows)]
        first += len(rows)
        low, high = np.searchsorted(rows, rows - round(LASTS / p.run.step)), np.arange(1, len(rows) + 1)
        added = np.concatenate([[0.0], np.cumsum(own)])
        found.append((added[high] - added[low]) / (high - low))
    return np.concatenate(found)


def _bent(parts: Sequence[regression.Prepared], fit: regression.Fit, told: Values) -> Iterator[tuple[Values, Values]]:
    """The effort by an amplifier that is not even, and its instruments: its slope a straight line, and a parabola."""
    # What the constants follow is the slope, how a small change is passed on: from -1 for nothing to 1 at the top. It
    # acts on each sample, and an effort that answers to noise has peaks that its windows have not.
    top = max(float(np.quantile(np.abs(told), 0.98)), 1e-300)

    def bent(effort: Values, power: int) -> Values:
        return effort * (2.0 / (power + 1) * np.minimum(np.abs(effort) / top, MOST_OVER) ** power - 1.0)

    late = fit.value("delay")
    effort = regression.make_effort(parts, late)
    for power in (1, 2):
        held = [p.motion.kernel.held(bent(p.run.effort, power), p.motion.rows, late / p.run.step) for p in parts]
        column = np.concatenate(held)
        # A part of the effort itself, which holds what the model leaves of it, would explain just that.
        column -= float((column * effort).sum() / max((effort**2).sum(), 1e-300)) * effort
        if rms(column) > UNEVEN * rms(effort):
            yield column, bent(told, power)


def over_motion(parts: Sequence[regression.Prepared]) -> Iterator[tuple[str, Values]]:
    """Courses with what the axis does, by the instruments, shape (m,)."""
    velocity, acceleration = (
        np.concatenate([getattr(p.ideal, name) for p in parts]) for name in ("velocity", "acceleration")
    )
    yield "with the direction", np.sign(velocity)
    yield "from braking to speeding up", np.sign(velocity * acceleration)
    yield SPEED, level(velocity)
    yield "with the acceleration", level(acceleration)


def over_place(parts: Sequence[regression.Prepared]) -> Iterator[tuple[str, Values]]:
    """Courses over the travel of each log, shape (m,)."""
    places: list[Values] = []
    for p in parts:
        low, high = float(p.run.position.min()), float(p.run.position.max())
        places.append(2.0 * (p.ideal.position - low) / max(high - low, 1e-300) - 1.0)
    along = np.concatenate(places)
    yield "from end to end of the travel", along
    yield "from the middle to the ends of the travel", 2.0 * np.abs(along) - 1.0
    for halves in range(3, MOST_HALVES + 1):
        yield f"up and down over the travel, in {halves} half waves", np.cos(0.5 * np.pi * halves * (along + 1.0))


def level(values: Values) -> Values:
    """Sizes from -1 for nothing to 1 for the largest."""
    sizes = np.abs(values)
    return np.clip(2.0 * sizes / max(float(np.quantile(sizes, 0.98)), 1e-300) - 1.0, -1.0, 1.0)


def widen(parts: Sequence[regression.Prepared], fit: regression.Fit, changes: Sequence[Change]) -> None:
    """Let the covariance of a fit carry slight changes: a constant anywhere between both ends."""
    top = float(np.quantile(np.abs(np.concatenate([p.ideal.velocity for p in parts])), 0.98))
    for change in changes:
        for k, name in enumerate((*equations.terms_of(fit.model), "delay")):
            fit.covariance[k, k] += _side(change, name, float(fit.values[k]), rms(fit.effort), top) ** 2 / 3.0


def _side(change: Change, name: str, value: float, effort: float, top: float) -> float:
    """By how much a change leaves a constant open to each side."""
    kind, _, way = change.name.partition(".")
    is_force = name.startswith(("coulomb", "offset", "excess"))
    if change.name in {GAIN, SCALE}:
        return change.amplitude * value
    if change.name == FORCE:
        return change.amplitude * effort * is_force
    # A mass changes with nothing that an axis does; what is not even is the effort, and friction is read from it too.
    if change.name == "mass" and change.is_of_motion and name != "mass":
        return change.share * effort * (is_force + 2.0 / top * name.startswith("viscous"))
    # Straight lines through the slow and the fast half of a parabola differ so where they meet the standstill.
    if change.course == SPEED and kind == "viscous" and name == f"coulomb{'.' if way else ''}{way}":
        return 0.5 * change.amplitude * top
    return change.amplitude * (name == change.name)
