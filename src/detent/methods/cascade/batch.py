"""Many cascade axes of one file, each making the same moves: built as arrays, moved in one compiled loop.

The loop does for each axis what `run.run_cascade_moves` does through its host, with the same steps in the same order,
so that a case has the bits of its own run.
"""

import ctypes
import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.analysis.margins import Margins
from detent.control.guard import NO_ARRIVAL, await_arrival
from detent.errors import GUARD_TEXT, InputError
from detent.files.fields import BOUNDS, bounds_of, leaf_fields
from detent.files.problems import dotted
from detent.kernel.compiled import nth
from detent.kernel.loop import Bytes, HostArray, Offsets, advance
from detent.kernel.registers import Registers, f8, i8, register, u1
from detent.kernel.step import step
from detent.methods.batch import Machine, Numbers, kind_of, refusal_of
from detent.methods.cascade import checks
from detent.methods.cascade.build import build_cascade, fill_cascade, motion_limits
from detent.methods.cascade.controller import ARRIVED, FAULT, Feed
from detent.methods.cascade.loop import LinearLoop, machine_of
from detent.methods.cascade.run import CascadeRun, check_cascade_job
from detent.methods.cascade.schema import MOST_SAMPLES, CascadeSpec, FeedModelTable
from detent.methods.cascade.system import Cascade, CascadeParams, along, switch_on
from detent.methods.moves.job import MoveJob
from detent.planning.profile import MotionLimits, plan_move
from detent.plant.linear_two_mass import fastest_rate
from detent.sensing.gauge import set_gauge

Flags = NDArray[np.bool_]

SIDES = tuple(
    f"mechanics.{mass}.{side}.{key}"
    for mass in ("friction", "load_friction")
    for side in ("positive", "negative")
    for key in ("coulomb", "static", "stribeck", "viscous")
)
COLUMNS = frozenset((
    *SIDES, "mechanics.friction.offset", "mechanics.load_friction.offset", "mechanics.motor_mass",
    "mechanics.load_mass", "mechanics.weight", "mechanics.pendulum", "mechanics.transmission_loss",
    "mechanics.coupling.stiffness", "mechanics.coupling.damping", "mechanics.coupling.backlash",
    "motor.rotor_inertia", "motor.resistance", "drive.effort_per_volt", "drive.current_per_volt", "drive.voltage_gain",
    "drive.command_limit", "drive.command_step", "drive.delay", "drive.max_current", "encoder.delay",
    "load_encoder.delay", "method.position_gain", "method.velocity_gain", "method.velocity_integral",
    "method.proportional", "method.integral", "method.derivative",
))  # fmt: skip
"""Keys whose variants are built as columns; with any other, each machine is built for itself."""


# ---- parameters as arrays


class Columns:
    """Registers of many machines, with the fields of one: what is read and written are columns."""

    def __init__(self, array: NDArray[Any]) -> None:
        object.__setattr__(self, "_array", array)

    def __getattr__(self, name: str) -> Any:
        column = self._array[name]
        return Columns(column) if column.dtype.names else column

    def __setattr__(self, name: str, value: Any) -> None:
        self._array[name] = value


def build_many(spec: CascadeSpec, columns: Mapping[str, Any], count: int) -> Any:
    """Parameters of many machines of a file, byte for byte what `build_cascade` makes of each file.

    `columns` has the keys in which they differ, each of `COLUMNS`, as arrays of shape (count,), or one value for all;
    the result is an array of `CascadeParams`.
    """
    kind: Any = spec.registers_of(CascadeParams)
    made: Any = (kind * count)()
    with np.errstate(all="ignore"):  # what a file would not be allowed to say is built, too, and refused elsewhere
        fill_cascade(Columns(np.frombuffer(made, np.dtype(kind))), spec.varied(columns))
    return made


def ready(spec: CascadeSpec) -> CascadeSpec:
    """The same with a place for what the controller keeps."""
    shares = spec.method.feed_forward
    if shares.model is not None:
        return spec
    return spec.changed(method={"feed_forward": shares.model_copy(update={"model": FeedModelTable()})})


