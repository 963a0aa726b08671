"""A recording replayed on a simulated cascade axis: its reference followed, or its command put in, and both compared.

The simulated axis begins where the recorded one stood and as fast as it moved. It is compared with the recording at the
recording's own instants: what its encoders read there, and what its law commanded.

Janot, Gautier, Brunot: Data Set and Reference Models of EMPS. Nonlinear System Identification Benchmarks 2019 (relative
errors of a simulation: the norm of the difference over the norm of the measurement).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from importlib import import_module
from typing import Any, ClassVar

import numpy as np

from detent.errors import DetentError
from detent.files.screen import OnScreen
from detent.logs.headings import EFFORTS
from detent.logs.log import Log
from detent.methods.cascade.host import CascadeHost, Rows
from detent.methods.cascade.schema import CascadeSpec
from detent.methods.cascade.system import set_off
from detent.planning.profile import Numbers, Profile, profile_of_recording
from detent.record.machine import AnyRecorder, Progress
from detent.record.run import RunRecord
from detent.units import format_quantity

CHUNK = 8192  # samples between two words of progress

# Velocities that were not recorded, and accelerations, are those of positions low-passed at this frequency, both alike
# [Hz]; at most a fifth of the sample rate.
CUTOFF = 100.0

START_SPAN, START_SAMPLES = 0.012, 8  # time from which the velocity at the begin is taken [s], and its samples at least
STILL = 5  # samples on both sides through which a recorded reference that stands does not change


@dataclass(frozen=True, slots=True, eq=False, kw_only=True, repr=False)
class ReplayJob(OnScreen):
    """A recording, as far as an axis can replay it; arrays of shape (n,), n >= 3, all finite.

    One with neither a reference nor an effort, or with arrays that do not fit together, is a `DetentError`.
    """

    name: str  #: name of the log
    t: Numbers  #: time [s], strictly increasing
    position: Numbers  #: as measured [m]; of a rotary axis [rad]
    reference: Numbers | None = None  #: position asked for [m]; without one the recorded effort drives the axis
    velocity: Numbers | None = None  #: as measured [m/s]
    load_position: Numbers | None = None  #: by a second encoder [m]
    #: what drove the axis: force [N], torque [N m], current [A], voltage [V], command [V]
    efforts: dict[str, Numbers] = field(default_factory=dict[str, Numbers])
    notes: tuple[str, ...] = ()  #: what was found wrong with the log, and what was guessed
    kind: str = "replay"

    def __post_init__(self) -> None:
        """Refuse what no axis could replay."""
        present = [self.t, self.position, *self.efforts.values()]
        present += [x for x in (self.reference, self.velocity, self.load_position) if x is not None]
        if len(self.t) < 3 or any(x.shape != self.t.shape for x in present):
            shapes = ", ".join(str(x.shape) for x in present)
            raise DetentError(f"{self.name}: got signals of shapes {shapes}; expected: all (n,) with n 3 or more")
        if not (np.diff(self.t) > 0).all() or not all(np.isfinite(x).all() for x in present):
            raise DetentError(
                f"{self.name}: got a time that does not rise, or values that are not finite; expected: a rising time, "
                "finite values; read the log with detent.identify first"
            )
        if self.reference is None and not self.efforts:
            raise DetentError(
                f"{self.name}: got neither a reference nor a force, current, voltage or command; expected: one of them "
                "beside the position; name its column: --column 'reference=COLUMN [mm]'"
            )

    @property
    def seconds(self) -> float:
        """Length of the recording [s]."""
        return float(self.t[-1] - self.t[0])


def make_replay_job(spec: CascadeSpec, log: Log) -> ReplayJob:
    """The recording of an axis, as its job."""
    if "position" not in log.signals:
        got = ", ".join(log.signals) or "no signal"
        raise DetentError(
            f"{log.name}: got {got}; expected: a log with a position; name its column: --column 'position=COLUMN [mm]'"
        )
    way = spec.unit("m")
    example = "deg" if way == "rad" else "mm"
    for role, unit in log.units.items():
        kind = unit.partition("/")[0]
        if role in log.signals and kind in {"m", "rad", "count"} and kind != way:
            raise DetentError(
                f"{log.name}: got {role} in {unit}; expected: {way}, as the axis is a {spec.axis.motion} one; state "
                f"the unit of its column, a number before it for counts: --column '{role}=COLUMN [{example}]'"
            )
    guessed = [f"guessed: {'; '.join(log.guesses)}"] if log.guesses else []
    return ReplayJob(
        name=log.name,
        t=log.t,
        position=log.signals["position"],
        reference=log.signals.get("reference"),
        velocity=log.signals.get("velocity"),
        load_position=log.signals.get("position_load"),
        efforts={role: log.signals[role] for role in EFFORTS if role in log.signals},
        notes=(*map(str, log.findings), *guessed),
    )


@dataclass(frozen=True, slots=True, eq=False)
class Compared:
    """One signal, as recorded and as simulated, at the instants of the recording."""

    name: str  #: what it is: "position", "velocity", "force"
    unit: str  #: SI unit
    measured: Numbers  #: values as recorded [unit], shape (n,)
    simulated: Numbers  #: the same as simulated

    @property
    def difference(self) -> Numbers:
        """Recording minus simulation."""
        return self.measured - self.simulated

    @property
    def rms(self) -> float:
        """Root of the mean square of the difference."""
        return float(np.sqrt(np.mean(self.difference**2)))

    @property
    def peak(self) -> float:
        """Largest magnitude of the difference."""
        return float(np.abs(self.difference).max())

    @property
    def relative(self) -> float:
        """Norm of the difference over that of the recording; NaN for a recording of zeros."""
        norm = float(np.linalg.norm(self.measured))
        return float(np.linalg.norm(self.difference)) / norm if norm else math.nan


@dataclass(repr=False)
class ReplayRun(RunRecord[ReplayJob]):
    """A recording beside its simulation. Times [s] count from the recording's first sample.

    Also `done`: the simulation came to the recording's end; `failure`: why not, empty if `done`; `warnings`: what
    should be known about the comparison; `time_ready` and `time_end`: begin and end, in simulated time.
    """

    open_loop: str = ""  #: signal that drove the axis where there is no reference; empty where it followed one
    period: float = 0.0  #: time between two samples of the loops
    compared: list[Compared] = field(default_factory=list[Compared])  #: position first
    peak_following: float = math.nan  #: largest magnitude of the simulated following error; NaN open loop
    limited: float = 0.0  #: time with the simulated command at its limit [s]

    told: ClassVar[tuple[str, ...]] = ("open_loop", "period", "peak_following", "limited")

    def to_dict(self) -> dict[str, Any]:
        """Plain data for ``--json``: everything but the curves."""
        found = super().to_dict() | {"samples": len(self.job.t), "notes": list(self.job.notes)}
        found["compared"] = [
            {"signal": one.name, "unit": one.unit, "rms": one.rms, "peak": one.peak, "relative": one.relative}
            for one in self.compared
        ]
        return found


def run_cascade_replay(
    spec: CascadeSpec, job: ReplayJob, *, recorder: AnyRecorder | None = None, progress: Progress | None = None
) -> ReplayRun:
    """Replay a recording on the axis of `spec`.

    The loops follow the recorded reference; without one the amplifier gets the recorded effort. The drive does not go
    off: what it would have gone off for is a warning.
    """
    host = CascadeHost(spec, recorder, position=float(job.position[0]))
    host.controller.guarded = 0
    if speed := starting_velocity(job.t, job.position):
        set_off(host.params, host.state, speed)
    result = ReplayRun(job, period=host.period)
    samples = math.floor(job.seconds / host.period + 1e-6) + 1
    if job.reference is not None:
        host.follow(recorded_profile(job.t, job.reference, host.period))
    else:
        result.open_loop, command = _open_loop(spec, job)
        # What was put out holds until the next sample of the recording.
        at = float(job.t[0]) + (np.arange(samples) + 1e-6) * host.period
        rows = np.searchsorted(job.t, at, side="right") - 1
        host.drive(np.ascontiguousarray(command[rows]))
    seen: list[Rows] = []
    try:
        for begin in range(0, samples, CHUNK):
            seen.append(host.watch(min(CHUNK, samples - begin)))
            if progress is not None:
                progress(min(begin + CHUNK, samples) / samples, "replaying the recording")
    finally:
        host.machine.close()
    result.time_end = host.time
    _judge(spec, result, host, np.concatenate(seen))
    return result


# ---- how it moved


def recorded_profile(t: Numbers, reference: Numbers, period: float) -> Profile:
    """A recorded reference at the samples of the loops, with its derivatives.

    They are those of a spline, which rings by a hair where the reference stands: a feedforward against Coulomb
    friction would jump to and fro. Where the recording stands for `STILL` samples on both sides they are 0.
    """
    found = profile_of_recording(t, reference, period)
    moves = np.convolve(np.diff(reference) != 0.0, np.ones(2 * STILL), mode="full")[STILL - 1 :][: len(reference)]
    nearest = np.searchsorted(t, float(t[0]) + (np.arange(found.count) - 0.5) * period).clip(max=len(t) - 1)
    stands = moves[nearest] < 0.5
    return replace(
        found,
        velocity=np.where(stands, 0.0, found.velocity),
        acceleration=np.where(stands, 0.0, found.acceleration),
    )


def starting_velocity(t: Numbers, position: Numbers) -> float:
    """Velocity at the begin of a recording [m/s]."""
    begin = float(t[0])
    count = max(START_SAMPLES, int(np.searchsorted(t, begin + START_SPAN, side="right")))
    if len(t) <= count:
        return 0.0
    at, q = t[:count] - begin, position[:count]
    fitted, covariance = np.polyfit(at, q, 3, cov=True)
    slope, reached = float(fitted[2]), float(np.abs(np.diff(q) / np.diff(at)).max())
    least = max(5 * math.sqrt(max(float(covariance[2, 2]), 0.0)), 0.1 * reached)
    return slope if abs(slope) > least else 0.0


def smooth_velocity(t: Numbers, position: Numbers) -> Numbers:
    """Velocity of recorded positions: low-passed forwards and backwards, then central differences [m/s]."""
    signal: Any = import_module("scipy.signal")  # it states no types
    rate = (len(t) - 1) / float(t[-1] - t[0])
    numerator, denominator = signal.butter(4, min(CUTOFF, 0.2 * rate) / (0.5 * rate))
    reach = 3 * max(len(numerator), len(denominator))
    smooth = signal.filtfilt(numerator, denominator, position) if len(t) > reach else position
    return np.asarray(np.gradient(smooth, t), np.float64)


# ---- what drove the axis


def per_command(spec: CascadeSpec) -> dict[str, float]:
    """Each effort that a recording can hold, per volt of this axis's command; what tells most about it comes first."""
    if spec.drive.input == "voltage":
        return {"voltage": spec.drive.voltage_gain, "command": 1.0}
    force = {"torque" if spec.axis.motion == "rotary" else "force": spec.effort_per_command}
    command = {"voltage": 1.0, "command": 1.0}
    if spec.drive.input == "current":
        return {"current": spec.drive.current_per_volt} | command | force
    return force | command


