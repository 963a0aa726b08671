"""A sampled loop across the edge of a count: the encoder as a relay of half a count, by Tsypkin's method.

    q(k) = count/2 sign x(k)        x(k+1) = A x(k) + B q(k)        y(k) = C x(k) + D q(k)

About the edge between two counts the encoder tells two places only. A cycle of n samples on either side has
x(n) = -x(0), which gives x(0) = -(I + A^n)^-1 sum A^(n-1-k) B q. It exists where the place has the sign of what is read
in each of the n samples (Tsypkin 1984, Relay Control Systems, ch. 6, for a relay that is sampled).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]

LONGEST = 256  # samples of half a cycle
ZERO = 1e-9  # of a count: so near the edge a place has no sign


class EdgeCycle(NamedTuple):
    """A cycle across the edge of a count."""

    half: int  # samples of half a cycle
    swing: float  # of the place, peak to peak at the samples [count]
    command: float  # of the command, peak to peak, of a count [1/count]


def edge_cycle(a: Numbers, b: Numbers, place: Numbers, command: Numbers, through: float) -> EdgeCycle | None:
    """Find the longest cycle of a loop across the edge of a count.

    The state goes from sample to sample by `a`, shape (n, n), of the loop cut open where the place is read; what is
    read there does `b`, shape (n,), to it, and `through` to the command in the same sample. `place` and `command`, of
    shape (n,), say over the state where the encoder stands and what the loop commands. It is the cycle for a count
    of 1; None where none up to 256 samples long on each side exists. Tsypkin 1984, Relay Control Systems, ch. 6;
    checked by tests/unit/analysis/test_count_edge.py.
    """
    size, found = len(a), None
    power, driven = np.eye(size), np.zeros(size)  # A^k, and the sum of A^j B over j < k
    rows, steps = list[Numbers](), list[Numbers]()
    for half in range(1, LONGEST + 1):
        rows.append(np.stack([place @ power, command @ power]))
        steps.append(np.array([place @ driven, command @ driven + through]))
        driven, power = a @ driven + b, a @ power
        start = np.linalg.solve(np.eye(size) + power, -0.5 * driven)
        places, commands = (np.array(rows) @ start + 0.5 * np.array(steps)).T
        if np.all(places > ZERO):
            swings = [float(2.0 * np.abs(one).max()) for one in (places, commands)]
            found = EdgeCycle(half, *swings)
    return found
