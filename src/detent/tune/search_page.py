"""The page of `detent tune` where values were searched by simulation: before and after, and all that was tried."""

from typing import TYPE_CHECKING

import numpy as np

from detent.page.chart import Chart, Curve, Panel, line_chart
from detent.page.figure import Figure
from detent.page.frame import Card, Headline, Page, Section
from detent.page.parts import Note
from detent.page.table import TextTable

if TYPE_CHECKING:
    from detent.tune.searched import Candidate, Searched

TOP = 10  # candidates in the table
FEW = 2  # places below which curves show nothing


def searched_page(found: "Searched") -> Page:
    """Put the page together."""
    level = "good" if found.done else "warn" if found.after else "bad"
    verdict = {"good": "Values chosen", "warn": "For the nominal axis only", "bad": "No values"}[level]
    name = found.file.spec.axis.name
    good = sum(not one.trial.refused for one in found.candidates)
    table = TextTable("", ("", "before", "after"), found.rows).on_page
    caption = "Values and figures of the simulated axis, with those of its file and with those that were chosen."
    return Page(
        title=f"{name}: tuned",
        headline=Headline(
            level=level, verdict=verdict, name=name, kicker="Choice by simulation",
            lead=f"{found.sentence} {' '.join(found.why)}",
        ),
        cards=[
            Card("candidates simulated", str(len(found.candidates)), "", f"{good} of them will do", good == 0),
            *(Card(title, *_split(after), f"{before} before") for title, before, after in _told(found)),
        ],
        notes=[Note("warning", str(one)) for one in found.refusals],
        sections=[
            Section("Before and after", [Figure(title="Values and figures", caption=caption, table=table)]),
            Section("What was tried", [_map(found), _best(found), _reasons(found)]),
        ],
        settings={"axis file": found.file.file, "plants": str(1 + found.plants)},
    )  # fmt: skip


def _told(found: "Searched") -> list[tuple[str, str, str]]:
    """The first two figures that both have, before and after."""
    rows = found.rows[len(found.values) :]
    return [row for row in rows if row[2] and row[1] != "-"][:2]


def _split(text: str) -> tuple[str, str]:
    value, _, unit = text.partition(" (")[0].partition(" ")
    return value, unit


def _ranks(found: "Searched", *, chosen: bool, place: float) -> tuple[list[float], list[float]]:
    """Least of what decides over the second side, of candidates with the chosen first side or of all others."""
    least = dict[float, float]()
    for one in found.candidates:
        first, second = found.search.place(one.values)
        if (first == place) == chosen:
            rank = np.inf if one.trial.refused else one.trial.rank[0]
            least[second] = min(least.get(second, np.inf), rank)
    places = sorted(least)
    return places, [least[one] if np.isfinite(least[one]) else np.nan for one in places]


def _map(found: "Searched") -> Figure:
    """What decides, over both sides."""
    title, (first, second) = "What decides", found.search.sides
    if not found.values:
        return Figure(title=title)
    place = found.search.place(found.values)
    x, y = _ranks(found, chosen=True, place=place[0])
    curves = [Curve(label=f"{first} {place[0]:g}, chosen", colour="speed", y=np.array(y), rings=7, digits=4)]
    others, least = _ranks(found, chosen=False, place=place[0])
    if np.isfinite([*y, *least]).sum() < FEW:
        return Figure(title=title)
    if others == x and np.isfinite(least).any():
        curves.insert(0, Curve(label=f"best of every other {first}", colour="muted", y=np.array(least), digits=4))
    panel = Panel(name="search", label=found.search.measure, curves=curves, zero=True)
    chart: Chart = line_chart(panel, np.array(x), second)
    caption = f"Lower is better; where a curve breaks off, candidates were refused. {second} {place[1]:g} was chosen."
    return Figure(title=title, caption=caption, charts=[chart])


def _cells(found: "Searched", one: "Candidate") -> list[str]:
    return [f"{place:g}" for place in found.search.place(one.values)]


def _best(found: "Searched") -> Figure:
    """The best of them."""
    good = sorted((one for one in found.candidates if not one.trial.refused), key=lambda one: one.trial.rank)[:TOP]
    if not good:
        return Figure(title="The best")
    names = list(good[0].trial.figures)
    rows = [[*_cells(found, one), *(one.trial.figures.get(name, "-") for name in names)] for one in good]
    table = TextTable("", [*found.search.sides, *names], rows).on_page
    return Figure(title="The best", caption=f"The {len(good)} best of those that will do, the best first.", table=table)


def _reasons(found: "Searched") -> Figure:
    """Why candidates were refused."""
    rows = [(kind, str(number)) for kind, number in found.reasons]
    table = TextTable("", ("why", "candidates"), rows).on_page if rows else None
    return Figure(title="Refused", caption="Candidates that will not do, by their first fault.", table=table)
