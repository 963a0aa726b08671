"""Random steppers, envelopes, extremes and edits, run on the rotor rig and judged step by step.

The tables and the rule hold for any ramp; that the rotor loses no step is promised inside the margin that `step_motors`
states.
"""

import math
from collections import Counter
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from tests.property.numbered_cases import chance, generator, log_uniform, whole
from tests.property.step_motors import RELOAD_TICKS, Axis, draw_axis
from tests.stepper_rig import RELOAD_CLOCK_HZ, Course, Rig

from detent.control.step_rule import DECEL, FAULT, REST
from detent.planning.step_envelope import INDEX_MASK, StepEnvelope, Zone, ZoneMap

PEAK_LAG = 2.0
"""Steps at which the torque curve falls back to 0: a rotor that stays inside has lost nothing."""
MOST_STEPS = 900
MOST_SECONDS = 0.2
"""About as long as one leg may take on the rig [s]."""


# -------------------------------------------------------------------------------------------------------------- places


def draw_zones(rng: np.random.Generator, axis: Axis, steps: int) -> tuple[Zone, ...]:
    """Up to four zones, neighbours included; one that is slower than the start frequency is short."""
    count = whole(rng, 0, 4)
    edges = sorted({whole(rng, 0, steps) for _ in range(2 * count)})
    apart = list(zip(edges[::2], edges[1::2], strict=False))
    places = apart if chance(rng, 0.6) else list(pairwise(edges))[:4]
    start, top = float(axis.ramp.hz[0]), float(axis.ramp.hz[-1])
    zones: list[Zone] = []
    for begin, end in places:
        if chance(rng, 0.1):
            zones.append(Zone(begin, min(end, begin + 5), max(1.0, start * rng.uniform(0.1, 1.0))))
        else:
            zones.append(Zone(begin, end, log_uniform(rng, 0.7 * start, 1.2 * top)))
    return tuple(zones)


def draw_place(rng: np.random.Generator, steps: int) -> int:
    """Anywhere; the ends of the travel often."""
    return steps * whole(rng, 0, 1) if chance(rng, 0.25) else whole(rng, 0, steps)


def draw_steps(rng: np.random.Generator, axis: Axis) -> int:
    """A travel too short for the ramp, or with some way at the full frequency; no longer than a test has time for."""
    most = min(MOST_STEPS, 3 * len(axis.ramp) + 30, MOST_SECONDS * float(axis.ramp.hz.mean()))
    return whole(rng, 1, 6) if chance(rng, 0.1) else whole(rng, 1, max(int(most), 10))


# ------------------------------------------------------------------------------------------------------------- judging


def speed_limits(zones: ZoneMap) -> np.ndarray:
    """Limit of every step, shape (N,) [Hz]."""
    limit = np.full(zones.steps, zones.max_hz)
    for zone in zones.zones:
        limit[zone.begin : zone.end] = zone.max_hz
    return limit


def assert_feasible(table: StepEnvelope) -> None:
    """No entry above its limit; on the way no index rises or falls by more than one; the first and last are 0."""
    along = slice(None, None, table.direction)
    index, hz = table.indices()[along], table.permissible_hz()[along]
    limit = speed_limits(table.zones)[along]
    n = table.steps
    start = table.start if table.direction > 0 else n - table.start
    stop = table.stop if table.direction > 0 else n - table.stop
    assert (hz <= np.minimum(limit, table.ramp.hz[-1])).all(), "an entry exceeds its zone or the ramp"
    if start < stop:
        assert index[start] == index[stop - 1] == 0, "an extreme is not left and reached at the start frequency"
    if stop < n:
        assert index[stop] == -1, "a step beyond the stop is allowed"
    # Beyond the extremes too, for whoever starts there: from behind the start, and from the stop to the travel's end.
    for run in (index[:stop], index[stop + 1 :]):
        assert (run >= 0).all(), "a sentinel on the way"
        assert np.abs(np.diff(run)).max(initial=0) <= 1, "an index differs from its neighbour by more than one"
        assert run[-1:].tolist() in ([], [0]), "the way ends at speed"


@dataclass
class Tables:
    """Ramp index that each table permits, by the position a step departs from, for the steps after `pulses`."""

    pulses: int
    up: np.ndarray
    down: np.ndarray


def tables_of(rig: Rig) -> Tables:
    """The tables as they are now."""
    up, down = (np.where(table < 0, -1, table & INDEX_MASK) for table in map(np.asarray, rig.tables))
    return Tables(rig.timer.pulses, up, down)


