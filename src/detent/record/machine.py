"""An axis in simulated time: parameters, state, recorder, and the passing of time."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np

from detent.kernel.registers import Registers
from detent.methods.filtered_servo import system as filtered_servo
from detent.methods.filtered_servo.build import build_filtered_servo, sample_microseconds
from detent.methods.filtered_servo.schema import FilteredServoSpec
from detent.methods.phase_servo import system as phase_servo
from detent.methods.phase_servo.build import build_phase_servo
from detent.methods.phase_servo.schema import PhaseServoSpec
from detent.methods.print_head import system as print_head
from detent.methods.print_head.build import build_print_head
from detent.methods.print_head.schema import PrintHeadSpec
from detent.methods.rotary_table import system as rotary_table
from detent.methods.rotary_table.build import build_rotary_table, start_turns, ticks
from detent.methods.rotary_table.schema import RotaryTableSpec
from detent.record.capture import Capture
from detent.record.recorder import Recorder

LONGEST_STRETCH = 1 << 20
"""Ticks of one call into compiled code: progress can be shown between two."""

AnyRecorder = Recorder | Capture
"""What records a run: every n-th tick of all of it, or each clock of a stretch."""

P = TypeVar("P", bound=Registers)
S = TypeVar("S", bound=Registers)


@dataclass(frozen=True, slots=True)
class Loop:
    """The compiled loop of an axis.

    Attributes
    ----------
    tick : float
        Base tick [s].
    advance : callable
        ``advance(params, state, ticks, trace, picks, every)`` gives the ticks run: fewer when the axis waits for its
        host.
    by_clocks : callable, optional
        ``by_clocks(params, state, ticks, trace, picks)``: the same, recording every clock inside a tick.
    """

    tick: float
    advance: Callable[..., int]
    by_clocks: Callable[..., int] | None = None


class Machine(Generic[P, S]):
    """A simulated axis.

    Parameters
    ----------
    params : Registers
        What does not change.
    state : Registers
        The registers; the field ``tick`` counts base ticks.
    loop : Loop
        What advances them.
    recorder : Recorder or Capture, optional
        Records registers on the way.
    """

    def __init__(self, params: P, state: S, loop: Loop, recorder: AnyRecorder | None = None) -> None:
        self.params, self.state, self.tick, self.recorder = params, state, loop.tick, recorder
        self._loop = loop
        self._clock: Any = state  # every axis's state has a field `tick`, which the base class cannot name
        self._no_rows = (np.zeros((1, 1), np.uint8), np.zeros(0, np.int64))

    @property
    def time(self) -> float:
        """Simulated time since power-on [s]."""
        return self._clock.tick * self.tick

    def pass_time(self, seconds: float) -> None:
        """Let at most `seconds` pass (a tick at least); returns earlier when the axis waits for its host."""
        self.pass_ticks(max(1, round(seconds / self.tick)))

    def pass_ticks(self, ticks: int) -> int:
        """Let at most so many ticks pass; returns how many did: fewer when the axis waits for its host."""
        left = ticks
        while left > 0:
            asked = min(left, LONGEST_STRETCH)
            done = self._run(asked)
            left -= done
            if done == 0:
                break
        return ticks - left

    def _run(self, ticks: int) -> int:
        r, now = self.recorder, self._clock.tick
        if r is None:
            return self._loop.advance(self.params, self.state, ticks, *self._no_rows, 0)
        ticks = min(ticks, r.room(now))
        if isinstance(r, Capture) and r.fine and self._loop.by_clocks is not None:
            done = self._loop.by_clocks(self.params, self.state, ticks, r.rows, r.picks)
        else:
            done = self._loop.advance(self.params, self.state, ticks, r.rows, r.picks, r.every)
        if r.room(now + done) <= 0:
            r.flush(now + done)
        return done

    def close(self) -> None:
        """Hand the last rows to the recorder's sink."""
        if self.recorder is not None:
            self.recorder.flush(self._clock.tick)


def print_head_machine(
    spec: PrintHeadSpec, recorder: AnyRecorder | None = None
) -> Machine[print_head.PrintHeadParams, print_head.PrintHead]:
    """Print head at power-on."""
    p, r = build_print_head(spec), print_head.PrintHead()
    print_head.switch_on(p, r, spec.mechanics.start_position, spec.encoder.seed)
    return Machine(p, r, Loop(print_head.TICK, print_head.advance), recorder)


def phase_servo_machine(
    spec: PhaseServoSpec, recorder: AnyRecorder | None = None
) -> Machine[phase_servo.PhaseServoParams, phase_servo.PhaseServo]:
    """Phase servo at power-on."""
    p, r = build_phase_servo(spec), phase_servo.PhaseServo()
    phase_servo.switch_on(p, r, spec.mechanics.start_position, spec.detector.seed)
    return Machine(p, r, Loop(spec.tick, phase_servo.advance), recorder)


def filtered_servo_machine(
    spec: FilteredServoSpec, recorder: AnyRecorder | None = None
) -> Machine[filtered_servo.FilteredServoParams, filtered_servo.FilteredServo]:
    """Filtered servo at power-on."""
    p, r = build_filtered_servo(spec), filtered_servo.FilteredServo()
    filtered_servo.switch_on(p, r, spec.mechanics.start_position, sample_microseconds(spec), spec.encoder.seed)
    loop = Loop(filtered_servo.TICK, filtered_servo.advance, filtered_servo.advance_by_clocks)
    return Machine(p, r, loop, recorder)


def rotary_table_machine(
    spec: RotaryTableSpec, recorder: AnyRecorder | None = None
) -> Machine[rotary_table.RotaryTableParams, rotary_table.RotaryTable]:
    """Rotary table at power-on."""
    p, r = build_rotary_table(spec), rotary_table.RotaryTable()
    rotary_table.switch_on(p, r, start_turns(spec), ticks(spec.method.task_phase), spec.detector.seed)
    return Machine(p, r, Loop(rotary_table.TICK, rotary_table.advance), recorder)
