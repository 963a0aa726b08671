"""What of an identification can be trusted, what not, why, and what to record instead."""

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import accumulate
from typing import Any

import numpy as np

from detent.identify.fit.constants import Constants
from detent.identify.fit.equations import Run
from detent.identify.fit.estimate import Estimate, quantile, rms
from detent.identify.fit.free_run import Horizon
from detent.identify.fit.ladder import Climb, chosen_climb
from detent.identify.fit.regression import Fit, Prepared, make_effort, residuals_of
from detent.identify.fit.steadiness import FORCE, GAIN, PAST, Change
from detent.identify.fit.windows import MOST_OUT, Moved, sticks_out
from detent.logs.log import Values

LEAST_MOTION = 1.0  # time in which the axis really moves [s], at least
LEAST_EACH_WAY = 0.05  # share of this time in each direction, at least
WIDEST_MASS = 0.2  # half of the interval of the mass over the mass, at most
UNTOLD_FORCE = 0.1  # effort that a mass which is not known leaves open, over the effort, at most
WIDEST_FORCE = 0.15  # half of the interval of a friction or a weight over the effort that moves the axis, at most
SAME_SPEED = 0.6  # tenth over ninth decile of the speeds of a direction, from which on they count as one speed
WIDEST_DELAY = 10.0  # half of the interval of the delay, in samples, at most
MOST_APART = 0.2  # what the delay does to the effort, over the effort, at most
USUAL_DELAY = 3.0  # samples by which an effort may act later whatever that does to it: it is measured, worked out, held
MOST_LATE = 2.5  # samples by which the effort may come after the motion that it causes
COARSE = 0.1  # distance of the levels of an effort, in its size, from which it may say too little
UNTOLD = 0.06  # residual in this distance from which it does: a command that is one of few levels is exact
LASTING = 0.9  # correlation of neighbouring residuals from which the model misses something that lasts
WORST_LASTING = 0.05  # error of the prediction from which that matters
# Error of simulations over the travel: of half a second and more, as a rule; of any of these, and of the free run.
WORST_MISSED, WORST_ANY = 0.4, 0.8
FAR_OFF = "simulation is far off"
WELL_MET = 0.2  # the same up to which the simulation fit is recommended where the regression is far off
BETTER_MISSED = 0.7  # such an error in that of another way to the constants, up to which it is the better one
WORST_PREDICTION = 0.35  # error of the prediction of held-out segments over the effort, at most
WORST_SIMULATION = 0.7  # simulated error over that of going on with the velocity of the start, at most
_WAYS = ("positive", "negative")
_FRICTIONS = tuple(f"{kind}.{way}" for kind in ("coulomb", "viscous", "static") for way in _WAYS)
FORCES = (*_FRICTIONS, "pendulum", "pendulum.across")


@dataclass(frozen=True, slots=True)
class Refusal:
    """One thing that is not trusted.

    Attributes
    ----------
    subject : str
        What the matter is, in two or three words.
    text : str
        What was found, with its figures.
    record : str
        What to record, or to do, instead.
    constants : tuple of str
        Constants that are constants affected; empty for all.
    """

    subject: str
    text: str
    record: str
    constants: tuple[str, ...] = ()

    def __str__(self) -> str:
        """Give the refusal as one line."""
        what = ", ".join(self.constants) if self.constants else "all constants"
        return f"refused: {what}: {self.subject}: {self.text}; try: {self.record}"

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return asdict(self)


