"""PWM by comparison with a counted sawtooth, locked antiphase (phase-servo specification 3.9; block 250)."""

from detent.kernel.registers import Registers, i2, i8, register
from detent.kernel.step import hot_step


class SawtoothParams(Registers):
    """Length of the sawtooth."""

    half: i8 = register("half the counts of one PWM period, 2^(M-1)", unit="count")


class SawtoothPwm(Registers):
    """Sawtooth of the present oscillator period."""

    sawtooth: i2 = register("up counter 252, -2^(M-1) .. 2^(M-1) - 1", unit="count")


@hot_step
def count_sawtooth(p: SawtoothParams, r: SawtoothPwm, word: int) -> int:
    """Request of the next oscillator period with this drive word: 1 plus, -1 minus, 0 neither (once a sawtooth)."""
    s = r.sawtooth + 1
    r.sawtooth = s if s < p.half else -p.half
    return (1 if word > r.sawtooth else 0) - (1 if word < r.sawtooth else 0)
