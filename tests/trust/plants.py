"""Random axes and runs for the trust test: what is true is known, what is recorded is not quite that.

A case is one number: axis, controller, excitation, noise and quantisation follow from it.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.signal import lfilter

from detent.kernel.loop import advance
from detent.methods.cascade.system import Cascade, CascadeParams, along, fill_clocks, set_count, switch_on
from detent.planning.profile import MotionLimits, Profile, plan_move, profile_of_recording

SUBSTEPS = 4
"""Ticks of the plant per sample."""

BAD = ("too short", "no reversal", "saturated", "wrong sign", "wrong unit", "constant speed", "stuck encoder")
"""What a log may be that must be refused."""


@dataclass(frozen=True)
class Case:
    """A log with the truth about it.

    Attributes
    ----------
    columns : dict
        Columns of the file, heading to values.
    truth : dict
        True constants by the names of the identification.
    bad : str
        Why the log must be refused; empty for a good one.
    """

    number: int
    columns: dict[str, np.ndarray]
    truth: dict[str, float]
    bad: str = ""


@dataclass(frozen=True)
class Axis:
    """Constants of a random axis; forces in N, `top` speed [m/s], `rise` acceleration [m/s^2]."""

    mass: float
    coulomb: tuple[float, float]
    viscous: tuple[float, float]
    static: tuple[float, float]
    stribeck: float
    offset: float
    top: float
    rise: float
    step: float
    resolution: float
    delay: int

    @property
    def effort(self) -> float:
        """Force of the acceleration [N]."""
        return self.mass * self.rise


def make_axis(rng: np.random.Generator) -> Axis:
    """A random axis."""
    mass = float(np.exp(rng.uniform(math.log(0.1), math.log(200.0))))
    top, rise = float(np.exp(rng.uniform(math.log(0.05), math.log(1.0)))), float(rng.uniform(0.8, 8.0))
    effort = mass * rise
    uneven = rng.uniform(0.75, 1.25, 4) if rng.random() < 0.5 else np.ones(4)
    coulomb, viscous = effort * rng.uniform(0.1, 0.6), effort / top * rng.uniform(0.05, 0.5)
    fc = (coulomb * uneven[0], coulomb * uneven[1])
    fv = (viscous * uneven[2], viscous * uneven[3])
    sticky = rng.uniform(1.2, 1.7) if rng.random() < 0.35 else 1.0
    step = 1.0 / float(rng.choice([500, 1000, 2000]))
    return Axis(
        mass=mass,
        coulomb=fc,
        viscous=fv,
        static=(fc[0] * sticky, fc[1] * sticky),
        stribeck=top * rng.uniform(0.03, 0.2) if sticky > 1.0 else 0.0,
        offset=float(coulomb * rng.uniform(-0.3, 0.3)),
        top=top,
        rise=rise,
        step=step,
        resolution=top * step / float(np.exp(rng.uniform(math.log(2.0), math.log(60.0)))),
        delay=int(rng.integers(0, 3)),
    )


def make_params(a: Axis, rng: np.random.Generator, limit: float = math.inf) -> CascadeParams:
    """Registers of the axis under a cascade of moderate bandwidth."""
    p = CascadeParams()
    p.plant.machine.motor.mass = a.mass
    f = p.plant.machine.motor.friction
    for k, d in enumerate((f.positive, f.negative)):
        d.coulomb, d.viscous, d.static, d.stribeck = a.coulomb[k], a.viscous[k], a.static[k], a.stribeck
    f.offset = a.offset
    p.plant.machine.winding.max_current = math.inf
    p.plant.source.gain, p.plant.source.limit, p.plant.source.delay = 1.0, limit, a.delay
    p.controller.law.max_command, p.controller.law.cascade.max_velocity = limit, math.inf
    band = 2 * math.pi * float(rng.uniform(8.0, 25.0))
    p.controller.law.cascade.position_gain, p.controller.law.cascade.velocity_gain = band / 4, band * a.mass
    p.controller.law.cascade.integral_gain = (
        p.controller.law.cascade.velocity_gain * band / 8 * float(rng.integers(0, 2))
    )
    p.controller.law.feed_forward.velocity = float(rng.integers(0, 2))
    span = max(1, round(2e-3 / a.step))
    for s in (p.controller.motor_sensor, p.controller.load_sensor):
        s.span, s.smoothing = span, 1.0
    set_count(p, a.resolution, a.resolution)
    fill_clocks(p, a.step / SUBSTEPS, SUBSTEPS)
    return p


def moves(a: Axis, rng: np.random.Generator, seconds: float, *, one_way: bool = False) -> np.ndarray:
    """Positions asked for by moves of random length, speed and acceleration, some with a dwell."""
    parts, place, length = [], 0.0, 0
    while length * a.step < seconds:
        speed = a.top * float(rng.choice([0.1, 0.25, 0.5, 0.75, 1.0]))
        way = speed * float(rng.uniform(0.2, 1.5))
        sign = 1.0 if one_way else -math.copysign(1.0, place) if place and rng.random() < 0.8 else rng.choice([-1, 1])
        rise = a.rise * rng.uniform(0.5, 1.0)
        jerk = math.inf if rng.random() < 0.5 else rise * 40.0
        part = plan_move(place, place + sign * way, MotionLimits(speed, rise, jerk), a.step).position
        dwell = round(float(rng.choice([0.0, 0.02, 0.3])) / a.step)
        parts += [part, np.full(dwell, part[-1])]
        place, length = float(part[-1]), length + len(part) + dwell
    return np.concatenate(parts)[: round(seconds / a.step)]


def multisine(a: Axis, rng: np.random.Generator, seconds: float) -> np.ndarray:
    """Positions asked for by sines of random phase whose speed and acceleration the axis reaches."""
    t = np.arange(round(seconds / a.step)) * a.step
    f = np.array([0.1, 0.3, 0.7, 1.1, 1.9, 3.1]) * rng.uniform(0.7, 1.3)
    phase = rng.uniform(0, 2 * math.pi, len(f))
    w = 2 * math.pi * f
    x = np.sin(np.outer(t, w) + phase) @ (1.0 / w**1.5)
    v, acc = np.gradient(x, a.step), np.gradient(np.gradient(x, a.step), a.step)
    x *= min(a.top / np.abs(v).max(), a.rise / np.abs(acc[5:-5]).max())
    return (x - x[0]) * np.minimum(t / 0.5, 1.0)


def record(p: CascadeParams, ref: Profile, start: float) -> dict[str, np.ndarray]:
    """Run along a reference; one row per sample: what the encoder read, and the command given then."""
    r = Cascade()
    switch_on(p, r, start)
    leaves = {leaf.path: leaf for leaf in Cascade.leaves()}
    names = ("controller.motor_sensor.position", "controller.law.command")
    offsets = [leaves[name].offset for name in names]
    picks = np.concatenate([np.arange(o, o + 8) for o in offsets]).astype(np.int64)
    rows = np.zeros((ref.count + 1, 16), np.uint8)
    every = p.controller.sample_ticks
    advance(p, r, ref.count * every, rows, picks, every, *along(ref.position, ref.velocity, ref.acceleration))
    table = rows.view(np.float64)[1 : ref.count + 1]
    return {"position": table[:, 0].copy(), "force": table[:, 1].copy()}


def coloured(rng: np.random.Generator, n: int, size: float, memory: float) -> np.ndarray:
    """Noise of a standard deviation, each value remembering its neighbour."""
    white = rng.normal(size=n + 500)
    noise: Any = lfilter([math.sqrt(1 - memory**2)], [1, -memory], white)
    return size * noise[500:]


def make_case(number: int, bad: str = "") -> Case:
    """The case of a number."""
    rng = np.random.default_rng([number, 20])
    a = make_axis(rng)
    seconds = float(rng.uniform(8.0, 25.0))
    if bad == "too short":
        seconds = float(rng.uniform(0.1, 0.6))
    if bad == "constant speed":
        t = np.arange(round(seconds / a.step)) * a.step
        wanted = a.top * rng.uniform(0.3, 1.0) * t
    elif bad == "no reversal" or rng.random() < 0.6:
        wanted = moves(a, rng, seconds, one_way=bad == "no reversal")
    else:
        wanted = multisine(a, rng, seconds)
    t = np.arange(len(wanted)) * a.step
    friction = max(a.static) + abs(a.offset)
    p = make_params(a, rng, 1.1 * friction if bad == "saturated" else math.inf)
    ref = profile_of_recording(t, wanted, a.step)
    made = record(p, ref, float(wanted[0]))
    n = min(len(made["force"]), len(t))
    t, wanted = t[:n], wanted[:n]
    if bad == "constant speed":  # the run-up is not part of the log
        first = round(1.0 / a.step)
        t, wanted, made = t[first:] - t[first], wanted[first:], {k: v[first:] for k, v in made.items()}
        n = len(t)
    position = made["position"][:n]
    jitter = a.resolution * float(rng.choice([0.0, 0.3]))
    position = a.resolution * np.round((position + jitter * rng.normal(size=n)) / a.resolution)
    memory = float(rng.choice([0.0, 0.6, 0.95]))
    force = made["force"][:n] + coloured(rng, n, a.effort * float(rng.uniform(0.003, 0.03)), memory)
    columns = {"t [s]": t, "position ref [m]": wanted, "position [m]": position, "force [N]": force}
    if bad:
        spoil(columns, bad, rng)
    return Case(number, columns, truth_of(a), bad)


def truth_of(a: Axis) -> dict[str, float]:
    """True constants; the offset is part of the Coulomb friction of both directions."""
    return {
        "mass": a.mass,
        "coulomb.positive": a.coulomb[0] + a.offset,
        "coulomb.negative": a.coulomb[1] - a.offset,
        "viscous.positive": a.viscous[0],
        "viscous.negative": a.viscous[1],
        "delay": a.delay * a.step,
    }


def spoil(columns: dict[str, np.ndarray], bad: str, rng: np.random.Generator) -> None:
    """Make a log what must be refused."""
    if bad == "wrong sign":
        columns["force [N]"] = -columns["force [N]"]
    if bad == "wrong unit":
        columns["position [m]"] = columns["position [m]"] * float(rng.choice([1000.0, 1e-3, 25.4, 1 / 25.4]))
    if bad == "stuck encoder":
        n = len(columns["t [s]"])
        first = int(rng.uniform(0.0, 0.3) * n)
        columns["position [m]"][first:] = columns["position [m]"][first]
    if bad == "saturated":
        force = columns["force [N]"]
        limit = np.quantile(np.abs(force), 0.3)
        columns["force [N]"] = np.clip(force, -limit, limit)
