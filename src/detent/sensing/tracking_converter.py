"""Digital tracking converter: one up or down pulse per step of phase (phase-servo specification 3.4; block 550).

A reference counter is kept in phase with the comparator's square wave by letting it count once more or once less per
cycle; every such correction is a pulse. Order inside one reference period: `count_reference` with the first clock,
`emit_pulse` while the second is active, `shift_samples` at its trailing edge.
"""

from detent.kernel.registers import Registers, i8, register, u1, u2
from detent.kernel.step import hot_step


class TrackingParams(Registers):
    """Length of the reference counter and the repair of its false lock."""

    mask: i8 = register("counts per cycle N, less one", unit="count")
    top: i8 = register("number of the counter's top bit", unit="count")
    leave_antiphase: u1 = register("1 takes a falling edge of PS at the gate for a lead: no false lock at antiphase")


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
