"""A phase servo on the bench: the default plant of specification 7, driven by set strobes, recorded tick by tick."""

from collections.abc import Sequence
from copy import copy
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from detent.kernel.loop import advance
from detent.kernel.turn_table import TURN
from detent.methods.load import load_spec
from detent.methods.phase_servo.build import build_phase_servo
from detent.methods.phase_servo.controller import command, take_ready
from detent.methods.phase_servo.schema import PhaseServoSpec
from detent.methods.phase_servo.system import PhaseServo, PhaseServoParams, be_ready, switch_on
from detent.sensing.gauge import set_gauge
from detent.sensing.interference import plan_next
from detent.sensing.phase_converters import (
    AbsoluteConverter,
    ConverterParams,
    Converters,
    convert,
    count_carrier,
    reset_carrier,
    run_converters,
)
from detent.sensing.phase_detector import Detector, DetectorParams, compare

EXAMPLE = Path(str(files("detent") / "examples" / "phase_servo.toml"))
NO_TRACE = (np.zeros((1, 1), np.uint8), np.zeros(0, np.int64), 0)
START = 0.25e-3
"""Time of the set strobe in the specification's tests [s]."""


def make_spec(overrides: Sequence[str] = ()) -> PhaseServoSpec:
    """The default plant; 7.0e-5 kg m^2 in all, as the specification rounds it."""
    spec = load_spec(EXAMPLE, ["mechanics.pulley_inertia=88 g*cm^2", *overrides])
    assert isinstance(spec, PhaseServoSpec)
    return spec


