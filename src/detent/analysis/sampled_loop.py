"""Exact model of a sampled speed loop around a continuous position error (filtered-servo spec 3.7).

    x'' = K·E - x'/tau_m      E = K1·P - y      P = X - x
    y   = A·B·(x(k) - x(k-1)) + (1 - A)·y       at each sample instant, held until the next

X, x  : command and position [count]        P : following error [count]
y, E  : speed word and drive word [count]
K     : drive word to acceleration [1/s²]   tau_m : mechanical time constant [s], inf for an ideal current drive
K1    : position gain                       A, B  : coefficient of the filter, scale of the speed count
TS    : sample period [s]

Counts are not rounded and the drive does not saturate: the model says how the loop moves between those two. The
position error acts at once, the speed as the mean of the window that has just closed; both are advanced over a window
by the matrix exponential, so that no step of time is approximated.
"""

from dataclasses import asdict, dataclass
from importlib import import_module
from math import asin, inf, log, pi, sqrt
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from detent.analysis.arguments import check_constants
from detent.analysis.linear_system import LinearSystem
from detent.analysis.transfer_function import slowest_first
from detent.errors import DetentError

Numbers = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Response:
    """How the loop answered a command: columns of shape (n,) over the time `t` since the first sample instant [s].

    `command` is X and `position` is x [count], `velocity` is x' [count/s], `following_error` is P = X - x [count].
    `speed_word` is y [count], at a sample instant the new word, which acts from there; `drive_word` is E = K1·P - y
    [count].
    """

    t: Numbers
    command: Numbers
    position: Numbers
    velocity: Numbers
    speed_word: Numbers
    following_error: Numbers
    drive_word: Numbers


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledLoop:
    """Position servo whose speed is counted over windows, filtered, and held.

    A constant that is out of range is a `DetentError`.

    Attributes
    ----------
    gain : float
        K = K3·K4, drive word to acceleration [1/s²].
    sample_period : float
        TS, the window of the speed count and the clock of the filter [s].
    scale : float
        B, by which the count of a window is multiplied.
    coefficient : float
        A of the filter, 0 < A <= 1; 1 for no filter.
    tau_m : float
        Mechanical time constant of the axis [s]; infinite for an ideal current drive without viscous friction.
    position_gain : float
        K1.

    >>> loop = SampledLoop(gain=4000, sample_period=5e-3, scale=4, coefficient=0.25)
    >>> loop.is_stable, round(loop.stability_limit()), loop.steady_following_error(1000)
    (True, 10216, 20.0)
    """

    gain: float
    sample_period: float
    scale: float
    coefficient: float = 1.0
    tau_m: float = inf
    position_gain: float = 1.0

    def __post_init__(self) -> None:
        """Refuse constants that describe no loop."""
        check_constants("SampledLoop.", **asdict(self))

    # ------------------------------------------------------------------------------------------------ one window

    def transition(self) -> Numbers:
        """State (x [count], x' [count/s], y [count]) from one sample instant to the next, shape (3, 3).

        The command is at 0.
        """
        return self._window()[:3, :3]

    def open_loop(self) -> LinearSystem:
        """The loop cut open at the speed word y, as matrices over the state (x, x', y)."""
        after = np.zeros((3, 4))
        after[:2, [0, 1, 3]] = self._flow(1.0)[:2, :3]  # the held word is what is put in
        after[2] = self.coefficient * self.scale * (after[0] - np.eye(4)[0])
        after[2, 2] += 1.0 - self.coefficient
        out = np.array([[0.0, 0.0, -1.0]])
        d = np.zeros((1, 1))
        return LinearSystem(a=after[:, :3], b=after[:, 3:], c=out, d=d, dt=self.sample_period, name="speed loop")

    def command_input(self) -> Numbers:
        """What a command adds to the state (x, x', y) over a window, shape (3, 2).

        By the command at the beginning of the window [count], and by its rate in it [count/s].
        """
        return self._window()[:3, 3:]

    def eigenvalues(self) -> NDArray[np.complex128]:
        """Factors by which the modes change from sample to sample, shape (3,)."""
        return np.linalg.eigvals(self.transition()).astype(np.complex128)

    def spectral_radius(self) -> float:
        """Magnitude of the largest eigenvalue: below 1 the loop is stable."""
        return float(np.abs(self.eigenvalues()).max())

    @property
    def is_stable(self) -> bool:
        """Whether every mode decays."""
        return self.spectral_radius() < 1.0

    def poles(self) -> NDArray[np.complex128]:
        """Modes of the loop as in continuous time, ln(z)/TS [1/s], the slowest to decay first, shape (3,).

        A mode that changes its sign at each sample has the imaginary part pi/TS and no partner.

        >>> loop = SampledLoop(gain=4000, sample_period=5e-3, scale=4, coefficient=0.25)
        >>> loop.poles().round(1).tolist()
        [(-8.2+88.8j), (-8.2-88.8j), (-28.3+0j)]
        """
        with np.errstate(divide="ignore"):  # a mode that is gone after one sample: ln(0) is -inf, as it should be
            rates = np.log(self.eigenvalues()) / self.sample_period
        return slowest_first(rates.astype(np.complex128))

    # ------------------------------------------------------------------------------------------ limit of the gain

    def stability_limit(self) -> float:
        """Lowest gain K at which a mode no longer decays [1/s²]; the gain of the loop itself plays no part.

        Infinite where there is none, as with little speed feedback on a strongly damped axis.
        For an ideal current drive cos(TS·sqrt(K1·K)) = 1 - A/(1 + A·B/K1), from Jury's criterion on the characteristic
        polynomial of `transition`. With mechanical damping the first zero of the criterion is searched upwards from
        half of that gain.
        """
        k1, a = self.position_gain, self.coefficient
        turn = 2.0 * asin(sqrt(0.5 * a / (1.0 + a * self.scale / k1)))  # 2·sin²(turn/2) = 1 - cos(turn)
        ideal = turn**2 / k1
        stiffness = ideal if self.tau_m == inf else self._search_limit(ideal)
        return stiffness / self.sample_period**2

    def _search_limit(self, ideal: float) -> float:
        """K·TS² at which the damped loop is lost; `ideal` is where it would be lost without damping."""
        for stretch in self._stretches(0.5 * ideal):
            turn = self._first_zero(stretch)
            if turn < inf:
                around = turn + min(0.03 * turn, 0.05) * np.linspace(-1.0, 1.0, 41)
                refined = self._first_zero(around)
                return (refined if refined < inf else turn) ** 2 / self.position_gain
        return inf

    def _first_zero(self, turns: Numbers) -> float:
        """Lowest zero of Jury's criterion between natural frequencies [rad per window]; infinite if there is none.

        Between the given frequencies the criterion is a spline, so that a range of unstable gains is found even if it
        is narrower than their steps.
        """
        CubicSpline: Any = import_module("scipy.interpolate").CubicSpline
        stiffness = turns**2 / self.position_gain  # K·TS²
        # Shape (..., 3, 3), with velocities in counts per window.
        margins = _jury_margins(
            self._closed(_expm(_generator(stiffness, self._damping, self.position_gain)[..., :3, :3]))
        )
        zeros = [CubicSpline(turns, margin).roots(extrapolate=False) for margin in margins]
        return float(np.min(np.concatenate(zeros), initial=inf))

    def _stretches(self, start: float) -> list[Numbers]:
        """Natural frequencies to try [rad per window], upwards from K·TS² = `start`.

        Once the axis oscillates at all within a window, the picture repeats with each turn of its natural frequency:
        ten turns show whether there is a limit.
        """
        lowest, oscillating = sqrt(start * self.position_gain), max(4.0, self._damping)
        rising = np.geomspace(lowest, oscillating, 2 + round(33 * log(oscillating / lowest)))
        return [rising, np.arange(oscillating, oscillating + 20.0 * pi, 0.05)]

    # ---------------------------------------------------------------------------------------------- a command

    def steady_following_error(self, rate: float) -> float:
        """Mean following error at a constant speed of the command [count/s]: rate·B·TS/K1 + rate/(tau_m·K·K1) [count].

        The first term is what the speed word takes to balance; the second is the drive that holds the speed.
        """
        holding = rate / (self.tau_m * self.gain)
        return (rate * self.scale * self.sample_period + holding) / self.position_gain

    @property
    def velocity_error_constant(self) -> float:
        """KV = K1/(B·TS) [1/s]: speed over steady following error, the drive that holds the speed neglected."""
        return self.position_gain / (self.scale * self.sample_period)

    def respond(self, rates: ArrayLike, *, step: float = 0.0, points: int = 1) -> Response:
        """Answer of the loop, at rest until then, to a command of constant rate in each window.

        `rates` are the speeds of the command [count/s], finite, shape (n,), n >= 1; `step` is its jump at the beginning
        [count]; `points` says how many instants of each window are computed, evenly spaced, 1 for the sample instants
        alone. Columns have the shape (n·points + 1,), from the beginning to the end of the last window.

        >>> loop = SampledLoop(gain=4000, sample_period=5e-3, scale=4)
        >>> moving_then_stopped = loop.respond([1000.0] * 100 + [0.0] * 40)
        >>> moving_then_stopped.following_error[[100, 140]].round(2).tolist()
        [20.0, 0.0]
        """
        speed = np.atleast_1d(np.asarray(rates, dtype=np.float64))
        if speed.ndim != 1 or not speed.size or not np.isfinite(speed).all():
            raise DetentError(
                f"rates: got {rates!r:.60}; expected: one finite number per window, at least one; "
                "try: state the speed of the command in each window"
            )
        check_constants(points=points)
        part, a = self._flow(1.0 / points), self.coefficient
        state = np.array([0.0, 0.0, 0.0, step, 0.0])
        rows = [state]
        for rate in speed:
            opened_at = state[0]
            state = np.array([*state[:4], rate])
            for _ in range(points):
                state = part @ state
                rows.append(state)
            # The end of the window: the speed word takes up the mean speed in it.
            state[2] = a * self.scale * (state[0] - opened_at) + (1.0 - a) * state[2]
        x, v, y, command = np.array(rows)[:, :4].T.copy()
        error = command - x
        t = np.arange(len(rows)) * self.sample_period / points
        return Response(t, command, x, v, y, error, self.position_gain * error - y)

    # ------------------------------------------------------------------------------------------- the mathematics

    @property
    def _damping(self) -> float:
        """Mechanical damping over a window, TS/tau_m."""
        return self.sample_period / self.tau_m

    def _window(self) -> Numbers:
        """(x, x', y, X, X') from one sample instant to the next, shape (5, 5)."""
        return self._closed(self._flow(1.0))

    def _flow(self, part: float) -> Numbers:
        """(x, x', y, X, X') over a part of a window, in which y is held and X' is constant; shape (5, 5)."""
        stiffness = self.gain * self.sample_period**2
        unit = np.array([1.0, self.sample_period, 1.0, 1.0, self.sample_period])  # velocities in counts per window
        flow = _expm(_generator(stiffness, self._damping, self.position_gain) * part)
        return flow * unit / unit[:, np.newaxis]

    def _closed(self, flow: Numbers) -> Numbers:
        """Flow over a whole window with its end: y takes up the difference of x between its two ends."""
        closed, a = flow.copy(), self.coefficient
        closed[..., 2, :] = a * self.scale * (flow[..., 0, :] - np.eye(flow.shape[-1])[0])
        closed[..., 2, 2] += 1.0 - a
        return closed


