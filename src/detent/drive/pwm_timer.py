"""PWM timer: a one-shot retriggered every 40 us, counting a 7.5 MHz clock (print-head specification 2.3)."""

from detent.kernel.registers import Registers, register, u1, u2
from detent.kernel.step import hot_step, step

CLOCKS_PER_PERIOD = 300  # 7.5 MHz / 25 kHz: drive counts and timer clocks are the same number


class PwmTimer(Registers):
    """Count register written by the axis computer, and the down-counter that makes the pulse."""

    count: u2 = register("count register, 0..300; takes effect at the next trigger", unit="count")
    pulse: u2 = register("width of the current pulse, copied at the trigger", unit="count")
    counter: u2 = register("down-counter of the current pulse", unit="count")
    output: u1 = register("PWM line")


@hot_step
def trigger(r: PwmTimer) -> None:
    """25 kHz trigger: copy the count and set the output, unless it is 0 (which a real 8254 takes for 65536)."""
    r.pulse = r.count
    r.counter = r.count
    r.output = 1 if r.count > 0 else 0


@step
def clock(r: PwmTimer) -> None:
    """One 7.5 MHz clock: count down; reaching zero clears the output."""
    if r.counter > 0:
        r.counter -= 1
        if r.counter == 0:
            r.output = 0
