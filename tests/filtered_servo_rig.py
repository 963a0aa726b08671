"""A filtered servo on the bench: plants A and B of specification 6, driven by evenly spaced command pulses."""

from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from detent.control.pulse_generator import PER_PULSE
from detent.kernel.loop import advance
from detent.methods.filtered_servo.build import build_filtered_servo
from detent.methods.filtered_servo.controller import go_to
from detent.methods.filtered_servo.schema import FilteredServoSpec
from detent.methods.filtered_servo.system import TICK, FilteredServo, FilteredServoParams, switch_on
from detent.methods.load import load_spec

EXAMPLE = Path(str(files("detent") / "examples" / "filtered_servo.toml"))
NO_TRACE = (np.zeros((1, 1), np.uint8), np.zeros(0, np.int64), 0)
ENDLESS = 10**12
START = 25.0
"""Where the slide stands at power-on [m], halfway of a way that no test reaches the end of."""

COMMON = (
    "limits.travel=50 m", f"mechanics.start_position={START} m", "mechanics.moving_mass=0 kg",
    "motor.rotor_inertia=700 g*cm^2", "method.command_acceleration=0 m/s^2",
    *(f"protection.{watch}=0" for watch in ("overspeed", "jump")),
    *(f"protection.{watch}_time=0 s" for watch in ("saturation", "stuck", "reversed")),
    *(f"mechanics.friction.{side}.{kind}=0 N" for side in ("right", "left") for kind in ("coulomb", "static")),
)  # fmt: skip
"""What the tests of the law have in common; loops that swing and plants without friction are nothing to protect."""

PULSE = 5e-6
"""Travel per pulse [m]."""

CONVENTIONAL = ("method.filter=none",)
LONG_WINDOW = ("method.filter=none", "method.scale=1", "method.sample_period=20 ms", "method.counter_bits=12")
SMALL_MULTIPLIER = ("method.filter=none", "method.scale=1")


def current_per_count(gain: float) -> float:
    """Current per count [A] that makes an ideal plant of `gain` [1/s^2]: K = i Kt / J x 1000 / (2 pi)."""
    return gain * 7e-5 / 0.05 * 2 * np.pi / 1000


def plant_a(gain: float = 4000.0) -> tuple[str, ...]:
    """Ideal current drive."""
    return (f"drive.current_per_count={current_per_count(gain)!r} A", "limits.effort=1e5 N")


PLANT_B = ("drive.amplifier=voltage", "drive.supply=12 V", "limits.effort=1e5 N")
"""R = 2 ohm, 12 V over 128 counts: K = 5329 1/s^2, tau_m = 56 ms."""

FINENESS = 100
"""Pulses of the fine encoder to one of the others: what rounding to whole pulses does becomes a hundredth."""

FINE = (
    f"encoder.cycles_per_revolution={250 * FINENESS}", "drive.word_bits=16", "method.position_bits=16",
    "method.counter_bits=12", "drive.pwm_frequency=100 kHz", "limits.speed=4 mm/s",
)  # fmt: skip
"""Fine encoder, with counters and a drive word wide enough for its pulses; the PWM takes over the word in each tick."""


def fine_plant(gain: float, *, damped: bool = False) -> tuple[str, ...]:
    """Plant of `gain` [1/s^2] in the pulses of the fine encoder; `damped` by back-EMF with tau_m = 56 ms."""
    if not damped:
        return (f"drive.current_per_count={current_per_count(gain) / FINENESS!r} A", "limits.effort=1e5 N")
    full = 1 << 15  # volts of a full word of 16 bits: K Kt / J = volts per count / R
    supply = current_per_count(gain) * 2.0 / FINENESS * full
    return ("drive.amplifier=voltage", f"drive.supply={supply!r} V", "limits.effort=1e5 N")


class Rig:
    """The axis after reset; positions count in pulses from the start."""

    def __init__(self, *overrides: str, plant: Sequence[str] | None = None) -> None:
        spec = load_spec(EXAMPLE, [*COMMON, *(plant_a() if plant is None else plant), *overrides])
        assert isinstance(spec, FilteredServoSpec)
        self.spec = spec
        self.p: FilteredServoParams = build_filtered_servo(spec)
        self.r = FilteredServo()
        self.c, self.lines, self.plant = self.r.controller, self.r.lines, self.r.plant
        switch_on(self.p, self.r, START, round(spec.method.sample_period * 1e6), spec.encoder.seed)
        self.run_ticks(1)

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.r.tick * TICK

    def command_rate(self, rate: float) -> None:
        """Command pulses for ever at a signed rate [pulses/s]; 0 stops where the command stands."""
        go_to(self.c, int(self.c.generator.command + np.sign(rate) * ENDLESS), round(abs(rate) * PER_PULSE))

    def go(self, pulses: int, rate: float = 20_000.0) -> None:
        """Command so many pulses more, at a rate [pulses/s]."""
        go_to(self.c, self.c.generator.command + pulses, round(rate * PER_PULSE))

    def acknowledge(self) -> None:
        """The host has looked."""
        self.c.event = 0

    def run_ticks(self, ticks: int) -> None:
        """Let ticks pass, whatever the axis says."""
        left = ticks
        while left > 0:
            left -= advance(self.p, self.r, left, *NO_TRACE)
            self.acknowledge()

    def run(self, seconds: float) -> None:
        """Let time pass."""
        self.run_ticks(round(seconds / TICK))

    def record(self, seconds: float, names: Sequence[str], every: int = 1) -> dict[str, np.ndarray]:
        """Run and record registers every so many ticks (values at the end of a tick), with `t` [s] since power-on."""
        leaves = {leaf.path: leaf for leaf in FilteredServo.leaves()}
        chosen = [leaves[name] for name in names]
        picks = np.concatenate([np.arange(c.offset, c.offset + c.width.size) for c in chosen]).astype(np.int64)
        dtype: Any = np.dtype([(c.path, "<" + c.width.code) for c in chosen])
        first, ticks = self.r.tick, round(seconds / TICK)
        rows = np.zeros((ticks // every + 2, dtype.itemsize), np.uint8)
        left = ticks
        while left > 0:
            left -= advance(self.p, self.r, left, rows, picks, every)
            self.acknowledge()
        index = np.arange(first // every + 1, self.r.tick // every + 1)
        table = rows[index % len(rows)].view(dtype)[:, 0]
        return {name: table[name].copy() for name in names} | {"t": index * every * TICK}
