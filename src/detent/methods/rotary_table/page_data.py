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
    """The largest of the figures of all steps, and whose it is."""

    value: float  # in SI units
    step: int  # number of the step


@dataclass(frozen=True, slots=True, kw_only=True)
class SequenceFigures:
    """The figures of a sequence that a person wants first."""

    asked: int  # and made: steps of the sequence, repeats counted; those that came to their end
    made: int
    positionings: int  # and jogs: how many of the steps that were begun are of these kinds
    jogs: int
    seconds: float  # from the start of the sequence to the end of its last step [s]
    travel: float  # way of all steps, in either direction [rad]
    turns: int  # whole turns from where the table stood first to where it stands at the end, signed
    # crossings, rollovers: how often the table crossed the end of its turn, and how often the positioner went back by
    # one turn
    crossings: int
    rollovers: int
    # largest magnitude of target less angle at the end of a positioning [rad]; None if none ended
    error: WorstStep | None
    # largest magnitude of the deviation dR of positionings and jogs [rad]; None if there was none
    deviation: WorstStep | None
    peak_speed: WorstStep | None  # their largest speed [rad/s]


@dataclass(frozen=True, slots=True, kw_only=True)
class StepResult:
    """How one step went."""

    number: int  # from 1, repeats counted
    kind: str  # "go", "jog", "wait" or "output"
    text: str  # what was asked
    begin: float  # and seconds: when it began, and how long it took [s]
    seconds: float  # [s]
    start: float  # and stop: endless angle of the table at both ends [rad]
    stop: float  # [rad]
    offset: float  # angle less target at the end [rad]: plus is beyond it, to larger angles; NaN without a target
    peak_speed: float  # and peak_deviation: largest speed [rad/s], largest magnitude of the deviation [rad]
    peak_deviation: float
    crossings: int  # and rollovers: ends of the turn that were crossed, rollovers of the positioner
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
    """An input or output of the sequence controller."""

    name: str  # as in the job
    spans: Sequence[tuple[float, float]]  # when it was on [s]


@dataclass(frozen=True, slots=True, kw_only=True)
class TablePath:
    """Where the table was during the sequence."""

    t: Numbers  # time [s], shape (n,)
    angle: Numbers  # True endless angle of the table [rad], shape (n,)
    target: Numbers  # endless target of the positioning that is under way [rad], shape (n,); NaN in other steps
    detected: Numbers  # angle D of the detector, within a turn [rad], shape (n,)
    velocity: Numbers  # and velocity_ref: True speed of the table and commanded speed [rad/s], shape (n,)
    velocity_ref: Numbers  # [rad/s]


@dataclass(frozen=True, slots=True, kw_only=True)
class TurnDetail:
    """One step with the angles that the positioner reckons with, as in figure 5 of the specification's source."""

    number: int  # number of the step
    kind: str  # "jog" or "go"
    text: str  # what was asked
    why: str  # why this one is shown: "the jog that crosses the end of the turn most often"
    form: str  # form of the extension: "turn counter", "flag" or "raw"
    failed: bool  # the run broke off in this step
    t: Numbers  # time since the positioner took the step [s], shape (n,)
    # detected, present, command, target: D, R, C and M [rad], shape (n,); M is NaN before the step was taken
    detected: Numbers
    present: Numbers  # [rad]
    command: Numbers  # [rad]
    target: Numbers  # [rad]
    # M less one turn along the motion: where C sets off a rollover [rad], shape (n,); NaN outside a jog
    threshold: Numbers
    turns: Numbers  # and flag: turns n that R has over D, and FLG, shape (n,)
    flag: Numbers
    deviation: Numbers  # deviation dR [rad], positive where the table lags, shape (n,)
    speed_signal: Numbers  # and velocity: speed signal S4 and true speed of the table [rad/s], shape (n,)
    velocity: Numbers  # [rad/s]
    crossings: int  # and rollovers: how many of them are within `t`
    rollovers: int
    events: Sequence[Event]  # in order of time


@dataclass(frozen=True, slots=True, kw_only=True)
class TableReportData:
    """Everything `page.make_table_page` shows. Parts that are None or empty are left out."""

    axis_name: str  # and job_name: as in the axis file; the job's file name
    job_name: str
    done: bool  # every step came to its end
    figures: SequenceFigures  # the headline figures
    count: float  # angle of the table per count [rad]
    in_position: float  # deviation that counts as in position [rad]
    max_speed: float  # limit of the axis [rad/s]
    failure: str = ""  # why not, and what to do; only read if `done` is False
    steps: Sequence[StepResult] = ()  # steps that were begun, in order
    outputs: Sequence[Signal] = ()  # and inputs: signals of the sequence controller
    inputs: Sequence[Signal] = ()
    path: TablePath | None = None  # the whole sequence
    detail: TurnDetail | None = None  # one step in detail
    comparison: AngleComparison | None = None  # the method beside its alternatives
    notes: Sequence[Note] = ()  # in any order: the page puts errors and warnings first
    # small print at the page's end: seed, axis file, ...
    settings: dict[str, str] = field(default_factory=dict[str, str])
    version: str = ""  # of detent; the package's own if empty
