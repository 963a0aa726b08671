"""The phase servo, wired as its block diagram (phase-servo specification 2).

    host -> sequencer -> corrector, integrator, arithmetic -> PWM -> split bridge -> motor -> wire, carriage
               ^   ^                    ^                                                        |
     absolute |   | +/- pulses         | speed word                                             v
      converter   tracking converter ---+ <------- comparator <------- detector <- carrier, clocks

One tick is one period of the reference clocks, two of the oscillator: in the first CK1 counts, in the second CK2
samples. Its order is: sample (comparator, converters, pulses), decide, actuate, move. The words of the logic are
combinational; they are worked out in the ticks in which something they depend on has changed.
"""

from detent.control.clock_chain import ClockChain, ClockParams, integrate_strobe, next_period, sample_strobe
from detent.control.phase_law import Law, LawParams, drive_word, integrate
from detent.control.phase_sequencer import (
    ACQUIRE,
    POSITION_MODE,
    SETTLE_READY,
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
from detent.drive.sawtooth_pwm import SawtoothParams, SawtoothPwm, count_sawtooth
from detent.drive.split_bridge import SplitBridge, SplitBridgeParams, drive_two, sense_current
from detent.kernel.compiled import copy_back, local_copy
from detent.kernel.loop import ticks
from detent.kernel.registers import Registers, block, i8, register, u1
from detent.kernel.step import hot_step, step
from detent.plant.drive_train import DriveTrain, DriveTrainParams, move_averaged
from detent.plant.push import Push, push_force
from detent.sensing.absolute_converter import AbsoluteConverter, AbsoluteParams, absolute_error, count_absolute
from detent.sensing.carrier import Carrier, CarrierParams, count_carrier, reset_carrier
from detent.sensing.gauge import Gauge, read_gauge
from detent.sensing.interference import (
    Interference,
    InterferenceParams,
    interfere,
    lose,
    start_interference,
    take_away,
)
from detent.sensing.phase_detector import Detector, DetectorParams, compare
from detent.sensing.pulse_counter import PulseCounter, PulseCounterParams, add_pulses, close_window
from detent.sensing.tracking_converter import (
    TrackingConverter,
    TrackingParams,
    count_reference,
    emit_pulse,
    shift_samples,
)


class ConverterParams(Registers):
    """Everything that the clocked logic between comparator and pulses reads."""

    carrier: CarrierParams = block("carrier generator")
    tracking: TrackingParams = block("tracking converter")
    absolute: AbsoluteParams = block("absolute converter")


class Converters(Registers):
    """The logic that runs in every tick: carrier, tracking and absolute converter."""

    carrier: Carrier = block("carrier generator")
    tracking: TrackingConverter = block("tracking converter")
    absolute: AbsoluteConverter = block("absolute converter")


class PhaseServoParams(Registers):
    """Everything about the axis that does not change while it runs."""

    clocks: ClockParams = block("taps of the divider")
    converters: ConverterParams = block("converters")
    detector: DetectorParams = block("detector and comparator")
    speed: PulseCounterParams = block("speed detector")
    sequencer: SequencerParams = block("sequencer")
    law: LawParams = block("corrector, integrator, arithmetic")
    pwm: SawtoothParams = block("PWM")
    bridge: SplitBridgeParams = block("bridge")
    train: DriveTrainParams = block("motor and mechanics")
    interference: InterferenceParams = block("noise on the pulse lines")
    push: Push = block("disturbing force")


class PhaseServo(Registers):
    """State of the whole axis."""

    tick: i8 = register("periods of the reference clock since power-on", unit="tick")
    clocks: ClockChain = block("oscillator, clocks, divider")
    detector: Detector = block("detector and comparator")
    converters: Converters = block("converters")
    speed: PulseCounter = block("speed detector 350")
    sequencer: Sequencer = block("sequencer 100")
    law: Law = block("corrector, integrator, arithmetic")
    wake: i8 = register("next tick in which a one-shot runs out", unit="tick")
    pwm: SawtoothPwm = block("PWM")
    bridge: SplitBridge = block("bridge")
    train: DriveTrain = block("motor and carriage")
    interference: Interference = block("noise on the pulse lines")
    gauge: Gauge = block("what an observer sees of the move")
    changed: u1 = register("1 when the words of the logic must be worked out anew")


@hot_step
def convert(p: ConverterParams, r: Converters, ps: int) -> None:
    """Both converters for one tick; the carrier has counted, and `ps` is the comparator's answer to it."""
    count_reference(p.tracking, r.tracking)
    count_absolute(p.absolute, r.absolute, ps)
    emit_pulse(p.tracking, r.tracking)
    shift_samples(p.tracking, r.tracking, ps)


@step
def receive_pulses(p: PhaseServoParams, r: PhaseServo, plus: int, minus: int) -> None:
    """Pulses as they arrive on the counting lines: with what interference has put in or taken away."""
    n = r.interference
    if plus + minus:
        hear_tracker(r.sequencer, plus - minus, r.tick)
        if take_away(n):
            plus = minus = 0
    plus += n.plus
    minus += n.minus
    count_pulses(r.sequencer, plus, minus)
    add_pulses(p.speed, r.speed, plus - minus)
    r.changed = 1


@step
def sample_speed(p: PhaseServoParams, r: PhaseServo) -> None:
    """Speed strobe 400f; in the acquisition it also asks whether the tracker has come to rest."""
    if not lose(r.interference):
        close_window(r.speed)
        r.changed = 1
    s = r.sequencer
    if s.state == ACQUIRE and r.tick - s.last_pulse > p.sequencer.quiet_ticks:
        enable(p, r)


@step
def enable(p: PhaseServoParams, r: PhaseServo) -> None:
    """The tracker is locked: clear what its pulses have left, and let the bridge drive."""
    s = r.sequencer
    r.speed.count = r.speed.word = 0
    s.distance = s.remaining = s.position = 0
    r.bridge.enabled = 1
    enter_position(p.sequencer, s, r.tick)
    r.changed = 1


@step
def decide(p: PhaseServoParams, r: PhaseServo, error: int) -> None:
    """Sequencer, corrector, integrator and arithmetic after a change; `error` is the absolute word's."""
    s = r.sequencer
    r.changed = 0
    if take_command(s):
        r.law.integral = 0
    if s.mode == SPEED_MODE and s.distance <= p.sequencer.threshold:
        enter_position(p.sequencer, s, r.tick)
    run_timers(s, r.tick)
    r.wake = next_timer(s)
    r.law.setpoint = setpoint(p.sequencer, s, error)
    drive_word(p.law, r.law, s.mode, s.stop, r.speed.word)


@step
def tick_integrator(p: PhaseServoParams, r: PhaseServo) -> None:
    """Integration clock 400e: it counts at stop only."""
    if r.sequencer.stop and p.law.integrator:
        integrate(p.law, r.law, r.law.setpoint)
        r.changed = 1


@hot_step
def sample(p: PhaseServoParams, r: PhaseServo, x: float) -> None:
    """Clocks, comparator, converters; what their pulses and strobes change is noted."""
    c = r.converters
    next_period(r.clocks)
    count_carrier(p.converters.carrier, c.carrier)
    compare(p.detector, r.detector, c.carrier.count, x)
    if r.tick >= r.interference.next_tick:
        interfere(p.interference, r.interference, r.tick)
        r.detector.ps ^= r.interference.corrupt
        r.changed |= r.interference.plus + r.interference.minus > 0
    convert(p.converters, c, r.detector.ps)
    next_period(r.clocks)
    if c.tracking.plus | c.tracking.minus | r.changed:
        receive_pulses(p, r, c.tracking.plus, c.tracking.minus)
    r.changed |= c.absolute.latched | r.sequencer.strobe
    if integrate_strobe(p.clocks, r.clocks):
        tick_integrator(p, r)
    if sample_strobe(p.clocks, r.clocks):
        sample_speed(p, r)


@hot_step
def actuate(p: PhaseServoParams, r: PhaseServo, current: float) -> None:
    """Two oscillator periods of the sawtooth, and what the bridge makes of them."""
    count_sawtooth(p.pwm, r.pwm, r.law.word)
    first = r.pwm.request
    count_sawtooth(p.pwm, r.pwm, r.law.word)
    sense_current(p.bridge, r.bridge, current)
    drive_two(p.bridge, r.bridge, first, r.pwm.request)


@hot_step
def move(p: PhaseServoParams, r: PhaseServo, train: DriveTrain) -> None:
    """The plant moves through the tick."""
    train.force = push_force(p.push, r.tick)
    move_averaged(p.train, train, r.bridge.positive, r.bridge.negative)
    read_gauge(r.gauge, r.tick, train.position, train.velocity)


@ticks(PhaseServoParams, local="train")
@hot_step
def tick(p: PhaseServoParams, r: PhaseServo, train: DriveTrain) -> bool:
    """One period of the reference clocks, on `train` of `r`; none while the host must look: ready."""
    if r.sequencer.event:
        return False
    sample(p, r, train.position)
    if r.changed or r.tick >= r.wake:
        decide(p, r, absolute_error(p.converters.absolute, r.converters.absolute))
    actuate(p, r, train.current)
    move(p, r, train)
    r.tick += 1
    return True


def switch_on(p: PhaseServoParams, r: PhaseServo, position: float, seed: int) -> None:
    """Power-on with the carriage at `position` [m]; `seed` starts the noise of comparator and lines.

    All counters are cleared together; the axis begins in the acquisition, its bridge off.
    """
    r.train.position = position
    reset_carrier(r.converters.carrier)
    r.detector.noise.state = seed
    start_interference(p.interference, r.interference, seed ^ 0x5DEECE66D)
    r.sequencer.mode = POSITION_MODE
    r.sequencer.direction = 1
    r.wake = 1 << 62


def be_ready(p: PhaseServoParams, r: PhaseServo) -> None:
    """As after an acquisition and its settling: locked, enabled, at hold; for runs that begin with a command."""
    compare(p.detector, r.detector, r.converters.carrier.count, r.train.position)
    steps = (r.detector.phase >> p.detector.carrier_shift) + r.converters.carrier.count
    r.converters.tracking.reference = steps & p.converters.tracking.mask
    r.bridge.enabled = 1
    s = r.sequencer
    s.state, s.ready, s.stop = SETTLE_READY, 1, 0
    s.stop_at = r.tick
    r.changed = 1


@step
def run_converters(p: ConverterParams, r: Converters, d: DetectorParams, start: int, rate: int, periods: int) -> int:
    """Converters alone, the phase of the secondary at `start` and growing by `rate` per period [2^-32 turn]."""
    local = local_copy(r)
    net = 0
    phase = start
    for _ in range(periods):
        count_carrier(p.carrier, local.carrier)
        ps = (phase + (local.carrier.count << d.carrier_shift)) >> 31 & 1
        convert(p, local, ps)
        net += local.tracking.plus - local.tracking.minus
        phase += rate
    copy_back(r, local)
    return net
