from dataclasses import replace

import numpy as np
import pytest
from tests.unit.methods.stepper_envelope.samples import MM, jerk_comparison, step_comparison

from detent import examples
from detent.methods.load import read_axis
from detent.methods.stepper_envelope.comparison import (
    METHODS,
    JerkComparison,
    Profile,
    StepComparison,
    compare_jerk,
    compare_steps,
)
from detent.page.draw import plain

pytestmark = pytest.mark.compiled

ZOOM = next(path for path in examples() if path.name == "zoom.toml")


@pytest.fixture(scope="module")
def spec():
    return read_axis(ZOOM).spec


@pytest.fixture(scope="module")
def found(spec):
    return compare_steps(spec)


def test_each_motor_has_each_method_over_each_way(found):
    a, b = found
    assert (a.motor, a.ways) == ("group_a", (100, 500, 2000, 8000))
    assert (b.motor, b.ways) == ("group_b", (100, 500, 2000))
    assert list(a.courses) == list(METHODS)
    assert all(len(row) == len(a.ways) for row in a.courses.values())
    assert a.to_dict()["methods"]["envelope"][0]["lost"] == 0


def seconds(found: StepComparison, method: str) -> np.ndarray:
    return np.array([course.seconds for course in found.courses[method]])


def test_times_are_those_of_the_specification(found):
    """Those of acceptance test 16."""
    a = found[0]
    envelope, constant = seconds(a, "envelope"), seconds(a, "start frequency")
    assert envelope[:3] == pytest.approx([0.0841, 0.2089, 0.5839], abs=5e-4)
    assert constant == pytest.approx(np.array(a.ways) / 400, rel=1e-3)
    assert (constant[:3] / envelope[:3]).round(1).tolist() == [3.0, 6.0, 8.6]


def test_without_zones_recomputation_makes_the_same_motion(found):
    a = found[0]
    for name in ("A: braking distance per step", "B: speed per step"):
        recomputed = a.courses[name]
        for one, other in zip(a.courses["envelope"][:3], recomputed[:3], strict=True):
            assert one.seconds == pytest.approx(other.seconds, abs=1 / 400)
            assert one.lost == other.lost == 0


def test_across_a_zone_recomputation_loses_steps_and_the_envelope_none(found):
    """Only the table knows of a zone ahead: a bare step of the frequency at its border loses steps (test 14)."""
    a = found[0]
    assert a.courses["envelope"][-1].lost == 0
    assert a.courses["B: speed per step"][-1].lost > 500


def test_the_largest_frequency_from_rest_loses_steps(found):
    assert all(course.lost > 0 for course in found[0].courses["largest frequency"])


# ---- what is shown of it, made up


def cells_of(found) -> list[list[str]]:
    (figure,) = found.figures()
    return [[plain(cell.text) for cell, _ in figure.table.cells(row)] for row in figure.table.rows]


def test_every_method_has_its_times_its_lost_steps_and_its_cost() -> None:
    cells = cells_of(step_comparison())
    assert cells[0] == ["envelope (this method)", "80 ms", "600 ms", METHODS["envelope"][2]]
    assert cells[2][1:3] == ["80 ms", "550 ms"]
    assert cells[3] == ["constant start frequency", "240 ms", "5.40 s", "nothing"]
    assert cells[4] == ["constant largest frequency", "25 ms, 36 lost", "500 ms, 460 lost", "nothing"]
    (figure,) = step_comparison().figures()
    assert [plain(head) for head, _ in figure.table.heads[1:3]] == ["100 steps, 0.5 mm", "2 000 steps, 10 mm"]


def test_bars_compare_the_methods_over_one_way_and_lost_steps_are_marked() -> None:
    (figure,) = step_comparison().figures()
    bars = [[cell.bar for cell in row[1:3]] for row in figure.table.rows]
    assert bars[0] == pytest.approx([1 / 3, 1 / 9])
    assert bars[3] == [1.0, 1.0]
    assert [[cell.over for cell in row[1:3]] for row in figure.table.rows] == [[False, False]] * 4 + [[True, True]]


def test_who_loses_steps_is_told() -> None:
    def told(found):
        return found.figures()[0].caption

    found = step_comparison()
    assert "is 9.0 times as quick" in told(found)
    assert "jump" not in told(found)
    assert "on paper only" in told(found)
    one = step_comparison(zones_lose=960)
    assert "B jumps" in told(one)
    a, b = (name for name in METHODS if name[1] == ":")
    both = replace(one, courses=one.courses | {a: one.courses[b]})
    assert "A and B jump" in told(both)


