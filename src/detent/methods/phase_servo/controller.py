"""What the electronics of a phase servo do in a tick, from the comparator's bit to the requests of the PWM.

One tick is one period of the reference clocks, two of the oscillator: in the first CK1 counts, in the second CK2
samples. The words of the logic are combinational; they are worked out in the ticks in which something they depend on
has changed. The clocks' own divider keeps the time.
"""

from detent.control import guard
from detent.control.clocks import (
    ClockChain,
    ClockParams,
    SawtoothParams,
    SawtoothPwm,
    count_sawtooth,
    integrate_strobe,
    next_period,
    reference_period,
    sample_strobe,
)
from detent.control.guard import Guard, GuardParams, await_arrival, enable_guard, is_overdue, watch
from detent.control.phase_law import Law, LawParams, drive_word, integrate
from detent.control.phase_sequencer import (
    ACQUIRE,
    NEVER,
    POSITION_MODE,
    SPEED_MODE,
    Sequencer,
    SequencerParams,
    count_pulses,
    enter_position,
    hear_tracker,
    next_timer,
    run_timers,
    setpoint,
    take_command,
)
from detent.kernel.compiled import unlikely
from detent.kernel.loop import controls
from detent.kernel.registers import CONTROLLER, PLANT, Fit, Registers, block, i1, i4, i8, register, u1, u2
from detent.kernel.step import hot_step, step
from detent.sensing.counted_speed import PulseCounter, PulseCounterParams, add_pulses, close_window
from detent.sensing.home_marks import HomeLevels
from detent.sensing.phase_converters import (
    ConverterParams,
    Converters,
    absolute_error,
    convert,
    count_carrier,
    reset_carrier,
)


class PhaseControllerParams(Registers):
    """What the electronics are set to."""

    clocks: ClockParams = block("taps of the divider")
    converters: ConverterParams = block("converters")
    speed: PulseCounterParams = block("speed detector")
    sequencer: SequencerParams = block("sequencer")
    law: LawParams = block("corrector, integrator, arithmetic")
    pwm: SawtoothParams = block("PWM")
    guard: GuardParams = block("protection")
    breaking: i4 = register("drive word that breaks the carriage loose", unit="count")


class PhaseController(Registers):
    """State of the electronics."""

    clocks: ClockChain = block("oscillator, clocks, divider")
    converters: Converters = block("converters")
    speed: PulseCounter = block("speed detector 350")
    sequencer: Sequencer = block("sequencer 100")
    law: Law = block("corrector, integrator, arithmetic")
    wake: i8 = register("next tick in which a one-shot runs out", unit="tick")
    pwm: SawtoothPwm = block("PWM")
    changed: u1 = register("1 when the words of the logic must be worked out anew")
    guard: Guard = block("protection")


class PhaseLines(Registers):
    """Wires between electronics and machine, and what noise does to them."""

    ps: u1 = register("digital position signal PS of this tick, as noise leaves it", by=PLANT)
    plus: u1 = register("pulses that noise puts in on the + line in this tick", unit="count", by=PLANT)
    minus: u1 = register("pulses that noise puts in on the - line in this tick", unit="count", by=PLANT)
    swallow: u1 = register("1 while the counting lines are to lose the next pulse", by=PLANT)
    mask: u1 = register("1 while the line of the speed sample is to lose the next strobe", by=PLANT)
    carrier: u2 = register("drive counter 451, which switches the coil currents", unit="count", by=CONTROLLER)
    swallowed: u1 = register("1 in a tick in which the counting lines have lost a pulse", by=CONTROLLER)
    missed: u1 = register("1 in a tick in which a strobe of the speed sample was lost", by=CONTROLLER)
    first_request: i1 = register(
        "request of the PWM in the tick's first oscillator period: 1 plus, -1 minus, 0 neither", by=CONTROLLER
    )
    request: i1 = register("request of the PWM in its second: 1 plus, -1 minus, 0 neither", by=CONTROLLER)
    enable: u1 = register("1 once the bridge may drive", by=CONTROLLER)
    home: HomeLevels = block("home switch", by=PLANT)


@step
def receive_pulses(p: PhaseControllerParams, c: PhaseController, lines: PhaseLines) -> None:
    """Pulses as they arrive on the counting lines: with what noise has put in or taken away."""
    plus, minus = c.converters.tracking.plus, c.converters.tracking.minus
    if plus + minus:
        hear_tracker(c.sequencer, plus - minus, reference_period(c.clocks))
        if lines.swallow:
            lines.swallowed = 1
            plus = minus = 0
    plus += lines.plus
    minus += lines.minus
    count_pulses(c.sequencer, plus, minus)
    add_pulses(p.speed, c.speed, plus - minus)
    c.changed = 1


@step
def sample_speed(p: PhaseControllerParams, c: PhaseController, lines: PhaseLines) -> None:
    """Speed strobe 400f; in the acquisition it also asks whether the tracker has come to rest."""
    if lines.mask:
        lines.missed = 1
    else:
        close_window(c.speed)
        c.changed = 1
    s = c.sequencer
    if s.state == ACQUIRE and reference_period(c.clocks) - s.last_pulse > p.sequencer.quiet_ticks:
        enable(p, c, lines)


