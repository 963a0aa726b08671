"""Motor and load of `plant.two_mass` as linear equations, of anything that has the names of its parameters.

Friction stands for its slope over speed, the flanks of a backlash touch, and a load that hangs does so near its lowest
place. No compiled block loads for it.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class LinearPlant:
    """Equations x' = A x + b u: current (where the winding has inductance), position and velocity of motor, of load.

    Of many machines at once, whose constants are arrays, both matrices are stacks of theirs.
    """

    a: Numbers  # shape (..., n, n), n = 2 to 5
    b: Numbers  # shape (..., n); the input is what the amplifier puts out, a voltage [V] or a force [N]
    motor: int  # and load: places of both positions in x; the same where the coupling is rigid
    load: int


def linear_plant(p: Any, drags: tuple[float, float]) -> LinearPlant:
    """Equations of both masses with so much viscous friction [N.s/m]."""
    w, coupled = p.winding, bool(np.all(p.stiffness > 0.0))
    first = 1 if w.used and w.inductance > 0.0 else 0
    load = first + 2 if coupled else first
    mass, load_mass = (p.motor.mass, p.load.mass) if coupled else (p.motor.mass + p.load.mass,) * 2
    many = np.broadcast_shapes(*map(np.shape, (mass, load_mass, p.stiffness, p.damping, p.pendulum, *drags)),
                               np.shape(w.resistance) if w.used else ())  # fmt: skip
    a, b = np.zeros((*many, load + 2, load + 2)), np.zeros((*many, load + 2))
    a[..., first, first + 1] = a[..., load, load + 1] = 1.0
    a[..., first + 1, first + 1] = -drags[0] / mass
    a[..., load + 1, load + 1] -= drags[1] / load_mass
    a[..., load + 1, load] = -p.pendulum / load_mass
    if coupled:
        twist = np.stack(np.broadcast_arrays(-p.stiffness, -p.damping, p.stiffness, p.damping), axis=-1)
        a[..., first + 1, first:] += twist / np.asarray(mass)[..., None]
        a[..., load + 1, first:] -= twist / np.asarray(load_mass)[..., None]
    if not w.used:
        b[..., first + 1] = 1.0 / mass
    elif first == 0:  # the current follows at once, and the back-EMF brakes
        b[..., 1] = w.force_constant / w.resistance / mass
        a[..., 1, 1] -= b[..., 1] * w.emf_constant
    else:
        a[..., 0, 0], a[..., 0, 2] = -w.resistance / w.inductance, -w.emf_constant / w.inductance
        a[..., 2, 0], b[..., 0] = w.force_constant / mass, 1.0 / w.inductance
    return LinearPlant(a, b, first, load)


def fastest_rate(p: Any) -> Any:
    """Largest magnitude of the eigenvalues of motor, coupling and load, with the steepest friction [1/s].

    Of many machines at once, an array.

    Times the tick it should be 1 at most: a swing of that rate then loses 0.7 % of its amplitude per radian.
    """
    plant = linear_plant(p, (_steepest(p.motor.friction), _steepest(p.load.friction)))
    rates = np.max(np.abs(np.linalg.eigvals(plant.a)), axis=-1)
    return rates if np.ndim(rates) else float(rates)


def _steepest(friction: Any) -> Any:
    """Largest slope of the friction of both directions, its falling part included [N.s/m]."""
    steepest: Any = 0.0
    for d in (friction.positive, friction.negative):
        # The curve falls steepest at vs / sqrt(2); a Stribeck velocity of 0 has no falling part.
        has = np.greater(d.stribeck, 0.0)
        falls = np.where(has, (d.static - d.coulomb) * math.sqrt(2.0 / math.e) / np.where(has, d.stribeck, 1.0), 0.0)
        steepest = np.maximum(steepest, np.maximum(d.viscous, falls - d.viscous))
    return steepest
