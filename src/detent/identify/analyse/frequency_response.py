"""A measured frequency response, with its coherence and its scatter.

`measure_response` makes one of a recording, `resonances` takes resonances from it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from detent.logs.log import Values

Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """Response of an axis at some frequencies."""

    frequency: Values  # rising [Hz], shape (n,)
    response: Complex  # output over input, shape (n,)
    coherence: Values  # part of the power of the output that the input explains, 0..1, shape (n,)
    # standard deviation of the response: of its magnitude, as a part of it, and of its phase [rad]; shape (n,)
    deviation: Values
    averages: float  # periods, or independent windows, that were averaged
    resolution: float  # width over which the response is an average [Hz]; 0 for a periodic excitation
    method: str  # how it was found, with its figures
    input_unit: str = ""  # and output_unit: units of the two, empty for a pure number
    output_unit: str = ""

    def __len__(self) -> int:
        return len(self.frequency)

    @property
    def magnitude(self) -> Values:
        """Magnitude, in units of the output per unit of the input, shape (n,)."""
        return np.abs(self.response)


def response_deviation(coherence: Values, averages: float) -> Values:
    """Standard deviation of a response by its coherence: of the magnitude, as a part of it, and of the phase [rad].

    ``sqrt((1 - g2) / (2 n g2))``: J. S. Bendat, A. G. Piersol, "Random Data", 4th ed., Wiley 2010, section 9.2.4.

    >>> response_deviation(np.array([0.9]), 10).round(4)
    array([0.0745])
    """
    safe = np.clip(coherence, 1e-12, 1.0)
    return np.sqrt((1.0 - safe) / (2.0 * averages * safe))
