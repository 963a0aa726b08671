"""What gains are compared by: a push and a step, simulated, and what the loops make of forces and counts.

    stiffness = G K_i K_p        compliance = max |x / F|        noise = q / sqrt(12) |H|_2

G : force per command        x, F : place of the load, force on it        q : travel per count
H : from what an encoder reads to the command; a count is off by anything within it, evenly, from sample to sample
"""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from detent.analysis.linear_system import LinearSystem
from detent.methods.cascade.build import build_cascade
from detent.methods.cascade.derive import CascadeFigures, grain
from detent.methods.cascade.host import cascade_registers
from detent.methods.cascade.run import run_cascade_moves
from detent.methods.cascade.schema import CascadeSpec, DisturbanceTable, LoadPushTable
from detent.methods.moves.job import MoveJob, one_move
from detent.methods.tuning import Response
from detent.record.recorder import Recorder
from detent.units import format_quantity

Numbers = NDArray[np.float64]

PUSH = 1.0 / 3.0  # of the largest force
AT, LASTS, AFTER = 0.2, 0.4, 0.2  # when the push begins, how long it lasts, and what is seen of its end [s]
BEFORE = 0.02  # of the time at rest before it, that is shown [s]
BACK = 0.1  # of the in-position window, within which the axis is back, or a count
SMALL = 0.25  # of the largest command, that a step asks for at once
DOUBLINGS = 40  # of the samples that an encoder's error is followed
TIMES = 12.0  # time constants of the position loop, that are seen of a step

SHARES = "velocity", "acceleration", "viscous", "coulomb"  # of feedforward; the weight is held all the same
LOAD, ERROR = "plant.machine.load.position", "controller.law.position_error"


def loop_figures(spec: CascadeSpec) -> Iterator[tuple[str, str]]:
    """Figures of the loops, by name."""
    figures, method = CascadeFigures(spec), spec.method
    integral = method.integral if method.structure == "pid" else method.velocity_integral * method.position_gain
    stiffness = spec.effort_per_command * integral
    yield "integral stiffness", format_quantity(stiffness, spec.unit("N") + "/(" + spec.unit("m") + "*s)", 3)
    if figures.loop.spectral_radius >= 1.0:
        return
    level, at = figures.loop.open_loop("load").peak
    compliance = format_quantity(level, spec.unit("m") + "/" + spec.unit("N"), 3)
    yield "largest compliance", f"{compliance} at {format_quantity(at, 'Hz', 3)}"
    yield "command noise of counts", format_quantity(count_noise(figures), "V", 3) + " rms"
    yield "steady following error", format_quantity(figures.following_error, spec.unit("m"), 3)


def count_noise(figures: CascadeFigures) -> float:
    """Root mean square of the command for encoders that are off by anything within a count [V]."""
    found = 0.0
    for cut, sensor in figures.loop.sensors.items():
        found += sensor.resolution**2 / 12.0 * _power(figures.loop.open_loop(cut))
    return math.sqrt(found)


def _power(system: LinearSystem) -> float:
    """Mean square of what comes out for white noise of 1 that goes in: its moves sum up, twice as many each time."""
    moved, states = system.a, system.b @ system.b.T
    for _ in range(DOUBLINGS):
        states, moved = states + moved @ states @ moved.T, moved @ moved
    return float((system.c @ states @ system.c.T + system.d @ system.d.T)[0, 0])


def responses(spec: CascadeSpec) -> tuple[Response, Response]:
    """A push on the load at rest, and a step of the reference."""
    return _pushed(spec), _stepped(spec)


def _pushed(spec: CascadeSpec) -> Response:
    """A third of the largest force on the load."""
    force, unit = PUSH * spec.largest_effort, spec.unit("m")
    push = LoadPushTable.model_construct(force=force, at=AT, duration=LASTS)
    # Its guard takes a push that it stands against for a blocked axis: that is no matter of the gains.
    pushes = DisturbanceTable.model_construct(push=push)
    made = spec.changed(disturbance=pushes, protection={"stuck_time": 0.0})
    t, place, failure = _simulated(made, one_move("push", 0.0, AT + LASTS + AFTER), LOAD)
    t -= AT
    place -= place[np.searchsorted(t, 0.0) - 1]
    during = (t > 0.0) & (t < LASTS)
    within = max(BACK * spec.method.in_position, grain(spec))
    away = t[during & (np.abs(place) > within)]
    far, near = (format_quantity(one, unit, 3) for one in (float(np.abs(place[during]).max(initial=0.0)), within))
    after = format_quantity(float(away[-1]), "s", 3) if len(away) else "0 s"
    back = f"within {near} after {after}" if not len(away) or away[-1] < 0.98 * LASTS else f"not back within {near}"
    name = f"push of {format_quantity(force, spec.unit('N'), 3)}"
    shown = t >= -BEFORE
    return Response(name, "load is pushed off by", t[shown], place[shown], {name: failure or f"{far}, {back}"})


def _stepped(spec: CascadeSpec) -> Response:
    """A step of the reference without feedforward, so small that the command is not limited."""
    method, period = spec.method, spec.method.sample_period
    gain = method.proportional if method.structure == "pid" else method.position_gain * method.velocity_gain
    step = min(SMALL * spec.largest_command / gain, 0.5 * method.following_error, 0.1 * spec.limits.travel)
    speed = max(spec.limits.speed, step / period)
    made = spec.changed(
        limits={"speed": speed, "acceleration": 4.0 * speed / period, "jerk": None},
        method={"feed_forward": method.feed_forward.model_copy(update=dict.fromkeys(SHARES, 0.0))},
    )
    slowest = TIMES / method.position_gain if method.structure == "cascade" else LASTS
    way = step if spec.mechanics.start_position < spec.limits.lowest + 0.5 * spec.limits.travel else -step
    t, place, failure = _simulated(made, one_move("step", way, min(max(slowest, 0.05), 2.0)), LOAD)
    begun = np.flatnonzero(np.abs(place - place[0]) > 1e-3 * step)
    t -= t[max(begun[0] - 1, 0)] if len(begun) else t[-1]
    shown, seen = t >= -0.02 * slowest, (place - place[0]) / way * step
    over = max(float(seen.max()) / step - 1.0, 0.0)
    far = format_quantity(step, spec.unit("m"), 3)
    told = {"step, no feedforward": failure or f"{far}, and {100 * over:.2g} % beyond it"}
    name = "step of the reference, without feedforward"
    return Response(name, "load, as a share of its way", t[shown], seen[shown] / step, told, share=True)


def followed(spec: CascadeSpec, job: MoveJob) -> Response:
    """Error of the position loop during a job, from power-on."""
    t, error, _ = _simulated(spec, job, ERROR)
    return Response(job.name, "position error", t, error)


def _simulated(spec: CascadeSpec, job: MoveJob, name: str) -> tuple[Numbers, Numbers, str]:
    """Time from power-on [s] and a register sample by sample, and in a few words what went wrong."""
    params, registers = build_cascade(spec), cascade_registers(spec)
    tick = params.plant.machine.period
    recorder = Recorder(registers, [name], every=round(spec.method.sample_period / tick), period=tick)
    result = run_cascade_moves(spec, job, recorder=recorder)
    trace = recorder.trace()
    return np.array(trace["t"]), np.array(trace[name]), "" if result.done else "the guard switches it off"