def doubtful(spec: CascadeSpec, columns: Mapping[str, Any], count: int) -> Flags:
    """Which machines a check of their file might refuse; of the others it is known that it does not.

    Bounds of keys, and of the rules in `checks.RULES` those that look at a key of `COLUMNS`; shape (count,).
    """
    fields = {dotted(path): field for path, field in leaf_fields(type(spec))}
    bad = np.zeros(count, np.bool_)
    for key, column in columns.items():
        for kind, bound in bounds_of(fields[key]):
            bad |= np.logical_not(BOUNDS[kind][1](column, bound))
    s = spec.varied(columns)
    for table in checks.directions(s).values():
        bad |= np.less(table.static, table.coulomb)
    at_motor, at_load = checks.ends(s)
    light = np.minimum(at_motor, at_load)
    gain = s.method.velocity_gain * s.method.position_gain if s.method.structure == "cascade" else s.method.proportional
    with np.errstate(all="ignore"):
        bad |= np.less(light, checks.LEAST_MASS) | np.equal(gain, 0.0)
        bad |= 0.5 * s.limits.effort / light * s.method.sample_period**2 > 0.999 * s.limits.travel
        bad |= np.greater(s.drive.command_step, s.largest_command)
        for encoder in (s.encoder, s.load_encoder):
            bad |= encoder is not None and np.greater(encoder.delay + encoder.velocity_span, MOST_SAMPLES)
        sound = ~bad
        if sound.any():
            few = {key: column[sound] if np.ndim(column) else column for key, column in columns.items()}
            bad[sound] |= fastest_rate(machine_of(spec.varied(few))) > 0.999 * checks.FASTEST
    return bad


# ---- the loop


class Seen(Registers):
    """What a move of one axis was, beside what its registers show."""

    event: u1 = register("2: a fault; nothing is done any more")
    begin: i8 = register("when its reference began", unit="tick")
    arrived: i8 = register("when its reference had come to the target", unit="tick")
    start: f8 = register("where the load stood", unit="m")
    following: f8 = register("largest magnitude of the error of the position loop", unit="m")
    after: f8 = register("the same after the end of the reference", unit="m")


class Order(Registers):
    """A move that many axes make; times in samples."""

    target: f8 = register("where it goes", unit="m")
    window: f8 = register("in-position window", unit="m")
    samples: i8 = register("length of the reference", unit="count")
    settle: i8 = register("largest time until in position", unit="count")
    dwell: i8 = register("time at the target", unit="count")


@step
def pass_samples(p: Any, r: Any, samples: int, trace: Bytes, picks: Offsets, *feed: HostArray) -> int:
    """As `CascadeHost.pass_samples`."""
    advance(p, r, samples * p.controller.sample_ticks, trace, picks, 0, *feed)
    event, r.controller.event = r.controller.event, 0
    if event:
        advance(p, r, r.controller.left, trace, picks, 0, *feed)
    return event


@step
def arrive(p: Any, r: Any, samples: int, trace: Bytes, picks: Offsets, *feed: HostArray) -> int:
    """As `CascadeHost.arrive`."""
    r.controller.within = 0
    await_arrival(r.controller.guard, samples)
    return pass_samples(p, r, samples, trace, picks, *feed)


@step
def power_on(  # noqa: PLR0913 - as `make_moves`
    p0: Any, r0: Any, seen0: Any, which: Offsets, order: Any, trace: Bytes, picks: Offsets, *feed: Any
) -> None:
    """Wait for these axes to be in position."""
    for i in range(len(which)):
        k = which[i]
        nth(seen0, k).event = arrive(nth(p0, k), nth(r0, k), order.settle, trace, picks, *feed)


