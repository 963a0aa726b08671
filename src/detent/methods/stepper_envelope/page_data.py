"""What the report of a stepper stage shows: plain data, filled from the run of a job.

Units, signs and times are those of `stage_results`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

from detent.methods.stepper_envelope.comparison import JerkComparison, StepComparison
from detent.methods.stepper_envelope.stage_results import MotionResult, StageFigures, StageMoveResult
from detent.page.parts import Event, Note, Numbers

# ---- where the stage was


@dataclass(frozen=True, slots=True, kw_only=True)
class Tile:
    """One place of a list of tiles, and how the stage came there."""

    move: int  # number of the move
    label: str  # name of the tile
    target: tuple[float, float]  # and place: where the stage had to go, and where its rotors stood in the end [m]
    place: tuple[float, float]  # [m]
    seconds: float  # time of the way there, until every rotor was at rest [s]
    lag: float  # largest distance of a rotor from its field on that way [step]
    off: bool  # a rotor stood steps beside its place


@dataclass(frozen=True, slots=True, kw_only=True)
class TilePlan:
    """The tiles as one sees them from above."""

    motors: tuple[str, str]  # what moves the stage to the right, and what moves it up in the picture
    start: tuple[float, float]  # where the stage stood first [m]
    tiles: Sequence[Tile]  # in the order of the visits, at least one


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorPath:
    """Where one motor was."""

    motor: str  # its name
    counted: Numbers  # position of record [m], shape (n,)
    target: Numbers  # where it had to go [m], shape (n,); NaN in a manual run
    rotor: Numbers | None  # where its rotor was [m], shape (n,); None if that was not recorded
    astray: bool  # it lost steps on the way: the counted position is not where it was


@dataclass(frozen=True, slots=True, kw_only=True)
class StagePath:
    """Where the motors were during the job."""

    t: Numbers  # time [s], shape (n,)
    motors: Sequence[MotorPath]  # those that moved, in the order of the axis file


# ---- frequency against position


@dataclass(frozen=True, slots=True)
class ZoneSpan:
    """A stretch of the travel with its own speed limit."""

    name: str  # as in the axis file
    begin: float  # and end: its ends [m]
    end: float  # [m]
    hz: float  # limit [Hz]
    direction: str  # "both", "up" or "down"


@dataclass(frozen=True, slots=True, kw_only=True)
class Envelope:
    """Permissible step frequency along the travel; each value holds up to the next place."""

    position: Numbers  # places, rising [m], shape (n,)
    up: Numbers  # and down: permissible frequency in each direction, 0 where no step is allowed [Hz], shape (n,)
    down: Numbers  # [Hz]


@dataclass(frozen=True, slots=True, kw_only=True)
class Arc:
    """Steps of one motor that followed one another in one direction."""

    direction: int  # 1 up, -1 down
    position: Numbers  # middle of each step [m], shape (n,), with the place of rest before the first and after the last
    hz: Numbers  # frequency of each step [Hz], shape (n,); 0 at both ends


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorRuns:
    """All recorded runs of one motor under its envelope."""

    motor: str  # its name
    step: float  # travel per step [m]
    travel: tuple[float, float]  # ends of the travel [m]
    max_hz: float  # limit of the motor [Hz]
    zones: Sequence[ZoneSpan]  # its zones
    envelope: Envelope  # between the ends of the travel
    arcs: Sequence[Arc]  # in order of time, at least one
    left_out: int  # moves of this motor that are not among them


# ---- one move


@dataclass(frozen=True, slots=True, kw_only=True)
class StepTorques:
    """What every step of a move asks of its motor."""

    hz: Numbers  # frequency of each step [Hz], shape (n,)
    # available, needed: pull-out torque at that frequency, torque for friction and acceleration [N m], shape (n,)
    available: Numbers
    needed: Numbers  # [N m]
    margin: Numbers  # the first over the second, shape (n,); infinite where no torque is needed
    safety: float  # what the ramp divides the pull-out torque by


@dataclass(frozen=True, slots=True, kw_only=True)
class RotorPath:
    """How the rotor followed in one move."""

    t: Numbers  # time since the start signal [s], shape (n,)
    velocity: Numbers  # and velocity_ref: speed of the rotor and of its field, as travel [m/s], shape (n,)
    velocity_ref: Numbers  # [m/s]
    lag: Numbers  # field less rotor [step], shape (n,)
    tolerance: float  # lag that counts as at rest [step]
    events: Sequence[Event]  # in order of time


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveDetail:
    """One motor in one move, step by step."""

    number: int  # number of the move
    label: str  # what the job calls it
    why: str  # why this one is shown: "the motion with the least torque margin"
    motion: MotionResult  # its figures
    runs: MotorRuns  # its steps under the table of this move
    torques: StepTorques | None  # None if the ramp indices were not recorded
    rotor: RotorPath | None  # None if the rotor was not recorded


@dataclass(frozen=True, slots=True, kw_only=True)
class StageReportData:
    """Everything `page.make_stage_page` shows. Parts that are None or empty are left out."""

    axis_name: str  # and job_name: as in the axis file; the job's file name
    job_name: str
    kind: str  # "moves", or "tiles" where the job is a list of tiles
    done: bool  # every move ended in its place and no step was lost
    figures: StageFigures  # the headline figures
    failure: str = ""  # why not, and what to do; only read if `done` is False
    moves: Sequence[StageMoveResult] = ()  # moves that were made, in order
    plan: TilePlan | None = None  # tiles from above
    path: StagePath | None = None  # the whole job
    runs: Sequence[MotorRuns] = ()  # frequency against position, of motors that moved
    detail: MoveDetail | None = None  # one move in detail
    steps: Sequence[StepComparison] = ()  # the method beside its alternatives, by motor
    jerk: JerkComparison | None = None  # the method beside a profile of limited jerk
    notes: Sequence[Note] = ()  # in any order: the page puts errors and warnings first
    settings: dict[str, str] = field(default_factory=dict[str, str])  # small print at the page's end: axis file, ...
    version: str = ""  # of detent; the package's own if empty

    @property
    def word(self) -> str:
        """What a move of this job is called."""
        return "tile" if self.kind == "tiles" else "move"