def judge_steps(rig: Rig, course: Course, rests: list[int], tables: list[Tables]) -> None:
    """Every step that the rotor was given: within its zone, within its table, and one index from the step before."""
    up = course.direction > 0
    interval = np.where(up, course.position, course.position - 1)
    assert ((interval >= 0) & (interval < rig.zones.steps)).all(), "a step leaves the travel"
    limit = np.where(up, speed_limits(rig.zones)[interval], speed_limits(rig.down_zones)[interval])
    assert (course.hz <= limit * (1 + 1e-9)).all(), "a step is faster than its zone"
    assert not (course.state == FAULT).any(), "a fault"
    path = np.concatenate([[0], course.index])
    assert np.abs(np.diff(path)).max(initial=0) <= 1, "the index changes by more than one from step to step"
    turns = np.flatnonzero(np.diff(course.direction))
    ends = np.array([*turns, *(turns + 1), *(n - 1 for n in rests if n), *(n for n in rests if n < len(path) - 1)], int)
    assert (course.index[ends] == 0).all(), "a rest or a reversal at speed"
    number = np.arange(len(course.index))
    for k, table in enumerate(tables):
        until = tables[k + 1].pulses if k + 1 < len(tables) else len(number)
        for mask, entries in ((up, table.up), (~up, table.down)):
            chosen = mask & (number >= table.pulses) & (number < until)
            assert (course.index[chosen] <= entries[course.position[chosen]]).all(), "a step is faster than its table"


# ------------------------------------------------------------------------------------------------------------- running


