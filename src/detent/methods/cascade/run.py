"""A list of moves on a simulated cascade axis, from power-on: what its drive sees, and an observer beside the load."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any, ClassVar

from detent.axisfile.blocks import describe_fault
from detent.control.guard import NO_ARRIVAL
from detent.errors import MOST_PROBLEMS, FileProblem, InputError
from detent.methods.cascade.build import motion_limits
from detent.methods.cascade.controller import ARRIVED, FAULT, coast, forget_following, forget_peaks
from detent.methods.cascade.host import CascadeHost
from detent.methods.cascade.schema import CascadeSpec
from detent.methods.changes import lay_changes
from detent.methods.moves.job import Move, MoveJob
from detent.methods.moves.run import time_to_settle
from detent.planning.profile import plan_move
from detent.record.machine import AnyRecorder, Progress
from detent.record.run import Evidence, RunRecord
from detent.sensing.gauge import set_gauge
from detent.units import format_quantity

COAST = 0.1  # time that a run goes on after the drive has gone off [s]

CASCADE_SIGNALS = (
    "controller.reference.position", "controller.reference.velocity", "controller.motor_sensor.position",
    "controller.motor_sensor.velocity", "controller.load_sensor.position", "controller.law.position_error",
    "controller.law.integral", "controller.law.feed_forward", "controller.law.command", "controller.law.limited",
    "plant.source.command", "plant.source.output", "plant.machine.current", "plant.machine.motor.position",
    "plant.machine.motor.velocity", "plant.machine.load.position", "plant.machine.load.velocity",
    "plant.gauge.target",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class CascadeMove:
    """How one move went; lengths [m] or angles [rad], times in seconds since power-on."""

    number: int  #: from 1
    label: str  #: what the move is for
    begin: float  #: when its reference began
    arrived: float  #: when its reference had come to the target; NaN if the drive went off before
    ready: float  #: when it was in position: the loop's error within the window for its time; NaN if it was not
    settled: float  #: when the load was outside the window for the last time; NaN if it stayed outside
    end: float  #: end of the dwell, or when the drive went off
    start: float  #: where the load stood
    target: float  #: where it had to go
    position: float  #: where it stood at the end
    overshoot: float  #: how far the load went beyond the target, 0 if it did not
    peak_speed: float  #: largest speed of the load [m/s]
    peak_following: float  #: largest magnitude of the position loop's error
    peak_after: float = math.nan  #: the same after the end of the reference; NaN if the drive went off before
    peak_command: float  #: largest magnitude of the command [V]
    limited: float  #: time with the command at its limit [s]
    in_position: bool  #: the axis was in position in time

    @property
    def error(self) -> float:
        """Target less position of the load at the end."""
        return self.target - self.position

    @property
    def settling(self) -> float:
        """From the begin of the reference until the load stayed within the window [s]; NaN if it did not."""
        return time_to_settle(self.begin, self.settled, rested=self.in_position)

    @property
    def approach(self) -> float:
        """From the end of the reference until the load stayed within the window [s]; NaN if it did not."""
        return time_to_settle(self.arrived, self.settled, rested=self.in_position)


@dataclass(repr=False)
class CascadeRun(RunRecord[MoveJob]):
    """Outcome of a list of moves on a cascade axis. Times [s], lengths [m] or angles [rad].

    Also `done`: every move was in position in time; `failure`: why not, and what to do, empty if `done`, and the drive
    is off then; `warnings`: what the drive cannot see; `time_ready` and `time_end`: when the axis was in position after
    power-on, and the end of the run, since power-on.
    """

    time_off: float = math.nan  #: when its drive went off; NaN if it did not
    moves: list[CascadeMove] = field(default_factory=list[CascadeMove])  #: in order; the last one may have failed
    tolerance: float = 0.0  #: in-position window
    max_command: float = 0.0  #: limit of the command [V]

    told: ClassVar[tuple[str, ...]] = (
        "time_off", "tolerance", "max_command", "worst_following", "worst_error", "worst_overshoot",
    )  # fmt: skip
    measured: ClassVar[Mapping[str, str]] = {"time_end": "s"}
    measured_moves: ClassVar[Mapping[str, str]] = {
        "peak_following": "m", "peak_after": "m", "error": "m", "settling": "s", "approach": "s", "overshoot": "m",
        "peak_command": "V", "limited": "s", "peak_speed": "m/s",
    }  # fmt: skip
    kept_by: ClassVar[Mapping[str, str]] = {
        "peak_following": "method.following_error", "error": "method.in_position",
    }  # fmt: skip

    @property
    def seconds(self) -> float:
        """From the first readiness to the end of the job."""
        return max(self.time_end - self.time_ready, 0.0)

    @property
    def worst_following(self) -> float:
        """Largest following error."""
        return max((move.peak_following for move in self.moves), default=0.0)

    @property
    def worst_error(self) -> float:
        """Largest magnitude of the error of the load at the end of a move that was in position."""
        return max((abs(move.error) for move in self.moves if move.in_position), default=0.0)

    @property
    def worst_overshoot(self) -> float:
        """Largest overshoot."""
        return max((move.overshoot for move in self.moves), default=0.0)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for ``--json``."""
        moves = [asdict(m) | {"error": m.error, "settling": m.settling, "approach": m.approach} for m in self.moves]
        return super().to_dict() | {"moves": moves}


