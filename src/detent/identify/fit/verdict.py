"""What of an identification can be trusted, what not, why, and what to record instead."""

import math
from collections.abc import Collection, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.identify.fit.constants import Constants
from detent.identify.fit.estimate import Estimate
from detent.identify.fit.free_run import Horizon
from detent.identify.fit.ladder import Climb
from detent.identify.fit.prepare import Run
from detent.identify.fit.regression import Prepared
from detent.logs.log import Kind, Log, Severity, Values

LEAST_MOTION = 1.0  # time in which the axis really moves [s], at least
LEAST_EACH_WAY = 0.05  # share of this time in each direction, at least
MOST_SATURATED = 0.3  # share of saturated samples, at most
MOST_STUCK = 0.05  # share of samples with a stuck signal, at most

MOST_LEFT_BEHIND = 0.6
"""Share of the way of the reference during which the position stands still, at most; friction may hold it for some."""

WIDEST_MASS = 0.2  # half of the interval of the mass over the mass, at most
WIDEST_FORCE = 0.15  # half of the interval of a friction or a weight over the effort that moves the axis, at most
SAME_SPEED = 0.6  # tenth over ninth decile of the speeds of a direction, from which on they count as one speed
WIDEST_DELAY = 10.0  # half of the interval of the delay, in samples, at most
WORST_PREDICTION = 0.35  # error of the prediction of stretches not seen over the effort, at most
WORST_SIMULATION = 0.7  # simulated error over that of going on with the velocity of the start, at most

