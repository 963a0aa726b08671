"""Decoder and H-bridge: from PWM, right/left and transition lines to the motor terminals.

Leg A is Q1 (upper) and Q3 (lower), leg B is Q2 and Q4; the motor lies between A and B and a free-wheel diode across
each switch. A current i > 0 flows from A to B. Print-head specification 2.4; the decoder's table is its reconstruction.
"""

from detent.kernel.registers import Registers, f8, register, u1, u2
from detent.kernel.step import step


class BridgeLines(Registers):
    """What the axis computer and the timer tell the decoder."""

    right_left: u1 = register("direction line, 1 = right")
    transition: u1 = register("transition line TR: 1 = regenerative brake")


class Bridge(Registers):
    """Mean terminal voltages that the present lines impose, per sign of the current."""

    gates_on: u1 = register("gates while the PWM line is high: bit 0 Q1, 1 Q2, 2 Q3, 3 Q4", unit="code")
    gates_off: u1 = register("gates while the PWM line is low", unit="code")
    pulse: u2 = register("width of the current pulse", unit="count")
    on_positive: f8 = register("terminal voltage, PWM high, current positive", unit="V")
    on_negative: f8 = register("terminal voltage, PWM high, current negative", unit="V")
    off_positive: f8 = register("terminal voltage, PWM low, current positive", unit="V")
    off_negative: f8 = register("terminal voltage, PWM low, current negative", unit="V")
    mean_positive: f8 = register("mean over the period, current positive", unit="V")
    mean_negative: f8 = register("mean over the period, current negative", unit="V")


@step
def decode(pwm: int, right_left: int, transition: int) -> int:
    """Gates for the three decoder inputs: bit 0 Q1, bit 1 Q2, bit 2 Q3, bit 3 Q4."""
    if transition:
        gate = 4 if right_left else 8
        return gate if pwm else 0
    if right_left:
        return (1 if pwm else 0) | 8
    return (2 if pwm else 0) | 4


@step
def terminal_voltage(gates: int, supply: float, sign: int) -> float:
    """Motor voltage A - B for ideal switches and diodes while the current has `sign` (1 or -1).

    A leg with no switch on is carried by the diode that the current finds: out of the leg from ground, into it to the
    supply.
    """
    if gates & 1:
        a = supply
    elif gates & 4:
        a = 0.0
    else:
        a = 0.0 if sign > 0 else supply
    if gates & 2:
        b = supply
    elif gates & 8:
        b = 0.0
    else:
        b = supply if sign > 0 else 0.0
    return a - b


@step
def steer(r: Bridge, lines: BridgeLines, pulse: int, supply: float) -> None:
    """Take over the lines and the pulse width for this period."""
    r.gates_on = decode(1, lines.right_left, lines.transition)
    r.gates_off = decode(0, lines.right_left, lines.transition)
    r.pulse = pulse
    r.on_positive = terminal_voltage(r.gates_on, supply, 1)
    r.on_negative = terminal_voltage(r.gates_on, supply, -1)
    r.off_positive = terminal_voltage(r.gates_off, supply, 1)
    r.off_negative = terminal_voltage(r.gates_off, supply, -1)
    share = pulse / 300.0
    r.mean_positive = share * r.on_positive + (1.0 - share) * r.off_positive
    r.mean_negative = share * r.on_negative + (1.0 - share) * r.off_negative
