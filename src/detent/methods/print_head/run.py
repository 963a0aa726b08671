"""Printing a job on the simulated axis, from power-on: home, identify, print line by line (issue words: the main job).

The supervisor plans the lines, sends the commands with one waiting behind the running one, and loads the columns of the
next line while the present one prints.
"""

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from detent.control.column_timer import COLUMNS
from detent.control.feed_forward import steady_drive
from detent.control.head_computer import IMPLAUSIBLE, LOWEST_FAST_PASS, OBSTRUCTION
from detent.control.speed_selection import HIGH_SPEED
from detent.errors import AxisError, describe_sb1
from detent.files.quantities import INCH
from detent.methods.changes import lay_changes
from detent.methods.print_head import system as print_head
from detent.methods.print_head.build import build_print_head
from detent.methods.print_head.controller import load_line
from detent.methods.print_head.derive import HeadFigures
from detent.methods.print_head.line_plan import Geometry, LinePlan, plan_lines
from detent.methods.print_head.printed_page import PrintedCharacter, PrintJob, PrintLine
from detent.methods.print_head.schema import COLUMN, EMITTER, SPEED_STEP, PrintHeadSpec
from detent.methods.print_head.supervisor import (
    Answer,
    Command,
    Supervisor,
    calculate_parameters,
    print_from,
    run_to,
    set_speed,
)
from detent.record.machine import AnyRecorder, Machine, Progress
from detent.record.run import RunRecord
from detent.units import format_quantity

NOT_FIRED = -(1 << 31)


SIGNALS = (
    "plant.train.position", "plant.train.velocity", "plant.train.current", "plant.train.voltage", "plant.train.energy",
    "controller.head.state", "controller.head.drive_cmd", "lines.transition", "lines.right_left",
    "controller.head.emitter", "controller.head.speed", "controller.head.direction", "controller.head.columns.active",
    "controller.head.columns.fired",
)  # fmt: skip
"""Registers a run records unless told otherwise: enough for the report's figures and most questions."""


def print_head_machine(
    spec: PrintHeadSpec, recorder: AnyRecorder | None = None
) -> Machine[print_head.PrintHeadParams, print_head.PrintHead]:
    """Print head at power-on."""
    p, r = build_print_head(spec), print_head.PrintHead()
    machine = Machine(p, r, print_head.TICK, recorder)
    print_head.switch_on(p, r, spec.mechanics.start_position, spec.encoder.seed, machine.act)
    return machine


@dataclass(frozen=True, slots=True)
class LineRecord:
    """How one line was printed; lengths in metres, times in seconds since power-on."""

    number: int
    direction: int
    speed_value: int
    turn_around: bool
    start: float
    stop: float
    characters: int
    columns: int
    missed: int
    worst_error: float
    rms_error: float

    @property
    def speed(self) -> float:
        """Commanded print speed [m/s]."""
        return self.speed_value * SPEED_STEP

    @property
    def begin(self) -> float:
        """`start`, as the records of every run have it."""
        return self.start

    @property
    def end(self) -> float:
        """`stop`, as the records of every run have it."""
        return self.stop


@dataclass(frozen=True, slots=True)
class Direction:
    """Identification of one direction: what the axis found and what is true."""

    slope: int
    friction: int
    speed_fast: int
    speed_slow: int
    drive_fast: int
    drive_slow: int
    true_slope: float
    true_friction: float
    default_slope: int
    default_friction: int
    valid: bool  # slope and friction are what the axis found; else its defaults stand in for them


@dataclass(frozen=True, slots=True)
class Strike:
    """One printed character and where its middle landed, right of its place [m]; NaN when it was not fired."""

    character: PrintedCharacter
    line: int
    offset: float