def _open_loop(spec: CascadeSpec, job: ReplayJob) -> tuple[str, Numbers]:
    """Signal that drives the axis, and the command that it comes from [V]."""
    gains = per_command(spec)
    for name, gain in gains.items():
        if name in job.efforts:
            return name, job.efforts[name] / gain
    allowed = " or ".join(gains)
    raise DetentError(
        f"{job.name}: got {', '.join(job.efforts)} and no reference; expected: a reference, or {allowed}, for an axis "
        f'with drive.input = "{spec.drive.input}"; name the column, or change drive.input'
    )


# ---- results


def _judge(spec: CascadeSpec, result: ReplayRun, host: CascadeHost, seen: Rows) -> None:
    """Compare, and say what should be known."""
    job = result.job
    finite = np.isfinite(seen["plant.machine.load.position"]) & np.isfinite(seen["controller.law.command"])
    result.done = bool(finite.all())
    if not result.done:
        first = int(np.argmin(finite)) * host.period
        result.failure = (
            f"the simulated axis ran away {format_quantity(first, 's')} after the start: its loops are unstable; "
            "correct the gains or the plant"
        )
        return
    at = job.t[0] + np.arange(len(seen)) * host.period

    def simulated(column: str) -> Numbers:
        return at_stamps(job.t, at, seen[column])

    efforts = [one for one in _efforts(spec, job, simulated) if one.name != result.open_loop]
    result.compared = [*_motion(spec, job, simulated), *efforts]
    at_limit = seen["controller.law.limited"] > 0
    if result.open_loop:
        at_limit = np.abs(seen["plant.source.command"]) >= host.params.plant.source.limit * (1 - 1e-12)
    result.limited = float(np.count_nonzero(at_limit)) * host.period
    result.warnings = _cautions(spec, result, seen)


