"""Oscillator, two-phase clock and divider (phase-servo specification 3.1; blocks 401 to 406)."""

from detent.kernel.registers import Registers, i8, register, u1
from detent.kernel.step import hot_step


class ClockParams(Registers):
    """Taps of the divider, as masks of its counter."""

    integrate_mask: i8 = register("periods of the oscillator per integration clock, less one", unit="count")
    sample_mask: i8 = register("periods of the oscillator per speed sample, less one", unit="count")


class ClockChain(Registers):
    """Divider, toggle flip-flop and the two clocks of the present oscillator period."""

    divider: i8 = register("oscillator periods since power-on", unit="count")
    toggle: u1 = register("toggle flip-flop 403: which of the two clocks is next")
    ck1: u1 = register("first reference clock, active in the high half of this oscillator period")
    ck2: u1 = register("second reference clock, active in the high half of this oscillator period")


@hot_step
def next_period(r: ClockChain) -> None:
    """One oscillator period: the flip-flop toggles and lets one of the two clocks through."""
    r.divider += 1
    r.toggle ^= 1
    r.ck1 = r.toggle
    r.ck2 = r.toggle ^ 1


@hot_step
def reference_period(r: ClockChain) -> int:
    """Number of the present period of the reference clocks, two of the oscillator; the first is 0."""
    return (r.divider - 1) >> 1


@hot_step
def integrate_strobe(p: ClockParams, r: ClockChain) -> bool:
    """The tap of the integration clock has just fallen."""
    return r.divider & p.integrate_mask == 0


@hot_step
def sample_strobe(p: ClockParams, r: ClockChain) -> bool:
    """The tap of the speed sample has just fallen: a pulse of one period."""
    return r.divider & p.sample_mask == 0
