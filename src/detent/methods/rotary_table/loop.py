"""Exact model of the position loop: a held speed word before a velocity loop of first order.

    x' = w        w' = (g·u - w)/tau        u = Kp·(c - x)    at each strobe, acting a delay later, held

x, c : angle and interpolated target [rad]        w, u : speed and speed signal S4 [rad/s]
g    : 1 - droop                                  tau  : time constant of the velocity loop [s]

The word is not rounded and the amplifier not at its limit. The state at a strobe is (x, w, u of the strobe before).
"""

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from detent.analysis.linear_system import LinearSystem

LONGEST = 20.0  # time constants after which the loop has forgotten everything

STEPS = 6_000  # strobes that are followed at most; a loop slower than that does not notice a longer strobe period


@dataclass(frozen=True, slots=True)
class HeldLoop:
    """The loop."""

    gain: float  # Kp [1/s]
    share: float  # g, the share of its reference that the speed reaches
    time_constant: float  # of the velocity loop, tau [s]
    period: float  # and delay: of the strobe, and from it to the interrupt, which is shorter [s]
    delay: float  # [s]

    def _coefficients(self, time: float) -> tuple[float, float, float, float]:
        """What a stretch of time makes of speed and signal: (x from w, x from u, w from w, w from u)."""
        lost = -math.expm1(-time / self.time_constant)
        run_out = self.time_constant * lost
        return run_out, self.share * (time - run_out), 1.0 - lost, self.share * lost

    def open_loop(self) -> "LinearSystem":
        """The loop cut open at the speed signal u, as matrices over the state (x, w, u of the strobe before)."""
        import numpy as np

        from detent.analysis.linear_system import LinearSystem

        x_w, x_u, w_w, w_u = self._coefficients(self.delay)
        old = np.array([[1.0, x_w, x_u], [0.0, w_w, w_u], [0.0, 0.0, 0.0]])
        x_w, x_u, w_w, w_u = self._coefficients(self.period - self.delay)
        new = np.array([[1.0, x_w, 0.0], [0.0, w_w, 0.0], [0.0, 0.0, 0.0]])
        signal, out = np.array([[x_u], [w_u], [1.0]]), np.array([[self.gain, 0.0, 0.0]])
        d = np.zeros((1, 1))
        return LinearSystem(a=new @ old, b=signal, c=out, d=d, dt=self.period, name="position loop")

    def eigenvalues(self) -> Any:
        """Factors by which the modes change from strobe to strobe, shape (3,)."""
        import numpy as np

        return np.linalg.eigvals(self.open_loop().closed().a)

    @property
    def spectral_radius(self) -> float:
        """Largest factor by which a mode changes from strobe to strobe: below 1 the loop is stable."""
        return max(abs(complex(value)) for value in self.eigenvalues())

    @property
    def damping(self) -> float:
        """Damping ratio of the least damped oscillatory mode; 1 where none does, below 0 where one grows."""
        least = 1.0
        for value in self.eigenvalues():
            factor = complex(value)
            pole = complex(math.log(max(abs(factor), 1e-300)), math.atan2(factor.imag, factor.real))
            if pole.imag != 0.0:
                least = min(least, -pole.real / abs(pole))
        return least

    def largest_gain(self, damping: float) -> float:
        """Largest Kp with at least this damping [1/s], within a few millionths; 0 gives the limit of stability."""
        low = high = self.gain
        while replace(self, gain=low).damping < damping:
            low /= 2
        while replace(self, gain=high).damping >= damping:
            high *= 2
        while high > low * (1 + 1e-6):
            middle = math.sqrt(low * high)
            low, high = (middle, high) if replace(self, gain=middle).damping >= damping else (low, middle)
        return low

    def stop(self, ramp: float) -> tuple[float, float]:
        """Follow a target that is slowed down to rest, by 1 rad/s^2.

        By the symmetry of the loop the same figures tell by how much more than in the steady state the table lags
        after an acceleration.

        Way by which the table passes its target [rad], 0 or more; largest acceleration on the way [rad/s^2].
        """
        slowest = LONGEST * (self.time_constant + 1.0 / (self.gain * self.share))
        ramp = min(ramp, slowest)
        period = max(self.period, (ramp + slowest) / STEPS)
        before, after = self._coefficients(self.delay), self._coefficients(period - self.delay)
        speed = w = ramp
        u = speed / self.share
        error = u / self.gain - speed * period
        passed = hardest = 0.0
        for _ in range(math.ceil((ramp + slowest) / period)):
            # The target moves on; the signal that follows from it acts after the delay, until then the one before.
            speed = max(0.0, speed - period)
            error += speed * period
            signal = self.gain * error
            travel, w = before[0] * w + before[1] * u, before[2] * w + before[3] * u
            u = signal
            hardest = max(hardest, abs(self.share * u - w) / self.time_constant)
            travel, w = travel + after[0] * w + after[1] * u, after[2] * w + after[3] * u
            error -= travel
            if speed == 0.0:
                passed = max(passed, -error)
        return passed, hardest
