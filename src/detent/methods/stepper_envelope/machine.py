"""Several steppers in simulated time, side by side: each with its own control unit, tables and rotor.

Nothing is shared but time (stepper-envelope specification 2.2): each motor is advanced for itself, up to the instant
that all of them reach. A record of the stage is put together from records of its motors.
"""

import ctypes
from collections.abc import Iterable
from functools import cache
from typing import Any

import numpy as np

from detent.control.step_rule import FAULT, REST, acknowledge
from detent.kernel.loop import advance
from detent.kernel.registers import Registers, block, i8, register
from detent.methods.stepper_envelope.build import MotorTables, build_stepper, instant, make_tables
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec
from detent.methods.stepper_envelope.system import Stepper, switch_on, tables, take_over
from detent.planning.step_envelope import StepEnvelope
from detent.record.machine import LONGEST_STRETCH, AnyRecorder


def stage_registers(spec: StepperEnvelopeSpec) -> type[Registers]:
    """Class of the registers of a whole stage: ``tick``, and a block per motor of the motor's name."""
    return _registers_of(tuple(spec.stepper))


@cache
def _registers_of(names: tuple[str, ...]) -> type[Registers]:
    """One class per set of names; it has the layout of a record, the motors themselves live apart."""
    # The base's metaclass reads these to lay the structure out.
    body: dict[str, Any] = {"__module__": __name__, "__doc__": "Registers of a stage."}
    body["__annotations__"] = {"tick": i8} | dict.fromkeys(names, Stepper)
    body["tick"] = register("time steps of the rotors since power-on", unit="tick")
    body |= {name: block(f"motor {name}") for name in names}
    make: Any = type(Registers)
    return make("Stage", (Registers,), body)


class StageMotor:
    """One motor of a stage at power-on, with its tables."""

    def __init__(self, spec: StepperEnvelopeSpec, name: str) -> None:
        self.name, self.table = name, spec.stepper[name]
        self.tables: MotorTables = make_tables(self.table)
        self.p: Any = build_stepper(spec, name, self.tables)
        # ctypes gives every register its type at run time only.
        self.r: Any = Stepper()
        switch_on(self.r, self.table.step_inside(self.table.mechanics.start_position), self.p.plant.rotor.step_angle)
        self.controller: Any = self.r.controller
        self.feed: tuple[Any, ...] = tables(self.tables.up.entries, self.tables.down.entries)
        self.rows, self.picks = np.zeros((1, 1), np.uint8), np.zeros(0, np.int64)  # no record of it
        self.rested = 0.0  # when its last step was over [s], at the last event

    @property
    def position(self) -> int:
        """Position of record [step]."""
        return int(self.controller.rule.position)

    @property
    def place(self) -> float:
        """The same as a length [m]."""
        return self.table.position_of(self.position)

    def along(self, heading: int) -> tuple[StepEnvelope, StepEnvelope]:
        """Table of a direction of motion, and of the other one."""
        up, down = self.tables.up, self.tables.down
        return (up, down) if heading > 0 else (down, up)

    @property
    def resting(self) -> bool:
        """True when it stands and no start waits to be taken."""
        rule = self.controller.rule
        return rule.index < 0 and rule.state in {REST, FAULT} and not rule.start

    def compare(self, method: int, way: range, start_hz: float) -> None:
        """Let a method of `control.step_comparison` drive, upwards over a way [step]."""
        acceleration = self.table.limits.acceleration / self.table.step
        self.p, self.r = take_over(
            self.p, self.r, self.tables.up.zones, way, method=method, start_hz=start_hz, acceleration=acceleration
        )
        self.controller, self.feed = self.r.controller, ()

    def advance_to(self, at: int, every: int, *, until_event: bool) -> bool:
        """Advance up to an instant, or until the control unit has an event for the host; True if it has one."""
        r, rule = self.r, self.controller.rule
        while r.tick < at and not (until_event and rule.event):
            if not until_event:
                acknowledge(rule)
            n = min(at - r.tick, LONGEST_STRETCH)
            advance(self.p, r, n, self.rows, self.picks, every, *self.feed)
        if rule.event:
            self.rested = self.controller.timer.expires / self.p.controller.timer.clock_hz
        return bool(rule.event)


class Stage:
    """All motors of an axis, and the time they share."""

    def __init__(self, spec: StepperEnvelopeSpec, recorder: AnyRecorder | None = None) -> None:
        self.spec, self.tick, self.recorder = spec, instant(spec), recorder
        self.motors = {name: StageMotor(spec, name) for name in spec.stepper}
        self.instant = 0
        self._every = 0 if recorder is None else recorder.every
        self._columns: dict[str, Any] = {}  # of the record, by the motor that they are of
        for field in stage_registers(spec).__fields__.values():
            if recorder is None or field.block is None:
                continue
            end = field.offset + ctypes.sizeof(field.block)
            columns = np.flatnonzero((recorder.picks >= field.offset) & (recorder.picks < end))
            motor, self._columns[field.name] = self.motors[field.name], columns
            motor.picks = np.ascontiguousarray(recorder.picks[columns] - field.offset)
            motor.rows = np.zeros((len(recorder.rows), len(columns)), np.uint8)

    @property
    def time(self) -> float:
        """Simulated time since power-on [s]."""
        return self.instant * self.tick

    def pass_time(self, seconds: float) -> None:
        """Let time pass for all motors."""
        end = self.instant + round(seconds / self.tick)
        while self.instant < end:
            self._bring_to(min(end, self.instant + self._room()))

    def wait_for(self, names: Iterable[str], seconds: float) -> set[str]:
        """Wait until each of these motors has an event for the host, at most so long."""
        waiting, end = set(names), self.instant + round(seconds / self.tick)
        reached = self.instant
        while waiting and self.instant < end:
            stop = min(end, self.instant + self._room())
            for name in sorted(waiting):
                if self.motors[name].advance_to(stop, self._every, until_event=True):
                    waiting.discard(name)
                    reached = max(reached, int(self.motors[name].r.tick))
            self._bring_to(stop if waiting else max(reached, self.instant))
        return waiting

    def _room(self) -> int:
        """Instants that may pass before the record must be handed on."""
        return LONGEST_STRETCH if self.recorder is None else self.recorder.room(self.instant)

    def _bring_to(self, at: int) -> None:
        """Bring all motors to an instant that none of them has passed."""
        for motor in self.motors.values():
            motor.advance_to(at, self._every, until_event=False)
        self.instant = at
        if self.recorder is not None and self.recorder.room(at) <= 0:
            self._flush(self.recorder)

    def _flush(self, recorder: AnyRecorder) -> None:
        """Put the motors' rows together and hand them on."""
        for name, columns in self._columns.items():
            recorder.rows[:, columns] = self.motors[name].rows
        every = max(recorder.every, 1)
        last, count = self.instant // every, len(recorder.rows)
        numbers = np.arange(last - count + 1, last + 1, dtype=np.int64)
        ticks = (numbers * every).astype("<i8").view(np.uint8).reshape(count, 8)
        recorder.rows[numbers % count, :8] = ticks  # the tick is the first register of every record
        recorder.flush(self.instant)

    def close(self) -> None:
        """Hand the last rows to the recorder's sink."""
        if self.recorder is not None:
            self._flush(self.recorder)
