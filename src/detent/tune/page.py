"""The page of `detent tune`: before and after, the loops with their bound, and what more sensitivity would buy."""

from typing import TYPE_CHECKING, Any

import numpy as np

from detent.analysis.linear_system import LinearSystem
from detent.axisfile.tables import AxisSpec
from detent.methods.registry import METHODS
from detent.page.chart import Chart, Curve, Loop, Panel, line_chart, loop_chart
from detent.page.figure import Figure
from detent.page.frame import Card, Headline, Page, Section
from detent.page.parts import Note, Numbers
from detent.page.table import TextTable
from detent.page.words import number
from detent.units import format_quantity

if TYPE_CHECKING:
    from detent.tune.tuned import Tuned

POINTS = 900  # frequencies of a figure
DECADES = 3.0  # of them
MOST_PLANTS = 6  # drawn beside the nominal one
FARTHEST = 3.0  # from the origin, that a Nyquist plot is drawn
BEFORE, AFTER, OTHERS = "muted", "speed", "left"


def tuned_page(found: "Tuned") -> Page:
    """Put the page together."""
    level = "good" if found.done else "warn" if found.after else "bad"
    verdict = {"good": "Gains chosen", "warn": "For the nominal axis only", "bad": "No gains"}[level]
    sections = [Section("Before and after", [_table(found)])]
    sections += [Section("The loops", _loops(found)), Section("What more would cost", _trade(found))]
    return Page(
        title=f"{found.before.file.spec.axis.name}: tuned",
        headline=Headline(
            level=level, verdict=verdict, name=found.before.file.spec.axis.name, kicker="Choice of gains",
            lead=f"{found.sentence} {' '.join(found.why)}".replace("`", ""),
        ),
        cards=_cards(found),
        notes=[Note("warning", str(one)) for one in found.refusals],
        sections=sections,
        settings={
            "axis file": found.before.file.file, "largest Ms": f"{found.bounds.sensitivity:g}",
            "largest overshoot": f"{found.bounds.overshoot:g}", "goal": found.goal,
        },
    )  # fmt: skip


def _cards(found: "Tuned") -> list[Card]:
    """Ms, and what it bought."""
    if found.after is None:
        return []
    new, at = found.after.sensitivity
    gained = (found.worth[2] if found.done else found.worth[1]) / found.worth[0] if found.worth[0] else 0.0
    cards = [
        Card("Ms", number(new), "", f"at {format_quantity(at, 'Hz', 3)}; before: {found.before.told}"),
        Card(found.worth_text, number(gained), "times", "that of the gains in the file"),
    ]
    if found.after.bandwidth is not None and found.before.bandwidth is not None:
        value, unit = format_quantity(found.after.bandwidth, "Hz", 3).split(" ")
        below = f"{format_quantity(found.before.bandwidth, 'Hz', 3)} before"
        cards.append(Card("bandwidth, −3 dB", value, unit, below))
    return cards


def _table(found: "Tuned") -> Figure:
    table = TextTable("", ("", "before", "after"), found.rows).on_page
    job = found.before.result.job.name
    caption = f"Gains, margins where the loops are cut open, and what the simulated axis did with the job “{job}”."
    return Figure(title="Gains and figures", caption=caption, table=table)


def _systems(found: "Tuned", spec: AxisSpec) -> dict[str, LinearSystem]:
    """The loops of a plant with the new gains."""
    return dict(METHODS[spec.axis.method].linear(spec.varied(found.typed)).loops)


def _loops(found: "Tuned") -> list[Figure]:
    """Sensitivity over frequency, and the loop beside the point that it must keep away from, at each cut."""
    old = found.before.file.spec
    before = METHODS[old.axis.method].linear(old).loops
    after = _systems(found, old) if found.after else {}
    others = [_systems(found, one.spec) for one in found.guaranteed.binding[1 : 1 + MOST_PLANTS]] if found.done else []
    return [
        Figure(
            title=f"Cut at the {cut}",
            caption="Sensitivity 1/(1 + L): how much of a disturbance is left, or grows; its peak is Ms. Beside it the "
            "loop itself: the circle around −1 is as large as Ms allows, and the loop stays outside.",
            charts=[_sensitivity(found, cut, system, after.get(cut), [one[cut] for one in others]),
                    _nyquist(found, cut, system, after.get(cut), [one[cut] for one in others])],
            beside=True,
        )
        for cut, system in before.items()
    ]  # fmt: skip


