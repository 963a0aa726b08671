"""Angle beyond one turn from a detector of one turn (rotary-table specification 3.2 to 3.5; section A2, steps 200-212).

The present angle R is the detected one, D, with whole periods added. Three forms: a signed turn counter; the flag of
the patent, which adds one period in the direction of the jog after any crossing; and the raw angle of a conventional
unit. Registers have their names of the specification.
"""

from detent.kernel.registers import Registers, i8, register, u1
from detent.kernel.step import step

TURN_COUNTER, FLAG, RAW = 0, 1, 2  # forms of the extension


class EndlessAngleParams(Registers):
    """Range of the detector and form of the extension."""

    period: i8 = register("range of the detected angle T", unit="count")
    form: u1 = register("0 turn counter, 1 flag as in the patent, 2 raw: no extension", unit="code")


class EndlessAngle(Registers):
    """Detected and present angle."""

    dar: i8 = register("DAR: detected angle D, 0..T-1", unit="count")
    d_prev: i8 = register("D_prev: detected angle of the interrupt before", unit="count")
    flg: u1 = register("FLG, 1: a boundary has been crossed in this manual feed")
    turn: i8 = register("n: periods to add, signed", unit="count")
    aar: i8 = register("AAR: present angle R, extended", unit="count")
    position: i8 = register("position of record: all movement since power-on added to the first angle", unit="count")
    crossings: i8 = register("boundaries crossed, either way", unit="count")


@step
def first_angle(r: EndlessAngle, d: int) -> None:
    """The first angle after power-on."""
    r.dar = r.d_prev = r.aar = r.position = d
    r.flg = 0
    r.turn = 0


@step
def read_angle(p: EndlessAngleParams, r: EndlessAngle, d: int, manual: bool) -> None:
    """Take over the detected angle: a change of more than half a period is a crossing. `manual`: FLG may be set."""
    change = d - r.d_prev
    wraps = 1 if 2 * change < -p.period else (-1 if 2 * change > p.period else 0)
    r.dar = r.d_prev = d
    r.position += change + wraps * p.period
    if wraps != 0:
        r.crossings += 1
        r.turn += wraps
        if manual:
            r.flg = 1


@step
def extend(p: EndlessAngleParams, r: EndlessAngle, z: int) -> None:
    """Present angle R; `z` is the direction of the jog."""
    if p.form == TURN_COUNTER:
        r.aar = r.dar + r.turn * p.period
    elif p.form == FLAG and r.flg:
        r.aar = r.dar + z * p.period
    else:
        r.aar = r.dar


@step
def start_raw(r: EndlessAngle) -> None:
    """Initial set: nothing is added."""
    r.flg = 0
    r.turn = 0
    r.aar = r.dar


@step
def shift_back(r: EndlessAngle, z: int) -> None:
    """Step 118: one period less, against the direction of the jog."""
    r.flg = 0
    r.turn -= z
