"""Sensors that say the same number while the axis moves."""

import numpy as np
from numpy.typing import NDArray

from detent.logs.differences import equal_runs, grain, runs_of
from detent.logs.draft import Draft
from detent.logs.log import Action, Kind, Severity, Values
from detent.logs.twins import FEWEST, find_twins
from detent.logs.windows import spread

MOST_RUNS = 200  # runs of equal numbers that are looked at, the longest first

STRONGER = 4.0
"""By how much the disagreement with another signal must grow in a run, in what it usually grows (95th percentile) in
as many rows: noise, delay and friction between the two are in the usual growth already."""

CALIBRATION = 0.1  # disagreement, as a share of the way in a run, that two good sensors may have
CHANCE = 1e-6  # probability of a run by chance, over the whole recording, below which a noisy sensor is stuck
_NOISY = ("current", "force", "torque", "acceleration", "voltage")
_MEASURED = ("position", "position_load", "velocity", *_NOISY)
_BESIDE = 50


def find_stuck(draft: Draft) -> None:
    """Find signals that never change, and stretches in which one stays the same though the axis moves.

    A signal that never changes was not recorded: it is left out, unless it is the position. Within a recording a run of
    equal numbers alone proves nothing, since an axis may rest. It is held against a twin: a position against the
    integral of the velocity, the other encoder or the reference, a velocity against the position. Of a noisy signal
    without a twin, such as a current, a run must be longer than chance allows while the axis moves.
    """
    for role in [role for role in draft.values if role in _MEASURED or role == "command"]:
        _find_constant(draft, role)
    for role in ("position", "position_load", "velocity"):
        if role in draft.values:
            _find_against_twins(draft, role)
    for role in _NOISY:
        if role in draft.values:
            _find_by_chance(draft, role)


def _find_constant(draft: Draft, role: str) -> None:
    """Leave out a signal that never changes; a command other than zero may be meant so."""
    values = draft.values[role]
    if np.ptp(values) > 0 or (role == "command" and values[0] != 0):
        return
    unit = draft.unit(role)
    text = f"{values[0]:g} {unit}".rstrip() + f" in each of {len(draft)} rows"
    if role == "position":
        advice = "record a run in which the axis moves"
        draft.note(Kind.STUCK, role, [], f"{text}: the axis or its sensor stands", Action.LEFT, advice, Severity.ERROR)
    else:
        draft.note(Kind.STUCK, role, [], f"{text}: it was not recorded", Action.LEFT_OUT)
        del draft.values[role]


def _find_against_twins(draft: Draft, role: str) -> None:
    """Find runs of equal numbers that a twin contradicts; one twin is enough."""
    values = draft.values[role]
    runs = equal_runs(values, FEWEST)
    runs = runs[np.argsort(runs[:, 0] - runs[:, 1])][:MOST_RUNS]
    stuck: dict[int, tuple[int, str]] = {}
    for twin in find_twins(draft, role) if len(runs) else ():
        for first, last in runs.tolist():
            floor = CALIBRATION * twin.way_in(first, last) + twin.rounding(draft.t, first, last)
            if first not in stuck and _grows(twin.disagreement, first, last, runs, floor):
                stuck[first] = (last, twin.name)
    if not stuck:
        return
    rows = np.concatenate([np.arange(first, last) for first, (last, _) in sorted(stuck.items())])
    names = " and ".join(sorted({name for _, name in stuck.values()}))
    text = f"stays the same for up to {_longest(stuck)} rows while {names} goes on"
    draft.note(Kind.STUCK, role, rows, text, Action.LEFT, "leave these rows out of a fit")


def _longest(stuck: dict[int, tuple[int, str]]) -> int:
    return max(last - first for first, (last, _) in stuck.items())


def _grows(rest: Values, first: int, last: int, runs: NDArray[np.int64], floor: float) -> bool:
    """True where the disagreement grows in a run by far more than in as many rows elsewhere."""
    size = last - first
    growth = float(np.ptp(rest[first:last]))
    if growth <= floor or size > len(rest) // 2:
        return growth > floor and _grows_overall(rest, first, last)
    usual = spread(rest, size)
    outside = np.ones(len(rest), dtype=np.bool_)
    half = size // 2
    for begin, end in runs.tolist():
        outside[max(0, begin - half) : end + half + 1] &= end - begin < size // 2
    usual = usual[outside] if outside.any() else usual
    return growth > STRONGER * float(np.percentile(usual, 95))


def _grows_overall(rest: Values, first: int, last: int) -> bool:
    """The same for a run over most of a recording: against the rows outside it."""
    outside = np.r_[rest[:first], rest[last:]]
    return len(outside) >= FEWEST and float(np.ptp(rest[first:last])) > STRONGER * float(np.ptp(outside))


def _find_by_chance(draft: Draft, role: str) -> None:
    """Find runs of equal numbers of a noisy signal that are longer than chance allows while the axis moves."""
    values = draft.values[role]
    moves = _moving(draft)
    if moves is None:
        return
    extremes = (values.min(), values.max())
    runs: list[tuple[int, int]] = [
        (first, last)
        for first, last in equal_runs(values, FEWEST).tolist()
        if values[first] not in extremes and _is_unlikely(values, first, last, int(moves[first:last].sum()))
    ]
    if runs:
        rows = np.concatenate([np.arange(first, last, dtype=np.intp) for first, last in runs])
        most = max(last - first for first, last in runs)
        text = f"the same number for up to {most} rows while the axis moves, at {len(runs)} place{'s'[: len(runs) > 1]}"
        draft.note(Kind.STUCK, role, rows, text, Action.LEFT, "leave these rows out of a fit")


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


def _moving(draft: Draft) -> NDArray[np.bool_] | None:
    """Samples around which the position changes; None where there is none."""
    position = draft.values.get("position")
    if position is None or np.ptp(position) == 0:
        return None
    around = 2 * FEWEST + 1
    change = spread(position, around)
    return change > 3 * grain(position)
