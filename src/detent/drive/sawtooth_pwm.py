"""PWM by comparison with a counted sawtooth, locked antiphase (phase-servo specification 3.9; block 250)."""

from detent.kernel.registers import Registers, i1, i2, i8, register
from detent.kernel.step import hot_step


class SawtoothParams(Registers):
    """Length of the sawtooth."""

    half: i8 = register("half the counts of one PWM period, 2^(M-1)", unit="count")


class SawtoothPwm(Registers):
    """Sawtooth and the request of the present oscillator period."""

    sawtooth: i2 = register("up counter 252, -2^(M-1) .. 2^(M-1) - 1", unit="count")
    request: i1 = register("1 plus, -1 minus, 0 neither (one period of each sawtooth)")


@hot_step
def count_sawtooth(p: SawtoothParams, r: SawtoothPwm, word: int) -> None:
    """One oscillator period with the drive word `word`."""
    s = r.sawtooth + 1
    r.sawtooth = s if s < p.half else -p.half
    r.request = (1 if word > r.sawtooth else 0) - (1 if word < r.sawtooth else 0)
