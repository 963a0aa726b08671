"""What an axis should do, sample by sample: moves of limited speed, acceleration and jerk, or a recording.

A move from rest to rest is time-optimal within its limits, worked out by ruckig (MIT licence); with an infinite jerk it
is a trapezoid. It begins at a sample; its end, which mostly lies between two, is reached at the next.

Berscheid, Kroeger: Jerk-limited Real-time Trajectory Generation with Arbitrary Target States. RSS 2021.
"""

import math
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.errors import DetentError

Numbers = NDArray[np.float64]

MOST_SAMPLES = 10_000_000  # samples of a profile at most: nearly three hours at 1 kHz, 240 MB


@dataclass(frozen=True, slots=True)
class MotionLimits:
    """What a move may do."""

    speed: float  # [m/s], above 0 and finite
    acceleration: float  # [m/s^2], above 0 and finite
    jerk: float = math.inf  # [m/s^3], above 0; infinite for a trapezoid of the speed


@dataclass(frozen=True, slots=True, eq=False)
class Profile:
    """A reference, one entry per sample."""

    period: float  # time between two samples [s]
    position: Numbers  # and velocity, acceleration: [m], [m/s], [m/s^2], shape (samples,), contiguous float64
    velocity: Numbers
    acceleration: Numbers

    @property
    def count(self) -> int:
        """Number of samples."""
        return len(self.position)

    @property
    def t(self) -> Numbers:
        """Time of each sample [s]."""
        return np.arange(self.count, dtype=np.float64) * self.period


@dataclass(frozen=True, slots=True, eq=False)
class Sections:
    """A time-optimal move as stretches of constant jerk: their begins, and the end."""

    t: Numbers  # [s], shape (8,)
    states: tuple[Numbers, Numbers, Numbers, Numbers]  # position, velocity, acceleration and jerk there

    def at(self, t: Numbers) -> tuple[Numbers, Numbers, Numbers]:
        """Position, velocity and acceleration at some moments of the move [s]."""
        k = np.searchsorted(self.t, t, side="right") - 1
        s = t - self.t[k]
        p, v, a, j = (state[k] for state in self.states)
        return p + s * (v + s * (a / 2.0 + s * j / 6.0)), v + s * (a + s * j / 2.0), a + s * j


def plan_move(start: float, target: float, limits: MotionLimits, period: float) -> Profile:
    """Time-optimal move from rest to rest.

    >>> move = plan_move(0.0, 0.1, MotionLimits(speed=0.5, acceleration=5.0, jerk=100.0), period=1e-3)
    >>> move.count, float(move.position[-1]), float(move.velocity.max())
    (351, 0.1, 0.5)
    """
    if start == target:
        return Profile(period, np.array([target]), np.zeros(1), np.zeros(1))
    sections = move_sections(start, target, limits)
    length = float(sections.t[-1]) / period
    check_length(length)
    # None is added for a rounding error; ruckig takes no time for a way of one, but the move begins at its start.
    samples = max(math.ceil(length - 1e-9), 1)
    position, velocity, acceleration = sections.at(np.arange(samples, dtype=np.float64) * period)
    return Profile(period, np.append(position, target), np.append(velocity, 0.0), np.append(acceleration, 0.0))


def profile_of_recording(
    t: Numbers, position: Numbers, period: float, velocity: Numbers | None = None, acceleration: Numbers | None = None
) -> Profile:
    """Reference from recorded samples.

    Positions between the samples, and the derivatives that were not recorded, come from the cubic spline through them.
    Steps of a coarse encoder become peaks of the acceleration: filter such a recording first, or leave the
    feedforward of the acceleration out.
    """
    _check_recording(t, position, velocity, acceleration)
    # A rounded time of the last sample must not lose it.
    samples = math.floor((t[-1] - t[0]) / period + 1e-6) + 1
    check_length(samples)
    at = np.minimum(t[0] + np.arange(samples, dtype=np.float64) * period, t[-1])
    q, dq, ddq = _spline(t, position, at)
    if velocity is not None:
        dq, ddq, _ = _spline(t, velocity, at)
    if acceleration is not None:
        ddq, _, _ = _spline(t, acceleration, at)
    return Profile(period, q, dq, ddq)


def _spline(t: Numbers, values: Numbers, at: Numbers) -> tuple[Numbers, Numbers, Numbers]:
    """Cubic spline through recorded values: itself and its first two derivatives, at other times."""
    spline: Any = import_module("scipy.interpolate").CubicSpline(t, values)  # it states no types, and loads slowly
    value, first, second = (np.ascontiguousarray(spline(at, order), np.float64) for order in range(3))
    return value, first, second


def move_sections(start: float, target: float, limits: MotionLimits) -> Sections:
    """Time-optimal move between two places, by ruckig."""
    ruckig: Any = import_module("ruckig")  # it states no types
    asked, found = ruckig.InputParameter(1), ruckig.Trajectory(1)
    asked.current_position, asked.target_position = [start], [target]
    asked.max_velocity, asked.max_acceleration = [limits.speed], [limits.acceleration]
    asked.max_jerk = [limits.jerk]
    try:
        ruckig.Ruckig(1).calculate(asked, found)
    except ruckig.RuckigError as error:
        raise DetentError(
            f"no profile from {start:g} m to {target:g} m within {limits.speed:g} m/s, {limits.acceleration:g} m/s^2 "
            f"and {limits.jerk:g} m/s^3; look at the limits of the axis"
        ) from error
    one = found.profiles[0][0]
    begins = np.concatenate([[0.0], np.cumsum(one.t)])
    # ruckig states the acceleration of a trapezoid as that at its begin, with no jerk.
    p, v, a, j = (np.append(x, x[-1])[:8] for x in (one.p, one.v, one.a, one.j))
    return Sections(begins, (p, v, a, j))


def check_length(samples: float) -> None:
    """Refuse a profile of more than `MOST_SAMPLES`."""
    if samples > MOST_SAMPLES:
        too_long = f"a profile of {samples:.4g} samples, must be {MOST_SAMPLES} or fewer; cut it, or sample slower"
        raise DetentError(too_long)


def _check_recording(t: Numbers, *signals: Numbers | None) -> None:
    present = [t, *(s for s in signals if s is not None)]
    if t.ndim != 1 or len(t) < 2 or any(s.shape != t.shape for s in present):
        shapes = ", ".join(str(s.shape) for s in present)
        raise DetentError(f"a recording of shapes {shapes}, must all be (n,) with n 2 or more")
    if not all(np.isfinite(s).all() for s in present):
        raise DetentError("a recording with values that are not finite; import it with detent.identify first")
    if not (np.diff(t) > 0.0).all():
        raise DetentError("a recording whose time does not increase strictly; import it with detent.identify first")
