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
    """One place of a list of tiles, and how the stage came there.

    Attributes
    ----------
    move : int
        Number of the move.
    label : str
        Name of the tile.
    target, place : (float, float)
        Where the stage had to go, and where its rotors stood in the end [m].
    seconds : float
        Time of the way there, until every rotor was at rest [s].
    lag : float
        Largest distance of a rotor from its field on that way [step].
    off : bool
        A rotor stood steps beside its place.
    """

    move: int
    label: str
    target: tuple[float, float]
    place: tuple[float, float]
    seconds: float
    lag: float
    off: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class TilePlan:
    """The tiles as one sees them from above.

    Attributes
    ----------
    motors : (str, str)
        What moves the stage to the right, and what moves it up in the picture.
    start : (float, float)
        Where the stage stood first [m].
    tiles : sequence of Tile
        In the order of the visits, at least one.
    """

    motors: tuple[str, str]
    start: tuple[float, float]
    tiles: Sequence[Tile]


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorPath:
    """Where one motor was.

    Attributes
    ----------
    motor : str
        Its name.
    counted : ndarray
        Position of record [m], shape (n,).
    target : ndarray
        Where it had to go [m], shape (n,); NaN in a manual run.
    rotor : ndarray, optional
        Where its rotor was [m], shape (n,); None if that was not recorded.
    astray : bool
        It lost steps on the way: the counted position is not where it was.
    """

    motor: str
    counted: Numbers
    target: Numbers
    rotor: Numbers | None
    astray: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class StagePath:
    """Where the motors were during the job.

    Attributes
    ----------
    t : ndarray
        Time [s], shape (n,).
    motors : sequence of MotorPath
        Those that moved, in the order of the axis file.
    """

    t: Numbers
    motors: Sequence[MotorPath]


# ---- frequency against position


@dataclass(frozen=True, slots=True)
class ZoneSpan:
    """A stretch of the travel with its own speed limit.

    Attributes
    ----------
    name : str
        As in the axis file.
    begin, end : float
        Its ends [m].
    hz : float
        Limit [Hz].
    direction : str
        "both", "up" or "down".
    """

    name: str
    begin: float
    end: float
    hz: float
    direction: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Envelope:
    """Permissible step frequency along the travel; each value holds up to the next place.

    Attributes
    ----------
    position : ndarray
        Places, rising [m], shape (n,).
    up, down : ndarray
        Permissible frequency in each direction, 0 where no step is allowed [Hz], shape (n,).
    """

    position: Numbers
    up: Numbers
    down: Numbers


@dataclass(frozen=True, slots=True, kw_only=True)
class Arc:
    """Steps of one motor that followed one another in one direction.

    Attributes
    ----------
    direction : int
        1 up, -1 down.
    position : ndarray
        Middle of each step [m], shape (n,), with the place of rest before the first and after the last.
    hz : ndarray
        Frequency of each step [Hz], shape (n,); 0 at both ends.
    """

    direction: int
    position: Numbers
    hz: Numbers


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorRuns:
    """All recorded runs of one motor under its envelope.

    Attributes
    ----------
    motor : str
        Its name.
    step : float
        Travel per step [m].
    travel : (float, float)
        Ends of the travel [m].
    max_hz : float
        Limit of the motor [Hz].
    zones : sequence of ZoneSpan
        Its zones.
    envelope : Envelope
        Between the ends of the travel.
    arcs : sequence of Arc
        In order of time, at least one.
    left_out : int
        Moves of this motor that are not among them.
    """

    motor: str
    step: float
    travel: tuple[float, float]
    max_hz: float
    zones: Sequence[ZoneSpan]
    envelope: Envelope
    arcs: Sequence[Arc]
    left_out: int


# ---- one move


@dataclass(frozen=True, slots=True, kw_only=True)
class StepTorques:
    """What every step of a move asks of its motor.

    Attributes
    ----------
    hz : ndarray
        Frequency of each step [Hz], shape (n,).
    available, needed : ndarray
        Pull-out torque at that frequency, torque for friction and acceleration [N m], shape (n,).
    margin : ndarray
        The first over the second, shape (n,); infinite where no torque is needed.
    safety : float
        What the ramp divides the pull-out torque by.
    """

    hz: Numbers
    available: Numbers
    needed: Numbers
    margin: Numbers
    safety: float


@dataclass(frozen=True, slots=True, kw_only=True)
class RotorPath:
    """How the rotor followed in one move.

    Attributes
    ----------
    t : ndarray
        Time since the start signal [s], shape (n,).
    velocity, velocity_ref : ndarray
        Speed of the rotor and of its field, as travel [m/s], shape (n,).
    lag : ndarray
        Field less rotor [step], shape (n,).
    tolerance : float
        Lag that counts as at rest [step].
    events : sequence of Event
        In order of time.
    """

    t: Numbers
    velocity: Numbers
    velocity_ref: Numbers
    lag: Numbers
    tolerance: float
    events: Sequence[Event]


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveDetail:
    """One motor in one move, step by step.

    Attributes
    ----------
    number : int
        Number of the move.
    label : str
        What the job calls it.
    why : str
        Why this one is shown: "the motion with the least torque margin".
    motion : MotionResult
        Its figures.
    runs : MotorRuns
        Its steps under the table of this move.
    torques : StepTorques, optional
        None if the ramp indices were not recorded.
    rotor : RotorPath, optional
        None if the rotor was not recorded.
    """

    number: int
    label: str
    why: str
    motion: MotionResult
    runs: MotorRuns
    torques: StepTorques | None
    rotor: RotorPath | None


@dataclass(frozen=True, slots=True, kw_only=True)
class StageReportData:
    """Everything `page.make_stage_page` shows. Parts that are None or empty are left out.

    Attributes
    ----------
    axis_name, job_name : str
        As in the axis file; the job's file name.
    kind : str
        "moves", or "tiles" where the job is a list of tiles.
    done : bool
        Every move ended in its place and no step was lost.
    failure : str
        Why not, and what to do; only read if `done` is False.
    figures : StageFigures
        The headline figures.
    moves : sequence of StageMoveResult
        Moves that were made, in order.
    plan : TilePlan, optional
        Tiles from above.
    path : StagePath, optional
        The whole job.
    runs : sequence of MotorRuns
        Frequency against position, of motors that moved.
    detail : MoveDetail, optional
        One move in detail.
    steps : sequence of StepComparison
        The method beside its alternatives, by motor.
    jerk : JerkComparison, optional
        The method beside a profile of limited jerk.
    notes : sequence of Note
        In any order: the page puts errors and warnings first.
    settings : mapping of str to str
        Small print at the page's end: axis file, ...
    version : str
        Of detent; the package's own if empty.
    """

    axis_name: str
    job_name: str
    kind: str
    done: bool
    figures: StageFigures
    failure: str = ""
    moves: Sequence[StageMoveResult] = ()
    plan: TilePlan | None = None
    path: StagePath | None = None
    runs: Sequence[MotorRuns] = ()
    detail: MoveDetail | None = None
    steps: Sequence[StepComparison] = ()
    jerk: JerkComparison | None = None
    notes: Sequence[Note] = ()
    settings: dict[str, str] = field(default_factory=dict[str, str])
    version: str = ""

    @property
    def word(self) -> str:
        """What a move of this job is called."""
        return "tile" if self.kind == "tiles" else "move"
