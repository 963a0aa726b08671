"""The page of `detent tune`: before and after, the loops with their bound, and what more sensitivity would buy."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from detent.analysis.linear_system import LinearSystem
from detent.analysis.margins import Margins
from detent.axisfile.tables import AxisSpec
from detent.methods.registry import METHODS
from detent.methods.tuning import Response
from detent.page.chart import Chart, Curve, Loop, Panel, Timeline, line_chart, loop_chart, time_charts
from detent.page.figure import Figure
from detent.page.frame import Card, Headline, Page, Section
from detent.page.parts import Note, Numbers
from detent.page.table import TextTable
from detent.page.units import Units
from detent.page.words import number
from detent.tune.assumed import CAPTION
from detent.units import format_quantity

if TYPE_CHECKING:
    from detent.tune.tuned import Tuned

POINTS = 900  # frequencies of a figure
DECADES = 3.0  # of them
MACHINES, SEED = 200, 7  # that are pushed, and what they are drawn from
SHARES = 5, 50, 95  # of them, that are drawn [%]
MOST_PLANTS = 6  # drawn beside the nominal one
FARTHEST = 3.0  # from the origin, that a Nyquist plot is drawn
BEFORE, AFTER, OTHERS = "muted", "speed", "left"


def tuned_page(found: "Tuned") -> Page:
    """Put the page together."""
    level = "good" if found.done else "warn" if found.after else "bad"
    verdict = {"good": "Gains chosen", "warn": "For the nominal axis only", "bad": "No gains"}[level]
    sections = [Section("Before and after", [_table(found), _why(found), *_friction(found)])]
    sections += [
        Section("The loops", _loops(found)), Section("In time", _in_time(found)),
        Section("What more would cost", [*_trade(found), _further(found)]),
    ]  # fmt: skip
    return Page(
        title=f"{found.before.file.spec.axis.name}: tuned",
        headline=Headline(
            level=level, verdict=verdict, name=found.before.file.spec.axis.name, kicker="Choice of gains",
            lead=" ".join([found.sentence, *found.what_limits]),
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


def _why(found: "Tuned") -> Figure:
    """What decided, a sentence a row."""
    rows = [(one.replace("`", ""),) for one in found.why]
    return Figure(title="Why these gains", table=TextTable("", ("",), rows).on_page if rows else None)


def _friction(found: "Tuned") -> list[Figure]:
    """What it does at standstill with friction that the file does not state."""
    if not found.assumed:
        return []
    return [Figure(title=found.table.title, caption=CAPTION, table=found.table.on_page)]


def _systems(found: "Tuned", spec: AxisSpec) -> dict[str, LinearSystem]:
    """The loops of a plant with the new gains."""
    return dict(METHODS[spec.axis.method].linear(spec.varied(found.typed)).loops)


def _loops(found: "Tuned") -> list[Figure]:
    """At each cut the open loop with its margins, its sensitivity, and how near it comes to -1."""
    old = found.before.file.spec
    before = METHODS[old.axis.method].linear(old).loops
    after = _systems(found, old) if found.after else {}
    others = [_systems(found, one.spec) for one in found.guaranteed.binding[1 : 1 + MOST_PLANTS]] if found.done else []
    every = _every(found)
    figures = list[Figure]()
    for cut, system in before.items():
        f, new = _grid(system), after.get(cut)
        plants = [one[cut] for one in others]
        seen = [one[cut].response(f) for one in every]
        band = " Thin lines are the ends of all plants of [tolerance]." if seen else ""
        figures += [
            Figure(
                title=f"Open loop at the {cut}",
                caption="Gain and phase of the loop that is cut there. Rings mark its margins: where its gain is 1, "
                f"and where its phase is −180°.{band}",
                charts=_bode(cut, f, [system, *([new] if new else [])], seen), beside=True,
            ),
            Figure(
                title=f"Cut at the {cut}",
                caption="Sensitivity S = 1/(1 + L), how much of a disturbance is left, or grows: its peak is Ms. T = "
                "L/(1 + L) is what comes through. Beside them the loop itself: the circle around −1 is as large as Ms "
                "allows, and the loop stays outside.",
                charts=[_sensitivity(found, cut, system, new, plants), _nyquist(found, cut, system, new, plants)],
                beside=True,
            ),
        ]  # fmt: skip
    return figures


def _every(found: "Tuned") -> list[dict[str, LinearSystem]]:
    """The loops of all plants that the choice looked at in every round, with the new gains; none without tolerances."""
    if not found.done or not found.file.tolerance:
        return []
    return [_systems(found, one.spec) for one in found.chooser.pool(found.values)]


def _bode(cut: str, f: Numbers, systems: list[LinearSystem], seen: list[Any]) -> list[Chart]:
    """Gain and phase over frequency; the last system is the one whose margins are marked."""
    looks = [("before", BEFORE, (5, 4)), ("after", AFTER, None)][-len(systems) if len(systems) == 1 else 0 :]
    looks = looks if len(systems) == 2 else [("before", AFTER, None)]
    loops = [one.response(f) for one in systems]
    marked = _marked(f, loops[-1], systems[-1].margins())
    name = cut.replace(" ", "-")
    charts = list[Chart]()
    for part, label, level, of in (
        ("gain", "gain", (1.0, "1"), np.abs), ("phase", "phase [°]", (-180.0, "−180°"), _phase),
    ):  # fmt: skip
        values = [of(loop) for loop in loops]
        ends = np.array([of(loop) for loop in seen])
        curves = [
            Curve(label=text, colour=OTHERS, y=side, width=1.0)
            for text, side in zip(("least of all plants", "largest"), (ends.min(axis=0), ends.max(axis=0)), strict=True)
        ] if seen else []  # fmt: skip
        curves += [
            Curve(label=text, colour=colour, y=y, dash=dash)
            for y, (text, colour, dash) in zip(values, looks, strict=True)
        ]
        rings = np.where(marked, values[-1], np.nan)
        curves.append(Curve(label="margins", colour="drive", y=rings, rings=8))
        span = (0.02, 50.0) if part == "gain" else (-540.0, 90.0)
        panel = Panel(name=f"{part}-{name}", label=label, curves=curves, height=300, span=span, levels=[level])
        charts.append(line_chart(panel, f, "frequency [Hz]", log="xy" if part == "gain" else "x"))
    return charts


def _phase(loop: Any) -> Any:
    """Phase without jumps, begun between −270 and 90 degrees."""
    turned = np.degrees(np.unwrap(np.angle(loop)))
    return turned - 360.0 * np.ceil((turned[0] - 90.0) / 360.0)


def _marked(f: Numbers, loop: Any, m: Margins) -> Any:
    """Places of the grid next to the crossover, and to where the gain margins are."""
    marked = np.zeros(len(f), bool)
    if m.crossover > 0.0:
        marked[np.argmin(np.abs(np.log(f / m.crossover)))] = True
    turns = np.flatnonzero((np.diff(np.signbit(loop.imag)) != 0) & (loop.real[:-1] < 0.0))
    for factor in (m.gain, m.least):
        if 0.0 < factor < np.inf and len(turns):
            marked[turns[np.argmin(np.abs(factor * np.abs(loop[turns]) - 1.0))]] = True
    return marked


# ---- in time


def _in_time(found: "Tuned") -> list[Figure]:
    """A push and a step, of many machines where these differ; the error during the job."""
    tuning, job = found.chooser.tuning, found.before.result.job
    stands = [found.before, *([found.after] if found.after else [])]
    many = _many(found)
    figures = [
        _response(found, k, [one.responses[k] if one.responses else None for one in stands], many[k] if many else [])
        for k in range(max(len(one.responses) for one in stands))
    ]
    runs = [tuning.followed(one.file.spec, job) if one.settles else None for one in stands]
    if any(runs):
        caption = f"How far the axis is off its reference during the job “{job.name}”."
        figures.append(_time_figure(found, "followed", ("Error during the job", caption), runs))
    return figures


def _many(found: "Tuned") -> list[list[Response]]:
    """Each response of many machines, with the new gains; none where all are alike."""
    tuning, plants = found.chooser.tuning, found.chooser.plants
    if not found.done or not plants.tolerance:
        return []
    machines = plants.random(MACHINES, list(plants.tolerance), SEED)
    made = [tuning.responses(one.spec.varied(found.typed)) for one in machines]
    return [list(one) for one in zip(*made, strict=True)]


def _response(found: "Tuned", k: int, both: Sequence[Response | None], many: Sequence[Response]) -> Figure:
    """One of them, with the new gains of as many machines as tell 5, 50 and 95 %."""
    caption = "; ".join(
        f"{when}: {text}"
        for when, one in zip(("before", "after"), both, strict=False) if one is not None
        for text in one.figures.values()
    )  # fmt: skip
    if many:
        caption += f". Of {len(many)} machines of [tolerance] 5, 50 and 95 % are below the lines at each moment"
    name = next(one.name for one in both if one is not None)
    return _time_figure(found, f"response-{k}", (name[0].upper() + name[1:], f"{caption}."), both, many)


def _time_figure(
    found: "Tuned", name: str, words: tuple[str, str], both: Sequence[Response | None], many: Sequence[Response] = ()
) -> Figure:
    """Before, after, and many machines, over one time; title and caption."""
    looks = [(("before", BEFORE, (5, 4))), ("after", AFTER, None)]
    drawn = [(one, look) for one, look in zip(both, looks, strict=False) if one is not None]
    shown = drawn[-1][0]

    def on(one: Response) -> Any:
        """At the moments that are shown."""
        return np.interp(shown.t, one.t, one.y, left=np.nan, right=np.nan)

    curves = list[Curve]()
    if many:
        ends = np.nanquantile(np.array([on(one) for one in many]), np.array(SHARES) / 100.0, axis=0)
        curves = [Curve(label=f"{share} % of machines", colour=OTHERS, y=y, width=1.0)
                  for share, y in zip(SHARES, ends, strict=True)]  # fmt: skip
    curves += [Curve(label=label, colour=colour, y=on(one), dash=dash) for one, (label, colour, dash) in drawn]
    scale = Units(_turns(found)).small(max(float(np.nanmax(np.abs(one.y))) for one in curves))
    factor, unit = (1.0, "") if shown.share else (scale.factor, f" [{scale.name}]")
    curves = [replace(one, y=one.y * factor, digits=4) for one in curves]
    panel = Panel(name=name, label=f"{shown.label}{unit}", height=240, zero=True, curves=curves)
    timeline = Timeline(name=name, t=shown.t, unit="ms" if shown.t[-1] < 1.0 else "s")
    return Figure(title=words[0], caption=words[1], charts=time_charts(timeline, [panel]))


def _turns(found: "Tuned") -> bool:
    """Whether positions are angles."""
    return getattr(found.file.spec.axis, "motion", "") == "rotary"


def _further(found: "Tuned") -> Figure:
    """What each change of the axis would give."""
    rows = [(text.rstrip(","), f"{times:.2f}" if np.isfinite(times) else "only so") for text, times in found.further]
    caption = (
        f"How many times the {found.worth_text} each would allow, one change at a time, on the axis as the file states "
        f"it. {found.limited[:1].upper()}{found.limited[1:]}{'.' if found.limited else ''}"
    )
    table = TextTable("", ("with", "times"), rows).on_page if rows else None
    return Figure(title="What would allow more", caption=caption, table=table)


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
    through = (after or before).closed().response(f)
    curves.append(Curve(label=f"T {'after' if after else 'before'}", colour="drive", y=np.abs(through)))
    panel = Panel(
        name=f"sensitivity-{cut.replace(' ', '-')}", label="|S| and |T|", curves=curves, height=300,
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
