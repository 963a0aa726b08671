"""The controller of a filtered servo: what counts, filters and subtracts, and the host's words to it.

It sees the encoder as a synchronous circuit does: ten clocks in a tick of 10 us, the levels of each on the lines.
Clocks in which nothing happens, or nothing whose moment matters, are skipped.
"""

from detent.control import guard
from detent.control.clocks import SampleClock, count_clock
from detent.control.deviation_counter import (
    FAULT,
    GUARDED,
    RESET,
    RUN,
    Deviation,
    DeviationParams,
    count_deviation,
    drive_word,
    watch_ranges,
)
from detent.control.guard import Guard, GuardParams, await_arrival, enable_guard, is_overdue, watch, watch_number
from detent.control.pulse_generator import (
    PulseGenerator,
    PulseGeneratorParams,
    clock_generator,
    is_between_pulses,
    steer_rate,
)
from detent.kernel.compiled import unlikely
from detent.kernel.loop import controls
from detent.kernel.registers import CONTROLLER, PLANT, Registers, block, f8, i1, i8, register, u1, u2, u4
from detent.kernel.step import bounded, hot_step, step
from detent.sensing.counted_speed import (
    PulseCounter,
    PulseCounterParams,
    SpeedFilter,
    SpeedFilterParams,
    add_pulses,
    close_window,
    filter_speed,
)
from detent.sensing.home_marks import HomeLevels
from detent.sensing.quadrature import ClockedDecoder, clock_decoder, edge_direction, is_settled, preset_decoder

CLOCKS = 10  # decoder clocks of 1 us in a tick
LEVELS = (1 << CLOCKS) - 1  # a channel that is high in all clocks of a tick


class FilteredLines(Registers):
    """Wires between controller and plant; levels lie clock by clock, the first of the tick in bit 0."""

    a: u2 = register("levels of channel A in the ten clocks of the tick, the first in bit 0", by=PLANT)
    b: u2 = register("levels of channel B in the ten clocks of the tick, the first in bit 0", by=PLANT)
    changed: u1 = register("1 when a level changes in the tick, or noise comes", by=PLANT)
    stray: i1 = register("pulses that noise puts on the counting lines in the first clock, signed", by=PLANT)
    swallow: u4 = register("the counting line swallows pulses until `swallowed` is this", by=PLANT)
    mask: u4 = register("the strobe line loses strobes until `missed` is this", by=PLANT)
    swallowed: u4 = register("pulses swallowed so far", by=CONTROLLER)
    missed: u4 = register("strobes lost so far", by=CONTROLLER)
    word: f8 = register("drive word: E, saturated", unit="count", by=CONTROLLER)
    run: u1 = register("1 enables the amplifier", by=CONTROLLER)
    home: HomeLevels = block("home switch and index", by=PLANT)


class FilteredControllerParams(Registers):
    """Constants of the controller."""

    generator: PulseGeneratorParams = block("command pulses")
    deviation: DeviationParams = block("position counter and error")
    speed: PulseCounterParams = block("speed counter")
    filter: SpeedFilterParams = block("scale and filter")
    window: i8 = register("deviation that counts as in position", unit="count")
    window_ticks: i8 = register("time inside it until the axis says so", unit="tick")
    guard: GuardParams = block("protection")
    look_ticks: i8 = register("time between two looks of the guard", unit="tick")
    breaking: f8 = register("drive word that breaks the slide loose", unit="count")
    lowest: i8 = register("lower end of the travel, from where the slide stood at power-on", unit="count")
    highest: i8 = register("upper end of the travel", unit="count")


