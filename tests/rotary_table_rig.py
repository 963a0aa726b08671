"""A rotary table on the bench: the default plant of specification 7, jogged and positioned, recorded tick by tick."""

import math
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from detent.control.table_positioner import POWER_ON, SHORTEST, TURN_COUNTER, Positioner, PositionerParams, interrupt
from detent.kernel.loop import advance
from detent.methods.rotary_table.system import TICK, RotaryTable, RotaryTableParams, switch_on
from detent.plant.rotary_motor import fill_motor
from detent.sensing.resolver_counter import CompositionParams

NO_TRACE = (np.zeros((1, 1), np.uint8), np.zeros(0, np.int64), 0)

RATIO, FINE, COARSE = 90, 4096, 4096
T = RATIO * FINE
"""Period [count]."""
COUNT = 360.0 / T
"""One count [deg]."""
INTERRUPT = 2e-3
"""Period of the interrupt [s]."""
KP = 30.0
LAG = 20e-3
"""Time constant of the velocity loop [s]."""
INERTIA = 1e-3
"""Of all that turns, at the motor [kg m^2]; only its ratio to the stiffness matters."""
F = 16
ONE = 1 << F
"""One count in 32.16 format."""

FINE_DAC = (32767, 180.0)
"""Reference: words of 16 bits up to the 180 deg/s of the model."""
DAC_12 = (2047, 400.0 / 3)
"""12 bits up to the 133.3 deg/s of the motor."""


def speed_word(deg_per_s: float, fraction: int = F) -> int:
    """Speed per interrupt in the interpolator's format."""
    return round(deg_per_s / COUNT * INTERRUPT * (1 << fraction))


def fill_composition(p: CompositionParams) -> None:
    """Sizes of the default detector."""
    p.ratio, p.fine, p.coarse = RATIO, FINE, COARSE


def fill_positioner(
    p: PositionerParams, *, kp: float = KP, dac: tuple[int, float] = FINE_DAC, fraction: int = F
) -> None:
    """Defaults of specification 7; `dac` is the largest word and its table speed [deg/s]."""
    per_word = dac[1] / dac[0]
    p.angle.period = T
    p.interpolator.fraction = fraction
    p.interpolator.acceleration = round(300.0 / COUNT * INTERRUPT**2 * (1 << fraction))
    p.interpolator.max_speed = speed_word(400.0 / 3, fraction)
    p.gain = kp * COUNT / (1 << fraction) / per_word
    p.speed_gain = COUNT / (1 << fraction) / INTERRUPT / per_word
    p.max_word = dac[0]
    p.window, p.window_interrupts = 2, 10


def make_params(
    *,
    kp: float = KP,
    dac: tuple[int, float] = FINE_DAC,
    droop: float = 0.0,
    fraction: int = F,
    max_torque: float = math.inf,
) -> RotaryTableParams:
    """The default plant; `droop` is the share of its reference by which the velocity stays behind."""
    p = RotaryTableParams()
    p.controller.clocks.strobe_ticks, p.controller.clocks.delay_ticks, p.controller.clocks.task_ticks = 20, 2, 200
    p.plant.fine.counts, p.plant.coarse.counts = FINE, COARSE
    fill_composition(p.controller.composition)
    fill_positioner(p.controller.positioner, kp=kp, dac=dac, fraction=fraction)
    a, m = p.plant.amplifier, p.plant.train.motor
    total = INERTIA / LAG
    m.inertia, m.viscous, m.period = INERTIA, droop * total, TICK
    a.stiffness, a.max_torque = (1.0 - droop) * total, max_torque
    a.speed_per_count = math.radians(dac[1] / dac[0]) * RATIO
    fill_motor(m, a.stiffness)
    p.plant.train.gear.ratio = p.plant.train.reduction.ratio = RATIO
    return p


