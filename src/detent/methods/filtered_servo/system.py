"""The filtered servo, wired as its block diagram (filtered-servo specification 2).

    command pulses -> position counter -> E = K1 P - y -> PWM -> amplifier -> motor -> screw, slide
                            ^                    ^                                        |
                            |   speed counter -> x B -> filter                            v
                            +------ +------ decoder <------------- encoder <--------------+
                                    sample clock drives counter and filter

One tick is 10 us, ten clocks of the decoder. Its order is: sample what the encoder saw during the last tick, decide,
actuate, move. Decoder clocks in which nothing happens, or nothing whose moment matters, are skipped.
"""

from detent.control.deviation_counter import (
    FAULT,
    RESET,
    RUN,
    Deviation,
    DeviationParams,
    count_deviation,
    drive_word,
    watch_ranges,
)
from detent.control.pulse_generator import (
    PulseGenerator,
    PulseGeneratorParams,
    clock_generator,
    keeps_rate,
    ramp_rate,
)
from detent.control.sample_clock import SampleClock, count_clock
from detent.kernel.loop import Bytes, Offsets, ticks, write_row
from detent.kernel.registers import Registers, block, f8, i8, register, u1
from detent.kernel.step import hot_step, step
from detent.plant.drive_train import DriveTrain, DriveTrainParams, move_averaged, move_with_current
from detent.plant.push import Push, push_force
from detent.sensing.encoder import Encoder, EncoderParams, is_one_edge, pass_left, pass_right, stand_at
from detent.sensing.gauge import Gauge, read_gauge
from detent.sensing.interference import (
    Interference,
    InterferenceParams,
    interfere,
    lose,
    start_interference,
    take_away,
)
from detent.sensing.pulse_counter import PulseCounter, PulseCounterParams, add_pulses, close_window
from detent.sensing.quadrature import ClockedDecoder, clock_decoder, is_settled, preset_decoder
from detent.sensing.speed_filter import SpeedFilter, SpeedFilterParams, filter_speed

TICK_US = 10
TICK = TICK_US * 1e-6
"""Base tick [s]."""
CLOCKS = 10
"""Decoder clocks of 1 us in a tick."""

NEVER = 1 << 62


class AmplifierParams(Registers):
    """PWM and amplifier."""

    voltage_drive: u1 = register("0 the amplifier imposes a current, 1 a voltage")
    per_count: f8 = register("current or voltage per count of the drive word", unit="A/count, V/count")
    carrier_ticks: i8 = register("ticks of one PWM period", unit="tick")


class Amplifier(Registers):
    """What the PWM has taken over."""

    left: i8 = register("ticks until the PWM takes the next word", unit="tick")
    word: f8 = register("drive word of the running PWM period", unit="count")


class FilteredServoParams(Registers):
    """Everything about the axis that does not change while it runs."""

    generator: PulseGeneratorParams = block("command pulses")
    deviation: DeviationParams = block("position counter and error")
    speed: PulseCounterParams = block("speed counter")
    filter: SpeedFilterParams = block("scale and filter")
    amplifier: AmplifierParams = block("PWM and amplifier")
    encoder: EncoderParams = block("encoder")
    train: DriveTrainParams = block("motor and mechanics")
    interference: InterferenceParams = block("noise on the pulse lines")
    push: Push = block("disturbing force")
    window: i8 = register("deviation that counts as in position", unit="count")
    window_ticks: i8 = register("time inside it until the axis says so", unit="tick")


class FilteredServo(Registers):
    """State of the whole axis."""

    tick: i8 = register("periods of 10 us since power-on", unit="tick")
    generator: PulseGenerator = block("command pulses")
    sampled: f8 = register("slide position at the last sample", unit="m")
    encoder: Encoder = block("encoder disc")
    decoder: ClockedDecoder = block("quadrature decoder")
    busy: u1 = register("1 while the decoder has not settled, or the host has written a command")
    deviation: Deviation = block("position counter and error")
    speed: PulseCounter = block("speed counter")
    clock: SampleClock = block("sample clock")
    filter: SpeedFilter = block("scale and filter")
    amplifier: Amplifier = block("PWM and amplifier")
    train: DriveTrain = block("motor and slide")
    interference: Interference = block("noise on the pulse lines")
    gauge: Gauge = block("what an observer sees of the move")
    failed: u1 = register("1 when the host has been told of a fault")
    away: u1 = register("1 while commanded or out of position")
    arrived: i8 = register("tick in which the axis last came into position", unit="tick")
    wake: i8 = register("tick at which the axis will be in position", unit="tick")
    event: u1 = register("1 when the axis has come into position or failed; the host clears it")


