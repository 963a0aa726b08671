"""The host of a servo axis: what a controller above it does to make one move. It sees what the lines show, no more.

The place the axis stands at after power-on is known to the host (a home sensor tells it in a machine).
"""

import math
from dataclasses import dataclass
from typing import Any

from detent.control.deviation_counter import FAULT
from detent.control.pulse_generator import PER_PULSE
from detent.errors import MOST_PROBLEMS, SERVO_FAULT_TEXT, AxisError, FileProblem, InputError
from detent.methods.filtered_servo.schema import FilteredServoSpec
from detent.methods.moves.job import Move, MoveJob
from detent.methods.phase_servo.schema import PhaseServoSpec
from detent.record.machine import AnyRecorder, filtered_servo_machine, phase_servo_machine
from detent.units import format_quantity

ACQUISITION = 0.5
"""Longest time that a phase servo may take to lock and settle after power-on [s]."""

GRID_TOLERANCE = 0.05
"""How far a target may be from a positioning point, in pitches: what a decimal figure of a length misses."""


@dataclass(frozen=True, slots=True)
class Destination:
    """A move as the host commands it.

    Attributes
    ----------
    move : Move
        What was asked.
    position : float
        Where the axis shall stand [m], on its grid.
    counts : int
        The same in counts of the axis from where it stood at power-on.
    """

    move: Move
    position: float
    counts: int


class PhaseHost:
    """Host of a phase servo: set strobe with direction and distance, ready, stop."""

    def __init__(self, spec: PhaseServoSpec, recorder: AnyRecorder | None = None) -> None:
        self.spec = spec
        self.machine = phase_servo_machine(spec, recorder)
        self.grid, self.tolerance = spec.pitch, 2 * spec.step
        self.state: Any = self.machine.state
        self.home = round(spec.mechanics.start_position / spec.pitch) * spec.pitch
        self._counts = 0

    def start(self) -> None:
        """Wait until the axis has locked, settled on the nearest positioning point and is ready."""
        self.machine.pass_time(ACQUISITION)
        s = self.state.sequencer
        if not s.event:
            raise AxisError(
                f"the axis did not become ready within {format_quantity(ACQUISITION, 's')} of power-on: the tracker is "
                "never silent; look for noise on the detector (detector.jitter, disturbance.lines)"
            )
        s.event = 0

    def place(self, move: Move, position: float) -> Destination:
        """Where a move to `position` [m] ends."""
        pitches = round((position - self.home) / self.spec.pitch)
        return Destination(move, self.home + pitches * self.spec.pitch, pitches * self.spec.detector.counts)

    def command(self, to: Destination) -> None:
        """Set strobe."""
        s, distance = self.state.sequencer, to.counts - self._counts
        s.command, s.backward, s.strobe = abs(distance), distance < 0, 1
        self._counts = to.counts

    def time_limit(self, to: Destination) -> float:
        """Time after which a move that is not ready has failed [s]: twice what its way can take, and half a second."""
        way = abs(to.position - self.state.train.position)
        return 0.5 + 2 * (way / self.spec.limits.speed + 2 * math.sqrt(way / self.spec.method.table_acceleration))

    def wait(self, seconds: float) -> bool:
        """Wait until ready; False when it is not within `seconds`."""
        self.machine.pass_time(seconds)
        arrived = bool(self.state.sequencer.event)
        self.state.sequencer.event = 0
        return arrived

    @property
    def failure(self) -> str:
        """Why the axis has given up; a phase servo never does."""
        return ""

    @property
    def switched(self) -> float:
        """When position mode was entered [s]."""
        return self.state.sequencer.switched * self.machine.tick

    def stands(self, dwell: float) -> None:
        """Let the axis stand."""
        self.machine.pass_time(dwell)


