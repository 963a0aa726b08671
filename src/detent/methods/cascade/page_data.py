"""What the reports of a cascade axis show: plain data, filled from a run of moves or from a replayed recording.

Everything is SI; a rotary axis has rad for m.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

from detent.methods.cascade.comparison import ProfileComparison
from detent.methods.cascade.replay import ReplayRun
from detent.methods.cascade.run import CascadeRun
from detent.methods.cascade.units import Units
from detent.page.parts import Event, Note, Numbers


@dataclass(frozen=True, slots=True, kw_only=True)
class CascadePath:
    """Signals over time, arrays of shape (n,).

    Attributes
    ----------
    t : ndarray
        Time [s].
    reference, load, motor : ndarray
        Position asked for, of the load and of the motor [m].
    velocity_ref, velocity : ndarray
        Velocity of the reference and of the load [m/s].
    following : ndarray
        Error of the position loop [m].
    command : ndarray
        Command [V].
    """

    t: Numbers
    reference: Numbers
    load: Numbers
    motor: Numbers
    velocity_ref: Numbers
    velocity: Numbers
    following: Numbers
    command: Numbers


@dataclass(frozen=True, slots=True, kw_only=True)
class CascadeDetail:
    """One move from its begin to its end.

    Attributes
    ----------
    number : int
        Which one.
    why : str
        Why this one is shown: "the fastest move".
    target : float
        Where it went [m].
    path : CascadePath
        Time since its begin.
    events : sequence of Event
        In order of time.
    rest : (float, float), optional
        Stretch in which the load comes to rest [s]; None if its reference never came to the target.
    """

    number: int
    why: str
    target: float
    path: CascadePath
    events: Sequence[Event]
    rest: tuple[float, float] | None


@dataclass(frozen=True, slots=True, kw_only=True)
class CascadeReportData:
    """Everything `page.make_cascade_page` shows; what is None or empty is left out.

    Attributes
    ----------
    axis_name : str
        As in the axis file.
    units : Units
        Of the axis.
    run : CascadeRun
        What came out.
    following_limit : float
        Following error beyond which the drive goes off [m].
    path : CascadePath, optional
        The whole job; time since the axis was ready.
    detail : CascadeDetail, optional
        One move.
    comparison : ProfileComparison, optional
        A move with other profiles, with and without feed-forward.
    notes : sequence of Note
        In any order.
    settings : dict of str to str
        Small print at the page's end.
    version : str
        Of detent; the package's own if empty.
    """

    axis_name: str
    units: Units
    run: CascadeRun
    following_limit: float
    path: CascadePath | None = None
    detail: CascadeDetail | None = None
    comparison: ProfileComparison | None = None
    notes: Sequence[Note] = ()
    settings: dict[str, str] = field(default_factory=dict[str, str])
    version: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplayReportData:
    """Everything `replay_page.make_replay_page` shows.

    Attributes
    ----------
    axis_name : str
        As in the axis file.
    units : Units
        Of the axis.
    run : ReplayRun
        What came out.
    notes : sequence of Note
        In any order.
    settings : dict of str to str
        Small print at the page's end.
    version : str
        Of detent; the package's own if empty.
    """

    axis_name: str
    units: Units
    run: ReplayRun
    notes: Sequence[Note] = ()
    settings: dict[str, str] = field(default_factory=dict[str, str])
    version: str = ""
