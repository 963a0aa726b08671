"""Signals that say the same motion, compared with one another: wrong signs and units wrong by a factor.

The position is the anchor. The velocity must be its derivative, the acceleration that of the velocity; the reference
and a second encoder must go where it goes. A sign is turned and a known factor taken out, as both are certain once the
signals are alike in everything else; a factor that is none of `FACTORS` is told and left.
"""

import math

import numpy as np

from detent.logs.differences import Likeness, correlate, grain, likeness, paired_changes, peaks_of, runs_of
from detent.logs.log import Action, Draft, Kind, Severity

OPPOSED = -0.7  # correlation below which two signals that should agree have opposite signs
ALIKE = 0.9  # correlation above which their factor is a unit's and not the noise's
FOLLOWS = 0.95  # the same for a position and its reference, whose sizes differ where a weak loop does not follow
NEAR = 0.05  # relative distance from a known factor at which it is taken for that one
NEAR_REFERENCE = 0.12  # the same for a reference
TOLERATED = 0.25  # relative deviation of a factor from 1 that a filter or a calibration may make

FACTORS: dict[str, dict[float, str]] = {
    "m": {1000.0: "thousandths: mm for m, or ms for s", 1e6: "millionths: um for m, or us for s",
          60.0: "minutes for seconds", 60e3: "mm/min for m/s", 1000 / 25.4: "inches for m", 1 / 25.4: "inches for mm",
          100.0: "hundredths: cm for m", 4.0: "four edges counted per line of the encoder, or one"},
    "rad": {180 / math.pi: "degrees for radians", 60 / math.tau: "revolutions per minute for rad/s",
            1 / math.tau: "turns for radians", 360.0: "degrees for turns",
            1000.0: "thousandths: mrad for rad, or ms for s", 1e6: "millionths: us for s",
            4.0: "four edges counted per line of the encoder, or one"},
    "count": {1000.0: "thousandths: ms for s", 1e6: "millionths: us for s", 60.0: "minutes for seconds",
              4.0: "four edges counted per line of the encoder, or one"},
}  # fmt: skip
"""Factors between units that are mixed up, as numbers of the wrong unit per number of the right one, with meanings; by
the unit of positions. No two of them are near one another."""

_OF_GRAVITY = {1 / 9.80665: "g for m/s^2"}
_NOT_OF_POSITIONS = frozenset({4.0, 60.0, 60e3, 100.0, 60 / math.tau})
_AS_GOOD = 0.05
_SAID = {"velocity": "d(position)/dt", "acceleration": "d(velocity)/dt", "reference": "the position",
         "position_load": "the position"}  # fmt: skip
"""What each signal must agree with, in the order of the checks."""


def find_disagreements(draft: Draft) -> None:
    """Find signals of the same motion with another sign or unit than the position, and put right what is certain."""
    position = draft.values.get("position")
    if position is None or np.ptp(position) <= 5 * grain(position):
        return
    base = draft.units["position"]
    for role in _SAID:
        if role in draft.values and draft.units[role].partition("/")[0] == base:
            _check_sign(draft, role, _compare(draft, role))
            _check_factor(draft, role, _compare(draft, role))


def _compare(draft: Draft, role: str) -> Likeness:
    """A signal against what it must agree with."""
    values, position = draft.values[role], draft.values["position"]
    if role == "velocity":
        return likeness(*paired_changes(position, values, draft.t))
    if role == "reference":
        return _before_position(draft)
    if role == "position_load":
        return likeness(values, position, is_centred=True)
    # An acceleration, about its mean, as gravity may give it one.
    is_doubtful = any(finding.signal == "velocity" and finding.action == Action.LEFT for finding in draft.findings)
    has_velocity = "velocity" in draft.values and draft.units[role] == f"{draft.units['velocity']}^2"
    velocity = draft.values["velocity"] if has_velocity and not is_doubtful else np.gradient(position, draft.t)
    return likeness(*paired_changes(velocity, values, draft.t), is_centred=True)


