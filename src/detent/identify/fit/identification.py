"""From logs to constants with limits, and a verdict: the whole way, in its order."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import numpy as np

from detent.errors import DetentError, InputError
from detent.files.screen import OnScreen
from detent.identify.fit import untold
from detent.identify.fit.constants import Constants, constants_of, further, reaching
from detent.identify.fit.doubt import doubt_of
from detent.identify.fit.equations import LOSS, Rows, Run, make_kernel, make_run
from detent.identify.fit.estimate import Estimate, quantile
from detent.identify.fit.free_run import ClosedLoop, Horizon, simulate_closed_loop, simulate_horizons
from detent.identify.fit.ladder import (
    AT_BOUND,
    RUNGS,
    Climb,
    Rung,
    bends_tried,
    chosen_climb,
    chosen_rung,
    climb,
    extended,
    fit_rung,
)
from detent.identify.fit.output_error import STRETCH, fit_output_error
from detent.identify.fit.readings import read_otherwise
from detent.identify.fit.regression import Fit, Instruments, Prepared, Residuals, prepare, residuals_of
from detent.identify.fit.signals import look_at_log, scale_off
from detent.identify.fit.steadiness import SCALE, Change, changes_of, widen
from detent.identify.fit.verdict import (
    BETTER_MISSED,
    FAR_OFF,
    WELL_MET,
    Refusal,
    compare_methods,
    look_at_constants,
    look_at_fit,
    look_at_motion,
    look_at_prediction,
    look_at_readings,
    look_at_windows,
    missed,
)
from detent.identify.fit.windows import moved_by_windows, odd_windows, widened, without
from detent.logs.log import Log, tell_rows

Report = Callable[[str, float], None]
Method = Literal["auto", "regression", "output error"]
Verdict = Literal["trusted", "partly trusted", "refused"]

WINDOW = 0.02  # half of the window to begin with [s]
WIDEST = 0.12  # half of the widest window [s]
# Share of the noise in the square of the acceleration, at most, by what instruments are made of.
NOISE_SHARE: dict[Instruments, float] = {"reference": 0.1, "position": 0.01, "none": 0.002}
# Cosine between velocities, and between accelerations, of instruments and axis, from which on they are taken.
LIKENESS: dict[Instruments, float] = {"reference": 0.6, "position": 0.95}
WIDEST_BEND = 0.5  # half of the interval of a Stribeck velocity or a loss over its value, at most
CLEARLY = 3.0  # gain of a rung that cannot be, in standard errors, from which the chosen one lacks something
ROUNDS_OUT = 3  # fits in which windows that stick out are left out, at most
FEWEST_LEFT = 5 * len(RUNGS[-1].terms)  # windows of all logs, at least
TOLD = 1.1  # times that limits reach further from which on the notes say so
HELD_OUT = 0.25  # last part of a log that the simulation is tested on
TURN = 0.5  # range of an angle from which on a weight may show [rad]
_WAYS: dict[Instruments, str] = {
    "reference": "references as instruments",
    "position": "wider windows as instruments: no reference that the axis follows closely",
    "none": "least squares: no reference that the axis follows closely, and motion too quick for wider windows",
}


@dataclass(frozen=True, eq=False, repr=False)
class Identification(OnScreen):
    """Constants of an axis, their limits, and what of them can be trusted.

    Attributes
    ----------
    logs : tuple of Log
        What was read.
    runs : tuple of Run
        The same on even grids.
    constants : Constants or None
        None where nothing could be fitted.
    estimates : tuple of Estimate
        Each constant with its interval.
    climbs : tuple of Climb
        The model-order ladder; the last one taken is the model.
    fit : Fit or None
        The regression behind the constants.
    horizons : tuple of Horizon
        Simulation errors on the last part of each log, with constants from the first.
    refusals : tuple of Refusal
        What is not trusted.
    seen : Constants or None
        Constants from the first part of each log, which the simulation errors belong to.
    closed_loop : ClosedLoop or None
        The same simulated under the loops of the log; None where it shows none.
    notes : tuple of str
        What was chosen on the way.
    """

    logs: tuple[Log, ...]
    runs: tuple[Run, ...]
    constants: Constants | None
    estimates: tuple[Estimate, ...]
    climbs: tuple[Climb, ...]
    fit: Fit | None
    horizons: tuple[Horizon, ...]
    refusals: tuple[Refusal, ...]
    seen: Constants | None = None
    closed_loop: ClosedLoop | None = None
    notes: tuple[str, ...] = ()

    @property
    def verdict(self) -> Verdict:
        """Trusted without refusals, refused where one concerns all constants, else partly trusted."""
        if not self.refusals:
            return "trusted"
        return "refused" if any(not r.constants for r in self.refusals) or not self.trusted else "partly trusted"

    @property
    def bounded(self) -> tuple[str, ...]:
        """Constants that a search left at an end of its range: no values, so without limits."""
        return () if self.constants is None else self.constants.bounded

    @property
    def residuals(self) -> Residuals | None:
        """What the residuals of the regression look like."""
        return None if self.fit is None else residuals_of(self.fit)

    @property
    def rung(self) -> Rung | None:
        """The chosen model."""
        return chosen_rung(self.climbs) if self.climbs else None

    @property
    def trusted(self) -> tuple[Estimate, ...]:
        """Constants that no refusal concerns."""
        if any(not r.constants for r in self.refusals):
            return ()
        refused = {name for r in self.refusals for name in r.constants}
        return tuple(e for e in self.estimates if e.name not in refused)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        c = self.constants
        return {
            "verdict": self.verdict,
            "model": self.rung.name if self.rung else None,
            "constants": [e.to_dict() | {"trusted": e in self.trusted} for e in self.estimates],
            "correlation": None if c is None else {"names": list(c.names), "matrix": c.correlation.tolist()},
            "inseparable": [] if c is None else [list(pair) for pair in c.inseparable()],
            "residuals": None if self.residuals is None else asdict(self.residuals),
            "ladder": [
                {"model": s.rung.name, "error": s.error, "gain": None if np.isnan(s.gain) else s.gain, "taken": s.taken}
                for s in self.climbs
            ],
            "simulation": [asdict(h) for h in self.horizons],
            "closed_loop": None if self.closed_loop is None else asdict(self.closed_loop),
            "refusals": [r.to_dict() for r in self.refusals],
            "notes": list(self.notes),
            "logs": [log.to_dict() for log in self.logs],
        }


def identify(
    logs: Sequence[Log], effort: str | None = None, *, method: Method = "auto", report: Report = untold
) -> Identification:
    """Identify an axis from recorded runs."""
    runs = tuple(make_run(log, effort) for log in logs)
    _check_alike(runs)
    refusals = [r for log, run in zip(logs, runs, strict=True) for r in look_at_log(log, run, runs)]
    parts = choose_windows(runs)
    refusals += look_at_motion(runs, parts)
    windows = sum(len(p.motion.rows) for p in parts)
    if windows < FEWEST_LEFT:
        if not refusals:
            refusals.append(Refusal("too short", "hardly any window without standstill", "record longer moves"))
        return Identification(tuple(logs), runs, None, (), (), None, (), tuple(refusals))
    parts, (climbs, fit, rivals), odd = _fit_usual(parts, runs, report)
    runs = tuple(p.run for p in parts)
    windows = sum(len(p.motion.rows) for p in parts)
    changes, clearest = changes_of(parts, fit)
    changes += scale_off(runs)
    own = replace(fit, covariance=fit.covariance.copy())
    widen(parts, fit, changes)
    constants = constants_of(fit, rivals)
    refusals += look_at_fit(parts, fit, chosen_climb(climbs).error, changes)
    tested = _Tested(constants)
    if constants.value("mass") > 0.0:
        tested = _simulated(runs, constants, fit, chosen_rung(climbs), method, report)
    refusals += tested.disagreement
    judged = _judge(runs, parts, climbs, tested, refusals)
    if method != "output error" and all(r.constants for r in judged):
        tested, depends = _by_windows(parts, own, tested, judged)
        judged += depends
    if method == "auto" and [r.subject for r in judged if not r.constants] == [FAR_OFF]:
        other = _other_way(runs, tested, fit, chosen_rung(climbs), report)
        if other.constants is not tested.constants:
            judged = _judge(runs, parts, climbs, other, refusals)
        tested = other
    doubt = doubt_of(parts, own, clearest)
    constants, horizons = further(tested.constants, doubt.times), tested.horizons
    others = read_otherwise(logs, parts, fit, constants)
    judged += look_at_readings(others.held_by(tested.constants), parts, judged, others.left_open)
    constants = others.held_by(constants)
    kernel, told = parts[0].motion.kernel, f"{runs[0].effort_name} [{runs[0].effort_unit}]"
    width = 2e3 * kernel.half * kernel.step
    notes = (f"effort: {told}", f"windows of {width:.3g} ms, {windows} of them", _WAYS[parts[0].instruments])
    notes += tuple(_told_odd(log, run, rows) for log, run, rows in zip(logs, runs, odd, strict=True) if len(rows))
    notes += tuple(_told_scale(change) for change in changes if change.name == SCALE)
    notes += (*others.notes, str(doubt)) if doubt.usual > TOLD else others.notes
    notes += (tested.believed,) if tested.believed else ()
    if not tested.believed and method != "output error" and (miss := missed(horizons)) > WELL_MET:
        notes += (f"held-out travel is missed by {miss:.0%}: --method output-error may predict it better",)
    estimates = constants.estimates(runs[0])
    results = (constants, estimates, climbs, fit, horizons, tuple(judged), tested.seen, tested.closed, notes)
    return Identification(tuple(logs), runs, *results)


class _Tested(NamedTuple):
    """Constants, with what became of their simulation on the held-out part, and what two ways to them say."""

    constants: Constants
    seen: Constants | None = None
    horizons: tuple[Horizon, ...] = ()
    closed: ClosedLoop | None = None
    believed: str = ""
    disagreement: tuple[Refusal, ...] = ()


def _judge(
    runs: Sequence[Run],
    parts: Sequence[Prepared],
    climbs: Sequence[Climb],
    tested: _Tested,
    refusals: Sequence[Refusal],
) -> list[Refusal]:
    """What is refused, with what constants and their simulation add to it."""
    found = [*refusals, *look_at_constants(runs[0], tested.constants, parts)]
    return [*found, *look_at_prediction(climbs, tested.horizons, found)]


def _by_windows(
    parts: Sequence[Prepared], fit: Fit, tested: _Tested, refusals: Sequence[Refusal]
) -> tuple[_Tested, list[Refusal]]:
    """Constants that wider windows tell otherwise: their limits hold both, and what differs by more is refused."""
    refused = {name for r in refusals for name in r.constants}
    left = [name for name in tested.constants.names if name not in refused]
    moved = moved_by_windows(parts, fit, left)
    depends = look_at_windows(parts[0].run, [one for one in moved if not one.is_slight], left)
    constants = widened(tested.constants, {one.name: one.other - one.value for one in moved})
    return tested._replace(constants=constants), list(depends)


def _simulated(  # noqa: PLR0913 - all that a simulation consists of
    runs: Sequence[Run], constants: Constants, fit: Fit, rung: Rung, method: Method, report: Report
) -> _Tested:
    """Constants tested on the held-out part; by simulation, where that is asked for, and against the regression."""
    if method != "output error":
        return _Tested(constants, *_test_simulation(runs, fit, rung, method, report))
    refined = _refine(runs, constants, "output error", report)
    seen, horizons, closed = _test_simulation(runs, fit, rung, method, report)
    if seen is None:
        return _Tested(refined)
    _, others, _ = _test_simulation(runs, fit, rung, "regression", report)
    believed, told = compare_methods(runs[0], (constants, refined), (others, horizons))
    return _Tested(refined, seen, horizons, closed, believed, tuple(told))


def _other_way(runs: Sequence[Run], tested: _Tested, fit: Fit, rung: Rung, report: Report) -> _Tested:
    """The simulation fit in the place of a regression that does not predict the motion, where it predicts it."""
    # Axes that stick, lose force in a gear, or have a coarse encoder: the regression sees little of what holds them.
    # Of logs that no model predicts well the limits of the simulation fit alone miss the truth too often: they reach as
    # far as those of the regression.
    try:
        seen, horizons, closed = _test_simulation(runs, fit, rung, "output error", report)
        other, by = missed(tested.horizons), missed(horizons)
        told = f"the regression misses held-out travel by {other:.0%}, the simulation fit by {by:.0%}"
        if seen is None or not 0.0 < by < min(BETTER_MISSED * other, WELL_MET):
            return tested._replace(believed=f"{told}: neither is to be believed")
        refined = reaching(_refine(runs, tested.constants, "output error", report), tested.constants)
    except DetentError:  # too short for its stretches
        return tested
    believed = f"{told}: its constants are given, with intervals that hold those of both"
    return _Tested(refined, seen, horizons, closed, believed, tested.disagreement)


def _check_alike(runs: Sequence[Run]) -> None:
    """Refuse logs of which one axis cannot have made all."""
    first = runs[0]
    for run in runs[1:]:
        for what, got, wanted in (
            ("positions", run.position_unit, first.position_unit),
            ("effort", f"{run.effort_name} [{run.effort_unit}]", f"{first.effort_name} [{first.effort_unit}]"),
        ):
            if got != wanted:
                allowed, remedy = f"{wanted}, as in {first.name}", "state the columns and units of both"
                raise InputError.of_file(run.name, f"{what} in {got}", allowed, remedy)


def _refine(runs: Sequence[Run], constants: Constants, what: str, report: Report) -> Constants:
    """Constants by simulation, from those of the regression on."""
    duration = min(STRETCH, min(float(run.t[-1]) for run in runs) / 4)
    return fit_output_error(runs, constants, duration, partial(report, what))


def choose_windows(runs: Sequence[Run]) -> list[Prepared]:
    """Windows with their instruments: the first of references, wider windows and none that is near the motion."""
    # Instruments that say little of the motion leave a bias smaller than the scatter that they bring.
    ways: list[Instruments] = ["reference"] if all(run.reference is not None for run in runs) else []
    for way in (*ways, "position"):
        parts = prepare_all(runs, way)
        if all(_follows(p) for p in parts):
            return parts
    return prepare_all(runs, "none")


def _follows(part: Prepared) -> bool:
    """True where velocity and acceleration of the instruments are those of the axis for the most part."""
    motion, ideal = part.motion, part.ideal
    for a, b in ((motion.velocity, ideal.velocity), (motion.acceleration, ideal.acceleration)):
        size = float(np.linalg.norm(a) * np.linalg.norm(b))
        if not (size > 0.0 and float(a @ b) / size > LIKENESS[part.instruments]):
            return False
    return True


def prepare_all(runs: Sequence[Run], instruments: Instruments) -> list[Prepared]:
    """Windows wide enough that noise does not matter, the same for all runs."""
    half = WINDOW
    before: Sequence[Prepared | None] = [None for _ in runs]
    while True:
        kernels = [make_kernel(max(5, round(half / run.step)), run.step) for run in runs]
        parts = [prepare(r, k, instruments, like) for r, k, like in zip(runs, kernels, before, strict=True)]
        seconds = [float(kernel.second @ kernel.second) for kernel in kernels]
        noise = sum(len(p.motion.rows) * p.run.noise**2 * s for p, s in zip(parts, seconds, strict=True))
        power = sum(float(np.sum(p.motion.acceleration**2)) for p in parts)
        if half >= WIDEST or (noise / power if power > 0.0 else 0.0) < NOISE_SHARE[instruments]:
            return parts
        half, before = 1.4 * half, parts


def _rungs_for(parts: Sequence[Prepared], runs: Sequence[Run]) -> tuple[Rung, ...]:
    """The ladder of these runs: an axis that turns may lift a weight, and lose force where it does."""
    if not runs[0].is_rotary or max(float(np.ptp(run.position)) for run in runs) < TURN:
        return RUNGS
    plain = RUNGS[1]
    weights = [plain, *(extended(plain, terms) for terms in (("pendulum",), ("pendulum", "pendulum.across")))]
    extra = chosen_rung(climb(parts, weights)).terms[len(plain.terms) :]
    if not extra:
        return RUNGS
    ladder = [extended(rung, extra) for rung in RUNGS]
    each = next(rung for rung in ladder if rung.name == "per direction")
    text = "friction of each direction, and a share of the force lost in the transmission"
    return (*ladder, Rung("loss", text, (*each.terms, LOSS)))


def _fit_all(
    parts: Sequence[Prepared], runs: Sequence[Run], report: Report
) -> tuple[tuple[Climb, ...], Fit, list[Fit]]:
    """Climb the ladder; the fit of the chosen model, and those of models as good."""
    climbs = climb(parts, _rungs_for(parts, runs), partial(report, "ladder"))
    chosen = chosen_climb(climbs)
    fits = {c.rung.name: c.fit for c in climbs if _is_rival(c, chosen)}
    if chosen.rung.is_bent and not _is_told(parts, fits[chosen.rung.name], _plain(climbs).fit):
        climbs = tuple(replace(c, taken=c.taken and not c.rung.is_bent) for c in climbs)
        chosen = chosen_climb(climbs)
        fits.setdefault(chosen.rung.name, chosen.fit)
    return climbs, fits.pop(chosen.rung.name), list(fits.values())


def _fit_usual(
    parts: Sequence[Prepared], runs: Sequence[Run], report: Report
) -> tuple[Sequence[Prepared], tuple[tuple[Climb, ...], Fit, list[Fit]], list[Rows]]:
    """Fit without the windows that stick out; what is left, the fit, and the middles of those left out."""
    found, left_out = _fit_all(parts, runs, report), [np.zeros(0, dtype=np.intp) for _ in parts]
    for _ in range(ROUNDS_OUT):
        odd = odd_windows(parts, found[1])
        fewer = [without(p, rows) for p, rows in zip(parts, odd, strict=True)]
        if not any(map(len, odd)) or sum(len(p.motion.rows) for p in fewer) < FEWEST_LEFT:
            break
        parts, found = fewer, _fit_all(fewer, runs, report)
        left_out = [np.union1d(a, b) for a, b in zip(left_out, odd, strict=True)]
    return parts, found, left_out


def _told_odd(log: Log, run: Run, rows: Rows) -> str:
    """Windows that were left out, by the rows of the file in their middles."""
    times = np.asarray(log.t[0] + rows * run.step, np.float64)
    places = log.rows[np.minimum(np.searchsorted(log.t, times), len(log.t) - 1)].tolist()
    cuts = (np.flatnonzero(np.diff(rows) > 2 * WINDOW / run.step) + 1).tolist()
    named = [(places[first], places[last - 1]) for first, last in pairwise([0, *cuts, len(rows)])]
    return f"{log.name}: left out about {tell_rows(named)}: the effort there is not that of the rest of the log"


def _plain(climbs: Sequence[Climb]) -> Climb:
    """The model without a bend that was chosen before one with it was."""
    return chosen_climb([c for c in climbs if not c.rung.is_bent])


def _knows_mass(fit: Fit) -> bool:
    """True where the interval of a mass does not hold 0."""
    return fit.value("mass") > quantile(float(fit.degrees[fit.names.index("mass")])) * fit.error("mass")


def _told_scale(change: Change) -> str:
    """A scale that is in doubt, in a sentence."""
    off = f"position and reference differ by {change.share:.1%} in scale, or the loop is soft"
    return f"{off}: no log tells which, the limits hold both"


def _is_told(parts: Sequence[Prepared], fit: Fit, plain: Fit) -> bool:
    """True where the log tells the bend of a model, more than a bound of it, and that friction rises to standstill.

    What is known without a bend must be known with it: of a few windows a loss explains all, masses and friction too.
    """
    if _knows_mass(plain) and not _knows_mass(fit):
        return False
    # A model that predicts well with constants that nobody knows stays among the rivals: its spread widens the limits.
    reach = np.array([quantile(d) for d in fit.degrees.tolist()]) * np.sqrt(np.maximum(np.diag(fit.covariance), 0.0))
    tried = bends_tried(parts, fit.model)
    is_inside = (1.0 + AT_BOUND) * tried[0] < fit.bend < (1.0 - AT_BOUND) * tried[-1]
    if not (is_inside and reach[-1] < WIDEST_BEND * fit.bend):
        return False
    return all(fit.values[k] > reach[k] for k, name in enumerate(fit.names) if name.startswith("excess"))


def _is_rival(c: Climb, chosen: Climb) -> bool:
    """True for the chosen rung, and for one whose predictions are as good within their scatter, or impossibly good."""
    if c is chosen:
        return True
    # Friction that falls to standstill is none that the model has; but if it tells the log better, the model lacks it.
    if not c.possible and c.gain > CLEARLY:
        return True
    if not c.possible or len(c.stretches) != len(chosen.stretches) or "viscous" not in " ".join(c.rung.terms):
        return False
    worse = c.stretches - chosen.stretches
    return bool(worse.mean() < worse.std(ddof=1) / np.sqrt(len(worse)))


def _test_simulation(
    runs: Sequence[Run], fit: Fit, rung: Rung, method: Method, report: Report
) -> tuple[Constants | None, tuple[Horizon, ...], ClosedLoop | None]:
    """Constants from the first part of each log, simulated along the last."""
    cuts = [round((1.0 - HELD_OUT) * len(run.position)) for run in runs]
    seen = [run.part(0, cut) for run, cut in zip(runs, cuts, strict=True)]
    unseen = [run.part(cut, len(run.position)) for run, cut in zip(runs, cuts, strict=True)]
    parts = prepare_all(seen, fit.instruments)
    if sum(len(p.motion.rows) for p in parts) < 3 * len(fit.names):
        return None, (), None
    constants = constants_of(fit_rung(parts, rung))
    del parts  # a simulation takes as much memory
    if constants.value("mass") <= 0.0:
        return None, (), None
    if method == "output error":
        constants = _refine(seen, constants, "output error on the first part", report)
    tell = partial(report, "simulation")
    return constants, simulate_horizons(constants, unseen, tell), simulate_closed_loop(constants, seen, unseen)
