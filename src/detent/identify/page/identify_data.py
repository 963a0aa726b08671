"""What the report of an identification shows: the identification, and what is simulated and worked out for its figures.

All is SI, in the units of the logs' positions and efforts.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from detent.errors import DetentError
from detent.identify.analyse.frequency_response import FrequencyResponse
from detent.identify.analyse.measure_response import response_of
from detent.identify.analyse.resonances import Resonances
from detent.identify.fit.constants import Constants
from detent.identify.fit.equations import HOPS, Motion
from detent.identify.fit.free_run import HORIZONS, Plant, free_run, start_velocities
from detent.identify.fit.identification import HELD_OUT, Identification, prepare_all
from detent.identify.fit.regression import Fit
from detent.identify.fit.run import Run
from detent.page.parts import Numbers

RESTART = 1.0
"""Time after which the simulation starts again from the recording [s]."""

LAGS = 60
"""Lags of the autocorrelation, in rows of the regression."""

COHERENT = 0.8
"""Coherence of a line that tells something."""

FEWEST_LINES = 10
"""Coherent lines without which there is no Bode plot."""

AGREEING = 0.9
"""Share of neighbouring lines whose accelerations are less than a factor of 2 apart, at least."""

BROADEST = 3.0
"""Highest over lowest coherent frequency, at least."""


@dataclass(frozen=True, slots=True, eq=False)
class HeldOut:
    """A log's last part beside its simulation with constants from the first, arrays of shape (n,)."""

    log: int  # which log
    t: Numbers  # time since the log's begin [s]
    measured: Numbers  # position of the log
    restarted: Numbers  # and free: simulated position: from the recording again after each `restart`, and in one piece
    free: Numbers
    restart: float  # time between two restarts [s]

    @property
    def rms_restarted(self) -> float:
        """Root mean square of what the restarted simulation is off."""
        return _rms(self.restarted - self.measured)

    @property
    def rms_free(self) -> float:
        """Root mean square of what the simulation in one piece is off."""
        return _rms(self.free - self.measured)


@dataclass(frozen=True, slots=True, eq=False)
class Windows:
    """Rows of the regression of one log, arrays of shape (m,)."""

    t: Numbers  # middle of each window since the log's begin [s]
    effort: Numbers  # and fitted, residual: measured, by the model, and the difference
    fitted: Numbers
    residual: Numbers
    velocity: Numbers  # mean velocity
    place: Numbers  # number of each window on an even grid; where it jumps, windows in between were not usable
    hop: float  # and width: distance of two neighbouring windows, and their width [s]
    width: float  # [s]


@dataclass(frozen=True, slots=True, eq=False)
class IdentifyReportData:
    """Everything `identify_page` shows."""

    found: Identification  # what came out
    title: str  # what was identified
    held: tuple[HeldOut, ...] = ()  # one per log; empty where nothing could be simulated
    windows: tuple[Windows, ...] = ()  # one per log; empty where nothing was fitted
    shown: int = 0  # which log is drawn
    response: FrequencyResponse | None = None  # None where no log holds an excitation that tells one
    resonances: Resonances | None = None  # what was fitted to the response


def identify_report_data(
    found: Identification,
    title: str | None = None,
    response: FrequencyResponse | None = None,
    resonances: Resonances | None = None,
) -> IdentifyReportData:
    """Work out what the report shows."""
    held = hold_out(found)
    shown = max(range(len(held)), key=lambda k: held[k].rms_restarted) if held else 0
    return IdentifyReportData(
        found=found,
        title=title or _names(found),
        held=held,
        windows=windows_of(found),
        shown=shown,
        response=response or _response(found, shown),
        resonances=resonances,
    )


def _rms(values: Numbers) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _names(found: Identification) -> str:
    first, more = found.logs[0].name, len(found.logs) - 1
    return f"{first} and {more} more" if more else first


# ---- simulation of what was not seen


def hold_out(found: Identification) -> tuple[HeldOut, ...]:
    """Simulate the last part of each log with constants from the first parts, as the table of horizons does."""
    constants = found.seen
    if constants is None or not found.horizons:
        return ()
    cuts = [round((1.0 - HELD_OUT) * len(run.position)) for run in found.runs]
    return tuple(_simulated(constants, k, run, cut) for k, (run, cut) in enumerate(zip(found.runs, cuts, strict=True)))


