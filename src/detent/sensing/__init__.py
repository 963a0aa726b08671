"""From motion to numbers: encoders, quadrature, counters."""
