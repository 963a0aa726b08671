"""The host of a phase servo: set strobe with direction and distance, ready, stop; and a bench for its comparisons."""

import math

from detent.axisfile.blocks import describe_fault
from detent.axisfile.tables import DisturbanceTable
from detent.control.guard import NO_ARRIVAL
from detent.control.phase_sequencer import POSITION_MODE
from detent.errors import AxisError
from detent.methods.moves.job import Move
from detent.methods.moves.run import Destination, Host, Wrong
from detent.methods.phase_servo.build import build_phase_servo
from detent.methods.phase_servo.controller import arrive_within, command, forget_conduct, take_ready
from detent.methods.phase_servo.schema import PhaseServoSpec
from detent.methods.phase_servo.system import PhaseServo, be_ready, switch_on
from detent.record.machine import AnyRecorder, Machine
from detent.record.recorder import Recorder
from detent.units import format_quantity

ACQUISITION = 0.5  # longest time that a phase servo may take to lock and settle after power-on [s]

GRID_TOLERANCE = 0.05
"""How far a target may be from a positioning point, in pitches: what a decimal figure of a length misses."""

START = 0.25e-3  # time of the set strobe on the bench, as in the tests of specification 6 [s]
ROOM = 8  # pitches of free way on both sides of its move
LOOK = 1e-3  # how often it looks whether position mode has been entered [s]

UNDISTURBED = DisturbanceTable()


class PhaseHost(Host):
    """Host of a phase servo: set strobe with direction and distance, ready, stop."""

    forgets = staticmethod(forget_conduct)
    own_pace = "this axis takes its speed from the velocity table"

    def __init__(self, spec: PhaseServoSpec, recorder: AnyRecorder | None = None) -> None:
        p, r, start = build_phase_servo(spec), PhaseServo(), spec.mechanics.start_position
        machine, home = Machine(p, r, spec.tick, recorder), round(start / spec.pitch) * spec.pitch
        switch_on(p, r, start, spec.detector.seed, machine.act)
        tolerance = spec.arrived_steps * spec.step
        super().__init__(spec, machine, grid=spec.pitch, tolerance=tolerance, home=home, look=spec.sample_period)
        self._counts = 0

    @property
    def count(self) -> float:
        """A step of the resolver [m]."""
        return self.spec.step

    def start(self) -> None:
        """Wait until the axis has locked, settled on the nearest positioning point and is ready."""
        self.machine.pass_time(ACQUISITION)
        if not self.act(take_ready):
            raise AxisError(
                f"the axis did not become ready within {format_quantity(ACQUISITION, 's')} of power-on: the tracker is "
                "never silent; look for noise on the detector (detector.jitter, disturbance.lines)"
            )

    def place(self, move: Move, position: float) -> Destination:
        """Where a move to `position` [m] ends."""
        pitches = round((position - self.home) / self.spec.pitch)
        return Destination(move, self.home + pitches * self.spec.pitch, pitches * self.spec.detector.counts)

    def command(self, to: Destination) -> None:
        """Set strobe."""
        distance = to.counts - self._counts
        self.act(command, abs(distance), int(distance < 0))
        self._counts = to.counts

    def time_limit(self, to: Destination) -> float:
        """Time after which a move that is not ready has failed [s]: twice what its way can take, and half a second."""
        del to  # the distance word is its way
        way = self.controller.sequencer.command * self.spec.step
        return 0.5 + 2 * (way / self.spec.limits.speed + 2 * math.sqrt(way / self.spec.method.table_acceleration))

    def wait(self, seconds: float) -> bool:
        """Wait until ready; False when it is not within `seconds`."""
        period = self.spec.sample_period
        windows = math.ceil(seconds / period)
        self.act(arrive_within, windows)
        self.machine.pass_time((windows + 1) * period)
        ready = bool(self.act(take_ready))
        self.act(arrive_within, 0)
        return ready

    def problems(self, to: Destination, asked: float) -> Wrong:
        """Targets off the positioning points, and words that this axis does not take."""
        if abs(asked - to.position) > GRID_TOLERANCE * self.grid:
            low = to.position - self.grid if to.position > asked else to.position
            near = f"{format_quantity(low, 'm', 7)} or {format_quantity(low + self.grid, 'm', 7)}"
            grid = f"a multiple of the detector's pitch, {format_quantity(self.grid, 'm', 6)}"
            yield to.move.place_key, format_quantity(asked, "m", 7), grid, f"move to a positioning point: {near}"
        yield from super().problems(to, asked)

    @property
    def failure(self) -> str:
        """Why the bridge is off; empty while it drives."""
        if self.controller.guard.code in {0, NO_ARRIVAL}:
            return ""
        speed = format_quantity(self.spec.limits.speed, "m/s")
        return describe_fault(self.controller.guard, self.spec.protection, speed)

    def in_counts(self, error: float) -> str:
        """How far off that is, in steps, and whether it is on another positioning point."""
        pitches, wrong = error / self.grid, abs(round(error / self.grid))
        text = f"{abs(error) / self.spec.step:.1f} steps"
        on_another = abs(pitches) > 0.5 and abs(pitches - round(pitches)) < 0.1
        name = "pitch" if wrong == 1 else "pitches"
        return f"{text}, on the positioning point {wrong} {name} off" if on_another else text

    @property
    def is_noisy(self) -> bool:
        """Whether noise may have moved a stop."""
        return self.spec.detector.jitter > 0 or super().is_noisy

    @property
    def switched(self) -> float:
        """When position mode was entered [s]."""
        return self.controller.sequencer.switched * self.machine.tick


class PhaseBench:
    """An axis that stands at a positioning point, locked and ready, before a move by whole pitches.

    Of ``[disturbance]`` only what is chosen is left, and the way is as long as the move needs, so that two runs differ
    in what is compared and in nothing else.
    """

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
        self.machine = PhaseHost(self.spec, recorder).machine
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
