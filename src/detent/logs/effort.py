"""Signals compared with the motion: an effort that works against it or lost its sign, and shifts in time.

A drive moves an axis by ``F = m a + c v + d sign(v) + k x + g`` with ``m, c, d >= 0``: it accelerates mass and feeds
friction. For a voltage or a duty cycle the back-EMF adds to ``c``. ``k x`` stands for springs and, near one position,
for gravity.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from detent.logs.differences import MOST_ROWS, correlate, grain, peaks_of, smooth, window_rows
from detent.logs.headings import EFFORTS
from detent.logs.log import Action, Draft, Kind, Severity, Values

EXPLAINED = 0.3  # share of the variance of an effort that the motion must explain before its sign is judged
AGAINST = -0.3  # sum of the shares (standardised) of inertia and friction below which an effort has the wrong sign
_FEWEST = 50
_HELPS = 0.15
_LOSES = 0.5


SMALLEST = 1.5  # rows by which signals may be apart: a difference of neighbours is half a row late, rounding adds
BETTER = 0.5  # disagreement left without the shift, as a share, at most: that of a filter does not vanish so
ALIKE = 0.9
_AS_GOOD = 0.02
_FEWEST_SHIFTED = 200
_BESIDE = {"reference": "lags the position that follows it", "position_load": "is shifted against the position"}


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
    return smooth(values, draft.t, motion.rows, 1)[1][0]


def _taken(motion: Motion, thin: slice) -> Motion:
    """Some samples of a motion."""
    return Motion(motion.x[thin].copy(), motion.v[thin].copy(), motion.a[thin].copy(), motion.rows)


def find_wrong_effort(draft: Draft) -> None:
    """Find efforts whose parts of inertia and friction are negative together, and efforts without their sign."""
    # They are left as they are: which of the two, effort or position, counts the other way the recording does not tell.
    motion = find_motion(draft)
    if motion is None:
        return
    thin = slice(None, None, max(1, len(motion.x) // MOST_ROWS))
    taken = _taken(motion, thin)
    for role in EFFORTS:
        if role in draft.values:
            effort = smoothed(draft.values[role], draft, motion)[thin]
            if np.ptp(effort) > 0 and not _find_lost_sign(draft, role, effort, taken):
                _find_wrong_sign(draft, role, effort, taken)


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
    text = f"opposes the motion: {shares}; neither can be negative"
    advice = f"invert one of the two: {role}=-COLUMN if its plus drives towards minus, otherwise position=-COLUMN"
    draft.note(Kind.WRONG_SIGN, role, [], text, Action.LEFT, advice, Severity.ERROR)


def _find_lost_sign(draft: Draft, role: str, effort: Values, motion: Motion) -> bool:
    """Find an effort that is never negative and grows with the speed whichever way the axis goes."""
    if draft.values[role].min() < 0 or min(np.sum(motion.v > 0), np.sum(motion.v < 0)) < len(motion.v) / 20:
        return False
    by_speed = float(np.corrcoef(effort, np.abs(motion.v))[0, 1])
    by_velocity = float(np.corrcoef(effort, motion.v)[0, 1])
    if by_speed < _LOSES or by_speed < abs(by_velocity) + 0.3:
        return False
    text = f"never negative, although the axis moves both ways, and grows with speed (correlation {by_speed:.2f})"
    advice = "record it with its sign, or fit only rows of one direction"
    draft.note(Kind.LOST_SIGN, role, [], text, Action.LEFT, advice, Severity.ERROR)
    return True


# ---- signals that are shifted against each other in time


def find_shifts(draft: Draft) -> None:
    """Find signals that lie beside one another in time.

    A velocity that comes later or earlier than the derivative of the position is moved by whole rows. A position that
    runs ahead of its reference, and an effort that comes after the acceleration that it makes, are against nature: one
    of the two was recorded with a delay. That a position follows its reference with a delay is what loops do.
    """
    motion = find_motion(draft)
    if motion is None or len(draft) < _FEWEST_SHIFTED:
        return
    if "velocity" in draft.values and draft.units["velocity"].partition("/")[0] == draft.units["position"]:
        _move_velocity(draft, motion)
        motion = find_motion(draft) or motion
    position = smoothed(draft.values["position"], draft, motion)
    for role in ("reference", "position_load", "force", "torque", "current"):
        if role not in draft.values:
            continue
        signal = smoothed(draft.values[role], draft, motion)
        if role in {"force", "torque", "current"}:
            lag = float(_late_effort(signal, motion))
            text = f"lags the acceleration that it causes by {lag:.0f} rows"
        else:
            lag = find_lag(signal, position, prefers_earlier=role == "reference")
            text = f"{_BESIDE[role]} by {abs(lag):.1f} rows"
        if (abs(lag) if role == "position_load" else lag) >= SMALLEST:
            period = float(np.median(np.diff(draft.t)))
            advice = f'if {role} was recorded late, state delay = "{lag * period * 1e3:.3g} ms" in [columns.{role}]'
            draft.note(Kind.SHIFTED, role, [], text, Action.LEFT, advice)


def find_lag(ours: Values, theirs: Values, *, prefers_earlier: bool = False) -> float:
    """By how many rows one series comes after another, by the peak of their correlation."""
    curve = correlate(ours, theirs)
    peaks, most = peaks_of(curve), len(curve) // 2
    if not len(peaks):
        return 0.0
    # A periodic motion has many: the nearest to no shift among those that are as good as the highest.
    good = peaks[1 - curve[peaks] <= 2 * (1 - curve[peaks].max()) + _AS_GOOD]
    if prefers_earlier and np.any(good <= most):
        good = good[good <= most]
    peak = int(good[np.argmin(np.abs(good - most))])
    if curve[peak] < ALIKE or 1 - curve[peak] > BETTER * (1 - curve[most]):
        return 0.0
    left, top, right = curve[peak - 1 : peak + 2]
    bend = left - 2 * top + right
    return peak - most + (0.5 * float(left - right) / float(bend) if bend else 0.0)


def _move_velocity(draft: Draft, motion: Motion) -> None:
    """Move a velocity onto the derivative of the position, by whole rows."""
    lag = find_lag(smoothed(draft.values["velocity"], draft, motion), motion.v)
    rows = int(np.rint(lag))
    if abs(lag) < SMALLEST:
        return
    text = f"comes {abs(lag):.1f} rows {'after' if lag > 0 else 'before'} the derivative of the position"
    draft.note(Kind.SHIFTED, "velocity", [], f"{text}; shifted by {abs(rows)} rows", Action.MOVED)
    draft.values["velocity"] = np.roll(draft.values["velocity"], -rows)
    inside = np.ones(len(draft), dtype=np.bool_)
    inside[slice(-rows, None) if rows > 0 else slice(0, -rows)] = False
    draft.keep(inside)


def _late_effort(effort: Values, motion: Motion) -> int:
    """Rows by which an effort fits the motion best when it is taken from later; 0 where it fits as well as it is."""
    most = min(20, len(effort) // 10)
    thin = slice(most, len(effort) - most, max(1, len(effort) // MOST_ROWS))
    columns = terms(_taken(motion, thin))
    errors: dict[int, float] = {}
    for lag in range(-most, most + 1):
        ours = effort[most + lag : len(effort) - most + lag : thin.step]
        fit, *_ = np.linalg.lstsq(columns, ours, rcond=None)
        errors[lag] = float(np.var(ours - columns @ fit)) / (float(np.var(ours)) or 1.0)
    best = min(errors, key=lambda lag: errors[lag])
    causal = min(error for lag, error in errors.items() if lag <= 0)
    is_clear = errors[best] < 1 - ALIKE and errors[best] < BETTER * causal
    # Smoothing blurs the moments at which friction turns round: a shift small beside the windows is not believed.
    return best if is_clear and motion.rows / 4 <= best < most else 0
