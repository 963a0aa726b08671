"""The page about a replayed recording: how far simulation and machine are apart."""

import math
from dataclasses import replace

import numpy as np

from detent.methods.cascade.page import error_panel, pair_panel
from detent.methods.cascade.replay import Compared, ReplayRun
from detent.methods.cascade.schema import CascadeSpec
from detent.methods.cascade.units import units_of
from detent.page.chart import Chart, Panel, Timeline, time_charts
from detent.page.figure import Figure
from detent.page.frame import Headline, Page, Section, card
from detent.page.parts import Note
from detent.page.run_page import page_title, warnings
from detent.page.table import Table, bar_cell
from detent.page.words import GAP, count, duration, number, percent

ZOOM_SHARE, ZOOM_LEAST = 0.04, 0.4  # part of a recording shown around its largest difference, at least so long [s]


def replay_page(spec: CascadeSpec, run: ReplayRun, settings: dict[str, str] | None = None) -> Page:
    """The page of a replay."""
    written = units_of(spec).written
    return Page(
        title=page_title(spec.axis.name, run, done="replayed"),
        headline=Headline(
            level="good" if run.done else "bad",
            verdict="Replayed" if run.done else "Not replayed",
            name=run.job.name,
            kicker=f"Comparison of a recording with the simulated axis {spec.axis.name}",
            lead=_apart(spec, run) if run.done else f"{run.failure[:1].upper()}{run.failure[1:]}.",
        ),
        cards=[
            card(
                f"{one.name}, rms difference".capitalize(),
                written(one.rms, one.unit),
                f"largest {written(one.peak, one.unit)}; {percent(one.relative)} of the recording",
            )
            for one in shown_signals(run)
        ],
        notes=warnings(run.warnings) + [Note("note", text) for text in run.job.notes],
        sections=[
            Section("Recorded and simulated", _curves(spec, run)),
            Section("In figures", [_table(spec, run)] if run.compared else []),
        ],
        settings=settings or {},
    )


def _apart(spec: CascadeSpec, run: ReplayRun) -> str:
    """How far both are apart, in two sentences."""
    place, error = run.compared[0], units_of(spec).error
    how = (
        f"is driven by the recorded {run.open_loop}, with its loops open,"
        if run.open_loop
        else "follows the recorded reference"
    )
    text = (
        f"For {duration(run.job.seconds)} the simulated axis {how} and deviates from the recorded "
        f"position by {error(place.rms)} (rms), {error(place.peak)} at most."
    )
    # What drove both, where that can differ.
    moved = ("m", "rad")
    efforts = [one for one in run.compared if one.unit.partition("/")[0] not in moved and one.name != run.open_loop]
    if efforts:
        text += f" Its {efforts[0].name} differs from the recorded one by {percent(efforts[0].relative)}."
    return text


def shown_signals(run: ReplayRun) -> list[Compared]:
    """Signals that are drawn: all but the acceleration, which is noise to the eye."""
    return [one for one in run.compared if one.name != "acceleration"]


# ---- figures


def _curves(spec: CascadeSpec, run: ReplayRun) -> list[Figure]:
    """Both above one another, and the difference of the positions; whole and magnified."""
    if not run.compared:
        return []
    t = run.job.t - run.job.t[0]
    begin, end = magnified(run)
    caption = (
        "Dashed: recording. Solid: simulation, at the same times. Where the curves coincide the model reproduces the "
        "machine; the difference is plotted below."
    )
    near = (
        f"The same from {number(begin)}{GAP}s to {number(end)}{GAP}s, where the positions differ most. Check whether "
        "they diverge when the axis starts or reverses (friction), while it accelerates (mass), or at constant "
        "speed (viscous friction, delay)."
    )
    everything = slice(0, len(t))
    kept = slice(int(np.searchsorted(t, begin)), int(np.searchsorted(t, end, side="right")))
    whole = Figure(title="The whole recording", caption=caption, charts=_charts("whole", spec, run, everything))
    if kept == everything or kept.stop - kept.start < 3:
        return [whole]
    return [whole, Figure(title="Where they differ most", caption=near, charts=_charts("near", spec, run, kept))]


def magnified(run: ReplayRun) -> tuple[float, float]:
    """Stretch around the largest difference of the positions [s]."""
    t = run.job.t - run.job.t[0]
    half = 0.5 * max(ZOOM_LEAST, ZOOM_SHARE * float(t[-1]))
    at = float(t[int(np.argmax(np.abs(run.compared[0].difference)))])
    begin = min(max(at - half, 0.0), max(float(t[-1]) - 2 * half, 0.0))
    return begin, begin + 2 * half


def _charts(name: str, spec: CascadeSpec, run: ReplayRun, rows: slice) -> list[Chart]:
    units, panels = units_of(spec), list[Panel]()
    for index, one in enumerate(shown_signals(run)):
        recorded, simulated = ("recorded", one.measured[rows]), ("simulated", one.simulated[rows])
        pair = pair_panel(f"{name}-{index}", one.name, units.of(one.unit), recorded, simulated)
        panels.append(replace(pair, about=f"{one.name}, recorded and simulated, over time"))
        if one.unit in {"m", "rad"}:
            less = ("recorded minus simulated", one.difference[rows])
            off = error_panel(f"{name}-{index}-off", "difference", less, units)
            panels.append(replace(off, about=f"{one.name}, recorded minus simulated, over time"))
    t = run.job.t[rows] - run.job.t[0]
    return time_charts(Timeline(name=name, t=t, label="time since the recording began", unit="s"), panels)


def _table(spec: CascadeSpec, run: ReplayRun) -> Figure:
    written = units_of(spec).written
    heads = [("signal", False), ("rms difference", True), ("largest", True), ("relative [%]", True)]
    longest = max((100 * one.relative for one in run.compared if not math.isnan(one.relative)), default=0.0) or 1.0
    rows = [
        [one.name, written(one.rms, one.unit), written(one.peak, one.unit), bar_cell(100 * one.relative, longest)]
        for one in run.compared
    ]
    caption = (
        f"Over {count(len(run.job.t))} samples. Relative is the norm of the difference over the norm of the recording. "
        "Quantities that were not recorded (velocity, acceleration) are derived from both positions in the same way, "
        "with a zero-phase low-pass at 100 Hz."
    )
    return Figure(title="Recording minus simulation", caption=caption, table=Table(heads=heads, rows=rows))


# ---- for the terminal


def replay_summary(spec: CascadeSpec, run: ReplayRun) -> list[tuple[str, str]]:
    """Name and text of each figure of a replay."""
    units = units_of(spec)
    source = f"driven by the recorded {run.open_loop}" if run.open_loop else "along the recorded reference"
    rows = [("recording", f"{duration(run.job.seconds)}, {count(len(run.job.t))} samples, {source}")]
    for one in run.compared:
        rms, peak = units.written(one.rms, one.unit), units.written(one.peak, one.unit)
        rows.append((one.name, f"rms {rms}, largest {peak}, {percent(one.relative)} of the recording"))
    if not math.isnan(run.peak_following):
        rows.append(("following error", f"up to {units.error(run.peak_following)}, simulated"))
    return [(name, text.replace(GAP, " ")) for name, text in rows]
