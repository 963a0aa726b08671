"""A made-up comparison of a filtered servo: small enough to know every number."""

import math

import numpy as np

from detent.methods.filtered_servo.comparison import FeedbackCase, FeedbackComparison


def feedback_comparison() -> FeedbackComparison:
    """Four cases, the third unstable."""
    t = np.arange(7.8, 8.0, 1e-3)

    def case(name: str, window: float, scale: int, coefficient: float, limit: float, ripple: float) -> FeedbackCase:
        stable = limit > 4000
        return FeedbackCase(
            name=name, sample_period=window, scale=scale, coefficient=coefficient, kv=1 / (scale * window),
            std_speed=ripple, std_error=ripple, force_ripple=2 * ripple, error_range=(-ripple, 2 * ripple),
            stop_overshoot=2.0 if stable else math.nan, stable=stable, gain_limit=limit, gain_margin=limit / 4000,
            t=t, error=ripple * np.sign(np.sin(50 * t)), speed_word=20 + ripple * np.sign(np.sin(50 * t)),
        )  # fmt: skip

    return FeedbackComparison(
        cases=(
            case("<conventional>", 5e-3, 4, 1.0, 16000, 1.8),
            case("with filter", 5e-3, 4, 0.25, 10000, 0.6),
            case("long window", 20e-3, 1, 1.0, 2740, 100.0),
            case("small multiplier", 5e-3, 1, 1.0, 44000, 0.5),
        ),
        rate=1037.0,
        gain=4000.0,
        tau_m=math.inf,
    )