class Rig:
    """The axis in HOLD; angles in degrees of the table, time in seconds from the pass at `START` ticks after power-on.

    Keywords that `make_params` does not know are fields of the positioner's parameters, of its `angle` for the form.
    """

    START = 200

    def __init__(
        self,
        place: float = 0.0,
        *,
        task_at: int = 0,
        seed: int = 1,
        noise: float = 0.0,
        form: int = TURN_COUNTER,
        **changes: Any,
    ) -> None:
        known = {k: changes.pop(k) for k in ("kp", "dac", "droop", "fraction", "max_torque") if k in changes}
        self.p, self.r = make_params(**known), RotaryTable()
        self.p.controller.positioner.angle.form = form
        self.p.plant.fine.noise = noise * 2**32 / FINE
        for name, value in changes.items():
            assert name in PositionerParams.__fields__, name
            setattr(self.p.controller.positioner, name, value)
        self.turns = (math.floor(place / COUNT + 1e-6) + 0.5) / FINE
        switch_on(self.p, self.r, self.turns, task_at, seed)
        self.positioner, self.angle, self.interpolator = (
            self.r.controller.positioner,
            self.r.controller.positioner.angle,
            self.r.controller.positioner.interpolator,
        )
        self.fraction = 1 << self.p.controller.positioner.interpolator.fraction
        self.run_ticks(self.START)

    # ------------------------------------------------------------------------------------------ what is seen

    @property
    def time(self) -> float:
        """Since the end of the first 20 ms [s]."""
        return (self.r.tick - self.START) * TICK

    @property
    def travel(self) -> float:
        """True way of the motor since power-on, at the table [deg]."""
        m = self.r.plant.train.motor
        return (m.turns - self.turns + m.angle / (2 * math.pi)) * 360.0 / RATIO

    @property
    def speed(self) -> float:
        """Velocity of the motor, at the table [deg/s]."""
        return math.degrees(self.r.plant.train.motor.velocity) / RATIO

    @property
    def detected(self) -> float:
        """D [deg]."""
        return self.angle.dar * COUNT

    @property
    def present(self) -> float:
        """R [deg]."""
        return self.angle.aar * COUNT

    @property
    def theoretical(self) -> float:
        """IR [deg]."""
        return self.interpolator.irr / self.fraction * COUNT

    @property
    def actual(self) -> float:
        """AR [deg], as it is now."""
        return self.positioner.z * (self.positioner.oar - self.angle.aar) * COUNT

    @property
    def command(self) -> float:
        """C, the interpolated target [deg]."""
        return self.positioner.oar * COUNT - self.positioner.z * self.theoretical

    @property
    def target(self) -> float:
        """M [deg]."""
        return self.positioner.oar * COUNT

    @property
    def deviation(self) -> float:
        """Deviation dR of the last interrupt [deg]."""
        return self.positioner.dr / self.fraction * COUNT

    @property
    def s4(self) -> float:
        """Speed signal S4 [deg/s]."""
        return self.positioner.s4 * self.word

    @property
    def word(self) -> float:
        """Table speed per count of S4 [deg/s]."""
        return math.degrees(self.p.plant.amplifier.speed_per_count) / RATIO

    # ------------------------------------------------------------------------------------------ what is done

    def run_ticks(self, ticks: int) -> None:
        """Let ticks pass, whatever the axis says."""
        left = ticks
        while left > 0:
            left -= advance(self.p, self.r, left, *NO_TRACE)
            self.positioner.event = 0

    def run_until(self, seconds: float) -> "Rig":
        """Let time pass up to a moment, its tick not included [s]."""
        self.run_ticks(round(seconds / TICK) + self.START - self.r.tick)
        return self

    def press(self, sign: int, speed: float = 60.0) -> "Rig":
        """Hold the + or - button down; the dial in deg/s."""
        self.positioner.dial = speed_word(speed, self.p.controller.positioner.interpolator.fraction)
        self.positioner.plus, self.positioner.minus = sign > 0, sign < 0
        return self

    def release(self) -> "Rig":
        """No button."""
        self.positioner.plus = self.positioner.minus = 0
        return self

    def entry(self, number: int, angle: float, speed: float = 60.0, policy: int = SHORTEST) -> "Rig":
        """Write an entry of the position table; angle in deg, speed in deg/s."""
        pdt = self.p.controller.positioner.pdt
        pdt.angle[number], pdt.speed[number], pdt.policy[number] = round(angle / COUNT), speed_word(speed), policy
        pdt.entries = max(pdt.entries, number + 1)
        return self

    def go(self, number: int) -> "Rig":
        """Start a positioning."""
        self.positioner.number, self.positioner.start = number, 1
        return self

    def record(self, until: float, names: Sequence[str], every: int = 20) -> dict[str, np.ndarray]:
        """Run and record registers every so many ticks, with `t` [s]; the row at t shows the tick before it."""
        picks, dtype = pick(tuple(names))
        first = self.r.tick
        left = round(until / TICK) + self.START - first
        rows = np.zeros((left // every + 2, dtype.itemsize), np.uint8)
        while left > 0:
            left -= advance(self.p, self.r, left, rows, picks, every)
            self.positioner.event = 0
        index = np.arange(first // every + 1, self.r.tick // every + 1)
        table = rows[index % len(rows)].view(dtype)[:, 0]
        return {name: table[name].copy() for name in names} | {"t": (index * every - self.START) * TICK}


@cache
def pick(names: tuple[str, ...]) -> tuple[np.ndarray, Any]:
    """Byte offsets of registers and the type of a row of them."""
    leaves = {leaf.path: leaf for leaf in RotaryTable.leaves()}
    chosen = [leaves[name] for name in names]
    picks = np.concatenate([np.arange(c.offset, c.offset + c.width.size) for c in chosen]).astype(np.int64)
    return picks, np.dtype([(c.path, "<" + c.width.code) for c in chosen])


class PositionerBench:
    """The positioner alone, fed with detected angles by hand; angles in counts."""

    def __init__(self, d: int, *, form: int = TURN_COUNTER, **changes: Any) -> None:
        self.p, self.r = PositionerParams(), Positioner()
        fill_positioner(self.p)
        self.p.angle.form = form
        for name, value in changes.items():
            assert name in PositionerParams.__fields__, name
            setattr(self.p, name, value)
        assert self.r.state == POWER_ON
        self.feed(d)

    def feed(self, d: int) -> None:
        """One interrupt with the detected angle `d`, of any turn."""
        interrupt(self.p, self.r, d % T)

    @property
    def command(self) -> float:
        """C [count]."""
        return self.r.oar - self.r.z * self.r.interpolator.irr / ONE
