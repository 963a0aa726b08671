"""Excitations to record: multisines and chirps within limits, as arrays and as a file of commands.

A multisine excites the lines that are asked for and nothing else, comes back in each period, and with good phases is
little higher than a sine of its power; a chirp runs through all frequencies between two (R. Pintelon, J. Schoukens,
"System Identification: A Frequency Domain Approach", 2nd ed., Wiley 2012, chapter 5).
"""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from detent.errors import DetentError
from detent.logs.log import Values

FEWEST_PERIODS = 3
"""Periods to record at least: one to settle, two to tell noise from the response."""


@dataclass(frozen=True, slots=True)
class Limits:
    """What an excitation may not exceed, in units of the excitation."""

    size: float  # largest magnitude
    rate: float = math.inf  # largest magnitude of its rate [1/s], such as the velocity of a reference
    # largest magnitude of its second derivative [1/s^2], such as the acceleration of a reference
    bend: float = math.inf

    def __post_init__(self) -> None:
        """Refuse limits that leave nothing."""
        for name in ("size", "rate", "bend"):
            value = getattr(self, name)
            if not value > 0 or (name == "size" and math.isinf(value)):
                raise DetentError(
                    f"excitation: came a limit {name} of {value:g}; allowed: above 0, and a finite size; state what "
                    "the axis can do"
                )


@dataclass(frozen=True, eq=False)
class Excitation:
    """An excitation, ready to be played."""

    t: Values  # time [s], from 0, shape (n,)
    values: Values  # shape (n,)
    frequency: Values  # excited lines [Hz], shape (lines,)
    period: float  # time after which it comes back [s]
    text: str  # what it is, for a person


def make_multisine(  # noqa: PLR0913 - what a multisine has
    band: tuple[float, float],
    period: float,  # period [s]; its reciprocal is the distance of two lines
    step: float,  # time between two samples [s]
    limits: Limits,
    *,
    periods: int = 10,
    seed: int | None = None,
    odd: bool = False,
) -> Excitation:
    """Make a multisine with lines of equal amplitude.

    >>> made = make_multisine((1.0, 20.0), 2.0, 1e-3, Limits(0.5), periods=3)
    >>> len(made.t), len(made.frequency), round(float(abs(made.values).max()), 6)
    (6000, 39, 0.5)
    """
    _check_band(band, step, periods)
    rows = _rows_of(period, step)
    length = rows * step
    numbers = _lines_within(band, rows, length, odd=odd)
    count = len(numbers)
    phases = _schroeder_phases(count) if seed is None else _random_phases(seed, count)
    spectrum = np.zeros(rows // 2 + 1, dtype=np.complex128)
    spectrum[numbers] = np.exp(1j * phases)
    omega = 2j * np.pi * np.arange(len(spectrum)) / length
    once, rate, bend = (np.fft.irfft(spectrum * omega**power, rows) for power in range(3))
    scale = _scale(once, rate, bend, limits)
    once = scale * np.roll(once, -int(np.argmin(np.abs(once))))
    lines = f"{count} {'odd ' if odd else ''}lines from {numbers[0] / length:.4g} to {numbers[-1] / length:.4g} Hz"
    kind = "Schroeder phases" if seed is None else f"random phases of seed {seed}"
    text = f"multisine of {lines}, {periods} periods of {length:.6g} s, {kind}"
    t = step * np.arange(rows * periods, dtype=np.float64)
    return Excitation(t, np.tile(once, periods), numbers / length, length, text)


def _rows_of(period: float, step: float) -> int:
    """Samples of a period, 2 or more."""
    rows = round(period / step)
    if rows < 2:
        raise DetentError(f"excitation: came a period of {period:g} s; allowed: two samples of {step:g} s or more")
    return rows


def _schroeder_phases(count: int) -> Values:
    """Phases [rad] of lines of equal amplitude that make low peaks."""
    order = np.arange(1, count + 1)
    return -np.pi * order * (order - 1) / count


def _lines_within(band: tuple[float, float], rows: int, length: float, *, odd: bool) -> NDArray[np.int64]:
    """Numbers of the lines of a period [s] that lie in a band [Hz]."""
    numbers = np.arange(1, (rows + 1) // 2)
    inside = (numbers >= band[0] * length * (1 - 1e-9)) & (numbers <= band[1] * length * (1 + 1e-9))
    numbers = numbers[inside & (numbers % 2 == 1)] if odd else numbers[inside]
    if not len(numbers):
        raise DetentError(
            f"excitation: came a band from {band[0]:g} to {band[1]:g} Hz with lines {1 / length:g} Hz apart; allowed: "
            "a band that holds a line; make the period longer"
        )
    return numbers


def make_chirp(
    band: tuple[float, float], period: float, step: float, limits: Limits, *, periods: int = 10
) -> Excitation:
    """Make a chirp that runs from one frequency to the other and starts again.

    Its amplitude falls where rate or second derivative would exceed their limits; so a reference may be wide at low
    frequencies and small at high ones.
    """
    _check_band(band, step, periods)
    rows = round(period / step)
    length = rows * step
    t = step * np.arange(rows)
    # A whole number of turns in a period, so that its end meets its beginning.
    turns = max(1, round(0.5 * (band[0] + band[1]) * length))
    grow = 2.0 * (turns - band[0] * length) / length**2
    angle = 2 * np.pi * (band[0] + 0.5 * grow * t) * t
    omega = 2 * np.pi * (band[0] + grow * t)
    size = np.minimum(limits.size, np.minimum(limits.rate / omega, limits.bend / omega**2))
    once = size * np.sin(angle)
    # The amplitude changes too; what that adds to the derivatives is taken off all of it.
    rate = np.gradient(once, step)
    once *= _scale(once, rate, np.gradient(rate, step), limits, most=1.0)
    numbers = np.arange(math.ceil(band[0] * length - 1e-9), math.floor(band[1] * length + 1e-9) + 1)
    text = f"chirp from {band[0]:.4g} to {band[1]:.4g} Hz, {periods} periods of {length:.6g} s"
    return Excitation(
        step * np.arange(rows * periods, dtype=np.float64), np.tile(once, periods), numbers / length, length, text
    )


def write_excitation(path: Path, excitation: Excitation, heading: str) -> None:
    """Write an excitation as comma-separated values: time and value, one line per sample."""
    lines = [f"# {excitation.text}", f"t [s],{heading}"]
    lines += [
        f"{t:.9g},{value:.9g}" for t, value in zip(excitation.t.tolist(), excitation.values.tolist(), strict=True)
    ]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _random_phases(seed: int, count: int) -> Values:
    return np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, count)


def _scale(once: Values, rate: Values, bend: Values, limits: Limits, most: float = math.inf) -> float:
    """Factor with which no limit is exceeded."""
    parts = [
        limit / float(np.abs(values).max())
        for values, limit in ((once, limits.size), (rate, limits.rate), (bend, limits.bend))
        if float(np.abs(values).max()) > 0
    ]
    return min([most, *parts])


def _check_band(band: tuple[float, float], step: float, periods: int) -> None:
    """Refuse a band or a clock that makes no excitation."""
    if not (step > 0 and 0 < band[0] < band[1] < 0.5 / step) or periods < FEWEST_PERIODS:
        top = f"{0.5 / step:g} Hz" if step > 0 else "half the sample rate"
        raise DetentError(
            f"excitation: came a band from {band[0]:g} to {band[1]:g} Hz, samples of {step:g} s, {periods} periods; "
            f"allowed: a rising band above 0 and below {top}, samples above 0 s, {FEWEST_PERIODS} periods or more"
        )
