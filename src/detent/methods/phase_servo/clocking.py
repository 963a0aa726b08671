"""How the registers of a phase servo change inside a tick, for timing diagrams."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.methods.phase_servo.schema import PhaseServoSpec
from detent.record.capture import Clocking
from detent.record.waveforms import Phase


def phase_servo_clocking(spec: PhaseServoSpec) -> Clocking:
    """First clock and sawtooth as a tick begins, pulses while the second clock is active, samplers as it ends."""
    tracking = "controller.converters.tracking"
    mask, half = spec.detector.counts - 1, 1 << (spec.drive.pwm_bits - 1)

    def reference(rows: Any) -> NDArray[Any]:
        """Reference counter after the first clock: without the pulse of the second."""
        plus, minus = (rows[f"{tracking}.{sign}"].astype(np.int64) for sign in ("plus", "minus"))
        return (rows[f"{tracking}.reference"] - plus + minus) & mask

    def sawtooth(rows: Any) -> NDArray[Any]:
        """Sawtooth in the first of the two oscillator periods."""
        return (rows["controller.pwm.sawtooth"].astype(np.int64) - 1 + half) % (2 * half) - half

    def request(rows: Any) -> NDArray[Any]:
        """Request in the first of the two oscillator periods."""
        return rows["lines.first_request"]

    pulse = Phase(pulse=(0.5, 0.75))
    return Clocking(
        phases={
            tracking: Phase(0.75),
            f"{tracking}.gate": pulse,
            f"{tracking}.plus": pulse,
            f"{tracking}.minus": pulse,
            "controller.speed": Phase(0.75),
            "controller.sequencer": Phase(0.75),
            "controller.law": Phase(0.75),
        },
        clocks={
            "controller.clocks.CK1": ((0.0, 0.25), "first reference clock"),
            "controller.clocks.CK2": ((0.5, 0.75), "second reference clock"),
        },
        between={f"{tracking}.reference": reference, "controller.pwm.sawtooth": sawtooth, "lines.request": request},
        needs=(f"{tracking}.plus", f"{tracking}.minus", "controller.pwm.sawtooth", "lines.first_request"),
    )
