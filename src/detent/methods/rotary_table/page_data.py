"""What the report of a rotary table shows: plain data, filled from the run of a sequence.

Angles are those of the table in radians. Endless ones go on beyond a turn; they count from the 0 of the turn in which
the table stood first. Times count from the start of the sequence unless something else is said.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

from detent.methods.rotary_table.comparison import AngleComparison
from detent.page.parts import Event, Note, Numbers


@dataclass(frozen=True, slots=True)
class WorstStep:
    """The largest of the figures of all steps, and whose it is.

    Attributes
    ----------
    value : float
        In SI units.
    step : int
        Number of the step.
    """

    value: float
    step: int


@dataclass(frozen=True, slots=True, kw_only=True)
class SequenceFigures:
    """The figures of a sequence that a person wants first.

    Attributes
    ----------
    asked, made : int
        Steps of the sequence, repeats counted; those that came to their end.
    positionings, jogs : int
        How many of the steps that were begun are of these kinds.
    seconds : float
        From the start of the sequence to the end of its last step [s].
    travel : float
        Way of all steps, in either direction [rad].
    turns : int
        Whole turns from where the table stood first to where it stands at the end, signed.
    crossings, rollovers : int
        How often the table crossed the end of its turn, and how often the positioner went back by one turn.
    error : WorstStep, optional
        Largest magnitude of target less angle at the end of a positioning [rad]; None if none ended.
    deviation : WorstStep, optional
        Largest magnitude of the deviation dR of positionings and jogs [rad]; None if there was none.
    peak_speed : WorstStep, optional
        Their largest speed [rad/s].
    """

    asked: int
    made: int
    positionings: int
    jogs: int
    seconds: float
    travel: float
    turns: int
    crossings: int
    rollovers: int
    error: WorstStep | None
    deviation: WorstStep | None
    peak_speed: WorstStep | None


@dataclass(frozen=True, slots=True, kw_only=True)
class StepResult:
    """How one step went.

    Attributes
    ----------
    number : int
        From 1, repeats counted.
    kind : str
        "go", "jog", "wait" or "output".
    text : str
        What was asked.
    begin, seconds : float
        When it began, and how long it took [s].
    start, stop : float
        Endless angle of the table at both ends [rad].
    offset : float
        Angle less target at the end [rad]: plus is beyond it, to larger angles; NaN without a target.
    peak_speed, peak_deviation : float
        Largest speed [rad/s], largest magnitude of the deviation [rad].
    crossings, rollovers : int
        Ends of the turn that were crossed, rollovers of the positioner.
    """

    number: int
    kind: str
    text: str
    begin: float
    seconds: float
    start: float
    stop: float
    offset: float
    peak_speed: float
    peak_deviation: float
    crossings: int
    rollovers: int

    @property
    def end(self) -> float:
        """When it ended [s]."""
        return self.begin + self.seconds

    @property
    def travel(self) -> float:
        """Way from start to stop, positive to larger angles [rad]."""
        return self.stop - self.start


@dataclass(frozen=True, slots=True)
class Signal:
    """An input or output of the sequence controller.

    Attributes
    ----------
    name : str
        As in the job.
    spans : sequence of (float, float)
        When it was on [s].
    """

    name: str
    spans: Sequence[tuple[float, float]]


@dataclass(frozen=True, slots=True, kw_only=True)
class TablePath:
    """Where the table was during the sequence.

    Attributes
    ----------
    t : ndarray
        Time [s], shape (n,).
    angle : ndarray
        True endless angle of the table [rad], shape (n,).
    target : ndarray
        Endless target of the positioning that is under way [rad], shape (n,); NaN in other steps.
    detected : ndarray
        Angle D of the detector, within a turn [rad], shape (n,).
    velocity, velocity_ref : ndarray
        True speed of the table and commanded speed [rad/s], shape (n,).
    """

    t: Numbers
    angle: Numbers
    target: Numbers
    detected: Numbers
    velocity: Numbers
    velocity_ref: Numbers


@dataclass(frozen=True, slots=True, kw_only=True)
class TurnDetail:
    """One step with the angles that the positioner reckons with, as in figure 5 of the specification's source.

    Attributes
    ----------
    number : int
        Number of the step.
    kind : str
        "jog" or "go".
    text : str
        What was asked.
    why : str
        Why this one is shown: "the jog that crosses the end of the turn most often".
    form : str
        Form of the extension: "turn counter", "flag" or "raw".
    failed : bool
        The run broke off in this step.
    t : ndarray
        Time since the positioner took the step [s], shape (n,).
    detected, present, command, target : ndarray
        D, R, C and M [rad], shape (n,); M is NaN before the step was taken.
    threshold : ndarray
        M less one turn along the motion: where C sets off a rollover [rad], shape (n,); NaN outside a jog.
    turns, flag : ndarray of int
        Turns n that R has over D, and FLG, shape (n,).
    deviation : ndarray
        Deviation dR [rad], positive where the table lags, shape (n,).
    speed_signal, velocity : ndarray
        Speed signal S4 and true speed of the table [rad/s], shape (n,).
    crossings, rollovers : int
        How many of them are within `t`.
    events : sequence of Event
        In order of time.
    """

    number: int
    kind: str
    text: str
    why: str
    form: str
    failed: bool
    t: Numbers
    detected: Numbers
    present: Numbers
    command: Numbers
    target: Numbers
    threshold: Numbers
    turns: Numbers
    flag: Numbers
    deviation: Numbers
    speed_signal: Numbers
    velocity: Numbers
    crossings: int
    rollovers: int
    events: Sequence[Event]


@dataclass(frozen=True, slots=True, kw_only=True)
class TableReportData:
    """Everything `page.make_table_page` shows. Parts that are None or empty are left out.

    Attributes
    ----------
    axis_name, job_name : str
        As in the axis file; the job's file name.
    done : bool
        Every step came to its end.
    failure : str
        Why not, and what to do; only read if `done` is False.
    figures : SequenceFigures
        The headline figures.
    count : float
        Angle of the table per count [rad].
    in_position : float
        Deviation that counts as in position [rad].
    max_speed : float
        Limit of the axis [rad/s].
    steps : sequence of StepResult
        Steps that were begun, in order.
    outputs, inputs : sequence of Signal
        Signals of the sequence controller.
    path : TablePath, optional
        The whole sequence.
    detail : TurnDetail, optional
        One step in detail.
    comparison : AngleComparison, optional
        The method beside its alternatives.
    notes : sequence of Note
        In any order: the page puts errors and warnings first.
    settings : mapping of str to str
        Small print at the page's end: seed, axis file, ...
    version : str
        Of detent; the package's own if empty.
    """

    axis_name: str
    job_name: str
    done: bool
    figures: SequenceFigures
    count: float
    in_position: float
    max_speed: float
    failure: str = ""
    steps: Sequence[StepResult] = ()
    outputs: Sequence[Signal] = ()
    inputs: Sequence[Signal] = ()
    path: TablePath | None = None
    detail: TurnDetail | None = None
    comparison: AngleComparison | None = None
    notes: Sequence[Note] = ()
    settings: dict[str, str] = field(default_factory=dict[str, str])
    version: str = ""
