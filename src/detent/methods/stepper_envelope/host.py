"""Several steppers in simulated time, side by side, and the host that moves them.

Nothing is shared but time (stepper-envelope specification 2.2): each motor has its own control unit, tables and rotor,
and is advanced for itself, up to the instant that all of them reach. A record of the stage is put together from records
of its motors. The host moves the extremes of the tables, gives the start signal, and waits for rest. It knows what a
controller would know: the step counts. Whether the rotors followed is for an observer to say.
"""

import ctypes
import math
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from detent.control.step_rule import FAULT, REST
from detent.control.step_timer import word_within
from detent.errors import STEP_FAULT_TEXT, AxisError, FileProblem, InputError
from detent.kernel.loop import advance
from detent.kernel.registers import Registers, block, i8, register
from detent.methods.stepper_envelope.build import build_stepper, instant, make_tables
from detent.methods.stepper_envelope.controller import NOWHERE, acknowledge, call_at, deflect, release, start
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec, StepperTable
from detent.methods.stepper_envelope.stage_job import StageJob, StageJog, StageMove
from detent.methods.stepper_envelope.system import Stepper, switch_on, tables, take_over
from detent.planning.step_envelope import StepEnvelope
from detent.plant.stepper_rotor import lost_steps
from detent.record.machine import LONGEST_STRETCH, AnyRecorder, Machine, Witness
from detent.units import format_quantity as text


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
    """One motor of a stage at power-on, with its tables; a witness sees it alone."""

    def __init__(self, spec: StepperEnvelopeSpec, name: str, witness: Witness | None = None) -> None:
        self.name, self.table = name, spec.stepper[name]
        self.tables = make_tables(self.table)
        self.p: Any = build_stepper(spec, name, self.tables)
        # ctypes gives every register its type at run time only.
        self.r: Any = Stepper()
        self.controller: Any = self.r.controller
        self.feed: tuple[Any, ...] = tables(self.tables.up.entries, self.tables.down.entries)
        self._witness, self._tick = witness, instant(spec)
        self._every = 0  # ticks between two rows of a record
        self.machine = self._machine()
        start_at = self.table.step_inside(self.table.mechanics.start_position)
        switch_on(self.r, start_at, self.p.plant.rotor.step_angle, self.machine.act)
        self.rows, self.picks = np.zeros((1, 1), np.uint8), np.zeros(0, np.int64)  # no record of it
        self.rested = 0.0  # when its last step was over [s], at the last event

    def act(self, action: Callable[..., Any], *args: Any) -> None:
        """Do something to the control unit."""
        self.machine.act(action, self.controller, *args)

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
    def steps_left(self) -> int:
        """Steps to the stop of its table, and from there to that of the other one where it has to turn."""
        rule = self.controller.rule
        first, second = self.along(rule.heading)
        return abs(first.stop - self.position) + (abs(second.stop - first.stop) if rule.turns else 0)

    @property
    def longest(self) -> float:
        """Time within which it comes to rest [s]: no run stays below its slowest frequency for long."""
        steps = self.steps_left + self.table.drive.reversal_pause
        return 2.0 * steps / min(float(self.tables.ramp.hz[0]), *self.tables.up.zones.limits)

    @property
    def lost(self) -> int:
        """Steps lost so far, of a rotor at rest; with microsteps the pulses of whole full steps."""
        return lost_steps(self.p.plant.rotor, self.r.plant.rotor, self.table.drive.microsteps)

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
        self.controller, self.feed, self.machine = self.r.controller, (), self._machine()

    def _machine(self) -> Machine[Any, Any]:
        return Machine(self.p, self.r, self._tick, self._witness, advance=self._advance, feed=lambda: self.feed)

    def _advance(self, p: Any, r: Any, ticks: int, *recording: Any) -> int:
        if self._witness is None:
            recording = self.rows, self.picks, self._every
        return advance(p, r, ticks, *recording, *self.feed)

    def advance_to(self, at: int, every: int, *, until_event: bool) -> bool:
        """Advance up to an instant, or until the control unit has an event for the host; True if it has one."""
        r, rule, self._every = self.r, self.controller.rule, every
        while r.tick < at and not (until_event and rule.event):
            if not until_event:
                self.act(acknowledge)
            self.machine.pass_ticks(at - r.tick)
            if rule.event:
                self.rested = self.controller.timer.expires / self.p.controller.timer.clock_hz
        return bool(rule.event)


