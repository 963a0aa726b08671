"""What the switches of the carrier mean: currents of both coils (phase-servo specification 3.2, block 461)."""

from detent.sensing.phase_converters import Carrier

LARGE = 3.0  # current through the small resistor R461, in units of the other's (1/R462): about 3


def coil_currents(r: Carrier, large: float) -> tuple[float, float]:
    """Currents of both coils in units of supply / R462; `large` is the ratio R462 / R461."""
    s = r.switches
    return large * (s & 1) + (s >> 1 & 1), large * (s >> 2 & 1) + (s >> 3 & 1)
