"""The page about a list of moves: did it arrive, how fast and how well, and how the axis did it.

It knows no method: what one shows of itself comes as a `MoveView`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from detent.methods.moves.run import MoveRecord, MoveRun
from detent.methods.moves.summary import MoveFigures, arrived, interference_text, whose
from detent.page.chart import Band, Chart, Curve, Heap, Panel, Timeline, histogram_chart, time_charts
from detent.page.figure import Figure
from detent.page.frame import Card, Comparison, Headline, Page, Section, card, comparison_section
from detent.page.parts import Event, Note, Numbers
from detent.page.run_page import (
    LONGEST,
    Stretch,
    happened,
    has,
    made_card,
    median_of,
    page_title,
    recorded_whole,
    run_headline,
    stopped_after,
    stretch,
    time_card,
    warnings,
    whole_or_first,
)
from detent.page.table import Cell, left_out, long_table, offset_cell, way_cell
from detent.page.words import CountUnit, count, duration, length, milliseconds, number
from detent.record.trace import Trace

POSITION, VELOCITY, TARGET = "plant.train.position", "plant.train.velocity", "plant.gauge.target"
"""Signals that every axis of moves records."""

FEWEST_MOVES = 5  # moves below which a histogram says less than the table
FINEST_BAR = 0.1  # narrowest bar of the histogram [µm]
CLOSE = 5  # the approach begins where this many tolerances are left to the target

MM, UM = 1e3, 1e6


@dataclass(frozen=True, slots=True)
class ShownMove:
    """The move that is shown in detail, why this one, and its rows on a clock that starts with its command."""

    run: MoveRun
    move: MoveRecord
    why: str
    rows: Stretch

    @property
    def settled(self) -> float:
        """When it was within tolerance for good [s]; NaN if it was not."""
        return self.move.settling

    @property
    def to_go(self) -> Numbers:
        """Target less true position [m]."""
        return self.move.target - self.rows[POSITION]


class MoveView:
    """What a method shows of itself on the page of a list of moves. What it leaves out has the default here."""

    signals: ClassVar[Sequence[str]] = ()  # signals that a move is drawn from beside position, velocity and target
    captions: ClassVar[tuple[str, str]] = ("", "")  # what to look for in the whole move, and in the words at its end

    def __init__(self, spec: Any) -> None:
        self.spec = spec

    @property
    def unit(self) -> CountUnit:
        """The smallest way that the axis knows."""
        return CountUnit(self.spec.pulse, "pulse")

    @property
    def max_speed(self) -> float:
        """Limit of the axis [m/s]."""
        return self.spec.limits.speed

    def panels(self, shown: ShownMove) -> list[Panel]:
        """Plot areas of the whole move, ids "move-...", from top to bottom."""
        return [Panel(name="move-speed", label="speed [mm/s]", zero=True, curves=[true_speed(shown)])]

    def bands(self, shown: ShownMove) -> list[Band]:
        """Stretches of the move with a ground of their own."""
        del shown
        return []

    def words(self, rows: Stretch) -> list[Curve]:
        """Words of the control [count] while it comes to rest."""
        del rows
        return []

    def events(self, shown: ShownMove) -> dict[str, float]:
        """What happens in the move, and when [s]; NaN if it does not."""
        ready = shown.move.ready - shown.move.begin
        return {"move commanded": 0.0, "within tolerance for good": shown.settled, "arrived": ready}

    def text_figure(self, run: MoveRun) -> Figure | None:
        """The text on paper, of an axis that prints."""
        del run
        return None


def moves_page(
    view: MoveView,
    run: MoveRun,
    trace: Trace | None,
    comparisons: Sequence[Comparison] = (),
    settings: dict[str, str] | None = None,
) -> Page:
    """The page of a run of moves; figures whose signals were not recorded are left out."""
    figures = MoveFigures(run)
    text = view.text_figure(run) if run.job.kind == "text" and run.moves else None
    result = [text, _job_figure(figures, trace), _rest_figure(view, figures)]
    return Page(
        title=page_title(view.spec.axis.name, run),
        headline=_headline(view, figures),
        cards=_cards(view, figures),
        notes=_notes(figures),
        sections=[
            Section("Results", [figure for figure in result if figure]),
            Section("How the axis performed", _move_figures(view, figures, trace)),
            comparison_section(comparisons),
            Section("Moves", [_every_move(run)] if run.moves else []),
        ],
        settings=settings or {},
    )


# ---- results, in one glance


def _headline(view: MoveView, figures: MoveFigures) -> Headline:
    run, asked = figures.run, count(figures.asked, figures.word)
    if not run.done:
        far = stopped_after(run, len(figures.there), asked, began=bool(run.moves))
        return run_headline(view.spec.axis.name, run, far)
    lead = f"{asked} in {duration(figures.seconds)}."
    if error := figures.error:
        counts = f"{number(error.value / view.unit.size, 2)} {view.unit.words}"
        lead += f" At the end of every dwell the axis stood within {length(error.value)} ({counts}) of its target."
    return run_headline(view.spec.axis.name, run, lead, doubt="Done, but ready too early" if figures.early else "")


def _cards(view: MoveView, figures: MoveFigures) -> list[Card]:
    run, words = figures.run, figures.word + "s"
    pace = f"{number(run.moves_per_second)} {words} per second" if run.done else "until it stopped"
    made = made_card(words.capitalize(), len(figures.there), figures.asked, "arrived and stayed")
    shown = [made, time_card(figures.seconds, pace)]
    if longest := figures.longest:
        below = f"median; worst {milliseconds(longest.value)}, {whose(longest.of)}"
        median = median_of(figures.went, lambda move: move.settling)
        shown.append(card("Settled after", milliseconds(median), below))
    for title, found, limit in (
        ("Worst overshoot", figures.overshoot, math.inf),
        ("Worst error at rest", figures.error, run.tolerance),
        ("Off its target in the end", figures.short, run.tolerance),
    ):
        if found:
            allowed = f", allowed {length(limit)}" if math.isfinite(limit) else ""
            below = f"{view.unit.counts(found.value)}, {whose(found.of)}{allowed}"
            shown.append(card(title, length(found.value), below, bad=found.value > limit))
    if fastest := figures.peak_speed:
        below = f"{whose(fastest.of)}, limit {number(view.max_speed * MM)}"
        shown.append(Card("Peak speed", number(fastest.value * MM), "mm/s", below))
    return shown


def _notes(figures: MoveFigures) -> list[Note]:
    notes = warnings(figures.run.warnings)
    noise = interference_text(figures.run)
    return [*notes, Note("note", f"interference on the pulse lines: {noise}")] if noise else notes


# ---- the whole job


def _job_figure(figures: MoveFigures, trace: Trace | None) -> Figure | None:
    rows = stretch(trace, (POSITION, TARGET), figures.run.time_ready) if figures.run.moves else None
    if rows is None:
        return None
    end = int(np.searchsorted(rows.t, float(rows.t[0]) + LONGEST, side="right"))
    curves = [
        Curve(label="target", colour="muted", dash=(6, 4), step=True, y=rows[TARGET][:end] * MM, digits=4),
        Curve(label="true position", colour="speed", width=2, y=rows[POSITION][:end] * MM, digits=4),
    ]
    timeline = Timeline(name="job", t=rows.t[:end], label="time since the axis was ready", unit="s")
    return Figure(
        # A long job is drawn in part, and of a very long one only the beginning is recorded.
        title=whole_or_first(float(rows.t[end - 1]), figures.seconds, "The whole job"),
        caption="Actual and target position. Check that the solid line meets the dashed one at the end of every move.",
        charts=time_charts(timeline, [Panel(name="job", label="position [mm]", height=260, curves=curves)]),
    )


def _rest_figure(view: MoveView, figures: MoveFigures) -> Figure | None:
    run, error = figures.run, figures.error
    if len(run.moves) < FEWEST_MOVES or error is None:
        return None
    outside = " (outside the figure)" if error.value < run.tolerance / 1.5 else ""
    caption = (
        "Position error at the end of each dwell. Expected: narrow peaks around zero; separate "
        "peaks mean that the result depends on the direction of approach. "
        f"Allowed: ±{length(run.tolerance)}{outside}; a {view.unit.word} is {length(view.unit.size)}."
    )
    # Right of the target is where the error is negative.
    heaps: list[Heap] = []
    for name, right in (("right", True), ("left", False)):
        errors = np.array([move.error for move in run.moves if (move.target > move.start) == right], dtype=float)
        heaps.append(Heap(label=f"moved to the {name}", colour=name, at=-errors * UM, counts=np.ones(len(errors))))
    labels = ("← left of the target   [µm]   right of it →", "moves")
    chart = histogram_chart("rest", heaps, labels, finest=FINEST_BAR, limit=run.tolerance * UM)
    return Figure(title="Error at rest", caption=caption, charts=[chart])


# ---- one move


def _move_figures(view: MoveView, figures: MoveFigures, trace: Trace | None) -> list[Figure]:
    needed = (POSITION, VELOCITY, TARGET, *view.signals)
    if trace is None or not has(trace, needed):
        return []
    move, why = _telling(figures, trace)
    rows = stretch(trace, needed, move.begin, move.end) if move else None
    if move is None or rows is None:
        return []
    shown = ShownMove(figures.run, move, why, rows)
    found = [_whole_figure(view, shown), *_approach_figures(view, shown)]
    # The longest shows what a shorter one does not come to: top speed, and what limits it.
    longest = max(recorded_whole(trace, figures.run.moves), key=_way)
    rows = stretch(trace, needed, longest.begin, longest.end)
    if rows is not None and _way(longest) > _way(move) + figures.run.tolerance:
        found.append(_whole_figure(view, ShownMove(figures.run, longest, "the longest move", rows), name="longest"))
    return found


def _telling(figures: MoveFigures, trace: Trace) -> tuple[MoveRecord | None, str]:
    """The most telling of the moves that were recorded whole, and why this one.

    It is the one that failed, else the one that was ready by far too early, else the one of middle length.
    """
    whole = recorded_whole(trace, figures.run.moves)
    failed = [move for move in whole if not arrived(figures.run, move)]
    if failed:
        return failed[-1], "the move that failed"
    early = figures.earliest
    if early and early.of in whole:
        return early.of, "the move that was ready too early"
    went = sorted((move for move in whole if _way(move) > figures.run.tolerance), key=_way)
    return (went[(len(went) - 1) // 2], "a move of median length") if went else (None, "")


def _way(move: MoveRecord) -> float:
    return abs(move.target - move.start)


def _events(view: MoveView, shown: ShownMove) -> list[Event]:
    lasted = shown.move.end - shown.move.begin
    events = happened(view.events(shown), lasted)
    return events if arrived(shown.run, shown.move) else [*events, Event(lasted, "the run ends here")]


def _whole_figure(view: MoveView, shown: ShownMove, name: str = "move") -> Figure:
    move, events = shown.move, _events(view, shown)
    side = "right" if move.target > move.start else "left"
    # The command itself comes shortly before the first row.
    marks = [Event(max(event.t, float(shown.rows.t[0])), event.text) for event in events]
    timeline = Timeline(
        name=name, t=shown.rows.t, label="time since the command", bands=view.bands(shown), events=marks
    )
    panels = [replace(panel, name=panel.name.replace("move", name, 1)) for panel in view.panels(shown)]
    return Figure(
        title=f"Move {count(move.number)}, {length(_way(move))} to the {side}",
        caption=f"Shown is {shown.why}. {view.captions[0]}",
        charts=time_charts(timeline, panels),
        events=events,
    )


def true_speed(shown: ShownMove) -> Curve:
    """The curve that every picture of a move has."""
    return Curve(label="true speed", colour="speed", width=2, y=shown.rows[VELOCITY] * MM)


def drive_curve(words: Numbers) -> Curve:
    """The drive word over time."""
    return Curve(label="drive word", colour="drive", width=2, step=True, y=words, digits=2)


def _approach_figures(view: MoveView, shown: ShownMove) -> list[Figure]:
    """How the axis came to rest; an axis that has given up on its way comes to none."""
    if math.isnan(shown.move.ready):
        return []
    unit, tolerance = view.unit, shown.run.tolerance
    caption = (
        f"The end of the same move, magnified: displacement to the right of the target, in {unit.words} of "
        f"{length(unit.size)}. Arrived means within ±{unit.counts(tolerance)} (dashed); the numbers are those above. "
        f"{view.captions[1]}"
    )
    return [Figure(title="Settling", caption=caption, charts=_approach_charts(view, shown))]


def _approach_charts(view: MoveView, shown: ShownMove) -> list[Chart]:
    """From `CLOSE` tolerances to the target, or more if the move ended farther away, until after the last event."""
    events, t = _events(view, shown), shown.rows.t
    begin = shown.rows.first(np.abs(shown.to_go) <= max(CLOSE * shown.run.tolerance, 1.5 * abs(float(shown.to_go[-1]))))
    last = events[-1].t
    rows = shown.rows.between(begin, min(last + 0.15 * (last - begin), float(t[-1])))
    unit, limit = view.unit, shown.run.tolerance / view.unit.size
    place = (rows[POSITION] - shown.move.target) / unit.size
    # The whole curve, and both limits with their names; more above, where the numbers of the events stand.
    low, high = min(float(place.min()), -limit), max(float(place.max()), limit)
    span = (round(low - 0.1 * (high - low), 3), round(high + 0.25 * (high - low), 3))
    within = [(shown.settled, float(t[-1]))] if shown.settled < t[-1] else []
    bands = [Band(label="within the tolerance", colour="good", spans=within)]
    # All events: those in sight have the numbers of the figure above.
    timeline = Timeline(name="approach", t=rows.t, label="time since the command", bands=bands, events=events)
    return time_charts(timeline, [
        Panel(
            name="approach-place", label=f"right of the target [{unit.word}]", height=260, zero=True, span=span,
            levels=[(limit, f"+{unit.counts(shown.run.tolerance)}"), (-limit, f"−{unit.counts(shown.run.tolerance)}")],
            curves=[Curve(label="true position", colour="speed", width=2, y=place)],
        ),
        Panel(name="approach-words", label="words [count]", height=180, zero=True, curves=view.words(rows)),
    ])  # fmt: skip


# ---- table


def _every_move(run: MoveRun) -> Figure:
    labelled = any(move.label for move in run.moves)
    heads = [("move", True), *([("character", False)] if labelled else []), ("start [s]", True), ("from [mm]", True),
             ("to [mm]", True), ("distance [mm]", False), ("ready after [ms]", True), ("settled after [ms]", True),
             ("overshoot [µm]", True), ("error [µm]", True)]  # fmt: skip
    longest = max(abs(move.error) for move in run.moves) or 1.0
    rows = [_row(run, move, longest, labelled=labelled) for move in run.moves]
    caption = (
        f"Ready: signalled by the axis. Settled: within ±{length(run.tolerance)} for good. Error: target minus "
        "position at the end of the dwell, positive if the axis is to the left of its target."
    )
    return Figure(title="Every move", caption=caption + left_out(len(rows), "move"), table=long_table(heads, rows))


def _row(run: MoveRun, move: MoveRecord, longest: float, *, labelled: bool) -> list[str | Cell]:
    ready, there = move.ready - move.begin, move.settling
    way = way_cell(1 if move.target > move.start else -1, number(_way(move) * MM, 4))
    return [
        count(move.number),
        *([move.label] if labelled else []),
        f"{move.begin - run.time_ready:.3f}",
        f"{move.start * MM:.3f}",
        f"{move.target * MM:.3f}",
        way if _way(move) > run.tolerance else Cell(text="stays", nowrap=True),
        number(ready * 1e3),
        Cell(text=number(there * 1e3), over=math.isnan(there) or (not math.isnan(ready) and there > ready + 1e-6)),
        number(move.overshoot * UM, 2),
        offset_cell(move.error * UM, longest * UM, over=abs(move.error) > run.tolerance),
    ]
