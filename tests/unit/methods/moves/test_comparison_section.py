import re
from dataclasses import replace

import numpy as np
from tests.page_reader import Reader
from tests.unit.methods.moves.samples import (
    feedback_comparison,
    filtered_report,
    noise_comparison,
    phase_report,
)

from detent.methods.moves.comparison_section import comparison_charts, comparison_section
from detent.methods.moves.page_data import ServoReportData


def read(report: ServoReportData) -> str:
    return Reader(comparison_section(report)).text


def cells_of(html: str) -> list[list[str]]:
    rows = re.findall(r"<tr>(.*?)</tr>", html, flags=re.DOTALL)
    return [[Reader(cell).text for cell in re.findall(r"<td.*?</td>", row, flags=re.DOTALL)] for row in rows]


def test_without_comparisons_there_is_no_section() -> None:
    alone = phase_report(noise=None, hold=None)
    assert comparison_section(alone) == ""
    assert comparison_charts(alone) == []


def test_noise_is_told_with_the_length_of_the_move_and_the_limit() -> None:
    text = read(phase_report(hold=None))
    assert "during a move of 6 pitches" in text
    assert "more than 24 pulses in one move" in text
    assert "Standing still" not in text
    assert "during a move of 1 pitch." in read(phase_report(noise=replace(noise_comparison(), pitches=1)))


def test_holding_is_told_with_what_came_of_each_case() -> None:
    html = comparison_section(phase_report(noise=None))
    text = Reader(html).text
    assert "A step is 10 µm. Swing at the end, peak to peak in steps: for ever 0.80, as is 0, D = 0 0.80." in text
    assert "for ever: what is <special> in for ever" in text
    assert "A force of 3 N pushes the carriage to the right after it has arrived." in text
    assert "in steps off the target: with it 0.70, without it 2." in text
    assert ["1", "30.0", "a force of 3 N pushes from now on"] in cells_of(html)
    assert ["2", "41.0", "stop: dead band and integrator take over"] in cells_of(html)
    assert "Noise on the pulse lines" not in text


def test_the_filter_is_told_with_how_much_quieter_it_is() -> None:
    text = read(filtered_report())
    assert "At a constant 1037 pulses per second" in text
    assert "the filtered drive word, 3 times quieter at the same following error." in text
    assert "(here 4 000 1/s²)" in text


def test_every_case_is_a_row_and_the_unstable_one_stands_out() -> None:
    html = comparison_section(filtered_report())
    rows = {row[0]: row[1:] for row in cells_of(html)[1:]}
    assert rows["<conventional>"] == ["5", "4", "–", "50", "1.80", "1.80", "−1.8 … 3.6", "3.60", "2", "× 4"]
    assert rows["with filter"] == ["5", "4", "0.250", "50", "0.600", "0.600", "−0.60 … 1.2", "1.20", "2", "× 2.50"]
    assert rows["long window"][:4] == ["20", "1", "–", "–"]
    assert rows["long window"][-2:] == ["never at rest", "× 0.685: unstable"]
    assert rows["small multiplier"][3] == "200"
    assert html.count('class="n over"') == 2


def test_a_case_that_failed_or_has_no_limit_is_told_in_words() -> None:
    found = feedback_comparison()
    without, with_filter, *others = found.cases
    gone = replace(with_filter, t=np.empty(0), std_error=float("nan"), std_speed=float("nan"), stable=False)
    endless = replace(without, gain_limit=float("inf"), gain_margin=float("inf"))
    html = comparison_section(filtered_report(feedback=replace(found, cases=(endless, gone, *others))))
    rows = {row[0]: row[1:] for row in cells_of(html)[1:]}
    assert rows["<conventional>"][-1] == "any"
    assert rows["with filter"][4:6] == ["–", "–"]
    assert "feedback-speed" not in Reader(html).ids


def test_charts_come_in_the_order_of_the_page() -> None:
    for report in (phase_report(), filtered_report()):
        drawn = [chart["id"] for chart in comparison_charts(report)]
        assert drawn == Reader(comparison_section(report)).ids
