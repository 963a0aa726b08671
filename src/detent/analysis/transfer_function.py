"""Transfer function of a position servo with filtered speed feedback, all in continuous time (filtered-servo spec 3.6).

    G(s) = x/X = 1/[ s²/(K1·K) + (K2/K1)·s/(Tf·s + 1) + 1 ]

X, x : command and position [count]
K1   : position gain, drive word per count of following error
K2   : speed gain [s], drive word per count per second of speed; B·TS where the speed is counted over a window TS
K    : K3·K4 [1/s²], drive word to acceleration in counts
Tf   : lag of the filter in the speed path [s]; 0 without filter

While Tf and the time the inertia takes are short against K2/K1, G is a first-order lag of K2/K1 whose reciprocal is the
velocity-error constant. Windows and holds are not in it: `sampled_loop` has them.
"""

from dataclasses import asdict, dataclass
from math import sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from detent.analysis.arguments import check_constants


@dataclass(frozen=True, slots=True, kw_only=True)
class ServoTransfer:
    """Position servo with a first-order lag in its speed feedback.

    A constant that is not above 0 (`filter_time`: below 0), or not finite, is a `DetentError`.

    Attributes
    ----------
    gain : float
        K = K3·K4, drive word to acceleration [1/s²].
    speed_gain : float
        K2 [s].
    filter_time : float
        Tf [s]; 0 without filter.
    position_gain : float
        K1.

    >>> servo = ServoTransfer(gain=1e6, speed_gain=0.02, filter_time=1e-3)
    >>> round(float(servo.poles()[0].real), 2), servo.first_order_pole, round(servo.next_order_pole, 2)
    (-47.72, -50.0, -47.62)
    """

    gain: float
    speed_gain: float
    filter_time: float = 0.0
    position_gain: float = 1.0

    def __post_init__(self) -> None:
        """Refuse constants that describe no servo."""
        check_constants("ServoTransfer.", **asdict(self))

    @classmethod
    def of_window(
        cls, *, gain: float, sample_period: float, scale: float, coefficient: float = 1.0, position_gain: float = 1.0
    ) -> "ServoTransfer":
        """The servo whose speed is counted over a window: K2 = B·TS and Tf = TS/A.

        TS is `sample_period` [s]; B is `scale`, by which the count of a window is multiplied; A is `coefficient`,
        0 < A <= 1, and 1 is no filter and gives Tf = 0. K2 and Tf are proportional to the sample period, so that
        Tf/(K2/K1) = K1/(A·B) does not depend on it.

        >>> ServoTransfer.of_window(gain=4000, sample_period=5e-3, scale=4, coefficient=0.25).filter_ratio
        1.0
        """
        check_constants(sample_period=sample_period, scale=scale, coefficient=coefficient)
        lag = sample_period / coefficient if coefficient < 1 else 0.0
        return cls(gain=gain, speed_gain=scale * sample_period, filter_time=lag, position_gain=position_gain)

    @property
    def lag(self) -> float:
        """K2/K1 [s], the time constant of the first-order form: following error per speed."""
        return self.speed_gain / self.position_gain

    @property
    def velocity_error_constant(self) -> float:
        """KV = K1/K2 [1/s]: speed over steady following error, for a drive that needs no error to hold a speed."""
        return self.position_gain / self.speed_gain

    @property
    def first_order_pole(self) -> float:
        """-K1/K2 [1/s], the pole of the first-order form."""
        return -self.velocity_error_constant

    @property
    def next_order_pole(self) -> float:
        """-1/(K2/K1 + Tf) [1/s]: what the lag of the filter makes of the first-order pole."""
        return -1.0 / (self.lag + self.filter_time)

    @property
    def filter_ratio(self) -> float:
        """Tf/(K2/K1). The first-order form asks for much less than 1."""
        return self.filter_time / self.lag

    @property
    def inertia_ratio(self) -> float:
        """sqrt(1/(K1·K))/(K2/K1). The first-order form asks for much less than 1, so that s² is nothing at its pole."""
        return sqrt(1.0 / (self.position_gain * self.gain)) / self.lag

    def denominator(self) -> NDArray[np.float64]:
        """Polynomial whose roots are the poles: Tf·s³/K + s²/K + (K2 + K1·Tf)·s + K1.

        Coefficients from the highest power down; shape (4,), without filter (3,).
        """
        inertia = 1.0 / self.gain
        damping = self.speed_gain + self.position_gain * self.filter_time
        cubic = [self.filter_time * inertia] if self.filter_time > 0 else []
        return np.array([*cubic, inertia, damping, self.position_gain])

    def poles(self) -> NDArray[np.complex128]:
        """Poles of G [1/s], the slowest to decay first, of a pair the one above the real axis.

        Shape (3,), without filter (2,).
        """
        return slowest_first(np.roots(self.denominator()).astype(np.complex128))

    def response(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
        """G at frequencies of any shape [Hz]: position over command, complex numbers in the same shape."""
        s = _s(frequency_hz)
        return self.position_gain * (self.filter_time * s + 1.0) / np.polyval(self.denominator(), s)

    def first_order_response(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
        """What the first-order form 1/((K2/K1)·s + 1) gives instead of `response`."""
        return 1.0 / (self.lag * _s(frequency_hz) + 1.0)


def slowest_first(poles: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Poles by rate of decay, the slowest first; of a pair the one above the real axis first.

    >>> slowest_first(np.array([-3, -1 - 2j, -1 + 2j])).tolist()
    [(-1+2j), (-1-2j), (-3+0j)]
    """
    return poles[np.lexsort((-poles.imag, -poles.real))]


def _s(frequency_hz: ArrayLike) -> NDArray[np.complex128]:
    """The imaginary axis: s = j·2·pi·f."""
    return np.asarray(frequency_hz, dtype=np.complex128) * 2j * np.pi
