"""What the figure shows that compares ways of choosing the drive value: plain data, SI."""

from collections.abc import Sequence
from dataclasses import dataclass

from detent.page.parts import Numbers


@dataclass(frozen=True, slots=True, kw_only=True)
class StartCurve:
    """Speed against time from the start of a move, with one way of choosing the drive value.

    Attributes
    ----------
    name : str
        Such as "identified".
    t : ndarray
        Time since the move began [s].
    velocity : ndarray
        Carriage speed [m/s].
    """

    name: str
    t: Numbers
    velocity: Numbers


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Ways of choosing the drive value, compared on one drifted machine (specification tests 24 and 25).

    Attributes
    ----------
    methods : sequence of str
        Such as ("power-on default", "nominal table", "identified").
    speeds : sequence of float
        Commanded speeds [m/s].
    errors : ndarray
        Steady speed error as a fraction of the commanded speed, measured - commanded: shape (methods, speeds, 2), right
        then left.
    starts : sequence of StartCurve
        Same methods, same order; may be empty.
    target : float
        Commanded speed of `starts` [m/s].
    band : float
        Half-width of the band of good speed, as a fraction of `target`.
    machine : str
        What was done to the machine: "K +10 %, friction +20 %".
    """

    methods: Sequence[str]
    speeds: Sequence[float]
    errors: Numbers
    starts: Sequence[StartCurve] = ()
    target: float = 0.0
    band: float = 0.01
    machine: str = ""
