"""A stepper on the bench: the defaults of stepper-envelope specification 7, with the rotor of 7.2 as the judge."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from detent.control.step_comparison import CONSTANT_FREQUENCY
from detent.control.step_rule import FAULT, PAUSE, REST, STEP, acknowledge, deflect, next_entry, start_move
from detent.kernel.loop import advance, ticks
from detent.kernel.registers import Leaf
from detent.kernel.step import hot_step
from detent.methods.stepper_envelope.controller import NOWHERE, Entries, load_rule, step_once
from detent.methods.stepper_envelope.system import (
    Compared,
    ComparedParams,
    Stepper,
    StepperParams,
    step_compared,
    switch_on,
    tables,
    take_over,
)
from detent.planning.step_envelope import StepEnvelope, StopEdit, Zone, ZoneMap
from detent.planning.step_ramp import FirstOrderPullOut, StepperMotor, StepRamp, make_ramp
from detent.plant.stepper_rotor import RotorParams, fill_curve, lost_steps

N = 8000
START_HZ, MAX_HZ, FINE_HZ = 400.0, 4000.0, 1000.0
A_LIN = 40_000.0


@dataclass(frozen=True)
class Load:
    """What hangs on the shaft."""

    pitch: float
    mass: float
    spindle_inertia: float
    coupling_inertia: float
    friction_torque: float

    @property
    def inertia(self) -> float:
        return self.spindle_inertia + self.coupling_inertia + self.mass * (self.pitch / (2 * math.pi)) ** 2

    @property
    def of_motor(self) -> dict[str, float]:
        """Fields of a motor with this load."""
        return {"load_inertia": self.inertia, "friction_torque": self.friction_torque}


LOAD = Load(pitch=1e-3, mass=0.12, spindle_inertia=6.0e-8, coupling_inertia=5.0e-8, friction_torque=0.006)
MOTOR = StepperMotor(
    steps_per_turn=200,
    rotor_inertia=9.0e-7,
    holding_torque=0.06,
    pull_out=FirstOrderPullOut(torque=0.045, corner_hz=1200.0),
    unloaded_start_hz=900.0,
    **LOAD.of_motor,
)
DT = 2e-6
SETTLE = 0.05
CLOCK_HZ = 1_000_000_000
"""Ticks of the timer that takes frequencies: fine enough for its rounding not to be seen."""

RELOAD_CLOCK_HZ = 1_000_000


def default_ramp(max_hz: float = MAX_HZ) -> StepRamp:
    return make_ramp(START_HZ, max_hz, MOTOR.acceleration_limit(A_LIN))


RAMP = default_ramp()
COARSE_FINE = (Zone(2000, 2600, FINE_HZ), Zone(5000, 6000, FINE_HZ))


def rotor_params(motor: StepperMotor = MOTOR, inertia: float | None = None, top: float = MAX_HZ) -> RotorParams:
    """Rotor of specification 7.2; `inertia` in place of the sum of motor and load [kg m^2], driven up to `top` [Hz]."""
    total = motor.inertia if inertia is None else inertia
    teeth = motor.steps_per_turn / 4
    p = RotorParams(
        dt=DT,
        teeth=teeth,
        step_angle=motor.step_angle,
        inertia=total,
        torque=motor.holding_torque,
        damping=0.4 * math.sqrt(teeth * motor.holding_torque * total),
        friction=motor.friction_torque,
    )
    fill_curve(p, motor.pull_out, top)
    return p


class AloneParams(StepperParams):
    """Parameters of a controller without its plant: as in firmware a tick is a step."""


@ticks(AloneParams)
@hot_step
def tick_alone(p: AloneParams, r: Stepper, up: Entries, down: Entries) -> bool:
    """One step, as firmware makes it; none while the motor rests, or has raised an event."""
    outcome = PAUSE
    while outcome == PAUSE and r.controller.rule.event == 0:
        outcome = step_once(p.controller, r.controller, next_entry(r.controller.rule, up, down))
    if outcome != STEP:
        return False
    r.tick += 1
    return True


class ComparedAloneParams(ComparedParams):
    """A compared method without the rotor: a tick is a step."""


@ticks(ComparedAloneParams)
@hot_step
def tick_compared_alone(p: ComparedAloneParams, r: Compared) -> bool:
    """One step; none while the motor rests, or has raised an event."""
    if r.controller.rule.event or step_compared(p, r) != STEP:
        return False
    r.tick += 1
    return True


@dataclass
class Course:
    """What a run without the rotor was: one value per step, and its whole time [s]."""

    position: np.ndarray
    """Before the step."""

    direction: np.ndarray
    hz: np.ndarray
    index: np.ndarray
    relation: np.ndarray
    state: np.ndarray
    seconds: float


class Rig:
    """One motor at rest at `at`, with tables from `start` up to `turn` and from there down to `stop`."""

    def __init__(
        self,
        steps: int = N,
        zones: Sequence[Zone] = (),
        *,
        turn: int | None = None,
        stop: int = 0,
        at: int = 0,
        max_hz: float = MAX_HZ,
        ramp: StepRamp = RAMP,
        motor: StepperMotor = MOTOR,
        load: Load | None = None,
        inertia: float | None = None,
        reload: bool = False,
        literal: bool = False,
        pause: int = 0,
        down_zones: Sequence[Zone] | None = None,
    ) -> None:
        turn = steps if turn is None else turn
        motor = motor if load is None else replace(motor, **load.of_motor)
        other = zones if down_zones is None else down_zones
        self.ramp, self.zones = ramp, ZoneMap(steps, max_hz, zones, [max_hz, *(zone.max_hz for zone in other)])
        self.down_zones = ZoneMap(steps, max_hz, other, self.zones.limits)
        self.up = StepEnvelope(ramp, self.zones, 1, 0, turn)
        self.down = StepEnvelope(ramp, self.down_zones, -1, turn, stop)
        self.p: Any = StepperParams()
        self.r: Any = Stepper()
        self.clock_hz = RELOAD_CLOCK_HZ if reload else CLOCK_HZ
        load_rule(self.p.controller, ramp, self.zones.limits, self.clock_hz, reload=reload)
        self.p.controller.rule.literal, self.p.controller.pause = literal, pause
        self.p.controller.instant_ticks = round(DT * self.clock_hz)
        self.p.plant.clock_hz = self.clock_hz
        self.p.plant.rotor = rotor_params(motor, inertia, max(max_hz, float(ramp.hz[-1])))
        switch_on(self.r, at, motor.step_angle)
        self.seconds = 0.0
        """Time of all runs so far, up to the end of the last period [s]."""
        self._every = 0
        self._rows: list[np.ndarray] = []

    @property
    def rule(self) -> Any:
        """Registers of the control unit."""
        return self.r.controller.rule

    @property
    def timer(self) -> Any:
        """Registers of the step timer."""
        return self.r.controller.timer

    @property
    def rotor(self) -> Any:
        """Registers of the rotor."""
        return self.r.plant.rotor

    @property
    def position(self) -> int:
        return self.rule.position

    @property
    def hz(self) -> float:
        """Frequency of the running step [Hz]."""
        return self.clock_hz / self.timer.period if self.timer.period else 0.0

    @property
    def lost(self) -> int:
        return lost_steps(self.p.plant.rotor, self.rotor)

    @property
    def tables(self) -> tuple[Any, ...]:
        """What is laid ready: nothing where a method drives that knows no tables."""
        return () if isinstance(self.p, ComparedParams) else tables(self.up.entries, self.down.entries)

    @property
    def alone(self) -> Any:
        """Parameters for running without the rotor."""
        made = ComparedAloneParams if isinstance(self.p, ComparedParams) else AloneParams
        return made.from_buffer(self.p)

    @property
    def resting(self) -> bool:
        return self.rule.index < 0 and self.rule.state in {REST, FAULT} and not self.rule.start

    def flat(self, hz: Sequence[float] | np.ndarray, *, up: bool = True) -> "Rig":
        """Overwrite a table: the literal rule then drives each step i with hz[i], whatever the ramp."""
        limits = sorted(set(hz), reverse=True)
        load_rule(self.p.controller, self.ramp, limits, self.clock_hz, reload=bool(self.p.controller.rule.reload))
        top = len(self.ramp) - 1
        table = self.up.entries[:-1] if up else self.down.entries[1:]
        table[:] = [limits.index(f) << self.p.controller.rule.zone_shift | top for f in hz]
        self.p.controller.rule.literal = 1
        return self

    def constant(self, hz: float) -> "Rig":
        """The naive drive: one frequency from the first step to the last."""
        return self.compared(CONSTANT_FREQUENCY, hz)

    def compared(self, method: int, start_hz: float = START_HZ) -> "Rig":
        """Another method drives, upwards from here to the end of the travel."""
        way = range(self.position, self.zones.steps)
        self.p, self.r = take_over(
            self.p, self.r, self.zones, way, method=method, start_hz=start_hz, acceleration=A_LIN
        )
        return self

    def start(self, heading: int = 1, turns: int = 0) -> "Rig":
        start_move(self.rule, heading, turns)
        return self

    def joystick(self, hz: float, heading: int = 1) -> "Rig":
        """Deflect it as far as `hz` is of the largest frequency; 0 releases."""
        word = hz if not self.p.controller.rule.reload or not hz else self.clock_hz / hz
        deflect(self.p.controller.rule, self.rule, round(word), len(self.ramp) - 1, heading)
        return self

    def run_to(self, position: int) -> "Rig":
        """On the rig, until the step that reaches `position` has begun."""
        self.r.controller.stop_at = position
        begin = self.timer.expires
        self._turn(10**9)
        assert self.position == position
        self.seconds += (self.timer.expires - begin) / self.clock_hz
        self.r.controller.stop_at = NOWHERE
        return self

    def run_to_rest(self) -> "Rig":
        """On the rig, until the motor rests."""
        begin = self.timer.expires
        self._turn(10**9)
        assert self.resting
        self.seconds += (self.timer.expires - begin) / self.clock_hz
        return self

    def settle(self, seconds: float = SETTLE) -> "Rig":
        """Let the rotor come to rest."""
        self._turn(round(seconds / DT))
        return self

    def run(self) -> "Rig":
        """On the rig to rest, then let the rotor settle."""
        return self.run_to_rest().settle()

    def _turn(self, instants: int) -> None:
        acknowledge(self.rule)
        if self._every:
            self._turn_and_log(instants)
        else:
            advance(self.p, self.r, instants, *NO_TRACE, *self.tables)
        acknowledge(self.rule)

    def log_steps(self, fastest_hz: float) -> "Rig":
        """From here on note every step on the rig, none of them faster than `fastest_hz`."""
        self._every = int(self.clock_hz / fastest_hz) // self.p.controller.instant_ticks
        assert self._every > 0, f"{fastest_hz} Hz leave no row between two steps"
        return self

    def _turn_and_log(self, instants: int) -> None:
        """Row by row, often enough for every step to have one."""
        picks, dtype = pick((*COURSE, "controller.timer.pulses"))
        rows = np.zeros((4096, dtype.itemsize), np.uint8)
        while instants > 0 and not self.rule.event:
            first = self.r.tick // self._every + 1
            most = min(instants, (len(rows) - 1) * self._every)
            instants -= advance(self.p, self.r, most, rows, picks, self._every, *self.tables)
            written = np.arange(first, self.r.tick // self._every + 1)
            self._rows.append(rows[written % len(rows)].view(dtype)[:, 0])

    def logged(self) -> Course:
        """Every step on the rig since `log_steps`, each one once."""
        rows = np.concatenate(self._rows)
        pulses, first = np.unique(rows["controller.timer.pulses"], return_index=True)
        first = first[pulses > 0]
        assert len(first) == self.timer.pulses, "a step has no row"
        return course_of(rows[first], self.clock_hz, self.seconds)

    def edit_stop(self, position: int) -> StopEdit:
        """Move the stop extreme of the running direction between two steps."""
        rule = self.rule
        table = self.up if rule.direction > 0 else self.down
        return table.move_stop(position, rule.position, rule.index)

    def course(self, most: int = 10**7) -> Course:
        """Run without the rotor until the motor rests or an event comes; one row per step."""
        picks, dtype = pick(COURSE)
        rows = np.zeros((min(most, 3 * self.zones.steps + 10), dtype.itemsize), np.uint8)
        begin, first = self.timer.expires, self.r.tick
        acknowledge(self.rule)
        done = advance(self.alone, self.r, min(most, len(rows)), rows, picks, 1, *self.tables)
        acknowledge(self.rule)
        found = rows[np.arange(first + 1, first + done + 1) % len(rows)].view(dtype)[:, 0]
        return course_of(found, self.clock_hz, (self.timer.expires - begin) / self.clock_hz)


NO_TRACE = (np.zeros((1, 1), np.uint8), np.zeros(0, np.int64), 0)
COURSE = (
    "controller.rule.position",
    "controller.rule.direction",
    "controller.timer.period",
    "controller.rule.index",
    "controller.rule.relation",
    "controller.rule.state",
)


@cache
def pick(names: tuple[str, ...]) -> tuple[np.ndarray, Any]:
    """Byte offsets of registers and the type of a row of them."""
    leaves: dict[str, Leaf] = {leaf.path: leaf for leaf in Stepper.leaves()}
    chosen = [leaves[name] for name in names]
    picks = np.concatenate([np.arange(c.offset, c.offset + c.width.size) for c in chosen]).astype(np.int64)
    return picks, np.dtype([(c.path, "<" + c.width.code) for c in chosen])


def course_of(rows: np.ndarray, clock_hz: int, seconds: float) -> Course:
    """One row per step, as a course."""
    direction = rows["controller.rule.direction"].astype(np.int64)
    return Course(
        position=rows["controller.rule.position"] - direction,
        direction=direction,
        hz=clock_hz / rows["controller.timer.period"],
        index=rows["controller.rule.index"].astype(np.int64),
        relation=rows["controller.rule.relation"].astype(np.int64),
        state=rows["controller.rule.state"].astype(np.int64),
        seconds=seconds,
    )


def heavier(load: Load, **changes: float) -> Load:
    """The load with other figures."""
    return replace(load, **changes)


def envelope(steps: int, zones: Sequence[Zone] = (), ramp: StepRamp = RAMP, max_hz: float = MAX_HZ) -> StepEnvelope:
    """Table upwards between the ends of the travel."""
    return StepEnvelope(ramp, ZoneMap(steps, max_hz, zones))


def turn_envelopes(
    ramp: StepRamp, zones: ZoneMap, start: int, turn: int, stop: int
) -> tuple[StepEnvelope, StepEnvelope]:
    """Both tables of a run from `start` up to `turn` and down to `stop`, with the same zones in both directions."""
    return StepEnvelope(ramp, zones, 1, start, turn), StepEnvelope(ramp, zones, -1, turn, stop)
