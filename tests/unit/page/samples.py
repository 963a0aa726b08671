"""A page with everything that a page can hold."""

import numpy as np
from markupsafe import Markup

from detent.page.chart import (
    Band,
    Bar,
    Chart,
    Curve,
    Heap,
    Lane,
    Loop,
    Panel,
    Timeline,
    histogram_chart,
    lane_chart,
    line_chart,
    loop_chart,
    time_charts,
)
from detent.page.figure import Figure
from detent.page.frame import Card, Headline, Page, Section
from detent.page.parts import Event, Note
from detent.page.table import Cell, Table, bar_cell, offset_cell, way_cell

EVENTS = [Event(0.1, "stop <begins>", -12), Event(0.11, "second"), Event(0.8, "at rest")]


def over_time() -> list[Chart]:
    """Two plot areas with a band, a level, a step, dashes, filled ground and numbered events."""
    t = np.linspace(0.0, 1.0, 200)
    steps = Curve(label="stepped", colour="left", dash=(6, 4), step=True, y=np.round(5 * np.sin(9 * t)) / 5)
    filled = Curve(label="filled", colour="drive", fill=True, y=np.cos(9 * t))
    timeline = Timeline(name="time", t=t, bands=[Band(label="good", colour="good", spans=[(0.2, 0.4)])], events=EVENTS)
    smooth = Curve(label="smooth", colour="speed", y=np.sin(9 * t))
    return time_charts(timeline, [
        Panel(name="speed", label="speed [mm/s]", zero=True, levels=[(0.5, "half")], curves=[smooth, steps]),
        Panel(name="drive", label="drive", height=140, title="below", about="the drive <word>", curves=[filled]),
    ])  # fmt: skip


def heaps() -> Chart:
    """A histogram of two groups with a limit."""
    at = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])
    groups = [
        Heap(label="right", colour="right", at=at, counts=np.array([1, 2, 4, 2, 1])),
        Heap(label="left", colour="left", at=at, counts=np.array([2, 4, 2, 1, 0])),
    ]
    return histogram_chart("heaps", groups, ("off [µm]", "moves"), finest=0.5, limit=1.5)


def lanes() -> Chart:
    """Two lanes of bars."""
    bars = [Bar(0.0, 3.0, "go 1", "go to 1"), Bar(4.0, 6.0, "go 2", "go to 2")]
    return lane_chart("lanes", [Lane("go", "speed", bars), Lane("wait", "left", bars[:1])], (0.0, 8.0), "time [s]")


def loops() -> Chart:
    """A loop above a curve with rings."""
    x = np.array([0.0, 1.0, 2.0])
    panel = Panel(name="loops", label="speed [mm/s]", curves=[Curve(label="rings", colour="ink", rings=6, y=x)])
    turn = np.linspace(0.0, 2 * np.pi, 30)
    return loop_chart(
        panel, x, "distance [mm]", [Loop(label="loop", colour="right", x=1 + np.cos(turn), y=np.sin(turn))]
    )


def plain_chart(name: str) -> Chart:
    """One curve over anything but time."""
    x = np.array([0.0, 1.0])
    return line_chart(Panel(name=name, label="y [V]", curves=[Curve(label="y", colour="ink", y=x)]), x, "x [A]")


def table() -> Table:
    """Every kind of cell."""
    heads = [("name", False), ("worst [µm]", True), ("off [µm]", True), ("way", False)]
    return Table(heads=heads, rows=[
        ["<a> & b", Cell(text="7", over=True), offset_cell(-3.0, 6.0), way_cell(1, "3 <mm>")],
        [Cell(text="jog", mark="right"), bar_cell(3.0, 6.0, over=True), offset_cell(6.0, 6.0), Markup("<b>bold</b>")],
    ])  # fmt: skip


def figures() -> list[Figure]:
    """Charts above and beside one another, a drawing, a table, and a figure of nothing."""
    return [
        Figure(title="Speed < drive", caption="1 < 2", charts=over_time(), events=EVENTS),
        Figure(
            title="Two", caption=Markup("see <b>here</b>"), charts=[heaps() | {"title": "a < b"}, lanes()], beside=True
        ),
        Figure(title="Loops", charts=[loops()], hint="3 more & not drawn."),
        Figure(title="Cells", caption="all of them", table=table()),
        Figure(title="Nothing", caption="at all"),
        Figure(title="Drawn", drawing=Markup("<svg></svg>")),
    ]


def page() -> Page:
    """All of it."""
    return Page(
        title="run <1> of $title",
        headline=Headline(level="warn", verdict="Moved & held", name="<b>", kicker="axis <a>", lead="1 < 2"),
        cards=[Card("Moves", "12", "of 12", "1 < 2"), Card("Worst", "9", "µm", "allowed 6 µm", bad=True)],
        notes=[Note("note", "n"), Note("warning", "w <1>"), Note("error", "e")],
        sections=[Section("Moves & stops", figures()), Section("Empty", [Figure(title="Nothing")])],
        settings={"axis file": "<a>.toml", "seed": "7"},
    )
