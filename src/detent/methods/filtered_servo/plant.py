"""The machine of a filtered servo: PWM and amplifier, motor, screw, slide, encoder, and the noise on its lines."""

from detent.kernel.compiled import unlikely
from detent.kernel.registers import Registers, block, f8, i8, register, u1
from detent.kernel.step import hot_step, step
from detent.methods.filtered_servo.controller import CLOCKS, LEVELS, FilteredLines
from detent.plant.drive_train import DriveTrain, DriveTrainParams, move_averaged, move_with_current
from detent.plant.push import Push, push_force
from detent.sensing.encoder import Encoder, EncoderParams, pass_left, pass_right
from detent.sensing.gauge import Gauge, read_gauge
from detent.sensing.home_marks import HomeMarks, HomeMarksParams, sense_marks
from detent.sensing.interference import Interference, InterferenceParams, count_losses, interfere


class AmplifierParams(Registers):
    """PWM and amplifier."""

    voltage_drive: u1 = register("0 the amplifier imposes a current, 1 a voltage")
    per_count: f8 = register("current or voltage per count of the drive word", unit="A/count, V/count")
    carrier_ticks: i8 = register("ticks of one PWM period", unit="tick")


class Amplifier(Registers):
    """What the PWM has taken over."""

    left: i8 = register("ticks until the PWM takes the next word", unit="tick")
    word: f8 = register("drive word of the running PWM period", unit="count")


class FilteredPlantParams(Registers):
    """Constants of the machine."""

    amplifier: AmplifierParams = block("PWM and amplifier")
    encoder: EncoderParams = block("encoder")
    train: DriveTrainParams = block("motor and mechanics")
    interference: InterferenceParams = block("noise on the pulse lines")
    push: Push = block("disturbing force")
    home: HomeMarksParams = block("switch and index by which it finds its reference")


class FilteredPlant(Registers):
    """State of the machine."""

    sampled: f8 = register("slide position at the last sample", unit="m")
    encoder: Encoder = block("encoder disc")
    amplifier: Amplifier = block("PWM and amplifier")
    train: DriveTrain = block("motor and slide")
    interference: Interference = block("noise on the pulse lines")
    gauge: Gauge = block("what an observer sees of the move")
    home: HomeMarks = block("switch and index by which it finds its reference")


@hot_step
def has_passed(edge: float, start: float, way: float, k: int, right: bool) -> bool:
    """True when the slide, `way` [m] in the tick, has passed an edge by clock `k`."""
    return (start + way * ((k + 1) * (1.0 / CLOCKS)) >= edge) == right


@hot_step
def clock_of(edge: float, start: float, way: float, k: int, right: bool) -> int:
    """Clock, `k` or later, in which the slide passes an edge: at their quotient or beside it, as its places say."""
    first, ahead = k, edge - start
    k = max(int(ahead / way * CLOCKS) if abs(ahead) < abs(way) else CLOCKS - 1, first)
    if k > first and has_passed(edge, start, way, k - 1, right):
        k -= 1
    elif k < CLOCKS and not has_passed(edge, start, way, k, right):
        k += 1
    return k


@hot_step
def pass_edges(p: EncoderParams, r: Encoder, lines: FilteredLines, start: float, x: float) -> None:
    """The disc follows the slide, going evenly from `start` to `x` [m]; new levels from the clock of each edge on."""
    right = x >= r.next_right
    k = 0
    while (x >= r.next_right) if right else (x < r.next_left):
        k = clock_of(r.next_right if right else r.next_left, start, x - start, k, right)
        if k == CLOCKS:
            return
        if right:
            pass_right(p, r)
        else:
            pass_left(p, r)
        lines.changed = 1
        later = LEVELS << k & LEVELS
        lines.a = lines.a & ~later | r.channel_a * later
        lines.b = lines.b & ~later | r.channel_b * later


@step
def disturb(p: InterferenceParams, r: Interference, tick: int, lines: FilteredLines) -> None:
    """Noise of this tick: pulses and an inverted sample in its first clock, and what will be lost on the way."""
    interfere(p, r, tick)
    lines.stray = r.plus - r.minus
    lines.a ^= r.corrupt
    lines.changed |= lines.stray != 0 or r.corrupt
    lines.swallow, lines.mask = r.removed + r.remove, r.lost + r.lose_sample


@hot_step
def hold_levels(r: Encoder, lines: FilteredLines) -> None:
    """The disc stands: the same levels in all clocks of the tick."""
    lines.a, lines.b = r.channel_a * LEVELS, r.channel_b * LEVELS
    lines.changed = 0


@hot_step
def sense(p: FilteredPlantParams, plant: FilteredPlant, x: float, tick: int, lines: FilteredLines) -> None:
    """What happened on the lines during the last tick; the slide stands at `x` [m] now."""
    if unlikely(lines.changed != 0):
        hold_levels(plant.encoder, lines)
    if unlikely(x >= plant.encoder.next_right or x < plant.encoder.next_left):
        pass_edges(p.encoder, plant.encoder, lines, plant.sampled, x)
        if p.home.present:
            sense_marks(p.home, plant.home, lines.home, x)
    plant.sampled = x
    if unlikely(tick >= plant.interference.next_tick):
        disturb(p.interference, plant.interference, tick, lines)


@hot_step
def actuate(p: AmplifierParams, r: Amplifier, lines: FilteredLines) -> None:
    """The PWM takes over the drive word at the beginning of its period; a fault switches it off at once."""
    r.left -= 1
    if r.left <= 0 or not lines.run:
        r.left = p.carrier_ticks
        r.word = lines.word


@hot_step
def move(p: FilteredPlantParams, plant: FilteredPlant, train: DriveTrain, tick: int, lines: FilteredLines) -> None:
    """The plant moves through the tick; without drive it coasts, whatever the amplifier."""
    actuate(p.amplifier, plant.amplifier, lines)
    n = plant.interference
    if unlikely(n.remove + n.lose_sample > 0):
        count_losses(n, lines.swallowed - n.removed, lines.missed - n.lost)
    train.force = push_force(p.push, tick)
    output = plant.amplifier.word * p.amplifier.per_count
    if p.amplifier.voltage_drive and lines.run:
        move_averaged(p.train, train, output, output)
    else:
        move_with_current(p.train, train, output if lines.run else 0.0)
    read_gauge(plant.gauge, tick, train.position, train.velocity)