@dataclass
class StepCase:
    """One stepper, what is done with it, and what came of it."""

    number: int
    rng: np.random.Generator = field(init=False)
    axis: Axis = field(init=False)
    rig: Rig = field(init=False)
    met: Counter[str] = field(default_factory=Counter)
    rests: list[int] = field(default_factory=lambda: [0])
    tables: list[Tables] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.rng = rng = generator(self.number)
        self.axis = axis = draw_axis(rng)
        steps = draw_steps(rng, axis)
        top = float(axis.ramp.hz[-1])
        up = draw_zones(rng, axis, steps)
        self.rig = Rig(
            steps,
            up,
            turn=draw_place(rng, steps),
            stop=draw_place(rng, steps),
            at=draw_place(rng, steps),
            max_hz=axis.max_hz if chance(rng, 0.7) else top * rng.uniform(0.5, 1.5),
            ramp=axis.ramp,
            motor=axis.motor,
            reload=top * RELOAD_TICKS <= RELOAD_CLOCK_HZ and chance(rng, 0.5),
            pause=1 if axis.must_wait else whole(rng, 0, 1),
            down_zones=None if chance(rng, 0.3) else draw_zones(rng, axis, steps),
        )
        self.rig.log_steps(1.02 * top + 1)
        self.met[type(axis.motor.pull_out).__name__] += 1
        self.met["reload"] += self.rig.p.controller.rule.reload
        self.note_tables(self.rig.up, self.rig.down)

    def note_tables(self, *edited: StepEnvelope) -> None:
        """From the next step on the tables are these, and the edited ones are feasible."""
        for table in edited:
            assert_feasible(table)
        self.tables.append(tables_of(self.rig))

    def end_of(self, heading: int, begin: int) -> int:
        """Where a run that departs from `begin` ends: at the stop, or at the end of the travel when it is behind."""
        table = self.rig.up if heading > 0 else self.rig.down
        last = self.rig.zones.steps if heading > 0 else 0
        return table.stop if heading * (table.stop - begin) >= 0 else last

    # ------------------------------------------------------------------------------------------------------- edits

    def edit_at_rest(self) -> None:
        """Move some extremes of the resting motor."""
        for _ in range(whole(self.rng, 0, 2)):
            table = self.rig.up if chance(self.rng, 0.5) else self.rig.down
            place = draw_place(self.rng, self.rig.zones.steps)
            if chance(self.rng, 0.5):
                table.move_start(place)
            else:
                assert table.move_stop(place).stop == place
            self.met["edit at rest"] += 1
            self.note_tables(table)

    def edit_running(self, heading: int) -> None:
        """Move a stop or a start between two steps of a run, to where it is asked for or as near as possible."""
        rng, rig, rule = self.rng, self.rig, self.rig.rule
        running, other = (rig.up, rig.down) if heading > 0 else (rig.down, rig.up)
        place, kind = draw_place(rng, rig.zones.steps), rng.random()
        if kind < 0.6:
            self.move_stop(heading, place if chance(rng, 0.3) else self.ahead(heading))
        elif kind < 0.75:
            other.move_start(place)
        elif kind < 0.9:
            assert other.move_stop(place).stop == place
        elif abs(place - rule.position) >= rule.index:  # nearer it would have to be passed at speed
            running.move_start(place)
            self.met["start moved on the way"] += 1
        self.note_tables(running if kind < 0.6 or kind >= 0.9 else other)

    def ahead(self, heading: int) -> int:
        """A place about where the motor could just stop, or further on."""
        nearest = self.rig.position + heading * self.rig.rule.index
        if chance(self.rng, 0.5):
            return min(max(nearest + heading * whole(self.rng, -3, 3), 0), self.rig.zones.steps)
        return whole(self.rng, *sorted((nearest, self.rig.zones.steps if heading > 0 else 0)))

    def move_stop(self, heading: int, place: int) -> None:
        """Move the stop of the run: it is where it was asked for, or flagged and one step per index ahead."""
        rig, rule = self.rig, self.rig.rule
        nearest = rule.position + heading * rule.index
        too_near = heading * (nearest - place) > 0
        braking, former = rule.state == DECEL, (rig.up if heading > 0 else rig.down).stop
        edit = rig.edit_stop(place)
        assert (edit.stop, edit.overrun) == ((nearest, True) if too_near else (place, False)), (edit, place, nearest)
        self.met["overrun"] += too_near
        self.met[("outwards" if heading * (edit.stop - former) > 0 else "inwards") + " braking" * braking] += 1

    # -------------------------------------------------------------------------------------------------------- runs

    def run_leg(self, heading: int, begin: int, *, last: bool) -> int:
        """From `begin` to the next sentinel, with edits on the way; returns where that was."""
        rig, end = self.rig, self.end_of(heading, begin)
        for _ in range(whole(self.rng, 0, 2)):
            left = heading * (end - rig.position)
            if left < 1:
                break
            rig.run_to(rig.position + heading * whole(self.rng, 1, left))
            self.edit_running(heading)
            end = self.end_of(heading, rig.position)
        if last:
            rig.run_to_rest()
        elif rig.position != end:
            rig.run_to(end)
        self.met["legs"] += begin != end
        return end

    def run_automatically(self) -> None:
        """To the stop of one direction, perhaps then of the other, and so on."""
        rig = self.rig
        heading, turns = (1 if chance(self.rng, 0.6) else -1), whole(self.rng, 0, 2)
        rig.start(heading, turns)
        for leg in range(turns + 1):
            end = self.run_leg(heading, rig.position, last=leg == turns)
            heading = -heading
        assert rig.position == end, f"the run ended at {rig.position}, not at its stop {end}"
        assert rig.rule.state == REST

    def run_manually(self) -> None:
        """The operator deflects, perhaps turns about, and lets go, or holds on: where the motor then rests."""
        rig, rng, rule = self.rig, self.rng, self.rig.rule
        for _ in range(whole(rng, 1, 3)):
            heading = 1 if chance(rng, 0.5) else -1
            # Turned about at speed it first comes down, one step per index.
            begin = rig.position + rule.direction * max(rule.index, 0) * (heading != rule.direction)
            left = heading * (self.end_of(heading, begin) - rig.position)
            if left < 1:
                break
            self.met["turned about at speed"] += rule.index > 0 and heading != rule.direction
            rig.joystick(float(self.axis.ramp.hz[-1]) * rng.uniform(0.0, 1.1) + 0.5 * self.axis.ramp.hz[0], heading)
            rig.run_to(rig.position + heading * whole(rng, 1, left))
            if chance(rng, 0.3):
                self.edit_running(heading)
        if rule.index < 0:
            return
        end = self.end_of(rule.direction, rig.position)
        if chance(rng, 0.7):
            rig.joystick(0, rule.direction)
            end = rig.position + rule.direction * rule.index
            self.met["let go"] += 1
        rig.run_to_rest()
        assert rig.position == end, f"the motor rests at {rig.position}, not at {end}"

    def run(self) -> None:
        """Edits at rest and runs, the rotor still swinging in the next one or not."""
        for _ in range(whole(self.rng, 1, 2)):
            self.edit_at_rest()
            if chance(self.rng, 0.75):
                self.run_automatically()
            else:
                self.run_manually()
            self.rests.append(self.rig.timer.pulses)
            if chance(self.rng, 0.5):
                self.settle()
            else:
                self.rig.settle(self.rig.p.controller.pause / float(self.axis.ramp.hz[0]))
        self.settle()

    def settle(self) -> None:
        """Until the swing, damped with 0.2 of the critical damping, has fallen to a thousandth: no step is lost."""
        self.rig.settle(math.log(1000) / (0.2 * 2 * math.pi * self.axis.natural_hz))
        lag = self.rig.rotor.peak_lag
        assert self.rig.lost == 0, f"{self.rig.lost} steps are lost"
        assert lag < PEAK_LAG, f"the rotor lagged by {lag} steps"

    def judge(self) -> None:
        """The steps that the rotor was given, and the tables after all edits."""
        judge_steps(self.rig, self.rig.logged(), self.rests, self.tables)
        for table in (self.rig.up, self.rig.down):
            anew = StepEnvelope(table.ramp, table.zones, table.direction, table.start, table.stop)
            assert np.array_equal(table.entries, anew.entries), "an edited table differs from the one built anew"


def run_case(number: int) -> Counter[str]:
    """Draw, run and judge a case; returns what it met."""
    case = StepCase(number)
    case.run()
    case.judge()
    return case.met