class FilteredController(Registers):
    """State of the controller."""

    generator: PulseGenerator = block("command pulses")
    channel_a: u1 = register("channel A as the running clock takes it")
    channel_b: u1 = register("channel B as the running clock takes it")
    decoder: ClockedDecoder = block("quadrature decoder")
    busy: u1 = register("1 while the decoder has not settled, or the host has written a command")
    deviation: Deviation = block("position counter and error")
    speed: PulseCounter = block("speed counter")
    clock: SampleClock = block("sample clock")
    filter: SpeedFilter = block("scale and filter")
    failed: u1 = register("1 when the host has been told of a fault")
    away: u1 = register("1 while commanded or out of position")
    settling: i8 = register("ticks until the axis says that it is in position; 0 it does not come to that", unit="tick")
    event: u1 = register("1 when the axis has come into position or failed; the host clears it")
    guard: Guard = block("protection")
    watched: i8 = register("pulses at the last look of the guard", unit="count")
    look: i8 = register("ticks until its next look", unit="tick")
    known: u1 = register("mailbox: 1 while the position is known: beyond an end of the travel it is then switched off")
    marks: i8 = register("index marks seen", unit="count")
    mark: i8 = register("pulses at the last one, from where the slide stood at power-on", unit="count")


# ---- host actions


@step
def power_on(c: FilteredController, lines: FilteredLines, sample_us: int) -> None:
    """The lines show where the disc stands; the first tick leaves the reset."""
    c.channel_a, c.channel_b = lines.a & 1, lines.b & 1
    c.clock.demanded = c.clock.period = c.clock.left = sample_us
    c.deviation.state = RESET
    c.known = 1
    reset(c)


@step
def go_to(c: FilteredController, goal: int, rate: int) -> None:
    """Command pulses up to `goal`, at `rate` [uHz]; where the command is: stop at once."""
    c.generator.goal, c.generator.rate = goal, rate
    c.away = c.busy = 1
    c.event = 0


@step
def reset(c: FilteredController) -> None:
    """Leave a fault."""
    c.deviation.reset = c.busy = 1
    c.event = 0


@step
def give_way(c: FilteredController) -> None:
    """The command stands where the slide does: what it has run ahead is forgotten."""
    g = c.generator
    c.deviation.deviation = 0
    g.goal = g.command = c.deviation.position
    g.present = g.phase = g.direction = 0
    c.busy = 1


@step
def shift_counters(c: FilteredController, pulses: int) -> None:
    """The slide stands elsewhere by so many pulses than was thought: every place shifts, and nothing moves."""
    c.deviation.position += pulses
    c.watched += pulses
    c.generator.goal += pulses
    c.generator.command += pulses


@step
def set_period(c: FilteredController, sample_us: int) -> None:
    """Sample period from the next window on [us]."""
    c.clock.demanded = sample_us


@step
def arrive_within(c: FilteredController, ticks: int) -> None:
    """The axis must come into position within so many ticks; 0 lifts it."""
    await_arrival(c.guard, ticks)


@step
def take_event(c: FilteredController) -> int:
    """The host's look at the event, which is answered by it: 1 in position, or failed."""
    event = c.event
    c.event = 0
    return event


@step
def forget_conduct(c: FilteredController) -> None:
    """A stretch begins that is to be judged for itself."""
    guard.forget_conduct(c.guard)


# ---- a clock of the decoder


@hot_step
def count_movement(p: FilteredControllerParams, c: FilteredController, commanded: int, moved: int) -> None:
    """Pulses of one clock on the counting lines."""
    if commanded or moved:
        count_deviation(c.deviation, commanded, moved)
        add_pulses(p.speed, c.speed, moved)
        watch_ranges(p.deviation, c.deviation, c.speed.count, p.speed.half)


@hot_step
def take_pulse(lines: FilteredLines, moved: int) -> int:
    """What the counting lines show of a pulse of the decoder, or of none."""
    if moved and lines.swallowed != lines.swallow:
        lines.swallowed += 1
        return 0
    return moved


@hot_step
def sample_speed(p: FilteredControllerParams, c: FilteredController, lines: FilteredLines) -> None:
    """Strobe CS: counter to register and filter, in one event."""
    if lines.missed != lines.mask:
        lines.missed += 1
    else:
        close_window(c.speed)
        filter_speed(p.filter, c.filter, c.speed.word)


