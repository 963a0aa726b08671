"""The page about a replayed recording: how far simulation and machine are apart."""

from html import escape

from detent.methods.cascade.charts import magnified, replay_charts, shown_signals
from detent.methods.cascade.page_data import ReplayReportData
from detent.methods.cascade.replay import Compared
from detent.methods.cascade.report import figure as in_unit
from detent.methods.cascade.report import relative
from detent.methods.cascade.units import percent
from detent.page.chart import Chart
from detent.page.page import (
    ZOOM_HINT,
    Card,
    Page,
    cards,
    chart_slot,
    figure,
    headline,
    notes,
    section,
    small_print,
)
from detent.page.words import GAP, bar_cell, count, duration, number, table


def make_replay_page(data: ReplayReportData) -> Page:
    """What the page is made of."""
    drawn = replay_charts(data.run, data.units)
    return {
        "title": f"{data.run.job.name} replayed on {data.axis_name}",
        "body": [
            _headline(data), _cards(data), notes(data.notes), _figures(data, drawn), _table(data),
            small_print(data.settings),
        ],
        "charts": drawn,
        "version": data.version,
    }  # fmt: skip


def _headline(data: ReplayReportData) -> str:
    run = data.run
    kicker = f"A recording beside the simulated axis {data.axis_name}"
    if not run.done:
        lead = f"{run.failure[:1].upper()}{run.failure[1:]}."
        return headline("bad", "Not replayed", run.job.name, kicker=kicker, lead=lead)
    place = run.compared[0]
    how = f"gets the recorded {run.open_loop}, its loops open," if run.open_loop else "follows the recorded reference"
    lead = (
        f"For {duration(run.job.seconds)} the simulated axis {how} and is {data.units.error(place.rms)} from the "
        f"recorded position on average (rms), {data.units.error(place.peak)} at most."
    )
    efforts = _efforts(data)
    if efforts:
        lead += f" Its {efforts[0].name} differs from the recorded one by {percent(efforts[0].relative)}."
    return headline("good", "Replayed", run.job.name, kicker=kicker, lead=lead)


def _efforts(data: ReplayReportData) -> list[Compared]:
    """What drove both, where that can differ."""
    moved = ("m", "rad")
    return [
        one for one in data.run.compared if one.unit.partition("/")[0] not in moved and one.name != data.run.open_loop
    ]


def _cards(data: ReplayReportData) -> str:
    shown: list[Card] = []
    for one in shown_signals(data.run):
        value, _, unit = in_unit(one, one.rms, data.units).partition(GAP)
        below = f"largest {in_unit(one, one.peak, data.units)}; {relative(one)}"
        shown.append(Card(f"{one.name}, rms difference".capitalize(), value, unit, below))
    return cards(shown) if shown else ""


def _figures(data: ReplayReportData, drawn: list[Chart]) -> str:
    if not drawn:
        return ""
    begin, end = magnified(data.run)
    caption = (
        "Dashed: the recording. Solid: the simulation, at the same instants. Where both lie on one another the model "
        "does what the machine did; the difference shows what is left."
    )
    near = (
        f"The same from {number(begin)}{GAP}s to {number(end)}{GAP}s, where the positions differ most. Look for: "
        "whether they part where the axis sets off or turns round (friction), where it accelerates (mass), or at speed "
        "(viscous friction, delay)."
    )
    parts = [("whole", "The whole recording", caption), ("near", "Where they differ most", near)]
    return section(
        "Recorded and simulated",
        *(
            figure(title, text, _slots(data, [chart for chart in drawn if chart["id"].startswith(name)]), ZOOM_HINT)
            for name, title, text in parts
            if any(chart["id"].startswith(name) for chart in drawn)
        ),
    )


def _slots(data: ReplayReportData, drawn: list[Chart]) -> str:
    names = [one.name for one in shown_signals(data.run)]
    slots: list[str] = []
    for chart in drawn:
        _, index, *off = chart["id"].split("-")
        what = (
            f"{names[int(index)]}, recorded less simulated" if off else f"{names[int(index)]}, recorded and simulated"
        )
        slots.append(chart_slot(chart["id"], f"{what}, over time"))
    return "".join(slots)


def _table(data: ReplayReportData) -> str:
    run = data.run
    if not run.compared:
        return ""
    heads = [("signal", False), ("rms difference", True), ("largest", True), ("relative [%]", True)]
    longest = max((100 * one.relative for one in run.compared if one.relative == one.relative), default=0.0) or 1.0
    rows = [
        [
            escape(one.name),
            in_unit(one, one.rms, data.units),
            in_unit(one, one.peak, data.units),
            bar_cell(100 * one.relative, longest),
        ]
        for one in run.compared
    ]
    caption = (
        f"Over {count(len(run.job.t))} samples. Relative is the norm of the difference over the norm of the recording. "
        "What was not recorded (a velocity, the acceleration) comes from both positions alike, low-passed at 100 Hz "
        "forwards and backwards."
    )
    return section("In figures", figure("Recording less simulation", caption, table(heads, rows)))
