"""Figures and tables of the comparisons of steppers: methods that decide step by step, and limited jerk."""

from pathlib import Path
from typing import Any

import numpy as np

from detent.methods.stepper_envelope.comparison import JerkComparison, StepComparison
from detent.methods.stepper_envelope.stage_jerk import magnified, speed_at
from detent.methods.stepper_envelope.summary import stated
from detent.page.parts import Numbers
from detent.page.plots import COLOURS, check_figure_path, new_figure
from detent.page.words import count
from detent.units import format_quantity

# matplotlib's stubs leave every **kwargs untyped, so that strict checking would refuse each call.
Axes = Any

BLUE, ORANGE, GREEN, PINK = COLOURS[:4]
GREY = "#7d8996"
LIGHT = "#b8c1ca"
INK = "#17202a"
RED = "#b3261e"

LOOKS = (BLUE, GREY, LIGHT, "#E69F00", PINK)
"""Colours of the compared methods in their order: the one to look at is strong, those that reckon are grey."""

POINTS = 4000
"""Points of one curve: more than a printed page resolves."""

ROW = 0.86
"""Height that the bars of all methods of one way take, of 1."""

Table = tuple[str, tuple[str, ...], list[tuple[str, ...]]]
"""Title, heads and rows."""


METHOD_NAMES = {
    "envelope": "envelope (this method)",
    "start frequency": "constant start frequency",
    "largest frequency": "constant largest frequency",
}
"""Names of compared methods in full; the others carry theirs."""

METHOD_COSTS = {
    "envelope": "1 table read, 1 comparison, at most 1 increment",
    "A: braking distance per step": "1 or 2 square roots, 1 or 2 divisions",
    "B: speed per step": "1 square root, 1 multiplication",
    "start frequency": "nothing",
    "largest frequency": "nothing",
}
"""What the control unit works out before every step, compared methods as in stepper-envelope specification 3.7."""


def method_name(method: str) -> str:
    """Name of a compared method in full."""
    return METHOD_NAMES.get(method, method)


def steps_table(found: StepComparison) -> Table:
    """One motor with each method as a table."""
    title = f"Motor {found.motor}: time of a way, and steps lost ({format_quantity(found.step, 'm')} a step)"
    heads = ("method", *(f"{way} steps" for way in found.ways), "worked out per step")
    rows: list[tuple[str, ...]] = []
    for method, courses in zip(found.methods, found.courses, strict=True):
        cells = [_course(course.seconds, course.lost) for course in courses]
        rows.append((method_name(method), *cells, METHOD_COSTS.get(method, "")))
    return title, heads, rows


def _course(seconds: float, lost: int) -> str:
    return format_quantity(seconds, "s") + (f", {abs(lost)} lost" if lost else "")


def jerk_table(found: JerkComparison) -> Table:
    """The envelope and the profile of limited jerk as a table."""
    way = format_quantity(found.way, "m")
    title = f"Motor {found.motor}: {way} without zones, limits {_limits(found)}"
    profiles = (("envelope", found.envelope), ("time-optimal, jerk limited (ruckig)", found.smooth))
    rows: list[tuple[str, ...]] = []
    for name, profile in profiles:
        more = profile.seconds - found.envelope.seconds
        longer = "" if profile is found.envelope else f"{more * 1e3:+.1f} ms, {more / found.envelope.seconds:+.1%}"
        peak = format_quantity(float(profile.speed.max()), "m/s")
        rows.append((name, format_quantity(profile.seconds, "s"), longer, peak))
    return title, ("profile", "time", "beside the envelope", "peak speed"), rows


def _limits(found: JerkComparison) -> str:
    """Limits of the profile in words."""
    limits = ((found.speed, "m/s"), (found.acceleration, "m/s^2"), (found.jerk, "m/s^3"))
    return ", ".join(format_quantity(value, unit) for value, unit in limits)


# ---- figures


