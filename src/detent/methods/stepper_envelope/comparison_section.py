"""The part of a stage's page that holds the method against its alternatives."""

from html import escape

from detent.methods.stepper_envelope.comparison import Course, JerkComparison, StepComparison
from detent.methods.stepper_envelope.page_data import StageReportData
from detent.methods.stepper_envelope.stage_figures import METHOD_COSTS, method_name
from detent.methods.stepper_envelope.stage_jerk import jerk_charts, magnified
from detent.methods.stepper_envelope.summary import stated
from detent.page.chart import Chart
from detent.page.page import ZOOM_HINT, chart_slot, figure, section, side_by_side
from detent.page.words import GAP, count, duration, number, table

LONGEST_BAR = 48
"""As of `detent.page.words.bar_cell` [px]."""

STEPS_CAPTION = (
    "The same motor over several ways from its lower end, with its rotor simulated. A and B reckon from the distance "
    "to the extremes how fast every step may be; the envelope looks it up, and is as quick as they are where they lose "
    "no step. "
)
"""Stands at the first motor only."""


def comparison_charts(data: StageReportData) -> list[Chart]:
    """Charts of the comparisons."""
    return jerk_charts(data.jerk) if data.jerk else []


def comparison_section(data: StageReportData) -> str:
    """Figures of the comparisons under their title."""
    figures = [_steps_figure(found, first=k == 0) for k, found in enumerate(data.steps)]
    if data.jerk:
        figures.append(_jerk_figure(data.jerk))
    return section("What the method is worth on this axis", *figures)


# ---- methods that decide step by step


def _steps_figure(found: StepComparison, *, first: bool) -> str:
    heads = [("", False), *((_way(found, way), True) for way in found.ways), ("worked out before every step", False)]
    rows = [
        [
            f"<b>{escape(method_name(method))}</b>",
            *(_course_cell(found, k, course) for k, course in enumerate(courses)),
            escape(METHOD_COSTS.get(method, "")),
        ]
        for method, courses in zip(found.methods, found.courses, strict=True)
    ]
    caption = (STEPS_CAPTION if first else "") + _worth(found) + _losers(found)
    return figure(f"Motor {found.motor}: time of a way, and steps lost", caption, table(heads, rows))


def _way(found: StepComparison, way: int) -> str:
    return f"{count(way, 'step')}, {stated(way * found.step * 1e3)}{GAP}mm"


def _course_cell(found: StepComparison, way: int, course: Course) -> str:
    """Time with a bar that compares it with the other methods, and the steps lost."""
    longest = max(courses[way].seconds for courses in found.courses)
    bar = f'<span class="bar" style="width:{LONGEST_BAR * course.seconds / longest:.0f}px"></span>'
    text = f"{bar}{_time(course.seconds)}"
    if course.lost:
        return f'<td class="n over">{text}<br>{count(abs(course.lost))} lost</td>'
    return f'<td class="n">{text}</td>'


def _time(seconds: float) -> str:
    return f"{number(seconds * 1e3)}{GAP}ms" if seconds < 1 else duration(seconds)


def _worth(found: StepComparison) -> str:
    """What the envelope saves over the start frequency on the longest way."""
    if "start frequency" not in found.methods:
        return ""
    constant = found.courses[found.methods.index("start frequency")][-1].seconds
    times = number(constant / found.courses[0][-1].seconds, 2)
    return f"On the longest way it is {times} times as quick as the constant start frequency. "


def _losers(found: StepComparison) -> str:
    """Which methods lose steps, and why."""
    lost = {
        method: max(abs(course.lost) for course in courses)
        for method, courses in zip(found.methods, found.courses, strict=True)
    }
    recomputed = [method[:1] for method in lost if method[:2] in {"A:", "B:"} and lost[method]]
    text = ""
    if recomputed:
        names = " and ".join(recomputed)
        text += (
            f"{names} jump{'' if len(recomputed) > 1 else 's'} from one speed to the other where a zone begins or "
            "torque falls, which the rotor cannot follow: steps are lost. "
        )
    if lost.get("largest frequency"):
        text += "The largest frequency from rest is quicker on paper only: the rotor is left behind."
    return text


# ---- limited jerk


def _jerk_figure(found: JerkComparison) -> str:
    envelope, smooth = found.envelope.seconds, found.smooth.seconds
    more = 100 * (smooth / envelope - 1)
    quicker = f"{number(abs(more), 2)}{GAP}% {'longer' if more >= 0 else 'shorter'}"
    caption = (
        f"{stated(found.way * 1e3)}{GAP}mm of motor {escape(found.motor)} without zones, with the same largest speed "
        f"({stated(found.speed * 1e3)}{GAP}mm/s) and acceleration ({stated(found.acceleration)}{GAP}m/s²): the "
        f"envelope takes {_time(envelope)}, the time-optimal profile of limited jerk "
        f"({number(found.jerk)}{GAP}m/s³, by ruckig) {_time(smooth)}, {quicker}. A stepper may begin and end at its "
        "start frequency at once; the profile begins at standstill. Near the top the envelope spares acceleration "
        "where the torque falls; of that the profile knows nothing."
    )
    ends = f"{number(magnified(found) * 1e3, 2)}{GAP}ms"
    content = chart_slot("jerk-whole", "Speed over time of both profiles, the whole way") + side_by_side(
        {
            f"The first {ends}": chart_slot("jerk-begin", "Speed over time at the beginning"),
            f"The last {ends}": chart_slot("jerk-end", "Speed over time at the end"),
        }
    )
    return figure("The envelope beside a jerk-limited time-optimal profile", caption, content, ZOOM_HINT)
