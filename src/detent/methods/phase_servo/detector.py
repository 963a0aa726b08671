"""How far the faults of detector and comparator displace the two edges of a cycle."""

import math
from dataclasses import dataclass

from detent.methods.phase_servo.schema import PhaseServoSpec

EDGE_LIMIT = 0.2  # largest displacement of an edge [turn] (`sensing.phase_detector.JITTER_LIMIT`)
JITTER_PEAK = 3  # peak of the noise over its rms (`kernel.noise.bell`)


@dataclass(frozen=True, slots=True)
class EdgeSeparation:
    """Displacements of an edge in turns of the carrier, and what would still do."""

    # by the comparator's offset where the secondary is weakest; 0.5 where it does not reach the offset at all
    displaced: float
    limit: float  # largest displacement allowed
    largest_offset: float  # largest offset within it, as a fraction of the amplitude
    largest_jitter: float  # largest rms jitter that the offset leaves room for [s]


def edge_separation(spec: PhaseServoSpec) -> EdgeSeparation:
    """Look at the edges of a detector with its faults.

    With the electrical angle x the secondary's amplitude is ``hypot((1 + g) cos x - sin q sin x, cos q sin x)`` (gain
    error g, quadrature error q; `sensing.phase_detector.fill_errors`); its minimum over x is the smaller singular
    value of that matrix, times the amplitude over its nominal.
    """
    table = spec.detector
    gain, q = 1 + table.gain_error, table.quadrature_error
    # Singular values: squares add up to (1 + g)^2 + 1, their product is (1 + g) cos q.
    total, product = gain**2 + 1, gain * math.cos(q)
    weakest = math.sqrt(max(0.0, total - math.sqrt(max(0.0, total**2 - 4 * product**2))) / 2)
    weakest *= table.amplitude
    share = abs(table.offset_error) / weakest
    displaced = math.asin(share) / (2 * math.pi) if share < 1 else 0.5
    largest = min(0.45, weakest * math.sin(2 * math.pi * EDGE_LIMIT))
    room = max(0.0, EDGE_LIMIT - displaced) * spec.detector.counts * spec.tick
    return EdgeSeparation(displaced, EDGE_LIMIT, largest, room / JITTER_PEAK * table.amplitude)