@hot_step
def one_clock(p: FilteredControllerParams, c: FilteredController, lines: FilteredLines, k: int) -> None:
    """Decoder clock `k` of a tick.

    The strobe comes first, so that a pulse that comes with it belongs to the new window; then what the pulse lines
    show; then the flip-flops.
    """
    c.channel_a, c.channel_b = lines.a >> k & 1, lines.b >> k & 1
    if count_clock(c.clock):
        sample_speed(p, c, lines)
    moved = take_pulse(lines, c.decoder.forward - c.decoder.reverse)
    if k == 0:
        moved += lines.stray
    count_movement(p, c, clock_generator(c.generator, 1), moved)
    clock_decoder(c.decoder, c.channel_a, c.channel_b)


# ---- a tick


@hot_step
def is_calm(p: FilteredControllerParams, c: FilteredController, lines: FilteredLines, k: int) -> bool:
    """True when the order of events from clock `k` of the tick on does not matter.

    The decoder is at rest, no strobe is due, the levels change once at most, and the deviation is far from its limit.
    """
    clocks = CLOCKS - k
    if not is_settled(c.decoder, c.channel_a, c.channel_b) or c.clock.left <= clocks:
        return False
    a, b = lines.a >> k, lines.b >> k
    changes = ((a ^ (a << 1 | c.channel_a)) & LEVELS >> k) << CLOCKS | (b ^ (b << 1 | c.channel_b)) & LEVELS >> k
    return changes & (changes - 1) == 0 and abs(c.deviation.deviation) + clocks < p.deviation.range


@hot_step
def skip_clocks(p: FilteredControllerParams, c: FilteredController, clocks: int, moved: int) -> int:
    """Clocks in which command pulses, and one edge at most, count alike wherever they come; returns the former."""
    c.clock.left -= clocks
    commanded = clock_generator(c.generator, clocks)
    count_movement(p, c, commanded, moved)
    return commanded


@hot_step
def skip_rest(p: FilteredControllerParams, c: FilteredController, lines: FilteredLines, k: int) -> None:
    """The calm rest of a tick at once: an edge is counted in it, unless it comes in the last clock."""
    last = CLOCKS - 1
    a, b, moved = lines.a >> last, lines.b >> last, 0
    if a == lines.a >> last - 1 & 1 and b == lines.b >> last - 1 & 1:
        moved = take_pulse(lines, edge_direction(c.channel_a, c.channel_b, a, b))
        preset_decoder(c.decoder, a, b)
    else:
        clock_decoder(c.decoder, a, b)
    c.channel_a, c.channel_b = a, b
    skip_clocks(p, c, CLOCKS - k, moved)


@hot_step
@bounded(CLOCKS, "the clocks of a tick")
def run_clocks(p: FilteredControllerParams, c: FilteredController, lines: FilteredLines) -> None:
    """Ten decoder clocks in which something happens, until the rest is calm, and what follows from them."""
    if c.deviation.reset:
        leave_reset(c)
    k = 0
    # Noise puts its pulses into the first clock.
    while k < CLOCKS and ((k == 0 and lines.stray != 0) or not is_calm(p, c, lines, k)):
        one_clock(p, c, lines, k)
        k += 1
    if k < CLOCKS:
        skip_rest(p, c, lines, k)
    conclude(p, c, lines)


@hot_step
def conclude(p: FilteredControllerParams, c: FilteredController, lines: FilteredLines) -> None:
    """After the clocks of a tick: is the decoder at rest, was there a mark, and what is the drive word now."""
    c.busy = 0 if is_settled(c.decoder, c.channel_a, c.channel_b) else 1
    if unlikely(c.marks != lines.home.marks):
        c.marks, c.mark = lines.home.marks, c.deviation.position
    decide(p, c, lines)


