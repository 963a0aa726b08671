"""Resistance, inductance, back-EMF constant and torque constant from recorded voltage, current and speed.

A winding obeys ``u = R i + L di/dt + ke v + u0``. With a voltage that is held from sample to sample and a speed that
hardly changes in between, its samples obey exactly

    i[k+1] = a i[k] + g (u[k] - ke v[k] - u0),    a = exp(-R dt / L),    g = (1 - a) / R.

Noise of the measured current would make ``a``, and with it L, too small; so the equation is solved with instruments:
the columns with the current that the model itself makes of voltage and speed in place of the measured one, both behind
the filter ``1 / (1 - a/z)``, found in turn with the constants (the simplified refined instrumental variable: P. C.
Young, Recursive Estimation and Time-Series Analysis, 2nd ed. 2011, chapter 7). The torque constant comes from a torque
or force where one is recorded, otherwise it equals the back-EMF constant, by conservation of energy.

Assumed: the voltage is that at the winding (or its mean over a cycle of the modulator) and is not made from the noise
of the measured current, as a very stiff current loop does.
"""

from dataclasses import dataclass, replace

import numpy as np

from detent.identify.fit.estimate import Estimate, coloured_covariance, estimate, known_noise_covariance, quantile
from detent.logs.differences import scipy
from detent.logs.log import Log, Values
from detent.logs.stamps import stretches

EVEN = 0.1  # largest deviation of a time step from their mean, as a part of it
TOGETHER = 0.95  # correlation of two constants from which they may be inseparable
_TORQUE_UNITS = {"V*s/rad": "N*m/A", "V*s/m": "N/A"}
CLEARLY_BETTER = 0.8  # residual, as a part of the present one, with which another delay of the voltage fits better
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

    def error(self, which: int) -> float:
        """Standard error of a constant."""
        return float(np.sqrt(self.covariance[which, which]))

    def estimate(self, which: int, name: str, unit: str) -> Estimate:
        """A constant with its interval."""
        return estimate(name, float(self.values[which]), unit, self.error(which), METHOD, self.degrees)

    def is_vague(self, which: int) -> bool:
        """True for a constant that is not told from zero, or hardly."""
        return not self.error(which) < VAGUE * abs(float(self.values[which]))


def make_pieces(log: Log, late: int = 0) -> list[Piece]:
    """Parts of a log without gaps; where the voltage is late, both ends are cut."""
    role = torque_role(log)
    pieces: list[Piece] = []
    for part in stretches(log.t):
        count = part.stop - part.start
        if count < FEWEST:
            continue
        step = float(log.t[part][-1] - log.t[part][0]) / (count - 1)
        # Mean speed from each sample to the next.
        if "position" in log.signals:
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


@dataclass(frozen=True, slots=True)
class Winding:
    """Constants of a winding."""

    resistance: Estimate | None = None  # and inductance: [Ohm] and [H]
    inductance: Estimate | None = None
    back_emf_constant: Estimate | None = None  # [V*s/rad] or [V*s/m]
    offset: Estimate | None = None  # voltage that makes no current [V]
    torque_constant: Estimate | None = None  # [N*m/A] or [N/A]
    # ``R + ke v / i`` where speed and current are proportional and only the sum is seen [Ohm]
    apparent_resistance: Estimate | None = None
    relative_error: float = np.nan  # residual over the current, both standard deviations; nan without a fit
    reason: str = ""  # why there is no result; empty where there is one
    notes: tuple[str, ...] = ()  # what the data cannot tell, and what to know about the result

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """All constants found."""
        found = (self.resistance, self.inductance, self.back_emf_constant, self.offset, self.torque_constant)
        return tuple(one for one in (*found, self.apparent_resistance) if one is not None)


def fit_winding(log: Log) -> Winding:
    """Constants of the winding from a recording."""
    log.need("voltage", "current")
    reason = _refusal(log)
    if reason:
        return Winding(reason=reason)
    pieces = make_pieces(log)
    is_moving = any(np.any(piece.v != 0) for piece in pieces)
    fit = iterate(pieces, is_moving=is_moving)
    way = log.units["position" if "position" in log.signals else "velocity"].removesuffix("/s")
    found = _told(pieces, fit, f"V*s/{way}") if is_moving else _still(pieces, fit)
    if found.reason or fit is None:
        return found
    found = _with_torque(log, pieces, fit, found)
    # Where the voltage acts at another time than it is recorded, another delay fits better.
    others = {word: iterate(make_pieces(log, k), is_moving=is_moving) for word, k in (("earlier", -1), ("later", 1))}
    shares = {word: float(one.residual.std()) / float(fit.residual.std()) for word, one in others.items() if one}
    word = min(shares, key=shares.__getitem__, default="")
    if not word or shares[word] >= CLEARLY_BETTER:
        return found
    note = f"a voltage that acts a sample {word} leaves {shares[word]:.0%} of the residual"
    return replace(found, notes=(*found.notes, f"{note}; state by how much it is late"))


def _refusal(log: Log) -> str:
    """Why a log says nothing about a winding; empty where it may."""
    if not {"velocity", "position"} & set(log.signals):
        return (
            "neither speed nor position is recorded: back-EMF and resistance cannot be separated; record "
            "one of them, also with a locked rotor"
        )
    if max(part.stop - part.start for part in stretches(log.t)) < FEWEST:
        return f"no {FEWEST} samples without a gap; record longer"
    for role in ("voltage", "current"):
        if float(np.ptp(log.signals[role])) == 0.0:
            return f"the {role} is constant; record steps or noise of the voltage"
    steps = np.concatenate([np.diff(log.t[part]) for part in stretches(log.t)])
    if float(np.abs(steps - steps.mean()).max()) > EVEN * float(steps.mean()):
        return f"time steps range from {steps.min():.3g} to {steps.max():.3g} s; sample evenly"
    return ""


