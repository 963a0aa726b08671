"""What the report of a print head shows: plain data, filled from a run.

Everything is SI (m, m/s, s, A) except drive values, which are in counts of the axis computer, and what names its unit.
The page turns lengths into inches or micrometres where the trade does. Directions are +1 (right) and -1 (left).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from detent.page.paper import Marks
from detent.page.parts import INCH, Event, Note, Numbers

SPEED_STEP = INCH / 6
"""One speed value of the specification [m/s]: s = 6 v with v in in/s (2.1)."""
COLUMN = INCH / 120
"""The finest column grid of a daisy-wheel printer [m]."""


@dataclass(frozen=True, slots=True)
class Constant:
    """One constant of the axis: as identified, and as the simulated machine truly has it.

    Attributes
    ----------
    name : str
        Such as "slope K, right".
    unit : str
        Such as "1/256 count per speed value".
    identified : float, optional
        What the axis measured; None if it does not measure it.
    true : float, optional
        What the simulated machine has; None if there is no truth to compare with (a recorded run).
    meaning : str
        What it is, for someone new.
    """

    name: str
    unit: str
    identified: float | None
    true: float | None
    meaning: str = ""


@dataclass(frozen=True, slots=True)
class LineResult:
    """How one line went.

    Attributes
    ----------
    number : int
        Line number in the job, from 1.
    direction : int
        +1 printed to the right, -1 to the left.
    speed : float
        Commanded print speed [m/s].
    turn_around : bool
        The head came from the line before by a turn-around, without stopping in between.
    start, stop : float
        From the command to zero speed [s], run time.
    characters : int
        How many were struck.
    worst_error, rms_error : float
        Largest and root-mean-square distance between where characters landed and their column [m]; NaN for none.
    """

    number: int
    direction: int
    speed: float
    turn_around: bool
    start: float
    stop: float
    characters: int
    worst_error: float
    rms_error: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnErrors:
    """How far from its place every printed column landed, counted in bins.

    Attributes
    ----------
    bin_width : float
        Width of a bin [m]; the middle bin is centred on zero, the end bins hold everything beyond.
    right, left : ndarray of int
        Columns per bin, printed to the right and to the left, from left of the place to right of it; odd length.
    worst, rms : float
        Largest magnitude and root mean square of all columns [m].
    """

    bin_width: float
    right: Numbers
    left: Numbers
    worst: float
    rms: float

    @property
    def total(self) -> int:
        """Columns printed."""
        return int(self.right.sum() + self.left.sum())

    @property
    def offsets(self) -> Numbers:
        """Middle of each bin [m], right of the place positive."""
        return (np.arange(len(self.right)) - len(self.right) // 2) * self.bin_width

    def beyond(self, limit: float) -> int:
        """Columns that landed farther than `limit` [m] from their place."""
        far = np.abs(self.offsets) > limit
        return int(self.right[far].sum() + self.left[far].sum())


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadPath:
    """Where the head was during the whole job.

    Attributes
    ----------
    t : ndarray
        Run time [s].
    position : ndarray
        Distance from the left frame [m].
    printing : ndarray of bool
        True between the first and the last character of a line.
    travel : float
        Distance between the frames [m].
    column0 : float
        Where column 0 of the paper is, from the left frame [m].
    """

    t: Numbers
    position: Numbers
    printing: Numbers
    travel: float
    column0: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedProfile:
    """One line from start to stop: speed above, drive below (specification 2.5, 3.10-3.12).

    Attributes
    ----------
    line : int
        Number of the line.
    direction : int
        +1 or -1.
    t : ndarray
        Time since the move began [s].
    velocity, velocity_ref : ndarray
        True and demanded velocity [m/s], right positive; NaN in the reference where there is no demand.
    drive : ndarray
        Drive value [count], right positive, -300..300.
    transition : ndarray of bool
        TR line: the motor is braked by the complemented modulator.
    print_span : (float, float), optional
        From the first to the last character [s].
    events : sequence of Event
        Marks, in order of time.
    """

    line: int
    direction: int
    t: Numbers
    velocity: Numbers
    velocity_ref: Numbers
    drive: Numbers
    transition: Numbers
    print_span: tuple[float, float] | None = None
    events: Sequence[Event] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class TurnAround:
    """Motor current while the head reverses (specification 4.4, tests 45 and 48).

    Attributes
    ----------
    line_from, line_to : int
        Numbers of the line that ends and the line that begins.
    t : ndarray
        Time since the stop began [s].
    current : ndarray
        Motor current [A], right positive; per PWM period mean or finer.
    velocity : ndarray
        Carriage velocity [m/s], right positive.
    transition : ndarray of bool
        TR line.
    events : sequence of Event
        Stop begins, TR off, zero speed, jump, ramp end.
    """

    line_from: int
    line_to: int
    t: Numbers
    current: Numbers
    velocity: Numbers
    transition: Numbers
    events: Sequence[Event] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentifiedLine:
    """Drive against speed in one direction: what the axis measured, what it made of it, what is true (figure 16).

    Attributes
    ----------
    direction : int
        +1 or -1.
    slope : float
        K in use [1/256 count per speed value].
    friction : float
        Vf in use [count].
    points : sequence of (float, float)
        Measured (speed value, drive in counts), the two passes of the identification; empty if it was not run.
    true_slope, true_friction : float, optional
        The simulated machine's; None if unknown.
    default_slope, default_friction : float, optional
        What the axis would use without identification; None leaves that line out.
    """

    direction: int
    slope: float
    friction: float
    points: Sequence[tuple[float, float]] = ()
    true_slope: float | None = None
    true_friction: float | None = None
    default_slope: float | None = None
    default_friction: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportData:
    """Everything `page.make_print_page` shows. Parts that are None or empty are left out.

    Attributes
    ----------
    axis_name, job_name : str
        As in the axis file; the job's file name.
    printed : bool
        The whole job is on paper.
    failure : str
        Why not, and what to do; only read if `printed` is False.
    duration : float
        Simulated time from the first command of the job to the last zero speed [s].
    line_count, page_count, character_count : int
        What the job asks for.
    lines : sequence of LineResult
        Lines that were printed, in order.
    marks : Marks
        Characters that were struck.
    errors : ColumnErrors, optional
        Column errors of the whole job.
    column_limit : float
        Largest column error to be called good [m]; marks beyond it are shown in the colour of warnings.
    path, profile, turn_around : optional
        The figures of these names.
    identified : sequence of IdentifiedLine
        Right, then left.
    constants : sequence of Constant
        Table of constants.
    notes : sequence of Note
        In any order: the page puts errors and warnings first.
    settings : mapping of str to str
        Small print at the page's end: fidelity, seed, axis file, ...
    version : str
        Of detent; the package's own if empty.
    """

    axis_name: str
    job_name: str
    printed: bool
    duration: float
    line_count: int
    page_count: int
    character_count: int
    failure: str = ""
    lines: Sequence[LineResult] = ()
    marks: Marks = field(default_factory=Marks)
    errors: ColumnErrors | None = None
    column_limit: float = COLUMN / 2
    path: HeadPath | None = None
    profile: SpeedProfile | None = None
    turn_around: TurnAround | None = None
    identified: Sequence[IdentifiedLine] = ()
    constants: Sequence[Constant] = ()
    notes: Sequence[Note] = ()
    settings: dict[str, str] = field(default_factory=dict[str, str])
    version: str = ""
