"""PWM timer: a one-shot retriggered every 40 us, counting a 7.5 MHz clock (print-head specification 2.3)."""

from detent.kernel.registers import Registers, register, u2
from detent.kernel.step import hot_step, step

CLOCKS_PER_PERIOD = 300  # 7.5 MHz / 25 kHz: drive counts and timer clocks are the same number


class PwmTimer(Registers):
    """The down-counter that makes the pulse; the PWM line is high while it is not 0."""

    pulse: u2 = register("width of the current pulse, copied at the trigger", unit="count")
    counter: u2 = register("down-counter of the current pulse", unit="count")


@hot_step
def trigger(r: PwmTimer, count: int) -> None:
    """25 kHz trigger: take over the count, 0..300; 0 gives no pulse (a real 8254 takes it for 65536)."""
    r.pulse = count
    r.counter = count


@step
def clock(r: PwmTimer) -> None:
    """One 7.5 MHz clock: count down."""
    if r.counter > 0:
        r.counter -= 1
