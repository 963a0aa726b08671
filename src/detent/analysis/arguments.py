"""The constants that closed forms are given: what each may be, and what it is."""

from collections.abc import Callable
from math import inf

from detent.errors import DetentError

ALLOWED: dict[str, Callable[[float], bool]] = {
    "above 0 and finite": lambda value: 0 < value < inf,
    "above 0 or inf": lambda value: value > 0,
    "0 or above, finite": lambda value: 0 <= value < inf,
    "above 0, up to 1": lambda value: 0 < value <= 1,
    "1 or more": lambda value: value >= 1,
}
CONSTANTS = {
    "gain": ("above 0 and finite", "1/s^2", "K = K3*K4, drive word to acceleration"),
    "position_gain": ("above 0 and finite", "", "K1"),
    "speed_gain": ("above 0 and finite", "s", "K2 = B*TS"),
    "sample_period": ("above 0 and finite", "s", "the sample period TS"),
    "scale": ("above 0 and finite", "", "the scale B of the speed count"),
    "coefficient": ("above 0, up to 1", "", "A = TS/Tf, 1 for no filter"),
    "filter_time": ("0 or above, finite", "s", "the lag Tf, 0 for no filter"),
    "tau_m": ("above 0 or inf", "s", "the mechanical time constant"),
    "rate": ("above 0 and finite", "pulses/s", "the rate of the command pulses"),
    "samples": ("1 or more", "", "how many values to compute"),
    "points": ("1 or more", "", "how many instants of each window to compute"),
}
"""What each may be, its unit, and what to state."""


def check_constants(place: str = "", **values: float) -> None:
    """Refuse a constant that is not as its name allows; `DetentError` says so.

    >>> check_constants("SampledLoop.", gain=4000.0, coefficient=1.0)
    """
    for name, value in values.items():
        allowed, unit, meaning = CONSTANTS[name]
        if not ALLOWED[allowed](value):
            got = f"{value:g} {unit}".rstrip()
            raise DetentError(f"{place}{name}: got {got}; expected: {allowed}; try: state {meaning}")