@dataclass(repr=False)
class PrintRun(RunRecord[PrintJob]):
    """Outcome of a print job. Times [s], lengths [m], current [A], energy [J].

    Attributes
    ----------
    done : bool
        Every inked column of the job is on paper.
    failure : str
        Why not, and what to do; empty if `done`.
    time_ready, time_end : float
        End of identification, end of the job, since power-on.
    lines : list of LineRecord
        Lines that were printed.
    strikes : list of Strike
        Characters printed, in the order of the lines; bounded by `MOST_STRIKES`.
    characters, columns, missed : int
        Characters printed (one struck twice in place counts once), columns of dots fired, and inked ones passed by.
    worst_error, rms_error : float
        Of where the columns landed, as far as they were printed.
    errors_right, errors_left : ndarray of int, shape (ERROR_BINS,)
        Columns per bin of `ERROR_BIN`, right of their place positive, by direction of printing.
    identified : dict
        By "right" and "left".
    """

    lines: list[LineRecord] = field(default_factory=list[LineRecord])
    strikes: list[Strike] = field(default_factory=list[Strike])
    characters: int = 0
    columns: int = 0
    missed: int = 0
    worst_error: float = 0.0
    rms_error: float = 0.0
    errors_right: NDArray[np.int64] = field(default_factory=lambda: np.zeros(ERROR_BINS, np.int64))
    errors_left: NDArray[np.int64] = field(default_factory=lambda: np.zeros(ERROR_BINS, np.int64))
    turn_arounds: int = 0
    repositions: int = 0
    peak_current: float = 0.0
    energy: float = 0.0
    width: float = 0.0
    identified: dict[str, Direction] = field(default_factory=dict[str, Direction])

    told: ClassVar[tuple[str, ...]] = (
        "print_time", "characters", "characters_per_second", "columns", "missed", "worst_error", "rms_error",
        "turn_arounds", "repositions", "peak_current", "energy", "width",
    )  # fmt: skip
    measured: ClassVar[Mapping[str, str]] = {
        "worst_error": "m", "rms_error": "m", "print_time": "s", "peak_current": "A", "energy": "J",
    }  # fmt: skip

    @property
    def print_time(self) -> float:
        """Time from the end of identification to the end of the job [s]."""
        return self.time_end - self.time_ready

    @property
    def characters_per_second(self) -> float:
        """Characters printed per second of print time."""
        return self.characters / self.print_time if self.print_time > 0 else 0.0

    @property
    def beyond(self) -> int:
        """Columns that landed farther from their nominal position than is good."""
        return int((self.errors_right + self.errors_left)[np.abs(ERROR_PLACES) > COLUMN_LIMIT].sum())

    @property
    def speeds(self) -> dict[int, int]:
        """Lines printed per speed value [1/6 in/s]."""
        return dict(sorted(Counter(line.speed_value for line in self.lines).items(), reverse=True))

    def to_dict(self) -> dict[str, Any]:
        """Plain data for ``--json``."""
        return super().to_dict() | {
            "pages": self.job.pages,
            "speeds": {str(s): n for s, n in self.speeds.items()},
            "identified": {side: asdict(line) for side, line in self.identified.items()},
            "lines": [asdict(line) for line in self.lines],
            "notes": [asdict(note) for note in self.job.notes],
        }