@step
def make_move(p: Any, r: Any, seen: Any, order: Any, trace: Bytes, picks: Offsets, *feed: HostArray) -> int:  # noqa: PLR0913 - as `make_moves`
    """One move of one axis, and its dwell; the event that ended it."""
    c, peaks, load = r.controller, r.controller.peaks, r.plant.machine.load
    seen.begin, seen.start, seen.arrived, seen.after = r.tick, load.position, -1, math.nan
    peaks.following = peaks.command = 0.0
    peaks.limited = 0
    set_gauge(r.plant.gauge, r.tick, seen.start, order.target, order.window)
    c.entry = 0
    event = pass_samples(p, r, order.samples - 1, trace, picks, *feed)
    seen.following = peaks.following
    if event == 0:
        peaks.following = 0.0
        seen.arrived = r.tick
        event = arrive(p, r, order.settle, trace, picks, *feed)
        if event == ARRIVED:
            event = pass_samples(p, r, order.dwell // 2, trace, picks, *feed) if order.dwell > 1 else 0
            if event == 0 and order.dwell > 0:
                event = pass_samples(p, r, order.dwell - order.dwell // 2, trace, picks, *feed)
        seen.after = peaks.following
        seen.following = max(seen.following, seen.after)
    return event


@step
def make_moves(  # noqa: PLR0913 - axes, where they are in their arrays, and what to do
    p0: Any, r0: Any, seen0: Any, which: Offsets, order: Any, trace: Bytes, picks: Offsets, *feed: Any
) -> None:
    """One move of these axes, those that failed left out."""
    for i in range(len(which)):
        k = which[i]
        seen = nth(seen0, k)
        if seen.event != FAULT:
            seen.event = make_move(nth(p0, k), nth(r0, k), seen, order, trace, picks, *feed)


_NO_ROWS = np.zeros((1, 1), np.uint8), np.zeros(0, np.int64)


@lru_cache(maxsize=256)
def _planned(place: float, target: float, limits: MotionLimits, period: float) -> tuple[int, Feed]:
    """Samples of a move, and what the host lays ready for it."""
    profile = plan_move(place, target, limits, period)
    return profile.count, along(profile.position, profile.velocity, profile.acceleration)


# ---- many axes


class _Fleet:
    """Axes at power-on, in arrays; those that failed have a reason."""

    def __init__(self, specs: Sequence[CascadeSpec], whose: Offsets, params: Any) -> None:
        self.specs: Sequence[CascadeSpec] = specs
        self.whose, self.params = whose, params
        self.count = len(whose)
        self.kind: Any = specs[0].registers_of(Cascade)
        self.state: Any = (self.kind * self.count)()
        self.seen: Any = (Seen * self.count)()
        self.reasons = dict[int, str]()
        self.p, self.r, self.s = (np.frombuffer(one, np.dtype(one._type_)) for one in (params, self.state, self.seen))
        self.tick = self.p["plant"]["machine"]["period"]
        self.period = self.tick * self.p["controller"]["sample_ticks"]
        self.moves = list[dict[str, Numbers]]()

    def refuse(self, k: int, reason: str) -> None:
        """Let an axis make no move."""
        self.reasons[k] = reason
        self.s["event"][k] = FAULT

    def switch_on(self) -> None:
        """Power-on, of axes that begin alike at once."""
        begun = dict[int, Any]()
        starts: Any = [spec.mechanics.start_position for spec in self.specs]
        for k, whose in enumerate(self.whose.tolist()):
            if k in self.reasons:
                continue
            if whose not in begun:
                first: Any = self.kind()
                begun[whose] = first
                switch_on(self.params[k], first, starts[whose])
                first.controller.guarded = 1
            ctypes.memmove(ctypes.addressof(self.state[k]), ctypes.addressof(begun[whose]), ctypes.sizeof(self.kind))

    def groups(self) -> dict[tuple[int, float], Offsets]:
        """Axes that have one reference: those of one specification and sample period."""
        found = dict[tuple[int, float], list[int]]()
        for k, (whose, period) in enumerate(zip(self.whose.tolist(), self.period.tolist(), strict=True)):
            if k not in self.reasons:
                found.setdefault((whose, period), []).append(k)
        return {key: np.array(which, np.int64) for key, which in found.items()}

    def run(self, job: MoveJob) -> None:
        """Make the job."""
        self.switch_on()
        self.moves = [{name: np.full(self.count, np.nan) for name in CascadeRun.measured_moves} for _ in job.moves]
        for (whose, period), which in self.groups().items():
            spec = self.specs[whose]
            try:
                targets = check_cascade_job(spec, job)
            except InputError as error:
                for k in which.tolist():
                    self.refuse(k, refusal_of(error.problems))
                continue
            self._make(spec, job, targets, period, which)
        for k in np.flatnonzero(self.s["event"] == FAULT).tolist():
            if k not in self.reasons:
                self.reasons[k] = self._reason(k)

    def _make(self, spec: CascadeSpec, job: MoveJob, targets: Sequence[float], period: float, which: Offsets) -> None:
        """The moves of some axes that have one reference."""
        place, method, limits = spec.mechanics.start_position, spec.method, motion_limits(spec)
        order = Order(window=method.in_position, settle=math.ceil(method.timeout / period))
        arrays = self.params[0], self.state[0], self.seen[0]
        stand = along(np.array([place]), np.zeros(1), np.zeros(1))
        power_on(*arrays, which, order, *_NO_ROWS, *stand)
        for j, (move, target) in enumerate(zip(job.moves, targets, strict=True)):
            own = MotionLimits(move.speed or limits.speed, limits.acceleration, limits.jerk)
            order.samples, feed = _planned(place, target, own, period)
            order.target, order.dwell = target, math.ceil(move.dwell / period - 1e-9) if move.dwell > 0 else 0
            make_moves(*arrays, which, order, *_NO_ROWS, *feed)
            self._measure(self.moves[j], which, target, order.window)
            place = target

    def _measure(self, found: dict[str, Numbers], which: Offsets, target: float, window: float) -> None:
        """Figures of a move, as `run.CascadeMove` has them."""
        r, s, tick, period = self.r[which], self.s[which], self.tick[which], self.period[which]
        gauge, peaks = r["plant"]["gauge"], r["controller"]["peaks"]
        error = np.abs(target - r["plant"]["machine"]["load"]["position"])
        settled = np.where(error > window, np.nan, gauge["outside"] * tick)
        begin, arrived = s["begin"] * tick, s["arrived"] * tick
        told = {
            "peak_following": s["following"], "peak_after": s["after"], "error": error,
            "settling": np.maximum(settled - begin, 0.0), "approach": np.maximum(settled - arrived, 0.0),
            "overshoot": np.maximum(gauge["beyond"], 0.0), "peak_command": peaks["command"],
            "limited": peaks["limited"] * period, "peak_speed": gauge["peak_speed"],
        }  # fmt: skip
        for name, each in told.items():
            found[name][which] = each

    def _reason(self, k: int) -> str:
        """Why an axis failed, as `run.describe_cause` says it, without values."""
        guard = self.state[k].controller.guard
        if guard.code == NO_ARRIVAL:
            return "not in position within ... of the end of the reference"
        side = "upper" if guard.side > 0 else "lower"
        fields = dict.fromkeys(("stuck", "saturated", "reversed", "speed", "end", "following", "arrival"), "...")
        return kind_of(GUARD_TEXT[guard.code].format(side=side, **fields))

    def results(self) -> dict[str, Numbers]:
        """What was measured, by the names of `RunRecord.figures`."""
        done = np.ones(self.count, np.bool_)
        done[list(self.reasons)] = False
        told = {"time_end": self.r["tick"] * self.tick}
        for name in CascadeRun.measured_moves:
            told[name] = np.max([move[name] for move in self.moves], axis=0)
        if len(self.moves) > 1:
            told |= {f"move {k} {name}": move[name] for name in CascadeRun.measured_moves
                     for k, move in enumerate(self.moves, 1)}  # fmt: skip
        return {"done": done.astype(np.float64)} | {name: np.where(done, each, np.nan) for name, each in told.items()}


class CascadeBatch:
    """A list of moves on many axes of one file."""

    def __init__(self, spec: CascadeSpec, job: MoveJob) -> None:
        self.spec, self.job = ready(spec), job

    def fleet(self, variants: Mapping[str, Any], machine: Machine, count: int) -> _Fleet:
        """The axes; those that their file would be refused are there, too, and make no move."""
        if not self._in_columns(variants):
            return self._each(machine, count)
        params = build_many(self.spec, variants, count)
        fleet = _Fleet([self.spec], np.zeros(count, np.int64), params)
        for k in np.flatnonzero(doubtful(self.spec, variants, count)).tolist():
            try:
                machine(k)
            except InputError as error:
                fleet.refuse(k, refusal_of(error.problems))
        return fleet

    def _in_columns(self, variants: Mapping[str, Any]) -> bool:
        """Whether these machines can be built as columns."""
        fields = {dotted(path) for path, _ in leaf_fields(type(self.spec))}
        alone = [key for key, column in variants.items() if np.ndim(column) and key not in COLUMNS]
        return not alone and fields.issuperset(variants)

    def _each(self, machine: Machine, count: int) -> _Fleet:
        """Axes built one by one."""
        kind: Any = self.spec.registers_of(CascadeParams)
        params, specs, refused = (kind * count)(), list[CascadeSpec](), dict[int, str]()
        for k in range(count):
            spec = self.spec
            try:
                spec = machine(k).spec
            except InputError as error:
                refused[k] = refusal_of(error.problems)
            specs.append(spec)
            params[k] = build_cascade(spec)
        fleet = _Fleet(specs, np.arange(count), params)
        for k, reason in refused.items():
            fleet.refuse(k, reason)
        return fleet

    def run(
        self, variants: Mapping[str, Any], machine: Machine, count: int
    ) -> tuple[dict[str, Numbers], dict[int, str]]:
        """Make the job on each; as `methods.batch.Batch` says it."""
        fleet = self.fleet(variants, machine, count)
        fleet.run(self.job)
        return fleet.results(), fleet.reasons

    def margins(self, variants: Mapping[str, Any], count: int) -> Mapping[str, Margins] | None:
        """Margins of the loops of each; as `methods.batch.Batch` says it."""
        return LinearLoop(self.spec.varied(variants), count).margins if self._in_columns(variants) else None
