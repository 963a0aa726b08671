"""Numbers that stay the same: stuck sensors, compared with signals of the same motion, and drives at their limit."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from detent.logs.differences import (
    correlate,
    equal_runs,
    grain,
    integral,
    likeness,
    resolution,
    runs_of,
    spread,
    stepped,
    window_rows,
)
from detent.logs.log import Action, Draft, Kind, Severity, Values, tell_count

MOST_RUNS = 200  # runs of equal numbers that are looked at, the longest first

STRONGER = 4.0
"""By how much the disagreement with another signal must grow in a run, in what it usually grows (95th percentile) in
as many rows: noise, delay and friction between the two are in the usual growth already."""

CALIBRATION = 0.1  # disagreement, as a share of the way in a run, that two good sensors may have
CHANCE = 1e-6  # probability of a run by chance, over the whole recording, below which a noisy sensor is stuck
_NOISY = ("current", "force", "torque", "acceleration", "voltage")
_MEASURED = ("position", "position_load", "velocity", *_NOISY)
_BESIDE = 50
FEWEST = 10  # rows with the same number from which a sensor can be stuck
TRACKS = 0.9  # correlation from which two series are taken for the same motion
_FEWEST_WINDOWS = 20
_SMALL_WINDOW = 4
# Signals that a limit can cut off. Positions rest where they are told to, and a velocity has plateaus.
LIMITED = ("command", "voltage", "current", "force", "torque")
MOSTLY_STEPPED = 0.9  # share of the rows at an end into which a signal is stepped from which on it is commanded
PLATEAU = 3  # rows at the extreme value from which it is a plateau
FEWEST_CUT = 10  # rows at the extreme value, in plateaus, from which the signal is cut off there
FEWEST_LEVELS = 20  # different numbers below which a signal is one of levels, such as a square wave or a staircase

PILED = 3.0
"""Rows at the extreme value, in those at any one of the `NEIGHBOURS` numbers next to it, from which values are piled
up: a sine that was rounded has 1.4 times as many."""

NEIGHBOURS = 5
HEAPED = 20.0  # the same from which no plateau is needed: noise takes a signal from its limit and back

_FULL_SCALES = frozenset(
    {float(value) for bits in (8, 10, 12, 14, 15, 16) for value in (2**bits - 1, 2 ** (bits - 1))}
    | {1.0, 100.0, 1000.0}
)


class Twin(NamedTuple):
    """Another signal that says the same as one."""

    name: str  # what it is called in a sentence
    way: Values  # the way by the other, to the scale of the one, shape (n,)
    disagreement: Values  # the way by the one less that by the other, shape (n,)
    grain: float  # resolution of the positions
    drift: float  # resolution of the velocity, by which its integral can drift per second; 0 between positions

    def floor(self, t: Values, first: int, last: int) -> float:
        """Disagreement that calibration and rounding can make in some samples: the way is what either of them says."""
        way, rest = self.way[first:last], self.disagreement[first:last]
        most = max(float(np.ptp(way)), float(np.ptp(way + rest)))
        return CALIBRATION * most + (3 * self.grain + self.drift * float(t[last - 1] - t[first]))


def find_twins(draft: Draft, role: str) -> Iterator[Twin]:
    """Find the signals that a position or a velocity can be compared with."""
    values, t = draft.values[role], draft.t
    base = draft.units[role].partition("/")[0]
    found: list[tuple[str, Values, Values, float]] = []
    if role == "velocity":
        if "position" in draft.values and draft.units["position"] == base:
            found = [("the position", integral(values, t), draft.values["position"], resolution(values))]
    else:
        velocity = draft.values.get("velocity")
        if velocity is not None and draft.units["velocity"].partition("/")[0] == base:
            found = [("the integral of the velocity", values, integral(velocity, t), resolution(velocity))]
        for other in ("position_load", "position", "reference"):
            if other in draft.values and other != role:
                found.append((f"the {other.replace('_', ' ')}", values, _aligned(values, draft.values[other]), 0.0))
    grain = resolution(draft.values["position"]) if "position" in draft.values else 0.0
    for name, ours, theirs, drift in found:
        scale = _scale(ours, theirs, values)
        if scale is not None:
            yield Twin(name, scale * theirs, ours - scale * theirs, grain, drift)


def _aligned(ours: Values, theirs: Values) -> Values:
    """The second series, taken from as much earlier as the first, its still stretches bridged, follows it."""
    free = _free(ours)
    bridged = ours
    if free.any() and not free.all():
        index = np.arange(len(ours), dtype=np.float64)
        bridged = np.interp(index, index[free], ours[free])
    curve = correlate(bridged, theirs)
    lag = max(0, int(np.argmax(curve)) - len(curve) // 2)
    return np.r_[np.full(lag, theirs[0]), theirs[: len(theirs) - lag]]


def _scale(ours: Values, theirs: Values, values: Values) -> float | None:
    """Factor of the changes of two series over windows; None where they are not alike."""
    # Where the sensor's numbers stay the same, and where they jump behind that, the changes say nothing.
    free = _free(values)
    rows = min(max(window_rows(ours), window_rows(theirs)), len(ours) // 4)
    for size in (rows, _SMALL_WINDOW):
        blocked = np.r_[0, np.cumsum(~free)]
        clear = blocked[size + 1 :] == blocked[: -size - 1]
        if clear.sum() >= _FEWEST_WINDOWS:
            found = likeness((ours[size:] - ours[:-size])[clear], (theirs[size:] - theirs[:-size])[clear])
            return found.factor if found.correlation > TRACKS else None
    return None


def _free(values: Values) -> NDArray[np.bool_]:
    """Samples outside the runs of equal numbers that are looked at, and outside the jumps behind them."""
    free = np.ones(len(values), dtype=np.bool_)
    for first, last in equal_runs(values, FEWEST).tolist():
        free[first : last + 1] = False
    return free


def find_stuck(draft: Draft) -> None:
    """Find signals that never change, and stretches in which one stays the same though the axis moves.

    Within a recording a run of equal numbers alone proves nothing, since an axis may rest. A position is compared with
    the integral of the velocity, the other encoder or the reference, a velocity against the position. Of a noisy signal
    without such a twin, a run must be longer than chance allows while the axis moves.
    """
    for role in [role for role in draft.values if role in _MEASURED or role == "command"]:
        _find_constant(draft, role)
    for role in _MEASURED:
        if role in draft.values:
            (_find_by_chance if role in _NOISY else _find_against_twins)(draft, role)


def _find_constant(draft: Draft, role: str) -> None:
    """Leave out a signal that never changes; a command other than zero may be meant so."""
    values = draft.values[role]
    if np.ptp(values) > 0 or (role == "command" and values[0] != 0):
        return
    text = f"{values[0]:g} {draft.units[role]}".rstrip() + f" in each of {len(draft)} rows"
    if role == "position":
        advice = "record a run in which the axis moves"
        draft.note(
            Kind.STUCK, role, [], f"{text}: the axis or its sensor does not move", Action.LEFT, advice, Severity.ERROR
        )
    else:
        draft.note(Kind.STUCK, role, [], f"{text}: it was not recorded", Action.LEFT_OUT)
        del draft.values[role]


def _find_against_twins(draft: Draft, role: str) -> None:
    """Find runs of equal numbers that a twin contradicts; one twin is enough."""
    values = draft.values[role]
    runs = equal_runs(values, FEWEST)
    runs = runs[np.argsort(runs[:, 0] - runs[:, 1])][:MOST_RUNS]
    stuck: dict[tuple[int, int], str] = {}
    for twin in find_twins(draft, role) if len(runs) else ():
        for first, last in runs.tolist():
            floor = twin.floor(draft.t, first, last)
            if (first, last) not in stuck and _grows(twin.disagreement, first, last, runs, floor):
                stuck[first, last] = twin.name
    if stuck:
        names = " and ".join(sorted(set(stuck.values())))
        most = max(last - first for first, last in stuck)
        _tell(draft, role, sorted(stuck), f"is constant for up to {most} rows while {names} changes")


def _grows(rest: Values, first: int, last: int, runs: NDArray[np.int64], floor: float) -> bool:
    """True where the disagreement grows in a run by far more than in as many rows elsewhere."""
    size = last - first
    growth = float(np.ptp(rest[first:last]))
    if growth <= floor:
        return False
    if size > len(rest) // 2:  # a run over most of a recording: against the rows outside it
        others = np.r_[rest[:first], rest[last:]]
        return len(others) >= FEWEST and growth > STRONGER * float(np.ptp(others))
    usual = spread(rest, size)
    outside = np.ones(len(rest), dtype=np.bool_)
    half = size // 2
    for begin, end in runs.tolist():
        outside[max(0, begin - half) : end + half + 1] &= end - begin < size // 2
    usual = usual[outside] if outside.any() else usual
    return growth > STRONGER * float(np.percentile(usual, 95))


def _find_by_chance(draft: Draft, role: str) -> None:
    """Find runs of equal numbers of a noisy signal that are longer than chance allows while the axis moves."""
    values = draft.values[role]
    position = draft.values.get("position")
    if position is None or np.ptp(position) == 0:
        return
    moves = spread(position, 2 * FEWEST + 1) > 3 * grain(position)
    extremes = (values.min(), values.max())
    runs: list[tuple[int, int]] = [
        (first, last)
        for first, last in equal_runs(values, FEWEST).tolist()
        if values[first] not in extremes and _is_unlikely(values, first, last, int(moves[first:last].sum()))
    ]
    if runs:
        most = max(last - first for first, last in runs)
        where = f"while the axis moves, at {tell_count(len(runs), 'place')}"
        _tell(draft, role, runs, f"the same number for up to {most} rows {where}")


def _tell(draft: Draft, role: str, runs: list[tuple[int, int]], text: str) -> None:
    """Note runs of equal numbers."""
    rows = np.concatenate([np.arange(first, last, dtype=np.intp) for first, last in runs])
    draft.note(Kind.STUCK, role, rows, text, Action.LEFT, "exclude these rows from a fit")


def _is_unlikely(values: Values, first: int, last: int, moving: int) -> bool:
    """True for a run with far more rows of motion than the runs beside it, and than chance makes likely."""
    around = 3 * (last - first) + _BESIDE
    same = np.diff(values[max(0, first - around) : last + around]) == 0
    begin = first - max(0, first - around)
    same[begin : begin + last - first - 1] = False
    others = runs_of(same)
    longest = int((others[:, 1] - others[:, 0]).max(initial=0)) + 1
    share = max(float(np.sum(same)) / max(len(same) - (last - first), 1), 1.0 / len(values))
    chance = np.log(len(values)) + moving * np.log(share)
    # Where a smooth signal turns, it rests at one of its steps for longer than elsewhere.
    before, behind = values[max(0, first - 1)] - values[first], values[min(last, len(values) - 1)] - values[first]
    needed = max(FEWEST, STRONGER * longest) * (2 if before * behind > 0 else 1)
    return moving >= needed and bool(chance < np.log(CHANCE))


def find_saturation(draft: Draft) -> None:
    """Find signals that pile up at their largest or smallest value, far more often than at any number beside it."""
    # Cut off, and not commanded so, is certain where that is a full scale or both ends lie as far from zero.
    for role in LIMITED:
        if role in draft.values and len(np.unique(draft.values[role])) >= FEWEST_LEVELS:
            _find_plateau(draft, role, 1.0)
            _find_plateau(draft, role, -1.0)


def _find_plateau(draft: Draft, role: str, side: float) -> None:
    """Find a plateau at the largest value, or at the smallest for side -1."""
    values = draft.values[role]
    levels, counts = np.unique(side * values, return_counts=True)
    is_end = side * values == levels[-1]
    runs = runs_of(is_end)
    beside, longest = float(counts[-1 - NEIGHBOURS : -1].max(initial=0)), int((runs[:, 1] - runs[:, 0]).max())
    is_piled = counts[-1] >= max(FEWEST_CUT, (PILED if longest >= PLATEAU else HEAPED) * beside)
    is_commanded = stepped(values, is_end, float(np.ptp(values)))[is_end].mean() > MOSTLY_STEPPED
    if is_piled and not (is_commanded and longest >= PLATEAU):
        end, where, factor = side * float(levels[-1]), np.flatnonzero(is_end), abs(draft.sources[role].factor)
        is_symmetric = bool(np.isclose(values.max(), -values.min(), rtol=1e-3))
        is_full = any(np.isclose(abs(end) / factor, scale, rtol=1e-9) for scale in _FULL_SCALES)
        severity = Severity.WARNING if is_symmetric or is_full else Severity.NOTE
        why = "as far as the other end" if is_symmetric else "a full scale" if is_full else "clipped, or commanded so"
        shown = f"{end:.4g} {draft.units[role]}".rstrip()
        text = f"stays at {shown} ({why}) in {tell_count(len(where), 'row')}"
        advice = "exclude these rows from a fit of the loop; a fit of the axis may keep them"
        draft.note(Kind.SATURATED, role, where, text, Action.LEFT, advice, severity)
