"""What an identified model says without a simulation: friction over the speed, the response of a rigid axis."""

import numpy as np

from detent.identify.fit.constants import Constants
from detent.identify.fit.estimate import quantile
from detent.page.parts import Numbers


def friction_at(constants: Constants, values: Numbers, velocity: Numbers) -> Numbers:
    """Friction of the model, signed as the velocity, with any values of its constants."""
    known = dict(zip(constants.names, values.tolist(), strict=True))
    total = np.zeros(len(velocity))
    for way, sign in (("positive", 1.0), ("negative", -1.0)):
        speed = sign * velocity
        coulomb = known.get(f"coulomb.{way}", 0.0)
        excess = known.get(f"static.{way}", coulomb) - coulomb
        bristle = np.exp(-np.minimum((speed / known["stribeck"]) ** 2, 50.0)) if known.get("stribeck") else 0.0
        total += np.where(
            speed > 0.0, sign * (coulomb + excess * bristle + known.get(f"viscous.{way}", 0.0) * speed), 0.0
        )
    return total


def friction_limits(constants: Constants, velocity: Numbers) -> Numbers:
    """Half of the 95 % interval of the friction at some velocities, from the covariance of all its constants."""
    slopes: list[Numbers] = []
    for k, error in enumerate(constants.errors):
        step = np.zeros(len(constants.names))
        step[k] = 1e-3 * error
        more, less = (friction_at(constants, constants.values + sign * step, velocity) for sign in (1.0, -1.0))
        slopes.append((more - less) / (2e-3 * error) if error > 0.0 else np.zeros(len(velocity)))
    slope = np.array(slopes)
    variance = np.einsum("in,ij,jn->n", slope, constants.covariance, slope)
    degrees = float(constants.degrees[slope.any(axis=1)].min(initial=np.inf))
    return quantile(degrees) * np.sqrt(np.maximum(variance, 0.0))


def respond(constants: Constants, frequency: Numbers) -> Numbers | None:
    """Response of position to effort by mass, viscous friction and delay alone, complex, shape (n,)."""
    mass = constants.value("mass")
    if mass <= 0.0:
        return None
    s = 2j * np.pi * frequency
    viscous = max(0.5 * (constants.value("viscous.positive") + constants.value("viscous.negative")), 0.0)
    return np.exp(-s * constants.value("delay")) / (mass * s**2 + viscous * s)
