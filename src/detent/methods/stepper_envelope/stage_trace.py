"""From the trace of a stage to the steps that its motors made, and to the tables they were made under."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from detent.control.step_rule import TURN
from detent.methods.stepper_envelope.build import make_tables, stepper_load, stepper_motor, zone_maps
from detent.methods.stepper_envelope.run import MotorMove, StageMoveRecord
from detent.methods.stepper_envelope.schema import StepperTable
from detent.page.parts import Numbers
from detent.page.run_page import has
from detent.planning.step_envelope import StepEnvelope, ZoneMap
from detent.planning.step_ramp import needed_torque, torque_margin
from detent.record.trace import Trace

NEEDED_STEPS = ("controller.rule.position", "controller.rule.direction", "controller.timer.period")
"""Registers of a motor that its steps are read from."""

FLAT = 20  # steps of one frequency that make a stretch of their own in a curve


def of(motor: str, names: Sequence[str]) -> list[str]:
    """Names of a motor's registers in the trace."""
    return [f"{motor}.{name}" for name in names]


@dataclass(frozen=True, slots=True)
class MadeSteps:
    """Steps of one motor as a trace shows them: the last one in each row, as far as it is a new one."""

    t: Numbers  # time of the row [s], shape (n,)
    position: Numbers  # step boundary that the step leads to, shape (n,)
    direction: Numbers  # 1 up, -1 down, shape (n,)
    hz: Numbers  # frequency of the step [Hz], shape (n,)
    index: Numbers | None  # ramp index of the step, shape (n,); None if it was not recorded

    def between(self, begin: float, end: float) -> "MadeSteps":
        """Steps of a stretch of time [s]."""
        return self._rows(slice(*np.searchsorted(self.t, (begin, end)).tolist()))

    def legs(self) -> "list[MadeSteps]":
        """Stretches of one direction, in order of time."""
        turns = np.flatnonzero(np.diff(self.direction)) + 1
        edges = [0, *turns.tolist(), len(self.t)]
        return [self._rows(slice(first, last)) for first, last in pairwise(edges) if first < last]

    def _rows(self, part: slice) -> "MadeSteps":
        index = None if self.index is None else self.index[part]
        return MadeSteps(self.t[part], self.position[part], self.direction[part], self.hz[part], index)


def made_steps(trace: Trace, motor: str, clock_hz: float) -> MadeSteps | None:
    """Steps that a motor made; None if the registers are not in the trace."""
    if not has(trace, of(motor, NEEDED_STEPS)):
        return None
    position, direction, period = (trace[name].astype(np.int64) for name in of(motor, NEEDED_STEPS))
    new = (period > 0) & (np.diff(position, prepend=position[:1] - direction[:1]) != 0)
    if f"{motor}.controller.rule.state" in trace:
        new &= trace[f"{motor}.controller.rule.state"] != TURN
    rows = np.flatnonzero(new)
    index = trace[f"{motor}.controller.rule.index"][rows] if f"{motor}.controller.rule.index" in trace else None
    return MadeSteps(trace.time[rows], position[rows], direction[rows], clock_hz / period[rows], index)


# ---- runs under their tables


@dataclass(frozen=True, slots=True, kw_only=True)
class Envelope:
    """Permissible step frequency along the travel; each value holds up to the next place."""

    position: Numbers  # places, rising [m], shape (n,)
    up: Numbers  # and down: permissible frequency in each direction, 0 where no step is allowed [Hz], shape (n,)
    down: Numbers  # [Hz]


@dataclass(frozen=True, slots=True, kw_only=True)
class Arc:
    """Steps of one motor that followed one another in one direction, as a curve."""

    direction: int  # 1 up, -1 down
    position: Numbers  # middle of each step [m], shape (n,), with the place of rest before the first and after the last
    hz: Numbers  # frequency of each step [Hz], shape (n,); 0 at both ends


@dataclass(frozen=True, slots=True)
class Leg:
    """Steps of one direction, and the extremes they were made between."""

    made: MadeSteps  # at least one
    start: int  # and stop: step boundaries
    stop: int

    @property
    def direction(self) -> int:
        """1 up, -1 down."""
        return int(self.made.direction[0])


def legs_of(made: MadeSteps, table: StepperTable, move: StageMoveRecord, motor: MotorMove) -> list[Leg]:
    """Runs of a motor in a move, from rest or turn to turn or rest."""
    parts = made.between(move.begin, motor.arrived).legs()
    # Between two rows there may be a step that nobody saw, but not at a turn: the last step there is slow.
    ends = [int(part.position[-1]) for part in parts[:-1]]
    places = [table.step_at(motor.start), *ends, table.step_at(motor.stop)]
    return [Leg(part, *ends) for part, ends in zip(parts, pairwise(places), strict=True)] if parts else []


def arc_of(leg: Leg, table: StepperTable, points: int) -> Arc:
    """A run as a curve of frequency against position."""
    made = leg.made
    kept = _corners(made.hz, points - 2)
    middle = made.position[kept] - 0.5 * leg.direction
    places = np.concatenate(([leg.start], middle, [leg.stop]))
    return Arc(
        direction=leg.direction,
        position=table.mechanics.lower_end + places * table.step,
        hz=np.concatenate(([0.0], made.hz[kept], [0.0])),
    )


