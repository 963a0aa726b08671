"""Pull-out torque of a stepper against its step frequency, in the three ways it is known.

Pull-out torque is the most a motor that is in step can drive without falling out of it. It falls with the frequency,
because coil current rises at a limited rate and the rotor's own voltage opposes it. Known are the form of
stepper-envelope specification 3.1, the constants of the winding, or points read from a published curve.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import hypot, pi, sqrt

FIRST_HARMONIC = 4 / pi  # fundamental of a square wave of amplitude 1: full steps switch each coil so
PullOut = Callable[[float], float]  # pull-out torque [N m] at a step frequency [Hz]; 0 where the motor drives nothing


@dataclass(frozen=True, slots=True)
class FirstOrderPullOut:
    """T_po0 / sqrt(1 + (f/f_c)^2), stepper-envelope specification 3.1."""

    torque: float  # pull-out torque at standstill T_po0 [N m]
    corner_hz: float  # step frequency at which it has fallen to 1/sqrt 2 [Hz]

    def __call__(self, hz: float) -> float:
        """Pull-out torque at `hz` [N m]."""
        return self.torque / hypot(1.0, hz / self.corner_hz)


@dataclass(frozen=True, slots=True)
class WindingPullOut:
    """Two-phase hybrid or permanent-magnet motor on a supply of limited voltage and current.

    With the rotor's linked flux times teeth ``k = T_hold / (sqrt 2 I_rated)``, the electrical frequency
    ``w = 2 pi f / 4`` and ``Z = sqrt(R^2 + (w L)^2)``, a voltage drive pulls out at ``k (V / Z - w psi R / Z^2)``
    (P. Acarnley, Stepping Motors, 4th ed., IEE 2002, chapter 5), V the fundamental of the square wave and psi the flux.
    A chopper holds the current, and with it the torque, to ``k I`` below the frequency where the voltage no longer
    reaches it. Measured curves lie below this by the ripple and the resonances of a real drive: that is what the
    safety factor of the ramp is for.
    """

    holding_torque: float  # both phases at the rated current [N m]
    rated_current: float  # and current: rated, and set at the drive, per phase [A]
    current: float  # [A]
    supply: float  # voltage that drives the current [V]
    resistance: float  # winding and drive, per phase [ohm]
    inductance: float  # per phase [H]
    teeth: float  # rotor teeth, a quarter of the steps per turn

    @property
    def per_current(self) -> float:
        """Torque per current of one phase at its best angle [N m/A]."""
        return self.holding_torque / (sqrt(2) * self.rated_current)

    def __call__(self, hz: float) -> float:
        """Pull-out torque at `hz` [N m]."""
        omega = 2 * pi * hz / 4
        impedance = hypot(self.resistance, omega * self.inductance)
        flux = self.per_current / self.teeth
        driven = FIRST_HARMONIC * self.supply / impedance - omega * flux * self.resistance / impedance**2
        return self.per_current * max(min(FIRST_HARMONIC * self.current, driven), 0.0)


@dataclass(frozen=True, slots=True)
class MeasuredPullOut:
    """Points of a published curve, straight lines between them."""

    # step frequencies, rising [Hz]; below the first one its torque holds, above the last there is none
    hz: Sequence[float]
    torque: Sequence[float]  # pull-out torque at each [N m]

    def __call__(self, hz: float) -> float:
        """Pull-out torque at `hz` [N m]."""
        if hz <= self.hz[0]:
            return self.torque[0]
        for (f0, t0), (f1, t1) in pairwise(zip(self.hz, self.torque, strict=True)):
            if hz <= f1:
                return t0 + (t1 - t0) * (hz - f0) / (f1 - f0)
        return 0.0
