"""What electronics divide from an oscillator: clocks, the sawtooth of a PWM, a sample period.

Blocks 401 to 406 and 250 of the phase servo (specification 3.1, 3.9). Block 10 of the filtered servo: one strobe drives
speed counter and filter, so that feedback gain, lag and time constant scale together (claim 1).
"""

from detent.kernel.registers import Registers, i2, i4, i8, register, u1
from detent.kernel.step import hot_step


class ClockParams(Registers):
    """Taps of the divider, as masks of its counter."""

    integrate_mask: i8 = register(
        "periods of the oscillator per integration clock, less one", unit="count", range=(0, (1 << 24) - 1)
    )
    sample_mask: i8 = register(
        "periods of the oscillator per speed sample, less one", unit="count", range=(0, (1 << 24) - 1)
    )


class ClockChain(Registers):
    """Divider, toggle flip-flop and the two clocks of the present oscillator period."""

    divider: i8 = register("oscillator periods since power-on", unit="count", range=(0, 1 << 62))
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
    return ((r.divider + 1) >> 1) - 1


@hot_step
def integrate_strobe(p: ClockParams, r: ClockChain) -> bool:
    """The tap of the integration clock has just fallen."""
    return r.divider & p.integrate_mask == 0


@hot_step
def sample_strobe(p: ClockParams, r: ClockChain) -> bool:
    """The tap of the speed sample has just fallen: a pulse of one period."""
    return r.divider & p.sample_mask == 0


class SawtoothParams(Registers):
    """Length of the sawtooth."""

    half: i8 = register("half the counts of one PWM period, 2^(M-1)", unit="count", range=(1, 1 << 15))


class SawtoothPwm(Registers):
    """Sawtooth of the present oscillator period."""

    sawtooth: i2 = register("up counter 252, -2^(M-1) .. 2^(M-1) - 1", unit="count")


@hot_step
def count_sawtooth(p: SawtoothParams, r: SawtoothPwm, word: int) -> int:
    """Request of the next oscillator period with this drive word: 1 plus, -1 minus, 0 neither (once a sawtooth)."""
    s = r.sawtooth + 1
    r.sawtooth = s if s < p.half else -p.half
    return (1 if word > r.sawtooth else 0) - (1 if word < r.sawtooth else 0)


class SampleClock(Registers):
    """Period asked for, period of the running window, clocks left in it."""

    demanded: i4 = register("period of the next window, written by the host", unit="us")
    period: i4 = register("period of the running window", unit="us")
    left: i4 = register("decoder clocks until the strobe", unit="count")


@hot_step
def count_clock(r: SampleClock) -> bool:
    """One decoder clock; True at the strobe CS."""
    r.left -= 1
    if r.left > 0:
        return False
    r.period = r.demanded
    r.left = r.period
    return True
