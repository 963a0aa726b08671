"""Whether a log could show a fault at all: what the best test for it would say, that knows its form exactly.

A fault that the constants of another axis explain leaves a log that is as good as one of that axis. What they do not
explain of it is known here, as the clean log is: the residuals of the spoilt log less those of the clean one. Beside
the latter, whatever is looked for, it is so many standard errors large (a matched filter: North, Proc. IEEE 51 (1963)).
"""

import numpy as np

from detent.identify.fit import equations, regression
from detent.identify.fit.chance import student_reach
from detent.identify.fit.estimate import coloured_covariance
from detent.identify.fit.identification import Identification, prepare_all
from detent.identify.fit.steadiness import CHANCE_WHOLE
from detent.logs.log import Values

CLEAR = student_reach(CHANCE_WHOLE, np.inf)
"""Standard errors from which on a test sees one of the dozens of things that it must look for."""


def standard_errors(spoilt: Identification, clean: Identification) -> float:
    """How large a fault is that no constants explain, by what the clean log leaves unexplained."""
    assert spoilt.fit is not None
    assert spoilt.rung is not None
    way, terms, bend = spoilt.fit.instruments, spoilt.rung.terms, spoilt.fit.bend
    half = max(part.motion.kernel.half for found in (spoilt, clean) for part in prepare_all(found.runs, way))
    (rows, left), (others, without) = (_residuals(found, half, way, terms, bend) for found in (spoilt, clean))
    both = np.intersect1d(rows, others)
    if len(both) < 0.5 * len(rows):
        return np.inf  # what the others show is not known
    # Of logs whose rows are not those of the same moments the difference is as large as the residuals: never hidden.
    # How large the noise is nobody knows: where all of the effort is larger, so is that, and nothing else is left.
    left, noise = left[np.isin(rows, both)], without[np.isin(others, both)]
    noise = noise * float((left * noise).sum() / max((noise * noise).sum(), 1e-300))
    column = left - noise
    covariance, _ = coloured_covariance(column[:, None], noise)
    if np.abs(column).max() < 1e-9 * np.abs(left).max():
        return 0.0
    return float(1.0 / np.sqrt(max(covariance[0, 0], 1e-300)))


def _residuals(
    found: Identification, half: int, way: regression.Instruments, terms: tuple[str, ...], bend: float
) -> tuple[equations.Rows, Values]:
    """What a model leaves of the effort of a log, with the rows in the middle of the windows."""
    (run,) = found.runs
    part = regression.prepare(run, equations.make_kernel(half, run.step), way)
    return part.motion.rows, regression.fit_equations([part], terms, bend).residual
