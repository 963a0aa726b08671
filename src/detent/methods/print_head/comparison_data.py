"""What the figure shows that compares ways of choosing the drive value: plain data, SI."""

from collections.abc import Sequence
from dataclasses import dataclass

from detent.page.parts import Numbers


@dataclass(frozen=True, slots=True, kw_only=True)
class StartCurve:
    """Speed against time from the start of a move, with one way of choosing the drive value."""

    name: str  # such as "identified"
    t: Numbers  # time since the move began [s]
    velocity: Numbers  # carriage speed [m/s]


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Ways of choosing the drive value, compared on one drifted machine (specification tests 24 and 25)."""

    methods: Sequence[str]  # such as ("power-on default", "nominal table", "identified")
    speeds: Sequence[float]  # commanded speeds [m/s]
    # steady speed error as a fraction of the commanded speed, measured - commanded: shape (methods, speeds, 2), right
    # then left
    errors: Numbers
    starts: Sequence[StartCurve] = ()  # same methods, same order; may be empty
    target: float = 0.0  # commanded speed of `starts` [m/s]
    band: float = 0.01  # half-width of the band of good speed, as a fraction of `target`
    machine: str = ""  # what was done to the machine: "K +10 %, friction +20 %"
