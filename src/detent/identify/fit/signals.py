"""What the signals of a log say alone, before anything is fitted to them: forms that no axis and no drive makes.

A signal that is updated late, keeps its number, has lost its small values or comes with the sign of another moment
looks like one of another axis once it is smoothed over windows. What gives it away are its numbers, row by row.
"""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from detent.identify.fit.equations import Run
from detent.identify.fit.estimate import coloured_covariance
from detent.identify.fit.regression import combine, lag_of, solve
from detent.identify.fit.steadiness import SCALE, Change
from detent.identify.fit.verdict import Refusal
from detent.logs.differences import resolution, runs_of, stepped
from detent.logs.log import Action, Kind, Log, Severity, Values

MOST_SATURATED = 0.3  # share of saturated samples, at most
MOST_STUCK = 0.05  # share of samples with a stuck signal, at most
MOST_LEFT_BEHIND = 0.6  # share of the reference's way while the position stands still, at most: friction may hold it
SLOWEST = 0.1  # share of the top speed from which an axis moves
FEWEST_BESIDE = 20  # zeros in motion, and different values beside the gap about them, from which small ones are gone
ROUNDED = 6  # digits to which ways from row to row, over the largest, are one and the same: straight lines were drawn
FEWEST_UPDATES, LONGEST_HELD = 20, 0.04  # updates of a signal, and the time between two [s], by which it is held
# Deviation of a position from its reference that a course of time explains, over the travel, and over what is left
# beside it, from which on the position is not that of the loop; the share of the way by which a loop may stay behind
# and still follows; and rows that are compared.
LEAVES, BY_FAR, FOLLOWS, FEWEST_COMPARED, MOST_COMPARED = 0.004, 1.2, 0.1, 200, 20_000
# Share of the way that a position does not go, or goes beyond, from which its scale is in doubt, and up to which: then
# it is a soft loop; and in its standard errors.
LEAST_OFF, SOFT, CLEAR = 0.01, 0.25, 4.0
FINE = 10.0  # usual change of an effort in its steps from which on it changes in each row, or is commanded
KEPT, SINGLE = 4, 0.1  # changes that are none, one after the other; share of changes behind which the next one follows
FEWEST_KEPT, MOST_KEPT = 15, 0.05  # such stretches, and their share of the motion, from which the effort was held
MOST_LINES = 0.1  # share of the rows on straight lines from which on these were drawn
SUDDEN, FEWEST_TURNS = 8.0, 10  # size of a jump in the usual change, and how many are looked at
TURNED, MOST_TURNED = 0.25, 0.85  # difference of the sizes before and behind, in the jump; share of jumps that turn
APART, FLAT = 20, 1.4  # rows, and change of the size over so many, in that over one, up to which it is flat and noisy
FEWEST_LINES = 50  # straight lines of one slope from which on an effort was kept to it: a command has fewer
Mask = NDArray[np.bool_]
_DIRT: dict[Kind, tuple[str, str]] = {
    Kind.WRONG_SIGN: ("wrong sign", "invert the signal in the mapping, as in force=-COLUMN"),
    Kind.WRONG_UNIT: ("wrong unit", "state the unit of the column in the mapping"),
    Kind.LOST_SIGN: ("lost sign", "record the signal with its sign"),
    Kind.COPIED: ("copied column", "record what the encoder says"),
    Kind.DROPPED_ROWS: ("lost rows", "record the time of each row with the row"),
    Kind.DRIFTING_CLOCK: ("clock drifts", "record time and rows by one clock"),
}


