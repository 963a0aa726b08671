"""The machine of a phase servo: resolver and comparator, bridge, motor and carriage, and the noise on the lines."""

from detent.drive.split_bridge import SplitBridge, SplitBridgeParams, drive_two, sense_current
from detent.kernel.compiled import unlikely
from detent.kernel.registers import Registers, block
from detent.kernel.step import hot_step, step
from detent.methods.phase_servo.controller import PhaseLines
from detent.plant.drive_train import DriveTrain, DriveTrainParams, move_averaged
from detent.plant.push import Push, push_force
from detent.sensing.gauge import Gauge, read_gauge
from detent.sensing.home_marks import HomeMarks, HomeMarksParams, sense_marks
from detent.sensing.interference import Interference, InterferenceParams, count_losses, interfere
from detent.sensing.phase_detector import Detector, DetectorParams, compare


class PhasePlantParams(Registers):
    """What the machine is like."""

    detector: DetectorParams = block("detector and comparator")
    interference: InterferenceParams = block("noise on the lines")
    bridge: SplitBridgeParams = block("bridge")
    push: Push = block("disturbing force")
    train: DriveTrainParams = block("motor and mechanics")
    home: HomeMarksParams = block("switch by which it finds its reference")


class PhasePlant(Registers):
    """State of the machine."""

    detector: Detector = block("detector and comparator")
    interference: Interference = block("noise on the lines")
    bridge: SplitBridge = block("bridge")
    train: DriveTrain = block("motor and carriage")
    gauge: Gauge = block("what an observer sees of the move")
    home: HomeMarks = block("switch by which it finds its reference")


@step
def disturb(p: PhasePlantParams, plant: PhasePlant, lines: PhaseLines, tick: int) -> None:
    """Noise of this tick: what it flips and puts in, and whether pulse and strobe to come shall be lost."""
    n = plant.interference
    interfere(p.interference, n, tick)
    lines.ps ^= n.corrupt
    lines.plus = n.plus
    lines.minus = n.minus
    lines.swallow = n.remove > 0
    lines.mask = n.lose_sample > 0


@hot_step
def sense(p: PhasePlantParams, plant: PhasePlant, x: float, lines: PhaseLines, tick: int) -> None:
    """What the electronics see in this tick; the comparator answers to the carrier's next count, that of this CK1."""
    lines.ps = compare(p.detector, plant.detector, lines.carrier + 1, x)
    if unlikely(tick >= plant.interference.next_tick or lines.swallowed + lines.missed > 0):
        disturb(p, plant, lines, tick)
    if p.home.present:
        sense_marks(p.home, plant.home, lines.home, x)


@hot_step
def move(p: PhasePlantParams, plant: PhasePlant, train: DriveTrain, lines: PhaseLines, tick: int) -> None:
    """The machine moves through the tick."""
    if unlikely(lines.swallowed + lines.missed > 0):
        count_losses(plant.interference, lines.swallowed, lines.missed)
    sense_current(p.bridge, plant.bridge, train.current)
    first, second = (lines.first_request, lines.request) if lines.enable else (0, 0)
    drive_two(p.bridge, plant.bridge, first, second)
    train.force = push_force(p.push, tick)
    move_averaged(p.train, train, plant.bridge.positive, plant.bridge.negative)
    read_gauge(plant.gauge, tick, train.position, train.velocity)