@hot_step
def pass_edges(p: FilteredServoParams, r: FilteredServo, x: float) -> None:
    """The encoder follows the slide to `x` [m]."""
    while x >= r.encoder.next_right:
        pass_right(p.encoder, r.encoder)
    while x < r.encoder.next_left:
        pass_left(p.encoder, r.encoder)


@hot_step
def count_movement(p: FilteredServoParams, r: FilteredServo, commanded: int, moved: int) -> None:
    """Pulses of one clock on the counting lines."""
    if commanded or moved:
        count_deviation(r.deviation, commanded, moved)
        add_pulses(p.speed, r.speed, moved)
        watch_ranges(p.deviation, r.deviation, r.speed.count, p.speed.half)


@hot_step
def sample_speed(p: FilteredServoParams, r: FilteredServo) -> None:
    """Strobe CS: counter to register and filter, in one event."""
    if not lose(r.interference):
        close_window(r.speed)
        filter_speed(p.filter, r.filter, r.speed.word)


@hot_step
def one_clock(p: FilteredServoParams, r: FilteredServo, x: float, k: int) -> None:
    """Decoder clock `k` of a tick in which the slide went from `sampled` to `x` [m].

    The strobe comes first, so that a pulse that comes with it belongs to the new window; then what the pulse lines
    show; then the flip-flops.
    """
    pass_edges(p, r, r.sampled + (x - r.sampled) * ((k + 1) * (1.0 / CLOCKS)))
    if count_clock(r.clock):
        sample_speed(p, r)
    moved = r.decoder.forward - r.decoder.reverse
    if moved and take_away(r.interference):
        moved = 0
    if k == 0:
        moved += r.interference.plus - r.interference.minus
    count_movement(p, r, clock_generator(r.generator, 1), moved)
    flip = r.interference.corrupt if k == 0 else 0
    clock_decoder(r.decoder, r.encoder.channel_a ^ flip, r.encoder.channel_b)


@hot_step
def skip_clocks(p: FilteredServoParams, r: FilteredServo, clocks: int) -> int:
    """Clocks in which nothing but command pulses can come, which count alike wherever they do; returns them, signed."""
    r.clock.left -= clocks
    commanded = clock_generator(r.generator, clocks)
    count_movement(p, r, commanded, 0)
    return commanded


@hot_step
def is_calm(p: FilteredServoParams, r: FilteredServo, x: float, clocks: int) -> bool:
    """True when the order of events in the last `clocks` of the tick does not matter.

    The decoder is at rest, no strobe is due, no more than one edge comes, and the deviation is far from its limit.
    """
    if not is_settled(r.decoder, r.encoder.channel_a, r.encoder.channel_b) or r.clock.left <= clocks:
        return False
    return abs(r.deviation.deviation) + clocks < p.deviation.range and is_one_edge(p.encoder, r.encoder, x)


@step
def run_clocks(p: FilteredServoParams, r: FilteredServo, x: float, stray: int) -> None:
    """Ten decoder clocks in which something happens, and what follows from them.

    From where the tick is calm only its last two clocks are run: an edge is counted in the tick in which it comes,
    unless it comes in the last clock. Interference acts in the first.
    """
    k = 0
    while k < CLOCKS:
        if k < CLOCKS - 2 and stray == 0 and is_calm(p, r, x, CLOCKS - k):
            skip_clocks(p, r, CLOCKS - 2 - k)
            k = CLOCKS - 2
        one_clock(p, r, x, k)
        stray = 0
        k += 1
    conclude(p, r)


@step
def conclude(p: FilteredServoParams, r: FilteredServo) -> None:
    """After the clocks of a tick: is the decoder at rest, and what is the drive word now."""
    r.busy = 0 if is_settled(r.decoder, r.encoder.channel_a, r.encoder.channel_b) else 1
    decide(p, r)


@step
def decide(p: FilteredServoParams, r: FilteredServo) -> None:
    """Error and drive word after a change, and whether the axis is in position."""
    d = r.deviation
    if d.state == FAULT and r.failed == 0:
        r.failed = 1
        r.event = 1
    drive_word(p.deviation, d, r.filter.output)
    away = r.generator.command != r.generator.goal or abs(d.deviation) > p.window
    if away:
        r.wake = NEVER
    elif r.away:
        r.arrived = r.tick
        r.wake = r.tick + p.window_ticks
    r.away = 1 if away else 0


