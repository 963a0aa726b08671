"""An axis with identified constants, simulated along a log: the test that no residual replaces.

The axis gets the recorded effort and nothing else, so that every error of the constants adds up. From many moments of
the log it starts where the log says the axis was, and runs for a horizon: a sample, a second, to the end.

A log with a reference is followed under its own loops too (`simulate_closed_loop`), those that `loop_fit` finds in its
first part. Loops hide errors of constants in the position, and show them in the effort; both are stated.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from detent.identify.fit import Report, untold
from detent.identify.fit.constants import Constants, hanging_position
from detent.identify.fit.equations import Run, fine_kernel, make_kernel
from detent.identify.fit.estimate import quantile, rms, significant
from detent.identify.fit.loop_fit import Loops, fit_loops, motion_asked
from detent.kernel.loop import advance
from detent.logs.log import Values
from detent.methods.cascade import system as cascade
from detent.plant.linear_two_mass import fastest_rate
from detent.record.recorder import byte_places, choose_leaves
from detent.sensing.position_sensor import MEMORY

HORIZONS = (0.1, 0.5, 1.0, 2.0)  # lengths of simulated stretches [s]
SUBSTEPS = 4  # ticks of the plant per sample of the log
NUDGED = 0.05  # change of a constant for what it does to a free run, in its value, at most
FARTHEST = 10.0  # spread of a free run, in the way that it makes, from which on nothing is said of it
MOST_STARTS = 60  # stretches simulated per horizon at most, evenly spread over the log
_LOOP_PICKS = byte_places(choose_leaves(cascade.Cascade, ["plant.machine.motor.position", "controller.law.command"]))
_PICKS = byte_places(choose_leaves(cascade.Cascade, ["plant.machine.motor.position"]))


@dataclass(frozen=True, slots=True)
class Horizon:
    """Errors of stretches of one length."""

    duration: float  # length of a stretch [s]; a sample, or to the end of the log
    name: str  # what it is called
    starts: int  # stretches simulated
    # rms, largest: error of the position at the end of a stretch over all stretches; of the free run over its whole
    # length
    rms: float
    largest: float
    moved: float  # root mean square of the way the axis made in these stretches, which 0 would be wrong by
    naive: float  # error of going on with the velocity of the start: what no model needs to know
    # of the free run: half of the 95 % interval that the limits of the constants alone leave its position, rms over its
    # length; nan for stretches, and where the limits leave nothing to be said
    spread: float = math.nan


class Plant:
    """An axis with identified constants that can be run along a log."""

    def __init__(self, constants: Constants, step: float) -> None:
        p = plant_registers(constants)
        self.ticks = _ticks(p, step)
        cascade.fill_clocks(p, step / self.ticks, 1)
        self._params = p
        self._late = round(constants.value("delay") / step * self.ticks)
        self._hanging = hanging_position(constants)
        self._step = step

    def run(self, effort: Values, begin: int, samples: int, position: float, velocity: float) -> Values:
        """Positions at samples under a recorded effort, loops open."""
        r = cascade.Cascade()
        cascade.switch_on(self._params, r, position - self._hanging)
        r.plant.machine.motor.velocity = r.plant.machine.load.velocity = velocity
        ticks = (samples - 1) * self.ticks
        first, into = divmod(begin * self.ticks - self._late, self.ticks)
        held = effort[np.clip(np.arange(first, first + samples), 0, len(effort) - 1)]
        command = np.repeat(held, self.ticks)[into : into + ticks]
        rows = np.zeros((samples, 8), np.uint8)
        advance(self._params, r, ticks, rows, _PICKS, self.ticks, *cascade.driven(command))
        moved = rows.view(np.float64)[:, 0] + self._hanging
        moved[0] = position
        return moved


def _ticks(p: cascade.CascadeParams, step: float) -> int:
    """Ticks of the plant per sample; the rate is rounded, as its last digits differ from processor to processor."""
    return max(SUBSTEPS, math.ceil(significant(fastest_rate(p.plant.machine) * step / cascade.MAX_RATE)))


def plant_registers(constants: Constants) -> cascade.CascadeParams:
    """Registers of a plant that is driven by the effort itself."""
    p = cascade.CascadeParams()
    p.plant.machine.motor.mass = constants.value("mass")
    offset = 0.5 * (constants.value("coulomb.positive") - constants.value("coulomb.negative"))
    friction = p.plant.machine.motor.friction
    friction.offset = offset
    for direction, way, sign in ((friction.positive, "positive", 1.0), (friction.negative, "negative", -1.0)):
        direction.coulomb = max(constants.value(f"coulomb.{way}") - sign * offset, 0.0)
        direction.viscous = max(constants.value(f"viscous.{way}"), 0.0)
        direction.static = max(constants.value(f"static.{way}") - sign * offset, 0.0)
        direction.stribeck = max(constants.value("stribeck"), 0.0)
    p.plant.machine.pendulum = math.hypot(constants.value("pendulum"), constants.value("pendulum.across"))
    p.plant.machine.loss = min(max(constants.value("loss"), 0.0), 1.0)
    p.plant.machine.winding.max_current = p.controller.law.cascade.max_velocity = math.inf
    p.plant.source.gain, p.plant.source.limit, p.controller.law.max_command = 1.0, math.inf, math.inf
    for sensor in (p.controller.motor_sensor, p.controller.load_sensor):
        sensor.span, sensor.smoothing = 1, 1.0
    return p


def start_velocities(run: Run) -> Values:
    """Velocity at every sample, as a simulation starts with it."""
    return fine_kernel(make_kernel(max(4, round(0.02 / run.step)), run.step)).velocities(run.position)


def simulate_horizons(constants: Constants, runs: Sequence[Run], report: Report = untold) -> tuple[Horizon, ...]:
    """Errors over each of `HORIZONS`, over a sample, and to the end."""
    found: list[Horizon] = []
    step = runs[0].step
    named = [*((round(h / step), f"{h:g} s") for h in HORIZONS), (1, "one step")]
    for k, (samples, name) in enumerate(named):
        if samples < 1 or (samples == 1 and name != "one step"):
            continue
        made = [_stretches(constants, run, samples) for run in runs if len(run.position) > samples + 2]
        rows = np.concatenate([np.empty((0, 3)), *made])
        if len(rows):
            found.append(_horizon(name, samples * step, len(rows), rows))
        report((k + 1) / (len(named) + 1))
    found.append(_free_run(constants, runs))
    return tuple(found)


def _stretches(constants: Constants, run: Run, samples: int) -> Values:
    """Error, way and naive error at the end of stretches, shape (stretches, 3)."""
    plant, velocity, q = Plant(constants, run.step), start_velocities(run), run.position
    border = well_known_from(run)
    last = len(q) - samples - border
    starts = np.unique(np.linspace(border, max(last, border), MOST_STARTS).astype(int))
    starts = starts[starts + samples < len(q)]
    rows: list[tuple[float, float, float]] = []
    for s in starts.tolist():
        end = plant.run(run.effort, s, samples + 1, float(q[s]), float(velocity[s]))[-1]
        way = float(q[s + samples] - q[s])
        rows.append((float(end - q[s + samples]), way, float(velocity[s]) * samples * run.step - way))
    return np.array(rows).reshape(-1, 3)


def _horizon(name: str, duration: float, starts: int, rows: Values) -> Horizon:
    error, way, naive = rows.T
    return Horizon(duration, name, starts, rms(error), float(np.abs(error).max()), rms(way), rms(naive))


def _free_run(constants: Constants, runs: Sequence[Run]) -> Horizon:
    """The whole of each run in one piece."""
    rows: list[Values] = []
    for run in runs:
        velocity = float(start_velocities(run)[well_known_from(run)])
        cut = run.part(well_known_from(run), len(run.position))
        q = cut.position
        rows.append(np.column_stack([free_run(constants, run) - q, q - q[0], q[0] + velocity * cut.t - q]))
    found = _horizon("free run", max(run.t[-1] for run in runs), len(runs), np.concatenate(rows))
    return replace(found, spread=free_spread(constants, runs))


def free_spread(constants: Constants, runs: Sequence[Run]) -> float:
    """Half of the 95 % interval that the errors of the constants leave a free run, rms over it; nan beyond `FARTHEST`.

    To first order: the free run is simulated once more with each constant a little off, and what that changes is added
    up by the covariance. No start, and nothing that the model lacks, is part of it.
    """
    errors, found, way = constants.errors, list[Values](), 0.0
    for run in runs:
        middle = free_run(constants, run)
        way = max(way, float(np.ptp(middle)))
        nudges = np.array([_nudge(constants, k, run.step) for k in range(len(errors))])
        factors = np.where(errors > 0.0, errors / nudges, 0.0).tolist()
        changes = [(_change(constants, k, run) - middle) * factor for k, factor in enumerate(factors)]
        # In one order on every processor, and without a second copy of all.
        square = np.zeros(len(middle))
        for correlated, change in zip(constants.correlation.tolist(), changes, strict=True):
            others = np.zeros(len(middle))
            for weight, other in zip(correlated, changes, strict=True):
                others += weight * other
            square += change * others
        found.append(square)
    spread = quantile(float(constants.degrees.min())) * math.sqrt(max(float(np.mean(np.concatenate(found))), 0.0))
    return spread if spread < FARTHEST * way else math.nan


def _nudge(constants: Constants, k: int, step: float) -> float:
    """By how much a constant is changed for what it does: its error, a twentieth of it at most; a delay by a tick."""
    if constants.names[k] == "delay":
        return max(float(constants.errors[k]), step)
    value = abs(float(constants.values[k]))
    return significant(min(float(constants.errors[k]), NUDGED * value) or NUDGED * value or 1.0)


def _change(constants: Constants, k: int, run: Run) -> Values:
    """The free run with a constant a little larger."""
    values = constants.values.copy()
    values[k] = significant(values[k] + _nudge(constants, k, run.step))
    return free_run(replace(constants, values=values), run)


def well_known_from(run: Run) -> int:
    """Samples at the begin whose velocity is not known well."""
    return min(max(4, round(0.006 / run.step)), len(run.position) // 4)


def free_run(constants: Constants, run: Run) -> Values:
    """A run in one piece, from its first well-known velocity on; a few samples shorter than the run."""
    begin = well_known_from(run)
    samples = len(run.position) - begin
    velocity = float(start_velocities(run)[begin])
    return Plant(constants, run.step).run(run.effort, begin, samples, float(run.position[begin]), velocity)


@dataclass(frozen=True, slots=True)
class ClosedLoop:
    """Errors of the simulation under the loops of the log."""

    rms: float  # and largest: error of the position [m] or [rad]
    largest: float  # [m] or [rad]
    relative: float  # and effort: norm of the error over that of the recording, of the position and of the effort
    effort: float
    duration: float  # simulated time over all logs [s]
    loops: Loops  # of the first log


def simulate_closed_loop(constants: Constants, seen: Sequence[Run], unseen: Sequence[Run]) -> ClosedLoop | None:
    """Follow the references of the parts that were not seen; None where a log shows no such loops."""
    found = [loops for run in seen if (loops := fit_loops(run)) is not None]
    if len(found) < len(seen):
        return None
    parts = [(loops, run) for loops, run in zip(found, unseen, strict=True) if len(run.position) > MEMORY]
    pairs = [(*_follow(constants, loops, run), run) for loops, run in parts]
    if not pairs:
        return None
    position = np.concatenate([q - run.position for q, _, run in pairs])
    effort = np.concatenate([u - run.effort for _, u, run in pairs])
    if not (np.isfinite(position).all() and np.isfinite(effort).all()):
        return None
    relative = _share(position, np.concatenate([run.position for *_, run in pairs]))
    share = _share(effort, np.concatenate([run.effort for *_, run in pairs]))
    duration = sum(float(run.t[-1]) for *_, run in pairs)
    return ClosedLoop(rms(position), float(np.abs(position).max()), relative, share, duration, found[0])


def _share(error: Values, signal: Values) -> float:
    size = float(np.linalg.norm(signal))
    return float(np.linalg.norm(error)) / size if size > 0.0 else math.nan


def _params(constants: Constants, loops: Loops, run: Run) -> cascade.CascadeParams:
    """Plant and loops; the velocity is the difference that the log's loops took."""
    p = plant_registers(constants)
    law, feed = p.controller.law, p.controller.law.feed_forward
    law.cascade.position_gain, law.cascade.velocity_gain = loops.position, loops.velocity
    law.cascade.integral_gain = loops.integral
    feed.velocity, feed.acceleration, feed.viscous = loops.feed_velocity, loops.feed_acceleration, loops.feed_viscous
    feed.coulomb_positive = feed.coulomb_negative = loops.feed_coulomb
    p.plant.source.delay = min(max(round(constants.value("delay") / run.step), 0), MEMORY - 1)
    p.controller.motor_sensor.span = loops.span
    cascade.set_count(p, run.resolution, 0.0)
    ticks = _ticks(p, run.step)
    cascade.fill_clocks(p, run.step / ticks, ticks)
    return p


