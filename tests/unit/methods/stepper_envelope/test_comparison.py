from dataclasses import replace

import numpy as np
import pytest
from tests.unit.methods.stepper_envelope.samples import step_comparison

from detent import examples
from detent.methods.load import read_axis
from detent.methods.stepper_envelope.comparison import METHODS, compare_steps
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
    assert a.methods[0] == "envelope"
    assert all(len(row) == len(a.ways) for row in a.courses)
    assert a.to_dict()["methods"]["envelope"][0]["lost"] == 0


def test_times_are_those_of_the_specification(found):
    """Those of acceptance test 16."""
    a = found[0]
    envelope, constant = a.seconds(0), a.seconds(a.methods.index("start frequency"))
    assert envelope[:3] == pytest.approx([0.0841, 0.2089, 0.5839], abs=5e-4)
    assert constant == pytest.approx(np.array(a.ways) / 400, rel=1e-3)
    assert (constant[:3] / envelope[:3]).round(1).tolist() == [3.0, 6.0, 8.6]


def test_without_zones_recomputation_makes_the_same_motion(found):
    a = found[0]
    for name in ("A: braking distance per step", "B: speed per step"):
        recomputed = a.courses[a.methods.index(name)]
        for one, other in zip(a.courses[0][:3], recomputed[:3], strict=True):
            assert one.seconds == pytest.approx(other.seconds, abs=1 / 400)
            assert one.lost == other.lost == 0


def test_across_a_zone_recomputation_loses_steps_and_the_envelope_none(found):
    """Only the table knows of a zone ahead: a bare step of the frequency at its border loses steps (test 14)."""
    a = found[0]
    assert a.courses[0][-1].lost == 0
    assert a.courses[a.methods.index("B: speed per step")][-1].lost > 500


def test_the_largest_frequency_from_rest_loses_steps(found):
    assert all(course.lost > 0 for course in found[0].courses[-1])


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
    both = replace(one, courses=(one.courses[0], one.courses[2], *one.courses[2:]))
    assert "A and B jump" in told(both)


def test_the_table_of_the_terminal_says_the_same() -> None:
    title, heads, rows = step_comparison(zones_lose=-8).table
    assert title == "Motor x: time of a way, and steps lost (5 um a step)"
    assert heads == ("method", "100 steps", "2000 steps", "worked out per step")
    assert rows[0] == ("envelope (this method)", "80 ms", "600 ms", METHODS["envelope"][2])
    assert rows[2][1:3] == ("80 ms", "550 ms, 8 lost")
    assert rows[4] == ("constant largest frequency", "25 ms, 36 lost", "500 ms, 460 lost", "nothing")
