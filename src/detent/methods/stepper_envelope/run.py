"""A job on a simulated stepper stage, from power-on: what its host commands, and what an observer of rotors sees."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, ClassVar

from detent.errors import AxisError
from detent.methods.changes import lay_changes
from detent.methods.stepper_envelope.build import start_hz, stepper_motor
from detent.methods.stepper_envelope.host import Leg, StageHost, StageMotor, check_stage_job
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec
from detent.methods.stepper_envelope.stage_job import StageJob, StageJog, StageMove
from detent.record.machine import AnyRecorder, Progress
from detent.record.run import EDGE, RunRecord

MOTOR_SIGNALS = (
    "controller.rule.position", "controller.rule.index", "controller.rule.state", "controller.rule.direction",
    "controller.timer.period", "plant.rotor.angle", "plant.rotor.velocity", "plant.rotor.lag",
)  # fmt: skip
"""Registers of each motor that a run records unless told otherwise."""


def stage_signals(spec: StepperEnvelopeSpec) -> tuple[str, ...]:
    """Registers that a run records unless told otherwise."""
    return tuple(f"{name}.{signal}" for name in spec.stepper for signal in MOTOR_SIGNALS)


PULL_OUT_LAG = 2.0
"""Lag from which on the field pulls the rotor the wrong way: half a period of the torque curve, which has four steps
(stepper-envelope specification 7.2) [step]."""


@dataclass(frozen=True, slots=True)
class MotorMove:
    """How one motor made a move; places in metres, of a motor that turns in radians; times in seconds since power-on.

    Attributes
    ----------
    start, target, stop : float
        Where it stood, where it had to go, and its position of record at the end.
    arrived, settled : float
        When its last step was over, and when the rotor was outside the tolerance for the last time.
    steps, missed, lost : int
        Steps made, both ways; from the stop to the target; and those that the rotor fell behind, or jumped ahead.
    rest_lag, peak_lag : float
        Distance of the rotor from its field when the host took the move for done, and the largest one [steps].
    peak_hz : float
        Largest step frequency [Hz].
    margin : float
        Smallest pull-out torque over torque needed; below 1 the rotor falls behind.
    overrun : bool
        A stop that was changed on the way lay too near and was passed.
    naive : float
        Time that as many steps take at the start frequency [s].
    """

    start: float
    target: float
    stop: float
    arrived: float
    settled: float
    steps: int
    missed: int
    lost: int
    rest_lag: float
    peak_lag: float
    peak_hz: float
    margin: float
    overrun: bool
    naive: float


@dataclass(frozen=True, slots=True)
class StageMoveRecord:
    """How one move went.

    Attributes
    ----------
    number : int
        From 1.
    label : str
        The tile, or what the job calls it.
    begin, ready, end : float
        The start signals; when the host took it for done, the last step and the time to settle over; and the end of
        the dwell, since power-on [s].
    motors : dict of MotorMove by motor
        Those that moved.
    """

    number: int
    label: str
    begin: float
    ready: float
    end: float
    motors: dict[str, MotorMove]

    @property
    def seconds(self) -> float:
        """From the start signals until all rotors were at rest [s]."""
        rests = [max(motor.arrived, motor.settled) for motor in self.motors.values()]
        return max(rests, default=self.begin) - self.begin


@dataclass(repr=False)
class StageRun(RunRecord[StageJob]):
    """Outcome of a job on a stage.

    Attributes
    ----------
    done : bool
        Every move ended on its place and no rotor lost a step.
    failure : str
        Why not, and what to do; empty if `done`.
    time_ready, time_end : float
        Begin and end of the job, since power-on [s].
    moves : list of StageMoveRecord
        Moves made, in order.
    lost : dict of int by motor
        Steps lost in all.
    """

    moves: list[StageMoveRecord] = field(default_factory=list[StageMoveRecord])
    lost: dict[str, int] = field(default_factory=dict[str, int])

    told: ClassVar[tuple[str, ...]] = ("lost", "worst_lag", "least_margin", "moves_per_second")
    measured: ClassVar[Mapping[str, str]] = {"worst_lag": "", "least_margin": "", "time_end": "s"}

    @property
    def made(self) -> list[tuple[StageMoveRecord, str, MotorMove]]:
        """Every motion of every motor, with its move."""
        return [(move, name, motor) for move in self.moves for name, motor in move.motors.items()]

    @property
    def worst_lag(self) -> float:
        """Largest distance of a rotor from its field [steps]."""
        return max((motor.peak_lag for _, _, motor in self.made), default=0.0)

    @property
    def least_margin(self) -> float:
        """Smallest torque margin of all motions; infinite if nothing moved."""
        return min((motor.margin for _, _, motor in self.made), default=float("inf"))

    @property
    def moves_per_second(self) -> float:
        """Moves, settling and dwells included, per second."""
        span = self.time_end - self.time_ready
        return len(self.moves) / span if span > 0 else 0.0

    def to_dict(self) -> dict[str, Any]:
        """Plain data for ``--json``."""
        moves = [asdict(move) for move in self.moves]
        return super().to_dict() | {"notes": list(self.job.notes), "moves": moves}


def run_stage(
    spec: StepperEnvelopeSpec, job: StageJob, *, recorder: AnyRecorder | None = None, progress: Progress | None = None
) -> StageRun:
    """Do a job on the stage of `spec`, from power-on."""
    check_stage_job(spec, job)
    host, result = StageHost(spec, recorder), StageRun(job, lost=dict.fromkeys(spec.stepper, 0))
    lay_changes({name: motor.machine for name, motor in host.stage.motors.items()}, job)
    try:
        for done, move in enumerate(job.moves):
            result.moves.append(_make_move(host, move, result))
            if progress is not None:
                progress((done + 1) / len(job.moves), f"move {done + 1} of {len(job.moves)}")
    except AxisError as error:
        result.failure = f"move {len(result.moves) + 1}: {error}"
    finally:
        host.stage.flush()
    result.time_end = host.stage.time
    result.failure = result.failure or _verdict(spec, result)
    result.done = not result.failure
    result.warnings += _doubts(spec, result)
    return result


def _make_move(host: StageHost, move: StageMove | StageJog, result: StageRun) -> StageMoveRecord:
    """One move, the time to settle and the dwell."""
    stage = host.stage
    begin = stage.time
    before = {name: _counted(motor) for name, motor in stage.motors.items()}
    for name in move.motors:
        plant = stage.motors[name].r.plant
        plant.rotor.peak_lag = abs(plant.rotor.lag)
        plant.gauge.peak_hz, plant.gauge.outside = 0.0, stage.instant
    legs, over = (host.jog(move), False) if isinstance(move, StageJog) else host.run(move)
    if isinstance(move, StageJog) and not legs:
        made = f"motor {move.motor} made no step: it stands at the end of its travel"
        result.warnings.append(f"move {move.number}: {made}")
    stage.pass_time(stage.spec.controller.settle_time)
    ready = stage.time
    motors = {name: _observe(host, name, leg, before[name], over=over) for name, leg in legs.items()}
    for name, motor in motors.items():
        result.lost[name] += motor.lost
    stage.pass_time(move.dwell)
    return StageMoveRecord(move.number, move.label, begin, ready, stage.time, motors)


def _counted(motor: StageMotor) -> tuple[int, int]:
    """Pulses made and steps lost so far."""
    return int(motor.controller.timer.pulses), motor.lost


def _observe(host: StageHost, name: str, leg: Leg, before: tuple[int, int], *, over: bool) -> MotorMove:
    """What a look at the rotor tells after a motion."""
    motor = host.stage.motors[name]
    plant, table = motor.r.plant, motor.table
    # The part of the ramp that the motion went up and down.
    used = motor.tables.ramp.hz[: motor.tables.ramp.index_of(float(plant.gauge.peak_hz)) + 1]
    pulses, lost = (now - then for now, then in zip(_counted(motor), before, strict=True))
    return MotorMove(
        start=table.position_of(leg.start),
        target=host.goal[name],
        stop=motor.place,
        arrived=motor.rested,
        settled=plant.gauge.outside * host.stage.tick,
        steps=pulses,
        missed=table.step_inside(host.goal[name]) - motor.position,
        lost=lost,
        rest_lag=float(plant.rotor.lag) / table.drive.microsteps,
        peak_lag=float(plant.rotor.peak_lag) / table.drive.microsteps,
        peak_hz=float(plant.gauge.peak_hz),
        margin=float(stepper_motor(table).torque_margin(used).min()),
        overrun=over,
        naive=pulses / start_hz(table),
    )


def _doubts(spec: StepperEnvelopeSpec, result: StageRun) -> Iterator[str]:
    """What looks wrong about a run whose rotors kept their steps: how near they came to losing them."""
    for move, name, motor in result.made:
        if motor.overrun:
            target = spec.stepper[name].text(motor.target, "m")
            yield (
                f"move {move.number}: the stop of {name} was changed to {target} when the motor was too fast to stop "
                "there; it stopped as soon as it could and came back; change it earlier"
            )
    made = result.made
    lagging = max(made, key=lambda one: one[2].peak_lag, default=None)
    if lagging and lagging[2].peak_lag >= PULL_OUT_LAG:
        move, name, motor = lagging
        yield (
            f"in move {move.number} the rotor of {name} was {motor.peak_lag:.3g} steps from its field; from "
            f"{PULL_OUT_LAG:g} the field pulls it the wrong way, and only luck kept its steps; lower "
            "limits.acceleration or limits.speed of the motor"
        )
    weak = min(made, key=lambda one: one[2].margin, default=None)
    if weak and weak[2].margin < 1.0:
        move, name, motor = weak
        yield (
            f"in move {move.number} the motor {name} had {100 * motor.margin:.3g} % of the torque that its ramp needs; "
            "it falls behind its field; lower limits.acceleration or limits.speed of the motor, or raise drive.supply"
        )
    off = max(made, key=lambda one: abs(one[2].rest_lag), default=None)
    if off and abs(off[2].rest_lag) > EDGE * spec.controller.tolerance:
        move, name, motor = off
        yield (
            f"in move {move.number} the rotor of {name} stood {abs(motor.rest_lag):.2g} steps from its place when the "
            f"time to settle was over, at the edge of controller.tolerance, {spec.controller.tolerance:g}; the next "
            "machine of this kind ends outside; raise controller.settle_time, or lower friction_torque"
        )


def _verdict(spec: StepperEnvelopeSpec, result: StageRun) -> str:
    """Why the job is not done; empty if it is."""
    for move, name, motor in result.made:
        where = f"move {move.number}: motor {name}"
        if motor.lost:
            return (
                f"{where} lost {abs(motor.lost)} steps, and every place after that is off by them; lower "
                "limits.acceleration or limits.speed of the motor, or raise drive.supply"
            )
        if motor.missed:
            return f"{where} stopped {abs(motor.missed)} steps from its place; look at its table in the report"
        if abs(motor.rest_lag) > spec.controller.tolerance:
            return (
                f"{where} was still {abs(motor.rest_lag):.2g} steps from its place when the time to settle was over; "
                "raise controller.settle_time, or lower friction_torque"
            )
    return ""
