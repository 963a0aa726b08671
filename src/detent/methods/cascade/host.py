"""The host of a cascade axis: it gives the loops their reference, sample by sample, and watches what they do.

The drive of a real axis looks after itself at every sample: it switches off when the following error, the travel or a
command that stays at its limit says that something is wrong. So does this host. Each stretch is run on a copy of the
axis first; the axis itself then passes as many samples as its drive would have let it.
"""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.kernel.loop import advance
from detent.kernel.registers import Leaf, Registers
from detent.methods.cascade.build import build_cascade
from detent.methods.cascade.controller import follow, switch_off
from detent.methods.cascade.schema import CascadeSpec
from detent.methods.cascade.system import Cascade, CascadeParams, Feed, along, driven, switch_on
from detent.planning.profile import Profile
from detent.record.machine import AnyRecorder, Loop, Machine

CHUNK = 8192
"""Samples of one stretch that is looked through for what ends it."""

Numbers = NDArray[np.float64]

Rows = NDArray[Any]
"""Structured rows, one per sample: what its law computed, and the plant when it was over."""


class RotaryCascade(Cascade):
    """Registers of an axis that turns: the same places, other units."""

    @classmethod
    def leaves(cls, prefix: str = "", offset: int = 0, by: str = "") -> Iterator[Leaf]:
        """Every stored quantity with its dotted path, in order of memory."""
        return (replace(leaf, unit=rotary_unit(leaf.unit)) for leaf in Cascade.leaves(prefix, offset, by))


def rotary_unit(unit: str) -> str:
    """Unit of an axis that turns, for that of one that moves straight.

    >>> [rotary_unit(unit) for unit in ("m/s", "V, N", "V.s2/m", "tick")]
    ['rad/s', 'V, N.m', 'V.s2/rad', 'tick']
    """
    words = {"m": "rad", "N": "N.m", "kg": "kg.m2"}
    return re.sub("[A-Za-z]+", lambda match: words.get(match[0], match[0]), unit)


def cascade_registers(spec: CascadeSpec) -> type[Registers]:
    """Class of the registers of an axis, with its units."""
    return RotaryCascade if spec.axis.motion == "rotary" else Cascade


@dataclass(frozen=True, slots=True)
class Stop:
    """What ends a stretch."""

    samples: int  # samples passed, the one in which it was seen counted
    cause: str = ""  # why the drive switches off; empty where nothing is wrong


Judge = Callable[[Rows], Stop | None]
"""Looks through the rows of a stretch for what ends it; what it counts goes on in the next stretch."""


@dataclass(slots=True)
class Peaks:
    """Largest magnitudes since they were cleared."""

    following: float = 0.0  # following error of the position loop [m]
    command: float = 0.0  # command, in its own unit
    limited: int = 0  # samples with the command at its limit

    def take(self, rows: Rows) -> None:
        """Take the rows of a stretch."""
        self.following = max(self.following, float(np.abs(rows["controller.law.position_error"]).max(initial=0.0)))
        self.command = max(self.command, float(np.abs(rows["controller.law.command"]).max(initial=0.0)))
        self.limited += int(np.count_nonzero(rows["controller.law.limited"]))


class CascadeHost:
    """A cascade axis at power-on, its loops closed, and the reference where it stands."""

    def __init__(self, spec: CascadeSpec, recorder: AnyRecorder | None = None, position: float | None = None) -> None:
        self.spec, self.peaks = spec, Peaks()
        self.params: Any = build_cascade(spec)
        # ctypes gives every register its type at run time only.
        self.state: Any = Cascade()
        start = spec.mechanics.start_position if position is None else position
        switch_on(self.params, self.state, start)
        self.tick: float = self.params.plant.machine.period
        self.sample_ticks: int = self.params.controller.sample_ticks
        self.machine: Machine[CascadeParams, Cascade] = Machine(
            self.params, self.state, Loop(self.tick, self._advance), recorder
        )
        self.feed: Feed = along(np.array([start]), np.zeros(1), np.zeros(1))

    @property
    def period(self) -> float:
        """Time between two samples [s]."""
        return self.tick * self.sample_ticks

    @property
    def time(self) -> float:
        """Simulated time since power-on [s]."""
        return self.machine.time

    @property
    def position(self) -> float:
        """True position of the load [m]."""
        return float(self.state.plant.machine.load.position)

    def follow(self, profile: Profile) -> None:
        """Follow a reference from the next sample on; behind its end it stands."""
        self.feed = along(profile.position, profile.velocity, profile.acceleration)
        follow(self.state.controller)

    def drive(self, command: Numbers) -> None:
        """Open the loops: the amplifier gets these commands, one per sample, and nothing behind their end."""
        self.feed = driven(command)
        follow(self.state.controller)

    def switch_off(self) -> None:
        """Take the drive's command away; the axis coasts."""
        switch_off(self.state.controller)

    def _advance(self, p: CascadeParams, r: Cascade, ticks: int, *recording: Any) -> int:
        return advance(p, r, ticks, *recording, *self.feed)

    def rehearse(self, samples: int) -> Rows:
        """What the next samples would bring; the axis stays where it is."""
        copy: Any = self.state.copy()
        first = copy.tick // self.sample_ticks + 1
        memory = np.zeros((samples + 1, len(_PICKS)), np.uint8)
        self._advance(self.params, copy, samples * self.sample_ticks, memory, _PICKS, self.sample_ticks)
        return memory[np.arange(first, first + samples) % len(memory)].view(_ROW)[:, 0]

    def pass_samples(self, samples: int, judge: Judge) -> Stop | None:
        """Let samples pass, at most until the judge ends the stretch."""
        done = 0
        while done < samples:
            rows = self.rehearse(min(samples - done, CHUNK))
            stop = judge(rows)
            rows = rows[: stop.samples] if stop else rows
            self.peaks.take(rows)
            self.machine.pass_ticks(len(rows) * self.sample_ticks)
            done += len(rows)
            if stop:
                return Stop(done, stop.cause)
        return None


WATCHED = (
    "controller.law.position_error", "controller.law.command", "controller.law.limited", "plant.source.command",
    "controller.motor_sensor.position", "controller.motor_sensor.velocity", "controller.load_sensor.position",
    "plant.machine.current", "plant.machine.motor.position", "plant.machine.load.position",
)  # fmt: skip
"""Registers that a rehearsal shows."""

_LEAVES = [next(leaf for leaf in Cascade.leaves() if leaf.path == name) for name in WATCHED]
_PICKS = np.concatenate([np.arange(x.offset, x.offset + x.width.size) for x in _LEAVES]).astype(np.int64)
_ROW: Any = np.dtype([(leaf.path, "<" + leaf.width.code) for leaf in _LEAVES])


def run_lengths(on: NDArray[np.bool_], before: int) -> NDArray[np.int64]:
    """For each sample, through how many up to it something has held.

    >>> import numpy as np
    >>> run_lengths(np.array([True, True, False, True]), 5).tolist()
    [6, 7, 0, 1]
    """
    number = np.arange(1, len(on) + 1)
    last_off = np.maximum.accumulate(np.where(on, 0, number))
    return number - last_off + np.where(last_off == 0, before, 0)