def _before_position(draft: Draft) -> Likeness:
    """A reference beside the position that follows it: where they are most alike, at the shortest delay of those."""
    # Without the delay of the loop a fast motion would lie crosswise to its reference. Of a sine, half a period of
    # delay and a wrong sign look the same: then the sign is believed.
    reference, position, enabled = draft.values["reference"], draft.values["position"], draft.values.get("enabled")
    if enabled is not None and np.any(enabled):  # the longest stretch in which the drive is on
        runs = runs_of(enabled > 0.5)
        first, last = runs[int(np.argmax(runs[:, 1] - runs[:, 0]))].tolist()
        reference, position = reference[first:last], position[first:last]
    curve = correlate(position, reference)
    size, middle = np.abs(curve), len(curve) // 2
    peaks = peaks_of(size)
    peaks = peaks[size[peaks] >= size.max() - _AS_GOOD]
    if not len(peaks) or np.min(np.abs(peaks - middle)) > max(10, len(position) // 20):
        return Likeness(0.0, 0.0)
    correlation = float(curve[peaks[np.argmin(np.abs(peaks - middle))]])
    if np.any(np.sign(curve[peaks]) != np.sign(correlation)):
        correlation = abs(correlation)
    factor = float(reference.std() / position.std()) if position.std() > 0 else 0.0
    return Likeness(correlation, float(np.copysign(factor, correlation)))


def _check_sign(draft: Draft, role: str, found: Likeness) -> None:
    """Turn a signal round that goes the other way."""
    if found.correlation > (OPPOSED if role != "reference" else -ALIKE):
        return
    draft.rescale(role, -1.0)
    text = f"contradicts the sign of {_SAID[role]} (correlation {found.correlation:.2f})"
    advice = f"if the {role.replace('_', ' ')} was right, invert the position: position=-COLUMN, {role}=COLUMN"
    draft.note(Kind.WRONG_SIGN, role, [], text, Action.TURNED, advice, Severity.ERROR)


def _check_factor(draft: Draft, role: str, found: Likeness) -> None:
    """Take a known factor out, and tell an unknown one."""
    tracks = role in {"reference", "position_load"}
    if found.correlation < (FOLLOWS if tracks else ALIKE):
        return
    factor = found.factor
    known = _known(factor, role, draft.units["position"])
    said = f"is {factor:.4g} times {_SAID[role]}"
    # A power of a thousand is what a wrong guess of the unit of the time would make as well.
    is_rate = role in {"velocity", "acceleration"} and "time" in draft.guessed_units
    if known is not None and not (is_rate and any(np.isclose(known[0], (1e3, 1e6, 1e-3, 1e-6)))):
        factor, meaning = known
        draft.rescale(role, 1.0 / factor)
        advice = f"state the units; the other of the two may be the wrong one ({_other(role)})"
        text = f"{said}: {meaning}"
        draft.note(Kind.WRONG_UNIT, role, [], text, Action.CONVERTED, advice, Severity.ERROR)
    elif known is not None:
        advice = f"state the units of {role}, {_other(role)} and time: which of them is wrong cannot be determined"
        draft.note(Kind.WRONG_UNIT, role, [], f"{said}: {known[1]}", Action.LEFT, advice, Severity.ERROR)
    elif abs(factor - 1) > TOLERATED and role != "reference":
        advice = f"state the units of {role} and {_other(role)}, or the ratio between them as factor"
        draft.note(Kind.WRONG_UNIT, role, [], f"{said}, no known ratio of units", Action.LEFT, advice)


def _other(role: str) -> str:
    return "velocity" if role == "acceleration" else "position"


def _known(factor: float, role: str, base: str) -> tuple[float, str] | None:
    """The factor of units nearest to one found, with its meaning; None where none is near."""
    if abs(factor - 1) <= TOLERATED:
        return None
    table = FACTORS[base] | (_OF_GRAVITY if role == "acceleration" and base == "m" else {})
    is_position = role in {"reference", "position_load"}
    known: dict[float, str] = {}
    for value, meaning in table.items():
        if not (is_position and value in _NOT_OF_POSITIONS):
            known[value] = meaning
            known[1 / value] = f"the reverse of {meaning}"
    nearest = min(known, key=lambda value: abs(math.log(value / factor)))
    # A loop may follow its reference with an overshoot, or not all the way.
    near = NEAR_REFERENCE if role == "reference" else NEAR
    return (nearest, known[nearest]) if abs(nearest / factor - 1) <= near else None
