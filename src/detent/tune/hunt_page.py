"""The page of `detent hunt`: verdict and kinds, the worst start, the map of its slips, and what stops it."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from detent.methods.tuning import COLUMNS
from detent.page.chart import Chart, Curve, Loop, Panel, Timeline, line_chart, loop_chart, time_charts
from detent.page.figure import Figure
from detent.page.frame import Card, Headline, Page, Section
from detent.page.parts import Note
from detent.page.table import Table, TextTable
from detent.page.units import Units
from detent.page.words import number
from detent.tune.assumed import CAPTION
from detent.tune.dead_band import MAP_STARTS
from detent.tune.standstill import HUNTS, OUTCOMES
from detent.units import format_quantity

if TYPE_CHECKING:
    from detent.tune.dead_band import Map
    from detent.tune.hunted import Hunted

Numbers = NDArray[np.float64]

PERIODS = 5  # of the worst start that are drawn
BLOCK = 0.5  # of it that is simulated at a time [s]
ROUNDS = 8  # of the cobweb


def hunted_page(found: "Hunted") -> Page:
    """Put the page together."""
    level = "bad" if found.standing.hunts else "good" if found.standing.outcome == "rests" else "warn"
    name = found.file.spec.axis.name
    heads = ("what", *found.heads[1:])
    masses = "" if found.standing.ensemble.single else " of motor and load"
    kinds = Figure(
        title="Kinds", table=TextTable("", heads, found.rows).on_page if found.rows else None,
        caption=f"Kinds that differ in amplitude or period by more than a factor of 3: swings{masses} from peak to "
        "peak, and from how many starts they come about.",
    )  # fmt: skip
    return Page(
        title=f"{name}: at standstill",
        headline=Headline(
            level=level, verdict=found.standing.outcome.capitalize(), name=name, kicker="Axis at standstill",
            lead=found.sentence,
        ),
        cards=_cards(found),
        notes=[Note("note", one[0].upper() + one[1:].replace("`", "") + ".") for one in found.told],
        sections=[
            Section("What it does", [kinds, _worst(found)]),
            Section("Why", [_cobweb(found), _assumed(found)]),
            Section("What stops it", [_widths(found), _map(found)]),
        ],
        settings={
            "axis file": found.file.file, "starts": str(len(found.standing.found)), "seed": str(found.standing.seed),
            "targets": "on counts" if found.standing.on_counts or not found.standing.ensemble.between else "anywhere",
        },
    )  # fmt: skip


def _units(found: "Hunted") -> Units:
    return Units(found.standing.ensemble.unit == "rad")


def _cards(found: "Hunted") -> list[Card]:
    """How far, how often, from how many starts."""
    stand, units = found.standing, _units(found)
    hunting = round(stand.shares[HUNTS] * len(stand.found))
    cards = [Card("starts that hunt", number(hunting), "", f"of {len(stand.found)}", hunting > 0)]
    if stand.kinds:
        worst = stand.kinds[0]
        scale = units.small(worst.worst.swing.largest)
        cards.append(Card("largest swing", number(worst.worst.swing.largest * scale.factor), scale.name, worst.name))
        value, unit = format_quantity(worst.period, "s", 3).split(" ")
        cards.append(Card("period", number(float(value)), unit, "median of its kind"))
    if found.band is not None and found.band.found is not None:
        scale = units.small(found.band.found.width)
        rest = units.error(found.band.found.rest_error)
        cards.append(
            Card("dead band", number(found.band.found.width * scale.factor), scale.name, f"rests up to {rest} off")
        )
    return cards


def worst_rows(found: "Hunted") -> Numbers:
    """Rows of the worst start, `COLUMNS`, its last five periods: it is simulated again."""
    stand = found.standing
    worst = max(range(len(stand.found)), key=lambda k: (OUTCOMES.index(stand.found[k].outcome),
                                                        stand.found[k].swing.largest))  # fmt: skip
    course = stand.ensemble.courses(worst + 1, stand.seed, on_counts=stand.on_counts)[worst]
    one, parts, simulated = stand.found[worst], list[Numbers](), 0.0
    while simulated < one.simulated and not course.proven:
        parts.append(course.go(BLOCK))
        simulated += BLOCK
    rows = np.concatenate(parts)
    shown = PERIODS * one.swing.period if one.swing.period > 0.0 else BLOCK
    return rows[rows[:, 0] >= rows[-1, 0] - shown]


def _worst(found: "Hunted") -> Figure:
    """Position, command and integral over five periods; where it leapt over standing, lines join the ends."""
    rows, units = worst_rows(found), _units(found)
    t = rows[:, 0] - rows[0, 0]
    column = {name: rows[:, k] for k, name in enumerate(COLUMNS)}
    middle = 0.5 * (column["load_low"].min() + column["load_high"].max())
    ways = {name: 0.5 * (column[f"{name}_low"] + column[f"{name}_high"]) - middle for name in ("motor", "load")}
    scale = units.small(max(float(np.abs(way).max()) for way in ways.values()))
    masses = (("motor", "drive"), ("load", "speed"))[: 1 if found.standing.ensemble.single else 2]
    curves = [Curve(label=name, colour=colour, y=ways[name] * scale.factor) for name, colour in masses]
    unit = found.standing.ensemble.command_unit
    error = Curve(label="error", colour="current", y=column["error"] * scale.factor)
    command = [Curve(label="command", colour="drive", y=column["command"], digits=4)]
    if np.any(column["integral"] != 0.0):
        command.append(Curve(label="integral", colour="muted", y=column["integral"], digits=4))
    panels = [
        Panel(
            name="worst-position", label=f"from the middle [{scale.name}]", curves=curves, title="Position", zero=True
        ),
        Panel(name="worst-error", label=f"error [{scale.name}]", curves=[error], title="Error", zero=True, height=160),
        Panel(name="worst-command", label=f"command [{unit}]", curves=command, title="Command", height=160),
    ]
    unit = "ms" if t[-1] < 1.0 else "s"
    charts = time_charts(Timeline(name="worst", t=t, unit=unit, label="time"), panels)
    grows = " While friction holds, the integral grows." if len(command) > 1 else ""
    caption = f"The start that moves farthest, over its last five periods.{grows}"
    return Figure(title="The worst start", caption=caption, charts=charts)


def _cobweb(found: "Hunted") -> Figure:
    """Return map of the slips, and the way of one start on it."""
    title = "From slip to slip"
    if found.slips is None:
        return Figure(title=title)
    errors, behind = found.slips
    scale = _units(found).small(float(errors.max()))
    x, y = errors * scale.factor, behind * scale.factor
    panel = Panel(
        name="cobweb", label=f"error behind it [{scale.name}]", height=320, zero=True,
        curves=[Curve(label="behind a slip", colour="speed", y=y), Curve(label="no change", colour="muted", y=x)],
    )  # fmt: skip
    at, places = 0.9 * float(x[-1]), list[tuple[float, float]]()
    for _ in range(ROUNDS):
        after = float(np.interp(at, x, y))
        places += [(at, after), (after, after)]
        at = after
    way = np.array(places)
    loops = [Loop(label="one start", colour="drive", x=way[:, 0], y=way[:, 1], width=1.0)]
    caption = (
        "A slip begins where the force reaches static friction; the error there decides the error behind it. Where the "
        "curve is above or below zero on the other side, the next slip goes back: the axis hunts between the two."
    )
    chart = loop_chart(panel, x, f"error at which a slip begins [{scale.name}]", loops)
    return Figure(title=title, caption=caption, charts=[chart])


def _assumed(found: "Hunted") -> Figure:
    """What it does with other friction, where the file does not say."""
    table = found.table.on_page if found.assumed else None
    return Figure(title=found.table.title, caption=CAPTION, table=table)


def _widths(found: "Hunted") -> Figure:
    """Swing and rest error over the width of the dead band."""
    if found.band is None:
        return Figure(title="Dead band")
    units = _units(found)
    rows = [[units.error(one.width), f"{100 * one.hunts:.0f} %", units.error(one.swing) if one.swing else "–",
             units.error(one.rest_error)] for one in sorted(found.band.tried, key=lambda one: one.width)]  # fmt: skip
    heads = [("dead band", False), ("starts that hunt", True), ("largest swing", True), ("largest rest error", True)]
    caption = "Widths that were tried: in place of a swing the axis rests somewhere inside the band, or where it lands."
    return Figure(title="Dead band", caption=caption, table=Table(heads=heads, rows=rows))


def _map(found: "Hunted") -> Figure:
    """Verdict over dead band and integral."""
    if found.map is None:
        return Figure(title="Dead band and integral")
    units, made = _units(found), found.map
    largest = max(one.swing for row in made.found for one in row) or 1.0
    heads = [("integral", False), *((f"band {units.error(width)}", True) for width in made.widths)]
    rows = [[f"× {share:g}", *(_place(units, one, largest) for one in row)]
            for share, row in zip(made.integrals, made.found, strict=True)]  # fmt: skip
    caption = (
        f"Largest swing of what hunts, with a bar for its size; else the rest error; {MAP_STARTS} starts each. The "
        f"file has × 1 of the integral and a dead band of {units.error(_own_band(found))}."
    )
    return Figure(title="Dead band and integral", caption=caption, charts=[_edge(made, units)],
                  table=Table(heads=heads, rows=rows))  # fmt: skip


def _own_band(found: "Hunted") -> float:
    from detent.tune.choice import value_of

    return value_of(found.file.spec, found.standing.ensemble.band)


def _place(units: Units, one: Any, largest: float) -> Any:
    from detent.page.table import Cell

    if one.hunts:
        return Cell(text=f"hunts {units.error(one.swing)}", bar=one.swing / largest, over=True)
    return Cell(text=f"{one.outcome}, {units.error(one.rest_error)} off")


def _edge(made: "Map", units: Units) -> Chart:
    """The least dead band of the map that does not hunt, over the integral; the verdict as a line."""
    shares = [share for share in made.integrals if share > 0.0]
    least = [
        next((width for width, one in zip(made.widths, row, strict=True) if not one.hunts), np.nan)
        for share, row in zip(made.integrals, made.found, strict=True)
        if share > 0.0
    ]
    scale = units.small(float(np.nanmax(least)) if np.isfinite(least).any() else made.widths[-1])
    y = np.array(least) * scale.factor
    curves = [Curve(label="least band that stops it", colour="speed", y=y),
              Curve(label="tried", colour="speed", y=y, rings=7)]  # fmt: skip
    panel = Panel(name="band-over-integral", label=f"dead band [{scale.name}]", curves=curves, zero=True)
    return line_chart(panel, np.array(shares), "integral gain, times that of the file", log="x")
