"""What recorded positions say about motion: velocities, the one at the begin, and a reference to be followed."""

import math
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.planning.profile import Profile, profile_of_recording

CUTOFF = 100.0
"""Velocities that were not recorded, and accelerations, are those of positions low-passed at this frequency, both alike
[Hz]; at most a fifth of the sample rate."""

START_SPAN, START_SAMPLES = 0.012, 8
"""Time from which the velocity at the begin is taken [s], and its samples at least."""

STILL = 5
"""Samples on both sides through which a recorded reference that stands does not change."""

Numbers = NDArray[np.float64]


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
