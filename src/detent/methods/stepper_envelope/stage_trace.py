"""From the trace of a stage to the steps that its motors made, the tables they were made under, and a chart of both."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from detent.control.step_rule import TURN
from detent.methods.stepper_envelope.build import make_step_ramp, stepper_motor, zone_maps
from detent.methods.stepper_envelope.run import MotorMove, StageMoveRecord
from detent.methods.stepper_envelope.schema import StepperTable, ZoneTable
from detent.methods.stepper_envelope.summary import StageFigures, speed_text, units_of
from detent.page.chart import Chart, Curve, Loop, Panel, loop_chart
from detent.page.parts import Numbers
from detent.page.run_page import has
from detent.page.words import GAP, count
from detent.planning.step_envelope import StepEnvelope
from detent.record.trace import Trace

NEEDED_STEPS = ("controller.rule.position", "controller.rule.direction", "controller.timer.period")
"""Registers of a motor that its steps are read from."""

HEADROOM = 1.25  # height of a half of the figure over the motor's limit
LONG_NUMBERS = 1e4  # limit from which on frequencies are written in kHz [Hz]
CROPPED = 0.35  # runs that lie within less than this part of the travel are drawn alone, not with all of it
ARC_POINTS = 4000  # points of all runs of one motor in the figure of frequency against position
MOST_MOVES = 400  # moves of one motor in that figure: more lie on one another
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
        return self.part(*np.searchsorted(self.t, (begin, end)).tolist())

    def part(self, first: int, last: int) -> "MadeSteps":
        """Some of the steps that follow one another."""
        rows = slice(first, last)
        index = None if self.index is None else self.index[rows]
        return MadeSteps(self.t[rows], self.position[rows], self.direction[rows], self.hz[rows], index)


def made_steps(trace: Trace | None, motor: str, clock_hz: float) -> MadeSteps | None:
    """Steps that a motor made; None if the registers are not in the trace."""
    if trace is None or not has(trace, of(motor, NEEDED_STEPS)):
        return None
    position, direction, period = (trace[name].astype(np.int64) for name in of(motor, NEEDED_STEPS))
    new = (period > 0) & (np.diff(position, prepend=position[:1] - direction[:1]) != 0)
    if f"{motor}.controller.rule.state" in trace:
        new &= trace[f"{motor}.controller.rule.state"] != TURN
    rows = np.flatnonzero(new)
    index = trace[f"{motor}.controller.rule.index"][rows] if f"{motor}.controller.rule.index" in trace else None
    return MadeSteps(trace.time[rows], position[rows], direction[rows], clock_hz / period[rows], index)


def recorded_steps(figures: StageFigures, trace: Trace | None) -> dict[str, MadeSteps]:
    """Recorded steps of each motor that made some."""
    found = ((name, made_steps(trace, name, figures.spec.controller.timer)) for name in figures.moved)
    return {name: made for name, made in found if made is not None and len(made.t)}


# ---- runs under their tables


class Envelope(NamedTuple):
    """Permissible step frequency along the travel; each value holds up to the next place."""

    position: Numbers  # places, rising [m], shape (n,)
    up: Numbers  # and down: permissible frequency in each direction, 0 where no step is allowed [Hz], shape (n,)
    down: Numbers  # [Hz]


class Arc(NamedTuple):
    """Steps of one motor that followed one another in one direction, as a curve."""

    direction: int  # 1 up, -1 down
    position: Numbers  # middle of each step [m], shape (n,), with the place of rest before the first and after the last
    hz: Numbers  # frequency of each step [Hz], shape (n,); 0 at both ends


class Leg(NamedTuple):
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
    made = made.between(move.begin, motor.arrived)
    turns = np.flatnonzero(np.diff(made.direction)) + 1
    parts = [made.part(*edges) for edges in pairwise([0, *turns.tolist(), len(made.t)])] if len(made.t) else []
    # Between two rows there may be a step that nobody saw, but not at a turn: the last step there is slow.
    ends = [int(part.position[-1]) for part in parts[:-1]]
    places = [table.step_at(motor.start), *ends, table.step_at(motor.stop)]
    return [Leg(part, *ends) for part, ends in zip(parts, pairwise(places), strict=False)]


def arc_of(leg: Leg, table: StepperTable, points: int) -> Arc:
    """A run as a curve of frequency against position."""
    kept = _corners(leg.made.hz, points - 2)
    places = np.concatenate(([leg.start], leg.made.position[kept] - 0.5 * leg.direction, [leg.stop]))
    hz = np.concatenate(([0.0], leg.made.hz[kept], [0.0]))
    return Arc(direction=leg.direction, position=table.mechanics.lower_end + places * table.step, hz=hz)


def _corners(hz: Numbers, points: int) -> NDArray[np.intp]:
    """Rows that draw like all rows: both ends of every long stretch of one frequency, and some between those."""
    begins = np.concatenate(([0], np.flatnonzero(np.diff(hz)) + 1, [len(hz)]))
    long = np.flatnonzero(np.diff(begins) >= FLAT)
    ends = np.concatenate((begins[long], begins[long + 1] - 1, [0, len(hz) - 1]))
    others = np.unique(np.concatenate((begins[:-1], begins[1:] - 1)))
    spread = np.linspace(0, len(others) - 1, min(len(others), max(points - len(ends), 2))).round().astype(np.intp)
    return np.unique(np.concatenate((ends, others[spread]))).astype(np.intp)


def envelope_of(table: StepperTable, legs: Sequence[Leg] = ()) -> Envelope:
    """Permissible frequency, zones included: between the extremes of a move, or of runs to the ends of the travel."""
    ramp, maps, halves = make_step_ramp(table), zone_maps(table), list[Numbers]()
    extremes = {leg.direction: (leg.start, leg.stop) for leg in reversed(legs)}
    for sign, zones in zip((1, -1), maps, strict=True):
        # The frequency of the last step holds up to the end; there a 0 follows.
        hz = np.zeros(table.steps + 1)
        if not legs or sign in extremes:
            half = StepEnvelope(ramp, zones, sign, *extremes.get(sign, ()))
            run = slice(*sorted((half.start, half.stop)))
            hz[run] = half.permissible_hz()[run]
        halves.append(hz)
    places = np.unique(np.concatenate(([0], *(np.flatnonzero(np.diff(hz)) + 1 for hz in halves))))
    up, down = (hz[places] for hz in halves)
    return Envelope(position=table.mechanics.lower_end + places * table.step, up=up, down=down)


# ---- torque


def step_torques(table: StepperTable, legs: Sequence[Leg]) -> NDArray[np.float64] | None:
    """What every step of a move asks of the motor: its frequency [Hz], pull-out torque there, torque needed [N m].

    Shape (3, n); None where the ramp indices were not recorded, or no step was made.
    """
    motor, ramp, (up, down) = stepper_motor(table), make_step_ramp(table).hz, zone_maps(table)
    rows: list[Numbers] = []
    for leg in legs:
        made, zones = leg.made, up if leg.direction > 0 else down
        if made.index is None:
            return None
        # A period rounded to whole ticks of the timer would feign accelerations larger than those of the ramp; an
        # operator who asks for less than the table allows goes by a frequency of his own.
        planned = np.minimum(ramp[made.index], zones.hz[made.position - (1 if leg.direction > 0 else 0)])
        planned = np.where(np.abs(made.hz / planned - 1) < 0.01, planned, made.hz)
        # Between two rows of the trace the square rises evenly.
        way = np.abs(made.position - leg.start)
        hz = np.sqrt(np.interp(np.arange(1, abs(leg.stop - leg.start) + 1), way, planned**2))
        rows.append(np.array([hz, [motor.pull_out(f) for f in hz.tolist()], motor.needed_torque(hz)]))
    found = np.concatenate(rows, axis=1)
    return found if found.size else None


# ---- frequency against position


@dataclass(frozen=True, slots=True)
class Runs:
    """Runs of one motor under its envelope."""

    name: str  # of the motor
    table: StepperTable
    envelope: Envelope
    arcs: Sequence[Arc]  # in order of time; at least one, if they are to be drawn
    left_out: int = 0  # motions of this motor that are not among them

    @property
    def travel(self) -> tuple[float, float]:
        """Ends of the travel [m]."""
        return self.table.mechanics.lower_end, self.table.upper_end

    @property
    def window(self) -> tuple[float, float]:
        """Part of the travel that is drawn: all of it, or the neighbourhood of the runs if these are short [m]."""
        places = np.concatenate([arc.position for arc in self.arcs])
        low, high = float(places.min()), float(places.max())
        first, last = self.travel
        if high - low > CROPPED * (last - first):
            return self.travel
        room = max(0.12 * (high - low), 10 * self.table.step)
        return max(low - room, first), min(high + room, last)

    @property
    def zones(self) -> dict[str, ZoneTable]:
        """Zones that reach into that part."""
        low, high = self.window
        return {name: zone for name, zone in self.table.zone.items() if zone.begin < high and zone.end > low}

    def permitted(self) -> tuple[Numbers, Numbers, Numbers]:
        """Places in that part, both its ends included, and frequencies up and down."""
        (low, high), envelope = self.window, self.envelope
        inside = envelope.position[(envelope.position > low) & (envelope.position < high)]
        at = np.concatenate(([low], inside, [high]))
        rows = np.searchsorted(envelope.position, at + 0.01 * self.table.step, side="right") - 1
        rows = rows.clip(0, len(envelope.position) - 1)
        return at, envelope.up[rows], envelope.down[rows]


def motor_runs(figures: StageFigures, name: str, made: MadeSteps) -> Runs:
    """Those runs of a motor that were recorded whole."""
    table = figures.spec.stepper[name]
    motions = [motion for motion in figures.motions if motion.name == name]
    whole = [motion for motion in motions if motion.motor.arrived <= made.t[-1] + 1 / made.hz[-1]][:MOST_MOVES]
    points = max(ARC_POINTS // max(len(whole), 1), 12)
    legs = [leg for motion in whole for leg in legs_of(made, table, motion.move, motion.motor)]
    arcs = [arc_of(leg, table, points) for leg in legs]
    return Runs(name, table, envelope_of(table), arcs, left_out=len(motions) - len(whole))


def runs_of(name: str, table: StepperTable, legs: Sequence[Leg], points: int, bounds: Sequence[Leg]) -> Runs:
    """Runs as curves of so many points, under the table between the extremes of `bounds`, or of the travel."""
    return Runs(name, table, envelope_of(table, bounds), [arc_of(leg, table, points) for leg in legs])


def runs_chart(runs: Runs, name: str, *, height: int = 300) -> Chart:
    """Draw the steps of a motor under its envelope, up above zero and down below it."""
    at, up, down = runs.permitted()
    max_hz, place = runs.table.max_hz, units_of(runs.table).place
    scale = place.factor
    unit, per_hz, digits = ("kHz", 1e-3, 4) if max_hz >= LONG_NUMBERS else ("Hz", 1.0, 1)
    permitted = [
        Curve(label=f"permissible, {word}", colour="muted", step=True, fill=True, y=sign * hz * per_hz, digits=digits)
        for word, sign, hz in (("up", 1, up), ("down", -1, down))
        if hz.any()
    ]
    most = max_hz * per_hz
    limit = f"limit {count(round(max_hz))}{GAP}Hz, {speed_text(runs.table, max_hz * runs.table.step)}"
    # A half in which nothing is permitted has little room.
    span = tuple(round(HEADROOM * most * (1.0 if half.any() else 0.1), 3) for half in (down, up))
    panel = Panel(
        name=name, label=f"← down   [{unit}]   up →", height=height, zero=True, span=(-span[0], span[1]),
        levels=[(most, limit), (-most, "" if up.any() else limit)], curves=permitted,
        about=f"Step frequency of {runs.name} over position, under the envelope",
    )  # fmt: skip
    loops = [
        Loop(
            label=f"steps made, {word}", colour=colour, x=arc.position * scale, y=arc.hz * sign * per_hz, digits=digits
        )
        for word, colour, sign in (("up", "right", 1), ("down", "left", -1))
        for arc in runs.arcs
        if arc.direction == sign
    ]
    bands: list[Chart] = []
    for zone_name, zone in runs.zones.items():
        part = [round(zone.begin * scale, 4), round(zone.end * scale, 4)]
        told = f"{zone_name}: {speed_text(runs.table, zone.speed)}".replace(GAP, " ")
        told += "" if zone.direction == "both" else f", {zone.direction} only"
        bands.append({"spans": [part], "colour": "brake", "label": told})
    label = f"position of {runs.name} [{place.name}]"
    return loop_chart(panel, at * scale, label, loops) | {"bands": bands}
