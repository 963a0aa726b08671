"""A phase servo on the bench, for comparisons: one move by whole pitches, from lock, with a chosen disturbance alone.

Nothing random of the axis file's ``[disturbance]`` table is left, and the way is as long as the move needs, so that two
runs differ in what is compared and in nothing else.
"""

import math

from detent.control.phase_sequencer import POSITION_MODE
from detent.methods.phase_servo.controller import command, take_ready
from detent.methods.phase_servo.host import phase_servo_machine
from detent.methods.phase_servo.schema import DisturbanceTable, PhaseServoSpec
from detent.methods.phase_servo.system import PhaseServo, PhaseServoParams, be_ready
from detent.record.machine import Machine
from detent.record.recorder import Recorder

START = 0.25e-3  # time of the set strobe, as in the tests of specification 6 [s]
ROOM = 8  # pitches of free way on both sides of the move
LOOK = 1e-3  # how often the bench looks whether position mode has been entered [s]

UNDISTURBED = DisturbanceTable()


class PhaseBench:
    """An axis that stands at a positioning point, locked and ready, before a move by whole pitches."""

    def __init__(
        self,
        spec: PhaseServoSpec,
        pitches: int,
        disturbance: DisturbanceTable = UNDISTURBED,
        recorder: Recorder | None = None,
    ) -> None:
        begin = ROOM if pitches > 0 else ROOM - pitches
        self.spec = spec.changed(
            limits={"travel": (abs(pitches) + 2 * ROOM) * spec.pitch},
            mechanics={"start_position": begin * spec.pitch},
            disturbance=disturbance,
        )
        self.pitches, self.target = pitches, (begin + pitches) * spec.pitch
        self.machine: Machine[PhaseServoParams, PhaseServo] = phase_servo_machine(self.spec, recorder)
        be_ready(self.machine.params, self.machine.state)

    @property
    def displacement(self) -> float:
        """Position less target [steps]."""
        return (self.machine.state.plant.train.position - self.target) / self.spec.step

    def run_until(self, moment: float) -> None:
        """Let time pass up to a moment since power-on [s], whatever the axis says."""
        left = round(moment / self.machine.tick) - self.machine.state.tick
        while left > 0:
            left -= self.machine.pass_ticks(left)
            take_ready(self.machine.state.controller)

    def move(self) -> float:
        """Make the move up to the beginning of position mode; gives its time [s], NaN where it is not reached."""
        self.run_until(START)
        c = self.machine.state.controller
        command(c, abs(self.pitches) * self.spec.detector.counts, int(self.pitches < 0))
        way, a = abs(self.pitches) * self.spec.pitch, self.spec.method.table_acceleration
        limit = START + 0.5 + 3 * (way / self.spec.limits.speed + 2 * math.sqrt(way / a))
        while self.machine.time < limit:
            self.run_until(self.machine.time + LOOK)
            if c.sequencer.mode == POSITION_MODE:
                return c.sequencer.switched * self.machine.tick
        return math.nan