def at_stamps(t: Numbers, at: Numbers, values: Numbers) -> Numbers:
    """Simulated values at the stamps of a recording."""
    found = np.interp(t, at, values)
    if len(at) < 2:
        return found
    slope = (values[-1] - values[-2]) / (at[-1] - at[-2])
    return np.asarray(found + np.maximum(t - at[-1], 0.0) * slope, np.float64)


def _motion(spec: CascadeSpec, job: ReplayJob, simulated: Callable[[str], Numbers]) -> list[Compared]:
    """Positions, velocity and acceleration."""
    way = spec.unit("m")
    # The one encoder that was recorded is the one that the position loop uses.
    on_load = spec.method.feedback.position == "load" and job.load_position is None
    place = simulated("controller.load_sensor.position" if on_load else "controller.motor_sensor.position")
    found = [Compared("position", way, job.position, place)]
    if job.load_position is not None:
        load = simulated("controller.load_sensor.position")
        found.append(Compared("position of the load", way, job.load_position, load))
    measured, got = (smooth_velocity(job.t, values) for values in (job.position, place))
    accelerations = np.gradient(measured, job.t), np.gradient(got, job.t)
    if job.velocity is not None and not on_load:
        measured, got = job.velocity, simulated("controller.motor_sensor.velocity")
    found.append(Compared("velocity", spec.unit("m/s"), measured, got))
    return [*found, Compared("acceleration", spec.unit("m/s^2"), *accelerations)]


