"""The page about the analyses of a recording: what to do, then each result with its figures."""

from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from detent.identify.analyse.analyses import Analysis
from detent.identify.page import words
from detent.identify.page.response import bode_charts
from detent.page.chart import Chart, Curve, Panel, Timeline, line_chart, time_charts
from detent.page.figure import Figure
from detent.page.frame import Headline, Page, Section
from detent.page.parts import Note
from detent.page.words import count, duration

if TYPE_CHECKING:
    from detent.identify.analysed import Analysed
    from detent.logs.log import Log


def analysed_page(found: "Analysed") -> Page:
    """Put the page together."""
    from detent.identify.analysed import table_of

    log = found.log
    answered = [one for one in found.answers if one.estimates]
    sections = [Section("Recorded signals", [Figure(title="Time plots", charts=recorded_charts(log))])]
    for one in found.answers:
        about = f"{words.sentence(one.advice)}."
        table = table_of(one).on_page if one.estimates else None
        notes = "; ".join(dict.fromkeys(one.notes))
        if table is None:
            figure = Figure(title=one.name, drawing=Markup("<p>{}</p>").format(about))
        else:
            figure = Figure(title=one.name, caption=about, charts=charts_of(one), table=table, hint=notes)
        sections.append(Section(words.sentence(one.title), [figure]))
    told = f"{count(len(answered), 'question')} of {len(found.answers)} answered"
    return Page(
        title=f"{log.name}: analysed",
        headline=Headline(
            level="good" if found.done else "warn",
            verdict="Answered" if found.done else "No result",
            name=log.name,
            kicker="Analysis of a recording",
            lead=f"{told}; {count(len(log), 'sample')} over {duration(float(log.t[-1] - log.t[0]))}.",
        ),
        notes=[
            *(Note("warning", f"{finding}.") for finding in log.findings),
            *(Note("note", t) for t in found.remarks),
        ],
        sections=sections,
        settings={"recording": log.name},
    )


def recorded_charts(log: "Log") -> list[Chart]:
    """Every signal over time, one plot area for each unit."""
    units: dict[str, list[str]] = {}
    for role in log.signals:
        units.setdefault(log.units[role], []).append(role)
    colours = ("speed", "left", "drive", "current", "right", "ink", "muted")
    panels = [
        Panel(
            name=f"recorded-{k}",
            label=words.label_of(roles[0] if len(roles) == 1 else "", words.unit_text(unit)),
            curves=[
                Curve(label=role, colour=colour, y=log.signals[role], digits=words.digits_for(_peak(log, role)))
                for role, colour in zip(roles, colours, strict=False)
            ],
            height=170,
        )
        for k, (unit, roles) in enumerate(units.items())
    ]
    return time_charts(Timeline(name="recorded", t=log.t - log.t[0], label=words.SINCE, unit="s"), panels)


def _peak(log: "Log", role: str) -> float:
    return words.peak_of(log.signals[role])


def charts_of(answer: Analysis) -> list[Chart]:
    """Figures of an answer; none of those that are numbers alone."""
    if answer.name == "frequency" and answer.shown is not None:
        return bode_charts(answer.shown, None)
    if answer.name != "friction-map" or not answer.estimates:
        return []
    details = answer.details
    speed, friction = (np.array(details[key], dtype=np.float64) for key in ("speed", "friction"))
    limits = [np.array(details[key], dtype=np.float64) for key in ("low", "high")]
    digits = words.digits_for(words.peak_of(friction))
    curves = [
        Curve(label="friction", colour="speed", y=friction, digits=digits, rings=7),
        *(
            Curve(label=f"95 % interval, {name}", colour="muted", y=one, digits=digits, dash=(4, 4))
            for name, one in zip(("low", "high"), limits, strict=True)
        ),
    ]
    label = words.label_of("friction", words.unit_text(str(details["unit"])))
    across = words.label_of("speed", words.unit_text(str(details["speed_unit"])))
    return [line_chart(Panel(name="friction-map", label=label, curves=curves, zero=True), speed, across, digits=6)]
