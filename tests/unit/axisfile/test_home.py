"""What a file says of homing: defaults that stay inside the travel, and a key for each register."""

import math

import pytest

from detent.axisfile.blocks import fill_marks, homing_params
from detent.axisfile.tables import FARTHEST_BACK, HomeTable, InnerHomeTable
from detent.sensing.home_marks import HomeMarksParams

ENDS, SPEED, TURN = (0.0, 1.0), 0.5, 0.01


def completed(table, **keys):
    return table(**{"by": "switch"} | keys).completed(ENDS, SPEED, TURN)


@pytest.mark.parametrize(
    ("by", "direction", "place"),
    [("switch", "negative", 0.02), ("switch", "positive", 0.98), ("index", "negative", 0.024),
     ("index", "positive", 0.976), ("contact", "negative", 0.0), ("contact", "positive", 1.0)],
)  # fmt: skip
def test_between_frames_a_reference_lies_where_it_can_be_passed(by, direction, place):
    assert completed(InnerHomeTable, by=by, direction=direction).position == pytest.approx(place)
    assert completed(HomeTable, by=by, direction=direction).position == pytest.approx(float(place > 0.5))


def test_a_travel_of_kilometres_derives_a_way_back_that_the_key_may_have():
    """A fiftieth of it was more than the file could be written with and read again."""
    made = HomeTable(by="switch").completed((0.0, 60e3), SPEED, TURN)
    assert made.back_off == FARTHEST_BACK
    HomeTable.model_validate({"by": "switch", "back_off": f"{made.back_off} m"})


def test_what_is_stated_stays():
    made = completed(InnerHomeTable, position="0.3 m", back_off="5 mm", edge_to_index="1 mm", speed="0.1 m/s")
    assert (made.position, made.back_off, made.edge_to_index, made.speed) == (0.3, 0.005, 0.001, 0.1)
    assert made.creep == pytest.approx(0.01)


@pytest.mark.parametrize("by", ["switch", "index"])
def test_marks_of_the_machine_lie_where_the_file_says(by):
    p, made = HomeMarksParams(), completed(InnerHomeTable, by=by)
    fill_marks(p, made, TURN)
    assert p.present == 1
    assert (p.side, p.edge) == (-1.0, pytest.approx(0.02))
    assert p.pitch == (TURN if by == "index" else 0.0)


def test_each_key_is_a_parameter_of_the_search():
    made = completed(HomeTable, by="index", direction="positive", position="0.9 m")
    p = homing_params(made, travel=1.0, pitch=TURN, count=1e-5, look=1e-3, pressed=0.04)
    assert (p.way, p.side, p.place, p.speed, p.creep) == (2, 1.0, 0.9, made.speed, made.creep)
    assert (p.back, p.longest, p.pitch) == (made.back_off, 1.2 + made.back_off, pytest.approx(1.2 * TURN))
    assert (p.lag, p.still) == (1e-4, 40)
    assert not math.isnan(p.grain + p.slack)
