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
    """One constant of the axis: as identified, and as the simulated machine truly has it."""

    name: str  # such as "slope K, right"
    unit: str  # such as "1/256 count per speed value"
    identified: float | None  # what the axis measured; None if it does not measure it
    true: float | None  # what the simulated machine has; None if there is no truth to compare with (a recorded run)
    meaning: str = ""  # what it is, for someone new


@dataclass(frozen=True, slots=True)
class LineResult:
    """How one line went."""

    number: int  # line number in the job, from 1
    direction: int  # +1 printed to the right, -1 to the left
    speed: float  # commanded print speed [m/s]
    turn_around: bool  # the head came from the line before by a turn-around, without stopping in between
    start: float  # and stop: from the command to zero speed [s], run time
    stop: float  # [s]
    characters: int  # how many were struck
    # worst_error, rms_error: largest and root-mean-square distance between where characters landed and their column
    # [m]; NaN for none
    worst_error: float
    rms_error: float  # [m]


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnErrors:
    """How far from its place every printed column landed, counted in bins."""

    bin_width: float  # width of a bin [m]; the middle bin is centred on zero, the end bins hold everything beyond
    # right, left: columns per bin, printed to the right and to the left, from left of the place to right of it; odd
    # length
    right: Numbers
    left: Numbers
    worst: float  # and rms: largest magnitude and root mean square of all columns [m]
    rms: float  # [m]

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
    """Where the head was during the whole job."""

    t: Numbers  # run time [s]
    position: Numbers  # distance from the left frame [m]
    printing: Numbers  # True between the first and the last character of a line
    travel: float  # distance between the frames [m]
    column0: float  # where column 0 of the paper is, from the left frame [m]


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedProfile:
    """One line from start to stop: speed above, drive below (specification 2.5, 3.10-3.12)."""

    line: int  # number of the line
    direction: int  # +1 or -1
    t: Numbers  # time since the move began [s]
    # velocity, velocity_ref: True and demanded velocity [m/s], right positive; NaN in the reference where there is no
    # demand
    velocity: Numbers
    velocity_ref: Numbers  # [m/s]
    drive: Numbers  # drive value [count], right positive, -300..300
    transition: Numbers  # TR line: the motor is braked by the complemented modulator
    print_span: tuple[float, float] | None = None  # from the first to the last character [s]
    events: Sequence[Event] = ()  # marks, in order of time


@dataclass(frozen=True, slots=True, kw_only=True)
class TurnAround:
    """Motor current while the head reverses (specification 4.4, tests 45 and 48)."""

    line_from: int  # and line_to: numbers of the line that ends and the line that begins
    line_to: int
    t: Numbers  # time since the stop began [s]
    current: Numbers  # motor current [A], right positive; per PWM period mean or finer
    velocity: Numbers  # carriage velocity [m/s], right positive
    transition: Numbers  # TR line
    events: Sequence[Event] = ()  # stop begins, TR off, zero speed, jump, ramp end


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentifiedLine:
    """Drive against speed in one direction: what the axis measured, what it made of it, what is true (figure 16)."""

    direction: int  # +1 or -1
    slope: float  # K in use [1/256 count per speed value]
    friction: float  # Vf in use [count]
    # measured (speed value, drive in counts), the two passes of the identification; empty if it was not run
    points: Sequence[tuple[float, float]] = ()
    true_slope: float | None = None  # and true_friction: the simulated machine's; None if unknown
    true_friction: float | None = None
    # default_slope, default_friction: what the axis would use without identification; None leaves that line out
    default_slope: float | None = None
    default_friction: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportData:
    """Everything `page.make_print_page` shows. Parts that are None or empty are left out."""

    axis_name: str  # and job_name: as in the axis file; the job's file name
    job_name: str
    printed: bool  # the whole job is on paper
    duration: float  # simulated time from the first command of the job to the last zero speed [s]
    line_count: int  # and page_count, character_count: what the job asks for
    page_count: int
    character_count: int
    failure: str = ""  # why not, and what to do; only read if `printed` is False
    lines: Sequence[LineResult] = ()  # lines that were printed, in order
    marks: Marks = field(default_factory=Marks)  # characters that were struck
    errors: ColumnErrors | None = None  # column errors of the whole job
    # largest column error to be called good [m]; marks beyond it are shown in the colour of warnings
    column_limit: float = COLUMN / 2
    path: HeadPath | None = None  # and profile, turn_around: the figures of these names
    profile: SpeedProfile | None = None
    turn_around: TurnAround | None = None
    identified: Sequence[IdentifiedLine] = ()  # right, then left
    constants: Sequence[Constant] = ()  # table of constants
    notes: Sequence[Note] = ()  # in any order: the page puts errors and warnings first
    # small print at the page's end: fidelity, seed, axis file, ...
    settings: dict[str, str] = field(default_factory=dict[str, str])
    version: str = ""  # of detent; the package's own if empty