@hot_step
def prepare(p: FilteredServoParams, r: FilteredServo) -> int:
    """Rate of the command and noise of this tick; not zero when noise has come."""
    moving = r.generator.command != r.generator.goal or r.generator.present > 0
    if moving and not keeps_rate(p.generator, r.generator):
        ramp_rate(p.generator, r.generator)
    if r.tick < r.interference.next_tick:
        return 0
    interfere(p.interference, r.interference, r.tick)
    return r.interference.plus + r.interference.minus + r.interference.corrupt


@hot_step
def sample(p: FilteredServoParams, r: FilteredServo, x: float) -> None:
    """What happened on the lines during the last tick; the slide stands at `x` [m] now."""
    stray = prepare(p, r)
    moved = x >= r.encoder.next_right or x < r.encoder.next_left
    if moved or r.busy or stray or r.clock.left <= CLOCKS:
        run_clocks(p, r, x, stray)
    elif skip_clocks(p, r, CLOCKS):
        decide(p, r)
    r.sampled = x


@step
def leave_reset(r: FilteredServo) -> None:
    """Power-on, or the host's answer to a fault: all counters at zero, the command where the slide stands."""
    r.deviation.deviation = 0
    r.generator.goal = r.generator.command = r.deviation.position
    r.generator.present = r.generator.phase = r.generator.direction = 0
    r.speed.count = r.speed.word = 0
    r.filter.accumulator = r.filter.input = 0
    r.filter.output = r.deviation.error = r.deviation.word = 0.0
    preset_decoder(r.decoder, r.encoder.channel_a, r.encoder.channel_b)
    r.deviation.reset = 0
    r.deviation.state = RUN
    r.failed = 0
    r.event = 0
    r.busy = 1


@hot_step
def actuate(p: FilteredServoParams, r: FilteredServo) -> None:
    """The PWM takes over the drive word at the beginning of its period; a fault switches it off at once."""
    r.amplifier.left -= 1
    if r.amplifier.left <= 0 or r.deviation.state != RUN:
        r.amplifier.left = p.amplifier.carrier_ticks
        r.amplifier.word = r.deviation.word


@hot_step
def move(p: FilteredServoParams, r: FilteredServo, train: DriveTrain) -> None:
    """The plant moves through the tick; without drive it coasts, whatever the amplifier."""
    train.force = push_force(p.push, r.tick)
    output = r.amplifier.word * p.amplifier.per_count
    if p.amplifier.voltage_drive and r.deviation.state == RUN:
        move_averaged(p.train, train, output, output)
    else:
        move_with_current(p.train, train, output if r.deviation.state == RUN else 0.0)
    read_gauge(r.gauge, r.tick, train.position, train.velocity)


@hot_step
def drive(p: FilteredServoParams, r: FilteredServo, train: DriveTrain) -> None:
    """The second half of a tick: tell the host, actuate, move."""
    if r.tick >= r.wake:
        r.wake = NEVER
        r.event = 1
    actuate(p, r)
    move(p, r, train)
    r.tick += 1


@ticks(FilteredServoParams, local="train")
@hot_step
def tick(p: FilteredServoParams, r: FilteredServo, train: DriveTrain) -> bool:
    """Ten microseconds, on `train` of `r`; none while the host must look: in position, or failed."""
    if r.event:
        return False
    if r.deviation.reset:
        leave_reset(r)
    sample(p, r, train.position)
    drive(p, r, train)
    return True


@step
def advance_by_clocks(p: FilteredServoParams, r: FilteredServo, most: int, trace: Bytes, picks: Offsets) -> int:
    """The one loop with every decoder clock run and recorded, for timing diagrams: the same bits, clock by clock.

    Row ``10 tick + clock`` modulo rows of `trace` holds the registers after that clock.
    """
    n = 0
    while n < most and r.event == 0:
        if r.deviation.reset:
            leave_reset(r)
        prepare(p, r)
        for k in range(CLOCKS):
            one_clock(p, r, r.train.position, k)
            write_row(r, r.tick * CLOCKS + k, trace, picks, 1)
        conclude(p, r)
        r.sampled = r.train.position
        drive(p, r, r.train)
        n += 1
    return n


def switch_on(p: FilteredServoParams, r: FilteredServo, position: float, sample_us: int, seed: int) -> None:
    """Power-on with the slide at `position` [m], the sample clock at `sample_us`; `seed` starts all noise."""
    r.train.position = r.sampled = position
    stand_at(p.encoder, r.encoder, position, seed)
    start_interference(p.interference, r.interference, seed ^ 0x5DEECE66D)
    preset_decoder(r.decoder, r.encoder.channel_a, r.encoder.channel_b)
    r.clock.demanded = r.clock.period = r.clock.left = sample_us
    r.amplifier.left = 1
    r.wake = NEVER
    r.deviation.state = RESET
    r.deviation.reset = 1
