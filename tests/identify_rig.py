"""Recordings of axes whose constants are known, made by arithmetic or by the compiled simulation."""

from dataclasses import dataclass, field, replace

import numpy as np

from detent.identify.fit.equations import Run
from detent.logs.log import Finding, Log

STEP = 2e-3
"""Time between two samples [s]."""

TRUTH = {
    "mass": 2.0,
    "coulomb.positive": 1.6,
    "coulomb.negative": 1.2,
    "viscous.positive": 6.0,
    "viscous.negative": 4.5,
}
"""An axis with friction of each direction [kg, N, N*s/m]."""

SYMMETRIC = TRUTH | {"coulomb.negative": 1.6, "viscous.negative": 6.0}


@dataclass
class Recorder:
    """Records an axis that moves by sines and needs exactly the force that its constants say.

    Attributes
    ----------
    truth : dict
        Constants; `excess` [N] over Coulomb friction at standstill fades with `stribeck` [m/s].
    seconds, step : float
        Length and period of the recording [s].
    delay : float
        By how much later the force acts than it stands in the recording [s].
    force_noise : float
        Standard deviation of white noise of the force [N].
    position_noise : float
        The same of the position [m].
    count : float
        Way of a count of the encoder; 0 for none.
    """

    truth: dict[str, float] = field(default_factory=lambda: dict(TRUTH))
    seconds: float = 10.0
    step: float = STEP
    delay: float = 0.0
    force_noise: float = 0.02
    position_noise: float = 0.0
    count: float = 0.0
    seed: int = 1
    excess: float = 0.0
    stribeck: float = 0.02

    hertz = np.array([0.23, 0.61, 1.3])
    sizes = np.array([0.06, 0.025, 0.008])

    def motion(self, t):
        """Position, velocity and acceleration, exactly."""
        w = 2 * np.pi * self.hertz
        angle = np.outer(t, w) + np.array([0.3, 1.1, 2.0])
        return (
            np.sin(angle) @ self.sizes,
            np.cos(angle) @ (self.sizes * w),
            -np.sin(angle) @ (self.sizes * w**2),
        )

    def force(self, t):
        """Force that this motion needs."""
        _, v, a = self.motion(t)
        c = self.truth
        fade = 1.0 + self.excess / c["coulomb.positive"] * np.exp(-((v / self.stribeck) ** 2))
        right = c["coulomb.positive"] * fade + c["viscous.positive"] * v
        left = -c["coulomb.negative"] * fade + c["viscous.negative"] * v
        return c["mass"] * a + np.where(v > 0, right, left)

    def columns(self):
        """Time, reference, position and force as they are recorded; a force stands until the next sample."""
        rng = np.random.default_rng(self.seed)
        t = np.arange(round(self.seconds / self.step)) * self.step
        reference = self.motion(t)[0]
        position = reference + self.position_noise * rng.standard_normal(len(t))
        if self.count:
            position = self.count * np.rint(position / self.count)
        force = self.force(t + 0.5 * self.step + self.delay) + self.force_noise * rng.standard_normal(len(t))
        return t, reference, position, force

    def run(self, *, with_reference: bool = True) -> Run:
        """The recording as a run."""
        _, reference, position, force = self.columns()
        return Run(
            "made.csv",
            self.step,
            position,
            force,
            np.ones(len(position), bool),
            reference=reference if with_reference else None,
            resolution=self.count,
            noise=max(self.position_noise, 0.29 * self.count),
        )

    def log(self, *, with_reference: bool = True) -> Log:
        """The recording as a log."""
        t, reference, position, force = self.columns()
        signals = {"position": position, "force": force}
        return make_log(t, signals | ({"reference": reference} if with_reference else {}))


UNITS = {"position": "m", "reference": "m", "position_load": "m", "force": "N", "torque": "N*m", "voltage": "V"}


def make_log(t, signals, units=None, findings: tuple[Finding, ...] = ()) -> Log:
    """A log of signals in SI units; rows are numbered from 1."""
    t = np.asarray(t, float)
    values = {name: np.asarray(series, float) for name, series in signals.items()}
    known = {"time": "s"} | {name: UNITS.get(name, "") for name in signals} | (units or {})
    return Log("made.csv", t, values, known, {}, np.arange(1, len(t) + 1), findings)


def changed(log: Log, **signals) -> Log:
    """The log with other values of some signals."""
    return replace(log, signals=log.signals | signals)


def binomial_bounds(cases: int, share: float = 0.95, doubt: float = 1e-4) -> tuple[float, float]:
    """Shares that chance leaves, but for a probability `doubt`, if each of so many cases holds as often as `share`."""
    from scipy.stats import binom

    low, high = binom.ppf(0.5 * doubt, cases, share), binom.ppf(1.0 - 0.5 * doubt, cases, share)
    return float(low) / cases, float(high) / cases
