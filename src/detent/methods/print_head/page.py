"""The page about a run of a print head: did it print, how well, and line by line."""

from collections.abc import Sequence
from math import isnan

import numpy as np
from markupsafe import Markup

from detent.files.quantities import INCH
from detent.methods.print_head.detail import SIGNALS, how_figures
from detent.methods.print_head.printed_page import PAGE
from detent.methods.print_head.run import COLUMN_LIMIT, ERROR_BIN, ERROR_PLACES, LineRecord, PrintRun
from detent.methods.print_head.schema import COLUMN, PrintHeadSpec
from detent.page.chart import POINTS, Chart, Curve, Heap, Panel, Timeline, histogram_chart, time_charts
from detent.page.figure import Figure
from detent.page.frame import Card, Comparison, Headline, Page, Section, card, comparison_section
from detent.page.paper import Marks, paper_figure
from detent.page.parts import Note, Numbers
from detent.page.run_page import (
    LONGEST,
    Stretch,
    made_card,
    page_title,
    run_headline,
    stopped_after,
    stretch,
    time_card,
    warnings,
    whole_or_first,
)
from detent.page.table import Cell, bar_cell, left_out, long_table
from detent.page.words import GAP, arrow, count, duration, further, inches_per_second, length, number
from detent.record.trace import Trace

MOST_NOTES = 20  # notes about the job on the page: more than anybody reads
UM = 1e6


def print_page(
    spec: PrintHeadSpec,
    run: PrintRun,
    trace: Trace | None,
    comparisons: Sequence[Comparison] = (),
    settings: dict[str, str] | None = None,
) -> Page:
    """The page of a run; figures whose signals were not recorded are left out."""
    path = _path_figure(spec, run, trace)
    return Page(
        title=page_title(spec.axis.name, run, done="printed"),
        headline=_headline(spec, run),
        cards=_cards(run),
        notes=_notes(run),
        sections=[
            Section("Results", _result(run)),
            Section("Head position", [path] if path else []),
            Section("How the axis performed", how_figures(run, trace)),
            comparison_section(comparisons),
            Section("Lines", [_every_line(run)] if run.lines else []),
        ],
        settings={"fidelity": spec.axis.fidelity} | (settings or {}),
    )


def summary_rows(_: PrintHeadSpec, run: PrintRun) -> list[tuple[str, str]]:
    """Name and text of each figure, such as ("lines", "11 of 11, on 1 page"); what it did not come to is left out."""
    asked = len(run.job.lines)
    rows = [("lines", f"{_plain(len(run.lines))} of {_plain(asked)}, on {_plain(run.job.pages, 'page')}")]
    if run.lines:
        rows += [
            ("characters", f"{_plain(run.characters)}, {run.characters_per_second:.0f} per second"),
            ("time", f"{run.print_time:.2f} s, after {run.time_ready:.2f} s of homing and identification"),
            ("speeds", ", ".join(f"{s / 6:.4g} in/s ({_plain(n, 'line')})" for s, n in run.speeds.items())),
            ("turn-arounds", f"{_plain(run.turn_arounds)}; runs back before a line: {_plain(run.repositions)}"),
            ("column error", f"worst {run.worst_error * 1e6:.1f} µm, rms {run.rms_error * 1e6:.1f} µm"),
        ]
    for side, line in run.identified.items():
        if line.valid or run.lines:
            friction = f"friction {line.friction} counts (true {line.true_friction:.1f})"
            rows.append(
                (
                    f"{'identified' if line.valid else 'default'}, {side}",
                    f"slope K {line.slope} (true {line.true_slope:.1f}), {friction}",
                )
            )
    return [*rows, ("motor", f"peak current {run.peak_current:.2f} A, energy {run.energy:.1f} J")]


def _plain(value: int, word: str = "") -> str:
    """A count with ordinary spaces: what a terminal shows and a script splits."""
    return count(value, word).replace(GAP, " ")


# ---- results, in one glance


