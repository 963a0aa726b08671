"""Slope and friction per direction from runs at two steady speeds or more.

An axis that moves at a steady speed needs no effort for its mass: what is left is friction and what grows with the
speed. Two speeds of a direction give both,

    slope = (F1 - F2) / (v1 - v2),    coulomb = direction * (F1 - slope * v1),

the claim of the print head (US 4,775,945), which measures the effort in counts of its modulator. More speeds give the
line through all stretches, each weighted by its length. What the slope is depends on the effort: viscous friction of a
force or torque; of a current, that over the torque constant; of a voltage or a duty cycle, the back-EMF constant and
the resistance's share of viscous friction. The friction of a direction holds any constant force (gravity, an offset of
the amplifier) in it.

Assumptions: acceleration is negligible in the stretches taken (see `identify.fit.steady`), and friction between the
speeds is a line. The error of each stretch is that of its mean with coloured residuals; where more than two stretches
scatter about the line by more than that, the scatter between stretches is added, and said.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from detent.identify.fit.estimate import Estimate, estimate
from detent.identify.fit.steady import SteadyStretch, find_steady, find_velocity, measure_stretch, unit_per_speed
from detent.logs.differences import scipy
from detent.logs.log import Log, Values

APART = 0.1  # difference of the highest and lowest speed, at least, as a part of the highest
ROUNDS = 3  # times that weights and line are computed in turn: the errors of the stretches depend on the slope
UNLIKELY = 0.05  # probability of the scatter about the line below which it is more than the errors of the stretches
DIRECTIONS = {"positive": 1.0, "negative": -1.0}


@dataclass(frozen=True, slots=True)
class SpeedLine:
    """Effort against speed in one direction."""

    direction: str  # ``"positive"`` or ``"negative"``
    stretches: tuple[SteadyStretch, ...]  # what it was found from
    slope: Estimate | None = None  # effort per speed
    coulomb: Estimate | None = None  # effort of the line at speed 0, as a magnitude against the motion
    # scatter of the stretches about the line beside their own errors, standard deviation; 0 where there is none
    between: float = 0.0
    reason: str = ""  # why there is no result; empty where there is one
    notes: tuple[str, ...] = ()  # what to know about it


@dataclass(frozen=True, slots=True)
class TwoSpeeds:
    """Outcome of the method."""

    effort: str  # role of the signal that drives
    positive: SpeedLine  # and negative: one for each direction
    negative: SpeedLine

    @property
    def reason(self) -> str:
        """Why there is no result in either direction; empty where there is one."""
        if self.positive.reason and self.negative.reason:
            return f"{self.positive.reason}; {self.negative.reason}"
        return ""

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """All constants found."""
        lines = (self.positive, self.negative)
        return tuple(found for line in lines for found in (line.slope, line.coulomb) if found is not None)


def fit_two_speeds(log: Log, effort: str = "") -> TwoSpeeds:
    """Slope and friction of each direction from the steady stretches of a recording."""
    role = log.effort(effort)
    velocity, speed_unit, step = find_velocity(log)
    drive = log.signals[role]
    parts = find_steady(log.t, velocity, step)
    units = (log.units[role], unit_per_speed(log.units[role], speed_unit), speed_unit)
    lines = {
        name: _fit_direction(name, (log.t, velocity, drive), [p for p in parts if velocity[p].mean() * sign > 0], units)
        for name, sign in DIRECTIONS.items()
    }
    return TwoSpeeds(role, lines["positive"], lines["negative"])


def _fit_direction(
    name: str, series: tuple[Values, Values, Values], parts: list[slice], units: tuple[str, str, str]
) -> SpeedLine:
    """The line of one direction, or why there is none."""
    unit, unit_of_slope, speed_unit = units
    measured = tuple(measure_stretch(*series, part, 0.0) for part in parts)
    speeds = [abs(stretch.speed) for stretch in measured]
    advice = "record passes at two steady speeds that differ by half or more"
    if not measured:
        return SpeedLine(name, measured, reason=f"no steady speed in {name} direction; {advice}")
    if max(speeds) - min(speeds) < APART * max(speeds):
        only = f"only one steady speed in {name} direction ({max(speeds):.4g} {speed_unit}); {advice}"
        return SpeedLine(name, measured, reason=only)
    line, errors, degrees, between = _weighted_line(measured)
    for _ in range(ROUNDS):
        measured = tuple(measure_stretch(*series, part, line[0]) for part in parts)
        line, errors, degrees, between = _weighted_line(measured)
    notes = [f"holds from {min(speeds):.4g} to {max(speeds):.4g} {speed_unit}; friction at rest is not measured"]
    if between > 0:
        text = "position-dependent friction, or friction that is no line over the speed"
        notes.append(f"stretches scatter about the line by {between:.3g} {unit} beside their errors: {text}")
    method = f"two-speed method, {len(measured)} stretches"
    slope = estimate(f"slope.{name}", line[0], unit_of_slope, errors[0], method, degrees[0])
    coulomb = estimate(f"coulomb.{name}", DIRECTIONS[name] * line[1], unit, errors[1], method, degrees[1])
    return SpeedLine(name, measured, slope, coulomb, between, notes=tuple(notes))


def _weighted_line(measured: tuple[SteadyStretch, ...]) -> tuple[list[float], list[float], list[float], float]:
    """Line through the means of the stretches, weighted by their length.

    Slope and height at zero, their standard errors, degrees of freedom of each, scatter between the stretches. Weights
    from the errors of the stretches would make the interval too short: each error is known with few degrees of freedom.
    """
    v = np.array([stretch.speed for stretch in measured])
    f = np.array([stretch.effort for stretch in measured])
    columns = np.column_stack([v, np.ones(len(v))])
    own = np.array([stretch.effort_error**2 for stretch in measured])
    own = np.maximum(own, 1e-24 * max(float(np.max(f * f)), 1e-300))
    seconds = np.array([stretch.seconds for stretch in measured])
    degrees = np.array([stretch.degrees for stretch in measured])
    pooled = float(degrees @ (own * seconds)) / float(degrees.sum()) / seconds
    between = _scatter_between(columns, f, pooled, float(degrees.sum()))
    pull = _pull(columns, pooled + between**2)
    shares = pull**2 * own
    # Satterthwaite: degrees of a sum of variances, each known with its own.
    inner = shares.sum(axis=1) ** 2 / (shares**2 / degrees).sum(axis=1)
    if between > 0:
        inner = np.minimum(inner, len(v) - 2)
    covariance = pull * (own + between**2) @ pull.T
    return (pull @ f).tolist(), np.sqrt(np.diag(covariance)).tolist(), inner.tolist(), between


def _pull(columns: Values, size: Values) -> NDArray[np.float64]:
    """What each stretch adds to slope and height, shape (2, m): the weighted least-squares solution as a matrix."""
    weighted = columns.T / size
    return np.asarray(np.linalg.solve(weighted @ columns, weighted), float)


def _scatter_between(columns: Values, effort: Values, pooled: Values, degrees: float) -> float:
    """Standard deviation between stretches that brings the scatter about the line to what is expected.

    Paule and Mandel, Journal of Research of the National Bureau of Standards 87 (1982) 377; 0 where the scatter is
    likely without it.
    """
    free = len(effort) - 2

    def excess(between: float) -> float:
        """Weighted squares of the residuals beyond what their errors explain."""
        size = pooled + between**2
        residual = effort - columns @ (_pull(columns, size) @ effort)
        return float(residual @ (residual / size)) - free

    if free < 1 or float(scipy("stats").f.sf((excess(0.0) + free) / free, free, degrees)) > UNLIKELY:
        return 0.0
    most = float(np.ptp(effort)) + float(np.sqrt(pooled.max()))
    return float(scipy("optimize").brentq(excess, 0.0, 10.0 * most))
