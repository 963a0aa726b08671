"""Figures of the report of an identification: the model beside a part of the recording that the fit did not see."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from detent.identify.fit.constants import Constants
from detent.identify.fit.estimate import rms
from detent.identify.fit.free_run import HORIZONS, Horizon, Plant, free_run, start_velocities
from detent.identify.fit.identification import HELD_OUT, Identification
from detent.identify.fit.prepare import Run
from detent.identify.page.words import SINCE, Ways, label_of, long_bar, peak_of, scaled
from detent.methods.cascade.units import percent
from detent.page.chart import Chart, Panel, Timeline, time_charts
from detent.page.figure import Figure
from detent.page.parts import Numbers
from detent.page.table import Table
from detent.page.words import count, duration

RESTART = 1.0  # time after which the simulation starts again from the recording [s]
SPREAD = 0.5  # room about a measured position for a simulated one that runs away, over its range


@dataclass(frozen=True, slots=True, eq=False)
class HeldOut:
    """A log's last part beside its simulation with constants from the first, in SI units, arrays of shape (n,)."""

    t: Numbers  # time since the log's begin [s]
    measured: Numbers  # position of the log
    restarted: Numbers  # and free: simulated position: from the recording again after each `restart`, and in one piece
    free: Numbers
    restart: float  # time between two restarts [s]

    @property
    def rms_restarted(self) -> float:
        """Root mean square of what the restarted simulation is off."""
        return rms(self.restarted - self.measured)


def hold_out(found: Identification) -> tuple[HeldOut, ...]:
    """Simulate the last part of each log with constants from the first parts, as the table of horizons does."""
    constants = found.seen
    if constants is None or not found.horizons:
        return ()
    return tuple(_simulated(constants, run, round((1.0 - HELD_OUT) * len(run.position))) for run in found.runs)


def _simulated(constants: Constants, run: Run, cut: int) -> HeldOut:
    unseen = run.part(cut, len(run.position))
    free = free_run(constants, unseen)
    begin = len(unseen.position) - len(free)
    # A second, or the longest of the usual horizons that goes twice into a shorter stretch.
    fitting = (h for h in HORIZONS if h <= RESTART and 2.0 * h <= len(free) * run.step)
    samples = max(round(max(fitting, default=min(HORIZONS)) / run.step), 2)
    plant, velocity = Plant(constants, run.step), start_velocities(unseen)
    pieces: list[Numbers] = []
    for start in range(begin, len(unseen.position), samples):
        number = min(samples, len(unseen.position) - start)
        at, speed = float(unseen.position[start]), float(velocity[start])
        pieces.append(plant.run(unseen.effort, start, number, at, speed) if number > 1 else np.array([at]))
    t = (cut + begin + np.arange(len(free))) * run.step
    return HeldOut(t, unseen.position[begin:], np.concatenate(pieces), free, samples * run.step)


# ---- figures


def simulated_figures(found: Identification, held: Sequence[HeldOut], shown: int) -> list[Figure]:
    """The simulation of one log over time, and how far that of all can be trusted."""
    ways = Ways(found.runs[0].position_unit)
    horizons = [_horizon_figure(found.horizons, ways)] if found.horizons else []
    if not held:
        return horizons
    one = held[shown]
    worst = (
        f"Of {count(len(held), 'recording')} the one with the largest errors, {found.logs[shown].name}. "
        if len(held) > 1
        else ""
    )
    caption = Markup(
        "{}A simulated axis with constants from the first three quarters of the recording, along its last quarter. It "
        "gets the recorded effort and nothing else; no controller holds it, so every error adds up. <b>Restarted every "
        "{}\u202fs it is {} off on average (rms), in one piece {}.</b> Where the curves lie on one another the model "
        "does what the axis did."
    ).format(worst, f"{one.restart:.3g}", ways.error(one.rms_restarted), ways.error(rms(one.free - one.measured)))
    title = "On the part that the fit did not see"
    return [Figure(title=title, caption=caption, charts=held_charts(one, ways)), *horizons]


def held_charts(held: HeldOut, ways: Ways) -> list[Chart]:
    """Draw the held-out part: recorded and simulated position, and both differences."""
    place, again = ways.place, f"simulated, from the recording again every {held.restart:.3g} s"
    curves = [
        scaled(again, "speed", held.restarted, place, width=2.5),
        scaled("simulated in one piece", "drive", held.free, place),
        scaled("recorded", "left", held.measured, place, dash=(5, 4)),
    ]
    label = label_of("position", place.name)
    # A simulation that runs away must not squeeze the rest.
    room = SPREAD * float(np.ptp(held.measured))
    low, high = float(held.measured.min()) - room, float(held.measured.max()) + room
    leaves = bool(np.any((held.free < low) | (held.free > high)))
    span = (low * place.factor, high * place.factor) if leaves else None
    return time_charts(Timeline(name="held", t=held.t, label=SINCE, unit="s"), [
        Panel(name="held-position", label=label, curves=curves, span=span),
        _off_panel("held-restarted", again, "speed", held.measured - held.restarted, ways),
        _off_panel("held-free", "simulated in one piece", "drive", held.measured - held.free, ways),
    ])  # fmt: skip


def _off_panel(name: str, label: str, colour: str, off: Numbers, ways: Ways) -> Panel:
    scale = ways.small(peak_of(off))
    curve = scaled(f"recorded less {label}", colour, off, scale)
    return Panel(name=name, label=label_of("difference", scale.name), height=150, zero=True, curves=[curve])


def _horizon_figure(horizons: Sequence[Horizon], ways: Ways) -> Figure:
    heads = [
        ("simulated for", False), ("starts", True), ("simulated, rms", True), ("largest", True),
        ("without a model, rms", True), ("simulated over without a model", False), ("way of the axis, rms", True),
    ]  # fmt: skip
    caption = Markup(
        "How far off the axis is at the end of a simulated stretch that starts where the recording says it was. "
        "<b>Without a model</b> it would go on with the velocity it started with: a model that is worth something is "
        "far below 100\u202f%. One step shows little but the noise of the encoder; the free run is one stretch, and "
        "its errors are over all of it."
    )
    rows: list[list[str]] = []
    for h in horizons:
        share = h.rms / h.naive if h.naive > 0.0 else math.nan
        name = f"free run, {duration(float(h.duration))}" if h.name == "free run" else h.name
        bar = long_bar(share / 1.5, percent(share), chosen=share < 1.0)
        errors = [ways.error(value) for value in (h.rms, h.largest, h.naive)]
        rows.append([name, count(h.starts), *errors, bar, ways.error(h.moved)])
    return Figure(title="How far it can be foretold", caption=caption, table=Table(heads=heads, rows=rows))