def _efforts(spec: CascadeSpec, job: ReplayJob, simulated: Callable[[str], Numbers]) -> list[Compared]:
    """Every recorded effort that this axis has too."""
    units = {"force": "N", "torque": "N*m", "current": "A", "voltage": "V", "command": "V"}
    got = {name: gain * simulated("plant.source.command") for name, gain in per_command(spec).items()}
    if spec.drive.input == "voltage":
        current = simulated("plant.machine.current")
        force = "torque" if spec.axis.motion == "rotary" else "force"
        got |= {"current": current, force: spec.force_constant * current}
    return [Compared(name, units[name], values, got[name]) for name, values in job.efforts.items() if name in got]


def _cautions(spec: CascadeSpec, result: ReplayRun, seen: Rows) -> list[str]:
    """What this axis would not have done, and what could not be compared."""
    found: list[str] = []
    way, limit = spec.unit("m"), spec.method.following_error
    if not result.open_loop:
        errors = np.abs(seen["controller.law.position_error"])
        result.peak_following = float(errors.max())
        if result.peak_following > limit:
            first = int(np.argmax(errors > limit)) * result.period
            found.append(
                f"the simulated following error exceeded {format_quantity(limit, way)}, method.following_error, "
                f"{format_quantity(first, 's')} after the start: in a run of moves the drive would have tripped"
            )
    place, limits = seen["plant.machine.load.position"], spec.limits
    if place.min() < limits.lowest or place.max() > spec.highest:
        ends = f"{format_quantity(limits.lowest, way)} to {format_quantity(spec.highest, way)}"
        found.append(f"the simulated load left the travel of the axis, {ends}; widen limits.travel, or look at the log")
    if result.limited > 0:
        whose = f"the recorded {result.open_loop}" if result.open_loop else "the simulated command"
        found.append(
            f"{whose} is clipped at the limit of this axis, {spec.largest_command:.4g} V of command, for "
            f"{format_quantity(result.limited, 's')}; look at limits.effort and drive.command_limit"
        )
    have = {one.name for one in result.compared} | {result.open_loop}
    if not result.job.efforts:
        found.append(
            "the log has no force, current, voltage or command to compare; if there is one, name its column and "
            "unit: --column 'voltage=COLUMN [V]'"
        )
    missing = [name for name in result.job.efforts if name not in have]
    if missing:
        found.append(
            f'{" and ".join(missing)}: recorded, but an axis with drive.input = "{spec.drive.input}" '
            f"{'and no [motor] ' if spec.motor is None else ''}has no such quantity; not compared"
        )
    return found
