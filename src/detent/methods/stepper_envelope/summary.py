"""The figures of a stage's job that a person wants first, and the same as rows of text for the terminal."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

from detent.methods.stepper_envelope.run import PULL_OUT_LAG, MotorMove, StageMoveRecord, StageRun
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec
from detent.page.run_page import Worst, worst
from detent.page.units import Units
from detent.page.words import GAP, count, duration, milliseconds, number


class Motion(NamedTuple):
    """How one motor made a move."""

    move: StageMoveRecord
    name: str  # of the motor
    motor: MotorMove
    off: int  # steps that its rotor stands beside its place in the end, those of earlier moves included

    @property
    def seconds(self) -> float:
        """From the start signal to the end of the last step [s]."""
        return self.motor.arrived - self.move.begin


WorstMotion = Worst[Motion] | None


class StageFigures:
    """Sums and extremes of a run, done or not; None where no motion has the figure."""

    def __init__(self, spec: StepperEnvelopeSpec, run: StageRun) -> None:
        self.spec, self.run = spec, run
        self.word = "tile" if run.job.kind == "tiles" else "move"  # what a move of this job is called
        self.asked = run.job.count  # moves of the job
        self.by_move: list[list[Motion]] = []  # motions of each move; none of a move in which all stay
        self.placed = 0  # moves after which every rotor stood in its place: it had lost no step up to then
        lost = dict.fromkeys(spec.stepper, 0)  # steps, up to each move
        for move in run.moves:
            for name, motor in move.motors.items():
                lost[name] += motor.lost
            motions = [Motion(move, name, made, lost[name] + made.missed) for name, made in move.motors.items()]
            self.by_move.append(motions)
            self.placed += not any(lost.values()) and not any(map(self.astray, motions))
        self.motions = [motion for motions in self.by_move for motion in motions]
        names = {motion.name for motion in self.motions}
        self.moved = [name for name in spec.stepper if name in names]
        self.seconds = max(run.time_end - run.time_ready, 0.0) if run.moves else 0.0  # of the whole job
        self.rate = f"{number(run.moves_per_second * 60)} {self.word}s per minute"  # settling and dwells included
        # Time in which a motor ran, the same if each had run at its start frequency [s], and their ratio.
        self.moving = self._longest(lambda motion: motion.seconds)
        self.naive = self._longest(lambda motion: motion.motor.naive)
        self.faster = self.naive / self.moving if self.moving > 0 else math.nan
        self.steps = sum(motion.motor.steps for motion in self.motions)
        self.all_lost = sum(abs(n) for n in run.lost.values())  # by all motors, of either sign
        self.first_lost = next((motion for motion in self.motions if motion.motor.lost), None)
        self.lag = largest(self.motions, lambda motion: motion.motor.peak_lag)  # of a rotor behind its field [step]
        self.rest = largest(self.motions, lambda motion: abs(motion.motor.rest_lag))  # when a move was done [step]
        self.peak_hz = largest(self.motions, lambda motion: motion.motor.peak_hz)
        self.peak_speeds = self._fastest()  # of the motors that slide, and of those that turn
        needy = [motion for motion in self.motions if math.isfinite(motion.motor.margin)]
        least = largest(needy, lambda motion: -motion.motor.margin)
        self.margin = least and Worst(-least.value, least.of)  # smallest torque margin; None if none needed torque

    def _longest(self, time: Callable[[Motion], float]) -> float:
        """Sum over the moves of the longest time of a motor [s]."""
        return sum(max(map(time, motions), default=0.0) for motions in self.by_move)

    def units(self, name: str) -> Units:
        """Units in which places and speeds of a motor are written."""
        return units_of(self.spec.stepper[name])

    def _fastest(self) -> list[str]:
        """The largest speed of the motors with each unit of it, in words."""
        found: dict[Units, float] = {}
        for motion in self.motions:
            table = self.spec.stepper[motion.name]
            speed = motion.motor.peak_hz * table.step
            found[units_of(table)] = max(speed, found.get(units_of(table), 0.0))
        return [units.speed_text(speed) for units, speed in found.items()]

    def astray(self, motion: Motion) -> bool:
        """Whether a motion of its own did not end in its place."""
        return motion.motor.missed != 0 or abs(motion.motor.rest_lag) > self.spec.controller.tolerance

    def whose(self, motion: Motion) -> str:
        """Whose motion it is: "move 1, x"."""
        return f"{called(motion.move, self.run.job.kind)}, {motion.name}"


def largest(motions: Sequence[Motion], figure: Callable[[Motion], float]) -> WorstMotion:
    """The first motion with the largest figure; what is equal in three digits is equal."""
    found = worst(motions, lambda motion: float(f"{figure(motion):.3g}"))
    return found and Worst(figure(found.of), found.of)


def stage_summary_rows(spec: StepperEnvelopeSpec, run: StageRun) -> list[tuple[str, str]]:
    """Name and text of each figure; what a run did not come to is left out."""
    figures = StageFigures(spec, run)
    word, made = figures.word, len(run.moves)
    rows = [(f"{word}s", f"{count(made)} of {count(figures.asked)}")]
    if figures.placed < made:
        rows.append(("in their places", count(figures.placed, word)))
    if run.moves:
        rows.append(("time", f"{duration(figures.seconds)}, {figures.rate}"))
    if figures.steps:
        constant = f"at the constant start frequency {duration(figures.naive)}, {number(figures.faster)} times as long"
        rows.append(("moving", f"{duration(figures.moving)}; {constant}"))
        lost = "0"
        if figures.first_lost:
            by_motor = ", ".join(f"{name} {number(n)}" for name, n in run.lost.items() if n) or "0 in the end"
            lost = f"{by_motor} (from move {count(figures.first_lost.move.number)} on),"
        rows.append(("lost steps", f"{lost} of {count(figures.steps)}"))
    if lag := figures.lag:
        most = number(lag.value) + (" step" if number(lag.value) == "1" else " steps")
        where = f"({figures.whose(lag.of)}); falls out of step at {number(PULL_OUT_LAG)}"
        rows.append(("rotor lag", f"up to {most} {where}"))
    if rest := figures.rest:
        rows.append(("at rest", f"within {number(rest.value, 2)} steps of its place ({figures.whose(rest.of)})"))
    if margin := figures.margin:
        least = number(margin.value)
        rows.append(("torque margin", f"at least {least} ({figures.whose(margin.of)}); falls behind below 1"))
    if peak := figures.peak_hz:
        speeds = " and ".join(figures.peak_speeds)
        rows.append(("peak", f"{count(round(peak.value))} Hz ({figures.whose(peak.of)}), {speeds}"))
    return [(name, text.replace(GAP, " ")) for name, text in rows]


def stated(value: float) -> str:
    """Write a value that a file states, without zeros that nobody wrote.

    >>> stated(0.5), stated(55.000000001), stated(-40.0), stated(87.439)
    ('0.5', '55', '−40', '87.44')
    """
    return f"{float(f'{value:.4g}'):.12g}".replace("-", "−")


class Moving(Protocol):
    """A motor, or what is told of one: it slides or turns what it moves."""

    @property
    def motion(self) -> str:
        """Either "linear" or "rotary"."""
        ...


def units_of(one: Moving) -> Units:
    """Units in which pages write places and speeds of a motor."""
    return Units(rotary=one.motion == "rotary")


def way_text(one: Moving, way: float) -> str:
    """Write a place or a way [m] that a file states, with its unit: 12 mm, or 90 deg of a motor that turns."""
    return f"{stated(way * units_of(one).place.factor)}{GAP}{units_of(one).place.name}"


def speed_text(one: Moving, speed: float) -> str:
    """Write a speed [m/s] that a file states, with its unit."""
    return f"{stated(speed * units_of(one).speed.factor)}{GAP}{units_of(one).speed.name}"


def time_text(seconds: float) -> str:
    """Write a time below 1 s in milliseconds."""
    return milliseconds(seconds) if seconds < 1 else duration(seconds)


def called(move: StageMoveRecord, kind: str) -> str:
    """What a move is called in a sentence: a tile goes by its name."""
    return f"tile {move.label}" if kind == "tiles" and move.label else f"move {count(move.number)}"


def margin_text(motion: Motion) -> str:
    """Write a torque margin; without friction and acceleration no torque is needed."""
    return number(motion.motor.margin) if math.isfinite(motion.motor.margin) else "any"