class Rig:
    """The axis at a positioning point, ready for a set strobe; lengths in steps count from there.

    As in the simulation the specification's figures come from, all counters are cleared at time 0 and the bridge is on:
    the tracker acquires during the 0.25 ms before the strobe (trap 2). `locked` lets it begin in lock, as after the
    acquisition state.
    """

    def __init__(self, *overrides: str, pitch_index: int = 400, locked: bool = False) -> None:
        self.spec = make_spec(overrides)
        self.step, self.pitch, self.tick = self.spec.step, self.spec.pitch, self.spec.tick
        self.counts = self.spec.detector.counts
        self.p: PhaseServoParams = build_phase_servo(self.spec)
        self.r = PhaseServo()
        self.origin = pitch_index * self.pitch
        switch_on(self.p, self.r, self.origin, self.spec.detector.seed)
        be_ready(self.p, self.r)
        if not locked:
            self.r.controller.converters.tracking.reference = 0
        self.target = self.origin

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.r.tick * self.tick

    @property
    def error(self) -> float:
        """Target less position [steps]."""
        return (self.target - self.r.plant.train.position) / self.step

    def run(self, seconds: float) -> None:
        """Let time pass, whatever the axis says."""
        self.run_ticks(round(seconds / self.tick))

    def run_ticks(self, ticks: int) -> None:
        """Let ticks pass, whatever the axis says."""
        left = ticks
        while left > 0:
            left -= advance(self.p, self.r, left, *NO_TRACE)
            self.acknowledge()

    def run_until(self, seconds: float) -> None:
        """Let time pass up to a moment since power-on [s]."""
        self.run_ticks(round(seconds / self.tick) - self.r.tick)

    def command(self, pitches: int) -> None:
        """Set strobe for a move by whole pitches."""
        self.target += pitches * self.pitch
        set_gauge(self.r.plant.gauge, self.r.tick, self.r.plant.train.position, self.target, 2 * self.step)
        command(self.r.controller, abs(pitches) * self.counts, int(pitches < 0))

    def acknowledge(self) -> None:
        """What the host does when the axis waits for it."""
        take_ready(self.r.controller)

    def disturb(self, kind: int, ticks: Sequence[int]) -> None:
        """Events of one kind on the lines at these ticks, none of them past; they replace the list so far."""
        p, r = self.p.plant.interference, self.r.plant.interference
        p.entries = len(ticks)
        for k, moment in enumerate(ticks):
            p.tick[k], p.kind[k] = moment, kind
        r.next_entry = 0
        plan_next(p, r, self.r.tick - 1)

    def move(self, pitches: int, seconds: float) -> "Rig":
        """Strobe at 0.25 ms, then run up to a moment since power-on [s]."""
        self.run_until(START)
        self.command(pitches)
        self.run_until(seconds)
        return self

    def record(self, seconds: float, names: Sequence[str], every: int = 1) -> dict[str, np.ndarray]:
        """Run and record registers every so many ticks (values at the end of a tick), with `t` [s] since power-on."""
        leaves = {leaf.path: leaf for leaf in PhaseServo.leaves()}
        chosen = [leaves[name] for name in names]
        picks = np.concatenate([np.arange(c.offset, c.offset + c.width.size) for c in chosen]).astype(np.int64)
        dtype: Any = np.dtype([(c.path, "<" + c.width.code) for c in chosen])
        first, ticks = self.r.tick, round(seconds / self.tick)
        rows = np.zeros((ticks // every + 2, dtype.itemsize), np.uint8)
        left = ticks
        while left > 0:
            left -= advance(self.p, self.r, left, rows, picks, every)
            self.acknowledge()
        index = np.arange(first // every + 1, self.r.tick // every + 1)
        table = rows[index % len(rows)].view(dtype)[:, 0]
        return {name: table[name].copy() for name in names} | {"t": index * every * self.tick}


class ConverterBench:
    """Carrier, detector and both converters without the axis; lengths in steps, ticks count from 0.

    The square wave lags the carrier by `lag` steps at position 0.
    """

    def __init__(self, counts: int = 64, *, lag: int = 0, leave_antiphase: bool = False) -> None:
        bits = counts.bit_length() - 1
        self.counts, self.step = counts, TURN // counts
        self.d = DetectorParams(turns_per_metre=self.step, offset=-lag * self.step % TURN, carrier_shift=32 - bits)
        self.p = ConverterParams()
        self.p.carrier.mask = self.p.tracking.mask = self.p.absolute.mask = counts - 1
        self.p.carrier.shift = bits - 3
        self.p.tracking.top = self.p.absolute.top = bits - 1
        self.p.tracking.leave_antiphase = leave_antiphase
        self.r, self.detector = Converters(), Detector()
        reset_carrier(self.r.carrier)
        self.spare = AbsoluteConverter()
        """A second absolute converter for a test to clock otherwise."""
        self.tick = self.ps = 0
        self.phase = self.d.offset

    def copy(self) -> "ConverterBench":
        """The same bench in the same state, independent."""
        twin = copy(self)
        twin.r, twin.detector, twin.spare = self.r.copy(), self.detector.copy(), self.spare.copy()
        return twin

    @property
    def lead(self) -> int:
        """What the reference counter is ahead of the drive counter [steps], in (-N/2, N/2]."""
        half = self.counts // 2
        return half - (half - self.r.tracking.reference + self.r.carrier.count) % self.counts

    def clock(self, steps: float, *, corrupt: bool = False) -> int:
        """One tick with the carriage at `steps`; returns the pulse: 1, -1 or 0."""
        count_carrier(self.p.carrier, self.r.carrier)
        self.ps = compare(self.d, self.detector, self.r.carrier.count, steps) ^ corrupt
        convert(self.p, self.r, self.ps)
        self.tick += 1
        return self.r.tracking.plus - self.r.tracking.minus

    def pulses(self, ticks: int, steps: float = 0.0) -> list[tuple[int, int]]:
        """Every pulse of so many ticks at rest: tick and sign."""
        found = [(self.tick, self.clock(steps)) for _ in range(ticks)]
        return [(tick, sign) for tick, sign in found if sign]

    def travel(self, steps_per_cycle: float, ticks: int) -> int:
        """Net pulses of uniform motion, from where the last call has left the carriage (at first at 0)."""
        rate = round(steps_per_cycle * self.step / self.counts)
        net = run_converters(self.p, self.r, self.phase, rate, ticks)
        self.phase += rate * ticks
        self.tick += ticks
        return net

    @property
    def place(self) -> float:
        """Where `travel` has brought the carriage [steps]."""
        return (self.phase - self.d.offset) / self.step
