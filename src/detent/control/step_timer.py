"""Step timer and phase sequencer of a stepper: one pulse per period (stepper-envelope specification 2.2, block B5)."""

import math

from detent.kernel.registers import Registers, i8, register, u1
from detent.kernel.step import hot_step


class StepTimerParams(Registers):
    """Clock of the timer and what its word means."""

    clock_hz: i8 = register("ticks of the timer per second", unit="Hz")
    reload: u1 = register("1: a word is the period itself [tick]; 0: it is a frequency [Hz]", option=True)


class StepTimer(Registers):
    """Period counter and coil pattern."""

    period: i8 = register("running period; 0 at rest", unit="tick")
    expires: i8 = register("time at which the running period is over", unit="tick")
    phase: u1 = register("place in the full-step pattern of the two coils, 0..3", unit="code")
    pulses: i8 = register("step pulses since power-on", unit="count")


@hot_step
def load_period(p: StepTimerParams, r: StepTimer, word: int) -> None:
    """Begin a period where the last one was over; a frequency costs a division, a reload value none.

    The division is rounded up: no step is faster than its word.
    """
    if p.reload:
        r.period = word
    else:
        r.period = (p.clock_hz + word - 1) // word
    r.expires += r.period


@hot_step
def pulse(r: StepTimer, direction: int) -> None:
    """Step pulse: the coil pattern moves on by one place."""
    r.phase = (r.phase + direction) & 3
    r.pulses += 1


def word_within(hz: float, clock_hz: float, *, reload: bool) -> int:
    """The fastest word of a frequency that is not above `hz`."""
    return math.ceil(clock_hz / hz - 1e-9) if reload else math.floor(hz + 1e-9)
