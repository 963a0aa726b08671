"""The machine of the print head: encoder, PWM timer, bridge, motor and carriage; an observer watches the paper."""

from detent.control.column_timer import COLUMNS
from detent.drive.h_bridge import Bridge, BridgeLines, steer
from detent.drive.pwm_timer import PwmTimer, trigger
from detent.kernel.registers import Registers, block, f8, i4, i4_array, register, u1
from detent.kernel.step import hot_step, step
from detent.methods.print_head.controller import EDGES, PERIOD_US, PrintHeadLines
from detent.plant.drive_train import DriveTrain, DriveTrainParams, move_averaged
from detent.plant.push import Push, push_force
from detent.plant.switched_motor import Scratch, SwitchedParams, move_switched
from detent.sensing.encoder import Encoder, EncoderParams, pass_left, pass_right, stand_at

AVERAGED, SWITCH_LEVEL = 0, 1
CYCLE = 4


class PaperParams(Registers):
    """Where the columns belong, and how long a wire flies."""

    column_zero: i4 = register("carriage position of column 0, 1/256 emitter", unit="emitter/256")
    column_pitch: i4 = register("distance of two columns, 1/256 emitter", unit="emitter/256")
    flight_time: f8 = register("time from firing to the paper", unit="s")
    metres_per_unit: f8 = register("length of 1/256 emitter", unit="m")


class Paper(Registers):
    """Where the columns landed."""

    landed: i4_array = register(
        "where each fired column landed, right of its place; bank 0, then bank 1", unit="nm", length=2 * COLUMNS
    )
    offset: f8 = register("where the last column landed, right of its place", unit="m")


class PrintHeadPlantParams(Registers):
    """Constants of the machine."""

    fidelity: u1 = register("0 averaged, 1 switch level")
    supply: f8 = register("true supply of the bridge", unit="V")
    train: DriveTrainParams = block("motor and mechanics")
    encoder: EncoderParams = block("encoder")
    paper: PaperParams = block("paper and flight of the wires")
    push: Push = block("disturbing force")
    switched: SwitchedParams = block("pulse responses of the switch-level fidelity")


class PrintHeadPlant(Registers):
    """State of the machine."""

    train: DriveTrain = block("motor and carriage")
    sampled: f8 = register("carriage position at the beginning of the period", unit="m")
    encoder: Encoder = block("encoder disc")
    timer: PwmTimer = block("PWM timer")
    latch: BridgeLines = block("lines as the decoder took them over at the trigger")
    bridge: Bridge = block("H-bridge")
    scratch: Scratch = block("work space of the switch-level solution")
    paper: Paper = block("columns on the paper, seen by an observer")


@hot_step
def pace(r: PrintHeadPlant, x: float) -> float:
    """How long the carriage took on its way to `x` [us/m]; 0 if it stands."""
    return PERIOD_US / (x - r.sampled) if x != r.sampled else 0.0


@hot_step
def report_edge(r: PrintHeadPlant, lines: PrintHeadLines, edge: float, per_metre: float) -> None:
    """An edge at `edge`, with the carriage on its way at `per_metre` [us/m]: its time and the levels after it.

    More than the lines can carry loses whole cycles, so that the levels stay in their sequence.
    """
    k = lines.edges
    if k == EDGES:
        k -= CYCLE
    lines.when_us[k] = min(int((edge - r.sampled) * per_metre), PERIOD_US - 1)
    lines.levels[k] = r.encoder.channel_a | r.encoder.channel_b << 1
    lines.edges = k + 1


@hot_step
def sense(p: PrintHeadPlantParams, r: PrintHeadPlant, train: DriveTrain, lines: PrintHeadLines) -> None:
    """What the encoder saw in the last period."""
    e, x = r.encoder, train.position
    lines.edges = 0
    if x >= e.next_right:
        per_metre = pace(r, x)
        while x >= e.next_right:
            edge = e.next_right
            pass_right(p.encoder, e)
            report_edge(r, lines, edge, per_metre)
    elif x < e.next_left:
        per_metre = pace(r, x)
        while x < e.next_left:
            edge = e.next_left
            pass_left(p.encoder, e)
            report_edge(r, lines, edge, per_metre)


@step
def land(p: PaperParams, r: Paper, place: int, x: float, v: float) -> None:
    """A column fired with the head at `x` [m] and `v` [m/s] flies on, and lands right of its place."""
    wanted = (p.column_zero + (place & (COLUMNS - 1)) * p.column_pitch) * p.metres_per_unit
    r.offset = x + v * p.flight_time - wanted
    r.landed[place] = int(r.offset * 1e9)


@hot_step
def observe(p: PrintHeadPlantParams, r: PrintHeadPlant, train: DriveTrain, lines: PrintHeadLines) -> None:
    """Columns fired in the last period, with the carriage where it truly was, from the left frame."""
    for k in range(lines.fired):
        share = lines.fired_us[k] * (1.0 / PERIOD_US)
        x = r.sampled + (train.position - r.sampled) * share
        land(p.paper, r.paper, lines.place[k], x, train.velocity)
    r.sampled = train.position


@hot_step
def take_over(p: PrintHeadPlantParams, r: PrintHeadPlant, lines: PrintHeadLines) -> None:
    """25 kHz trigger: timer and decoder take over what the computer put out; the bridge follows."""
    changed = lines.count != r.timer.pulse or lines.right_left != r.latch.right_left
    if changed or lines.transition != r.latch.transition:
        trigger(r.timer, lines.count)
        r.latch.right_left = lines.right_left
        r.latch.transition = lines.transition
        steer(r.bridge, r.latch, r.timer.pulse, p.supply)


@hot_step
def move(p: PrintHeadPlantParams, r: PrintHeadPlant, train: DriveTrain, lines: PrintHeadLines, tick: int) -> None:
    """The machine moves through the period."""
    take_over(p, r, lines)
    b = r.bridge
    train.force = push_force(p.push, tick)
    if p.fidelity == AVERAGED:
        move_averaged(p.train, train, b.mean_positive, b.mean_negative)
    else:
        move_switched(
            p.train, p.switched, train, r.scratch, b.pulse, b.on_positive, b.on_negative, b.off_positive, b.off_negative
        )


def stand(p: PrintHeadPlantParams, r: PrintHeadPlant, position: float, seed: int) -> None:
    """At rest at `position` [m], the bridge off; `seed` starts the encoder's noise."""
    r.train.position = r.sampled = position
    stand_at(p.encoder, r.encoder, position, seed)
    steer(r.bridge, r.latch, 0, p.supply)
