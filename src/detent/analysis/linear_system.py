"""A sampled linear system as matrices, and the margins of a loop that is cut open.

    x(k+1) = A x(k) + B w(k)        y(k) = C x(k) + D w(k)

Of a loop cut open, w goes in behind the cut and y comes out before it with its sign turned: w = -y closes it, and
L(z) = C (z - A)^-1 B + D is its gain.

A margin holds for everything: Ms, the largest sensitivity, is the inverse of the least distance of L from -1, which
needs no crossing to be seen (Astrom, Hagglund 2006, Advanced PID Control, section 4.6). It guarantees a gain margin of
Ms/(Ms - 1) and a phase margin of 2 asin(1/(2 Ms)).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from detent.errors import DetentError

Numbers = NDArray[np.float64]
Phasors = NDArray[np.complex128]
Respond = Callable[[Numbers], Phasors]  # response at frequencies [Hz], shape (n,)

GRID = 4000  # frequencies at which a loop is looked at, evenly spaced on a logarithmic scale
DECADES = 6  # of frequency, below half the sample rate
AROUND = 40  # more of them inside each resonance
ZOOM, ZOOMS = 65, 3  # points and times by which a crossing or a peak is looked at closer: to some 1e-8 of the frequency
MOST_ELEMENTS = 4_000_000  # of matrices that are solved at once


class Margins(NamedTuple):
    """What a loop that is cut open leaves; where it never crosses a gain of 1 there is nothing to lose."""

    crossover: float  # frequency at which the gain first falls below 1 [Hz]; 0 where it never does
    phase: float  # smallest phase margin over all crossings [rad]; pi where there is none
    gain: float  # smallest factor above 1 of the gain at which L passes -1; infinite where there is none
    delay: float  # dead time that may be added until it no longer settles [s]; infinite where there is none
    sensitivity: float  # Ms, largest magnitude of 1/(1 + L)
    peak: float  # frequency of it [Hz]
    least: float = 0.0  # largest factor below 1 of the gain at which L passes -1; 0 where there is none


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
        modes = np.linalg.eigvals(self.a)
        modes = modes[(np.abs(modes) > 0.5) & (modes.imag > 0.0)]
        rates = np.log(modes) / (2 * np.pi * self.dt)
        more = [rate.imag + np.linspace(-4.0, 4.0, AROUND) * max(-rate.real, 1e-6 * rate.imag) for rate in rates]
        grid = np.concatenate([usual_frequencies(self.dt), *more])
        return np.unique(grid[(grid > 0.0) & (grid < 0.5 / self.dt)])

    def margins(self) -> Margins:
        """Margins, where the system is a loop that is cut open."""
        return margins_of(self.response, self.frequencies(), self.dt)

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
        return _crossing(self.response, lambda found: _level(found) - math.log(limit), float(low), float(high))

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


def usual_frequencies(dt: float) -> Numbers:
    """Frequencies of an open loop that is sampled every `dt` [s], up to half the sample rate [Hz], shape (GRID,)."""
    highest = math.log10(0.5 / dt)
    return np.logspace(highest - DECADES, highest, GRID, endpoint=False)


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


def margins_of(respond: Respond, frequencies: Numbers, dt: float) -> Margins:
    """Margins of an open loop: looked for on a grid of frequencies [Hz], each then looked at closer."""
    frequencies = np.append(frequencies, 0.5 / dt)  # an alternating mode is lost there
    loop = respond(frequencies)
    gain = _level(loop)
    places = _changes(gain)
    crossings = [_crossing(respond, _level, frequencies[k], frequencies[k + 1]) for k in places]
    turns = [k for k in _changes(loop.imag) if loop.real[k] < 0.0]
    real = [respond(np.array([_crossing(respond, np.imag, frequencies[k], frequencies[k + 1])]))[0].real for k in turns]
    real.append(loop[-1].real)
    factors = [-1.0 / float(value) for value in real if value < 0.0]
    more, less = [one for one in factors if one > 1.0], [one for one in factors if one < 1.0]
    falling = [one for one, k in zip(crossings, places, strict=True) if gain[k] >= 0.0]
    phases = [math.remainder(float(np.angle(-respond(np.array([one]))[0])), math.tau) for one in crossings]
    late = [(phase % math.tau) / (math.tau * one) for phase, one in zip(phases, crossings, strict=True)]
    level, peak = largest_level(lambda at: _sensitivity(respond(at)), frequencies, _sensitivity(loop))
    crossover = falling[0] if falling else 0.0
    phase = min(phases, key=abs) if falling else math.pi
    gains = min(more, default=math.inf), max(less, default=0.0)
    return Margins(crossover, phase, gains[0], min(late, default=math.inf), level, peak, gains[1])


def _changes(values: Numbers) -> list[int]:
    """Places before a change of sign."""
    return np.flatnonzero(np.signbit(values[1:]) != np.signbit(values[:-1])).tolist()


def _level(loop: Phasors) -> Numbers:
    return np.log(np.maximum(np.abs(loop), 1e-300))


def _crossing(respond: Respond, part: Callable[[Phasors], Numbers], low: float, high: float) -> float:
    """Frequency between two at which a part of the response changes its sign [Hz]."""
    for _ in range(ZOOMS):
        grid = np.geomspace(low, high, ZOOM)
        below = np.signbit(part(respond(grid)))
        # An end may have come to lie on the other side by rounding.
        first = int(np.argmax(below != below[0])) or 1
        low, high = float(grid[first - 1]), float(grid[first])
    return math.sqrt(low * high)


def largest_level(
    level: Callable[[Numbers], Numbers], frequencies: Numbers, levels: Numbers | None = None
) -> tuple[float, float]:
    """Largest value of a positive function of frequency, looked for on a grid [Hz], and where it lies [Hz].

    `levels` are its values on the grid, where they are known already.
    """
    levels = level(frequencies) if levels is None else levels
    for _ in range(ZOOMS):
        top = int(np.argmax(levels))
        low, high = float(frequencies[max(top - 1, 0)]), float(frequencies[min(top + 1, len(frequencies) - 1)])
        frequencies = np.geomspace(low, high, ZOOM, dtype=np.float64)
        levels = level(frequencies)
    top = int(np.argmax(levels))
    return float(levels[top]), float(frequencies[top])


def _sensitivity(loop: Phasors) -> Numbers:
    return 1.0 / np.maximum(np.abs(1.0 + loop), 1e-300)
