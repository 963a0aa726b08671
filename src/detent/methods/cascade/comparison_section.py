"""One move with other profiles, with and without feed-forward: a part of the page, a figure, a table of text."""

import math
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from detent.methods.cascade.charts import profile_charts
from detent.methods.cascade.comparison import FEEDS, SHAPES, ProfileCase, ProfileComparison
from detent.methods.cascade.units import Units
from detent.page.chart import Chart
from detent.page.page import ZOOM_HINT, chart_slot, figure, section
from detent.page.plot_looks import ABOVE, BLUE, GREY, ORANGE, POINTS
from detent.page.plots import check_figure_path, new_figure
from detent.page.thin import thin_indices
from detent.page.words import GAP, bar_cell, number, table

# matplotlib's stubs leave every **kwargs untyped, so that strict checking would refuse each call.
Axes = Any


def comparison_charts(found: ProfileComparison | None) -> list[Chart]:
    """Charts of the comparison; none without one."""
    return profile_charts(found) if found else []


def comparison_section(found: ProfileComparison | None) -> str:
    """Figures of the comparison under their title."""
    if not found:
        return ""
    return section("What profile and feed-forward are worth on this axis", _curves(found), _figures(found))


def _curves(found: ProfileComparison) -> str:
    units = Units(rotary=found.rotary)
    jerk = "the jerk of the axis file" if found.stated else "a jerk chosen for it, as the axis file states none"
    caption = (
        f"A move of {_way(found)} at {units.speed_text(found.speed)} in four ways: as a trapezoid of the speed "
        f"and with {jerk}, each without feed-forward (dashed) and with it. Look for: without feed-forward the axis "
        "lags in proportion to its speed, whatever the profile; with it an error is left where the acceleration jumps."
    )
    content = chart_slot("profile-speed", "Speed of both references over time") + chart_slot(
        "profile-following", "Following error of the four cases over time"
    )
    curves = figure("The same move in four ways", caption, content, ZOOM_HINT)
    if math.isnan(found.frequency):
        return curves
    caption = (
        f"How far the motor is ahead of the load once the reference has ended. Against a motor that its loop holds the "
        f"load swings at {number(found.frequency)}{GAP}Hz. Look for: the swing that a jump of the acceleration leaves "
        "behind, and what a ramp of about a swing's length makes of it. Without feed-forward (dashed) the axis still "
        "brakes when its reference has ended."
    )
    slot = chart_slot("profile-twist", "Twist of the coupling over time since the reference ended")
    return curves + "\n" + figure("What is left swinging", caption, slot, ZOOM_HINT)


def _way(found: ProfileComparison) -> str:
    scale = Units(rotary=found.rotary).place
    return f"{number(round(found.way * scale.factor, 6))}{GAP}{scale.name}"


def _figures(found: ProfileComparison) -> str:
    units = Units(rotary=found.rotary)
    lag = units.small(max(case.peak_following for case in found.cases))
    heads = [("profile", False), ("takes [ms]", True), (f"largest following error [{lag.name}]", True),
             ("settles after [ms]", True), ("twist after it", True), ("peak command [V]", True)]  # fmt: skip
    longest = max(case.peak_following for case in found.cases) * lag.factor or 1.0
    rows = [
        [
            f'<td class="nowrap">{escape(case.name)}</td>',
            number(round(case.duration * 1e3, 6)),
            bar_cell(case.peak_following * lag.factor, longest),
            number(round(case.settling * 1e3, 6)),
            units.error(case.twist_after),
            number(case.peak_command),
        ]
        for case in found.cases
    ]
    caption = (
        f"Settling counts from the end of the reference until the load stays within {units.error(found.tolerance)} of "
        "the target. Twist after it is that of the coupling after that end, peak to peak."
    )
    return figure("In figures", caption, table(heads, rows))


# ---- as a file


