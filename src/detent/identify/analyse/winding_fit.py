"""The equation of a winding from sample to sample, solved with instruments; `winding` tells of it."""

from dataclasses import dataclass

import numpy as np

from detent.identify.fit.coloured import known_noise_covariance
from detent.identify.fit.estimate import Estimate, estimate, quantile
from detent.logs.log import Log, Values
from detent.logs.stamps import stretches
from detent.logs.windows import scipy

FEWEST = 100  # samples of a record, at least
SMOOTH = 9  # samples over which the speed is averaged to be its own instrument
ROUNDS = 50  # times, at most, that instruments and constants are found in turn
SETTLED = 1e-7  # change of the constants, relative, at which they are found
POLES = (0.01, 0.9999)  # limits of ``a`` in the filter; what lies outside is judged when it has settled
VAGUE = 0.3  # relative error from which a constant is not found
METHOD = "refined instrumental variable"


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """A part without gaps: current, held voltage, mean speed between samples, the same smoothed; torque; time step."""

    i: Values
    u: Values
    v: Values
    smooth: Values
    torque: Values
    step: float


@dataclass(frozen=True, slots=True, eq=False)
class WindingFit:
    """R, L, u0 and ke (absent when locked), their covariance and degrees of freedom."""

    values: Values
    covariance: Values
    degrees: int
    pole: tuple[float, float]  # interval of a
    residual: Values  # of the equation behind the filter
    made: list[Values]  # currents that the model makes, piece by piece

    def correlation(self, one: int, other: int) -> float:
        """Correlation of two constants, by their places."""
        return float(self.covariance[one, other]) / (self.error(one) * self.error(other) or 1.0)

    def error(self, which: int) -> float:
        """Standard error of a constant."""
        return float(np.sqrt(self.covariance[which, which]))

    def estimate(self, which: int, name: str, unit: str) -> Estimate:
        """A constant with its interval."""
        return estimate(name, float(self.values[which]), unit, self.error(which), METHOD, self.degrees)

    def is_vague(self, which: int) -> bool:
        """True for a constant that is not told from zero, or hardly."""
        return not self.error(which) < VAGUE * abs(float(self.values[which]))


def make_pieces(log: Log, late: int, *, is_locked: bool) -> list[Piece]:
    """Parts of a log without gaps; where the voltage is late, both ends are cut."""
    role = torque_role(log)
    pieces: list[Piece] = []
    for part in stretches(log.t):
        count = part.stop - part.start
        if count < FEWEST:
            continue
        step = float(log.t[part][-1] - log.t[part][0]) / (count - 1)
        # Mean speed from each sample to the next.
        if is_locked:
            v = np.zeros(count - 1)
        elif "position" in log.signals:
            v = np.diff(log.signals["position"][part]) / step
        else:
            v = 0.5 * (log.signals["velocity"][part][1:] + log.signals["velocity"][part][:-1])
        smooth = np.asarray(scipy("ndimage").uniform_filter1d(v, SMOOTH, mode="nearest"), float)
        u, i = log.signals["voltage"][part], log.signals["current"][part]
        begin, end = max(late, 0), count - 1 - max(-late, 0)
        held = u[begin - late : end - late]
        torque = log.signals[role][part][begin:end] if role else np.empty(0)
        pieces.append(Piece(i[begin : end + 1], held, v[begin:end], smooth[begin:end], torque, step))
    return pieces


