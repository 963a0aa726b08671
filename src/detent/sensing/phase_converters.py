"""Carrier of a resolver or Inductosyn, and what makes steps of its phase (phase-servo specification 3.2, 3.4, 3.5).

Carrier: eight current levels per cycle; four XOR gates and a flip-flop switch two resistors per coil, the second coil a
quarter cycle later. A capacitor across each coil keeps the fundamental: what the detector sees is that sine.

Tracking (block 550): a reference counter keeps in phase with the comparator's square wave by counting once more or once
less per cycle; each such correction is a pulse, a step. Order inside a reference period: `count_reference` with the
first clock, `emit_pulse` while the second is active, `shift_samples` at its trailing edge.
"""

from detent.kernel.compiled import copy_back, local_copy
from detent.kernel.registers import Registers, block, i8, register, u1, u2
from detent.kernel.step import hot_step, step


class CarrierParams(Registers):
    """Length of the carrier cycle."""

    mask: i8 = register("counts per cycle N, less one", unit="count", range=(0, 0xFFFF))
    shift: i8 = register("log2 N - 3: the counter's bits below the three that are decoded", unit="count", range=(0, 13))


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


class TrackingParams(Registers):
    """Length of the reference counter and the repair of its false lock."""

    mask: i8 = register("counts per cycle N, less one", unit="count", range=(0, 0xFFFF))
    top: i8 = register("number of the counter's top bit", unit="count", range=(0, 15))
    leave_antiphase: u1 = register(
        "1 takes a falling edge of PS at the gate for a lead: no false lock at antiphase", option=True
    )


class TrackingConverter(Registers):
    """Reference counter, samplers and pulses."""

    reference: u2 = register("reference counter 564", unit="count")
    ps_first: u1 = register("flip-flop 551: PS")
    ps_second: u1 = register("flip-flop 552: PS a tick earlier")
    msb_first: u1 = register("flip-flop 553: top bit of the reference counter")
    msb_second: u1 = register("flip-flop 554: top bit a tick earlier")
    gate: u1 = register("gate 562: the top bit has just risen")
    plus: u1 = register("+ pulse 550a of this tick")
    minus: u1 = register("- pulse 550b of this tick")


@hot_step
def count_reference(p: TrackingParams, r: TrackingConverter) -> None:
    """First clock."""
    r.reference = (r.reference + 1) & p.mask


@hot_step
def emit_pulse(p: TrackingParams, r: TrackingConverter) -> None:
    """Second clock active: at the gate, PS already high twice is a lead, still low twice a lag."""
    r.gate = r.msb_first & (r.msb_second ^ 1)
    r.plus = 0
    r.minus = 0
    if r.gate:
        # Seen at the gate, PS that has just fallen is half a cycle away: neither lead nor lag, unless it counts as one.
        r.plus = r.ps_second & (r.ps_first | p.leave_antiphase)
        r.minus = (r.ps_first | r.ps_second) ^ 1
        r.reference = (r.reference + r.plus - r.minus) & p.mask


@hot_step
def shift_samples(p: TrackingParams, r: TrackingConverter, ps: int) -> None:
    """Trailing edge of the second clock."""
    r.ps_second = r.ps_first
    r.ps_first = ps
    r.msb_second = r.msb_first
    r.msb_first = r.reference >> p.top


class AbsoluteParams(Registers):
    """Length of the free counter."""

    mask: i8 = register("counts per cycle N, less one", unit="count", range=(0, 0xFFFF))
    top: i8 = register("number of the counter's top bit", unit="count", range=(0, 15))


class AbsoluteConverter(Registers):
    """Counters and latch."""

    free: u2 = register("free counter 601", unit="count")
    msb: u1 = register("its top bit")
    gated: u2 = register(
        "gated counter 603: ticks since the last latch in which PS and the top bit differed", unit="count"
    )
    word: u2 = register("latch 604: absolute position word 600a, 0..N", unit="count")
    latched: u1 = register("1 in the tick that renewed the word")


@hot_step
def count_absolute(p: AbsoluteParams, r: AbsoluteConverter, ps: int) -> None:
    """One first clock: where the top bit rises, latch and then clear; count while PS and the top bit differ."""
    r.free = (r.free + 1) & p.mask
    before = r.msb
    r.msb = r.free >> p.top
    r.latched = r.msb & (before ^ 1)
    if r.latched:
        r.word = r.gated
        r.gated = 0
    r.gated += r.msb ^ ps


@hot_step
def absolute_error(p: AbsoluteParams, r: AbsoluteConverter) -> int:
    """Error word e in steps, target - actual: half the word from its middle; its lowest bit is 0 at 50 % duty."""
    return (r.word >> 1) - ((p.mask + 1) >> 2)


# ---- all three


class ConverterParams(Registers):
    """Everything that the clocked logic between comparator and pulses reads."""

    carrier: CarrierParams = block("carrier generator")
    tracking: TrackingParams = block("tracking converter")
    absolute: AbsoluteParams = block("absolute converter")


class Converters(Registers):
    """The logic that runs in every tick: carrier, tracking and absolute converter."""

    carrier: Carrier = block("carrier generator")
    tracking: TrackingConverter = block("tracking converter")
    absolute: AbsoluteConverter = block("absolute converter")


@hot_step
def convert(p: ConverterParams, r: Converters, ps: int) -> None:
    """Both converters for one tick; the carrier has counted, and `ps` is the comparator's answer to it."""
    count_reference(p.tracking, r.tracking)
    count_absolute(p.absolute, r.absolute, ps)
    emit_pulse(p.tracking, r.tracking)
    shift_samples(p.tracking, r.tracking, ps)


@step
def run_converters(p: ConverterParams, r: Converters, start: int, rate: int, periods: int) -> int:
    """Converters alone, the phase of the secondary at `start` and growing by `rate` per period [2^-32 turn]."""
    local = local_copy(r)
    net = 0
    phase = start
    shift = 29 - p.carrier.shift  # 32 - log2 N
    for _ in range(periods):
        count_carrier(p.carrier, local.carrier)
        ps = (phase + (local.carrier.count << shift)) >> 31 & 1
        convert(p, local, ps)
        net += local.tracking.plus - local.tracking.minus
        phase += rate
    copy_back(r, local)
    return net
