"""What is left of the effort when the model has explained its part."""

from dataclasses import dataclass

import numpy as np

from detent.identify.fit.coloured import independent_rows
from detent.identify.fit.regression import Fit


@dataclass(frozen=True, slots=True)
class Residuals:
    """Residuals of a regression, window by window."""

    rms: float  # root mean square, in the unit of the effort
    relative: float  # the same over the root mean square of the effort
    largest: float  # largest magnitude
    # correlation of neighbours: 0 for independent ones; windows overlap, which alone makes it about 0.4
    neighbours: float
    independent: float  # independent residuals that say as much
    count: int  # windows


def residuals_of(fit: Fit) -> Residuals:
    """Look at the residuals of a fit.

    A correlation of neighbours near 1 says that the model misses something that lasts: friction that changes with
    position, a missing constant, a clock that is wrong.
    """
    e = fit.residual
    power = float(e @ e)
    rms = float(np.sqrt(power / len(e)))
    effort = float(np.sqrt(np.mean(fit.effort**2)))
    return Residuals(
        rms=rms,
        relative=rms / effort if effort > 0.0 else 0.0,
        largest=float(np.abs(e).max()),
        neighbours=float(e[1:] @ e[:-1]) / power if power > 0.0 else 0.0,
        independent=independent_rows(e),
        count=len(e),
    )