class FilteredHost:
    """Host of a filtered servo: command pulses, in position, fault."""

    def __init__(self, spec: FilteredServoSpec, recorder: AnyRecorder | None = None) -> None:
        self.spec = spec
        self.machine = filtered_servo_machine(spec, recorder)
        self.grid = spec.pulse
        self.tolerance = (spec.method.in_position + 1) * spec.pulse
        self.state: Any = self.machine.state
        self.home = spec.mechanics.start_position

    def start(self) -> None:
        """Leave the reset."""
        self.machine.pass_ticks(1)

    def place(self, move: Move, position: float) -> Destination:
        """Where a move to `position` [m] ends."""
        pulses = round((position - self.home) / self.spec.pulse)
        return Destination(move, self.home + pulses * self.spec.pulse, pulses)

    def command(self, to: Destination) -> None:
        """Ask for the pulses; a sample period of the move takes effect with the next window."""
        g, move = self.state.generator, to.move
        g.rate = round((move.speed or self.spec.limits.speed) / self.spec.pulse * PER_PULSE)
        g.goal = to.counts
        self.state.clock.demanded = round((move.sample_period or self.spec.method.sample_period) * 1e6)
        self.state.away, self.state.busy, self.state.event = 1, 1, 0

    def time_limit(self, to: Destination) -> float:
        """Time after which a move that is not in position has failed [s]."""
        speed = to.move.speed or self.spec.limits.speed
        way, a = abs(to.position - self.state.train.position), self.spec.method.command_acceleration
        return way / speed + (2 * speed / a if a > 0 else 0.0) + self.spec.method.timeout

    def wait(self, seconds: float) -> bool:
        """Wait until in position; False on a fault, or when it is not within `seconds`."""
        self.machine.pass_time(seconds)
        arrived = bool(self.state.event) and self.state.deviation.state != FAULT
        self.state.event = 0
        return arrived

    @property
    def failure(self) -> str:
        """Why the axis has given up; empty while it runs."""
        d = self.state.deviation
        return SERVO_FAULT_TEXT[d.cause] if d.state == FAULT else ""

    @property
    def switched(self) -> float:
        """A filtered servo has one mode."""
        return math.nan

    def stands(self, dwell: float) -> None:
        """Let the axis stand; that it comes into position again after a disturbance is no news."""
        left = round(dwell / self.machine.tick)
        while left > 0:
            left -= self.machine.pass_ticks(left)
            self.state.event = 0


Host = PhaseHost | FilteredHost


def check_job(host: Host, job: MoveJob) -> list[Destination]:
    """Destinations of a whole job, before anything moves.

    Raises
    ------
    InputError
        Targets outside the travel, off the positioning points, or too far for the axis; speeds and sample periods that
        it cannot take. All of them, with their lines.
    """
    problems: list[FileProblem] = []
    found: list[Destination] = []
    position = host.home
    for move in job.moves:
        position = position + move.by if move.by is not None else float(move.target or 0.0)
        to = host.place(move, position)
        problems += [p for p in _problems(host, job.name, to, position) if len(problems) < MOST_PROBLEMS]
        position = to.position
        found.append(to)
    if problems:
        raise InputError(problems)
    return found


def _problems(host: Host, name: str, to: Destination, asked: float) -> list[FileProblem]:
    """What is wrong with one move."""
    spec, move = host.spec, to.move
    row = move.row

    def problem(key: str, came: str, allowed: str, remedy: str) -> FileProblem:
        return FileProblem(name, row, 1 if row else 0, key, came, allowed, remedy)

    key = "target" if move.by is None else "by"
    found: list[FileProblem] = []
    travel = spec.limits.travel
    if not 0.0 <= asked <= travel:
        allowed = f"a position from 0 to limits.travel, {format_quantity(travel, 'm', 5)}"
        found.append(problem(key, format_quantity(asked, "m", 6), allowed, "keep the move between the two ends"))
    if isinstance(host, PhaseHost) and abs(asked - to.position) > GRID_TOLERANCE * host.grid:
        low = to.position - host.grid if to.position > asked else to.position
        near = f"{format_quantity(low, 'm', 7)} or {format_quantity(low + host.grid, 'm', 7)}"
        grid = f"a multiple of the detector's pitch, {format_quantity(host.grid, 'm', 6)}"
        found.append(problem(key, format_quantity(asked, "m", 7), grid, f"move to a positioning point: {near}"))
    if isinstance(spec, PhaseServoSpec):
        for word, value in (("speed", move.speed), ("sample_period", move.sample_period)):
            if value is not None:
                allowed = f"no {word}: this axis takes its speed from the velocity table"
                found.append(problem(word, str(value), allowed, "leave it out, or change the axis file"))
        return found
    return found + _bad_rates(spec, move, problem)


def _bad_rates(spec: FilteredServoSpec, move: Move, problem: Any) -> list[FileProblem]:
    """Speed and sample period of a move against the limits of the counters."""
    found: list[FileProblem] = []
    top = spec.limits.speed
    if move.speed is not None and not 0 < move.speed <= top * (1 + 1e-9):
        allowed = f"up to limits.speed, {format_quantity(top, 'm/s')}"
        found.append(problem("speed", format_quantity(move.speed, "m/s"), allowed, "lower it, or raise limits.speed"))
    period = move.sample_period
    if period is None:
        return found
    most = (1 << (spec.method.counter_bits - 1)) - 2
    longest = most * spec.pulse / (move.speed or top)
    if not 1e-4 <= period <= min(longest, 0.1):
        allowed = f"from 0.1 ms to {format_quantity(min(longest, 0.1), 's')}: the speed counter holds {most} pulses"
        came = format_quantity(period, "s")
        found.append(problem("sample_period", came, allowed, "shorten it, lower the speed, or widen the counter"))
    return found