def look_at_log(log: Log, run: Run, runs: Sequence[Run] = ()) -> Iterator[Refusal]:
    """What is wrong with a log before anything is fitted; `runs` are those of all logs that are identified with it."""
    yield from _dirt(log)
    yield from _late(log, run)
    yield from _made_by_recorder(log, run)
    told = {"position", run.effort_name}
    stuck = float(log.mask(Kind.STUCK, signals=told).mean())
    if stuck > MOST_STUCK:
        text = f"{log.name}: is at standstill in {stuck:.0%} of the rows"
        yield Refusal("stuck signal", text, "check the sensor and its cable, and record again")
    behind = _share_left_behind(run)
    if behind > MOST_LEFT_BEHIND:
        text = f"{log.name}: the reference covers {behind:.0%} of its travel while the position does not change"
        yield Refusal("stuck signal", text, "check the encoder, its cable and the drive enable, and record again")
    if left := _leaves_reference(run):
        text = (
            f"{log.name}: the position leaves its reference by {left:.1%} of its travel along the log, as no loop does"
        )
        record = "look for a coupling that slips, counts that are lost, a scale that changes"
        yield Refusal("position leaves its reference", text, record)
    saturated = max(float(log.mask(Kind.SATURATED, signals=told).mean()), _share_at_ends(run, runs))
    limits = {f"{run.effort_name} or position is at its limit": saturated}
    limits[f"{run.effort_name} changes as fast as it ever does, and not faster,"] = _share_at_slope(
        log.signals[run.effort_name]
    )
    for what, share in limits.items():
        if share > MOST_SATURATED:
            text = f"{log.name}: {what} in {share:.0%} of the rows"
            yield Refusal("saturated", text, "record slower or smaller moves that stay within the limit")


def _dirt(log: Log) -> Iterator[Refusal]:
    """What was found while the log was read, and spoils its constants."""
    for finding in log.findings:
        is_clock = finding.kind is Kind.DROPPED_ROWS  # rows whose gap the time shows are only left out
        least = (Severity.ERROR,) if is_clock else (Severity.ERROR, Severity.WARNING)
        if finding.kind in _DIRT and finding.severity in least:
            subject, record = _DIRT[finding.kind]
            yield Refusal(subject, f"{log.name}: {finding.signal} {finding.text}", finding.advice or record)


def _late(log: Log, run: Run) -> Iterator[Refusal]:
    """Signals whose age is not known, and their delay neither."""
    if any(f.kind is Kind.REPEATED_STAMPS and f.action is Action.INTERPOLATED for f in log.findings):
        text = f"{log.name}: time stamps are coarser than the rows"
        yield Refusal("coarse time", text, "record the time of each row to a tenth of a period", ("delay",))
    told_by = {
        "position": log.signals["position"],
        run.effort_name: log.signals[run.effort_name],
        "the way from row to row": _rounded(np.diff(log.signals["position"])),
    }
    for what, values in told_by.items():
        if 1 < (rows := held_rows(values)) <= LONGEST_HELD / run.step:
            text = f"{log.name}: {what} changes every {rows} rows only: how old it is in between is not known"
            yield Refusal("coarse time", text, "record each signal as often as the rows are written", ("delay",))


def _made_by_recorder(log: Log, run: Run) -> Iterator[Refusal]:
    """Forms of an effort that no drive makes."""
    effort = log.signals[run.effort_name]
    moving = _moving(log.signals["position"])
    if gone := _small_values_gone(effort, moving):
        text = f"{log.name}: {run.effort_name} is never between 0 and {gone:.3g} {run.effort_unit}, and 0 in motion"
        yield Refusal("small values are gone", text, "record the effort without a threshold below which it counts as 0")
    if kept := _share_kept(effort, moving):
        text = f"{log.name}: {run.effort_name} keeps its number again and again, in {kept:.0%} of the motion"
        record = "record the effort in each row, not only where it has changed by much, and no peak values"
        yield Refusal("effort is held", text, record)
    if drawn := _share_of_lines(effort):
        text = f"{log.name}: {run.effort_name} consists of straight lines of many slopes, in {drawn:.0%} of the rows"
        yield Refusal("lines were drawn", text, "record the effort in each row; archives keep few, and join them")
    if alike := _share_turned(effort, moving):
        text = f"{log.name}: {run.effort_name} jumps to its own size with the other sign, in {alike:.0%} of its jumps"
        yield Refusal("sign of another moment", text, "record the effort with its sign, not size and direction apart")


def _rounded(ways: Values) -> Values:
    """Ways from row to row over the largest; those of a straight line are one and the same."""
    return np.round(ways / max(float(np.abs(ways).max(initial=0.0)), 1e-300), ROUNDED)


