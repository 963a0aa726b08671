"""An axis with identified constants, simulated along a log: the test that no residual replaces.

The axis gets the recorded effort and nothing else; its loops are open, so that every error of the constants adds up.
From many moments of the log it starts where the log says the axis was, and runs for a horizon: a sample, a second, to
the end. The same compiled blocks move it as in every other simulation.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from detent.identify.fit import Report, untold
from detent.identify.fit.constants import Constants, hanging_position
from detent.identify.fit.equations import fine_kernel
from detent.identify.fit.estimate import rms
from detent.identify.fit.prepare import Run
from detent.identify.fit.weights import make_kernel
from detent.kernel.loop import advance
from detent.logs.log import Values
from detent.methods.cascade.system import MAX_RATE, Cascade, CascadeParams, driven, fill_clocks, switch_on
from detent.plant.two_mass import fastest_rate
from detent.record.recorder import byte_places, choose_leaves

HORIZONS = (0.1, 0.5, 1.0, 2.0)  # lengths of simulated stretches [s]
SUBSTEPS = 4  # ticks of the plant per sample of the log
MOST_STARTS = 60  # stretches simulated per horizon at most, evenly spread over the log


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


class Plant:
    """An axis with identified constants that can be run along a log."""

    def __init__(self, constants: Constants, step: float) -> None:
        p = plant_registers(constants)
        self.ticks = max(SUBSTEPS, math.ceil(fastest_rate(p.plant.machine) * step / MAX_RATE))
        fill_clocks(p, step / self.ticks, 1)
        self._params = p
        self._late = round(constants.value("delay") / step * self.ticks)
        self._hanging = hanging_position(constants)
        self._step = step

    def run(self, effort: Values, begin: int, samples: int, position: float, velocity: float) -> Values:
        """Positions at samples under a recorded effort, loops open."""
        r = Cascade()
        switch_on(self._params, r, position - self._hanging)
        r.plant.machine.motor.velocity = r.plant.machine.load.velocity = velocity
        ticks = (samples - 1) * self.ticks
        at = np.arange(ticks) + begin * self.ticks - self._late
        command = effort[np.clip(at // self.ticks, 0, len(effort) - 1)]
        rows = np.zeros((samples, 8), np.uint8)
        advance(self._params, r, ticks, rows, _PICKS, self.ticks, *driven(command))
        moved = rows.view(np.float64)[:, 0] + self._hanging
        moved[0] = position
        return moved


def plant_registers(constants: Constants) -> CascadeParams:
    """Registers of a plant that is driven by the effort itself."""
    p = CascadeParams()
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


_PICKS = byte_places(choose_leaves(Cascade, ["plant.machine.motor.position"]))


def start_velocities(run: Run) -> Values:
    """Velocity at every sample, as a simulation starts with it."""
    return fine_kernel(make_kernel(max(4, round(0.02 / run.step)), run.step)).velocities(run.position)


def simulate_horizons(constants: Constants, runs: Sequence[Run], report: Report = untold) -> tuple[Horizon, ...]:
    """Errors over a sample, over each of `HORIZONS`, and to the end."""
    found: list[Horizon] = []
    step = runs[0].step
    named = [(1, "one step"), *((round(h / step), f"{h:g} s") for h in HORIZONS)]
    for k, (samples, name) in enumerate(named):
        if samples < 1 or (samples == 1 and name != "one step"):
            continue
        made = [_stretches(constants, run, samples) for run in runs if len(run.position) > samples + 2]
        rows = np.concatenate(made) if made else np.empty((0, 3))
        if len(rows):
            found.append(_horizon(name, samples * step, rows))
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


def _horizon(name: str, duration: float, rows: Values) -> Horizon:
    error, way, naive = rows.T
    return Horizon(duration, name, len(rows), rms(error), float(np.abs(error).max()), rms(way), rms(naive))


def _free_run(constants: Constants, runs: Sequence[Run]) -> Horizon:
    """The whole of each run in one piece."""
    errors: list[Values] = []
    ways: list[Values] = []
    naive: list[Values] = []
    for run in runs:
        velocity = float(start_velocities(run)[well_known_from(run)])
        cut = run.part(well_known_from(run), len(run.position))
        q = cut.position
        errors.append(free_run(constants, run) - q)
        ways.append(q - q[0])
        naive.append(q[0] + velocity * cut.t - q)
    error = np.concatenate(errors)
    duration = max(run.t[-1] for run in runs)
    largest = float(np.abs(error).max())
    return Horizon(
        duration, "free run", len(runs), rms(error), largest, rms(np.concatenate(ways)), rms(np.concatenate(naive))
    )


def well_known_from(run: Run) -> int:
    """Samples at the begin whose velocity is not known well."""
    return min(max(4, round(0.006 / run.step)), len(run.position) // 4)


def free_run(constants: Constants, run: Run) -> Values:
    """A run in one piece, from its first well-known velocity on; a few samples shorter than the run."""
    begin = well_known_from(run)
    samples = len(run.position) - begin
    velocity = float(start_velocities(run)[begin])
    return Plant(constants, run.step).run(run.effort, begin, samples, float(run.position[begin]), velocity)