def _headline(spec: PrintHeadSpec, run: PrintRun) -> Headline:
    asked, words = count(len(run.job.lines), "line"), ("Printed", "Not printed")
    if not run.done:
        far = stopped_after(run, len(run.lines), asked, began=run.print_time > 0)
        return run_headline(spec.axis.name, run, far, words=words)
    characters, pages = count(run.job.characters, "character"), count(run.job.pages, "page")
    lead = f"{asked} and {characters} on {pages} in {duration(run.print_time)}."
    doubt = "Printed, but columns misplaced" if run.beyond else ""
    if run.columns and not doubt:
        lead += f" Every column of dots landed within {length(run.worst_error)} of its nominal position."
    return run_headline(spec.axis.name, run, lead, doubt=doubt, words=words)


def _cards(run: PrintRun) -> list[Card]:
    lines, seconds = run.lines, run.print_time
    shown = [made_card("Lines printed", len(lines), len(run.job.lines), count(run.characters, "character"))]
    if run.done:
        rate = number(run.characters_per_second if seconds > 0 else None)
        shown.append(Card("Throughput", rate, "characters/s", f"in {duration(seconds)}"))
    elif seconds > 0:
        shown.append(time_card(seconds, "until it stopped"))
    else:
        shown.append(time_card(run.time_end, "of homing and identification, until it stopped"))
    if run.columns:
        below = f"rms {length(run.rms_error)}, allowed {length(COLUMN_LIMIT)}"
        shown.append(card("Worst column error", length(run.worst_error), below, bad=run.beyond > 0))
    if lines:
        fastest = max(line.speed for line in lines)
        at_top = f"in {count(sum(line.speed == fastest for line in lines))} of {count(len(lines))} lines"
        speed = f"{number(fastest)}{GAP}m/s, {at_top}"
        shown.append(Card("Top print speed", inches_per_second(fastest), "in/s", speed))
    if len(lines) > 1:
        turns = sum(line.turn_around for line in lines)
        shown.append(Card("Turn-arounds", count(turns), f"of {count(len(lines) - 1)}", "line changes without a stop"))
    return shown


def _notes(run: PrintRun) -> list[Note]:
    told = run.job.notes
    notes = [*warnings(run.warnings), *(Note("note", str(note)) for note in told[:MOST_NOTES])]
    if len(told) > MOST_NOTES:
        notes.append(Note("note", f"{further(len(told) - MOST_NOTES, 'note')} in the JSON summary only"))
    return notes


# ---- results


def _result(run: PrintRun) -> list[Figure]:
    caption = Markup(
        "Each character stands where it landed. At the margin: the line's number and the direction in which it was "
        "printed, {} or {}."
    ).format(arrow(1), arrow(-1))
    paper = paper_figure("The printed page", caption, marks_of(run), COLUMN_LIMIT)
    return [paper, *([_error_figure(run)] if run.columns else [])] if paper else []