def plot_steps(found: StepComparison, path: str | Path) -> None:
    """Draw how long each way takes with each method, as a multiple of the envelope's time, and the steps it loses."""
    path = check_figure_path(path)
    ratios = np.array([found.seconds(k) / found.seconds(0) for k in range(len(found.methods))])
    with new_figure(path, 9.0, 1.8 + 0.19 * ratios.size + 0.3 * len(found.ways)) as figure:
        area = figure.subplots()
        for k, method in enumerate(found.methods):
            colour = LOOKS[k % len(LOOKS)]
            at = np.arange(len(found.ways)) + ROW * ((k + 0.5) / len(found.methods) - 0.5)
            area.barh(at, ratios[k], 0.9 * ROW / len(found.methods), color=colour, label=method_name(method))
            for place, ratio, course in zip(at, ratios[k], found.courses[k], strict=True):
                _write_course(area, place, ratio, course.seconds, course.lost)
        area.axvline(1.0, color=INK, linewidth=0.8, linestyle="--")
        area.set_yticks(range(len(found.ways)), [_way(found, way) for way in found.ways])
        area.invert_yaxis()
        area.grid(visible=False, axis="y")
        area.set_xlim(0, 1.22 * float(ratios.max()))
        area.set_xlabel("time over the envelope's time")
        area.set_title(f"How long does a way take, and are steps lost? Motor {found.motor}", pad=10)
        figure.legend(loc="outside lower center", ncols=3, fontsize=9)


def _write_course(area: Axes, place: float, ratio: float, seconds: float, lost: int) -> None:
    """Time and lost steps at the end of a bar."""
    text = format_quantity(seconds, "s", 3) + (f", {abs(lost)} steps lost" if lost else "")
    area.annotate(
        text, (max(ratio, 1.0), place), (4, 0), textcoords="offset points", va="center", fontsize=8,
        color=RED if lost else INK, fontweight="bold" if lost else "normal",
    )  # fmt: skip


def _way(found: StepComparison, way: int) -> str:
    return f"{count(way)} steps\n{stated(way * found.step * 1e3)} mm"


def plot_jerk(found: JerkComparison, path: str | Path) -> None:
    """Draw the speed of the envelope's run and of the jerk-limited profile: the whole way, and both ends magnified."""
    path = check_figure_path(path)
    last, window = max(found.envelope.seconds, found.smooth.seconds), magnified(found)
    with new_figure(path, 9.0, 6.4) as figure:
        areas: dict[str, Axes] = figure.subplot_mosaic([["whole", "whole"], ["begin", "end"]])
        _draw_profiles(areas["whole"], found, (0.0, last), 1.0)
        _draw_profiles(areas["begin"], found, (0.0, window), 1e3)
        _draw_profiles(areas["end"], found, (last - window, last), 1e3)
        more = 100 * (found.smooth.seconds / found.envelope.seconds - 1)
        areas["whole"].set_title(
            f"{stated(found.way * 1e3)} mm of motor {found.motor}: the jerk-limited profile takes {_compared(more)}",
            pad=24,
        )
        areas["whole"].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, fontsize=9, borderaxespad=0.2)
        for name, text in (("begin", "The beginning"), ("end", "The end")):
            areas[name].set_title(f"{text}, magnified", fontsize=10)
        limits = _limits(found).replace("^2", "²").replace("^3", "³")
        areas["whole"].text(
            0.5, 0.45, f"limits of the profile: {limits}", transform=areas["whole"].transAxes, ha="center", fontsize=9,
            color=GREY, bbox={"facecolor": "white", "edgecolor": "none"},
        )  # fmt: skip


def _compared(percent: float) -> str:
    return f"{abs(percent):.2g} % {'longer' if percent >= 0 else 'shorter'}"


def _draw_profiles(area: Axes, found: JerkComparison, span: tuple[float, float], scale: float) -> None:
    t: Numbers = np.linspace(*span, POINTS)
    smooth, steps = speed_at(found.smooth, t), speed_at(found.envelope, t, step=True)
    name = "time-optimal with limited jerk (ruckig)"
    area.plot(t * scale, steps * 1e3, color=BLUE, linewidth=1.8, label="envelope, step by step")
    area.plot(t * scale, smooth * 1e3, "--", color=ORANGE, linewidth=1.6, label=name)
    area.set_ylim(0, 1.12 * found.speed * 1e3)
    area.margins(x=0)
    area.set_xlabel(f"time since the start signal [{'s' if scale == 1.0 else 'ms'}]")
    area.set_ylabel("speed [mm/s]")
