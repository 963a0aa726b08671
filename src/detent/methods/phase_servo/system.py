"""The phase servo, wired as its block diagram (phase-servo specification 2).

    host -> sequencer -> corrector, integrator, arithmetic -> PWM ===> split bridge -> motor -> wire, carriage
               ^   ^                    ^                                                        |
     absolute |   | +/- pulses         | speed word                                             v
      converter   tracking converter ---+ <================= comparator <------------------- detector <=== carrier

Left of the double arrows is the controller, right of them the plant; the arrows are the lines. One tick is one period
of the reference clocks: the plant answers to the carrier, the controller samples, decides and asks, the plant moves.
"""

from detent.control.phase_sequencer import SETTLE_READY
from detent.kernel.loop import ticks
from detent.kernel.registers import Registers, block, i8, register
from detent.kernel.step import Act, do, hot_step
from detent.methods.phase_servo.controller import PhaseController, PhaseControllerParams, PhaseLines, control, power_on
from detent.methods.phase_servo.plant import PhasePlant, PhasePlantParams, move, sense
from detent.plant.drive_train import DriveTrain
from detent.sensing.interference import start_interference
from detent.sensing.phase_detector import compare


class PhaseServoParams(Registers):
    """Everything about the axis that does not change while it runs."""

    controller: PhaseControllerParams = block("what the electronics are set to")
    plant: PhasePlantParams = block("what the machine is like")


class PhaseServo(Registers):
    """State of the whole axis."""

    tick: i8 = register("periods of the reference clock since power-on", unit="tick")
    controller: PhaseController = block("electronics")
    lines: PhaseLines = block("wires between electronics and machine")
    plant: PhasePlant = block("machine")


@ticks(PhaseServoParams, local="plant.train")
@hot_step
def tick(p: PhaseServoParams, r: PhaseServo, train: DriveTrain) -> bool:
    """One period of the reference clocks, on `train` of the plant; none while the host must look: ready."""
    if r.controller.sequencer.event:
        return False
    sense(p.plant, r.plant, train.position, r.lines, r.tick)
    control(p.controller, r.controller, r.lines)
    move(p.plant, r.plant, train, r.lines, r.tick)
    r.tick += 1
    return True


def switch_on(p: PhaseServoParams, r: PhaseServo, position: float, seed: int, act: Act = do) -> None:
    """Power-on with the carriage at `position` [m]; `seed` starts the noise of comparator and lines."""
    act(power_on, r.controller)
    r.plant.train.position = position
    r.plant.detector.noise.state = seed
    start_interference(p.plant.interference, r.plant.interference, seed ^ 0x5DEECE66D)


def be_ready(p: PhaseServoParams, r: PhaseServo) -> None:
    """As after an acquisition and its settling: locked, enabled, at hold; for runs that begin with a command."""
    c, count = r.controller, r.controller.converters.carrier.count
    compare(p.plant.detector, r.plant.detector, count, r.plant.train.position)
    steps = (r.plant.detector.phase >> p.plant.detector.carrier_shift) + count
    c.converters.tracking.reference = steps & p.controller.converters.tracking.mask
    r.lines.enable = 1
    c.sequencer.state, c.sequencer.ready, c.sequencer.stop = SETTLE_READY, 1, 0
    c.sequencer.stop_at = r.tick
    c.changed = 1
