"""The dirt that an identification must name or refuse, in sizes drawn by lot for each log; no rule was chosen with it.

The kinds are those of `faults`, from a half to twice of what they are there, and smaller where that is harder to see.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tests.trust.faults import (
    Fault,
    Spoil,
    clipped,
    copied,
    digits,
    drift,
    filtered,
    foreign_velocity,
    held,
    holes,
    jitter,
    late,
    levels,
    load_added,
    lost,
    other_half,
    play,
    rounded_time,
    slip,
    spikes,
    steps,
    twice,
    warped,
    wavy,
)


class Lots:
    """Sizes and counts by lot, each of its decades as likely."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng

    def size(self, least: float, most: float) -> float:
        return float(np.exp(self._rng.uniform(np.log(least), np.log(most))))

    def count(self, least: int, most: int) -> int:
        return round(self.size(least, most))


def drawn(make: Callable[[Lots], Spoil]) -> Spoil:
    """A fault whose sizes are drawn for each log."""
    return lambda table, rng: make(Lots(rng))(table, rng)


_KINDS = (
    Fault("spikes of the position", drawn(lambda lot: spikes("position", lot.count(1, 50), lot.size(1e-3, 0.1)))),
    Fault("spikes of the effort", drawn(lambda lot: spikes("effort", lot.count(1, 50), lot.size(2.0, 40.0)))),
    Fault("steps of the position", drawn(lambda lot: steps("position", lot.size(2e-3, 0.06), lot.count(1, 10)))),
    Fault(
        "the position off in a tenth of the log",
        drawn(lambda lot: steps("position", lot.size(5e-3, 0.2), back=True)),
    ),
    Fault("effort in steps", drawn(lambda lot: levels("effort", lot.count(5, 40)))),
    Fault("position in steps", drawn(lambda lot: levels("position", lot.count(100, 2000)))),
    Fault("effort behind a filter", drawn(lambda lot: filtered("effort", factor=lot.size(0.25, 2.0)))),
    Fault("position behind a filter", drawn(lambda lot: filtered("position", factor=lot.size(0.25, 2.0)))),
    Fault("effort with an offset that drifts", drawn(lambda lot: drift(offset=lot.size(0.1, 0.8)))),
    Fault("effort with a gain that drifts", drawn(lambda lot: drift(gain=lot.size(0.08, 0.5)))),
    Fault("effort with a step in its offset", drawn(lambda lot: drift(offset=lot.size(0.1, 0.6), step=True))),
    Fault("effort with a step in its gain", drawn(lambda lot: drift(gain=lot.size(0.08, 0.5), step=True))),
    Fault("stamps with jitter", drawn(lambda lot: jitter(lot.size(0.2, 2.0)))),
    Fault("stamps in steps", drawn(lambda lot: rounded_time(lot.size(1.2, 10.0)))),
    Fault("a clock that drifts", drawn(lambda lot: warped(lot.size(0.02, 0.3)))),
    Fault("rows lost without trace", drawn(lambda lot: lost(share=lot.size(5e-3, 0.2)))),
    Fault("a stretch lost without trace", drawn(lambda lot: lost(seconds=lot.size(0.1, 1.0)))),
    Fault("rows lost, the time shows it", drawn(lambda lot: lost(share=lot.size(0.02, 0.4), traced=True))),
    Fault("rows written twice", drawn(lambda lot: twice(lot.size(5e-3, 0.1)))),
    Fault("the reference in the place of the position", drawn(lambda _: copied("position", "reference")), "reference"),
    Fault("a second half of another axis", drawn(lambda lot: other_half(lot.size(1.2, 3.0)))),
    Fault(
        "a second half with another gain of the effort",
        drawn(lambda lot: other_half(lot.size(1.1, 2.0), both=False)),
    ),
    Fault("a load put on", drawn(lambda lot: load_added(lot.size(0.15, 1.0)))),
    Fault("a coupling that slips", drawn(lambda lot: slip(lot.size(2e-3, 0.04), lot.count(2, 20)))),
    Fault("backlash before the sensor", drawn(lambda lot: play(lot.size(3e-3, 0.03)))),
    Fault("a wavy sensor", drawn(lambda lot: wavy(lot.size(1e-3, 0.01)))),
    Fault("position to a few digits", drawn(lambda lot: digits("position", lot.count(2, 4)))),
    Fault("effort to a few digits", drawn(lambda lot: digits("effort", lot.count(1, 2)))),
    Fault("time to a few digits", drawn(lambda lot: digits("time", lot.count(3, 5)))),
    Fault("no position in the first rows", drawn(lambda lot: holes("position", 1, lot.count(10, 400), first=True))),
    Fault("no position here and there", drawn(lambda lot: holes("position", lot.count(3, 20), lot.count(5, 60)))),
    Fault("no effort here and there", drawn(lambda lot: holes("effort", lot.count(3, 20), lot.count(5, 60)))),
    Fault("a velocity of another motion", drawn(lambda _: foreign_velocity)),
    Fault("effort recorded late", drawn(lambda lot: late("effort", lot.size(0.015, 0.1)))),
    Fault("position recorded late", drawn(lambda lot: late("position", lot.size(0.015, 0.1)))),
    Fault("effort clipped", drawn(lambda lot: clipped("effort", lot.size(0.3, 0.8)))),
    Fault("effort updated in every few rows", drawn(lambda lot: held("effort", lot.count(3, 30)))),
)

DRAWN = tuple(replace(fault, name=f"{fault.name} (by lot)") for fault in _KINDS)
"""Kinds by lot, of names of their own."""
