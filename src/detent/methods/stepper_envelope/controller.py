"""Controller of one stepper: control unit, step timer and phases (stepper-envelope specification 2.2, blocks B4, B5).

What the host lays ready are both tables. The loop is open: nothing comes back along the lines but a home switch, which
the control unit does not look at.
"""

from collections.abc import Sequence

from detent.control import step_rule
from detent.control.step_rule import (
    IDLE,
    PAUSE,
    STEP,
    StepRule,
    StepRuleParams,
    next_entry,
    next_step,
    place_motor,
    start_move,
)
from detent.control.step_timer import StepTimer, StepTimerParams, load_period, pulse, word_within
from detent.kernel.loop import HostArray, controls, i2_signal
from detent.kernel.registers import CONTROLLER, PLANT, Fit, Registers, block, i1, i4, i8, register, u1, u2, u4
from detent.kernel.step import bounded, hot_step, step
from detent.planning.step_envelope import INDEX_BITS, INDEX_MASK
from detent.planning.step_ramp import StepRamp
from detent.sensing.home_marks import HomeLevels

Entries = HostArray  # table of int16, see `control.step_rule.next_entry`
NOWHERE = -(1 << 62)  # position that is never reached


class StepperControllerParams(Registers):
    """Ramp list, zone limits and timer."""

    rule: StepRuleParams = block("control unit")
    pause: u1 = register("waiting time of a reversal, in periods of the start frequency", unit="count")
    timer: StepTimerParams = block("step timer")
    instant_ticks: i8 = register("ticks of the step timer in a tick of the axis", unit="tick")


class StepperController(Registers):
    """Control unit and timer."""

    rule: StepRule = block("control unit")
    timer: StepTimer = block("step timer and phases")
    now: i8 = register("ticks of the step timer since power-on", unit="tick")
    stop_at: i8 = register("position at which the loop returns to the host", unit="count")


class StepperLines(Registers):
    """Wires to the power stage, and a switch; of the motor nothing comes back.

    A tick has one pulse at most: it takes one tick of the timer, or 2 us at most (`build.instant`), and a period takes
    ten ticks of the timer (`rules.LEAST_TICKS`) and 15 us (`step_ramp.MAX_HZ`) at least.
    """

    pulse: u1 = register("1 in the tick of a step pulse", by=CONTROLLER)
    direction: i1 = register("direction line: 1 or -1", by=CONTROLLER)
    period: u4 = register("period that the last pulse began; 0: hold, no step follows it", unit="tick", by=CONTROLLER)
    disable: u1 = register("1: no current in the coils, the motor is free", by=CONTROLLER)
    home: HomeLevels = block("home switch", by=PLANT)


# ---- host actions


@step
def place(c: StepperController, position: int) -> None:
    """Power-on or homing: the motor stands at `position` [step]."""
    place_motor(c.rule, position)
    c.stop_at = NOWHERE


@step
def start(c: StepperController, heading: i1, turns: u2) -> None:
    """Start signal: to the end of the table of `heading`, 1 or -1, with so many reversals on the way."""
    start_move(c.rule, heading, turns)


@step
def deflect(p: StepperControllerParams, c: StepperController, word: i4, heading: i1) -> None:
    """The operator takes over and asks for a word of the ramp list, frequency or period; 0 releases."""
    step_rule.deflect(p.rule, c.rule, word, p.rule.last, heading)


@step
def release(c: StepperController) -> None:
    """The operator lets go: the motor comes down its ramp and rests."""
    step_rule.release(c.rule)


@step
def reset(c: StepperController) -> None:
    """Leave a fault, once the motor is at rest."""
    c.rule.reset = 1


@step
def acknowledge(c: StepperController) -> None:
    """The host has seen the event: time may pass on."""
    step_rule.acknowledge(c.rule)


@step
def call_at(c: StepperController, position: int) -> None:
    """An event when the motor passes `position` [step]; `NOWHERE` takes it back."""
    c.stop_at = position


# ---- a period


@hot_step
def begin_period(p: StepperControllerParams, c: StepperController, outcome: int) -> int:
    """The running period is over: load the timer with what was decided; hands the decision on."""
    if outcome == STEP:
        load_period(p.timer, c.timer, c.rule.word)
        pulse(c.timer, c.rule.direction)
        if c.rule.position == c.stop_at:
            c.rule.event = 1
    elif outcome == PAUSE:
        start = c.timer.expires
        if p.pause:
            load_period(p.timer, c.timer, p.rule.ramp[0])
        c.timer.expires = start + p.pause * c.timer.period
    else:
        c.timer.period = 0
    return outcome


@hot_step
def step_once(p: StepperControllerParams, c: StepperController, entry: int) -> int:
    """The running period is over: decide by the entry, and begin the next one. Returns IDLE, STEP or PAUSE."""
    return begin_period(p, c, next_step(p.rule, c.rule, entry))


@hot_step
def step_along(p: StepperControllerParams, c: StepperController, up: i2_signal, down: i2_signal) -> int:
    """The running period is over: read the next entry, decide, and begin the next one. Returns IDLE, STEP or PAUSE."""
    return step_once(p, c, next_entry(c.rule, up, down))


@hot_step
def put_out(c: StepperController, lines: StepperLines, outcome: int) -> bool:
    """Drive the lines as it was decided; False at rest."""
    lines.pulse = outcome == STEP
    lines.direction = c.rule.direction
    lines.period = c.timer.period if outcome == STEP else 0
    return outcome != IDLE


@step
def next_period(
    p: StepperControllerParams, c: StepperController, lines: StepperLines, up: i2_signal, down: i2_signal
) -> bool:
    """The running period is over: begin the next one, and drive the lines; False at rest."""
    if c.timer.period == 0:
        c.timer.expires = c.now  # at rest time passes until a start, which takes effect at once
    return put_out(c, lines, step_along(p, c, up, down))


@controls(StepperControllerParams)
@hot_step
@bounded(2, "a pause of no length, and the step behind it")
def control(
    p: StepperControllerParams, c: StepperController, lines: StepperLines, up: i2_signal, down: i2_signal
) -> None:
    """One tick: begin the next period where one is over, after a pause of no length at once."""
    lines.pulse = 0
    running = True
    while running and c.timer.expires <= c.now:
        running = next_period(p, c, lines, up, down)
    c.now += p.instant_ticks


def fit(p: StepperControllerParams) -> Fit:
    """How much of its ramp list a motor uses: up to a power of two, for the index of any entry is masked."""
    top = (1 << p.rule.last.bit_length()) - 1
    inside, running = (0, top), (-1, top)
    return Fit(
        {(StepRuleParams, "ramp"): top + 1},
        {
            (StepRuleParams, "last"): inside, (StepRuleParams, "index_mask"): inside,
            (StepRule, "index"): running, (StepRule, "request"): running,
        },
        {(StepRuleParams, "index_mask"): top},
    )  # fmt: skip


def load_rule(
    p: StepperControllerParams, ramp: StepRamp, limits: Sequence[float], clock_hz: int, *, reload: bool
) -> None:
    """Put ramp list and zone limits into the control unit, in the words of its timer."""
    words = ramp.words(clock_hz, reload=reload)
    p.rule.ramp[: len(words)] = words.tolist()
    p.rule.limit[: len(limits)] = [word_within(hz, clock_hz, reload=reload) for hz in limits]
    p.rule.last = len(words) - 1
    p.rule.index_mask, p.rule.zone_shift = INDEX_MASK, INDEX_BITS
    p.rule.reload = p.timer.reload = int(reload)
    p.timer.clock_hz = clock_hz
