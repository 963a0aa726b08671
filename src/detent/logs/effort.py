"""What drives the axis, held against its motion: a force that works against it, or lost its sign.

A drive moves an axis by ``F = m a + c v + d sign(v) + k x + g`` with ``m, c, d >= 0``: it accelerates mass and feeds
friction. For a voltage or a duty cycle the back-EMF adds to ``c``. ``k x`` stands for springs and, near one position,
for gravity.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from detent.logs.differences import grain, smooth, window_rows
from detent.logs.draft import Draft
from detent.logs.log import Action, Kind, Severity, Values
from detent.logs.roles import EFFORTS

EXPLAINED = 0.3  # share of the variance of an effort that the motion must explain before its sign is judged
AGAINST = -0.3  # sum of the shares (standardised) of inertia and friction below which an effort has the wrong sign
_FEWEST = 50
_HELPS = 0.15
_LOSES = 0.5


class Motion(NamedTuple):
    """A motion smoothed over windows, across no gap."""

    x: Values  # and v, a: position, velocity, acceleration, shape (m,)
    v: Values
    a: Values
    rows: int  # rows of the window


def find_motion(draft: Draft) -> Motion | None:
    """Velocity and acceleration from the position, by a parabola through each window."""
    position = draft.values.get("position")
    if position is None or np.ptp(position) <= 20 * grain(position):
        return None
    rows = 2 * window_rows(position) + 1
    samples, (x, v, a) = smooth(position, draft.t, rows)
    return Motion(x, v, a, rows) if len(samples) >= _FEWEST else None


def smoothed(values: Values, draft: Draft, motion: Motion) -> Values:
    """A signal through the same windows as a motion, shape (m,): what is compared has the same delay."""
    return smooth(values, draft.t, motion.rows)[1][0]


def find_wrong_effort(draft: Draft) -> None:
    """Find efforts that work against the motion they should cause, and efforts without their sign.

    The effort is fitted by the terms of the equation above. Its sign is wrong where the parts of inertia and friction
    are negative together; friction that feeds an axis does not exist. An effort is left as it is: which of the two,
    effort or position, counts the other way the recording does not tell.
    """
    motion = find_motion(draft)
    if motion is None:
        return
    for role in EFFORTS:
        if role in draft.values:
            effort = smoothed(draft.values[role], draft, motion)
            if np.ptp(effort) > 0 and not _find_lost_sign(draft, role, effort, motion):
                _find_wrong_sign(draft, role, effort, motion)


def terms(motion: Motion) -> NDArray[np.float64]:
    """Columns of the fit: acceleration, velocity, its sign, position, one; shape (m, 5)."""
    slow = 0.02 * float(np.max(np.abs(motion.v))) or 1.0
    direction = np.clip(motion.v / slow, -1.0, 1.0)
    return np.column_stack([motion.a, motion.v, direction, motion.x - motion.x.mean(), np.ones(len(motion.v))])


def _find_wrong_sign(draft: Draft, role: str, effort: Values, motion: Motion) -> None:
    columns = terms(motion)
    scale = np.where(columns.std(axis=0) > 0, columns.std(axis=0), 1.0)
    weights, *_ = np.linalg.lstsq(columns / scale, effort, rcond=None)
    fit = (columns / scale) @ weights
    spread = float(effort.std())
    explained = 1 - float(np.var(effort - fit)) / spread**2
    inertia = float(weights[0]) / spread
    rubbing = (columns[:, 1:3] / scale[1:3]) @ weights[1:3]
    friction = float(np.copysign(rubbing.std(), np.mean(rubbing * motion.v))) / spread
    if explained < EXPLAINED or inertia + friction > AGAINST or max(inertia, friction) > _HELPS:
        return
    shares = f"shares of inertia {inertia:.2f}, of friction {friction:.2f}"
    text = f"works against the motion: {shares}; neither can be negative"
    advice = f"turn one of the two: {role}=-COLUMN if its plus drives towards minus, otherwise position=-COLUMN"
    draft.note(Kind.WRONG_SIGN, role, [], text, Action.LEFT, advice, Severity.ERROR)


def _find_lost_sign(draft: Draft, role: str, effort: Values, motion: Motion) -> bool:
    """Find an effort that is never negative and grows with the speed whichever way the axis goes."""
    if draft.values[role].min() < 0 or min(np.sum(motion.v > 0), np.sum(motion.v < 0)) < len(motion.v) / 20:
        return False
    by_speed = float(np.corrcoef(effort, np.abs(motion.v))[0, 1])
    by_velocity = float(np.corrcoef(effort, motion.v)[0, 1])
    if by_speed < _LOSES or by_speed < abs(by_velocity) + 0.3:
        return False
    text = f"never negative, though the axis goes both ways, and grows with the speed (correlation {by_speed:.2f})"
    advice = "record it with its direction, or fit only rows of one direction"
    draft.note(Kind.LOST_SIGN, role, [], text, Action.LEFT, advice, Severity.ERROR)
    return True