def look_at_motion(runs: Sequence[Run], parts: Sequence[Prepared]) -> Iterator[Refusal]:
    """Whether the axis moved long enough and both ways."""
    hop = [p.motion.kernel.half // 2 * p.run.step for p in parts]
    right = sum(h * float(np.sum(p.motion.velocity > 0.0)) for h, p in zip(hop, parts, strict=True))
    left = sum(h * float(np.sum(p.motion.velocity < 0.0)) for h, p in zip(hop, parts, strict=True))
    total = right + left
    if total < LEAST_MOTION:
        seconds = sum(float(run.t[-1]) for run in runs)
        text = f"in {seconds:.3g} s the axis moves clearly for {total:.2g} s"
        yield Refusal("too short", text, f"record {max(10.0, 5 * LEAST_MOTION):g} s or more of back-and-forth moves")
    elif min(right, left) < LEAST_EACH_WAY * total:
        way = "larger" if right > left else "smaller"
        most = f"it moves towards {way} positions in {max(right, left) / total:.0%} of the time"
        text = f"{most}, so friction and a constant force cannot be separated"
        yield Refusal("no reversal", text, "record moves in both directions, at two speeds or more")


def look_at_constants(run: Run, constants: Constants, parts: Sequence[Prepared]) -> list[Refusal]:
    """Whether each constant is known well enough, and can be one at all."""
    effort = rms(np.concatenate([p.run.effort for p in parts]))
    velocity = np.concatenate([p.motion.velocity for p in parts])
    top = float(np.quantile(np.abs(velocity), 0.95))
    by_name = {e.name: e for e in constants.estimates(run)}
    acceleration = rms(np.concatenate([p.motion.acceleration for p in parts]))
    found = [
        *_not_explained(by_name["mass"], effort, acceleration),
        *_not_told(run, by_name, effort, top, constants.bounded),
    ]
    refused = {name for refusal in found for name in refusal.constants}
    found += [r for r in _one_speed(run, velocity, by_name) if not refused >= set(r.constants)]
    found += [_bounded(by_name[name]) for name in constants.bounded if name in by_name]
    return [*found, *_impossible(by_name, effort, top)]


def _bounded(e: Estimate) -> Refusal:
    """A constant at an end of the range that was searched for it."""
    text = f"{e.name} {e.value:.4g} {e.unit} is an end of the range that was searched, not a value"
    record = "moves that show it" if e.name != "delay" else "effort and motion by one clock, unfiltered"
    return Refusal("at a bound", text, f"record {record}", (e.name,))


def _not_explained(mass: Estimate, effort: float, acceleration: float) -> Iterator[Refusal]:
    """A mass that is not known although the axis accelerates: something else takes the effort, and all are wrong."""
    share = mass.half * acceleration / max(effort, 1e-300)
    if mass.high > 0.0 and not mass.half < WIDEST_MASS * mass.value and UNTOLD_FORCE < share < np.inf:
        text = f"mass {mass.value:.4g} +- {mass.half:.2g} {mass.unit}, which leaves {share:.0%} of the effort open"
        yield Refusal("model does not explain the log", text, "look for what else drives the axis, a filter, a delay")


def _not_told(
    run: Run, by_name: dict[str, Estimate], effort: float, top: float, bounded: Collection[str]
) -> Iterator[Refusal]:
    """Constants that are not known well enough; those at an end of what was searched are told as such."""
    mass, delay = by_name["mass"], by_name.get("delay")
    if mass.high <= 0.0:
        text = f"the mass is {mass.value:.4g} {mass.unit}: effort and motion have opposite signs"
        yield Refusal("wrong sign", text, "invert the effort or the position in the mapping")
    elif "mass" not in bounded and not mass.half < WIDEST_MASS * mass.value:
        text = f"mass {mass.value:.4g} +- {mass.half:.2g} {mass.unit}, because there is hardly any acceleration"
        yield Refusal("little acceleration", text, "record moves with short ramps", ("mass",))
    for e in (by_name[name] for name in FORCES if name in by_name and name not in bounded):
        is_viscous = e.name.startswith("viscous")
        scale = top if is_viscous else 1.0
        if not e.half * scale < WIDEST_FORCE * effort:
            is_known = e.half < 100.0 * (effort / max(scale, 1e-300))
            text = f"{e.name} {f'{e.value:.4g} +- {e.half:.2g} {e.unit}' if is_known else 'not determined at all'}"
            record = "steady moves at several speeds" if is_viscous else "slow moves in both directions"
            yield Refusal("not determined by the data", text, f"record {record}", (e.name,))
    if delay is not None and "delay" not in bounded and delay.half > WIDEST_DELAY * run.step:
        text = f"delay {1e3 * delay.value:.3g} +- {1e3 * delay.half:.2g} ms"
        yield Refusal("not determined by the data", text, "record moves with short ramps, sampled faster", ("delay",))


def _one_speed(run: Run, velocity: Values, names: Collection[str]) -> Iterator[Refusal]:
    """Directions in which the axis has hardly more than one speed."""
    for way, speed in (("positive", velocity[velocity > 0.0]), ("negative", -velocity[velocity < 0.0])):
        # A model without viscous friction has it in its Coulomb friction.
        concerned = tuple(name for name in (f"coulomb.{way}", f"viscous.{way}") if name in names)
        if not concerned or len(speed) < 2:
            continue
        low, high = (float(np.quantile(speed, share)) for share in (0.1, 0.9))
        if low > SAME_SPEED * high:
            speeds = f"{low:.3g} to {high:.3g} {run.position_unit}/s nearly all the time"
            text = f"in {way} direction it moves at {speeds}: Coulomb and viscous friction cannot be separated"
            yield Refusal("one speed", text, "record moves at two speeds or more in each direction", concerned)


def _impossible(by_name: dict[str, Estimate], effort: float, top: float) -> Iterator[Refusal]:
    """Friction that would drive the axis."""
    coulomb = [by_name[n] for n in ("coulomb.positive", "coulomb.negative") if n in by_name]
    if len(coulomb) == 2:
        total, reach = sum(e.value for e in coulomb), math.hypot(*(e.error for e in coulomb)) * 3.0
        if total < -max(reach, 0.02 * effort):
            text = f"Coulomb friction of both directions is {total:.3g} {coulomb[0].unit}, which would drive the axis"
            record = "check the sign of the effort and the delay between the signals"
            yield Refusal("friction below 0", text, record)
    for way in _WAYS:
        e = by_name.get(f"viscous.{way}")
        if e is not None and e.high < 0.0 and e.value * top < -0.05 * effort:
            text = f"viscous.{way} is {e.value:.3g} {e.unit}: friction decreases with speed"
            record = "record several speeds; check the effort for saturation or delay"
            yield Refusal("friction below 0", text, record, (e.name,))


def look_at_fit(parts: Sequence[Prepared], fit: Fit, error: float, changes: Sequence[Change]) -> Iterator[Refusal]:
    """Whether the fit is that of one axis whose signals belong to the same moments."""
    run, effort_as_recorded, shifted = parts[0].run, make_effort(parts, 0.0), fit.effort
    large = [change for change in changes if change.is_large]
    if large:
        most = max(large, key=lambda change: change.share)
        subject = "changes with the motion" if most.is_of_motion else "changes along the log"
        yield Refusal(subject, *_told(run, most, fit))
    if (share := float(np.mean(sticks_out(fit)))) > MOST_OUT:
        text = f"in {share:.0%} of the windows the effort is eight times further off than in the others"
        yield Refusal("model does not explain the log", text, "look for parts of the log that are not of this axis")
    delay, step = 1e3 * fit.value("delay"), 1e3 * run.step
    half = 1e3 * quantile(float(fit.degrees[fit.names.index("delay")])) * fit.error("delay")
    is_known = half < WIDEST_DELAY * step
    record = "record effort and motion by one clock, unfiltered"
    apart = rms(shifted - effort_as_recorded) / max(rms(effort_as_recorded), 1e-300)
    if not fit.is_settled and (is_known or error > WORST_LASTING):
        text = f"up to {delay:.3g} ms, the end of the search, no delay of the effort fits the motion best"
        yield Refusal("delay out of range", text, record)
    elif apart > MOST_APART and not (is_known and delay + half > 0.0 and delay - half < USUAL_DELAY * step):
        text = f"{delay:.3g} ms between effort and motion, which is {apart:.0%} of the effort: a delay, or a filter"
        yield Refusal("effort and motion are apart", text, record)
    elif fit.instruments == "reference" and is_known and delay + half < -MOST_LATE * step:
        text = f"the effort follows the motion that it causes by {-delay:.3g} ms: it came late, or through a filter"
        yield Refusal("effort is late", text, record)
    elif fit.instruments == "reference" and delay + half < -step:
        text = f"{delay:.3g} ms: no effort acts before it is there by more than the time between two rows"
        yield Refusal("effort is late", text, record, ("delay",))
    neighbours = residuals_of(fit).neighbours
    level, effort = level_of(run.effort), rms(run.effort)
    if level > COARSE * effort and rms(fit.residual) > UNTOLD * level:
        text = f"{run.effort_name} has steps of {level:.3g} {run.effort_unit}, {level / effort:.0%} of its size"
        yield Refusal("coarse effort", text, "record the effort with a finer resolution")
    if error > WORST_LASTING and neighbours > LASTING:
        text = f"{error:.0%} of the effort are left unexplained, for long stretches (correlation {neighbours:.2f})"
        record = (
            "look for a filter, a coarse sensor, or friction that depends on the place; record on one axis at a time"
        )
        yield Refusal("model does not explain the log", text, record)


def _told(run: Run, change: Change, fit: Fit) -> tuple[str, str]:
    """A change in words, and what to look for."""
    unit = {GAIN: "times", FORCE: run.effort_unit}.get(change.name) or run.unit(change.name)
    size = rms(fit.effort) if change.name == FORCE else 1.0
    ends = f"{size * (change.mean - change.amplitude):.4g} to {size * (change.mean + change.amplitude):.4g} {unit}"
    text = f"{change.name} changes {change.course}, from {ends}: it is not of one axis and one effort"
    if change.course == PAST:
        text = f"{change.name} follows what the effort was in the last second, by {abs(change.amplitude):.1%} of it"
        return text, "look for a sensor that creeps, an amplifier that holds no steady value, a slow filter"
    if not change.is_of_motion:
        what = "a load put on, an offset or gain of the sensor, a clock that drifts"
        return text, f"look for {what}; identify parts alone"
    if change.name == "delay":
        return text, "look for a filter or a sensor that is late in a part of the motion, a clock that is not even"
    return text, "look for an amplifier that is not even, a filter, a limit, a coarse sensor of the place"


def look_at_windows(run: Run, moved: Sequence[Moved], names: Collection[str]) -> Iterator[Refusal]:
    """Whether wider windows say the same: an axis that is another for each length is none that the model has."""
    for one in moved:
        widths = f"{one.value:.4g} by windows of {1e3 * one.width:.3g} ms, {one.other:.4g} by wider ones"
        text = f"{one.name} [{run.unit(one.name)}] is {widths}: the model, or a signal, lacks something"
        record = "look for a sensor that is not even, a coupling that slips, spikes, a filter, a load put on"
        yield Refusal("depends on the window", text, record, tuple(name for name in one.concerned if name in names))


def look_at_readings(
    constants: Constants, parts: Sequence[Prepared], refused: Sequence[Refusal], left_open: str
) -> Iterator[Refusal]:
    """Constants that one reading of a log tells well enough, and all of them together do not."""
    run = parts[0].run
    known = {e.name: e for e in constants.estimates(run)}
    open_now = {name for r in look_at_constants(run, constants, parts) for name in r.constants or ("mass",)}
    before = {name for r in refused for name in r.constants or known}
    if names := [name for name in known if name in open_now - before]:
        told = ", ".join(
            f"{name} {known[name].value:.4g} +- {known[name].half:.2g} {known[name].unit}" for name in names
        )
        text = f"{told}, as the log leaves open {left_open}"
        yield Refusal("depends on the reading", text, "record effort and motion by one even clock", tuple(names))


def level_of(effort: Values) -> float:
    """Distance of the values that an effort goes to from the nearest other value, the root mean square over these."""
    # A value that it keeps counts once: a command that is stepped is exact, however far its steps are.
    levels, counts = np.unique(effort[np.r_[True, np.diff(effort) != 0.0]], return_counts=True)
    if len(levels) < 2:
        return 0.0
    ways = np.r_[np.inf, np.diff(levels), np.inf]
    nearest = np.minimum(ways[:-1], ways[1:])
    nearest *= nearest  # in its place: it is as large as the log, where the effort is never twice the same
    return float(np.sqrt(np.sum(np.multiply(counts, nearest, out=nearest)) / np.sum(counts)))


def look_at_prediction(
    climbs: Sequence[Climb], horizons: Sequence[Horizon], refused: Sequence[Refusal]
) -> Iterator[Refusal]:
    """Whether the model explains what it did not see; without a mass that is known it cannot be simulated."""
    chosen = chosen_climb(climbs)
    if not chosen.error < WORST_PREDICTION:
        text = f"the effort on held-out segments is predicted with an error of {chosen.error:.0%}"
        record = "check that the effort is what drives this axis, and its sign, unit and delay"
        yield Refusal("model does not explain the log", text, record)
    tested = [h for h in horizons if h.name in {"0.1 s", "0.5 s"}]
    if not tested or any("mass" in refusal.constants for refusal in refused):
        return
    if not min(h.rms / max(h.naive, 1e-300) for h in tested) < WORST_SIMULATION:
        h = tested[-1]
        text = f"simulated over {h.name} its error is {h.rms:.3g}, constant velocity gives {h.naive:.3g}"
        yield Refusal("model does not explain the log", text, "record with more acceleration, or check the units")
        return
    yield from _far_off(horizons)


def _far_off(horizons: Sequence[Horizon]) -> Iterator[Refusal]:
    """A simulation that leaves the log by more than constants that are nearly right can make it."""
    if missed(horizons) > WORST_MISSED or any(share > WORST_ANY for _, share in shares_missed(horizons)):
        told = ", ".join(f"{share:.0%} over {name}" for name, share in shares_missed(horizons))
        text = f"simulated from the effort alone, the axis misses its travel by {told}"
        record = "record each direction at several speeds; behind --method regression, try --method output-error"
        yield Refusal(FAR_OFF, text, record)


def _long(horizons: Sequence[Horizon]) -> list[Horizon]:
    """Horizons over which constants show: half a second and more."""
    return [h for h in horizons if h.name not in {"one step", "0.1 s"} and h.moved > 0.0]


def shares_missed(horizons: Sequence[Horizon]) -> list[tuple[str, float]]:
    """By how much simulations of each such length miss, over the travel.

    An axis that comes back within a stretch has travelled as far as it did in a shorter one.
    """
    long = _long(horizons)
    ways = accumulate((h.moved for h in long), max)
    return [(h.name, h.rms / way) for h, way in zip(long, ways, strict=True)]


def missed(horizons: Sequence[Horizon]) -> float:
    """By how much simulations of half a second and more miss, over the travel: the median; 0 where there is none."""
    shares = [h.rms / h.moved for h in _long(horizons)]
    return float(np.median(shares)) if shares else 0.0


def compare_methods(
    run: Run, ways: tuple[Constants, Constants], horizons: tuple[Sequence[Horizon], Sequence[Horizon]]
) -> tuple[str, list[Refusal]]:
    """Which of two ways to believe where their intervals are disjoint, in a sentence; refused where neither is better.

    The regression comes first, the simulation fit second, whose constants are given.
    """
    known = {e.name: e for e in ways[0].estimates(run)}
    pairs = [(known[e.name], e) for e in ways[1].estimates(run) if e.name in known and e.name != "delay"]
    apart = [(a, b) for a, b in pairs if a.low > b.high or b.low > a.high]
    if not apart:
        return "", []
    told = ", ".join(
        f"{a.name} {a.value:.4g} +- {a.half:.2g} and {b.value:.4g} +- {b.half:.2g} {b.unit}" for a, b in apart
    )
    by, other = missed(horizons[1]), missed(horizons[0])
    both = f"regression and simulation fit disagree: {told}"
    if 0.0 < by < BETTER_MISSED * other:
        return (
            f"{both}; the simulation fit misses held-out travel by {by:.0%}, the regression by {other:.0%}: use it",
            [],
        )
    why = f"{both}; held-out travel is missed by {other:.0%} and {by:.0%}, which does not decide between them"
    record = "record slower and faster moves; where the regression predicts better, leave --method out"
    return "", [Refusal("two ways disagree", why, record, tuple(b.name for _, b in apart))]