class Stage:
    """All motors of an axis, and the time they share."""

    def __init__(self, spec: StepperEnvelopeSpec, recorder: AnyRecorder | Witness | None = None) -> None:
        witness = None if recorder is None or isinstance(recorder, AnyRecorder) else recorder
        recorder = recorder if isinstance(recorder, AnyRecorder) else None
        self.spec, self.tick, self.recorder = spec, instant(spec), recorder
        self.motors = {
            name: StageMotor(spec, name, witness if witness and witness.motor == name else None)
            for name in spec.stepper
        }
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
            self.flush()

    def flush(self) -> None:
        """Put the motors' rows together and hand them to the recorder's sink."""
        recorder = self.recorder
        if recorder is None:
            return
        for name, columns in self._columns.items():
            recorder.rows[:, columns] = self.motors[name].rows
        every = max(recorder.every, 1)
        last, count = self.instant // every, len(recorder.rows)
        numbers = np.arange(last - count + 1, last + 1, dtype=np.int64)
        ticks = (numbers * every).astype("<i8").view(np.uint8).reshape(count, 8)
        recorder.rows[numbers % count, :8] = ticks  # the tick is the first register of every record
        recorder.flush(self.instant)


# ---- the host


@dataclass(frozen=True, slots=True)
class Leg:
    """What one motor does in a move, in steps of its own."""

    start: int  # and target: step boundaries
    target: int
    turn: int | None = None  # where it turns on the way

    @property
    def via(self) -> int:
        """Where the first run ends."""
        return self.target if self.turn is None else self.turn

    @property
    def steps(self) -> int:
        """Steps made in all."""
        return abs(self.via - self.start) + abs(self.target - self.via)


class StageHost:
    """Host of a stage at power-on."""

    def __init__(self, spec: StepperEnvelopeSpec, recorder: AnyRecorder | Witness | None = None) -> None:
        self.spec, self.stage = spec, Stage(spec, recorder)
        self.goal = {name: motor.place for name, motor in self.stage.motors.items()}

    def legs(self, move: StageMove) -> dict[str, Leg]:
        """What each motor has to do for a move; motors that stand there already are left out.

        Where a manual run ended is not known before it is made: only now can a move from there be refused.
        """
        found: dict[str, Leg] = {}
        for name in move.motors:
            motor = self.stage.motors[name]
            goal = move.place_of(name, self.goal[name])
            for key, got, allowed, remedy in move_faults(motor.table, name, move, motor.place, goal):
                where = f"motor {name} at {motor.table.text(motor.place, 'm')}" + (f", {key}" if key != name else "")
                raise AxisError(f"{where}: got {got}; expected: {allowed}; try: {remedy}")
            turn = None if move.turn is None else motor.table.step_inside(move.turn)
            leg, self.goal[name] = Leg(motor.position, motor.table.step_inside(goal), turn), goal
            if leg.steps:
                found[name] = leg
        return found

    def start(self, legs: dict[str, Leg]) -> None:
        """Set the extremes of each motor and give all start signals at once."""
        for name, leg in legs.items():
            motor = self.stage.motors[name]
            heading = 1 if leg.via > leg.start else -1
            first, second = motor.along(heading)
            first.move_start(leg.start)
            first.move_stop(leg.via)
            if leg.turn is not None:
                second.move_start(leg.via)
                second.move_stop(leg.target)
            motor.act(start, heading, int(leg.turn is not None))

    def wait(self, names: Collection[str]) -> None:
        """Wait until these motors have come to rest."""
        limit = 1.0 + sum(self.stage.motors[name].longest for name in names)
        late = self.stage.wait_for(names, limit)
        for name in names:
            rule = self.stage.motors[name].controller.rule
            if rule.state == FAULT:
                raise AxisError(f"motor {name}: {STEP_FAULT_TEXT[rule.cause]}")
            if name in late:
                late_after = f"did not come to rest within {text(limit, 's')}"
                raise AxisError(f"motor {name}: {late_after}; look at its table in the report")

    def run(self, move: StageMove) -> tuple[dict[str, Leg], bool]:
        """Make one move up to rest: what each motor did, and whether it could not stop where it was told to."""
        legs = self.legs(move)
        self.start(legs)
        over = move.change is not None and any(self._change(name, move.change.at, move.change.to) for name in legs)
        self.wait(legs)
        for name in legs if over else ():  # its new stop lay behind the nearest possible one: come back to it
            motor = self.stage.motors[name]
            back = {name: Leg(motor.position, motor.table.step_inside(self.goal[name]))}
            if back[name].steps:
                self.start(back)
                self.wait(back)
        return legs, over

    def _change(self, name: str, at: float, to: float) -> bool:
        """Move the stop extreme of a running motor when it passes a place; True if it lay too near."""
        motor = self.stage.motors[name]
        rule = motor.controller.rule
        motor.act(call_at, motor.table.step_inside(at))
        late = self.stage.wait_for([name], 1.0 + motor.longest)
        motor.act(call_at, NOWHERE)
        if late or motor.resting:  # a fault of the rule, which the host sees when it waits for the end
            return False
        motor.act(acknowledge)
        ahead, behind = motor.along(rule.direction)
        edit = ahead.move_stop(motor.table.step_inside(to), rule.position, rule.index)
        behind.move_start(edit.stop)
        self.goal[name] = to
        return edit.overrun

    def jog(self, jog: StageJog) -> dict[str, Leg]:
        """A manual run up to rest: what the motor did; it is left out if it stood at the end of its travel."""
        motor = self.stage.motors[jog.motor]
        start, heading = motor.position, 1 if jog.speed > 0 else -1
        for table in (motor.tables.up, motor.tables.down):
            table.move_start(0 if table.direction > 0 else table.steps)
            table.move_stop(table.steps - table.start)
        reload = self.spec.controller.words == "reload"
        word = word_within(motor.table.hz(abs(jog.speed)), motor.p.controller.timer.clock_hz, reload=reload)
        motor.machine.act(deflect, motor.p.controller, motor.controller, word, heading)
        self.stage.pass_time(jog.duration)
        motor.act(release)
        if not motor.resting:
            self.wait([jog.motor])
        self.goal[jog.motor] = motor.place
        return {jog.motor: Leg(start, motor.position)} if motor.position != start else {}


