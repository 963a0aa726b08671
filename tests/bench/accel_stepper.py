"""AccelStepper's ramp as compiled steps: what the run-time rule of the stepper envelope is measured against.

The interval between two steps follows a recurrence (D. Austin, Generate stepper-motor speed profiles in real time,
Embedded Systems Programming, January 2005), in the form of Mike McCauley's AccelStepper library, whose equations 13, 15
and 16 it names. Each step costs three divisions: braking distance, recurrence and speed. The interval is the timer's
reload value. The library counts in floats of 32 bits, this in 64. Around the decision stands what stands around the
rule in the controller: timer and phases, the event line, a position to stop at, the rows of a trace.
"""

import math

from detent.control.step_timer import StepTimer, StepTimerParams, load_period, pulse
from detent.kernel.compiled import copy_back, local_copy
from detent.kernel.loop import Bytes, Offsets, until_row, write_row
from detent.kernel.registers import Registers, block, f8, i1, i4, i8, register, u1
from detent.kernel.step import hot_step, step
from detent.methods.stepper_envelope.controller import NOWHERE


class AccelStepperParams(Registers):
    """Ramp and timer."""

    acceleration: f8 = register("acceleration and deceleration", unit="step/s2")
    clock_hz: f8 = register("ticks of the timer per second", unit="Hz")
    first: f8 = register("first interval, c_0", unit="tick")
    least: f8 = register("interval at the largest speed, c_min", unit="tick")
    timer: StepTimerParams = block("step timer, with reload values")


class AccelStepper(Registers):
    """State of one motor."""

    target: i8 = register("position to go to", unit="count")
    position: i8 = register("steps made, forward less backward", unit="count")
    n: i8 = register("place on the ramp: above 0 gaining speed, below 0 losing it", unit="count")
    interval: f8 = register("interval c_n", unit="tick")
    speed: f8 = register("speed, signed", unit="step/s")
    word: i4 = register("period to load for the next step, 0 at rest", unit="tick")
    direction: i1 = register("direction line: 1 or -1")
    event: u1 = register("1 when the motor has come to rest, or to `stop_at`; the host clears it")
    stop_at: i8 = register("position at which the loop returns to the host", unit="count")
    timer: StepTimer = block("step timer and phases")


@hot_step
def next_interval(p: AccelStepperParams, r: AccelStepper) -> None:
    """Decide about the next step from where the motor is and how fast."""
    way = r.target - r.position
    to_stop = int(r.speed * r.speed / (2.0 * p.acceleration))  # equation 16
    if way == 0 and to_stop <= 1:
        r.n = r.word = 0
        r.speed = 0.0
        r.event = 1
        return
    ahead = way * r.direction
    if r.n > 0 and to_stop >= ahead:
        r.n = -to_stop
    elif r.n < 0 and to_stop < ahead:
        r.n = -r.n
    if r.n == 0:
        r.interval = p.first
        r.direction = 1 if way > 0 else -1
    else:
        r.interval = max(r.interval - 2.0 * r.interval / (4.0 * r.n + 1.0), p.least)  # equation 13
    r.n += 1
    r.word = int(r.interval)
    r.speed = r.direction * p.clock_hz / r.interval


@hot_step
def step_once(p: AccelStepperParams, r: AccelStepper) -> None:
    """The interval is over: make the step, and decide about the next one."""
    load_period(p.timer, r.timer, r.word)
    pulse(r.timer, r.direction)
    r.position += r.direction
    if r.position == r.stop_at:
        r.event = 1
    next_interval(p, r)


@step
def advance(p: AccelStepperParams, r: AccelStepper, steps: int, trace: Bytes, picks: Offsets, every: int) -> int:
    """Run up to `steps` steps; stops when the motor rests, or has raised an event. As `systems.stepper.advance`."""
    done = 0
    while done < steps and r.event == 0:
        stretch = until_row(r.timer.pulses, steps - done, every)
        motor = local_copy(r)
        n = 0
        while n < stretch and motor.event == 0:
            step_once(p, motor)
            n += 1
        copy_back(r, motor)
        write_row(r, r.timer.pulses, trace, picks, every)
        done += n
    return done


@step
def move_to(p: AccelStepperParams, r: AccelStepper, target: int) -> None:
    """Start a move from rest."""
    r.target, r.event = target, 0
    next_interval(p, r)


def accel_stepper(acceleration: float, max_hz: float, clock_hz: int) -> tuple[AccelStepperParams, AccelStepper]:
    """A motor at rest at 0."""
    # Equation 15: the factor makes up for what the recurrence loses on its first steps.
    first = 0.676 * math.sqrt(2.0 / acceleration) * clock_hz
    p = AccelStepperParams(acceleration=acceleration, clock_hz=clock_hz, first=first, least=clock_hz / max_hz)
    p.timer.clock_hz, p.timer.reload = clock_hz, 1
    return p, AccelStepper(direction=1, stop_at=NOWHERE, event=1)
