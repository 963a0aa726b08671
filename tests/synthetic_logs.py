"""Recordings of simulated axes: clean ones of many kinds, and the faults that are put into them."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from detent.errors import InputError
from detent.logs.log import Log
from detent.logs.read_log import read_log

HEADINGS = {
    "time": "t [s]",
    "reference": "reference [m]",
    "position": "position [m]",
    "position_load": "load position [m]",
    "velocity": "velocity [m/s]",
    "acceleration": "acceleration [m/s^2]",
    "force": "force [N]",
    "current": "current [A]",
    "voltage": "voltage [V]",
    "command": "pwm",
    "temperature": "temperature [degC]",
}


@dataclass
class Recording:
    """A recording: numbers by roles, in the units of `HEADINGS`, and the true motion they come from."""

    columns: dict[str, np.ndarray]
    about: str = ""
    headings: dict[str, str] = field(default_factory=lambda: dict(HEADINGS))

    @property
    def count(self):
        return len(self.columns["time"])

    def rows_of(self, order=None):
        """Rows as lists of texts."""
        names = order or list(self.columns)
        texts = ([repr(value) for value in self.columns[name].astype(np.float64).tolist()] for name in names)
        return [list(row) for row in zip(*texts, strict=True)]

    def text(self, rows=None):
        """The recording as CSV, with other rows than its own where they are given."""
        lines = [",".join(self.headings[name] for name in self.columns)]
        return "\n".join(lines + [",".join(row) for row in (self.rows_of() if rows is None else rows)]) + "\n"

    def read(self, folder, rows=None, options=()) -> Log:
        path = folder / "log.csv"
        path.write_text(self.text(rows), encoding="utf-8")
        return read_log(path, options=options)


def trapezoids(rng, t):
    """Moves to random places with limited speed and acceleration, rests between them."""
    v_max, a_max = 1.0, rng.uniform(3.0, 10.0)
    x = np.zeros_like(t)
    at, now, span = 0.0, 0.0, t[-1]
    while now < span:
        now += rng.uniform(0.02, 0.1) * span
        way = rng.uniform(-1.0, 1.0) * 0.15 * span
        ramp = min(v_max / a_max, np.sqrt(abs(way) / a_max))
        cruise = abs(way) / (a_max * ramp) - ramp if ramp else 0.0
        s = np.clip(t - now, 0.0, 2 * ramp + cruise)
        up = np.minimum(s, ramp)
        flat = np.clip(s - ramp, 0.0, cruise)
        down = np.clip(s - ramp - cruise, 0.0, ramp)
        x += np.sign(way) * (0.5 * a_max * up**2 + a_max * ramp * flat + a_max * ramp * down - 0.5 * a_max * down**2)
        now += 2 * ramp + cruise
        at += way
    return x


def sines(rng, t):
    """Several sines of low frequencies."""
    span = t[-1]
    x = np.zeros_like(t)
    for _ in range(int(rng.integers(1, 6))):
        x += rng.uniform(0.2, 1.0) * np.sin(2 * np.pi * rng.uniform(2.0, 25.0) / span * t + rng.uniform(0, 6.3))
    return x


def chirp(rng, t):
    """A sine of rising frequency."""
    low, high = rng.uniform(1.0, 3.0) / t[-1], rng.uniform(10.0, 40.0) / t[-1]
    return np.sin(2 * np.pi * (low * t + 0.5 * (high - low) / t[-1] * t**2)) * rng.uniform(0.5, 2.0)


def wander(rng, t):
    """Smoothed noise."""
    width = max(10, len(t) // int(rng.integers(15, 60)))
    kernel = np.hanning(width)
    return np.convolve(rng.normal(size=len(t) + 2 * width), kernel / kernel.sum(), "same")[width:-width] * width**0.5


MOTIONS = (trapezoids, sines, chirp, wander)


def clean(seed: int, count: int | None = None) -> Recording:
    """A clean recording of an axis: motion, rate, noise, resolution and signals at random."""
    rng = np.random.default_rng(seed)
    n = count or int(rng.integers(400, 3000))
    dt = 10 ** rng.uniform(-3.7, -1.7)
    t = np.arange(n) * dt
    is_even = rng.random() < 0.6
    if not is_even:
        t = t + rng.uniform(-0.02, 0.02, n) * dt * rng.choice([1.0, 8.0])
    motion = MOTIONS[int(rng.integers(len(MOTIONS)))]
    reference = motion(rng, t - t[0])
    scale = 10 ** rng.uniform(-3, 0.3) / max(np.ptp(reference), 1e-9)
    reference = reference * scale
    delay = rng.uniform(0.0, 6.0) * dt
    x = np.interp(t - delay, t, reference)
    width = int(rng.integers(3, 12))
    x = np.convolve(np.pad(x, (width, 0), mode="edge"), np.ones(width) / width, "valid")[:n]  # a causal following loop
    v = np.gradient(x, t)
    a = np.gradient(v, t)
    columns: dict[str, Any] = {"time": t if rng.random() < 0.8 else np.round(t, 9), "reference": reference}
    grid = np.ptp(x) / 10 ** rng.uniform(2.5, 5.5)
    columns["position"] = np.round(x / grid) * grid
    noise = rng.uniform(0.0, 0.02) * np.std(v)
    kind = rng.integers(4)
    if kind == 0:
        columns["velocity"] = v + rng.normal(0, noise + 1e-12, n)
    elif kind == 1:
        quantum = np.ptp(v) / 10 ** rng.uniform(1.5, 3.5)
        columns["velocity"] = np.round(v / quantum) * quantum
    elif kind == 2:
        columns["velocity"] = np.gradient(columns["position"], t)
    mass, viscous, coulomb = rng.uniform(0.5, 5), rng.uniform(0, 3), rng.uniform(0, 2)
    force = mass * a / np.std(a) + viscous * v / np.std(v) + coulomb * np.tanh(v / (0.02 * np.max(np.abs(v))))
    force += rng.uniform(-1, 1) if rng.random() < 0.3 else 0.0
    force += rng.normal(0, rng.uniform(0.01, 0.3), n)
    if rng.random() < 0.7:
        columns["force"] = force
    if rng.random() < 0.5:
        step = np.ptp(force) / 2 ** rng.integers(7, 14)
        columns["current"] = np.round(force / step) * step * 0.3
    if rng.random() < 0.3:
        columns["voltage"] = force * 0.5 + 3 * v / np.std(v)
    if rng.random() < 0.3:
        columns["command"] = np.round(np.clip((force * 0.5 + 3 * v / np.std(v)) * 8, -255, 255))
    if rng.random() < 0.3:
        columns["position_load"] = np.round((x + rng.normal(0, grid, n)) / grid) * grid
    if rng.random() < 0.2:
        columns["temperature"] = np.round(25 + 10 * (1 - np.exp(-t / t[-1])), 1)
    return Recording(columns, f"{motion.__name__}, {n} rows of {dt:.2g} s, even: {is_even}")


def serious(log: Log):
    """Findings that are more than a note."""
    return [finding for finding in log.findings if finding.severity != "note"]


def kinds(log: Log):
    return [(str(finding.kind), finding.signal) for finding in serious(log)]


def refused(path, options=()):
    try:
        read_log(path, options=options)
    except InputError as error:
        return error.problems
    raise AssertionError(f"{path} was read")
