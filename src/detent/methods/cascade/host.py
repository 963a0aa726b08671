"""The host of a cascade axis: it gives the loops their reference, lets samples pass, and answers the events."""

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from detent.kernel.loop import Bytes, Offsets, advance, until_row, write_row
from detent.kernel.registers import Leaf, Registers
from detent.kernel.step import step
from detent.methods.cascade.build import build_cascade
from detent.methods.cascade.controller import Feed, arrive_within, begin, forget_conduct, guard_axis, take_event
from detent.methods.cascade.schema import CascadeSpec
from detent.methods.cascade.system import Cascade, CascadeParams, along, driven, switch_on
from detent.planning.profile import Numbers, Profile
from detent.record.machine import AnyRecorder, Machine
from detent.record.recorder import byte_places, choose_leaves

Rows = NDArray[Any]  # structured, one row per sample: what its law computed, and the plant when it was over


class RotaryCascade(Cascade):
    """Registers of an axis that turns: the same places, other units."""

    @classmethod
    def leaves(cls, prefix: str = "", offset: int = 0, by: str = "") -> Iterator[Leaf]:
        """Every stored quantity with its dotted path, in order of memory."""
        straight: Any = cls.__base__  # in single precision that is another class
        return (replace(leaf, unit=rotary_unit(leaf.unit)) for leaf in straight.leaves(prefix, offset, by))


def rotary_unit(unit: str) -> str:
    """Unit of an axis that turns, "V.s2/rad", for that of one that moves straight, "V.s2/m"."""
    words = {"m": "rad", "N": "N.m", "kg": "kg.m2"}
    return re.sub("[A-Za-z]+", lambda match: words.get(match[0], match[0]), unit)


def cascade_registers(spec: CascadeSpec) -> type[Registers]:
    """Class of the registers of an axis, with its units."""
    return spec.registers_of(RotaryCascade if spec.axis.motion == "rotary" else Cascade)


@step
def advance_watched(  # noqa: PLR0913 - as `advance`, and where the rows of the samples go
    p: Any, r: Any, most: int, trace: Bytes, picks: Offsets, every: int, seen: Bytes, chosen: Offsets, *feed: Any
) -> int:
    """`advance` with a second row at the end of every sample."""
    done, sample = 0, p.controller.sample_ticks
    while done < most:
        stretch = until_row(r.tick, most - done, sample)
        n = advance(p, r, stretch, trace, picks, every, *feed)
        done += n
        if n < stretch:
            break
        write_row(r, r.tick, seen, chosen, sample)
    return done


class CascadeHost:
    """A cascade axis at power-on, its loops closed, and the reference where it stands."""

    def __init__(self, spec: CascadeSpec, recorder: AnyRecorder | None = None, position: float | None = None) -> None:
        self.spec = spec
        # ctypes gives every register its type at run time only.
        self.params: Any = build_cascade(spec)
        self.state: Any = spec.registers_of(Cascade)()
        self.controller: Any = self.state.controller
        start = spec.mechanics.start_position if position is None else position
        self.tick: float = self.params.plant.machine.period
        self.sample_ticks: int = self.params.controller.sample_ticks
        self.machine = Machine[Any, Any](
            self.params, self.state, self.tick, recorder, advance=self._advance, feed=lambda: self.feed
        )
        self.feed: Feed = along(np.array([start]), np.zeros(1), np.zeros(1))
        switch_on(self.params, self.state, start, self.machine.act)
        self.act(guard_axis, 1)
        self._seen: Bytes | None = None

    def act(self, action: Callable[..., Any], *args: Any) -> Any:
        """Do something to the controller."""
        return self.machine.act(action, self.controller, *args)

    def forget(self) -> None:
        """A stretch begins that is to be judged for itself."""
        self.act(forget_conduct)

    @property
    def period(self) -> float:
        """Time between two samples [s]."""
        return self.tick * self.sample_ticks

    @property
    def time(self) -> float:
        """Simulated time since power-on [s]."""
        return self.machine.time

    def follow(self, profile: Profile) -> None:
        """Follow a reference from the next sample on; behind its end it stands."""
        self.feed = along(profile.position, profile.velocity, profile.acceleration)
        self.act(begin)

    def drive(self, command: Numbers) -> None:
        """Open the loops: the amplifier gets these commands, one per sample, and nothing behind their end."""
        self.feed = driven(command)
        self.act(begin)

    def _advance(self, p: CascadeParams, r: Cascade, ticks: int, *recording: Any) -> int:
        if self._seen is None:
            return advance(p, r, ticks, *recording, *self.feed)
        return advance_watched(p, r, ticks, *recording, self._seen, self._picks, *self.feed)

    def pass_samples(self, samples: int) -> int:
        """Let samples pass, at most to the end of the one that makes an event; which one, 0 if none did."""
        self.machine.pass_ticks(samples * self.sample_ticks)
        event = int(self.act(take_event))
        if event:
            self.machine.pass_ticks(self.controller.left)
        return event

    def arrive(self, samples: int) -> int:
        """Let samples pass until the axis is in position: that, or a fault, is the event."""
        self.act(arrive_within, samples)
        return self.pass_samples(samples)

    def watch(self, samples: int) -> Rows:
        """Let samples pass, and see every one of them."""
        first = self.state.tick // self.sample_ticks + 1
        leaves = choose_leaves(self.spec.registers_of(Cascade), WATCHED)
        self._picks = byte_places(leaves)
        memory = self._seen = np.zeros((samples + 1, len(self._picks)), np.uint8)
        self.pass_samples(samples)
        self._seen = None
        return memory[np.arange(first, first + samples) % len(memory)].view(
            [(leaf.path, "<" + leaf.width.code) for leaf in leaves]
        )[:, 0]


WATCHED = (
    "controller.law.position_error", "controller.law.command", "controller.law.limited", "plant.source.command",
    "controller.motor_sensor.position", "controller.motor_sensor.velocity", "controller.load_sensor.position",
    "plant.machine.current", "plant.machine.motor.position", "plant.machine.load.position",
)  # fmt: skip
"""Registers that `watch` shows."""
