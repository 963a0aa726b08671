"""What the report of a servo axis shows: plain data, filled from a run of moves.

Everything is SI except what names its unit; a count is a step of a phase servo or a pulse of a filtered servo.
Positions count from the left end, and + is to the right.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

from detent.methods.filtered_servo.comparison import FeedbackComparison
from detent.methods.phase_servo.hold_comparison import HoldComparison
from detent.methods.phase_servo.noise_comparison import NoiseComparison
from detent.page.paper import Marks
from detent.page.parts import Event, Note, Numbers
from detent.page.words import CountUnit


@dataclass(frozen=True, slots=True)
class Worst:
    """The largest of the figures of all moves, and whose it is.

    Attributes
    ----------
    value : float
        In SI units.
    move : int
        Number of the move.
    """

    value: float
    move: int


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveFigures:
    """The figures of a run that a person wants first.

    Attributes
    ----------
    asked, arrived : int
        Moves of the job; those that ended within the tolerance and of which the axis said so.
    seconds : float
        From the first readiness to the end of the job [s].
    rate : float
        Moves per second, dwells included.
    median_time : float
        Median time from the command until within the tolerance for good [s], of the moves that arrived and went
        anywhere; NaN if there are none.
    worst_time : Worst, optional
        The longest of these times [s].
    median_approach, worst_approach : float, Worst
        The same from the mode switch of an axis of two modes [s].
    overshoot, error, peak_speed : Worst, optional
        Farthest beyond a target [m], largest magnitude of target less position at the end of a dwell [m], largest speed
        [m/s]; None if no move was made.
    early : Worst, optional
        The move that was within the tolerance for good latest after the axis had said so, and by how long [s]; None if
        every move was there when the axis said so.
    early_moves : int
        How many moves were not.
    """

    asked: int
    arrived: int
    seconds: float
    rate: float
    median_time: float
    worst_time: Worst | None
    median_approach: float
    worst_approach: Worst | None
    overshoot: Worst | None
    error: Worst | None
    peak_speed: Worst | None
    early: Worst | None
    early_moves: int


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveResult:
    """How one move went; times [s] count from its command, lengths [m].

    Attributes
    ----------
    number : int
        From 1.
    label : str
        The character, in a text.
    begin : float
        When it was commanded, since the first readiness.
    start, target : float
        Where the axis stood, and where it had to go.
    ready : float
        When the axis said that it had arrived; NaN if it did not.
    settled : float
        When it was within the tolerance for good; NaN if it was not.
    overshoot : float
        How far it went beyond the target.
    offset : float
        Position less target at the end of the dwell: plus is to the right of the target.
    """

    number: int
    label: str
    begin: float
    start: float
    target: float
    ready: float
    settled: float
    overshoot: float
    offset: float

    @property
    def way(self) -> float:
        """From where the axis stood to the target [m]."""
        return self.target - self.start


@dataclass(frozen=True, slots=True, kw_only=True)
class JobPath:
    """Where the axis was during the whole job.

    Attributes
    ----------
    t : ndarray
        Time since the first readiness [s], shape (n,).
    position, target : ndarray
        Where it was and where it had to go [m], shape (n,).
    """

    t: Numbers
    position: Numbers
    target: Numbers


@dataclass(frozen=True, slots=True, kw_only=True)
class MovePath:
    """One move from its command to the end of its dwell.

    Attributes
    ----------
    number : int
        Which one.
    why : str
        Why this one is shown: "the move that failed".
    start, target : float
        Where the axis stood, and where it had to go [m].
    t : ndarray
        Time since the command [s], shape (n,).
    position, velocity : ndarray
        True position [m] and velocity [m/s], shape (n,).
    velocity_ref : ndarray
        Demanded velocity [m/s], shape (n,); NaN where none is demanded.
    drive : ndarray
        Drive word [count], shape (n,).
    events : sequence of Event
        In order of time.
    approach : (float, float), optional
        Stretch in which the axis comes to rest at the target [s]; None if it never said that it was there.
    settled : float
        When it was within the tolerance for good [s]; NaN if it was not.
    """

    number: int
    why: str
    start: float
    target: float
    t: Numbers
    position: Numbers
    velocity: Numbers
    velocity_ref: Numbers
    drive: Numbers
    events: Sequence[Event]
    approach: tuple[float, float] | None
    settled: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PhaseMove:
    """What a phase servo knows and does in a move.

    Attributes
    ----------
    path : MovePath
        The move.
    counted_speed : ndarray
        Speed word as a velocity [m/s], shape (n,).
    error_word : ndarray
        Absolute error word, target less position [step], shape (n,); NaN in speed mode.
    integral : ndarray
        Word of the integrator [count], shape (n,).
    position_mode : sequence of (float, float)
        Stretches in which the stop position rules [s].
    """

    path: MovePath
    counted_speed: Numbers
    error_word: Numbers
    integral: Numbers
    position_mode: Sequence[tuple[float, float]]


@dataclass(frozen=True, slots=True, kw_only=True)
class FilteredMove:
    """What a filtered servo knows and does in a move.

    Attributes
    ----------
    path : MovePath
        The move.
    counted_speed : ndarray
        Counted speed times the scale B [pulse], shape (n,).
    filtered_speed : ndarray
        The same after the filter [pulse], shape (n,).
    deviation : ndarray
        Command pulses less movement pulses [pulse], shape (n,).
    """

    path: MovePath
    counted_speed: Numbers
    filtered_speed: Numbers
    deviation: Numbers


@dataclass(frozen=True, slots=True, kw_only=True)
class ServoReportData:
    """Everything `page.make_servo_page` shows. Parts that are None or empty are left out.

    Attributes
    ----------
    axis_name, job_name : str
        As in the axis file; the job's file name.
    kind : str
        "moves", or "text" where each move is a character.
    done : bool
        Every move arrived and stood within the tolerance.
    failure : str
        Why not, and what to do; only read if `done` is False.
    figures : MoveFigures
        The headline figures.
    unit : CountUnit
        The smallest way that the axis knows.
    tolerance : float
        Distance from the target that counts as arrived [m].
    max_speed : float
        Limit of the axis [m/s].
    moves : sequence of MoveResult
        Moves that were made, in order.
    marks : Marks
        Characters that were struck, of a text.
    path : JobPath, optional
        The whole job.
    detail : PhaseMove or FilteredMove, optional
        One move in detail.
    noise, hold, feedback : optional
        Comparisons of the method with its alternatives.
    notes : sequence of Note
        In any order: the page puts errors and warnings first.
    settings : mapping of str to str
        Small print at the page's end: seed, axis file, ...
    version : str
        Of detent; the package's own if empty.
    """

    axis_name: str
    job_name: str
    kind: str
    done: bool
    figures: MoveFigures
    unit: CountUnit
    tolerance: float
    max_speed: float
    failure: str = ""
    moves: Sequence[MoveResult] = ()
    marks: Marks = field(default_factory=Marks)
    path: JobPath | None = None
    detail: PhaseMove | FilteredMove | None = None
    noise: NoiseComparison | None = None
    hold: HoldComparison | None = None
    feedback: FeedbackComparison | None = None
    notes: Sequence[Note] = ()
    settings: dict[str, str] = field(default_factory=dict[str, str])
    version: str = ""