def run_cascade_moves(
    spec: CascadeSpec, job: MoveJob, *, recorder: AnyRecorder | None = None, progress: Progress | None = None
) -> CascadeRun:
    """Make a list of moves on the axis of `spec`, from power-on.

    A move begins when the one before has been in position and its dwell is over.
    """
    targets = check_cascade_job(spec, job)
    host = CascadeHost(spec, recorder)
    lay_changes({"": host.machine}, job)
    evidence = Evidence(
        host.controller.guard, host.period, spec.encoder.resolution, spec.method.in_position, spec.unit("m"),
        forget=host.forget,
    )  # fmt: skip
    result = CascadeRun(job, tolerance=spec.method.in_position, max_command=spec.largest_command)
    place = spec.mechanics.start_position
    try:
        if _arrive(host) == FAULT:
            result.failure = f"after power-on: {describe_cause(host)}"
        result.time_ready = host.time
        for done, (move, target) in enumerate(zip(job.moves, targets, strict=True), 1):
            if result.failure:
                break
            if _make_move(host, result, evidence, move, place, target) == FAULT:
                result.failure = f"move {move.number} to {_text(spec, target, 6)}: {describe_cause(host)}"
            place = target
            if progress is not None:
                progress(done / len(targets), f"move {done} of {len(targets)}")
        if result.failure:
            result.time_off = host.time
            host.act(coast)
            host.pass_samples(math.ceil(COAST / host.period))
    finally:
        host.machine.close()
    result.time_end, result.done = host.time, not result.failure
    result.warnings, result.limited_share = [*_unseen(spec, result), *evidence.warnings()], evidence.limited_share
    return result


def _make_move(  # noqa: PLR0913 - a move, who makes it, and who judges
    host: CascadeHost, result: CascadeRun, evidence: Evidence, move: Move, place: float, target: float
) -> int:
    """One move and its dwell, put into the result; the event that ended it."""
    gauge, load, peaks = host.state.plant.gauge, host.state.plant.machine.load, host.controller.peaks
    limits = replace(motion_limits(host.spec), speed=move.speed or host.spec.limits.speed)
    profile = plan_move(place, target, limits, host.period)
    begin, start, arrived, ready = host.time, load.position, math.nan, math.nan
    host.act(forget_peaks)
    set_gauge(gauge, host.state.tick, start, target, result.tolerance)
    host.follow(profile)
    event = host.pass_samples(profile.count - 1)
    following, after = peaks.following, math.nan
    if not event:
        host.act(forget_following)
        arrived, event = host.time, _arrive(host)
    if event == ARRIVED:
        ready = host.time
        event = _stand(host, evidence, move) if move.dwell > 0 else 0
    if not math.isnan(arrived):
        after = peaks.following
        following = max(following, after)
    evidence.take()
    if event != FAULT:
        evidence.take_error(f"move {move.number}", target - load.position)
    made = CascadeMove(
        number=move.number,
        label=move.label,
        begin=begin,
        arrived=arrived,
        ready=ready,
        settled=math.nan if abs(target - load.position) > result.tolerance else gauge.outside * host.tick,
        end=host.time,
        start=start,
        target=target,
        position=load.position,
        overshoot=max(float(gauge.beyond), 0.0),
        peak_speed=float(gauge.peak_speed),
        peak_following=following,
        peak_after=after,
        peak_command=peaks.command,
        limited=peaks.limited * host.period,
        in_position=not math.isnan(ready),
    )
    result.moves.append(made)
    return event


