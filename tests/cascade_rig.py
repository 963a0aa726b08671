"""A cascade axis on the bench: a linear axis of 2 kg driven by a force, recorded tick by tick."""

import math
import re
from collections.abc import Sequence
from functools import reduce
from typing import Any

import numpy as np

from detent.kernel.loop import advance
from detent.kernel.registers import Registers, single
from detent.methods.cascade.system import Cascade, CascadeParams, along, driven, fill_clocks, switch_on
from detent.planning.profile import Profile
from detent.plant.stribeck import StribeckFriction

STANDING = along(*np.zeros((3, 0)))
"""Feed of an axis whose reference stands in its registers."""

NO_TRACE = (np.zeros((1, 1), np.uint8), np.zeros(0, np.int64), 0)

TICK = 50e-6
SAMPLE_TICKS = 20
T_SAMPLE = TICK * SAMPLE_TICKS
"""Period of the loops [s]."""
MASS = 2.0
"""Motor and load together [kg]."""
STIFFNESS, DAMPING = 2e5, 20.0
"""Of the coupling, where there is one: masses of 0.8 kg and 1.2 kg swing at 103 Hz."""

BY_HAND = ("method.position_gain=40", "method.velocity_gain=100 V*s/m", "method.velocity_integral=5 kV/m")
"""Gains of the packaged example as overrides, before `tune` chose them: the specifications' figures are of these."""


def by_hand(text: str) -> str:
    """The text of the packaged example with these gains."""
    for name, value in (one.removeprefix("method.").split("=") for one in BY_HAND):
        said = f'"{value}"' if " " in value else value
        text, count = re.subn(rf"(?m)^{name} = .*$", f"{name} = {said}", text)
        assert count == 1
    return text


def set_friction(friction: StribeckFriction, **values: float) -> None:
    """Set constants of both directions (coulomb, static, stribeck, viscous), or the offset."""
    for name, value in values.items():
        if name == "offset":
            friction.offset = value
        else:
            setattr(friction.positive, name, value)
            setattr(friction.negative, name, value)


def unlimited_params() -> CascadeParams:
    """A rigid mass without friction, ideal sensors and a source of 1 N/V without a limit; no gains yet."""
    p = CascadeParams()
    p.plant.machine.motor.mass, p.plant.machine.load.mass = 0.4 * MASS, 0.6 * MASS
    p.plant.machine.winding.max_current = math.inf
    p.plant.source.gain, p.plant.source.limit = 1.0, math.inf
    p.controller.law.max_command = p.controller.law.cascade.max_velocity = math.inf
    p.controller.law.pid.smoothing = 1.0
    for sensor in (p.controller.motor_sensor, p.controller.load_sensor):
        sensor.span, sensor.smoothing = 1, 1.0
    fill_clocks(p, TICK, SAMPLE_TICKS)
    return p


def make_params(*, coupled: bool = False, gap: float = 0.0) -> CascadeParams:
    """The same with the gains of a position loop of 10 Hz over a velocity loop of 40 Hz."""
    p = unlimited_params()
    p.controller.law.cascade.position_gain = 2 * math.pi * 10
    p.controller.law.cascade.velocity_gain = 2 * math.pi * 40 * MASS
    if coupled:
        p.plant.machine.stiffness, p.plant.machine.damping, p.plant.machine.half_gap = STIFFNESS, DAMPING, gap / 2
    return p


def in_single(p: Registers) -> Any:
    """The same parameters of an axis whose controller computes in single precision."""
    made: Any = single(type(p))()
    for leaf in p.leaves():
        *blocks, last = leaf.path.split(".")
        to, of = reduce(getattr, blocks, made), reduce(getattr, blocks, p)
        value = getattr(of, last)
        if leaf.length:
            getattr(to, last)[:] = value[:]
        else:
            setattr(to, last, value)
    return made


class Rig:
    """The axis after power-on at a position [m]."""

    def __init__(self, p: CascadeParams, position: float = 0.0) -> None:
        self.p = p
        self.r = single(Cascade)() if type(p) is single(CascadeParams) else Cascade()
        switch_on(p, self.r, position)

    @property
    def x(self) -> float:
        """Position of the load [m]."""
        return self.r.plant.machine.load.position

    def run(self, ticks: int) -> "Rig":
        """Let ticks pass."""
        assert advance(self.p, self.r, ticks, *NO_TRACE, *STANDING) == ticks
        return self

    def drive(self, command: Sequence[float] | np.ndarray, ticks: int) -> "Rig":
        """Let ticks pass under commands from the host, one per sample."""
        values = np.asarray(command, np.float64)
        assert advance(self.p, self.r, ticks, *NO_TRACE, *driven(values)) == ticks
        return self

    def record(self, ticks: int, names: Sequence[str], every: int = 1, **feed: Any) -> dict[str, np.ndarray]:
        """Run and record registers every so many ticks (values at the end of a tick), with `t` [s] since power-on.

        `feed` is a `profile` to follow or a `command` per sample; without, the reference stands.
        """
        leaves = {leaf.path: leaf for leaf in type(self.r).leaves()}
        chosen = [leaves[name] for name in names]
        picks = np.concatenate([np.arange(c.offset, c.offset + c.width.size) for c in chosen]).astype(np.int64)
        dtype: Any = np.dtype([(c.path, "<" + c.width.code) for c in chosen])
        first = self.r.tick
        rows = np.zeros((ticks // every + 2, dtype.itemsize), np.uint8)
        laid = STANDING
        if "profile" in feed:
            ref: Profile = feed["profile"]
            laid = along(ref.position, ref.velocity, ref.acceleration)
        elif "command" in feed:
            laid = driven(np.asarray(feed["command"], np.float64))
        advance(self.p, self.r, ticks, rows, picks, every, *laid)
        index = np.arange(first // every + 1, self.r.tick // every + 1)
        table = rows[index % len(rows)].view(dtype)[:, 0]
        t = index * every * self.p.plant.machine.period
        return {name: table[name].copy() for name in names} | {"t": t}