def _simulated(constants: Constants, log: int, run: Run, cut: int) -> HeldOut:
    unseen = run.part(cut, len(run.position))
    free = free_run(constants, unseen)
    begin = len(unseen.position) - len(free)
    window = _restart_of(len(free) * run.step)
    samples = max(round(window / run.step), 2)
    plant, velocity = Plant(constants, run.step), start_velocities(unseen)
    pieces: list[Numbers] = []
    for start in range(begin, len(unseen.position), samples):
        count = min(samples, len(unseen.position) - start)
        at, speed = float(unseen.position[start]), float(velocity[start])
        pieces.append(plant.run(unseen.effort, start, count, at, speed) if count > 1 else np.array([at]))
    t = (cut + begin + np.arange(len(free))) * run.step
    return HeldOut(log, t, unseen.position[begin:], np.concatenate(pieces), free, samples * run.step)


def _restart_of(seconds: float) -> float:
    """A second, or the longest of the usual horizons that goes twice into a shorter stretch."""
    return max((h for h in HORIZONS if h <= RESTART and 2.0 * h <= seconds), default=min(HORIZONS))


# ---- the regression


def windows_of(found: Identification) -> tuple[Windows, ...]:
    """Rows of the regression, log by log; None without a fit."""
    fit = found.fit
    if fit is None:
        return ()
    motions = [p.motion for p in prepare_all(found.runs, fit.instruments)]
    ends = np.cumsum([len(motion.rows) for motion in motions])
    return tuple(
        _windows(fit, run, motion, slice(int(end) - len(motion.rows), int(end)))
        for run, motion, end in zip(found.runs, motions, ends, strict=True)
    )


def _windows(fit: Fit, run: Run, motion: Motion, part: slice) -> Windows:
    rows = motion.rows
    hop = max(motion.kernel.half // HOPS, 1)
    first = int(rows[0]) if len(rows) else 0
    return Windows(
        t=rows * run.step,
        effort=fit.effort[part],
        fitted=fit.effort[part] - fit.residual[part],
        residual=fit.residual[part],
        velocity=motion.velocity,
        place=(rows - first) // hop,
        hop=hop * run.step,
        width=(2 * motion.kernel.half + 1) * run.step,
    )


def autocorrelation(windows: Sequence[Windows]) -> tuple[Numbers, Numbers]:
    """Correlation of residuals with those some windows earlier; gaps do not count as neighbours."""
    most = min(LAGS, max(int(one.place[-1]) for one in windows if len(one.place)))
    products, pairs = np.zeros(most + 1), np.zeros(most + 1)
    for one in windows:
        if not len(one.place):
            continue
        size = int(one.place[-1]) + 1
        values, known = np.zeros(size), np.zeros(size)
        values[one.place], known[one.place] = one.residual, 1.0
        for lag in range(min(most, size - 1) + 1):
            products[lag] += values[lag:] @ values[: size - lag]
            pairs[lag] += known[lag:] @ known[: size - lag]
    means = np.divide(products, pairs, out=np.full(most + 1, np.nan), where=pairs > 0)
    return (means / means[0] if means[0] > 0 else np.zeros(most + 1)), pairs


# ---- frequency response


def _response(found: Identification, shown: int) -> FrequencyResponse | None:
    """Response of a log, where it tells one: periods, or an open loop, and enough coherent lines.

    Windows over a closed loop show the controller where noise drives the effort; so a log with a reference must have
    periods.
    """
    run = found.runs[shown]
    try:
        response = response_of(found.logs[shown], run.effort_name)
    except DetentError:
        return None
    is_open = response.resolution == 0.0 or run.reference is None
    return response if is_open and _tells(response) else None


def _tells(response: FrequencyResponse) -> bool:
    """True for enough coherent lines whose neighbours agree.

    Lines that are hardly excited beside strong ones hold what friction makes of these; it comes back in each period, so
    that coherence does not show it.
    """
    told = response.coherence >= COHERENT
    f, size = response.frequency[told], response.magnitude[told]
    if len(f) < FEWEST_LINES or f[-1] < BROADEST * f[0]:
        return False
    apart = np.abs(np.diff(np.log(size * f**2)))
    return bool(np.mean(apart < math.log(2.0)) > AGREEING)