def _told(pieces: list[Piece], fit: WindingFit | None, unit: str) -> Winding:
    """Constants of a motor that moves, as far as the data tell them apart."""
    partner = _partner(pieces, fit)
    if partner:
        return _without_speed(pieces, partner)
    told = _still(pieces, fit)
    if told.reason or fit is None:
        return told
    if fit.is_vague(3):
        return replace(told, notes=(*told.notes, "the speed is too low to show back-EMF; record higher speeds"))
    if fit.values[3] < 0:
        reason = "the back-EMF constant is negative: speed and voltage have opposite signs; invert one"
        return Winding(reason=reason)
    return replace(told, back_emf_constant=fit.estimate(3, "back_emf_constant", unit))


def _partner(pieces: list[Piece], found: WindingFit | None) -> str:
    """What the back-EMF constant cannot be separated from: ``resistance``, ``offset``, or nothing."""
    if found is not None:
        is_possible = found.pole[0] < 1.0 and found.values[0] > 0 and found.values[3] > 0
        if is_possible and not found.is_vague(3):
            return ""
        # Correlation of the back-EMF constant with each.
        shares = {
            name: abs(float(found.covariance[3, which])) / (found.error(3) * found.error(which) or 1.0)
            for name, which in (("resistance", 0), ("offset", 2))
        }
        name = max(shares, key=lambda key: shares[key])
        return name if shares[name] > TOGETHER else ""
    v, i = (np.concatenate(series) for series in ([p.smooth for p in pieces], [p.i[:-1] for p in pieces]))
    if float(v.std()) < 0.01 * abs(float(v.mean())):
        return "offset"
    return "resistance" if abs(float(np.corrcoef(v, i)[0, 1])) > TOGETHER else ""


def _without_speed(pieces: list[Piece], partner: str) -> Winding:
    """Constants where the back-EMF cannot be told from another voltage."""
    fit = iterate(pieces, is_moving=False)
    found = _still(pieces, fit)
    if found.reason:
        return found
    if partner == "offset":
        note = "the speed is constant: back-EMF and voltage offset cannot be separated; record several speeds"
        return replace(found, offset=None, notes=(*found.notes, note))
    note = (
        "speed and current are proportional: back-EMF constant and resistance cannot be separated, and the apparent "
        "resistance is R + ke v/i; record accelerations, or a locked rotor"
    )
    apparent = replace(found.resistance, name="resistance.apparent") if found.resistance else None
    return replace(found, resistance=None, apparent_resistance=apparent, notes=(*found.notes, note))


def _still(pieces: list[Piece], found: WindingFit | None) -> Winding:
    """Resistance, inductance and offset of a fit."""
    if found is None:
        reason = "the current does not respond to the voltage like a winding; check columns, units and signs"
        return Winding(reason=reason)
    notes: list[str] = []
    if found.values[0] < 0 and not found.is_vague(0):
        return Winding(reason="the resistance is negative: voltage and current have opposite signs; invert one")
    if found.is_vague(0):
        return Winding(reason="the resistance is lost in noise; record larger and longer voltage steps")
    inductance: Estimate | None = found.estimate(1, "inductance", "H")
    if found.pole[0] <= POLES[0]:
        limit = float(found.values[0]) * pieces[0].step / -float(np.log(np.clip(found.pole[1], *POLES)))
        notes.append(f"the current settles within a sample: inductance below {limit:.2g} H; sample faster")
        inductance = None
    elif found.pole[1] >= 1.0 or found.is_vague(1):
        notes.append("the inductance is lost in noise; record faster voltage steps")
        inductance = None
    error = float(found.residual.std() / np.concatenate([piece.i for piece in pieces]).std())
    resistance, offset = found.estimate(0, "resistance", "ohm"), found.estimate(2, "voltage_offset", "V")
    return Winding(resistance, inductance, offset=offset, relative_error=error, notes=tuple(notes))


def _with_torque(log: Log, pieces: list[Piece], fit: WindingFit, found: Winding) -> Winding:
    """Add the torque constant, by a torque that was recorded, or by energy."""
    role = torque_role(log)
    ke = found.back_emf_constant
    if role:
        columns, instruments = (
            np.column_stack([np.concatenate(series), np.ones(sum(map(len, series)))])
            for series in ([piece.i[:-1] for piece in pieces], [made[:-1] for made in fit.made])
        )
        torque = np.concatenate([piece.torque for piece in pieces])
        values = solve_instruments(columns, instruments, torque)
        if values is not None:
            covariance, degrees = coloured_covariance(columns, torque - columns @ values, instruments)
            error = float(np.sqrt(covariance[0, 0]))
            kt = estimate("torque_constant", float(values[0]), f"{log.units[role]}/A", error, METHOD, degrees)
            return replace(found, torque_constant=kt)
    if ke is None or ke.unit not in _TORQUE_UNITS:
        return found
    method = "equal to the back-EMF constant, by conservation of energy"
    kt = replace(ke, name="torque_constant", unit=_TORQUE_UNITS[ke.unit], method=method)
    return replace(found, torque_constant=kt)