@step
def decide(p: FilteredControllerParams, c: FilteredController, lines: FilteredLines) -> None:
    """Error and drive word after a change, and whether the axis is in position."""
    d = c.deviation
    if d.state == FAULT and c.failed == 0:
        c.failed = 1
        c.event = 1
    lines.word = drive_word(p.deviation, d, c.filter.output)
    lines.run = 1 if d.state == RUN else 0
    away = c.generator.command != c.generator.goal or abs(d.deviation) > p.window
    if away:
        c.settling = 0
    elif c.away:
        c.settling = p.window_ticks + 1
    c.away = 1 if away else 0


@step
def leave_reset(c: FilteredController) -> None:
    """Power-on, or the host's answer to a fault: all counters at zero, the command where the slide stands."""
    give_way(c)
    c.speed.count = c.speed.word = 0
    c.filter.accumulator = c.filter.input = 0
    c.filter.output = c.deviation.error = 0.0
    preset_decoder(c.decoder, c.channel_a, c.channel_b)
    c.deviation.reset = 0
    c.deviation.state = RUN
    enable_guard(c.guard)
    c.failed = 0
    c.event = 0


@hot_step
def is_quiet(c: FilteredController, lines: FilteredLines) -> bool:
    """True when no level changes in the tick, no noise and no strobe comes, and nothing is left to do."""
    return (lines.changed | c.busy) == 0 and c.clock.left > CLOCKS


@hot_step
def work(p: FilteredControllerParams, c: FilteredController, lines: FilteredLines, quiet: bool) -> None:
    """A tick in which something happens; on quiet lines it is a command pulse, whose moment does not matter."""
    steer_rate(p.generator, c.generator)
    if not quiet:
        run_clocks(p, c, lines)
    elif skip_clocks(p, c, CLOCKS, 0):
        decide(p, c, lines)


@hot_step
def watch_arrival(c: FilteredController) -> None:
    """Tell the host when the axis has been in position for its time, or has not come there in time."""
    if c.settling > 0:
        c.settling -= 1
        if c.settling == 0:
            c.event = 1
    if c.guard.awaited and is_overdue(c.guard) and c.event == 0:
        c.event = 1


@step
def protect(p: FilteredControllerParams, c: FilteredController, lines: FilteredLines) -> None:
    """The guard looks: effort by the drive word, way by the counted pulses."""
    c.look = p.look_ticks
    d, moved = c.deviation, c.deviation.position - c.watched
    c.watched = d.position
    if d.state != RUN:
        return
    pushing = 1 if lines.word >= p.breaking else -1 if lines.word <= -p.breaking else 0
    side = 0 if c.known == 0 else 1 if d.position > p.highest else -1 if d.position < p.lowest else 0
    limited = 1 if abs(lines.word) >= p.deviation.word_limit else 0
    watch_number(p.guard, c.guard, lines.word)
    if watch(p.guard, c.guard, 0, side, limited, pushing, moved):
        d.state, d.cause = FAULT, GUARDED
        decide(p, c, lines)


@hot_step
def end_tick(p: FilteredControllerParams, c: FilteredController, lines: FilteredLines) -> None:
    """What the clocks have left to say: the guard looks, and the axis may have arrived."""
    c.look -= 1
    if unlikely(c.look <= 0):
        protect(p, c, lines)
    if unlikely(c.settling | c.guard.awaited != 0):
        watch_arrival(c)


@controls(FilteredControllerParams)
@hot_step
def control(p: FilteredControllerParams, c: FilteredController, lines: FilteredLines) -> None:
    """Ten microseconds."""
    quiet = is_quiet(c, lines)
    if unlikely(not (quiet and is_between_pulses(p.generator, c.generator, CLOCKS))):
        work(p, c, lines, quiet)
    else:
        c.generator.phase += c.generator.present * CLOCKS
        c.clock.left -= CLOCKS
    end_tick(p, c, lines)


@step
def control_clock(p: FilteredControllerParams, c: FilteredController, lines: FilteredLines, k: int) -> None:
    """Clock `k` of a tick with every clock run, for timing diagrams: the same bits; after the last, what follows."""
    if k == 0:
        steer_rate(p.generator, c.generator)
        if c.deviation.reset:
            leave_reset(c)
    one_clock(p, c, lines, k)