FORCES = (
    "coulomb.positive",
    "coulomb.negative",
    "viscous.positive",
    "viscous.negative",
    "static.positive",
    "static.negative",
    "pendulum",
    "pendulum.across",
)


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
        Constants that are not trusted for it; empty for all.
    """

    subject: str
    text: str
    record: str
    constants: tuple[str, ...] = ()

    def __str__(self) -> str:
        """Give the refusal as one line."""
        what = ", ".join(self.constants) if self.constants else "all constants"
        return f"refused: {what}: {self.subject}: {self.text}; do: {self.record}"

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return asdict(self)


_DIRT: dict[Kind, tuple[str, str]] = {
    Kind.WRONG_SIGN: ("wrong sign", "turn the signal round in the mapping, as in force=-COLUMN"),
    Kind.WRONG_UNIT: ("wrong unit", "state the unit of the column in the mapping"),
    Kind.LOST_SIGN: ("lost sign", "record the signal with its sign"),
}


def look_at_log(log: Log, run: Run) -> list[Refusal]:
    """What is wrong with a log before anything is fitted."""
    found: list[Refusal] = []
    for finding in log.findings:
        if finding.kind in _DIRT and finding.severity is not Severity.NOTE:
            subject, record = _DIRT[finding.kind]
            found.append(Refusal(subject, f"{log.name}: {finding.signal} {finding.text}", finding.advice or record))
    stuck = _share(log, Kind.STUCK, {"position", run.effort_name})
    if stuck > MOST_STUCK:
        found.append(
            Refusal(
                "stuck signal",
                f"{log.name}: stands still in {stuck:.0%} of the rows",
                "look at the sensor and its cable, and record again",
            )
        )
    behind = _share_left_behind(run)
    if behind > MOST_LEFT_BEHIND:
        text = f"{log.name}: the reference makes {behind:.0%} of its way while the position stands still"
        found.append(
            Refusal("stuck signal", text, "look at the encoder, its cable and the drive's enable, and record again")
        )
    saturated = max(_share(log, Kind.SATURATED, {"position", run.effort_name}), _share_at_ends(run.effort))
    if saturated > MOST_SATURATED:
        text = f"{log.name}: {run.effort_name} or position is at its limit in {saturated:.0%} of the rows"
        found.append(Refusal("saturated", text, "record slower or smaller moves that stay within the limit"))
    return found


def _share(log: Log, kind: Kind, signals: set[str]) -> float:
    """Share of rows in findings of a kind about some signals."""
    found: NDArray[np.bool_] = np.zeros(len(log.t), np.bool_)
    for finding in log.findings:
        if finding.kind is kind and finding.signal in signals:
            for first, last in finding.rows:
                found |= (log.rows >= first) & (log.rows <= last)
    return float(found.mean())


def _share_left_behind(run: Run) -> float:
    """Share of the way of the reference that it makes while the position stands still for a quarter of a second."""
    if run.reference is None:
        return 0.0
    count = max(round(0.25 / run.step), 2)
    stretches = len(run.position) // count
    if stretches == 0:
        return 0.0
    cut = (stretches, count)
    still = np.ptp(run.position[: stretches * count].reshape(cut), axis=1) == 0.0
    way = np.abs(np.diff(run.reference[: stretches * count].reshape(cut), axis=1)).sum(axis=1)
    total = float(way.sum())
    return float(way[still].sum()) / total if total > 0.0 else 0.0


def _share_at_ends(values: Values) -> float:
    """Share of samples exactly at the largest or the smallest value."""
    top, bottom = float(values.max()), float(values.min())
    at_ends = np.count_nonzero(values == top) + np.count_nonzero(values == bottom)
    return at_ends / len(values) if top > bottom else 1.0


def look_at_motion(runs: Sequence[Run], parts: Sequence[Prepared]) -> list[Refusal]:
    """Whether the axis moved long enough and both ways."""
    hop = [p.motion.kernel.half // 2 * p.run.step for p in parts]
    right = sum(h * float(np.sum(p.motion.velocity > 0.0)) for h, p in zip(hop, parts, strict=True))
    left = sum(h * float(np.sum(p.motion.velocity < 0.0)) for h, p in zip(hop, parts, strict=True))
    total = right + left
    found: list[Refusal] = []
    if total < LEAST_MOTION:
        seconds = sum(float(run.t[-1]) for run in runs)
        text = f"in {seconds:.3g} s the axis moves clear of standstill for {total:.2g} s"
        found.append(
            Refusal("too short", text, f"record {max(10.0, 5 * LEAST_MOTION):g} s or more of moves to and fro")
        )
    elif min(right, left) < LEAST_EACH_WAY * total:
        way = "larger" if right > left else "smaller"
        text = (
            f"it moves to {way} positions in {max(right, left) / total:.0%} of the time, so friction and a constant "
            "force cannot be told apart"
        )
        found.append(Refusal("no reversal", text, "record moves in both directions, at two speeds or more"))
    return found


def look_at_constants(run: Run, constants: Constants, parts: Sequence[Prepared]) -> list[Refusal]:
    """Whether each constant is known well enough, and can be one at all."""
    found: list[Refusal] = []
    rms_effort = float(np.sqrt(np.mean(np.concatenate([p.run.effort for p in parts]) ** 2)))
    velocity = np.concatenate([p.motion.velocity for p in parts])
    top = float(np.quantile(np.abs(velocity), 0.95))
    by_name = {e.name: e for e in constants.estimates(run)}
    mass = by_name["mass"]
    half = 0.5 * (mass.high - mass.low)
    if mass.high <= 0.0:
        found.append(
            Refusal(
                "wrong sign",
                f"the mass comes out as {mass.value:.4g} {mass.unit}: effort and motion point apart",
                "turn the effort or the position round in the mapping",
            )
        )
    elif not half < WIDEST_MASS * mass.value:
        text = f"mass {mass.value:.4g} +- {half:.2g} {mass.unit}, as there is hardly any acceleration"
        found.append(Refusal("little acceleration", text, "record moves with short ramps", ("mass",)))
    for name in FORCES:
        if name not in by_name:
            continue
        e = by_name[name]
        scale = top if name.startswith("viscous") else 1.0
        wide = 0.5 * (e.high - e.low) * scale
        if not wide < WIDEST_FORCE * rms_effort:
            text = _tell(e, rms_effort / max(scale, 1e-300))
            record = (
                "record steady moves at several speeds"
                if name.startswith("viscous")
                else "record slow moves in both directions"
            )
            found.append(Refusal("not told by the data", f"{name} {text}", record, (name,)))
    delay = by_name.get("delay")
    if delay is not None and 0.5 * (delay.high - delay.low) > WIDEST_DELAY * run.step:
        text = f"delay {1e3 * delay.value:.3g} +- {5e2 * (delay.high - delay.low):.2g} ms"
        found.append(Refusal("not told by the data", text, "record moves with short ramps, sampled faster", ("delay",)))
    refused = {name for refusal in found for name in refusal.constants}
    found += [r for r in _one_speed(run, velocity, by_name) if not refused >= set(r.constants)]
    found += _impossible(by_name, rms_effort, top)
    return found


def _one_speed(run: Run, velocity: Values, names: Collection[str]) -> list[Refusal]:
    """Directions in which the axis has hardly more than one speed."""
    found: list[Refusal] = []
    for way, speed in (("positive", velocity[velocity > 0.0]), ("negative", -velocity[velocity < 0.0])):
        concerned = tuple(name for name in (f"coulomb.{way}", f"viscous.{way}") if name in names)
        if len(concerned) < 2 or len(speed) < 2:
            continue
        low, high = (float(np.quantile(speed, share)) for share in (0.1, 0.9))
        if low > SAME_SPEED * high:
            text = (
                f"in {way} direction it moves at {low:.3g} to {high:.3g} {run.position_unit}/s nearly all the time: "
                "Coulomb and viscous friction cannot be told apart"
            )
            found.append(Refusal("one speed", text, "record moves at two speeds or more in each direction", concerned))
    return found


def _tell(e: Estimate, scale: float) -> str:
    """A constant with its limits, or that nothing is known of it."""
    half = 0.5 * (e.high - e.low)
    return f"{e.value:.4g} +- {half:.2g} {e.unit}" if half < 100.0 * scale else "not known at all"


def _impossible(by_name: dict[str, Estimate], effort: float, top: float) -> list[Refusal]:
    """Friction that would drive the axis."""
    found: list[Refusal] = []
    coulomb = [by_name[n] for n in ("coulomb.positive", "coulomb.negative") if n in by_name]
    if len(coulomb) == 2:
        total, reach = sum(e.value for e in coulomb), math.hypot(*(e.error for e in coulomb)) * 3.0
        if total < -max(reach, 0.02 * effort):
            text = f"Coulomb friction of both directions is {total:.3g} {coulomb[0].unit}, which would drive the axis"
            found.append(
                Refusal("friction below 0", text, "look at the sign of the effort and at the delay between the signals")
            )
    for way in ("positive", "negative"):
        e = by_name.get(f"viscous.{way}")
        if e is not None and e.high < 0.0 and e.value * top < -0.05 * effort:
            text = f"viscous.{way} is {e.value:.3g} {e.unit}: friction falls with speed"
            found.append(
                Refusal(
                    "friction below 0",
                    text,
                    "record several speeds; look for a limit or a delay of the effort",
                    (e.name,),
                )
            )
    return found


def look_at_prediction(
    climbs: Sequence[Climb], horizons: Sequence[Horizon], refused: Sequence[Refusal]
) -> list[Refusal]:
    """Whether the model explains what it did not see; without a mass that is known it cannot be simulated."""
    found: list[Refusal] = []
    chosen = next(c for c in reversed(climbs) if c.taken)
    if not chosen.error < WORST_PREDICTION:
        text = f"the effort of stretches not seen is predicted with an error of {chosen.error:.0%}"
        found.append(
            Refusal(
                "model does not explain the log",
                text,
                "look whether the effort is what drives this axis, and at its sign, unit and delay",
            )
        )
    if any("mass" in refusal.constants for refusal in refused):
        return found
    tested = [h for h in horizons if h.name in {"0.1 s", "0.5 s"}]
    if tested and not min(h.rms / max(h.naive, 1e-300) for h in tested) < WORST_SIMULATION:
        h = tested[-1]
        text = f"simulated over {h.name} it errs by {h.rms:.3g}, going on with the velocity by {h.naive:.3g}"
        found.append(Refusal("model does not explain the log", text, "record with more acceleration, or look at units"))
    return found