def _corners(hz: Numbers, points: int) -> NDArray[np.intp]:
    """Rows that draw like all rows: both ends of every long stretch of one frequency, and some between those."""
    begins = np.concatenate(([0], np.flatnonzero(np.diff(hz)) + 1, [len(hz)]))
    long = np.flatnonzero(np.diff(begins) >= FLAT)
    ends = np.concatenate((begins[long], begins[long + 1] - 1, [0, len(hz) - 1]))
    others = np.unique(np.concatenate((begins[:-1], begins[1:] - 1)))
    spread = np.linspace(0, len(others) - 1, min(len(others), max(points - len(ends), 2))).round().astype(np.intp)
    return np.unique(np.concatenate((ends, others[spread]))).astype(np.intp)


def travel_envelope(table: StepperTable) -> Envelope:
    """Permissible frequency between the ends of the travel, zones included."""
    ramp, (up, down) = make_tables(table).ramp, zone_maps(table)
    return _envelope(table, StepEnvelope(ramp, up, 1), StepEnvelope(ramp, down, -1))


def move_envelope(table: StepperTable, legs: Sequence[Leg]) -> Envelope:
    """Permissible frequency between the extremes of a move."""
    ramp, maps = make_tables(table).ramp, zone_maps(table)
    first = {leg.direction: (leg.start, leg.stop) for leg in reversed(legs)}
    up, down = (
        StepEnvelope(ramp, zones, sign, *first[sign]) if sign in first else None
        for sign, zones in zip((1, -1), maps, strict=True)
    )
    return _envelope(table, up, down)


def _envelope(table: StepperTable, up: StepEnvelope | None, down: StepEnvelope | None) -> Envelope:
    """Both directions, each frequency where it begins to hold."""
    hz = [_between_extremes(half, table.steps) for half in (up, down)]
    # The frequency of the last step holds up to the end; there a 0 follows.
    closed = [np.append(half, 0.0) for half in hz]
    changes = [np.flatnonzero(np.diff(half)) + 1 for half in closed]
    places = np.unique(np.concatenate(([0], *changes)))
    return Envelope(
        position=table.mechanics.lower_end + places * table.step, up=closed[0][places], down=closed[1][places]
    )


def _between_extremes(half: StepEnvelope | None, steps: int) -> Numbers:
    hz = np.zeros(steps)
    if half is not None:
        run = slice(*sorted((half.start, half.stop)))
        hz[run] = half.permissible_hz()[run]
    return hz


# ---- torque


@dataclass(frozen=True, slots=True, kw_only=True)
class StepTorques:
    """What every step of a move asks of its motor."""

    hz: Numbers  # frequency of each step [Hz], shape (n,)
    # available, needed: pull-out torque at that frequency, torque for friction and acceleration [N m], shape (n,)
    available: Numbers
    needed: Numbers  # [N m]
    margin: Numbers  # the first over the second, shape (n,); infinite where no torque is needed
    safety: float  # what the ramp divides the pull-out torque by


def step_torques(table: StepperTable, legs: Sequence[Leg]) -> StepTorques | None:
    """What every step of a move asks of the motor."""
    motor, load, maps = stepper_motor(table), stepper_load(table), zone_maps(table)
    ramp = make_tables(table).ramp.hz
    rows: list[Numbers] = []
    for leg in legs:
        planned = _planned_hz(leg, ramp, maps[0] if leg.direction > 0 else maps[1])
        if planned is None:
            return None
        hz = _every_step(leg, planned)
        available = np.array([motor.pull_out(f) for f in hz.tolist()])
        rows.append(np.array([hz, available, needed_torque(motor, load, hz), torque_margin(motor, load, hz)]))
    hz, available, needed, margin = np.concatenate(rows, axis=1)
    if not len(hz):
        return None
    return StepTorques(hz=hz, available=available, needed=needed, margin=margin, safety=table.drive.torque_safety)


def _planned_hz(leg: Leg, ramp: Numbers, zones: ZoneMap) -> Numbers | None:
    """Frequency of each step before it was rounded to whole ticks of the timer.

    A rounded period, a tick off at 4000 Hz and 1 MHz, would feign accelerations larger than those of the ramp.
    """
    made = leg.made
    if made.index is None:
        return None
    interval = made.position - (1 if leg.direction > 0 else 0)
    limit = np.repeat(np.array(zones.limits)[zones.numbers], np.diff(zones.edges))[interval]
    planned = np.minimum(ramp[made.index], limit)
    # An operator who asks for less than the table allows goes by a frequency of his own.
    rounded = np.abs(made.hz / planned - 1) < 0.01
    return np.where(rounded, planned, made.hz)


def _every_step(leg: Leg, hz: Numbers) -> Numbers:
    """Frequencies of all steps of a run, those between two rows included: there the square rises evenly."""
    way = np.abs(leg.made.position - leg.start)
    return np.sqrt(np.interp(np.arange(1, abs(leg.stop - leg.start) + 1), way, hz**2))
