"""Made-up comparisons of a phase servo: small enough to know every number."""

import numpy as np

from detent.methods.phase_servo.comparison import HoldCase, HoldComparison, NoiseComparison

STEP = 10e-6
"""A step of the made-up servo [m]."""


def noise_comparison() -> NoiseComparison:
    """One step left for every + pulse if only counted; on the target with 8 pulses, a pitch short with 30."""
    pulses = (0, 8, 30)
    counted = np.array(pulses, dtype=float)
    incremental = np.stack([np.stack([-counted, -counted], 1), np.stack([counted, counted], 1)], 1)
    absolute = np.zeros((3, 2, 2))
    absolute[2] = [[-64, 64], [-64, 64]]
    return NoiseComparison(
        pulses=pulses, absolute=absolute, incremental=incremental, step=STEP, counts=64, margin=24, pitches=6
    )


def hold_comparison() -> HoldComparison:
    """It swings by 0.8 steps unless stopped at 41 ms; 3 N from 30 ms on push it 2 steps, the integral pulls back."""
    t = np.arange(0.021, 0.2, 1e-4)
    swing = 0.4 * np.sign(np.sin(2 * np.pi * 100 * t))
    arriving = np.where(t < 0.023, -8.0, 0.0)

    def case(name: str, displacement: np.ndarray, integral: float = 0.0) -> HoldCase:
        return HoldCase(
            name=name, about=f"what is <special> in {name}", t=t, displacement=displacement + arriving,
            integral=np.where(t < 0.05, 0, integral).astype(np.int64), word=np.zeros(len(t), dtype=np.int64),
        )  # fmt: skip

    pushed = np.where(t < 0.03, 0.0, 2.0)
    return HoldComparison(
        still=(case("for ever", swing), case("as is", np.where(t < 0.041, swing, 0.1)), case("D = 0", swing)),
        loaded=(case("with it", np.where(t < 0.05, pushed, 0.7), -6), case("without it", pushed)),
        push=3.0,
        push_at=0.03,
        stop_at=0.041,
        step=STEP,
    )
