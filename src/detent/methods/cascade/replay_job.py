"""A recording as the job of an axis: what was asked, what was measured, what drove it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from detent.errors import DetentError
from detent.logs.roles import EFFORTS
from detent.methods.cascade.schema import CascadeSpec

Numbers = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ReplayJob:
    """A recording, as far as an axis can replay it; arrays of shape (n,), n >= 3, all finite.

    Attributes
    ----------
    name : str
        Name of the log.
    t : ndarray
        Time [s], strictly increasing.
    position : ndarray
        As measured [m]; of a rotary axis [rad].
    reference : ndarray, optional
        Position asked for [m]; without one the recorded effort drives the axis.
    velocity : ndarray, optional
        As measured [m/s].
    load_position : ndarray, optional
        By a second encoder [m].
    efforts : dict of str to ndarray
        What drove the axis: force [N], torque [N m], current [A], voltage [V], command [V].
    notes : tuple of str
        What was found wrong with the log, and what was guessed.

    Raises
    ------
    DetentError
        There is neither a reference nor an effort, or the arrays do not fit together.
    """

    name: str
    t: Numbers
    position: Numbers
    reference: Numbers | None = None
    velocity: Numbers | None = None
    load_position: Numbers | None = None
    efforts: dict[str, Numbers] = field(default_factory=dict[str, Numbers])
    notes: tuple[str, ...] = ()
    kind: str = "replay"

    def __post_init__(self) -> None:
        """Refuse what no axis could replay."""
        present = [self.t, self.position, *self.efforts.values()]
        present += [x for x in (self.reference, self.velocity, self.load_position) if x is not None]
        if len(self.t) < 3 or any(x.shape != self.t.shape for x in present):
            shapes = ", ".join(str(x.shape) for x in present)
            raise DetentError(f"{self.name}: came signals of shapes {shapes}; allowed: all (n,) with n 3 or more")
        if not (np.diff(self.t) > 0).all() or not all(np.isfinite(x).all() for x in present):
            raise DetentError(
                f"{self.name}: came a time that does not rise, or values that are not finite; allowed: a rising time, "
                "finite values; read the log with detent.identify first"
            )
        if self.reference is None and not self.efforts:
            raise DetentError(
                f"{self.name}: came neither a reference nor a force, current, voltage or command; allowed: one of them "
                "beside the position; name its column: --column 'reference=COLUMN [mm]'"
            )

    @property
    def seconds(self) -> float:
        """Length of the recording [s]."""
        return float(self.t[-1] - self.t[0])


def make_replay_job(
    spec: CascadeSpec,
    name: str,
    t: Numbers,  # time [s], shape (n,)
    signals: Mapping[str, tuple[Numbers, str]],
    notes: Sequence[str] = (),
) -> ReplayJob:
    """The recording of an axis, as its job."""
    if "position" not in signals:
        came = ", ".join(signals) or "no signal"
        raise DetentError(
            f"{name}: came {came}; allowed: a log with a position; name its column: --column 'position=COLUMN [mm]'"
        )
    way = spec.unit("m")
    example = "deg" if way == "rad" else "mm"
    for role, (_, unit) in signals.items():
        kind = unit.partition("/")[0]
        if kind in {"m", "rad", "count"} and kind != way:
            raise DetentError(
                f"{name}: came {role} in {unit}; allowed: {way}, as the axis is a {spec.axis.motion} one; state the "
                f"unit of its column, a number before it for counts: --column '{role}=COLUMN [{example}]'"
            )
    values = {role: found for role, (found, _) in signals.items()}
    return ReplayJob(
        name=name,
        t=t,
        position=values["position"],
        reference=values.get("reference"),
        velocity=values.get("velocity"),
        load_position=values.get("position_load"),
        efforts={role: values[role] for role in EFFORTS if role in values},
        notes=tuple(notes),
    )
