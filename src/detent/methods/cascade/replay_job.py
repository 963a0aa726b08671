"""A recording as the job of an axis: what was asked, what was measured, what drove it, and how it moved."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.errors import DetentError
from detent.logs.roles import EFFORTS
from detent.methods.cascade.schema import CascadeSpec
from detent.planning.profile import Profile, profile_of_recording

Numbers = NDArray[np.float64]

CUTOFF = 100.0
"""Velocities that were not recorded, and accelerations, are those of positions low-passed at this frequency, both alike
[Hz]; at most a fifth of the sample rate."""

START_SPAN, START_SAMPLES = 0.012, 8  # time from which the velocity at the begin is taken [s], and its samples at least
STILL = 5  # samples on both sides through which a recorded reference that stands does not change


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ReplayJob:
    """A recording, as far as an axis can replay it; arrays of shape (n,), n >= 3, all finite.

    Attributes
    ----------
    name : str
        Name of the log.
    t : ndarray
        Time [s], strictly increasing.
    position : ndarray
        As measured [m]; of a rotary axis [rad].
    reference : ndarray, optional
        Position asked for [m]; without one the recorded effort drives the axis.
    velocity : ndarray, optional
        As measured [m/s].
    load_position : ndarray, optional
        By a second encoder [m].
    efforts : dict of str to ndarray
        What drove the axis: force [N], torque [N m], current [A], voltage [V], command [V].
    notes : tuple of str
        What was found wrong with the log, and what was guessed.

    Raises
    ------
    DetentError
        There is neither a reference nor an effort, or the arrays do not fit together.
    """

    name: str
    t: Numbers
    position: Numbers
    reference: Numbers | None = None
    velocity: Numbers | None = None
    load_position: Numbers | None = None
    efforts: dict[str, Numbers] = field(default_factory=dict[str, Numbers])
    notes: tuple[str, ...] = ()
    kind: str = "replay"

    def __post_init__(self) -> None:
        """Refuse what no axis could replay."""
        present = [self.t, self.position, *self.efforts.values()]
        present += [x for x in (self.reference, self.velocity, self.load_position) if x is not None]
        if len(self.t) < 3 or any(x.shape != self.t.shape for x in present):
            shapes = ", ".join(str(x.shape) for x in present)
            raise DetentError(f"{self.name}: came signals of shapes {shapes}; allowed: all (n,) with n 3 or more")
        if not (np.diff(self.t) > 0).all() or not all(np.isfinite(x).all() for x in present):
            raise DetentError(
                f"{self.name}: came a time that does not rise, or values that are not finite; allowed: a rising time, "
                "finite values; read the log with detent.identify first"
            )
        if self.reference is None and not self.efforts:
            raise DetentError(
                f"{self.name}: came neither a reference nor a force, current, voltage or command; allowed: one of them "
                "beside the position; name its column: --column 'reference=COLUMN [mm]'"
            )

    @property
    def seconds(self) -> float:
        """Length of the recording [s]."""
        return float(self.t[-1] - self.t[0])


def make_replay_job(
    spec: CascadeSpec,
    name: str,
    t: Numbers,  # time [s], shape (n,)
    signals: Mapping[str, tuple[Numbers, str]],
    notes: Sequence[str] = (),
) -> ReplayJob:
    """The recording of an axis, as its job."""
    if "position" not in signals:
        came = ", ".join(signals) or "no signal"
        raise DetentError(
            f"{name}: came {came}; allowed: a log with a position; name its column: --column 'position=COLUMN [mm]'"
        )
    way = spec.unit("m")
    example = "deg" if way == "rad" else "mm"
    for role, (_, unit) in signals.items():
        kind = unit.partition("/")[0]
        if kind in {"m", "rad", "count"} and kind != way:
            raise DetentError(
                f"{name}: came {role} in {unit}; allowed: {way}, as the axis is a {spec.axis.motion} one; state the "
                f"unit of its column, a number before it for counts: --column '{role}=COLUMN [{example}]'"
            )
    values = {role: found for role, (found, _) in signals.items()}
    return ReplayJob(
        name=name,
        t=t,
        position=values["position"],
        reference=values.get("reference"),
        velocity=values.get("velocity"),
        load_position=values.get("position_load"),
        efforts={role: values[role] for role in EFFORTS if role in values},
        notes=tuple(notes),
    )


# ---- how it moved


def recorded_profile(t: Numbers, reference: Numbers, period: float) -> Profile:
    """A recorded reference at the samples of the loops, with its derivatives.

    They are those of a spline, which rings by a hair where the reference stands: a feed-forward against Coulomb
    friction would jump to and fro. Where the recording stands for `STILL` samples on both sides they are 0.
    """
    found = profile_of_recording(t, reference, period)
    moves = np.convolve(np.diff(reference) != 0.0, np.ones(2 * STILL), mode="full")[STILL - 1 :][: len(reference)]
    nearest = np.searchsorted(t, float(t[0]) + (np.arange(found.count) - 0.5) * period).clip(max=len(t) - 1)
    stands = moves[nearest] < 0.5
    return replace(
        found,
        velocity=np.where(stands, 0.0, found.velocity),
        acceleration=np.where(stands, 0.0, found.acceleration),
    )


def starting_velocity(t: Numbers, position: Numbers) -> float:
    """Velocity at the begin of a recording [m/s]."""
    begin = float(t[0])
    count = max(START_SAMPLES, int(np.searchsorted(t, begin + START_SPAN, side="right")))
    if len(t) <= count:
        return 0.0
    at, q = t[:count] - begin, position[:count]
    fitted, covariance = np.polyfit(at, q, 3, cov=True)
    slope, reached = float(fitted[2]), float(np.abs(np.diff(q) / np.diff(at)).max())
    least = max(5 * math.sqrt(max(float(covariance[2, 2]), 0.0)), 0.1 * reached)
    return slope if abs(slope) > least else 0.0


def smooth_velocity(t: Numbers, position: Numbers) -> Numbers:
    """Velocity of recorded positions: low-passed forwards and backwards, then central differences [m/s]."""
    signal: Any = import_module("scipy.signal")  # it states no types
    rate = (len(t) - 1) / float(t[-1] - t[0])
    numerator, denominator = signal.butter(4, min(CUTOFF, 0.2 * rate) / (0.5 * rate))
    reach = 3 * max(len(numerator), len(denominator))
    smooth = signal.filtfilt(numerator, denominator, position) if len(t) > reach else position
    return np.asarray(np.gradient(smooth, t), np.float64)
