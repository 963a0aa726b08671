"""What each control method brings to the simulation: what runs, what is recorded, how it is clocked."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from detent.kernel.registers import Registers
from detent.methods.cascade.build import build_cascade
from detent.methods.cascade.host import cascade_registers
from detent.methods.cascade.replay import ReplayJob, ReplayRun, run_cascade_replay
from detent.methods.cascade.run import CASCADE_SIGNALS, CascadeRun, run_cascade_moves
from detent.methods.cascade.schema import CascadeSpec
from detent.methods.filtered_servo import system as filtered_servo
from detent.methods.filtered_servo.schema import FilteredServoSpec
from detent.methods.moves.job import Move, MoveJob
from detent.methods.moves.move_file import load_moves
from detent.methods.moves.run import FILTERED_SIGNALS, PHASE_SIGNALS, MoveRun, run_moves
from detent.methods.phase_servo import system as phase_servo
from detent.methods.phase_servo.schema import PhaseServoSpec
from detent.methods.print_head import system as print_head
from detent.methods.print_head.print_job import PrintJob, load_job, parse_text
from detent.methods.print_head.run import PrintRun, Progress, default_signals, print_job
from detent.methods.print_head.schema import PrintHeadSpec
from detent.methods.registry import AnySpec
from detent.methods.rotary_table import system as rotary_table
from detent.methods.rotary_table.run import SEQUENCE_SIGNALS, SequenceRun, run_sequence
from detent.methods.rotary_table.schema import RotaryTableSpec
from detent.methods.rotary_table.sequence_file import load_sequence
from detent.methods.rotary_table.sequence_job import Jog, SequenceJob
from detent.methods.stepper_envelope.build import instant
from detent.methods.stepper_envelope.machine import stage_registers
from detent.methods.stepper_envelope.run import StageRun, run_stage, stage_signals
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec
from detent.methods.stepper_envelope.stage_file import load_stage_job
from detent.methods.stepper_envelope.stage_job import StageJob, StageMove
from detent.record.capture import Clocking, filtered_servo_clocking, phase_servo_clocking
from detent.record.machine import AnyRecorder

AnyJob = PrintJob | MoveJob | SequenceJob | StageJob | ReplayJob
AnyResult = PrintRun | MoveRun | SequenceRun | StageRun | CascadeRun | ReplayRun

PRINT_HEAD_TIMING = (
    "encoder.channel_a", "encoder.channel_b", "quadrature.count", "head.state", "head.drive_cmd", "timer.pulse",
    "lines.right_left", "lines.transition", "train.current",
)  # fmt: skip
PHASE_SERVO_TIMING = (
    "converters.carrier.count", "detector.ps", "converters.tracking.reference", "converters.tracking.ps_first",
    "converters.tracking.ps_second", "converters.tracking.msb_first", "converters.tracking.msb_second",
    "converters.tracking.gate", "converters.tracking.plus", "converters.tracking.minus", "converters.absolute.gated",
    "converters.absolute.word", "speed.count", "sequencer.distance", "sequencer.mode", "law.word", "pwm.request",
    "train.current",
)  # fmt: skip
FILTERED_SERVO_TIMING = (
    "encoder.channel_a", "encoder.channel_b", "decoder.a1", "decoder.a2", "decoder.b1", "decoder.b2",
    "decoder.forward", "decoder.reverse", "generator.command", "deviation.deviation", "speed.count", "speed.word",
    "clock.left", "filter.output", "deviation.word",
)  # fmt: skip
ROTARY_TABLE_TIMING = (
    "detector.fine.word", "detector.coarse.word", "detector.absolute.theta", "positioner.angle.dar",
    "positioner.angle.flg", "positioner.angle.turn", "positioner.angle.aar", "positioner.oar",
    "positioner.interpolator.irr", "positioner.dr", "positioner.s4", "amplifier.word", "machine.motor.velocity",
)  # fmt: skip
STEPPER_TIMING = (
    "timer.pulses", "timer.phase", "timer.period", "rule.index", "rule.relation", "rule.state", "rotor.lag",
)  # fmt: skip
CASCADE_TIMING = (
    "wake", "reference.position", "motor_sensor.count", "motor_sensor.velocity", "law.position_error", "law.command",
    "law.limited", "source.output", "machine.motor.position", "machine.motor.sense", "machine.load.position",
    "machine.side",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Simulated:
    """A method as the simulation knows it.

    Attributes
    ----------
    registers : type of Registers
        Class of the state.
    tick : float
        Base tick [s].
    every : int
        Ticks between two rows of a trace unless told otherwise.
    seed : int
        What its noise starts from.
    signals, timing : tuple of str
        Registers that a run records, and that a timing diagram shows, unless told otherwise.
    clocking : Clocking
        How registers change inside a tick.
    load : callable
        Reads a job file of the kind the method takes.
    job : type, or tuple of types
        Class of the jobs that the method takes; the first is that of the files that `load` reads.
    run : callable
        ``run(job, recorder=, progress=)`` makes a job.
    sample_job : callable
        A short job for looking at signals.
    """

    registers: type[Registers]
    tick: float
    every: int
    seed: int
    signals: tuple[str, ...]
    timing: tuple[str, ...]
    clocking: Clocking
    load: Callable[[Path], AnyJob]
    job: type[AnyJob] | tuple[type[AnyJob], ...]
    run: Callable[..., AnyResult]
    sample_job: Callable[[], AnyJob]


def simulated(spec: AnySpec) -> Simulated:
    """The simulation's side of a specification."""
    if isinstance(spec, PrintHeadSpec):
        return _print_head(spec)
    if isinstance(spec, PhaseServoSpec):
        return _phase_servo(spec)
    if isinstance(spec, FilteredServoSpec):
        return _filtered_servo(spec)
    if isinstance(spec, CascadeSpec):
        return _cascade(spec)
    return _rotary_table(spec) if isinstance(spec, RotaryTableSpec) else _stepper_envelope(spec)