def test_the_table_of_the_terminal_says_the_same() -> None:
    title, heads, rows = step_comparison(zones_lose=-8).table
    assert title == "Motor x: time of a way, and steps lost (5 um a step)"
    assert heads == ("method", "100 steps", "2000 steps", "worked out per step")
    assert rows[0] == ("envelope (this method)", "80 ms", "600 ms", METHODS["envelope"][2])
    assert rows[2][1:3] == ("80 ms", "550 ms, 8 lost")
    assert rows[4] == ("constant largest frequency", "25 ms, 36 lost", "500 ms, 460 lost", "nothing")


# ---- beside a profile of limited jerk


def test_both_profiles_go_the_same_way_within_the_same_limits(spec):
    found = compare_jerk(spec)
    assert found.motor == "group_a"
    assert found.way == pytest.approx(0.04)
    for profile in (found.envelope, found.smooth):
        assert (np.diff(profile.t) >= 0).all()
        assert profile.speed.max() <= found.speed * (1 + 1e-9)
    smooth, steps = found.smooth, found.envelope
    assert np.trapezoid(smooth.speed, smooth.t) == pytest.approx(found.way, rel=1e-5)
    assert np.sum(np.diff(steps.t) * steps.speed[:-1]) == pytest.approx(found.way, rel=1e-9)
    # 8000 steps without zones: 2.0839 s (acceptance test 2); the smooth one has to begin at standstill.
    assert found.envelope.seconds == pytest.approx(2.0837, abs=1e-3)
    assert found.envelope.seconds < found.smooth.seconds < 1.05 * found.envelope.seconds
    assert found.to_dict()["jerk"] == found.jerk


def test_the_smooth_profile_keeps_to_acceleration_and_jerk(spec):
    found = compare_jerk(spec, "group_b")
    t, speed = found.smooth.t, found.smooth.speed
    acceleration = np.diff(speed) / np.diff(t)
    assert np.abs(acceleration).max() <= found.acceleration * (1 + 1e-6)
    jerk = np.diff(acceleration) / np.diff(t)[1:]
    assert np.abs(jerk).max() <= found.jerk * (1 + 1e-6)


def charts_of(found: JerkComparison) -> list[dict]:
    return [chart for figure in found.figures() for chart in figure.charts]


def test_both_profiles_are_drawn_over_the_whole_way_and_both_ends() -> None:
    whole, begin, end = charts_of(jerk_comparison())
    assert (whole["x"][0], whole["x"][-1]) == (0.0, 2.1)
    assert whole["xLabel"] == "time since the start signal [s]"
    assert (begin["x"][0], begin["x"][-1]) == (0.0, pytest.approx(130.0))
    assert (end["x"][0], end["x"][-1]) == (pytest.approx(1970.0), 2100.0)
    assert whole["yRange"] == begin["yRange"] == end["yRange"] == [0.0, 23.0]
    assert [series["label"] for series in whole["series"]] == ["jerk limited", "envelope"]
    # The envelope begins with a step of its own, the profile at standstill.
    assert (begin["series"][1]["y"][0], begin["series"][0]["y"][0]) == (2.0, 0.0)


def test_a_profile_ends_with_its_last_point() -> None:
    *_, end = charts_of(jerk_comparison())
    smooth, envelope = (series["y"] for series in end["series"])
    assert smooth[-1] is not None
    assert envelope[-1] is None
    last = max(row for row, value in enumerate(envelope) if value is not None)
    assert end["x"][last] == pytest.approx(2080.0, abs=0.5)
    assert envelope[last] == 0.0


def test_steps_hold_and_profiles_change_evenly() -> None:
    found, t = jerk_comparison(), np.array([0.05, 1.0])
    assert found.smooth.at(t).tolist() == pytest.approx([10 * MM, 20 * MM])
    assert found.envelope.at(t).tolist() == pytest.approx([2 * MM, 20 * MM])


def test_a_short_way_is_magnified_to_its_half() -> None:
    t = np.array([0.0, 0.05, 0.1])
    short = Profile(t, np.array([0.0, 5 * MM, 0.0]))
    assert replace(jerk_comparison(), envelope=short, smooth=short).magnified == 0.05


def test_which_is_longer_and_by_how_much_is_told() -> None:
    found = jerk_comparison()
    whole, ends = found.figures()
    assert "0.96\u202f% longer" in whole.caption
    assert ends.beside
    swapped = replace(found, envelope=found.smooth, smooth=found.envelope)
    assert "0.95\u202f% shorter" in swapped.figures()[0].caption


def test_the_table_of_the_profiles_says_how_much_longer() -> None:
    title, heads, rows = jerk_comparison().table
    assert title == "Motor x: 40 mm without zones, limits 20 mm/s, 200 mm/s^2, 54.8 m/s^3"
    assert len(heads) == 4
    assert rows == [
        ("envelope", "2.08 s", "", "20 mm/s"),
        ("time-optimal, jerk limited (ruckig)", "2.1 s", "+20.0 ms, +1.0%", "20 mm/s"),
    ]
