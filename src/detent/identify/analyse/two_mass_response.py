"""Frequency response of two masses on a compliant coupling, and of one rigid mass, as models to fit.

The effort drives the motor, ``m1 a1 = g u - b1 v1 - d (v1 - v2) - k (x1 - x2)``; the load follows by the coupling,
``m2 a2 = d (v1 - v2) + k (x1 - x2) - b2 v2``. So with ``N = m2 s^2 + (d + b2) s + k`` and ``Z = d s + k``

    x1 / u = g N / D        x2 / u = g Z / D        D = (m1 s^2 + (b1 + d) s + k) N - Z^2

The zeros of N are the anti-resonance, which the encoder of the motor sees; the load's has none. D has a pole at 0, one
real pole, and the pair of the resonance (G. Ellis, "Control System Design Guide", 4th ed., 2012, chapter 16;
R. Munnig Schmidt et al., "The Design of High Performance Mechatronics", 2nd ed., 2014, chapter 3). A response does not
change when masses, stiffness, dampings and g grow together: all are taken per total mass here.

A sampled axis whose effort is held between samples shows more than that: half a sample of delay, and what lies
about the multiples of the sample rate (K. J. Astrom, B. Wittenmark, "Computer-Controlled Systems", 3rd ed., 1997,
section 7.4). Both are part of the models where a hold is given.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from detent.logs.log import Values

Complex = NDArray[np.complex128]

ALIASES = 3  # multiples of the sample rate, to both sides, that are counted


@dataclass(frozen=True, slots=True)
class RigidModel:
    """One mass with viscous friction: ``1 / (s (s + b))``."""

    outputs: int = 1  # encoders, which all see the same
    count: ClassVar[int] = 1  # viscous friction per mass [1/s]

    def respond(self, parameters: Values, s: Complex) -> Complex:
        """Responses up to the gain."""
        return np.tile(1.0 / (s * (s + parameters[0])), (self.outputs, 1))

    def tell(self, parameters: Values) -> dict[str, float]:
        """Friction alone."""
        return {"viscous": float(parameters[0])}


@dataclass(frozen=True, slots=True)
class TwoMassModel:
    """Two masses seen by the encoder of the motor, or by both."""

    outputs: int = 1  # 1 for the motor alone, 2 for motor and load
    # logarithms of m2 / m1 and of the anti-resonance [rad/s]; per total mass [1/s]: damping, viscous friction of motor
    # and load
    count: ClassVar[int] = 5

    def respond(self, parameters: Values, s: Complex) -> Complex:
        """Responses up to the gain."""
        m1, m2, k, d, b1, b2 = constants_of(parameters)
        n = (m2 * s + d + b2) * s + k
        z = d * s + k
        denominator = ((m1 * s + b1 + d) * s + k) * n - z * z
        return np.array([n, z][: self.outputs]) / denominator

    def tell(self, parameters: Values) -> dict[str, float]:
        """Anti-resonance and resonance, left out where the damping leaves none; ratio of the masses, friction.

        >>> found = TwoMassModel().tell(np.array([np.log(3.0), np.log(20.0 * np.pi), 0.0, 0.0, 0.0]))
        >>> round(found["antiresonance"], 6), round(found["resonance"], 6)
        (10.0, 20.0)
        """
        m1, m2, k, d, b1, b2 = constants_of(parameters)
        cubic = [m1 * m2, m1 * (d + b2) + m2 * (d + b1), k * (m1 + m2) + d * (b1 + b2) + b1 * b2, k * (b1 + b2)]
        roots = np.roots(cubic)
        pole = complex(roots[np.argmax(roots.imag)])
        omega = float(np.sqrt(k / m2))
        modes = {
            "antiresonance": omega / (2 * np.pi),
            "antiresonance.damping": (d + b2) / (2.0 * m2 * omega),
            "resonance": abs(pole) / (2 * np.pi),
            "resonance.damping": -pole.real / abs(pole),
        }
        ratio = {"mass_ratio": float(np.exp(parameters[0])), "viscous": float(parameters[3] + parameters[4])}
        return modes | ratio if pole.imag > 0 else ratio


@dataclass(frozen=True, slots=True)
class LoadModel:
    """Two masses seen by the encoder of the load alone: ``(1 + s d / k) / (s (s + a) (s^2 / w^2 + 2 z s / w + 1))``.

    The advance d / k and the delay can hardly be told apart below the resonance; neither is told of this model.
    """

    # the real pole [1/s], the logarithm of the resonance [rad/s], its damping ratio, advance [s]
    count: ClassVar[int] = 4

    def respond(self, parameters: Values, s: Complex) -> Complex:
        """Responses up to the gain."""
        pole, log_omega, ratio, advance = parameters.tolist()
        x = s / np.exp(log_omega)
        return ((1.0 + advance * s) / (s * (s + pole) * ((x + 2.0 * ratio) * x + 1.0)))[None, :]

    def tell(self, parameters: Values) -> dict[str, float]:
        """Resonance and friction."""
        pole, log_omega, ratio, _ = parameters[:4].tolist()
        return {"resonance": float(np.exp(log_omega)) / (2 * np.pi), "resonance.damping": ratio, "viscous": pole}


ResponseModel = RigidModel | TwoMassModel | LoadModel
"""Model of the answers of some outputs to one effort.

`respond` gives responses up to the gain, shape (outputs, n), at complex frequencies [rad/s], shape (n,). `tell` gives
what a person is told: frequencies [Hz], damping ratios, ratio of the masses, friction per mass [1/s].
"""


def constants_of(parameters: Values) -> tuple[float, float, float, float, float, float]:
    """Masses, stiffness, damping of the coupling, and viscous friction of motor and load, per total mass."""
    ratio, omega = float(np.exp(parameters[0])), float(np.exp(parameters[1]))
    m2 = ratio / (1.0 + ratio)
    return 1.0 - m2, m2, m2 * omega**2, float(parameters[2]), float(parameters[3]), float(parameters[4])


def laplace(frequency: Values) -> Complex:
    """Frequencies [Hz] as points of the imaginary axis [rad/s], in the same shape."""
    return np.asarray(2j * np.pi * frequency, dtype=np.complex128)


def respond_sampled(model: ResponseModel, parameters: Values, frequency: Values, hold: float) -> Complex:
    """Response of a model to an effort that is held between samples."""
    *inner, log_gain, delay = parameters.tolist()
    gain, own = np.exp(log_gain), np.asarray(inner)
    s = laplace(frequency)
    if hold == 0.0:
        return gain * np.exp(-s * delay) * model.respond(own, s)
    turns = np.arange(-ALIASES, ALIASES + 1)[:, None] / hold
    all_s = laplace((frequency + turns).ravel())
    held = -np.expm1(-all_s * hold) / (all_s * hold)
    answers = held * np.exp(-all_s * delay) * model.respond(own, all_s)
    return gain * answers.reshape(len(answers), len(turns), len(s)).sum(axis=1)
