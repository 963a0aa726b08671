"""The stepper envelope beside methods that decide step by step, on an axis's own motors.

Methods A and B work every step out from the distance to the extremes (stepper-envelope specification 3.7), with one
constant acceleration; the naive drives know one frequency.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from detent.control.step_comparison import BRAKING_DISTANCE, CONSTANT_FREQUENCY, PERMISSIBLE_FREQUENCY
from detent.control.step_rule import start_move
from detent.methods.stepper_envelope.build import changed
from detent.methods.stepper_envelope.machine import StageMotor
from detent.methods.stepper_envelope.schema import StepperEnvelopeSpec
from detent.methods.stepper_envelope.summary import stated
from detent.page.figure import Figure
from detent.page.table import Cell, Table, TextTable
from detent.page.words import GAP, count, duration, milliseconds, number
from detent.plant.stepper_rotor import lost_steps
from detent.record.machine import Progress
from detent.units import format_quantity

WAYS = (100, 500, 2000, 8000)  # that are compared where the travel has room [step]; those of acceptance test 16
SETTLING = 0.05  # time that a rotor is given to come to rest before its lost steps are counted (7.2) [s]

A, B = "A: braking distance per step", "B: speed per step"

METHODS = {
    "envelope": (0, "envelope (this method)", "1 table read, 1 comparison, at most 1 increment"),
    A: (BRAKING_DISTANCE, A, "1 or 2 square roots, 1 or 2 divisions"),
    B: (PERMISSIBLE_FREQUENCY, B, "1 square root, 1 multiplication"),
    "start frequency": (CONSTANT_FREQUENCY, "constant start frequency", "nothing"),
    "largest frequency": (CONSTANT_FREQUENCY, "constant largest frequency", "nothing"),
}
"""What is compared: its code (`control.step_comparison`), its name in full, what it works out before every step."""


@dataclass(frozen=True, slots=True)
class Course:
    """One run over a way."""

    seconds: float  # from the start signal to the end of the last period [s]
    lost: int  # steps that the rotor is off in the end
    peak_lag: float  # largest distance of the rotor from its field [step]


@dataclass(frozen=True, slots=True)
class StepComparison:
    """One motor with each method over several ways, upwards from its lower end.

    Attributes
    ----------
    motor : str
        Its name.
    step : float
        Travel per step [m].
    ways : tuple of int
        Ways [step].
    methods : tuple of str
        Their names, the envelope first.
    courses : tuple of tuple of Course
        By method, then by way.
    """

    motor: str
    step: float
    ways: tuple[int, ...]
    methods: tuple[str, ...]
    courses: tuple[tuple[Course, ...], ...]

    def seconds(self, method: int) -> NDArray[np.float64]:
        """Time of each way with a method, shape (ways,) [s]."""
        return np.array([course.seconds for course in self.courses[method]])

    @property
    def table(self) -> TextTable:
        """Time of each way and steps lost, for the terminal."""
        title = f"Motor {self.motor}: time of a way, and steps lost ({format_quantity(self.step, 'm')} a step)"
        heads = ("method", *(f"{way} steps" for way in self.ways), "worked out per step")
        rows: list[tuple[str, ...]] = []
        for method, courses in zip(self.methods, self.courses, strict=True):
            cells = [
                format_quantity(one.seconds, "s") + (f", {abs(one.lost)} lost" if one.lost else "") for one in courses
            ]
            _, name, cost = METHODS[method]
            rows.append((name, *cells, cost))
        return TextTable(title, heads, rows)

    def figures(self) -> tuple[Figure, ...]:
        """The same with bars, and who loses steps."""
        constant = self.courses[self.methods.index("start frequency")][-1].seconds
        times = number(constant / self.courses[0][-1].seconds, 2)
        caption = (
            "The same motor over several ways from its lower end, with its rotor simulated. A and B reckon from the "
            "distance to the extremes how fast every step may be; the envelope looks it up, and is as quick as they "
            f"are where they lose no step. On the longest way it is {times} times as quick as the constant start "
            f"frequency. {_losers(self)}"
        )
        heads = [(f"{count(way, 'step')}, {stated(way * self.step * 1e3)}{GAP}mm", True) for way in self.ways]
        longest = np.max([self.seconds(k) for k in range(len(self.methods))], axis=0).tolist()
        rows: list[list[str | Cell]] = []
        for method, courses in zip(self.methods, self.courses, strict=True):
            _, name, cost = METHODS[method]
            cells: list[str | Cell] = []
            for course, most in zip(courses, longest, strict=True):
                text = time_text(course.seconds)
                if course.lost:
                    text = Markup("{}, <br>{} lost").format(text, count(abs(course.lost)))
                cells.append(Cell(text=text, bar=course.seconds / most, over=course.lost != 0))
            rows.append([Markup("<b>{}</b>").format(name), *cells, cost])
        table = Table(heads=[("", False), *heads, ("worked out before every step", False)], rows=rows)
        return (Figure(title=f"Motor {self.motor}: time of a way, and steps lost", caption=caption, table=table),)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for ``--json``."""
        runs = {
            name: [{"seconds": c.seconds, "lost": c.lost, "peak_lag": c.peak_lag} for c in row]
            for name, row in zip(self.methods, self.courses, strict=True)
        }
        return {"motor": self.motor, "step": self.step, "ways": list(self.ways), "methods": runs}