def _curves(before: LinearSystem, after: LinearSystem | None, others: list[LinearSystem]) -> Any:
    """Each system with how it is drawn; what lies in front comes last."""
    drawn = [(before, "before", BEFORE, (5, 4))]
    drawn += [(one, f"after, plant {k} that decides", OTHERS, None) for k, one in enumerate(others, 2)]
    return drawn + ([(after, "after", AFTER, None)] if after else [])


def _grid(system: LinearSystem) -> Numbers:
    grid = system.frequencies()
    highest = 0.499 / system.dt
    usual = np.geomspace(highest * 10**-DECADES, highest, POINTS)
    near = grid[(grid > usual[0]) & (grid < highest)]
    return np.unique(np.concatenate([usual, near[:: max(1, len(near) // POINTS)]]))


def _sensitivity(
    found: "Tuned", cut: str, before: LinearSystem, after: LinearSystem | None, others: list[LinearSystem]
) -> Chart:
    f = _grid(before)
    curves = [
        Curve(label=label, colour=colour, y=1.0 / np.abs(1.0 + one.response(f)), dash=dash,
              width=1.0 if one in others else None)
        for one, label, colour, dash in _curves(before, after, others)
    ]  # fmt: skip
    panel = Panel(
        name=f"sensitivity-{cut.replace(' ', '-')}", label="sensitivity", curves=curves, height=300,
        span=(0.02, 5.0), levels=[(found.bounds.sensitivity, f"Ms {found.bounds.sensitivity:g}")],
    )  # fmt: skip
    return line_chart(panel, f, "frequency [Hz]", log="xy")


def _nyquist(
    found: "Tuned", cut: str, before: LinearSystem, after: LinearSystem | None, others: list[LinearSystem]
) -> Chart:
    loops = [
        Loop(label=label, colour=colour, x=point.real, y=point.imag, width=1.0 if one in others else 2.0)
        for one, label, colour, _ in _curves(before, after, others)
        for point in [_near(one.response(_grid(one)))]
    ]
    turn = np.linspace(0.0, 2 * np.pi, 121)
    circle = -1.0 + np.exp(1j * turn) / found.bounds.sensitivity
    loops.append(Loop(label=f"Ms {found.bounds.sensitivity:g}", colour="drive", x=circle.real, y=circle.imag))
    panel = Panel(
        name=f"nyquist-{cut.replace(' ', '-')}", label="imaginary part of L", curves=[], height=300, zero=True,
        span=(-FARTHEST, 1.5),
    )  # fmt: skip
    return loop_chart(panel, np.linspace(-FARTHEST, 1.0, 200), "real part of L", loops)


def _near(loop: Any) -> Any:
    """What of a loop is in sight; it comes from far away and ends at the origin."""
    inside = (loop.real > -FARTHEST) & (loop.real < 1.0) & (loop.imag > -FARTHEST) & (loop.imag < 1.5)
    first = int(np.argmax(inside))
    return loop[first:][inside[first:]]


def _trade(found: "Tuned") -> list[Figure]:
    """What each Ms would buy, nominal axis."""
    tried = [(level, worth) for level, worth in found.trade if worth > 0.0]
    if len(tried) < 2:
        return []
    levels, worths = (np.array(column) for column in zip(*tried, strict=True))
    digits = max(0, 4 - int(np.floor(np.log10(worths.max()))))
    curve = Curve(label=found.worth_text, colour=AFTER, y=worths, digits=digits)
    rings = Curve(label="computed", colour=AFTER, y=worths, digits=digits, rings=7)
    panel = Panel(name="trade", label=found.worth_text, curves=[curve, rings], height=240, zero=True)
    caption = (
        "How much the largest sensitivity allows, on the axis as the file states it. A larger Ms buys stiffness with "
        "less room for what is not known; 1.7 is a usual choice, above 2 a loop rings."
    )
    return [Figure(title="Stiffness against Ms", caption=caption, charts=[line_chart(panel, levels, "largest Ms")])]
