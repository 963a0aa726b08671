"""Resonances of an axis and the constants of its two masses, from frequency responses.

The encoder of the motor shows the anti-resonance ``wz^2 = k / m2``, at which the load swings against the standing
motor, and the resonance ``wp^2 = k (1 / m1 + 1 / m2)``; the encoder of the load shows the resonance alone. With the
total mass, which the gain gives where the effort is a force, they make both masses and the stiffness. The fit takes
the equations with their dampings as they are, not the approximation of small damping.

Assumed: linear friction, a coupling without backlash, one resonance in the band, encoders in the same unit. Backlash
and dry friction move a resonance with the amplitude; the frequencies are then those of the recorded amplitude.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.errors import DetentError
from detent.identify.analyse import response_fit
from detent.identify.analyse.measure_response import FrequencyResponse
from detent.identify.fit.chance import fisher_tail
from detent.identify.fit.estimate import Estimate, estimate
from detent.logs.log import Values

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

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "estimates": {name: found.to_dict() for name, found in self.estimates.items()},
            "frequency": self.frequency.tolist(),
            "magnitude": np.abs(self.fitted).tolist(),
            "phase": np.unwrap(np.angle(self.fitted)).tolist(),
            "outputs": list(self.outputs),
            "scatter": self.scatter,
            "trusted": not self.reason,
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
        raise DetentError("identify: got no frequency response; expected: that of the motor, of the load, or of both")
    outputs = tuple(name for name, response in (("motor", motor), ("load", load)) if response is not None)
    lines = response_fit.take_lines(responses)
    low = 2 * np.pi * lines.frequency[0]
    frictions = [np.array([low * part]) for part in (0.1, 1.0, 10.0, 100.0)]
    rigid = response_fit.fit_model(response_fit.RigidModel(len(outputs)), lines, frictions, hold)
    if motor is None:
        fit = response_fit.fit_model(response_fit.LoadModel(), lines, _load_starts(lines), hold)
    else:
        fit = response_fit.fit_model(response_fit.TwoMassModel(len(outputs)), lines, _two_mass_starts(lines), hold)
    why = _is_no_better(fit, rigid, lines)
    reason = why or "; ".join(_doubts(fit, responses))
    fit = rigid if why else fit
    return Resonances(_estimates(fit, responses[0]), lines.frequency, fit.fitted, outputs, fit.scatter, reason)


def _frequencies(lines: response_fit.Lines, *, deepest: bool) -> list[float]:
    """Where a resonance may be: a grid over the band, and the highest (deepest) lines of the acceleration [rad/s]."""
    low, high = math.log(lines.frequency[0]), math.log(lines.frequency[-1])
    grid = np.exp(low + (high - low) * np.arange(1, 25, dtype=np.float64) / 25)
    size = lines.frequency**2 * np.abs(lines.measured[0])
    order = np.argsort(np.where(lines.used[0], size if deepest else -size, np.inf))
    return (2 * np.pi * np.r_[grid, lines.frequency[order[:3]]]).tolist()


def _two_mass_starts(lines: response_fit.Lines) -> list[Values]:
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


def _load_starts(lines: response_fit.Lines) -> list[Values]:
    """A grid over resonance, damping and friction."""
    low = 2 * np.pi * lines.frequency[0]
    return [
        np.array([drag, np.log(omega), damping, 0.0])
        for omega in _frequencies(lines, deepest=False)
        for damping in (0.01, 0.05, 0.2)
        for drag in (0.2 * low, 3.0 * low)
    ]


def _is_no_better(fit: response_fit.Fit, rigid: response_fit.Fit, lines: response_fit.Lines) -> str:
    """Why the axis is taken for rigid; empty where two masses explain it better (F test on the same weights)."""

    def squares(one: response_fit.Fit) -> float:
        misfit = np.log(np.where(lines.used, lines.measured / one.fitted, 1.0))
        return float(np.sum(np.abs(fit.weights * misfit) ** 2))

    more = len(fit.parameters) - len(rigid.parameters)
    gain = (squares(rigid) - squares(fit)) / more
    ratio = gain / (squares(fit) / fit.freedom)
    if fisher_tail(ratio, more, fit.freedom) > NO_BETTER:
        rigid_too = f"one rigid mass explains the response as well as two (F = {ratio:.2g})"
        band = f"{lines.frequency[0]:.4g} to {lines.frequency[-1]:.4g} Hz"
        advice = "excite higher frequencies, or treat the axis as rigid"
        return f"{rigid_too}: no resonance from {band} is significant; {advice}"
    if not np.isfinite(fit.covariance).all() or "resonance" not in fit.model.tell(fit.parameters):
        return "the damping found leaves no resonance; treat the axis as rigid"
    return ""


def _doubts(fit: response_fit.Fit, responses: Sequence[FrequencyResponse]) -> list[str]:
    """Why the frequencies found are not to be trusted."""
    found = fit.spread(fit.model.tell)
    doubts: list[str] = []
    for name in ("antiresonance", "resonance"):
        if name in found:
            value, error = found[name]
            width = value * found[f"{name}.damping"][0]
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
        return [f"{outside}: it is extrapolated from the slope; excite {0.5 * value:.3g} to {2 * value:.3g} Hz"]
    doubts: list[str] = []
    near: list[float] = []
    for response in responses:
        # Lines within half a width of the resonance, and three at least.
        distance = np.abs(response.frequency - value)
        count = max(3, int(np.sum(distance <= max(width, _NEAR * value))))
        near.append(response.coherence[np.argsort(distance)[:count]].mean())
    advice, resolution = "excite it more, or record more periods", responses[0].resolution
    if max(near) < COHERENT:
        below = f"is {max(near):.2f}, below {COHERENT}: the response there is noise"
        doubts.append(f"the coherence about the {name} of {value:.4g} Hz {below}; {advice}")
    if error > SHARP * value:
        above = f"a standard error of {error:.2g} Hz, above {SHARP:.0%} of it"
        doubts.append(f"the {name} is {value:.4g} Hz with {above}; {advice}")
    if resolution > 0 and 2 * width < NARROW * resolution:
        wide = f"is {2 * width:.2g} Hz wide, the windows resolve {resolution:.2g} Hz: its damping is overestimated"
        doubts.append(f"the {name} of {value:.4g} Hz {wide}; record a periodic multisine, or a longer chirp")
    return doubts


def _tell(fit: response_fit.Fit, parameters: Values, *, is_force: bool) -> dict[str, float]:
    """What is told of a fit with any parameters: what its model tells, gain and delay [s]; of a force the masses."""
    told = fit.model.tell(parameters) | {"gain": fit.sign * float(np.exp(parameters[-2]))}
    if not isinstance(fit.model, response_fit.LoadModel):
        # With the load alone it is less the advance that the coupling's damping makes.
        told["delay"] = float(parameters[-1])
    total = float(np.exp(-parameters[-2]))
    if is_force:
        told["mass.total"] = total
        if isinstance(fit.model, response_fit.TwoMassModel):
            parts = ("mass.motor", "mass.load", "stiffness", "damping")
            told |= {
                name: part * total for name, part in zip(parts, response_fit.constants_of(parameters), strict=False)
            }
    return told


def _estimates(fit: response_fit.Fit, response: FrequencyResponse) -> dict[str, Estimate]:
    """Everything that a fit tells, with its intervals; masses, stiffness and damping where the effort is a force."""
    effort = f"({response.input_unit})" if "*" in response.input_unit else response.input_unit or "1"
    gain_unit = f"{response.output_unit or '1'}/s^2/{effort}"
    units = {"antiresonance": "Hz", "resonance": "Hz", "viscous": "1/s", "delay": "s", "gain": gain_unit}
    is_force = response.input_unit == _FORCES.get(response.output_unit)
    if is_force:
        mass, units["stiffness"], units["damping"] = _MECHANICAL[response.output_unit]
        units |= {"mass.total": mass, "mass.motor": mass, "mass.load": mass}
    method = "one mass fitted to the frequency response" if isinstance(fit.model, response_fit.RigidModel) else _METHOD
    found = fit.spread(lambda parameters: _tell(fit, parameters, is_force=is_force))
    return {
        name: estimate(name, value, units.get(name, "1"), error, method, fit.degrees)
        for name, (value, error) in found.items()
    }