def marks_of(run: PrintRun) -> Marks:
    """Every character that was fired, at its place on its page."""
    lines = {line.number: line for line in run.job.lines}
    # Eleven inches each [1/48 in]; on shorter forms the first line of a page, here the last that is asked, is its top.
    tops = {line.page: min(PAGE // 2 * (line.page - 1), line.baseline) for line in reversed(run.job.lines)}
    directions = {line.number: line.direction for line in run.lines}
    struck = [strike for strike in run.strikes if not isnan(strike.offset)]
    of = [lines[strike.line] for strike in struck]
    column = np.array([strike.character.column for strike in struck], dtype=float) * COLUMN
    return Marks(
        characters=[strike.character.char for strike in struck],
        page=np.array([line.page for line in of], dtype=int),
        line=np.array([line.number for line in of], dtype=int),
        baseline=np.array([line.baseline - tops[line.page] for line in of], dtype=float) * (INCH / 48),
        column=column,
        landed=column + np.array([strike.offset for strike in struck], dtype=float),
        width=np.array([strike.character.ink_columns for strike in struck], dtype=float) * COLUMN,
        direction=np.array([directions[line.number] for line in of], dtype=int),
        strikes=np.array([strike.character.strike for strike in struck], dtype=int),
    )


def _error_figure(run: PrintRun) -> Figure:
    outside = " (outside the figure)" if run.worst_error < COLUMN_LIMIT / 1.5 else ""
    caption = (
        "Position error of each column of dots. Expected: two narrow peaks in the same place. Separate peaks "
        "mean that lines printed to the right and to the left do not line up. "
        f"Allowed: ±{length(COLUMN_LIMIT)}{outside}; the finest column grid is {length(COLUMN)} (1/120{GAP}in)."
    )
    return Figure(title="Column errors", caption=caption, charts=[error_chart(run, COLUMN_LIMIT)])


def error_chart(run: PrintRun, limit: float) -> Chart:
    """Count how far off the columns landed, per direction of printing; `limit` is of good ones [m]."""
    heaps = [
        Heap(label=f"printed to the {name}", colour=name, at=ERROR_PLACES * UM, counts=counts)
        for name, counts in (("right", run.errors_right), ("left", run.errors_left))
    ]
    labels = ("\u2190 left of its place   [µm]   right of it \u2192", "columns")
    about = "Histogram of column errors, printed to the right and to the left"
    return histogram_chart("histogram", heaps, labels, finest=ERROR_BIN * UM, limit=limit * UM) | {"about": about}


# ---- where the head was


def _path_figure(spec: PrintHeadSpec, run: PrintRun, trace: Trace | None) -> Figure | None:
    """The beginning of the job, with the stretches in which it prints."""
    rows = stretch(trace, SIGNALS, 0.0, LONGEST)
    if rows is None:
        return None
    frames = Markup("The head between the frames (0 to {}{}in).").format(number(spec.limits.travel / INCH), GAP)
    look = Markup(
        ' Thick: printing, <span class="right">to the right</span> or <span class="left">to the left</span>. Thin: the '
        "way between. Look for: long thin stretches are time without print."
    )
    caption = frames + look if run.lines else frames + " No line was printed."
    position, right = rows["plant.train.position"] / INCH, rows["plant.train.velocity"] > 0
    printing = _printing(run, rows)
    thick = [
        Curve(label=f"printing to the {name}", colour=name, width=3, thin=POINTS // 2, y=np.where(on, position, np.nan))
        for name, on in (("right", printing & right), ("left", printing & ~right))
        if on.any()
    ]
    panel = Panel(
        name="path",
        label="head position [in]",
        about="Head position over time, printing marked",
        height=260,
        span=(0.0, round(spec.limits.travel / INCH, 3)),
        levels=[(round(spec.printing.left_margin / INCH, 3), "column 0")],
        curves=[Curve(label="moving", colour="muted", width=1, y=position), *thick],
    )
    return Figure(
        title=whole_or_first(float(rows.t[-1]), run.time_end, "The whole job" if run.done else "Until it stopped"),
        caption=caption,
        charts=time_charts(Timeline(name="path", t=rows.t, unit="s"), [panel]),
    )


def _printing(run: PrintRun, rows: Stretch) -> Numbers:
    """True between the first and the last column of a line."""
    fired = rows["controller.head.columns.fired"]
    printing = np.zeros(len(rows), dtype=bool)
    for line in run.lines:
        first, last = np.searchsorted(rows.t, (line.start, line.stop))
        inside = np.flatnonzero(np.diff(fired[first : last + 1]))
        if inside.size:
            printing[first + inside[0] : first + inside[-1] + 2] = True
    return printing


# ---- table


def _every_line(run: PrintRun) -> Figure:
    heads = [("line", True), ("printed", False), ("speed [in/s]", True), ("reached by", False), ("start [s]", True),
             ("time [s]", True), ("characters", True), ("worst error [µm]", True), ("rms [µm]", True)]  # fmt: skip
    longest = max((line.worst_error for line in run.lines), default=0.0) or 1.0
    rows = [_row(line, longest) for line in run.lines]
    caption = "Time from the command to zero speed. The bars compare the lines with each other."
    return Figure(title="Every line", caption=caption + left_out(len(rows), "line"), table=long_table(heads, rows))


def _row(line: LineRecord, longest: float) -> list[str | Cell]:
    return [
        str(line.number),
        arrow(line.direction),
        inches_per_second(line.speed),
        Cell(text="turn-around" if line.turn_around else "standing start", nowrap=True),
        f"{line.start:.3f}",
        f"{line.stop - line.start:.3f}",
        count(line.characters),
        bar_cell(line.worst_error * UM, longest * UM, over=line.worst_error > COLUMN_LIMIT),
        number(line.rms_error * UM, 2),
    ]
