"""Resonances of an axis and the constants of its two masses, from frequency responses.

The encoder of the motor shows the anti-resonance ``wz^2 = k / m2``, at which the load swings against the standing
motor, and the resonance ``wp^2 = k (1 / m1 + 1 / m2)``; the encoder of the load shows the resonance alone. With the
total mass, which the gain gives where the effort is a force, they make both masses and the stiffness. The fit takes
the equations of `two_mass_response` with their dampings as they are, so that these relations hold
without the approximation of small damping.

Assumed: linear friction, a coupling without backlash, one resonance in the band, encoders in the same unit. Backlash
and dry friction move a resonance with the amplitude; the frequencies are then those of the recorded amplitude.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.errors import DetentError
from detent.identify.analyse.measure_response import FrequencyResponse
from detent.identify.analyse.response_fit import Fit, Lines, fit_model, take_lines
from detent.identify.analyse.two_mass_response import (
    LoadModel,
    RigidModel,
    TwoMassModel,
    constants_of,
    modes_of,
    respond_sampled,
)
from detent.identify.fit.estimate import Estimate, estimate
from detent.logs.log import Values
from detent.logs.windows import scipy

COHERENT = 0.5  # coherence that the lines about a resonance must have on average for it to be trusted
SHARP = 0.03  # standard error of a frequency, as a part of it, above which it is not trusted
NO_BETTER = 1e-3  # chance to find a resonance in a rigid axis at which it is believed
NARROW = 1.5  # least width of a resonance in widths of a window: a narrower one comes out too flat
_MECHANICAL = {"m": ("kg", "N/m", "N*s/m"), "rad": ("kg*m^2", "N*m/rad", "N*m*s/rad")}
_FORCES = {"m": "N", "rad": "N*m"}
_NEAR = 0.08
_METHOD = "two masses fitted to the frequency response"


@dataclass(frozen=True, eq=False)
class Resonances:
    """What the frequency responses of an axis say about its masses."""

    # ``gain`` (acceleration per effort, below the resonance), ``viscous`` [1/s]; where there is a resonance
    # ``resonance`` [Hz], ``resonance.damping`` [1]; with the encoder of the motor ``delay`` [s], ``antiresonance``
    # [Hz], ``antiresonance.damping`` [1], ``mass_ratio`` (load over motor) [1]; where the effort is a force
    # ``mass.total``, and of two masses ``mass.motor``, ``mass.load``, ``stiffness``, ``damping``
    estimates: dict[str, Estimate]
    frequency: Values  # lines [Hz], shape (n,)
    fitted: NDArray[np.complex128]  # responses of the model at the lines, shape (outputs, n)
    outputs: tuple[str, ...]  # ``motor``, ``load`` or both
    # what neither model nor noise explain, as a part of the response, the median over lines: friction, backlash, other
    # resonances
    scatter: float
    reason: str  # why the resonances are not to be trusted; empty where they are

    @property
    def is_trusted(self) -> bool:
        """True where nothing speaks against the resonances."""
        return not self.reason

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "estimates": {name: found.to_dict() for name, found in self.estimates.items()},
            "frequency": self.frequency.tolist(),
            "magnitude": np.abs(self.fitted).tolist(),
            "phase": np.unwrap(np.angle(self.fitted)).tolist(),
            "outputs": list(self.outputs),
            "scatter": self.scatter,
            "trusted": self.is_trusted,
            "reason": self.reason,
        }


def fit_resonances(
    motor: FrequencyResponse | None = None, load: FrequencyResponse | None = None, *, hold: float = 0.0
) -> Resonances:
    """Fit two masses to the responses of one or both encoders to the effort.

    G. Ellis, "Control System Design Guide", 4th ed., 2012, chapter 16.
    """
    responses = [response for response in (motor, load) if response is not None]
    if not responses:
        raise DetentError("identify: came no frequency response; allowed: that of the motor, of the load, or of both")
    outputs = tuple(name for name, response in (("motor", motor), ("load", load)) if response is not None)
    lines = take_lines(responses)
    rigid = fit_model(RigidModel(len(outputs)), lines, _rigid_starts(lines), hold)
    model = LoadModel() if motor is None else TwoMassModel(len(outputs))
    fit = fit_model(model, lines, _load_starts(lines) if motor is None else _two_mass_starts(lines), hold)
    why = _is_no_better(fit, rigid, lines)
    reasons = [why] if why else _doubts(fit, responses)
    fit = rigid if why else fit
    return Resonances(
        estimates=_estimates(fit, responses[0]),
        frequency=lines.frequency,
        fitted=fit.sign * respond_sampled(fit.model, fit.parameters, lines.frequency, hold),
        outputs=outputs,
        scatter=fit.scatter,
        reason="; ".join(reasons),
    )


# -- starts ---------------------------------------------------------------------------------------------------


def _rigid_starts(lines: Lines) -> list[Values]:
    low = 2 * np.pi * lines.frequency[0]
    return [np.array([low * part]) for part in (0.1, 1.0, 10.0, 100.0)]


def _frequencies(lines: Lines, *, deepest: bool) -> list[float]:
    """Where a resonance may be: a grid over the band, and the highest (deepest) lines of the acceleration [rad/s]."""
    low, high = math.log(lines.frequency[0]), math.log(lines.frequency[-1])
    grid = np.exp(low + (high - low) * np.arange(1, 25, dtype=np.float64) / 25)
    size = lines.frequency**2 * np.abs(lines.measured[0])
    order = np.argsort(np.where(lines.used[0], size if deepest else -size, np.inf))
    return (2 * np.pi * np.r_[grid, lines.frequency[order[:3]]]).tolist()


def _two_mass_starts(lines: Lines) -> list[Values]:
    """A grid over anti-resonance, ratio of the masses, damping and friction."""
    low = 2 * np.pi * lines.frequency[0]
    zeros, poles = (_frequencies(lines, deepest=deepest) for deepest in (True, False))
    ratios = {0.1, 0.3, 1.0, 3.0, 10.0}
    return [
        np.array([np.log(ratio), np.log(omega), 2 * damping * omega * ratio / (1 + ratio) ** 2, 0.5 * drag, 0.5 * drag])
        for omega in zeros
        for ratio in ratios | {(pole / omega) ** 2 - 1 for pole in poles[-3:] if pole > 1.02 * omega}
        for damping in (0.01, 0.05, 0.2)
        for drag in (0.2 * low, 3.0 * low)
    ]


def _load_starts(lines: Lines) -> list[Values]:
    """A grid over resonance, damping and friction."""
    low = 2 * np.pi * lines.frequency[0]
    return [
        np.array([drag, np.log(omega), damping, 0.0])
        for omega in _frequencies(lines, deepest=False)
        for damping in (0.01, 0.05, 0.2)
        for drag in (0.2 * low, 3.0 * low)
    ]


# -- doubts ---------------------------------------------------------------------------------------------------


def _is_no_better(fit: Fit, rigid: Fit, lines: Lines) -> str:
    """Why the axis is taken for rigid; empty where two masses explain it better (F test on the same weights)."""
    more = len(fit.parameters) - len(rigid.parameters)
    gain = (_weighted(rigid, fit, lines) - _weighted(fit, fit, lines)) / more
    ratio = gain / (_weighted(fit, fit, lines) / fit.freedom)
    if float(scipy("stats").f.sf(ratio, more, fit.freedom)) > NO_BETTER:
        return (
            f"one rigid mass explains the response as well as two (F = {ratio:.2g}): no resonance from "
            f"{lines.frequency[0]:.4g} to {lines.frequency[-1]:.4g} Hz stands out; excite higher frequencies, or take "
            "the axis for rigid"
        )
    if not np.isfinite(fit.covariance).all() or _modes(fit, fit.parameters) is None:
        return "the damping found leaves no resonance; take the axis for rigid"
    return ""


def _weighted(fit: Fit, weights_of: Fit, lines: Lines) -> float:
    """Sum of the squared misfits of one fit on the weights of another."""
    misfit = np.log(np.where(lines.used, lines.measured / fit.fitted, 1.0))
    return float(np.sum(np.abs(weights_of.weights * misfit) ** 2))


def _doubts(fit: Fit, responses: Sequence[FrequencyResponse]) -> list[str]:
    """Why the frequencies found are not to be trusted."""
    found = ["resonance"] if isinstance(fit.model, LoadModel) else ["antiresonance", "resonance"]
    doubts: list[str] = []
    for name in found:
        value, error = fit.spread(_quantities(fit)[name])
        width = value * fit.spread(_quantities(fit)[f"{name}.damping"])[0]
        # Motor and load see the resonance, the motor alone the anti-resonance.
        doubts += _doubts_of(name, value, error, width, responses if name == "resonance" else responses[:1])
    return doubts


def _doubts_of(
    name: str, value: float, error: float, width: float, responses: Sequence[FrequencyResponse]
) -> list[str]:
    """Why a frequency [Hz] with its standard error and half width is not to be trusted."""
    low, high = float(responses[0].frequency[0]), float(responses[0].frequency[-1])
    if not low < value < high:
        outside = f"the {name} of {value:.4g} Hz lies outside the excited {low:.4g} to {high:.4g} Hz"
        return [f"{outside}: it is a guess from the slope; excite {0.5 * value:.3g} to {2 * value:.3g} Hz"]
    doubts: list[str] = []
    near = [response.coherence[_lines_about(response, value, width)].mean() for response in responses]
    if max(near) < COHERENT:
        doubts.append(
            f"the coherence about the {name} of {value:.4g} Hz is {max(near):.2f}, below {COHERENT}: the response "
            "there is noise; excite it more, or record more periods"
        )
    if error > SHARP * value:
        doubts.append(
            f"the {name} is {value:.4g} Hz with a standard error of {error:.2g} Hz, above {SHARP:.0%} of it; excite it "
            "more, or record more periods"
        )
    resolution = responses[0].resolution
    if resolution > 0 and 2 * width < NARROW * resolution:
        doubts.append(
            f"the {name} of {value:.4g} Hz is {2 * width:.2g} Hz wide, the windows see {resolution:.2g} Hz: its "
            "damping comes out too large; record a periodic multisine, or a longer chirp"
        )
    return doubts


def _lines_about(response: FrequencyResponse, value: float, width: float) -> NDArray[np.intp]:
    """Lines within half a width of a resonance, and three at least."""
    distance = np.abs(response.frequency - value)
    reach = max(width, _NEAR * value)
    count = max(3, int(np.sum(distance <= reach)))
    return np.argsort(distance)[:count]


# -- estimates ------------------------------------------------------------------------------------------------


def _modes(fit: Fit, parameters: Values) -> dict[str, float] | None:
    """Frequencies [Hz] and damping ratios."""
    if isinstance(fit.model, RigidModel):
        return None
    if isinstance(fit.model, LoadModel):
        return {"resonance": float(np.exp(parameters[1])) / (2 * np.pi), "resonance.damping": float(parameters[2])}
    modes = modes_of(parameters)
    if modes is None:
        return None
    return {
        "antiresonance": modes.omega_zero / (2 * np.pi),
        "antiresonance.damping": modes.damping_zero,
        "resonance": modes.omega_pole / (2 * np.pi),
        "resonance.damping": modes.damping_pole,
    }


def _quantities(fit: Fit) -> dict[str, Callable[[Values], float]]:
    """What is told of a fit, as functions of its parameters: pure numbers, [Hz], [1/s], [s], and the gain."""

    def mode(name: str) -> Callable[[Values], float]:
        return lambda parameters: (_modes(fit, parameters) or {}).get(name, np.nan)

    found: dict[str, Callable[[Values], float]] = {name: mode(name) for name in _modes(fit, fit.parameters) or {}}
    if isinstance(fit.model, TwoMassModel):
        found["mass_ratio"] = lambda parameters: float(np.exp(parameters[0]))
        found["viscous"] = lambda parameters: float(parameters[3] + parameters[4])
    else:
        found["viscous"] = lambda parameters: float(parameters[0])
    found["gain"] = lambda parameters: fit.sign * float(np.exp(parameters[-2]))
    if not isinstance(fit.model, LoadModel):
        # With the load alone it is less the advance that the coupling's damping makes.
        found["delay"] = lambda parameters: float(parameters[-1])
    return found


def _estimates(fit: Fit, response: FrequencyResponse) -> dict[str, Estimate]:
    """Everything that a fit tells, with its intervals."""
    effort = f"({response.input_unit})" if "*" in response.input_unit else response.input_unit or "1"
    gain_unit = f"{response.output_unit or '1'}/s^2/{effort}"
    units = {"antiresonance": "Hz", "resonance": "Hz", "viscous": "1/s", "delay": "s", "gain": gain_unit}
    method = "one mass fitted to the frequency response" if isinstance(fit.model, RigidModel) else _METHOD
    found: dict[str, Estimate] = {}
    for name, quantity in _quantities(fit).items():
        value, error = fit.spread(quantity)
        found[name] = estimate(name, value, units.get(name, "1"), error, method, fit.degrees)
    return found | _constants(fit, response)


def _constants(fit: Fit, response: FrequencyResponse) -> dict[str, Estimate]:
    """Masses, stiffness and damping in units of mechanics, where a force tells the total mass."""
    if response.output_unit not in _MECHANICAL or response.input_unit != _FORCES[response.output_unit]:
        return {}
    mass_unit, stiffness_unit, damping_unit = _MECHANICAL[response.output_unit]
    per_mass: dict[str, tuple[str, Callable[[Values], float]]] = {"mass.total": (mass_unit, lambda _: 1.0)}
    if isinstance(fit.model, TwoMassModel):
        wanted = (("mass.motor", mass_unit), ("mass.load", mass_unit), ("stiffness", stiffness_unit),
                  ("damping", damping_unit))  # fmt: skip
        for index, (name, unit) in enumerate(wanted):
            per_mass[name] = (unit, lambda parameters, index=index: constants_of(parameters)[index])
    found: dict[str, Estimate] = {}
    for name, (unit, part) in per_mass.items():
        value, error = fit.spread(lambda parameters, part=part: part(parameters) * np.exp(-parameters[-2]))
        found[name] = estimate(name, value, unit, error, _METHOD, fit.degrees)
    return found
