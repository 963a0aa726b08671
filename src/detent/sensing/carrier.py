"""Two-phase carrier of a resolver or Inductosyn: eight current levels per cycle (phase-servo specification 3.2).

A counter, four XOR gates and one flip-flop switch two resistors per coil; the second coil lags a quarter cycle. A
capacitor across each coil keeps the fundamental: what the detector sees is that sine.
"""

from detent.kernel.registers import Registers, i8, register, u1, u2
from detent.kernel.step import hot_step, step


class CarrierParams(Registers):
    """Length of the carrier cycle."""

    mask: i8 = register("counts per cycle N, less one", unit="count")
    shift: i8 = register("log2 N - 3: the counter's bits below the three that are decoded", unit="count")


class Carrier(Registers):
    """Drive counter and the switches it works."""

    count: u2 = register("drive counter 451", unit="count")
    delayed_msb: u1 = register("flip-flop 465: the counter's top bit a quarter cycle later")
    switches: u1 = register("transistors on: bit 0 a, 1 b of the first coil, 2 a', 3 b' of the second", unit="code")


@hot_step
def count_carrier(p: CarrierParams, r: Carrier) -> None:
    """One first clock: count, and at the beginning of a slot set the switches."""
    r.count = (r.count + 1) & p.mask
    if r.count & ((1 << p.shift) - 1) == 0:
        set_switches(r, r.count >> p.shift)


@hot_step
def set_switches(r: Carrier, slot: int) -> None:
    """Switches of one of the eight slots of the cycle; b3 is the top bit of the counter, b2 and b1 the next two."""
    b3 = slot >> 2
    b2 = (slot >> 1) & 1
    b1 = slot & 1
    if b2 == 1 and b1 == 0:
        r.delayed_msb = b3  # clocked by the rising edge of b2
    a = b3 ^ b2
    b = b3 ^ b1
    a_delayed = r.delayed_msb ^ (b2 ^ 1)
    b_delayed = r.delayed_msb ^ b1
    r.switches = a | b << 1 | a_delayed << 2 | b_delayed << 3


@step
def reset_carrier(r: Carrier) -> None:
    """Power-on clear, common with the counters of both converters."""
    r.count = 0
    r.delayed_msb = 1  # as the cycle before would have left it
    set_switches(r, 0)
