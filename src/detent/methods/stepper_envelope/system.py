"""One stepper of the envelope method, wired as its block diagram (stepper-envelope specification 2.2).

    host -> envelope builder -> table (up, down) -> control unit -> timer, phases -> motor, spindle, load
                                                        ^              |
                                                        +-- period over+

A tick is a time step of the rotor, the judge of whether the motor follows; without the rotor, as in firmware, it is a
step (`alone`). The order is: decide, actuate, move, record; an open-loop motor has nothing to sample. What the host has
laid ready are both tables. Several motors are several of these records, each with its own tables; nothing is shared.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from detent.control.step_comparison import Comparison, ComparisonParams, next_compared_step
from detent.control.step_rule import (
    AT_REST,
    IDLE,
    LIMITS,
    PAUSE,
    RAMP,
    STEP,
    StepRule,
    StepRuleParams,
    next_entry,
    next_step,
    place_motor,
)
from detent.drive.step_timer import StepTimer, StepTimerParams, frequency, load_period, pulse, reload_values
from detent.kernel.loop import HostArray, lay_ready, ticks
from detent.kernel.registers import Registers, block, f8, i8, register, u1
from detent.kernel.step import hot_step, step
from detent.planning.step_envelope import INDEX_BITS, INDEX_MASK
from detent.planning.step_ramp import StepRamp
from detent.plant.stepper_rotor import RotorParams, StepperRotor, hold_field, step_field, turn_rotor

Entries = HostArray
"""Table of int16, see `control.step_rule.next_entry`."""

NOWHERE = -(1 << 62)
"""Position that no motor reaches."""


class StepperParams(Registers):
    """Everything about one motor that does not change while it runs, but its tables."""

    rule: StepRuleParams = block("control unit")
    comparison: ComparisonParams = block("a method to compare with, instead of the control unit")
    pause: u1 = register("waiting time of a reversal, in periods of the start frequency", unit="count")
    timer: StepTimerParams = block("step timer")
    instant_ticks: i8 = register("time step of the rotor in ticks of the step timer", unit="tick")
    tolerance: f8 = register("distance of the rotor from its field that counts as settled, in steps", unit="count")
    rotor: RotorParams = block("motor and load")


class AloneParams(StepperParams):
    """The same for a motor without its rotor: control unit and timer, as in firmware, where a tick is a step."""


class Stepper(Registers):
    """State of one motor with its control unit."""

    tick: i8 = register("time steps of the rotor since power-on; steps where it runs without the rotor", unit="tick")
    rule: StepRule = block("control unit")
    comparison: Comparison = block("a method to compare with")
    timer: StepTimer = block("step timer and phases")
    stop_at: i8 = register("position at which the loop returns to the host", unit="count")
    peak_hz: f8 = register("largest step frequency since the host cleared it", unit="Hz")
    outside: i8 = register("time step in which the rotor was last outside its tolerance", unit="count")
    rotor: StepperRotor = block("motor")


@hot_step
def step_once(p: StepperParams, r: Stepper, entry: int) -> int:
    """The running period is over: decide by the entry, and begin the next one. Returns IDLE, STEP or PAUSE."""
    if p.comparison.method:
        outcome = next_compared_step(p.comparison, r.comparison, r.rule)
    else:
        outcome = next_step(p.rule, r.rule, entry)
    if outcome == STEP:
        load_period(p.timer, r.timer, r.rule.word)
        pulse(r.timer, r.rule.direction)
        if r.rule.position == r.stop_at:
            r.rule.event = 1
    elif outcome == PAUSE:
        start = r.timer.expires
        if p.pause:
            load_period(p.timer, r.timer, p.rule.ramp[0])
        r.timer.expires = start + p.pause * r.timer.period
    else:
        r.timer.period = 0
    return outcome


@hot_step
def next_period(p: StepperParams, r: Stepper, up: Entries, down: Entries) -> int:
    """The running period is over: what the control unit, or the method it is compared with, makes of it."""
    return step_once(p, r, AT_REST if p.comparison.method else next_entry(r.rule, up, down))


@ticks(AloneParams)
@hot_step
def tick_alone(p: AloneParams, r: Stepper, up: Entries, down: Entries) -> bool:
    """One step, as firmware makes it; none while the motor rests, or has raised an event."""
    outcome = PAUSE
    while outcome == PAUSE and r.rule.event == 0:
        outcome = next_period(p, r, up, down)
    if outcome != STEP:
        return False
    r.tick += 1
    return True


@step
def actuate(p: StepperParams, r: Stepper, up: Entries, down: Entries, now: int) -> bool:
    """The running period is over: the next one, and what its pulse does to the field. False at rest."""
    if r.timer.period == 0:
        r.timer.expires = now  # at rest time passes until a start, which takes effect at once
    outcome = next_period(p, r, up, down)
    if outcome == STEP:
        hz = frequency(p.timer, r.timer)
        r.peak_hz = max(r.peak_hz, hz)
        step_field(p.rotor, r.rotor, r.rule.direction, hz)
    else:
        hold_field(r.rotor)
    return outcome != IDLE


@ticks(StepperParams)
@hot_step
def tick(p: StepperParams, r: Stepper, up: Entries, down: Entries) -> bool:
    """One time step of the rotor; none while the motor has an event for its host."""
    if r.rule.event:
        return False
    now = r.tick * p.instant_ticks
    running = True
    while running and r.timer.expires <= now:
        running = actuate(p, r, up, down, now)
    turn_rotor(p.rotor, r.rotor)
    r.tick += 1
    if abs(r.rotor.lag) > p.tolerance:
        r.outside = r.tick
    return True


def alone(p: StepperParams) -> AloneParams:
    """The same parameters, in the same memory, for running without the rotor."""
    return AloneParams.from_buffer(p)


def tables(up: NDArray[np.int16], down: NDArray[np.int16]) -> tuple[Entries, Entries]:
    """Feed of a motor: both tables, in the memory in which the host edits them."""
    return lay_ready(up), lay_ready(down)


def load_rule(p: StepperParams, ramp: StepRamp, limits: Sequence[float], clock_hz: int, *, reload: bool) -> None:
    """Put ramp list and zone limits into the control unit, in the words of its timer."""
    if len(ramp) > RAMP or len(limits) > LIMITS:
        raise ValueError(
            f"{len(ramp)} ramp entries and {len(limits)} zone limits, must be {RAMP} and {LIMITS} or fewer"
        )
    bounds = np.asarray(limits, float)
    words = reload_values(ramp.hz, clock_hz) if reload else ramp.words()
    bound_words = np.ceil(clock_hz / bounds - 1e-9) if reload else np.floor(bounds)
    p.rule.ramp[: len(words)] = [int(word) for word in words]
    p.rule.limit[: len(bounds)] = [int(word) for word in bound_words]
    p.rule.index_mask, p.rule.zone_shift = INDEX_MASK, INDEX_BITS
    p.rule.reload = p.timer.reload = int(reload)
    p.timer.clock_hz = clock_hz


def switch_on(r: Stepper, position: int, step_angle: float) -> None:
    """Power-on with the motor standing at `position` [step], the rotor in the middle of its field."""
    place_motor(r.rule, position)
    r.rotor.commanded = position
    r.rotor.angle = position * step_angle
    hold_field(r.rotor)
    r.stop_at = NOWHERE