def time_text(seconds: float) -> str:
    """Write a time below 1 s in milliseconds."""
    return milliseconds(seconds) if seconds < 1 else duration(seconds)


def _losers(found: StepComparison) -> str:
    """Which methods lose steps, and why."""
    lost = {
        method: max(abs(course.lost) for course in courses)
        for method, courses in zip(found.methods, found.courses, strict=True)
    }
    recomputed = [method[:1] for method in (A, B) if lost[method]]
    text = ""
    if recomputed:
        jump = "jump" if len(recomputed) > 1 else "jumps"
        text += (
            f"{' and '.join(recomputed)} {jump} from one speed to the other where a zone begins or torque falls, which "
            "the rotor cannot follow: steps are lost. "
        )
    if lost["largest frequency"]:
        text += "The largest frequency from rest is quicker on paper only: the rotor is left behind."
    return text


def compare_steps(spec: StepperEnvelopeSpec, progress: Progress | None = None) -> tuple[StepComparison, ...]:
    """Run each motor of an axis over several ways with each method, on its rotor."""
    found: list[StepComparison] = []
    for name, table in spec.stepper.items():
        ways = tuple(way for way in WAYS if way <= table.steps) or (table.steps,)
        rows: list[tuple[Course, ...]] = []
        for done, method in enumerate(METHODS):
            if progress is not None:
                progress(done / len(METHODS), f"motor {name}: {method}")
            rows.append(tuple(_course(spec, name, method, way) for way in ways))
        found.append(StepComparison(name, table.step, ways, tuple(METHODS), tuple(rows)))
    return tuple(found)


def _course(spec: StepperEnvelopeSpec, name: str, method: str, way: int) -> Course:
    """One motor with one method over one way from its lower end, on its rotor."""
    table, (code, *_) = spec.stepper[name], METHODS[method]
    table = changed(table, "mechanics.start_position", table.mechanics.lower_end)
    motor = StageMotor(spec.model_copy(update={"stepper": spec.stepper | {name: table}}), name)
    motor.tables.up.move_start(0)
    motor.tables.up.move_stop(way)
    if code:
        start_hz = motor.table.max_hz if method == "largest frequency" else float(motor.tables.ramp.hz[0])
        motor.compare(code, range(way), start_hz)
    start_move(motor.controller.rule, 1)
    motor.advance_to(1 << 60, 0, until_event=True)
    motor.advance_to(motor.r.tick + round(SETTLING / motor.p.plant.rotor.dt), 0, until_event=False)
    rotor = motor.r.plant.rotor
    return Course(motor.rested, lost_steps(motor.p.plant.rotor, rotor), float(rotor.peak_lag))