def plot_profiles(found: ProfileComparison, path: str | Path) -> None:
    """Draw following error and twist of the four cases."""
    path = check_figure_path(path)
    units, rigid = Units(rotary=found.rotary), math.isnan(found.frequency)
    with new_figure(path, 9.5, 6.6 if rigid else 9.8) as drawn:
        areas = drawn.subplots(2 if rigid else 3, 1)
        _draw_speed(areas[0], found, units)
        _draw_following(areas[1], found, units)
        if not rigid:
            _draw_twist(areas[2], found, units)
        drawn.align_ylabels(areas)


def _draw_speed(area: Axes, found: ProfileComparison, units: Units) -> None:
    for case, colour in ((found.cases[0], ORANGE), (found.cases[2], BLUE)):
        label = f"{case.shape}: {number(round(case.duration * 1e3, 6))} ms"
        area.plot(1e3 * case.t, case.speed * units.speed.factor, color=colour, linewidth=1.6, label=label)
    area.set_ylabel(f"speed [{units.speed.name}]")
    area.set_title(f"A move of {_way(found).replace(GAP, ' ')} in four ways", pad=24)
    area.legend(**ABOVE, ncols=2)
    area.margins(x=0)


def _look(case: ProfileCase) -> dict[str, Any]:
    """Colour by profile, dashes without feed-forward."""
    colour = ORANGE if case.shape == SHAPES[0] else BLUE
    return {"color": colour, "linestyle": "--" if case.feed == FEEDS[0] else "-", "linewidth": 1.4}


def _draw_following(area: Axes, found: ProfileComparison, units: Units) -> None:
    scale = units.small(max(case.peak_following for case in found.cases))
    for case in found.cases:
        kept = thin_indices(case.following, POINTS)
        label = f"{case.name}: {units.error(case.peak_following).replace(GAP, ' ')}"
        area.plot(1e3 * case.t[kept], case.following[kept] * scale.factor, **_look(case), label=label)
    area.axhline(0, color=GREY, linewidth=0.8)
    area.set_ylabel(f"following error\n[{scale.name}]")
    area.set_xlabel("time since the move began [ms]")
    area.set_title("Following error, the largest of each", fontsize=10, pad=34)
    area.legend(**ABOVE, ncols=2)
    area.margins(x=0)


def _draw_twist(area: Axes, found: ProfileComparison, units: Units) -> None:
    shown = 10 / found.frequency
    parts = [(case, (case.t >= case.duration) & (case.t <= case.duration + shown)) for case in found.cases]
    peak = max(float(np.abs(case.twist[part]).max(initial=0.0)) for case, part in parts)
    scale = units.small(peak)
    for case, part in parts:
        label = f"{case.name}: {units.error(case.twist_after).replace(GAP, ' ')}"
        area.plot(1e3 * (case.t[part] - case.duration), case.twist[part] * scale.factor, **_look(case), label=label)
    area.set_ylabel(f"twist of the\ncoupling [{scale.name}]")
    area.set_xlabel("time since the reference ended [ms]")
    area.set_title("Motor ahead of the load after the end, peak to peak", fontsize=10, pad=34)
    area.legend(**ABOVE, ncols=2)
    area.margins(x=0)


# ---- in the terminal


def profiles_table(found: ProfileComparison) -> tuple[str, tuple[str, ...], list[tuple[str, ...]]]:
    """The comparison as a table for the terminal."""
    units = Units(rotary=found.rotary)
    heads = ("profile", "takes", "largest following error", "settles after", "twist after that", "peak command")
    rows = [
        (
            case.name,
            f"{number(round(case.duration * 1e3, 6))} ms",
            units.error(case.peak_following),
            "not" if math.isnan(case.settling) else f"{number(round(case.settling * 1e3, 6))} ms",
            "rigid" if math.isnan(case.twist_after) else units.error(case.twist_after),
            f"{number(case.peak_command)} V",
        )
        for case in found.cases
    ]
    title = f"A move of {_way(found)} at {units.speed_text(found.speed)}, in four ways".replace(GAP, " ")
    return title, heads, [tuple(cell.replace(GAP, " ") for cell in row) for row in rows]
