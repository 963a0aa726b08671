"""A sampled linear system as matrices, and the margins of a loop that is cut open.

    x(k+1) = A x(k) + B w(k)        y(k) = C x(k) + D w(k)

Of a loop cut open, w goes in behind the cut and y comes out before it with its sign turned: w = -y closes it, and
L(z) = C (z - A)^-1 B + D is its gain.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from detent.analysis.margins import Margins, around, crossing, largest_level, margins_of, one_of, usual_frequencies
from detent.errors import DetentError

Numbers = NDArray[np.float64]
Phasors = NDArray[np.complex128]
Respond = Callable[[Numbers], Phasors]  # response at frequencies [Hz], shape (n,)

MOST_ELEMENTS = 4_000_000  # of matrices that are solved at once


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LinearSystem:
    """A sampled linear system with one input and one output.

    Attributes
    ----------
    a, b, c, d : ndarray
        Matrices, shapes (n, n), (n, 1), (1, n), (1, 1).
    dt : float
        Sample period [s].
    name : str
        What it is.
    quick : callable, optional
        The same response at frequencies [Hz], shape (n,), from a form that takes less time than the matrices.
    known : callable, optional
        Gives its margins, where they are found together with those of other cuts.

    >>> import numpy as np
    >>> one = np.eye(1)
    >>> integrator = LinearSystem(a=one, b=0.1 * one, c=one, d=0 * one, dt=1e-3, name="integrator")
    >>> round(integrator.margins().crossover, 2), round(integrator.margins().gain, 3)
    (15.92, 20.0)
    """

    a: Numbers
    b: Numbers
    c: Numbers
    d: Numbers
    dt: float
    name: str
    quick: Respond | None = None
    known: Callable[[], Margins] | None = None

    def response(self, frequencies: ArrayLike) -> Phasors:
        """Response y/w at frequencies [Hz] below half the sample rate, shape as given."""
        asked = np.asarray(frequencies, dtype=np.float64)
        if self.quick is not None:
            return self.quick(asked.ravel()).reshape(asked.shape)
        z = np.exp(2j * np.pi * self.dt * asked.ravel())
        size = len(self.a)
        found = np.empty(len(z), dtype=np.complex128)
        rows = max(1, MOST_ELEMENTS // (size * size))
        for first in range(0, len(z), rows):
            part = z[first : first + rows]
            through = part[:, None, None] * np.eye(size) - self.a
            states = np.linalg.solve(through, np.broadcast_to(self.b, (len(part), size, 1)).astype(np.complex128))
            found[first : first + rows] = (self.c @ states)[:, 0, 0] + self.d[0, 0]
        return found.reshape(asked.shape)

    def frequencies(self) -> Numbers:
        """Where it is looked at: a logarithmic grid up to half the sample rate, finer around each resonance [Hz]."""
        grid = np.concatenate([usual_frequencies(self.dt), self._resonances])
        return np.unique(grid[grid < 0.5 / self.dt])

    @property
    def _resonances(self) -> Numbers:
        """Frequencies inside the resonances [Hz]."""
        modes = np.linalg.eigvals(self.a).astype(np.complex128)
        modes = modes[(np.abs(modes) > 0.5) & (modes.imag > 0.0)]
        rates: Any = np.log(modes) / self.dt
        return around(rates, self.dt)

    def margins(self) -> Margins:
        """Margins, where the system is a loop that is cut open."""
        if self.known is not None:
            return self.known()

        def respond(frequencies: Numbers, _: Any) -> Phasors:
            return self.response(np.atleast_2d(frequencies))[None]

        return one_of(margins_of(respond, self._resonances[None], self.dt)[0])

    def closed(self, gain: float = 1.0) -> "LinearSystem":
        """The loop closed with so much more gain: T = L/(1 + L), from what is put in at the cut to what comes back."""
        inverse = 1.0 / (1.0 + gain * self.d[0, 0])
        a = self.a - gain * inverse * (self.b @ self.c)
        b, c, d = gain * inverse * self.b, inverse * self.c, gain * inverse * self.d
        return LinearSystem(a=a, b=b, c=c, d=d, dt=self.dt, name=f"{self.name}, closed")

    @property
    def peak(self) -> tuple[float, float]:
        """Largest magnitude, and its frequency [Hz]."""
        return largest_level(lambda at: np.abs(self.response(at)), self.frequencies())

    @property
    def bandwidth(self) -> float:
        """Frequency above which the magnitude stays below that at rest over sqrt(2) [Hz]; of T, of a closed loop."""
        frequencies = self.frequencies()
        limit = abs(self.response(frequencies[:1])[0]) / math.sqrt(2.0)
        above = np.flatnonzero(np.abs(self.response(frequencies)) >= limit)
        if above[-1] + 1 == len(frequencies):
            return 0.5 / self.dt
        low, high = frequencies[above[-1]], frequencies[above[-1] + 1]
        return crossing(lambda at: np.abs(self.response(at)) - limit, float(low), float(high))

    @property
    def spectral_radius(self) -> float:
        """Largest factor by which a mode changes from sample to sample: below 1 the system is stable."""
        return float(np.max(np.abs(np.linalg.eigvals(self.a))))

    def to_scipy(self) -> Any:
        """Give the system as a ``scipy.signal.StateSpace``, a discrete one with its `dt`."""
        return import_module("scipy.signal").StateSpace(self.a, self.b, self.c, self.d, dt=self.dt)

    def to_control(self) -> Any:
        """Give the system as a ``control.StateSpace``; a `DetentError` where python-control is not installed."""
        try:
            control: Any = import_module("control")
        except ImportError as error:
            raise DetentError(
                'this needs python-control, which is not installed; try: pip install "detent[control]", or '
                "take to_scipy()"
            ) from error
        return control.StateSpace(self.a, self.b, self.c, self.d, self.dt, name=self.name.replace(" ", "_"))


def gain_limit(radius: Callable[[float], float], largest: float, step: float = 1.2) -> float:
    """Factor of the gain at which the spectral radius of a closed loop, given by its gain, leaves or enters 1.

    It is approached from a factor of 1 in such steps, as an integral in both loops makes a loop that settles neither
    with much nor with little gain.
    """
    settles = radius(1.0) < 1.0
    step = step if settles else 1.0 / step
    near = 1.0
    while 1.0 / largest < near < largest:
        far = near * step
        if (radius(far) < 1.0) != settles:
            break
        near = far
    else:
        return largest if settles else 0.0
    low, high = min(near, far), max(near, far)
    while high > low * 1.0001:
        middle = math.sqrt(low * high)
        low, high = (middle, high) if radius(middle) < 1.0 else (low, middle)
    return low
