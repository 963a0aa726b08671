"""Resistance, inductance, back-EMF constant and torque constant from recorded voltage, current and speed.

A winding obeys ``u = R i + L di/dt + ke v + u0``. With a voltage that is held from sample to sample and a speed that
hardly changes in between, its samples obey exactly

    i[k+1] = a i[k] + g (u[k] - ke v[k] - u0),    a = exp(-R dt / L),    g = (1 - a) / R.

No current is differentiated: this is the equation integrated over a sample. Noise of the measured current would make
``a``, and with it L, too small; so the equation is solved with instruments. These are the columns with the current that
the model itself makes of voltage and speed in place of the measured one, both behind the filter ``1 / (1 - a/z)``,
found in turn with the constants: the simplified refined instrumental variable (P. C. Young, Recursive Estimation and
Time-Series Analysis, 2nd ed. 2011, chapter 7), whose limit is the fit of the simulated current. Standard errors take
the colour of the residual into account.

The torque constant comes from a torque or force where one is recorded, otherwise it equals the back-EMF constant, by
conservation of energy.

Assumptions: constant R, L and ke; the voltage is that at the winding (or its mean over a cycle of the modulator) and is
not made from the noise of the measured current, as a very stiff current loop does; samples are even, within a tenth.
"""

from dataclasses import dataclass, replace

import numpy as np

from detent.errors import DetentError
from detent.identify.analyse.winding_fit import (
    FEWEST,
    METHOD,
    POLES,
    Piece,
    WindingFit,
    iterate,
    make_pieces,
    solve_instruments,
    torque_role,
)
from detent.identify.fit.coloured import coloured_covariance
from detent.identify.fit.estimate import Estimate, estimate
from detent.logs.log import Log
from detent.logs.stamps import stretches

EVEN = 0.1  # largest deviation of a time step from their mean, as a part of it
TOGETHER = 0.95  # correlation of two constants from which they may be inseparable
_TORQUE_UNITS = {"V*s/rad": "N*m/A", "V*s/m": "N/A"}
CLEARLY_BETTER = 0.8  # residual, as a part of the present one, with which another delay of the voltage fits better


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


def fit_winding(log: Log, *, is_locked: bool = False, late: int = 0) -> Winding:
    """Constants of the winding from a recording."""
    log.need("voltage", "current")
    if late < 0:
        raise DetentError(
            f"winding: came a delay of {late} samples; allowed: 0 or more; a voltage acts after it is set"
        )
    reason = _refusal(log, is_locked=is_locked)
    if reason:
        return Winding(reason=reason)
    pieces = make_pieces(log, late, is_locked=is_locked)
    is_moving = any(np.any(piece.v != 0) for piece in pieces)
    fit = iterate(pieces, is_moving=is_moving)
    way = "" if is_locked else log.units["position" if "position" in log.signals else "velocity"].removesuffix("/s")
    found = _told(pieces, fit, f"V*s/{way}") if is_moving else _still(pieces, fit)
    if found.reason or fit is None:
        return found
    found = _with_torque(log, pieces, fit, found)
    others = (make_pieces(log, other, is_locked=is_locked) for other in (late - 1, late + 1))
    earlier, later = (iterate(other, is_moving=is_moving) for other in others)
    return replace(found, notes=(*found.notes, *_delay_notes(fit, earlier, later)))


def _refusal(log: Log, *, is_locked: bool) -> str:
    """Why a log says nothing about a winding; empty where it may."""
    if not is_locked and not {"velocity", "position"} & set(log.signals):
        return (
            "neither speed nor position is recorded: back-EMF and resistance cannot be told apart; "
            "record one of them, or state that the rotor is locked"
        )
    if max(part.stop - part.start for part in stretches(log.t)) < FEWEST:
        return f"no {FEWEST} samples without a gap; record longer"
    for role in ("voltage", "current"):
        if float(np.ptp(log.signals[role])) == 0.0:
            return f"the {role} is constant; record steps or noise of the voltage"
    steps = np.concatenate([np.diff(log.t[part]) for part in stretches(log.t)])
    if float(np.abs(steps - steps.mean()).max()) > EVEN * float(steps.mean()):
        return f"time steps go from {steps.min():.3g} to {steps.max():.3g} s; sample evenly"
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
        return replace(told, notes=(*told.notes, "the speed is too low to show a back-EMF; record higher speeds"))
    ke = fit.estimate(3, "back_emf_constant", unit)
    if ke.value < 0:
        reason = "the back-EMF constant comes out negative: speed and voltage have opposite signs; turn one"
        return Winding(reason=reason)
    return replace(told, back_emf_constant=ke)


def _partner(pieces: list[Piece], found: WindingFit | None) -> str:
    """What the back-EMF constant cannot be told apart from: ``resistance``, ``offset``, or nothing."""
    if found is not None:
        is_possible = found.pole[0] < 1.0 and found.values[0] > 0 and found.values[3] > 0
        if is_possible and not found.is_vague(3):
            return ""
        shares = {"resistance": abs(found.correlation(3, 0)), "offset": abs(found.correlation(3, 2))}
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
        note = "the speed is constant: back-EMF and voltage offset cannot be told apart; record several speeds"
        return replace(found, offset=None, notes=(*found.notes, note))
    note = (
        "speed and current are proportional: back-EMF constant and resistance cannot be told apart, and the apparent "
        "resistance is R + ke v/i; record accelerations, or the rotor locked"
    )
    apparent = replace(found.resistance, name="resistance.apparent") if found.resistance else None
    return replace(found, resistance=None, apparent_resistance=apparent, notes=(*found.notes, note))


def _still(pieces: list[Piece], found: WindingFit | None) -> Winding:
    """Resistance, inductance and offset of a fit."""
    if found is None:
        reason = "the current does not follow the voltage as that of a winding does; check columns, units and signs"
        return Winding(reason=reason)
    notes: list[str] = []
    if found.values[0] < 0 and not found.is_vague(0):
        return Winding(reason="the resistance comes out negative: voltage and current have opposite signs; turn one")
    if found.is_vague(0):
        return Winding(reason="the resistance drowns in noise; record larger steps of the voltage, each for longer")
    inductance: Estimate | None = found.estimate(1, "inductance", "H")
    if found.pole[0] <= POLES[0]:
        limit = float(found.values[0]) * pieces[0].step / -float(np.log(np.clip(found.pole[1], *POLES)))
        notes.append(f"the current settles within a sample: inductance below {limit:.2g} H; sample faster")
        inductance = None
    elif found.pole[1] >= 1.0 or found.is_vague(1):
        notes.append("the inductance drowns in noise; record faster steps of the voltage")
        inductance = None
    current = np.concatenate([piece.i for piece in pieces])
    return Winding(
        found.estimate(0, "resistance", "ohm"),
        inductance,
        offset=found.estimate(2, "voltage_offset", "V"),
        relative_error=float(found.residual.std() / current.std()),
        notes=tuple(notes),
    )


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


def _delay_notes(fit: WindingFit, earlier: WindingFit | None, later: WindingFit | None) -> tuple[str, ...]:
    """What to try where the voltage acts at another time than it is recorded."""
    others = (("earlier", earlier), ("later", later))
    shares = {word: float(other.residual.std()) / float(fit.residual.std()) for word, other in others if other}
    word = min(shares, key=shares.__getitem__, default="")
    if not word or shares[word] >= CLEARLY_BETTER:
        return ()
    note = f"a voltage that acts a sample {word} leaves {shares[word]:.0%} of the residual"
    return (f"{note}; state by how much it is late",)