def iterate(pieces: list[Piece], *, is_moving: bool) -> WindingFit | None:
    """Find constants and instruments in turn; None where that does not settle."""
    columns, target = _stacked(pieces, 0.0, None, is_moving=is_moving)
    values = solve_instruments(columns, columns, target)
    for _ in range(ROUNDS):
        if values is None:
            return None
        before = values
        pole = float(np.clip(before[0], *POLES))
        made = [_simulated(piece, np.concatenate([[pole], before[1:]])) for piece in pieces]
        columns, target = _stacked(pieces, pole, None, is_moving=is_moving)
        instruments, _ = _stacked(pieces, pole, made, is_moving=is_moving)
        values = solve_instruments(columns, instruments, target)
        if values is not None and np.abs(values - before).max() <= SETTLED * np.abs(values).max():
            residual = target - columns @ values
            # The residual alone would say too little where a few steps of the voltage hold most of what is known of L.
            covariance, degrees = known_noise_covariance(columns, residual, residual, instruments)
            physical, slope = _physical_constants(values, pieces[0].step)
            reach = quantile(degrees) * float(np.sqrt(covariance[0, 0]))
            interval = (float(values[0]) - reach, float(values[0]) + reach)
            return WindingFit(physical, slope @ covariance @ slope.T, degrees, interval, residual, made)
    return None


def _physical_constants(values: Values, step: float) -> tuple[Values, Values]:
    """Physical constants of a, g, g*u0 and g*ke (absent when locked), and their derivatives by these (delta method)."""
    g, a = float(values[1]), float(np.clip(values[0], *POLES))
    resistance, log_a = (1.0 - float(values[0])) / g, float(np.log(a))
    count = len(values)
    slope = np.zeros((count, count))
    slope[0, :2] = -1.0 / g, -resistance / g
    slope[1] = -step / log_a * slope[0]
    slope[1, 0] += resistance * step / (a * log_a**2)
    for row in range(2, count):
        slope[row, 1], slope[row, row] = -float(values[row]) / g**2, 1.0 / g
    return np.concatenate([[resistance, -resistance * step / log_a], values[2:] / g]), slope


def _simulated(piece: Piece, values: Values) -> Values:
    """Current that the model makes of voltage and speed, shape as the current."""
    emf = values[3] * piece.smooth if len(values) > 3 else 0.0
    drive = values[1] * piece.u - values[2] - emf
    made, _ = scipy("signal").lfilter([1.0], [1.0, -values[0]], drive, zi=[values[0] * piece.i[0]])
    return np.concatenate([[piece.i[0]], np.asarray(made, float)])


def _stacked(pieces: list[Piece], pole: float, made: list[Values] | None, *, is_moving: bool) -> tuple[Values, Values]:
    """Columns of the equation and its left side behind the filter; with currents that were made, the instruments."""
    columns: list[Values] = []
    targets: list[Values] = []
    for number, piece in enumerate(pieces):
        i = piece.i if made is None else made[number]
        v = piece.v if made is None else piece.smooth
        parts = [i[:-1], piece.u, -np.ones(len(piece.u)), *([-v] if is_moving else [])]
        series = np.column_stack([*parts, i[1:]])
        filtered = np.asarray(scipy("signal").lfilter([1.0], [1.0, -pole], series, axis=0), float)
        columns.append(filtered[:, :-1])
        targets.append(filtered[:, -1])
    return np.concatenate(columns), np.concatenate(targets)


def solve_instruments(columns: Values, instruments: Values, target: Values) -> Values | None:
    """Constants of the instrumental-variable equation; None where it cannot be solved."""
    size: Values = np.asarray(np.linalg.norm(columns, axis=0), float)
    length: Values = np.asarray(np.linalg.norm(instruments, axis=0), float)
    if not np.all(size > 0) or not np.all(length > 0):
        return None
    matrix = (instruments / length).T @ (columns / size)
    if not np.linalg.cond(matrix) < 1e12:
        return None
    values = np.asarray(np.linalg.solve(matrix, (instruments / length).T @ target), float) / size
    return values if np.all(np.isfinite(values)) else None


def torque_role(log: Log) -> str:
    """Role of a torque or force that was measured, not computed from the current; empty without one."""
    source = log.columns.get("current")
    for role in ("torque", "force"):
        own = log.columns.get(role)
        if role in log.signals and (own is None or source is None or own.column != source.column):
            return role
    return ""