def _stand(host: CascadeHost, evidence: Evidence, move: Move) -> int:
    """The dwell, and the event that ended it; in its second half the axis has only to stand."""
    samples = math.ceil(move.dwell / host.period - 1e-9)
    event = host.pass_samples(samples // 2) if samples > 1 else 0
    evidence.take()
    if not event:
        event = host.pass_samples(samples - samples // 2)
        evidence.take(f"after move {move.number}", rest=True)
    return event


def _arrive(host: CascadeHost) -> int:
    """Wait for the axis as long as it may take: whether it is in position, or has a fault."""
    return host.arrive(math.ceil(host.spec.method.timeout / host.period))


def describe_cause(host: CascadeHost) -> str:
    """Why the drive went off, and what to do."""
    spec, method, guard = host.spec, host.spec.method, host.controller.guard
    if guard.code == NO_ARRIVAL:
        error = _text(spec, abs(float(host.controller.law.position_error)))
        return (
            f"not in position within {format_quantity(method.timeout, 's')} of the end of the reference "
            f"(method.timeout): its error is {error}, method.in_position is {_text(spec, method.in_position)}; "
            "the drive is off; add an integral or feedforward to the velocity loop, or widen the "
            "window"
        )
    return describe_fault(
        guard,
        spec.protection,
        speed=format_quantity(max(spec.limits.speed, method.velocity_limit), spec.unit("m/s"), 4),
        lower=f"{_text(spec, spec.limits.lowest)}, limits.lowest",
        upper=f"{_text(spec, spec.highest)}, limits.lowest + limits.travel",
        following=f"{_text(spec, method.following_error)}, method.following_error",
        slip=_text(spec, spec.protection.slip),
        swing=_text(spec, spec.protection.oscillation),
    )


def _text(spec: CascadeSpec, value: float, digits: int = 4) -> str:
    return format_quantity(value, spec.unit("m"), digits)


def _unseen(spec: CascadeSpec, run: CascadeRun) -> list[str]:
    """What the sensors of the loops do not show: a load that stands elsewhere."""
    off = [move for move in run.moves if move.in_position and abs(move.error) > run.tolerance]
    if not off:
        return []
    worst = max(off, key=lambda move: abs(move.error))
    said = (
        f"{len(off)} of {len(run.moves)} moves were in position while the load was off target, move "
        f"{worst.number} by {_text(spec, abs(worst.error), 3)}: the position loop's encoder does not see coupling and "
        "backlash, or the velocity loop has no integral; "
        'state method.feedback.position = "load", or widen method.in_position'
    )
    return [said]


# ---- the job


def check_cascade_job(spec: CascadeSpec, job: MoveJob) -> list[float]:
    """Where each move of a job goes [m]."""
    problems: list[FileProblem] = []
    targets: list[float] = []
    place = spec.mechanics.start_position
    for move in job.moves:
        place = place + move.by if move.by is not None else float(move.target or 0.0)
        targets.append(place)
        line = 1 if move.row else 0
        problems += [FileProblem(job.name, move.row, line, *words) for words in _refused(spec, move, place)]
    if problems:
        raise InputError(problems[:MOST_PROBLEMS])
    return targets


def _refused(spec: CascadeSpec, move: Move, place: float) -> Iterator[tuple[str, str, str, str]]:
    """Key, what it got, what it expected and what to try, of each word of a move that the axis cannot do."""
    speed = spec.unit("m/s")
    low, high, slack = spec.limits.lowest, spec.highest, 1e-9 * spec.limits.travel
    if not low - slack <= place <= high + slack:
        ends = f"{_text(spec, low, 5)} to {_text(spec, high, 5)}"
        allowed = f"a position from limits.lowest to limits.lowest + limits.travel, {ends}"
        yield move.place_key, _text(spec, place, 6), allowed, "keep the move between the two ends"
    if move.speed is not None and not 0 < move.speed <= spec.limits.speed * (1 + 1e-9):
        allowed = f"up to limits.speed, {format_quantity(spec.limits.speed, speed)}"
        yield "speed", format_quantity(move.speed, speed), allowed, "lower it, or raise limits.speed"
    if move.sample_period is not None:
        own = format_quantity(spec.method.sample_period, "s")
        allowed = f"no sample_period: the loops of this axis have a fixed one, {own}"
        yield "sample_period", format_quantity(move.sample_period, "s"), allowed, "leave it out"
