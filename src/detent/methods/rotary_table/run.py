"""A sequence on a simulated rotary table, from power-on: what an observer beside the table sees."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, ClassVar

from detent.errors import AxisError
from detent.kernel.turn_table import TURN
from detent.methods.changes import lay_changes
from detent.methods.rotary_table.host import TableHost, check_sequence, dial_speed
from detent.methods.rotary_table.schema import RotaryTableSpec
from detent.methods.rotary_table.sequence_controller import Change, SequenceController, suspect
from detent.methods.rotary_table.sequence_job import Action, Go, Jog, Output, SequenceJob
from detent.methods.rotary_table.system import RotaryTable, RotaryTableParams
from detent.plant.gearing import output_phase
from detent.record.machine import LONGEST_STRETCH, AnyRecorder, Machine, Progress
from detent.record.run import RunRecord
from detent.sensing.gauge import set_angle_gauge
from detent.units import format_quantity

SEQUENCE_SIGNALS = (
    "plant.train.motor.velocity", "plant.table", "controller.absolute.theta", "controller.positioner.state",
    "controller.positioner.z", "controller.positioner.angle.aar", "controller.positioner.angle.dar",
    "controller.positioner.angle.flg", "controller.positioner.angle.turn", "controller.positioner.angle.position",
    "controller.positioner.oar", "controller.positioner.arr", "controller.positioner.interpolator.irr",
    "controller.positioner.interpolator.speed", "controller.positioner.dr", "controller.positioner.s4",
    "plant.amplifier.torque",
)  # fmt: skip
"""Registers that a run records unless told otherwise."""


@dataclass(frozen=True, slots=True)
class StepRecord:
    """How one step went; times in seconds since power-on, angles of the table in radians.

    The angles are those of the table itself, endless: they go on beyond a turn.
    """

    number: int  #: counted from 1, repeats counted
    index: int  #: of the step in the job, from 0
    kind: str  #: "go", "jog", "wait" or "output"
    text: str  #: what was asked, for people
    begin: float  #: when it began
    end: float  #: when it ended
    start: float  #: angle of the table at the beginning
    stop: float  #: and at the end
    #: where it was sent, or is held after a jog; NaN for waits and outputs, and for a jog that did not end
    target: float
    error: float  #: target less angle at the end; NaN without a target
    travel: float  #: way from start to stop, positive to larger angles
    peak_speed: float  #: largest speed, at the interrupts [rad/s]
    peak_deviation: float  #: largest magnitude of the deviation dR, at the interrupts
    crossings: int  #: ends of the turn that were crossed
    rollovers: int  #: of the positioner


@dataclass(repr=False)
class SequenceRun(RunRecord[SequenceJob]):
    """Outcome of a sequence. Times since power-on [s], angles of the table [rad].

    Also `done`: every step came to its end; `failure`: why not, and what to do, empty if `done`; `warnings`: what a
    user of the axis should know though the sequence was done; `time_ready` and `time_end`: the axis holds its table,
    and the sequence begins; the end of the last step.
    """

    steps: list[StepRecord] = field(default_factory=list[StepRecord])  #: steps made, in order
    #: output signals as they were switched: (time, name, on); all are off before
    outputs: list[Change] = field(default_factory=list[Change])
    inputs: list[Change] = field(default_factory=list[Change])  #: input signals as they came
    count: float = 0.0  #: angle of the table per count of the axis
    in_position: float = 0.0  #: deviation that counts as in position
    travel: float = 0.0  #: way of all steps, in either direction
    turns: int = 0  #: whole turns from where the table stood first to where it stands at the end, signed
    crossings: int = 0  #: of all steps
    rollovers: int = 0  #: of all steps
    position: int = 0  #: position of record at the end [count]
    refused: int = 0  #: starts of a positioning that the axis has refused

    told: ClassVar[tuple[str, ...]] = (
        "count", "in_position", "travel", "turns", "crossings", "rollovers", "position", "refused", "peak_deviation",
        "worst_error",
    )  # fmt: skip
    measured: ClassVar[Mapping[str, str]] = {"worst_error": "rad", "peak_deviation": "", "time_end": "s"}

    @property
    def peak_deviation(self) -> float:
        """Largest magnitude of the deviation dR in all steps."""
        return max((step.peak_deviation for step in self.steps), default=0.0)

    @property
    def worst_error(self) -> float:
        """Largest magnitude of the error at the end of a positioning."""
        return max((abs(step.error) for step in self.steps if step.kind == "go"), default=0.0)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for ``--json``."""
        told = {
            name: [{"time": time, "name": signal, "on": on} for time, signal, on in changes]
            for name, changes in (("outputs", self.outputs), ("inputs", self.inputs))
        }
        return super().to_dict() | {"steps": [asdict(step) for step in self.steps]} | told