ERROR_BIN = 1e-7  # width of a bin of the column errors [m]
COLUMN_LIMIT = COLUMN / 2  # largest column error to be called good [m]
ERROR_BINS = 6001  # bins of the column errors: 0.3 mm to either side; what lies beyond counts in the end bins
ERROR_PLACES = (np.arange(ERROR_BINS) - ERROR_BINS // 2) * ERROR_BIN  # middle of each bin [m], right of the place > 0
MOST_STRIKES = 20_000  # characters kept one by one for the picture of the pages; the figures count all


def print_job(
    spec: PrintHeadSpec, job: PrintJob, *, recorder: AnyRecorder | None = None, progress: Progress | None = None
) -> PrintRun:
    """Print a job on the axis of `spec`, from power-on."""
    runner = SimulatedPrinting(spec, job, recorder, progress or (lambda _share, _text: None))
    try:
        runner.prepare()
        if not runner.result.failure:
            runner.print_all()
    except AxisError as error:
        runner.result.failure = str(error)
    finally:
        runner.machine.close()
    return runner.finish()


class Printing:
    """A job on an axis: how its lines are to be printed, and what became of them."""

    def __init__(
        self, spec: PrintHeadSpec, job: PrintJob, params: print_head.PrintHeadParams, state: print_head.PrintHead
    ) -> None:
        self.spec, self.job, self.params, self.state = spec, job, params, state
        self.result = PrintRun(job)
        self.head = state.controller.head
        self.buffer: Any = self.head.buffer  # ctypes gives the elements of an array no type
        paper: Any = state.plant.paper
        # By bank of the line buffer: banks alternate with every PRINT, the first is bank 1.
        self.ink: NDArray[np.uint8] = np.ctypeslib.as_array(self.buffer.ink).reshape(2, COLUMNS)
        self.landed: NDArray[np.int32] = np.ctypeslib.as_array(paper.landed).reshape(2, COLUMNS)
        self.plans: tuple[LinePlan, ...] = ()
        self.sum_squares = 0.0

    @property
    def time(self) -> float:
        """Time since power-on [s]."""
        return self.state.tick * print_head.TICK

    def plan(self) -> None:
        """Plan the lines between the frames found."""
        head, p = self.head, self.params.controller
        self.result.time_ready = self.time
        self.result.width = head.width * EMITTER
        self.result.identified = {side: self._direction(side) for side in ("right", "left")}
        if self.result.failure:
            return
        geometry = Geometry(head.width, p.columns.column_zero / 256, max_speed=p.print_speed)
        self.plans = plan_lines(self.job.lines, geometry, head=int(head.emitter), job_name=self.job.name)

    def _unidentified(self, code: int) -> str:
        """Why the axis works with its defaults."""
        top = self.params.controller.run_speed
        if top >= LOWEST_FAST_PASS:
            return describe_sb1(code)
        return (
            f"the axis did not measure itself and uses its defaults; limits.speed, {top / 6:.3g} in/s, is too "
            f"low for two sufficiently different passes; raise it to {LOWEST_FAST_PASS / 6:.3g} in/s, or state "
            "true defaults in method.default_slope and method.default_friction_counts"
        )

    def fail(self, what: str, code: int) -> None:
        """The axis did not do a command: say which, why and where."""
        self.result.failure = f"{what}: {describe_sb1(code)}{self._place(code)}"

    def _place(self, code: int) -> str:
        """Where an obstruction is, as far as the axis knows."""
        head = self.head
        if not code & OBSTRUCTION or head.width <= 0:
            return ""
        p = self.params.controller
        if head.width < p.expected_width - p.width_tolerance:
            return f" (the measured width is {_both(head.width)}, limits.travel is {_both(p.expected_width)})"
        return f" (the head stopped {_both(head.emitter)} from the left frame)"

    def book_line(self, index: int, bank: int, start: float, stop: float) -> None:
        """Read what a finished line left in its bank."""
        line, result = self.plans[index].line, self.result
        inked, landed = self.ink[bank] != 0, self.landed[bank]
        fired = inked & (landed != NOT_FIRED)
        errors: NDArray[np.float64] = landed[fired].astype(np.float64) * 1e-9
        squares = float(errors @ errors)
        worst = float(np.max(np.abs(errors), initial=0.0))
        direction, columns, missed = int(self.buffer.direction[bank]), int(fired.sum()), int((inked & ~fired).sum())
        counted = result.errors_right if direction > 0 else result.errors_left
        counted += count_errors(errors)
        result.lines.append(
            LineRecord(
                number=line.number,
                direction=direction,
                speed_value=int(self.buffer.speed[bank]),
                turn_around=bool(self.buffer.turned[bank]),
                start=start,
                stop=stop,
                characters=len(line.characters),
                columns=columns,
                missed=missed,
                worst_error=worst,
                rms_error=math.sqrt(squares / columns) if columns else math.nan,
            )
        )
        self._book_strikes(line, landed)
        result.characters += len(line.characters)
        result.columns += columns
        result.missed += missed
        result.worst_error = max(result.worst_error, worst)
        self.sum_squares += squares

    def finish(self) -> PrintRun:
        """Fill in the totals."""
        result, head, train = self.result, self.head, self.state.plant.train
        result.time_end = self.time
        result.turn_arounds, result.repositions = int(head.turn_arounds), int(head.repositions)
        result.peak_current, result.energy = train.peak_current, train.energy
        result.rms_error = math.sqrt(self.sum_squares / result.columns) if result.columns else 0.0
        if not result.failure and result.missed:
            result.failure = (
                f"{result.missed} of {result.columns + result.missed} columns were not fired; check the encoder "
                "(missing edges, jitter)"
            )
        if result.beyond:
            result.warnings.append(
                f"{result.beyond} of {result.columns} columns landed more than {format_quantity(COLUMN_LIMIT, 'm', 3)} "
                "from their nominal position; print to the right and to the left does not line up; check the column "
                "errors and the encoder (jitter, missing edges)"
            )
        result.done = not result.failure and len(result.lines) == len(self.job.lines)
        return result

    def _book_strikes(self, line: PrintLine, landed: NDArray[np.int32]) -> None:
        if len(self.result.strikes) + len(line.characters) > MOST_STRIKES:
            return
        for character in line.characters:
            first, last = _ink_span(character)
            found = landed[first:last][landed[first:last] != NOT_FIRED]
            offset = float(found.mean()) * 1e-9 if found.size else math.nan
            self.result.strikes.append(Strike(character, line.number, offset))

    def _direction(self, side: str) -> Direction:
        line, p, true = getattr(self.head, side), self.params.controller, HeadFigures(self.spec)
        return Direction(
            slope=line.slope,
            friction=line.friction,
            speed_fast=line.speed_fast,
            speed_slow=line.speed_slow,
            drive_fast=steady_drive(p.slope_default, p.friction_default, p.run_speed),
            drive_slow=steady_drive(p.slope_default, p.friction_default, HIGH_SPEED),
            true_slope=true.slope[side],
            true_friction=true.coulomb_counts[side],
            default_slope=p.slope_default,
            default_friction=p.friction_default,
            valid=bool(line.valid),
        )


class SimulatedPrinting(Printing):
    """The supervisor's program for one job, from power-on."""

    def __init__(self, spec: PrintHeadSpec, job: PrintJob, recorder: AnyRecorder | None, progress: Progress) -> None:
        self.machine, self.progress = print_head_machine(spec, recorder), progress
        lay_changes({"": self.machine}, job)
        super().__init__(spec, job, self.machine.params, self.machine.state)
        pass_time, controller = self.machine.pass_time, self.state.controller
        self.supervisor = Supervisor(controller, pass_time, self.on_answer, spec.method.ack_last, act=self.machine.act)
        self.began = 0.0

    def prepare(self) -> None:
        """CALCULATE PARAMETERS, then plan the lines."""
        self.progress(0.0, "homing and identification")
        self.supervisor.send(calculate_parameters())
        self.supervisor.finish()
        self.began = self.time
        self.plan()

    def print_all(self) -> None:
        """Send the lines, one waiting behind the running one."""
        preselected = int(self.head.maximum)
        for index, plan in enumerate(self.plans):
            while self.supervisor.outstanding and self.supervisor.outstanding[0].tag != index - 1:
                self.supervisor.await_answer()
            if self.result.failure:
                return
            bank = (index + 1) & 1
            self.landed[bank] = NOT_FIRED
            load_line(self.state.controller, bank, inked(plan.line), self.machine.act)
            for command in line_commands(plan, preselected, index):
                self.supervisor.send(command)
            preselected = plan.speed
        self.supervisor.finish()

    def on_answer(self, answer: Answer) -> None:
        """Book the end of a command."""
        if answer.command.tag >= 0 and answer.byte == 0:
            index = answer.command.tag
            self.book_line(index, (index + 1) & 1, self.began, self.time)
            self.progress((index + 1) / len(self.plans), f"line {index + 1} of {len(self.plans)}")
        elif answer.byte == IMPLAUSIBLE:
            self.result.warnings.append(f"{answer.command.text}: {self._unidentified(answer.byte)}")
        elif answer.byte and not self.result.failure:
            where = f" (line {self.plans[answer.command.tag].line.number})" if answer.command.tag >= 0 else ""
            self.fail(f"{answer.command.text}{where}", answer.byte)
        self.began = self.time


def count_errors(errors: NDArray[np.float64]) -> NDArray[np.int64]:
    """Columns per bin of `ERROR_BIN`, the middle bin centred on zero; errors beyond the ends count in the end bins."""
    bins = np.clip(np.round(errors / ERROR_BIN).astype(np.int64) + ERROR_BINS // 2, 0, ERROR_BINS - 1)
    return np.bincount(bins, minlength=ERROR_BINS).astype(np.int64)


def _both(emitters: int) -> str:
    """A length in the two units people use."""
    return f"{emitters * EMITTER * 1e3:.1f} mm = {emitters * EMITTER / INCH:.2f} in"


def inked(line: PrintLine) -> list[range]:
    """Columns of a line that carry ink."""
    return [range(*_ink_span(one)) for one in line.characters]


def line_commands(plan: LinePlan, preselected: int, tag: int) -> list[Command]:
    """Commands that print a line, with this speed preselected before it."""
    found = [set_speed(plan.speed)] if plan.speed != preselected else []
    if plan.run_to is not None:
        found.append(run_to(plan.run_to))
    return [*found, print_from(plan.print_from, plan.print_to, tag)]


def _ink_span(character: PrintedCharacter) -> tuple[int, int]:
    """Columns of a character that carry ink: its cell less a blank column at each side, first and one past the last."""
    first = min(character.column + 1, COLUMNS - 1)
    return first, min(max(first + 1, character.column + character.ink_columns - 1), COLUMNS)
