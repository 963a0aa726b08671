"""The part of a servo axis's page that holds the method against its alternatives."""

from html import escape
from math import isfinite, isnan

from detent.methods.filtered_servo.comparison import FeedbackCase, FeedbackComparison
from detent.methods.moves import charts as servo_charts
from detent.methods.moves.page_data import ServoReportData
from detent.methods.moves.summary import length
from detent.methods.phase_servo.hold_comparison import HoldComparison
from detent.methods.phase_servo.noise_comparison import NoiseComparison
from detent.page.chart import Chart
from detent.page.page import ZOOM_HINT, chart_slot, event_table, figure, section
from detent.page.words import GAP, count, number, table


def comparison_charts(data: ServoReportData) -> list[Chart]:
    """Charts of the comparisons.

    Parameters
    ----------
    data : ServoReportData
        What to show.

    Returns
    -------
    list of dict
        In the order of the page.
    """
    drawn = [servo_charts.noise_chart(data.noise)] if data.noise else []
    if data.hold:
        drawn += servo_charts.hold_charts(data.hold)
    if data.feedback:
        drawn += servo_charts.feedback_charts(data.feedback)
    return drawn


def comparison_section(data: ServoReportData) -> str:
    """Figures of the comparisons under their title.

    Parameters
    ----------
    data : ServoReportData
        What to show.

    Returns
    -------
    str
        HTML; empty if there are none.
    """
    figures: list[str] = []
    if data.noise:
        figures.append(_noise_figure(data.noise))
    if data.hold:
        figures += [_still_figure(data.hold), _loaded_figure(data.hold)]
    if data.feedback:
        figures += [_feedback_figure(data.feedback), _cases_figure(data.feedback)]
    return section("What the method is worth on this axis", *figures)


def _noise_figure(found: NoiseComparison) -> str:
    caption = (
        f"Noise puts pulses on the counting lines during a move of {count(found.pitches, 'pitch', 'pitches')}. A servo "
        "that only counts stops as far off its target as pulses came, and keeps the error. This one stops on its "
        "target, because the phase of the resolver says where that is. Its limit: more than "
        f"{count(found.margin, 'pulse')} in one move, and it stops exactly one pitch off."
    )
    slot = chart_slot("noise", "Rest point against pulses put in, of this servo and of the purely incremental one")
    return figure("Noise on the pulse lines: where the axis comes to rest", caption, slot)


def _still_figure(found: HoldComparison) -> str:
    swings = [f"{escape(case.name)} {number(round(case.swing, 2), 2)}" for case in found.still]
    caption = (
        "A digital servo that never reads zero swings for ever from one step to the next. Here a dead band opens a "
        f"moment after the arrival, and an integrator works outside it. A step is {length(found.step)}. "
        f"Swing at the end, peak to peak in steps: {', '.join(swings)}."
    )
    content = "".join(
        f'<p class="chart-title">{escape(case.name)}: {escape(case.about)}</p>'
        + chart_slot(f"still-{index}", f"Displacement over time, {case.name}")
        for index, case in enumerate(found.still)
    )
    return figure("Standing still", caption, content, ZOOM_HINT)


def _loaded_figure(found: HoldComparison) -> str:
    rests = [f"{escape(case.name)} {number(round(case.rest, 2), 2)}" for case in found.loaded]
    caption = (
        f"A force of {number(found.push)}{GAP}N pushes the carriage to the right after it has arrived. The error alone "
        "makes too little drive to push back; the integral counts up until the motor holds the force. "
        f"Where it stands at the end, in steps off the target: {', '.join(rests)}."
    )
    content = chart_slot("loaded-place", "Displacement over time under load") + chart_slot(
        "loaded-integral", "Integral over time under load"
    )
    return figure("Under load", caption, content, ZOOM_HINT + event_table(servo_charts.hold_events(found)))


def _feedback_figure(found: FeedbackComparison) -> str:
    if not servo_charts.feedback_charts(found):
        return ""
    without, with_filter = found.cases[:2]
    quieter = f", {number(without.std_error / with_filter.std_error, 2)} times quieter" if with_filter.std_error else ""
    caption = (
        f"At a constant {number(found.rate, 4)} pulses per second the counted speed cannot be a whole number: it jumps "
        "between two, and without a filter every jump, times B, reaches the motor. Look for: the filtered drive word"
        f"{quieter} at the same following error."
    )
    content = chart_slot("feedback-speed", "Speed word over time, with and without the filter") + chart_slot(
        "feedback-drive", "Drive word over time, with and without the filter"
    )
    return figure("Drive at constant speed, with and without the filter", caption, content, ZOOM_HINT)


def _cases_figure(found: FeedbackComparison) -> str:
    heads = [("", False), ("TS [ms]", True), ("B", True), ("A", True), ("KV [1/s]", True),
             ("speed word, std [pulse]", True), ("drive word, std [count]", True), ("drive word, from \u2026 to", True),
             ("force ripple, std [N]", True), ("overshoot at stop [pulse]", True), ("gain margin", True)]  # fmt: skip
    caption = (
        "The ways to quieten a counted speed, all on this axis. A longer window delays and may not be stable; a "
        "smaller multiplier takes the damping. KV is speed over following error; the last column says by how much the "
        f"loop's gain (here {count(round(found.gain))}{GAP}1/s²) could grow before it oscillates, after the exact "
        "sampled model."
    )
    return figure("The filter and its alternatives", caption, table(heads, [_case_row(case) for case in found.cases]))


def _case_row(case: FeedbackCase) -> list[str]:
    low, high = case.error_range
    unstable = f'<td class="n over">{_margin(case)}: unstable</td>'
    overshoot = '<td class="n over">never at rest</td>' if isnan(case.stop_overshoot) else number(case.stop_overshoot)
    return [
        f'<td class="nowrap"><b>{escape(case.name)}</b></td>',
        number(case.sample_period * 1e3),
        number(case.scale),
        "\u2013" if case.coefficient == 1 else number(case.coefficient),
        number(case.kv) if case.stable else "\u2013",
        number(case.std_speed),
        number(case.std_error),
        f"{number(low, 2)} \u2026 {number(high, 2)}",
        number(case.force_ripple),
        overshoot,
        _margin(case) if case.stable else unstable,
    ]


def _margin(case: FeedbackCase) -> str:
    return f"× {number(case.gain_margin)}" if isfinite(case.gain_margin) else "any"