def _start(p: cascade.CascadeParams, r: cascade.Cascade, loops: Loops, run: Run) -> None:
    """Where the log says the axis was, as fast, and with the integral that its effort shows."""
    velocity = float(start_velocities(run)[well_known_from(run)])
    place = float(run.position[0])
    cascade.switch_on(p, r, place)
    r.plant.machine.motor.velocity = r.plant.machine.load.velocity = velocity
    r.controller.motor_sensor.memory[:] = [place - (MEMORY - k) * velocity * run.step for k in range(MEMORY)]
    r.controller.motor_sensor.place = MEMORY - 1
    if loops.integral > 0.0 and run.reference is not None:
        speeds = np.gradient(run.reference[:8], run.step)
        demand = loops.position * (float(run.reference[0]) - place) + loops.feed_velocity * float(speeds[0])
        fed = loops.feed_viscous * float(speeds[0]) + loops.feed_coulomb * float(np.sign(speeds[0]))
        r.controller.law.integral = float(run.effort[0]) - loops.velocity * (demand - velocity) - fed


def _follow(constants: Constants, loops: Loops, run: Run) -> tuple[Values, Values]:
    """Position at each sample, and the effort commanded there."""
    p, r = _params(constants, loops, run), cascade.Cascade()
    _start(p, r, loops, run)
    reference = run.reference if run.reference is not None else run.position
    samples = len(run.position)
    rows = np.zeros((samples + 1, 16), np.uint8)
    every = p.controller.sample_ticks
    feed = cascade.along(reference, *motion_asked(run, reference))
    advance(p, r, samples * every, rows, _LOOP_PICKS, every, *feed)
    table = rows.view(np.float64)
    return np.concatenate([run.position[:1], table[1:samples, 0]]), table[1 : samples + 1, 1].copy()