def _moving(position: Values) -> Mask:
    """Rows in which the axis moves."""
    speed = np.abs(np.gradient(position))
    return speed > SLOWEST * float(np.quantile(speed, 0.98))


def held_rows(values: Values) -> int:
    """In every how many rows a signal is updated; 1 where it is in each, or in no such order."""
    between = np.diff(np.flatnonzero(np.diff(values)))
    if len(between) < FEWEST_UPDATES:
        return 1
    return int(np.gcd.reduce(between))


def _small_values_gone(effort: Values, moving: Mask) -> float:
    """Smallest value of an effort whose small ones were all written as 0 while the axis moved; 0 where none were."""
    # Of a continuous effort some values lie between 0 and any other: a gap as wide as its smallest value is, with many
    # different ones as far again behind it, is no chance, and no step of a converter.
    sizes = np.abs(effort)
    least = float(np.min(sizes[sizes > 0.0], initial=np.inf))
    zeros = np.count_nonzero((sizes == 0.0) & moving)
    behind = len(np.unique(sizes[(sizes >= least) & (sizes < 2.0 * least)]))
    return least if min(zeros, behind) >= FEWEST_BESIDE else 0.0


def _share_kept(effort: Values, moving: Mask) -> float:
    """Share of the rows in motion in which an effort keeps its number though its steps are fine; 0 for chance."""
    # A converter keeps a number until the next step. What changes by many steps at once changes in each row, or by a
    # command, or is updated in every few: but not now in the next row, and now in the tenth.
    same = np.diff(effort) == 0.0
    changes = np.abs(np.diff(effort)[~same])
    if not len(changes) or float(np.quantile(changes, 0.25)) < FINE * resolution(effort):
        return 0.0
    if np.count_nonzero(~same[1:] & ~same[:-1]) < SINGLE * len(changes):
        return 0.0
    runs = runs_of(same)
    first, last = runs[:, 0], runs[:, 1]
    long, in_motion = last - first, np.concatenate([[0], np.cumsum(moving)])
    is_end = (effort[first] == effort.min()) | (effort[first] == effort.max())
    kept = long[(long >= KEPT) & ~is_end & (in_motion[last] - in_motion[first] > 0.5 * long)]
    share = int(np.sum(kept)) / max(int(in_motion[-1]), 1)
    return share if len(kept) >= FEWEST_KEPT and share > MOST_KEPT else 0.0


def _share_of_lines(effort: Values) -> float:
    """Share of the rows in which an effort lies on straight lines, no two of one slope; 0 for few, and coarse steps."""
    ways = np.diff(effort)
    if float(np.abs(ways).max(initial=0.0)) < FINE * resolution(effort):
        return 0.0
    slopes = _rounded(ways)
    runs = runs_of((slopes[1:] == slopes[:-1]) & (slopes[1:] != 0.0))
    runs = runs[runs[:, 1] - runs[:, 0] >= KEPT]
    share, lines = int((runs[:, 1] - runs[:, 0]).sum()) / len(effort), slopes[runs[:, 0]]
    differ = len(np.unique(lines)) > 0.5 * len(lines)
    return share if differ and len(lines) >= FEWEST_KEPT and share > MOST_LINES else 0.0


def _share_turned(effort: Values, moving: Mask) -> float:
    """Share of the jumps of an effort through 0, in motion, that end where they began but for the sign; 0 for few."""
    # Friction that is fed forward turns so where the axis turns, and a square wave, which is flat in between.
    usual, sizes = float(np.median(np.abs(np.diff(effort)))), np.abs(effort)
    ways, both = np.abs(np.diff(effort)), np.abs(effort[1:] + effort[:-1])
    jumps = (effort[1:] * effort[:-1] < 0.0) & (ways > SUDDEN * usual) & moving[1:]
    later = float(np.median(np.abs(sizes[APART:] - sizes[:-APART])))
    if np.count_nonzero(jumps) < FEWEST_TURNS or later < FLAT * float(np.median(np.abs(np.diff(sizes)))):
        return 0.0
    share = float(np.mean(both[jumps] < TURNED * ways[jumps]))
    return share if usual > 0.0 and share > MOST_TURNED else 0.0


