"""One move of a cascade axis in four ways: trapezoid or limited jerk, with feed-forward by the axis's constants or not.

A loop without feed-forward moves only as far as its error tells it to: the axis lags in proportion to the speed. A
trapezoid demands a jump of the force, which makes a compliant coupling swing; a ramp of the force as long as one swing
hardly does.
"""

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.methods.cascade.build import motion_limits
from detent.methods.cascade.host import CascadeHost, Rows
from detent.methods.cascade.schema import CascadeSpec, DisturbanceTable
from detent.planning.profile import MotionLimits, plan_move
from detent.record.machine import Progress
from detent.sensing.gauge import set_gauge

WATCHED_TIME = 0.5
"""Time after the reference has come to rest in which the axis is watched, at least [s]."""

SWINGS = 4
"""And at least so many swings of the coupling."""

REST_TIME = 0.1
"""Time the axis stands before the move [s]."""

SHAPES, FEEDS = ("trapezoid", "limited jerk"), ("no feed-forward", "feed-forward")

Numbers = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ProfileCase:
    """The move made in one way; lengths [m] or angles [rad].

    Attributes
    ----------
    shape : str
        One of `SHAPES`.
    feed : str
        One of `FEEDS`.
    duration : float
        Of the reference [s].
    peak_following : float
        Largest magnitude of the following error.
    settling : float
        From the end of the reference until the load stayed within the window [s]; NaN if it did not.
    twist_after : float
        Twist of the coupling after the end of the reference, peak to peak; NaN for a rigid axis.
    peak_command : float
        Largest magnitude of the command [V].
    t : ndarray
        Time since the begin of the move, at every sample [s], shape (n,).
    speed : ndarray
        Of the reference [m/s], shape (n,).
    following, twist : ndarray
        Following error, and how far the motor is ahead of the load, shape (n,).
    """

    shape: str
    feed: str
    duration: float
    peak_following: float
    settling: float
    twist_after: float
    peak_command: float
    t: Numbers
    speed: Numbers
    following: Numbers
    twist: Numbers

    @property
    def name(self) -> str:
        """Both in one."""
        return f"{self.shape}, {self.feed}"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ProfileComparison:
    """Result of `compare_profiles`.

    Attributes
    ----------
    way : float
        Of the move [m] or [rad].
    speed, acceleration, jerk : float
        Its limits.
    stated : bool
        The jerk is that of the axis file; else the one that `smooth_jerk` proposes.
    frequency : float
        Of the load against a motor that is held [Hz]; NaN for a rigid axis.
    tolerance : float
        Error that counts as in position.
    rotary : bool
        Lengths are angles.
    cases : tuple of ProfileCase
        By shape, then by feed-forward.
    """

    way: float
    speed: float
    acceleration: float
    jerk: float
    stated: bool
    frequency: float
    tolerance: float
    rotary: bool
    cases: tuple[ProfileCase, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain data for ``--json``: everything but the curves."""
        curves = {"t", "speed", "following", "twist"}
        names = ("way", "speed", "acceleration", "jerk", "stated", "frequency", "tolerance", "rotary")
        cases = [{key: value for key, value in asdict(case).items() if key not in curves} for case in self.cases]
        return {name: getattr(self, name) for name in names} | {"cases": cases}


def compare_profiles(spec: CascadeSpec, *, progress: Progress | None = None) -> ProfileComparison:
    """Make one move in four ways on the axis of `spec`."""
    limits = motion_limits(spec)
    jerk = limits.jerk if math.isfinite(limits.jerk) else smooth_jerk(spec)
    found: list[ProfileCase] = []
    for shape, own in zip(SHAPES, (math.inf, jerk), strict=True):
        for feed in FEEDS:
            found.append(_case(spec, MotionLimits(limits.speed, limits.acceleration, own), shape, feed))
            if progress is not None:
                progress(len(found) / 4, found[-1].name)
    return ProfileComparison(
        way=0.5 * spec.limits.travel,
        speed=limits.speed,
        acceleration=limits.acceleration,
        jerk=jerk,
        stated=math.isfinite(limits.jerk),
        frequency=held_frequency(spec),
        tolerance=spec.method.in_position,
        rotary=spec.axis.motion == "rotary",
        cases=tuple(found),
    )


def held_frequency(spec: CascadeSpec) -> float:
    """Frequency at which the load swings against a motor that its loop holds [Hz]; NaN for a rigid axis."""
    coupling, mass = spec.mechanics.coupling, spec.mechanics.load_mass
    if coupling is None or mass <= 0:
        return math.nan
    return math.sqrt(coupling.stiffness / mass) / math.tau


def smooth_jerk(spec: CascadeSpec) -> float:
    """Jerk for an axis that states none [m/s^3].

    Its ramps of the acceleration last one swing of the load, which then ends without one; those of a rigid axis last a
    quarter of the time that the axis needs to come to speed.
    """
    limits, frequency = spec.limits, held_frequency(spec)
    ramp = 0.25 * limits.speed / limits.acceleration if math.isnan(frequency) else 1 / frequency
    return limits.acceleration / ramp


def _case(spec: CascadeSpec, limits: MotionLimits, shape: str, feed: str) -> ProfileCase:
    start = spec.limits.lowest + 0.25 * spec.limits.travel
    target = start + 0.5 * spec.limits.travel
    share = float(feed == FEEDS[1])
    own = spec.method.feed_forward
    shares: dict[str, float] = dict.fromkeys(("velocity", "acceleration", "viscous", "coulomb"), share)
    # A weight is held in both: the axis must not drop before the move.
    method = spec.method.model_copy(update={"feed_forward": own.model_copy(update=shares)})
    host = CascadeHost(spec.model_copy(update={"method": method, "disturbance": DisturbanceTable()}), position=start)
    _pass(host, REST_TIME)
    begin = host.time
    profile = plan_move(start, target, limits, host.period)
    set_gauge(host.state.gauge, host.state.tick, start, target, spec.method.in_position)
    host.follow(profile)
    frequency = held_frequency(spec)
    watched = WATCHED_TIME if math.isnan(frequency) else max(WATCHED_TIME, SWINGS / frequency)
    rows = _pass(host, (profile.count - 1) * host.period + watched)
    settled = host.state.gauge.outside * host.tick - begin
    duration = (profile.count - 1) * host.period
    twist = rows["machine.motor.position"] - rows["machine.load.position"]
    after = twist[profile.count - 1 :]
    speed = np.zeros(len(rows))
    speed[: profile.count] = profile.velocity[: len(rows)]
    return ProfileCase(
        shape=shape,
        feed=feed,
        duration=duration,
        peak_following=float(np.abs(rows["law.position_error"]).max()),
        settling=max(settled - duration, 0.0) if abs(host.position - target) <= spec.method.in_position else math.nan,
        twist_after=math.nan if math.isnan(frequency) else float(np.ptp(after)),
        peak_command=float(np.abs(rows["law.command"]).max()),
        t=np.arange(len(rows), dtype=np.float64) * host.period,
        speed=speed,
        following=rows["law.position_error"],
        twist=twist,
    )


def _pass(host: CascadeHost, seconds: float) -> Rows:
    """Let time pass, and see every sample."""
    kept: list[Rows] = []
    host.pass_samples(math.ceil(seconds / host.period - 1e-9), kept.append)
    return np.concatenate(kept)