@step
def enable(p: PhaseControllerParams, c: PhaseController, lines: PhaseLines) -> None:
    """The tracker is locked: clear what its pulses have left, and let the bridge drive."""
    s = c.sequencer
    c.speed.count = c.speed.word = 0
    s.distance = s.remaining = s.position = 0
    lines.enable = 1
    enable_guard(c.guard)
    enter_position(p.sequencer, s, reference_period(c.clocks))
    c.changed = 1


@step
def decide(p: PhaseControllerParams, c: PhaseController) -> None:
    """Sequencer, corrector, integrator and arithmetic after a change."""
    s, now = c.sequencer, reference_period(c.clocks)
    c.changed = 0
    if take_command(s):
        c.law.integral = 0
    if s.mode == SPEED_MODE and s.distance <= p.sequencer.threshold:
        enter_position(p.sequencer, s, now)
    run_timers(s, now)
    c.wake = next_timer(s)
    c.law.setpoint = setpoint(p.sequencer, s, absolute_error(p.converters.absolute, c.converters.absolute))
    drive_word(p.law, c.law, s.mode, s.stop, c.speed.word)


@step
def tick_integrator(p: PhaseControllerParams, c: PhaseController) -> None:
    """Integration clock 400e: it counts at stop only."""
    if c.sequencer.stop and p.law.integrator:
        integrate(p.law, c.law, c.law.setpoint)
        c.changed = 1


@step
def protect(p: PhaseControllerParams, c: PhaseController, lines: PhaseLines) -> None:
    """The guard looks at each window of the speed detector; a fault takes the bridge off and tells the host."""
    if lines.enable == 0 or lines.missed:
        return
    word = c.law.word
    pushing = 1 if word >= p.breaking else -1 if word <= -p.breaking else 0
    limited = 1 if word <= -p.law.word_limit or word >= p.law.word_limit - 1 else 0
    if watch(p.guard, c.guard, 0, 0, limited, pushing, c.speed.word):
        lines.enable = 0
        c.sequencer.event = 1
    if c.guard.awaited and is_overdue(c.guard):
        c.sequencer.event = 1


@hot_step
def sample(p: PhaseControllerParams, c: PhaseController, lines: PhaseLines) -> None:
    """Clocks, carrier, converters; what their pulses and strobes change is noted."""
    k = c.converters
    lines.swallowed = lines.missed = 0
    next_period(c.clocks)
    count_carrier(p.converters.carrier, k.carrier)
    lines.carrier = k.carrier.count
    convert(p.converters, k, lines.ps)
    next_period(c.clocks)
    if unlikely(k.tracking.plus + k.tracking.minus + lines.plus + lines.minus > 0):
        receive_pulses(p, c, lines)
    c.changed |= k.absolute.latched | c.sequencer.strobe
    if unlikely(integrate_strobe(p.clocks, c.clocks)):
        tick_integrator(p, c)
    if unlikely(sample_strobe(p.clocks, c.clocks)):
        sample_speed(p, c, lines)
        protect(p, c, lines)


def fit(p: PhaseControllerParams) -> Fit:
    """How much of its velocity table the servo uses."""
    last = p.sequencer.last
    return Fit({(SequencerParams, "table"): last + 1}, {(SequencerParams, "last"): (0, last)})


@controls(PhaseControllerParams)
@hot_step
def control(p: PhaseControllerParams, c: PhaseController, lines: PhaseLines) -> None:
    """One period of the reference clocks."""
    sample(p, c, lines)
    if unlikely(c.changed > 0 or reference_period(c.clocks) >= c.wake):
        decide(p, c)
    lines.first_request = count_sawtooth(p.pwm, c.pwm, c.law.word)
    lines.request = count_sawtooth(p.pwm, c.pwm, c.law.word)


@step
def command(c: PhaseController, distance: int, backward: int) -> None:
    """The host's set strobe: distance in steps, and direction."""
    c.sequencer.command = distance
    c.sequencer.backward = backward
    c.sequencer.strobe = 1


@step
def acquire(c: PhaseController) -> None:
    """Leave a fault: once the tracker is silent the bridge drives again."""
    c.sequencer.state, c.sequencer.last_pulse = ACQUIRE, reference_period(c.clocks)
    c.sequencer.ready = c.sequencer.stop = 0


@step
def take_ready(c: PhaseController) -> int:
    """The host's look at ready: 1 if it has risen since the last look, and not because something is wrong."""
    risen = c.sequencer.event and c.guard.code == 0
    c.sequencer.event = 0
    return 1 if risen else 0


@step
def arrive_within(c: PhaseController, windows: int) -> None:
    """The axis must be ready within so many windows of the speed detector; 0 lifts it."""
    await_arrival(c.guard, windows)


@step
def forget_conduct(c: PhaseController) -> None:
    """A stretch begins that is to be judged for itself."""
    guard.forget_conduct(c.guard)


@step
def power_on(c: PhaseController) -> None:
    """All counters are cleared together; it begins in the acquisition, the bridge off."""
    reset_carrier(c.converters.carrier)
    c.sequencer.mode = POSITION_MODE
    c.sequencer.direction = 1
    c.wake = NEVER
