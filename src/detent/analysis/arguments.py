"""Checks that every closed form makes of the constants it is given."""

from math import isfinite, isnan

from detent.errors import DetentError


def require_positive(name: str, value: float, unit: str, meaning: str, *, infinite: bool = False) -> None:
    """Refuse a constant that is not above 0.

    >>> require_positive("SampledLoop.gain", 4000.0, "1/s^2", "drive word to acceleration")
    """
    if value > 0 and (infinite or isfinite(value)):
        return
    allowed = f"above 0{' or inf' if infinite else ' and finite'}"
    raise DetentError(f"{name}: came {value:g} {unit}".rstrip() + f"; allowed: {allowed}; do: state {meaning}")


def require_between(name: str, value: float, low: float, high: float, meaning: str) -> None:
    """Refuse a pure number outside low < value <= high; `DetentError` says so."""
    if isnan(value) or not low < value <= high:
        raise DetentError(f"{name}: came {value:g}; allowed: above {low:g}, up to {high:g}; do: state {meaning}")


def require_not_negative(name: str, value: float, unit: str, meaning: str) -> None:
    """Refuse a constant below 0 or not finite; `DetentError` says so."""
    if not (value >= 0 and isfinite(value)):
        came = f"{value:g} {unit}".rstrip()
        raise DetentError(f"{name}: came {came}; allowed: 0 or above, finite; do: state {meaning}")


def require_count(name: str, value: int, least: int, meaning: str) -> None:
    """Refuse a whole number below `least`; `DetentError` says so."""
    if value < least:
        raise DetentError(f"{name}: came {value}; allowed: {least} or more; do: state {meaning}")
