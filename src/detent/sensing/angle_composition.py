"""Absolute angle from a fine and a coarse word (rotary-table specification 3.1; unit 19).

The fine word counts within a motor turn, the coarse word within a table turn. Their difference, rounded, is the number
of whole motor turns: right while the coarse word errs by less than half a motor turn, less one coarse count.
"""

from detent.kernel.registers import Registers, i8, register, u1
from detent.kernel.step import step


class CompositionParams(Registers):
    """Sizes and zeros of both words."""

    ratio: i8 = register("motor turns per table turn G", unit="count")
    fine: i8 = register("fine counts per motor turn F", unit="count")
    coarse: i8 = register("coarse counts per table turn", unit="count")
    fine_zero: i8 = register("fine word at table angle 0", unit="count")
    coarse_zero: i8 = register("coarse word at table angle 0", unit="count")
    truncating: u1 = register("1: motor turns from the coarse word alone, the way the method is compared with")


class AbsoluteAngle(Registers):
    """Output of the unit."""

    theta: i8 = register("absolute table angle S1, 0..G F - 1", unit="count")
    turns: i8 = register("whole motor turns in it", unit="count")


@step
def compose(p: CompositionParams, r: AbsoluteAngle, fine: int, coarse: int) -> None:
    """Absolute angle of two words: ``n = round(G c / C - f / F) mod G``, ``theta = n F + f``."""
    f = (fine - p.fine_zero) % p.fine
    c = (coarse - p.coarse_zero) % p.coarse
    if p.truncating:
        r.turns = p.ratio * c // p.coarse
    else:
        whole = p.coarse * p.fine
        difference = p.ratio * c * p.fine - f * p.coarse
        r.turns = (2 * difference + whole) // (2 * whole) % p.ratio
    r.theta = r.turns * p.fine + f
