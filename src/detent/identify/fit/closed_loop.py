"""An axis with identified constants under the loops that a log shows, following the log's reference.

Loops hide errors of the constants in the position, and show them in the effort; both are stated. The loops are those
that `loop_fit` finds in the first part of the log; a log whose effort they do not explain is not simulated so.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from detent.identify.fit.constants import Constants
from detent.identify.fit.estimate import rms
from detent.identify.fit.free_run import plant_registers, start_velocities, well_known_from
from detent.identify.fit.loop_fit import Loops, fit_loops
from detent.identify.fit.prepare import Run
from detent.kernel.loop import advance
from detent.logs.log import Values
from detent.methods.cascade.system import MAX_RATE, Cascade, CascadeParams, along, fill_clocks, set_count, switch_on
from detent.planning.profile import profile_of_recording
from detent.plant.two_mass import fastest_rate
from detent.record.recorder import byte_places, choose_leaves
from detent.sensing.position_sensor import MEMORY

_PICKS = byte_places(choose_leaves(Cascade, ["plant.machine.motor.position", "controller.law.command"]))
SUBSTEPS = 4  # ticks of the plant per sample of the log


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
    found = [fit_loops(run) for run in seen]
    if any(loops is None for loops in found):
        return None
    pairs: list[tuple[Values, Values, Run]] = []
    for loops, run in zip(found, unseen, strict=True):
        if loops is not None and len(run.position) > MEMORY:
            pairs.append((*_follow(constants, loops, run), run))
    if not pairs or found[0] is None:
        return None
    position = np.concatenate([q - run.position for q, _, run in pairs])
    effort = np.concatenate([u - run.effort for _, u, run in pairs])
    if not (np.isfinite(position).all() and np.isfinite(effort).all()):
        return None
    return ClosedLoop(
        rms=rms(position),
        largest=float(np.abs(position).max()),
        relative=_share(position, np.concatenate([run.position for *_, run in pairs])),
        effort=_share(effort, np.concatenate([run.effort for *_, run in pairs])),
        duration=sum(float(run.t[-1]) for *_, run in pairs),
        loops=found[0],
    )


def _share(error: Values, signal: Values) -> float:
    size = float(np.linalg.norm(signal))
    return float(np.linalg.norm(error)) / size if size > 0.0 else math.nan


def _params(constants: Constants, loops: Loops, run: Run) -> CascadeParams:
    """Plant and loops; the velocity is the difference that the log's loops took."""
    p = plant_registers(constants)
    law, feed = p.controller.law, p.controller.law.feed_forward
    law.cascade.position_gain, law.cascade.velocity_gain = loops.position, loops.velocity
    law.cascade.integral_gain = loops.integral
    feed.velocity, feed.acceleration, feed.viscous = loops.feed_velocity, loops.feed_acceleration, loops.feed_viscous
    feed.coulomb_positive = feed.coulomb_negative = loops.feed_coulomb
    p.plant.source.delay = min(max(round(constants.value("delay") / run.step), 0), MEMORY - 1)
    p.controller.motor_sensor.span = loops.span
    set_count(p, run.resolution, 0.0)
    ticks = max(SUBSTEPS, math.ceil(fastest_rate(p.plant.machine) * run.step / MAX_RATE))
    fill_clocks(p, run.step / ticks, ticks)
    return p


def _start(p: CascadeParams, r: Cascade, loops: Loops, run: Run) -> None:
    """Where the log says the axis was, as fast, and with the integral that its effort shows."""
    velocity = float(start_velocities(run)[well_known_from(run)])
    place = float(run.position[0])
    switch_on(p, r, place)
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
    p, r = _params(constants, loops, run), Cascade()
    _start(p, r, loops, run)
    reference = run.reference if run.reference is not None else run.position
    asked = profile_of_recording(run.t, reference, run.step)
    samples = len(run.position)
    rows = np.zeros((samples + 1, 16), np.uint8)
    every = p.controller.sample_ticks
    feed = along(asked.position, asked.velocity, asked.acceleration)
    advance(p, r, samples * every, rows, _PICKS, every, *feed)
    table = rows.view(np.float64)
    return np.concatenate([run.position[:1], table[1:samples, 0]]), table[1 : samples + 1, 1].copy()
