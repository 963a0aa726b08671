import re
from dataclasses import replace

from tests.page_reader import Reader
from tests.unit.methods.stepper_envelope.samples import jerk_comparison, stage_data, step_comparison

from detent.methods.stepper_envelope.comparison_section import comparison_charts, comparison_section


def read(**changes: object) -> str:
    return Reader(comparison_section(stage_data(**changes))).text


def cells_of(html: str) -> list[list[str]]:
    rows = re.findall(r"<tr>(.*?)</tr>", html, flags=re.DOTALL)
    return [[Reader(cell).text for cell in re.findall(r"<td.*?</td>", row, flags=re.DOTALL)] for row in rows]


def test_every_method_has_its_times_its_lost_steps_and_its_cost() -> None:
    html = comparison_section(stage_data(steps=[step_comparison()], jerk=None))
    cells = cells_of(html)
    assert ["envelope (this method)", "80 ms", "600 ms", "1 table read, 1 comparison, at most 1 increment"] in cells
    assert ["B: speed per step", "80 ms", "550 ms", "1 square root, 1 multiplication"] in cells
    assert ["constant start frequency", "240 ms", "5.40 s", "nothing"] in cells
    assert ["constant largest frequency", "25 ms36 lost", "500 ms460 lost", "nothing"] in cells
    heads = [Reader(one).text for one in re.findall(r"<th .*?</th>", html)]
    assert heads[1:3] == ["100 steps, 0.5 mm", "2 000 steps, 10 mm"]
    assert html.count('class="n over"') == 2


def test_bars_compare_the_methods_over_one_way() -> None:
    html = comparison_section(stage_data(steps=[step_comparison()], jerk=None))
    widths = [int(width) for width in re.findall(r'class="bar" style="width:(\d+)px"', html)]
    assert widths[:2] == [16, 5]  # a third of the longest, and a ninth
    assert widths[6:8] == [48, 48]


def test_the_words_say_what_it_is_worth_and_who_loses_steps() -> None:
    text = read(steps=[step_comparison()], jerk=None)
    assert "On the longest way it is 9.0 times as quick as the constant start frequency." in text
    assert "The largest frequency from rest is quicker on paper only: the rotor is left behind." in text
    assert "cannot follow" not in text
    text = read(steps=[step_comparison(zones_lose=960)], jerk=None)
    assert "B jumps from one speed to the other where a zone begins" in text
    both = step_comparison(zones_lose=960)
    courses = (both.courses[0], both.courses[2], *both.courses[2:])
    assert "A and B jump from one speed" in read(steps=[replace(both, courses=courses)], jerk=None)


def test_without_the_naive_methods_nothing_is_said_of_them() -> None:
    found = step_comparison()
    some = replace(found, methods=found.methods[:3], courses=found.courses[:3])
    text = read(steps=[some], jerk=None)
    assert "start frequency" not in text
    assert "on paper only" not in text


def test_the_methods_are_explained_once() -> None:
    assert read().count("A and B reckon from the distance to the extremes") == 1
    assert read(jerk=None).count("On the longest way") == 2


def test_the_profile_is_told_with_its_limits_and_times() -> None:
    text = read(steps=[])
    assert "40 mm of motor x without zones, with the same largest speed (20 mm/s) and acceleration (0.2 m/s²)" in text
    assert "the envelope takes 2.08 s, the time-optimal profile of limited jerk (54.8 m/s³, by ruckig) 2.10 s" in text
    assert "0.96 % longer" in text
    found = jerk_comparison()
    swapped = replace(found, envelope=found.smooth, smooth=found.envelope)
    assert "0.95 % shorter" in read(steps=[], jerk=swapped)
    assert "The first 130 ms" in text
    assert "The last 130 ms" in text


def test_charts_are_drawn_for_what_there_is() -> None:
    assert [chart["id"] for chart in comparison_charts(stage_data())] == ["jerk-whole", "jerk-begin", "jerk-end"]
    assert comparison_charts(stage_data(jerk=None)) == []
    assert comparison_section(stage_data(steps=(), jerk=None)) == ""
