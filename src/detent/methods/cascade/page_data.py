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
    """Signals over time, arrays of shape (n,)."""

    t: Numbers  # time [s]
    reference: Numbers  # and load, motor: position asked for, of the load and of the motor [m]
    load: Numbers  # [m]
    motor: Numbers  # [m]
    velocity_ref: Numbers  # and velocity: velocity of the reference and of the load [m/s]
    velocity: Numbers  # [m/s]
    following: Numbers  # error of the position loop [m]
    command: Numbers  # command [V]


@dataclass(frozen=True, slots=True, kw_only=True)
class CascadeDetail:
    """One move from its begin to its end."""

    number: int  # which one
    why: str  # why this one is shown: "the fastest move"
    target: float  # where it went [m]
    path: CascadePath  # time since its begin
    events: Sequence[Event]  # in order of time
    # stretch in which the load comes to rest [s]; None if its reference never came to the target
    rest: tuple[float, float] | None


@dataclass(frozen=True, slots=True, kw_only=True)
class CascadeReportData:
    """Everything `page.make_cascade_page` shows; what is None or empty is left out."""

    axis_name: str  # as in the axis file
    units: Units  # of the axis
    run: CascadeRun  # what came out
    following_limit: float  # following error beyond which the drive goes off [m]
    path: CascadePath | None = None  # the whole job; time since the axis was ready
    detail: CascadeDetail | None = None  # one move
    comparison: ProfileComparison | None = None  # a move with other profiles, with and without feed-forward
    notes: Sequence[Note] = ()  # in any order
    settings: dict[str, str] = field(default_factory=dict[str, str])  # small print at the page's end
    version: str = ""  # of detent; the package's own if empty


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplayReportData:
    """Everything `replay_page.make_replay_page` shows."""

    axis_name: str  # as in the axis file
    units: Units  # of the axis
    run: ReplayRun  # what came out
    notes: Sequence[Note] = ()  # in any order
    settings: dict[str, str] = field(default_factory=dict[str, str])  # small print at the page's end
    version: str = ""  # of detent; the package's own if empty
