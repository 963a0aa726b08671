"""Signals that are shifted against each other in time."""

import numpy as np

from detent.logs.differences import correlate, peaks_of
from detent.logs.draft import Draft
from detent.logs.effort import Motion, find_motion, smoothed, terms
from detent.logs.log import Action, Kind, Values

SMALLEST = 1.5  # rows by which signals may be apart: a difference of neighbours is half a row late, rounding adds

BETTER = 0.5  # disagreement left without the shift, as a share, at most: that of a filter does not vanish so
ALIKE = 0.9
_AS_GOOD = 0.02
_FEWEST = 200
_BESIDE = {"reference": "comes after the position that follows it", "position_load": "is beside the position"}


def find_shifts(draft: Draft) -> None:
    """Find signals that lie beside one another in time.

    A velocity that comes later or earlier than the derivative of the position is moved by whole rows. A second encoder
    is left where it is. A position that runs ahead of its reference, and a force, torque or current that comes after
    the acceleration that it makes, are against nature: then one of the two was recorded with a delay. That a position
    follows its reference with a delay is what loops do, and no finding.
    """
    motion = find_motion(draft)
    if motion is None or len(draft) < _FEWEST:
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
            text = f"comes {lag:.0f} rows after the acceleration that it makes"
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
    draft.note(Kind.SHIFTED, "velocity", [], f"{text}; moved by {abs(rows)} rows", Action.MOVED)
    draft.values["velocity"] = np.roll(draft.values["velocity"], -rows)
    inside = np.ones(len(draft), dtype=np.bool_)
    inside[slice(-rows, None) if rows > 0 else slice(0, -rows)] = False
    draft.keep(inside)


def _late_effort(effort: Values, motion: Motion) -> int:
    """Rows by which an effort fits the motion best when it is taken from later; 0 where it fits as well as it is."""
    columns = terms(motion)
    most = min(20, len(effort) // 10)
    errors: dict[int, float] = {}
    for lag in range(-most, most + 1):
        ours = effort[most + lag : len(effort) - most + lag]
        fit, *_ = np.linalg.lstsq(columns[most:-most], ours, rcond=None)
        errors[lag] = float(np.var(ours - columns[most:-most] @ fit)) / (float(np.var(ours)) or 1.0)
    best = min(errors, key=lambda lag: errors[lag])
    causal = min(error for lag, error in errors.items() if lag <= 0)
    is_clear = errors[best] < 1 - ALIKE and errors[best] < BETTER * causal
    # Smoothing blurs the moments at which friction turns round: a shift small beside the windows is not believed.
    return best if is_clear and motion.rows / 4 <= best < most else 0