def _print_head(spec: PrintHeadSpec) -> Simulated:
    def run(job: Any, recorder: AnyRecorder | None = None, progress: Progress | None = None) -> PrintRun:
        return print_job(spec, job, recorder=recorder, progress=progress)

    return Simulated(
        registers=print_head.PrintHead,
        tick=print_head.TICK,
        every=10,
        seed=spec.encoder.seed,
        signals=tuple(default_signals()),
        timing=PRINT_HEAD_TIMING,
        clocking=Clocking(),
        load=load_job,
        job=PrintJob,
        run=run,
        sample_job=lambda: parse_text("detent", "one word"),
    )


def _moves(spec: PhaseServoSpec | FilteredServoSpec) -> Callable[..., MoveRun]:
    def run(job: Any, recorder: AnyRecorder | None = None, progress: Progress | None = None) -> MoveRun:
        return run_moves(spec, job, recorder=recorder, progress=progress)

    return run


def _one_move(name: str, by: float, dwell: float) -> Callable[[], MoveJob]:
    return lambda: MoveJob(name, "moves", (Move(number=1, row=0, by=by, dwell=dwell),))


def _phase_servo(spec: PhaseServoSpec) -> Simulated:
    p = spec.printing

    def load(path: Path) -> MoveJob:
        margin = round(p.left_margin / spec.pitch) * spec.pitch
        return load_moves(path, pitch=p.character_pitch, left_margin=margin, hammer_time=p.hammer_time)

    return Simulated(
        registers=phase_servo.PhaseServo,
        tick=spec.tick,
        every=256,
        seed=spec.detector.seed,
        signals=PHASE_SIGNALS,
        timing=PHASE_SERVO_TIMING,
        clocking=phase_servo_clocking(spec),
        load=load,
        job=MoveJob,
        run=_moves(spec),
        sample_job=_one_move("one move of 6 pitches", 6 * spec.pitch, 0.05),
    )


def _filtered_servo(spec: FilteredServoSpec) -> Simulated:
    return Simulated(
        registers=filtered_servo.FilteredServo,
        tick=filtered_servo.TICK,
        every=10,
        seed=spec.encoder.seed,
        signals=FILTERED_SIGNALS,
        timing=FILTERED_SERVO_TIMING,
        clocking=filtered_servo_clocking(),
        load=load_moves,
        job=MoveJob,
        run=_moves(spec),
        sample_job=_one_move("one move of 1000 pulses", 1000 * spec.pulse, 0.2),
    )


def _rotary_table(spec: RotaryTableSpec) -> Simulated:
    def run(job: Any, recorder: AnyRecorder | None = None, progress: Progress | None = None) -> SequenceRun:
        return run_sequence(spec, job, recorder=recorder, progress=progress)

    def sample_job() -> SequenceJob:
        return SequenceJob("a short jog", (Jog(direction=1, duration=max(0.2, spec.method.task_period)),), {})

    return Simulated(
        registers=rotary_table.RotaryTable,
        tick=rotary_table.TICK,
        every=20,
        seed=spec.detector.seed,
        signals=SEQUENCE_SIGNALS,
        timing=ROTARY_TABLE_TIMING,
        clocking=Clocking(),
        load=load_sequence,
        job=SequenceJob,
        run=run,
        sample_job=sample_job,
    )


def _stepper_envelope(spec: StepperEnvelopeSpec) -> Simulated:
    names = tuple(spec.stepper)

    def run(job: Any, recorder: AnyRecorder | None = None, progress: Progress | None = None) -> StageRun:
        return run_stage(spec, job, recorder=recorder, progress=progress)

    def load(path: Path) -> StageJob:
        return load_stage_job(path, names)

    def sample_job() -> StageJob:
        ways: dict[str, float] = {}
        for name, table in spec.stepper.items():
            start = table.step_inside(table.mechanics.start_position)
            ways[name] = table.position_of(min(start + 200, table.steps))
        return StageJob("one move of 200 steps", "moves", (StageMove(1, 0, targets=ways),), names, ())

    return Simulated(
        registers=stage_registers(spec),
        tick=instant(spec),
        every=100,
        seed=0,
        signals=stage_signals(spec),
        timing=tuple(f"{name}.{signal}" for name in names for signal in STEPPER_TIMING),
        clocking=Clocking(),
        load=load,
        job=StageJob,
        run=run,
        sample_job=sample_job,
    )


def _cascade(spec: CascadeSpec) -> Simulated:
    p = build_cascade(spec)

    def run(job: Any, recorder: AnyRecorder | None = None, progress: Progress | None = None) -> CascadeRun | ReplayRun:
        if isinstance(job, ReplayJob):
            return run_cascade_replay(spec, job, recorder=recorder, progress=progress)
        return run_cascade_moves(spec, job, recorder=recorder, progress=progress)

    def load(path: Path) -> MoveJob:
        return load_moves(path, rotary=spec.axis.motion == "rotary")

    # To where there is more room.
    way = 0.02 * spec.limits.travel
    middle = spec.limits.lowest + 0.5 * spec.limits.travel
    return Simulated(
        registers=cascade_registers(spec),
        tick=p.machine.period,
        every=p.sample_ticks,
        seed=0,
        signals=CASCADE_SIGNALS,
        timing=CASCADE_TIMING,
        clocking=Clocking(),
        load=load,
        job=(MoveJob, ReplayJob),
        run=run,
        sample_job=_one_move("one move", way if spec.mechanics.start_position < middle else -way, 0.05),
    )