def _generator(stiffness: Any, damping: float, position_gain: float) -> Numbers:
    """d/dt of (x, x', y, X, X'), time in windows, for values of K·TS² of any shape; shape (..., 5, 5)."""
    k = np.asarray(stiffness, dtype=np.float64)
    generator = np.zeros((*k.shape, 5, 5))
    generator[..., 0, 1] = 1.0
    generator[..., 1, 0] = -k * position_gain
    generator[..., 1, 1] = -damping
    generator[..., 1, 2] = -k
    generator[..., 1, 3] = k * position_gain
    generator[..., 3, 4] = 1.0
    return generator


def _jury_margins(transition: Numbers) -> tuple[Numbers, Numbers]:
    """What is left until a pair of modes, and until an alternating mode, no longer decays.

    Jury's criterion for the characteristic polynomial z³ + a2·z² + a1·z + a0 of each 3 x 3 matrix: the product of
    1 - z·z' over the three pairs of modes, and that of 1 + z. A mode at z = 1 would be a drift; the position error
    excludes it at any gain.
    """
    trace = np.trace(transition, axis1=-2, axis2=-1)
    a2, a0 = -trace, -np.linalg.det(transition)
    a1 = 0.5 * (trace**2 - np.trace(transition @ transition, axis1=-2, axis2=-1))
    return 1.0 - a0**2 - a1 + a0 * a2, 1.0 - a2 + a1 - a0


def _expm(matrix: Numbers) -> Numbers:
    """Matrix exponential over the last two axes; scipy loads where it is used, so that `detent --help` is quick."""
    return import_module("scipy.linalg").expm(matrix)