def _share_at_slope(effort: Values) -> float:
    """Share of the rows in which an effort changes as fast as it ever does; 0 where that is a few straight lines."""
    ways = np.abs(np.diff(effort))
    if float(ways.max(initial=0.0)) < FINE * resolution(effort):
        return 0.0
    is_most: Mask = _rounded(ways) == 1.0
    return float(np.count_nonzero(is_most)) / len(ways) if len(runs_of(is_most)) >= FEWEST_LINES else 0.0


def _share_at_ends(run: Run, runs: Sequence[Run]) -> float:
    """Share of the samples whose effort is at its largest or smallest value, and was not put there by a step."""
    efforts = [one.effort for one in runs] or [run.effort]
    top, bottom = max(float(effort.max()) for effort in efforts), min(float(effort.min()) for effort in efforts)
    above, below = run.effort == top, run.effort == bottom
    cut = [end & ~stepped(run.effort, end, top - bottom, is_part=len(efforts) > 1) for end in (above, below)]
    return float(np.count_nonzero(cut[0] | cut[1])) / len(run.effort)


def _share_left_behind(run: Run) -> float:
    """Share of the way of the reference that it makes while the position stands still for a quarter of a second."""
    if run.reference is None:
        return 0.0
    count = max(round(0.25 / run.step), 2)
    whole = len(run.position) // count * count
    still = np.ptp(run.position[:whole].reshape(-1, count), axis=1) == 0.0
    way = np.abs(np.diff(run.reference[:whole].reshape(-1, count), axis=1)).sum(axis=1)
    total = float(way.sum())
    return float(way[still].sum()) / total if total > 0.0 else 0.0


def _leaves_reference(run: Run) -> float:
    """By how much a position that follows its reference leaves it along a log, over the travel; 0 where it does not."""
    if (found := _beside_reference(run)) is None:
        return 0.0
    usual, error = found
    place, along = usual[:, 1], np.linspace(-1.0, 1.0, len(error))
    turned = np.where(along > 0.0, 1.0, -1.0)
    more = np.column_stack([usual, along, turned, place * along, place * turned])
    follows = abs(float(solve(usual, usual, error)[1])) < FOLLOWS
    by, rest = (float(np.std(error - combine(x, solve(x, x, error)))) for x in (usual, more))
    left = math.sqrt(max(by**2 - rest**2, 0.0))
    return left if follows and left > max(LEAVES, BY_FAR * rest) else 0.0


def _beside_reference(run: Run) -> tuple[Values, Values] | None:
    """What a loop stays behind by, and by how much a position does, over the travel; none without a reference."""
    if run.reference is None:
        return None
    lag = lag_of(run.reference, run)
    rows = np.arange(lag, len(run.position), max((len(run.position) - lag) // MOST_COMPARED, 1))
    asked, way = run.reference[rows - lag], float(np.ptp(run.reference))
    if not way or len(rows) < FEWEST_COMPARED:
        return None
    # A loop is behind by its velocity and its friction, and may reach for a share of the travel only, all along.
    place, speed = asked / way, np.gradient(asked)
    usual = [np.ones(len(rows)), place, speed / max(float(np.abs(speed).max()), 1e-300), np.sign(speed)]
    return np.column_stack(usual), (run.position[rows] - asked) / way


def scale_off(runs: Sequence[Run]) -> list[Change]:
    """How far the scale of a position may be off: it goes a share of the way that its reference asks for."""
    # A loop that is soft does the same, and no log tells the two apart.
    found = 0.0
    for usual, error in filter(None, map(_beside_reference, runs)):
        constants = solve(usual, usual, error)
        covariance, _ = coloured_covariance(usual, error - combine(usual, constants))
        share = abs(float(constants[1]))
        if max(LEAST_OFF, CLEAR * math.sqrt(max(float(covariance[1, 1]), 0.0))) < share < SOFT:
            found = max(found, share)
    return [Change(SCALE, 1.0, found, found, "between the position and its reference")] if found else []
