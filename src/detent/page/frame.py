"""The page that a report is, as data: headline, cards, notes, sections of figures, small print. It knows no method."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from detent.files.screen import Block, OnScreen, Screen
from detent.page.chart import Chart
from detent.page.figure import Figure
from detent.page.parts import Note
from detent.page.table import TextTable
from detent.page.words import GAP, count
from detent.record.run import Level


@dataclass(frozen=True, slots=True, kw_only=True)
class Headline:
    """What happened: a small line (`kicker`), a badge with the verdict, a name, and a sentence or two (`lead`)."""

    level: Level
    verdict: str
    name: str
    kicker: str
    lead: str


@dataclass(frozen=True, slots=True)
class Card:
    """One figure that everybody wants to know, in large type; `below` says what to compare it with."""

    title: str
    value: str
    unit: str
    below: str
    bad: bool = False


def card(title: str, quantity: str, below: str, *, bad: bool = False) -> Card:
    """A card of a quantity as `page.words` writes it: number, narrow space, unit."""
    value, _, unit = quantity.partition(GAP)
    return Card(title, value, unit, below, bad)


@dataclass(frozen=True, slots=True)
class Section:
    """Figures under a title; without figures it leaves no trace."""

    title: str
    figures: Sequence[Figure]

    @property
    def shown(self) -> list[Figure]:
        """Figures that show something."""
        return [figure for figure in self.figures if figure]


@dataclass(frozen=True, slots=True, kw_only=True)
class Page:
    """Everything a page is made of, from top to bottom; `settings` is the small print at its end."""

    title: str
    headline: Headline
    cards: Sequence[Card] = ()
    notes: Sequence[Note] = ()
    sections: Sequence[Section] = ()
    settings: Mapping[str, str] = field(default_factory=dict[str, str])
    embedded: Mapping[str, Mapping[str, Any]] = field(default_factory=dict[str, Mapping[str, Any]])
    """Data that the page carries along for programs, by the id of its element."""

    def __post_init__(self) -> None:
        twice = [name for name, times in Counter(chart["id"] for chart in self.charts).items() if times > 1]
        if twice:
            raise ValueError(
                f"page: charts share an id: {', '.join(twice)}; give each chart of a page a name of its own"
            )
        if sum(figure.paper is not None for figure in self.figures) > 1:
            raise ValueError("page: got two printed pages, expected: one; leave one out")

    @property
    def figures(self) -> list[Figure]:
        """Every figure that shows something."""
        return [figure for section in self.sections for figure in section.shown]

    @property
    def charts(self) -> list[Chart]:
        """Every chart, in the order of the page."""
        return [chart for figure in self.figures for chart in figure.charts]

    @property
    def paper(self) -> Mapping[str, Any] | None:
        """The printed page, if there is one."""
        return next((figure.paper for figure in self.figures if figure.paper), None)


class Comparison(Protocol):
    """A method compared with its alternatives."""

    @property
    def table(self) -> TextTable:
        """The figures of each, for the terminal."""
        ...

    def figures(self) -> tuple[Figure, ...]:
        """The same for a page."""
        ...

    def to_dict(self) -> dict[str, Any]:
        """Plain data, as ``--json`` prints it."""
        ...


class ComparisonOnScreen(OnScreen):
    """A comparison that shows itself as its table."""

    __slots__ = ()

    def screen(self: Comparison) -> Screen:
        """The table."""
        return Screen(self.table.title, [Block("", self.table.heads, self.table.rows)])


@dataclass(frozen=True, slots=True, repr=False)
class TableComparison(ComparisonOnScreen):
    """A comparison that is a table and no more."""

    table: TextTable

    def figures(self) -> tuple[Figure, ...]:
        """The table."""
        return (Figure(title=self.table.title, table=self.table.on_page),)

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {"rows": [dict(zip(self.table.heads, row, strict=True)) for row in self.table.rows]}


def comparison_section(found: Sequence[Comparison]) -> Section:
    """Figures of comparisons, as the page of a run shows them."""
    return Section(
        "Comparison with the alternatives on this axis", [figure for one in found for figure in one.figures()]
    )


def comparison_page(axis_name: str, found: Sequence[Comparison], settings: Mapping[str, str] | None = None) -> Page:
    """The page that `detent compare` writes: every figure, and the terminal's table where no figure has one."""
    sections: list[Section] = []
    for one in found:
        figures = list(one.figures())
        if not any(figure.table for figure in figures):
            figures.append(Figure(title="In figures", table=one.table.on_page))
        sections.append(Section(one.table.title, figures))
    return Page(
        title=f"{axis_name}: compared",
        headline=Headline(
            level="good",
            verdict="Compared",
            name=axis_name,
            kicker="The method of an axis compared with its alternatives",
            lead=f"{count(len(found), 'comparison')}, simulated on this axis.",
        ),
        sections=sections,
        settings=settings or {},
    )