def run_sequence(
    spec: RotaryTableSpec, job: SequenceJob, *, recorder: AnyRecorder | None = None, progress: Progress | None = None
) -> SequenceRun:
    """Run a sequence on the rotary table of `spec`, from power-on.

    The sequence, and the time of its inputs, begins when the axis holds its table. Each step ends before the next
    begins: a positioning when the table is in position, a jog when it has come to rest and the loop has settled.
    """
    check_sequence(spec, job)
    result = SequenceRun(job, count=spec.count, in_position=spec.method.in_position * spec.count)
    host = TableHost(spec, recorder)
    lay_changes({"": host.machine}, job)
    try:
        host.start()
        result.time_ready = host.machine.time
        watched = _WatchedTable(host, result, progress)
        for number, (index, step) in enumerate(job.actions(), start=1):
            result.failure = watched.do(number, index, step)
            if result.failure:
                break
        watched.finish()
    finally:
        host.machine.close()
    return result


class TableObserver:
    """Looks at a table whose axis has taken its first angle."""

    def __init__(self, spec: RotaryTableSpec, machine: Machine[RotaryTableParams, RotaryTable]) -> None:
        self._spec, self._gear = spec, machine.params.plant.train.gear
        self._state: Any = machine.state  # ctypes gives every register its type at run time only
        # The axis knows the angle within a turn only: it starts in [0, T) whatever turn the table is in.
        away = self._state.controller.positioner.angle.position - self._motor_counts
        self._start_turns = round(away / spec.period)

    @property
    def angle(self) -> float:
        """True angle of the table [rad], endless; 0 where the motor's angle is 0.

        Whole numbers of any length: it is as fine after a million turns as in the first.
        """
        train = self._state.plant.train
        within = output_phase(self._gear, train.gear.slack, train.motor.turns, train.motor.angle)
        turns, phase = divmod((train.motor.turns // self._gear.ratio << 32) + within, TURN)
        return turns * math.tau + phase / TURN * math.tau

    @property
    def target(self) -> float:
        """Where the positioner holds the table [rad], in the same turns."""
        return self._target_counts * self._spec.count

    @property
    def miss(self) -> float:
        """Target less true angle of the motor [turn of the motor]: what the detector has wrong, and what is left."""
        return (self._target_counts - self._motor_counts) / self._spec.detector.fine.counts

    @property
    def _target_counts(self) -> int:
        positioner = self._state.controller.positioner
        angle = positioner.angle
        return angle.position + positioner.oar - angle.aar - self._start_turns * self._spec.period

    @property
    def _motor_counts(self) -> float:
        motor, fine = self._state.plant.train.motor, self._spec.detector.fine.counts
        return motor.turns * fine + motor.angle / math.tau * fine

    @property
    def speed(self) -> float:
        """Velocity of the motor, at the table [rad/s]."""
        return self._state.plant.train.motor.velocity / self._spec.ratio


class _WatchedTable(TableObserver):
    """Controller and table with an observer beside it, who writes the records."""

    def __init__(self, host: TableHost, result: SequenceRun, progress: Progress | None) -> None:
        super().__init__(host.spec, host.machine)
        self._host, self._result, self._progress = host, result, progress
        self._count, self._evidence = result.job.count, host.evidence
        self._number = self._told = 0
        self._start = self._first = self.angle
        self._controller = SequenceController(host, result.job.inputs, self._watch)

    def do(self, number: int, index: int, step: Action) -> str:
        """Do a step and record it; what went wrong, or nothing."""
        self._number = number
        self._tell()
        set_angle_gauge(self._state.plant.gauge)
        self._start = self.angle
        positioner, begin = self._host.positioner, self._host.machine.time
        crossings, rollovers = positioner.angle.crossings, positioner.rollovers
        try:
            self._controller.do(step)
            failure = self._verdict(step)
        except AxisError as error:
            failure = str(error)
        spec, gauge, stop = self._spec, self._state.plant.gauge, self.angle
        # During a jog the target is two turns ahead: it is nowhere to be held.
        is_held = isinstance(step, Go) or (isinstance(step, Jog) and not self._host.is_moving)
        target = self.target if is_held else math.nan
        record = StepRecord(
            number=number,
            index=index,
            kind=type(step).__name__.lower(),
            text=describe_step(spec, step),
            begin=begin,
            end=self._host.machine.time,
            start=self._start,
            stop=stop,
            target=target,
            error=target - stop,
            travel=stop - self._start,
            peak_speed=gauge.peak_speed / spec.ratio,
            peak_deviation=gauge.peak_deviation * spec.count / (1 << spec.method.fraction_bits),
            crossings=positioner.angle.crossings - crossings,
            rollovers=positioner.rollovers - rollovers,
        )
        self._result.steps.append(record)
        self._evidence.take(f"in step {number}", rest=record.kind == "wait")
        if record.kind == "go" and not failure:
            self._evidence.take_error(f"step {number}", record.error)
        if not failure:
            return ""
        line = f" (line {step.row})" if step.row else ""
        return f"step {number} of {self._count}{line}, {record.text}: {failure}"

    def _tell(self) -> None:
        """Tell what is being done."""
        self._told = self._host.tick
        if self._progress is not None:
            text = f"step {self._number} of {self._count}, {self._host.machine.time:.0f} s"
            self._progress((self._number - 1) / self._count, text)

    def _watch(self, asked: float) -> None:
        """A table that goes a turn farther than it was asked has run away."""
        if self._host.tick - self._told > LONGEST_STRETCH:
            self._tell()
        travel = self.angle - self._start
        if abs(travel) > asked + self._controller.latency + math.tau:
            raise AxisError(
                f"the table has run away: it has turned {_degrees(travel)} where {_degrees(asked)} were asked, "
                f"and turns on at {format_quantity(self.speed, 'rad/s')}; {suspect(self._host)}"
            )

    def _verdict(self, step: Action) -> str:
        """Why a step that has ended did not do what it was asked; empty if it did."""
        if isinstance(step, Jog):
            asked, travel = step.direction * self._controller.asked, self.angle - self._start
            if abs(asked - travel) > math.tau / 2 + self._controller.latency:
                turned = f"{_degrees(travel)} where {_degrees(asked)} were asked"
                return f"the table has turned {turned}; {suspect(self._host)}"
        elif isinstance(step, Go) and abs(self.miss) > 0.5:
            spec, turns = self._host.spec, self.miss
            remedy = (
                "keep the errors of the coarse side together (alignment, backlash, eccentricity) below half a turn of "
                f"the motor, {format_quantity(math.pi / spec.ratio, 'rad', 3)} of the table"
            )
            if spec.detector.composition != "rounded":
                remedy = 'set detector.composition = "rounded"'
            return (
                f"the axis signals in position, but is {_degrees(abs(turns) * math.tau / spec.ratio)} "
                f"{'below' if turns > 0 else 'above'} it, {abs(turns):.1f} turns of the motor: the detected angle is "
                f"wrong; {remedy}"
            )
        return ""

    def _beside(self) -> Iterator[str]:
        """In position for the axis, and beside its target for who looks at the table."""
        steps = [step for step in self._result.steps if step.kind == "go" and is_off(self._result, step.error)]
        if steps:
            worst = max(steps, key=lambda step: abs(step.error))
            off, counts = format_quantity(abs(worst.error), "rad", 3), abs(worst.error) / self._result.count
            yield (
                f"in step {worst.number} the table was {off} ({counts:.2g} counts) off target while the axis signalled "
                "in position; backlash and eccentricity of the gear are outside the loop; lower mechanics.backlash, or "
                "widen method.in_position"
            )

    def finish(self) -> None:
        """Totals."""
        result, controller = self._result, self._controller
        result.time_end = self._host.machine.time
        result.inputs, result.outputs = controller.inputs, controller.outputs
        result.warnings = [*self._beside(), *controller.warnings, *self._evidence.warnings()]
        result.limited_share = self._evidence.limited_share
        result.travel = sum(abs(step.travel) for step in result.steps)
        net = self.angle - self._first
        # A turn is whole that ends where it began, within the window.
        result.turns = int(math.copysign(abs(net) + result.in_position + result.count, net) / math.tau)
        result.crossings = sum(step.crossings for step in result.steps)
        result.rollovers = sum(step.rollovers for step in result.steps)
        result.position = self._state.controller.positioner.angle.position
        result.refused = self._host.positioner.refused
        result.done = not result.failure
        if result.done and controller.coming:
            names = ", ".join(f'"{name}"' for name in controller.coming)
            result.warnings.append(f"the sequence ended before all of these inputs had arrived: {names}")


def is_off(run: SequenceRun, error: float) -> bool:
    """The table stands farther off than window and resolution of the detector allow."""
    return abs(error) > run.in_position + run.count


def describe_step(spec: RotaryTableSpec, step: Action) -> str:
    """What a step asks for, for people."""
    if isinstance(step, Go):
        entry = spec.position[str(step.number)]
        # Only the turn counter knows other ways.
        direction = entry.direction if spec.method.form == "turn counter" else "as commanded"
        return f"go to position {step.number} ({_degrees(entry.angle)}, {direction})"
    if isinstance(step, Jog):
        speed = format_quantity(dial_speed(spec, step.speed), "rad/s")
        held = f'while "{step.signal}"' if step.signal else f"for {format_quantity(step.duration or 0.0, 's')}"
        return f"jog {'+' if step.direction > 0 else '-'} at {speed} {held}"
    if isinstance(step, Output):
        return f'{"set" if step.on else "clear"} "{step.signal}"'
    if step.signal:
        return f'wait {"for" if step.level else "for the end of"} "{step.signal}"'
    return f"wait {format_quantity(step.duration or 0.0, 's')}"


def _degrees(angle: float) -> str:
    return format_quantity(angle, "rad", 6)
