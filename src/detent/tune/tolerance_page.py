"""The page of `detent tolerance`: how many are good, how each quantity spreads, what makes it do so, why cases fail."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from detent.analysis.sensitivity import Index, Sensitivity
from detent.page.chart import Chart, Curve, Panel, line_chart, spread_chart
from detent.page.figure import Figure
from detent.page.frame import Card, Headline, Page, Section
from detent.page.parts import Note, Numbers
from detent.page.table import Cell, Table, offset_cell
from detent.page.words import count
from detent.tune.batch import DONE, Limit, Quantity
from detent.units import format_quantity

if TYPE_CHECKING:
    from detent.tune.tolerated import Tolerated

NEAR = 1.5  # of the spread of a quantity, how far off a limit is still drawn
MOST_POINTS = 1500  # of a scatter of cases
MOST_KEYS = 12  # of a tornado
GOOD, BAD = "speed", "current"


def tolerance_page(found: "Tolerated") -> Page:
    """Put the page together."""
    whole, name = found.yields[0], found.question.file.spec.axis.name
    low, high = (f"{100 * end:.4g}" for end in whole.interval)
    lead = (
        f"{found.sentence} Each case is a machine of its own: every key in [tolerance] has another value, and all make "
        f"the job “{found.question.job.name}”."
    )
    return Page(
        title=f"{name}: tolerances",
        headline=Headline(
            level="good" if found.done else "warn" if whole.good else "bad",
            verdict="All pass" if found.done else f"{100 * whole.share:.3g} % pass",
            name=name, kicker=f"{count(whole.of, 'machine')} within their tolerances", lead=lead,
        ),
        cards=[
            Card("yield", f"{100 * whole.share:.4g}", "%", f"{low} to {high} % with 95 % confidence"),
            Card("cases that fail", str(whole.of - whole.good), "", f"of {whole.of}", bad=not found.done),
            Card("to halve the interval", str(whole.more), "cases more", f"it is {low} to {high} % now"),
        ],
        notes=[] if found.done else [Note("warning", _first_failure(found))],
        sections=[
            Section("How many are good", [_yields(found), *_failures(found)]),
            Section("What makes them differ", _causes(found)),
            Section("How each quantity spreads", [_spread(found, one) for one in _varying(found)]),
            Section("What is not known", [_tolerances(found)]),
        ],
        settings={
            "axis file": found.question.name, "job": found.question.job.name, "seed": str(found.question.seed),
            "store": "" if found.folder is None else str(found.folder), "question": found.question.hash[:20],
        },
    )  # fmt: skip


def _first_failure(found: "Tolerated") -> str:
    """The most frequent kind in a sentence."""
    worst = found.judged.failures[0]
    return f"Most frequent: {worst.kind}, {count(worst.number, 'case')} of {found.yields[0].of}."


def _yields(found: "Tolerated") -> Figure:
    rows = list[list[str | Cell]]()
    for one in found.yields:
        low, high = one.interval
        told = f"{100 * low:.4g} to {100 * high:.4g} %"
        rows.append([one.name, f"{one.good} of {one.of}", Cell(text=f"{100 * one.share:.4g} %", bar=one.share), told])
    heads = [("passes", False), ("cases", True), ("yield", True), ("95 % interval", True)]
    caption = "The interval of Clopper and Pearson: of a hundred such samples, 95 or more hold the true yield."
    return Figure(title="Yield", caption=caption, table=Table(heads=heads, rows=rows))


def _failures(found: "Tolerated") -> list[Figure]:
    """Each kind of failure, with cases to look at."""
    rows = [
        [one.kind, Cell(text=str(one.number), bar=one.number / found.yields[0].of), ", ".join(map(str, one.cases))]
        for one in found.judged.failures
    ]
    heads = [("why", False), ("cases", True), ("the first", False)]
    caption = "A case that breaks several limits stands under all of them together."
    return [Figure(title="Cases that fail", caption=caption, table=Table(heads=heads, rows=rows))] if rows else []


# ---- what makes them differ


def _causes(found: "Tolerated") -> list[Figure]:
    """A tornado of each quantity with a limit, and the two keys that explain most of the first."""
    limited = [limit.quantity for limit in found.judged.limits if limit.quantity in found.sensitivities]
    named = list(dict.fromkeys([*limited, *found.sensitivities]))[: max(1, len(set(limited)))]
    figures = [_tornado(name, found.sensitivities[name], found.total.get(name, {})) for name in named]
    if named and len(found.sensitivities[named[0]].order) > 1:
        figures.append(_scatter(found, named[0]))
    return figures


def _tornado(name: str, one: Sensitivity, total: Mapping[str, Index]) -> Figure:
    longest = max(*(index.value for index in one.share.values()), 1e-3)
    rows: list[list[str | Cell]] = [
        [_key(key), _bar(one.share[key], longest), offset_cell(one.rank[key].value, 1.0), _interval(one.share[key])]
        for key in one.order[:MOST_KEYS]
    ]
    rows.append(["together only", _bar(one.together, longest), "", _interval(one.together)])
    heads = [("", False), ("share of the spread", True), ("rank correlation", True), ("share, 95 % interval", True)]
    caption = (
        "The share of its variance that each key explains alone: hold the first one closer. The sign of the rank "
        "correlation says whether the quantity grows or falls with the key. What keys do together only, and what none "
        "explains, is the last row."
    )
    if total:
        heads.append(("share with others", True))
        caption += " With others: alone, and together with other keys."
        for row, key in zip(rows, [*one.order[:MOST_KEYS], ""], strict=True):
            row.append(_percent(total[key]) if key else "")
    return Figure(title=f"What decides {name}", caption=caption, table=Table(heads=heads, rows=rows))


def _key(key: str) -> Markup:
    """A key that a narrow screen may break behind its dots."""
    return Markup(".<wbr>").join(key.split("."))


def _bar(one: Index, longest: float) -> Cell:
    """An index behind a bar."""
    return Cell(text=_percent(one), bar=min(one.value / longest, 1.0))


def _percent(one: Index) -> str:
    return f"{100 * one.value:.1f} %"


def _interval(one: Index) -> str:
    return f"{100 * one.low:.1f} to {100 * one.high:.1f} %"


def _scatter(found: "Tolerated", name: str) -> Figure:
    """Cases by the two keys that explain most of a quantity; of the good ones the first, of the others all that fit."""
    key, other = found.sensitivities[name].order[:2]
    bad = np.flatnonzero(~found.judged.good)[: MOST_POINTS // 2]
    kept = np.union1d(bad, np.flatnonzero(found.judged.good)[: MOST_POINTS - len(bad)])
    x, x_label = _in_units(found.cases.values[key][kept], _unit_of(found, key), key)
    y, y_label = _in_units(found.cases.values[other][kept], _unit_of(found, other), other)
    order, good = np.argsort(x, kind="stable"), found.judged.good[kept]
    curves = [
        Curve(label=label, colour=colour, y=np.where(which, y, np.nan)[order], rings=size, digits=_digits(y))
        for label, colour, which, size in (("passes", GOOD, good, 3), ("fails", BAD, ~good, 6))
        if which.any()
    ]
    panel = Panel(name="scatter", label=y_label, curves=curves, height=300)
    caption = f"Each point is a machine, by the two keys that explain most of {name}."
    return Figure(
        title="Where the bad ones lie" if len(bad) else "The two keys that decide most",
        caption=caption,
        charts=[line_chart(panel, x[order], x_label, digits=_digits(x))],
    )


def _unit_of(found: "Tolerated", key: str) -> str:
    return next(one.unit for one in found.question.tolerance if one.key == key)


# ---- how quantities spread


def _varying(found: "Tolerated") -> list[Quantity]:
    """Quantities that differ from case to case."""
    figures = found.figures
    return [one for one in found.judged.told if one.name != DONE and figures[one.name].least < figures[one.name].most]


def _spread(found: "Tolerated", one: Quantity) -> Figure:
    """How often each value occurs, with limits and the machine of the file."""
    values = found.cases.results[one.name]
    seen, figure = values[np.isfinite(values)], found.figures[one.name]
    limits = [limit for limit in found.judged.limits if limit.quantity == one.name]
    near = [limit for limit in limits if _is_near(limit, figure.least, figure.most)]
    worst = [known.value for known in found.worst if known.quantity == one.name]
    shown, label = _in_units(np.array([*seen, *(limit.value for limit in near), *worst]), one.unit, one.name)
    marks = list(
        zip(map(float, shown[len(seen) :]), [*("limit" for _ in near), *("worst case" for _ in worst)], strict=True)
    )
    chart: Chart = spread_chart(f"spread-{one.name.replace(' ', '-')}", shown[: len(seen)], (label, "cases"), marks)
    low, high, least, most, nominal = (
        format_quantity(value, one.unit, 3)
        for value in (figure.low, figure.high, figure.least, figure.most, figure.nominal)
    )
    caption = f"90 % lie between {low} and {high}, all between {least} and {most}; the file itself has {nominal}."
    caption += f" The worst machine found has {format_quantity(worst[0], one.unit, 3)}." if worst else ""
    far = [format_quantity(limit.value, one.unit, 3) for limit in limits if limit not in near]
    caption += f" The limit, {' and '.join(far)}, is far away." if far else ""
    return Figure(title=one.name, caption=caption, charts=[chart])


def _is_near(limit: Limit, least: float, most: float) -> bool:
    return least - NEAR * (most - least) <= limit.value <= most + NEAR * (most - least)


def _in_units(values: Numbers, unit: str, name: str) -> tuple[Numbers, str]:
    """Values in a unit of a size for people, and what stands at their axis."""
    top = float(np.abs(values).max())
    if not unit or not top:
        return values, f"{name} [{unit}]" if unit else name
    shown, _, prefixed = format_quantity(top, unit, 17).partition(" ")
    return values * (float(shown) / top), f"{name} [{prefixed.replace('um', 'µm')}]"


def _digits(values: Numbers) -> int:
    """Digits after the point that tell values apart."""
    spread = float(values.max() - values.min()) or 1.0
    return max(0, 3 - int(np.floor(np.log10(spread))))


def _tolerances(found: "Tolerated") -> Figure:
    rows = [[_key(one.key), str(one), "normal" if one.normal else "even"] for one in found.question.tolerance]
    heads = [("key", False), ("between", False), ("spread", False)]
    return Figure(title="Tolerances of the file", table=Table(heads=heads, rows=rows))