def check_stage_job(spec: StepperEnvelopeSpec, job: StageJob) -> None:
    """Refuse what the axis cannot be told to do, before anything moves."""
    problems = [FileProblem(job.name, row, 1, *told) for row, *told in _job_problems(spec, job)]
    if problems:
        raise InputError(problems)


def _job_problems(spec: StepperEnvelopeSpec, job: StageJob) -> Iterator[tuple[int, str, str, str, str]]:
    """Line and key of what the axis cannot do, what it got, what it expected and what to try."""
    goal = {name: table.mechanics.start_position for name, table in spec.stepper.items()}
    for move in job.moves:
        unknown = next((name for name in move.motors if name not in spec.stepper), None)
        if unknown is not None:
            yield move.row, unknown, f"the motor {unknown}", f"one of {', '.join(spec.stepper)}", "rename it"
            return
        if isinstance(move, StageJog):
            table = spec.stepper[move.motor]
            if not 1.0 <= table.hz(abs(move.speed)) <= table.max_hz * (1 + 1e-9):
                got, slowest, top = (table.text(v, "m/s") for v in (move.speed, table.step, table.limits.speed))
                remedy = f"write {top}, or correct limits.speed"
                yield move.row, "speed", got, f"{slowest} to {top}, either way", remedy
            goal[move.motor] = math.nan  # where a manual run ends is not known before it is made
            continue
        for name in move.motors:
            start, goal[name] = goal[name], move.place_of(name, goal[name])
            faults = list(move_faults(spec.stepper[name], name, move, start, goal[name]))
            yield from ((move.row, *fault) for fault in faults)
            if move.change is not None:
                goal[name] = move.change.to


def move_faults(
    table: StepperTable, name: str, move: StageMove, start: float, goal: float
) -> Iterator[tuple[str, str, str, str]]:
    """What a motor at `start` cannot do of a move to `goal` [m], either NaN where it is not known.

    Key, what it got, what it expected and what to try: places outside its travel, and places that are not on its way.
    """
    change = () if move.change is None else (move.change.at, move.change.to)
    outside = [told for place in (goal, move.turn, *change) if place is not None if (told := _outside(table, place))]
    yield from ((name, *told) for told in outside)
    if outside or math.isnan(start) or math.isnan(goal):
        return
    here, there = table.step_inside(start), table.step_inside(goal)
    way = f"from {table.text(table.position_of(here), 'm', 6)} to {table.text(table.position_of(there), 'm', 6)}"
    if move.turn is not None:
        turn = table.step_inside(move.turn)
        if (turn - here) * (there - turn) >= 0:
            got = f"{table.text(move.turn, 'm', 6)} on the way {way}"
            yield "turn", got, "a place from which the motor comes back", "set turn beyond both, or remove it"
    if move.change is not None:
        at = table.step_inside(move.change.at)
        if at == here or (at - here) * (there - at) < 0:
            got = f"{table.text(move.change.at, 'm', 6)}, which the motor does not pass {way}"
            yield "changed_at", got, "a place on the way, its end included", "set it there, or correct the target"


def _outside(table: StepperTable, place: float) -> tuple[str, str, str] | None:
    """What is wrong with a place: what it got, what it expected and what to try."""
    lower, upper = table.mechanics.lower_end, table.upper_end
    # The end of a travel that is no whole number of steps lies a part of a step beyond the last one.
    end = max(table.steps * table.step, table.limits.travel) + table.step / 2
    if math.isnan(place) or -table.step / 2 <= place - lower <= end:
        return None
    nearest = table.text(lower if place < lower else upper, "m")
    remedy = f"go to {nearest} at the most, or correct limits.travel and mechanics.lower_end of the motor"
    allowed = f"from {table.text(lower, 'm')} to {table.text(upper, 'm')}"
    return f"the position {table.text(place, 'm', 6)}", allowed, remedy
