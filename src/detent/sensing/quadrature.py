"""Quadrature decoders: four counts per encoder cycle, direction from the order of the channels.

Both take the direction of a change from the same two gates. `Quadrature` is called at every edge; `ClockedDecoder` is
the synchronous circuit of four flip-flops, which looks at the channels once per clock (filtered-servo
specification 3.1).
"""

from detent.kernel.registers import Registers, i8, register, u1
from detent.kernel.step import hot_step, step


class Quadrature(Registers):
    """Count of quarter cycles and the levels it was formed from."""

    count: i8 = register("quarter cycles since power-on, right positive", unit="count")
    channel_a: u1 = register("channel A at the last edge")
    channel_b: u1 = register("channel B at the last edge")
    illegal: i8 = register("transitions in which both channels changed at once", unit="count")


class ClockedDecoder(Registers):
    """Two-stage samplers of both channels and the pulses made from them."""

    a1: u1 = register("first flip-flop of channel A")
    a2: u1 = register("second flip-flop of channel A")
    b1: u1 = register("first flip-flop of channel B")
    b2: u1 = register("second flip-flop of channel B")
    forward: u1 = register("forward pulse F, one clock long")
    reverse: u1 = register("reverse pulse R, one clock long")


@hot_step
def edge_direction(a_before: int, b_before: int, a: int, b: int) -> int:
    """Step in quarter cycles of a change of levels: 1 while A leads B, -1 while B leads A, 0 for none or for both.

    ``X = A xor B'``, ``Y = B xor A'`` with the levels before; forward is ``X and not Y``, reverse ``Y and not X``.
    """
    return (a ^ b_before) - (b ^ a_before)


@hot_step
def count_edge(r: Quadrature, a: int, b: int) -> int:
    """Take new levels; returns the step in quarter cycles: 1, -1 or 0 (no or an illegal change)."""
    change = edge_direction(r.channel_a, r.channel_b, a, b)
    if a != r.channel_a and b != r.channel_b:
        r.illegal += 1
    r.channel_a = a
    r.channel_b = b
    r.count += change
    return change


def preset(r: Quadrature, a: int, b: int) -> None:
    """Power-on: the levels are there already."""
    r.channel_a, r.channel_b = a, b


@hot_step
def clock_decoder(r: ClockedDecoder, a: int, b: int) -> None:
    """One clock: the samplers shift, and the gates show a pulse until the next clock."""
    r.a2 = r.a1
    r.a1 = a
    r.b2 = r.b1
    r.b1 = b
    change = edge_direction(r.a2, r.b2, r.a1, r.b1)
    r.forward = 1 if change > 0 else 0
    r.reverse = 1 if change < 0 else 0


@hot_step
def is_settled(r: ClockedDecoder, a: int, b: int) -> bool:
    """True when further clocks would change nothing."""
    return r.a1 == a and r.a2 == a and r.b1 == b and r.b2 == b


@step
def preset_decoder(r: ClockedDecoder, a: int, b: int) -> None:
    """Power-on: all stages hold the present levels, else the first clocks would make a false pulse."""
    r.a1 = a
    r.a2 = a
    r.b1 = b
    r.b2 = b
    r.forward = 0
    r.reverse = 0
