"""The machine at its end of the lines: edges with their times, and where fired columns land."""

from itertools import pairwise

import pytest
from tests.print_head_rig import EMITTER, Rig

from detent.control.column_timer import COLUMNS
from detent.methods.print_head.controller import EDGES, PERIOD_US
from detent.methods.print_head.plant import Paper, PaperParams, land, observe, sense

EDGE = EMITTER / 4
SEQUENCE = (1, 3, 2, 0)
"""Levels of the channels moving right, A in bit 0."""


@pytest.fixture
def rig():
    return Rig(start=1000.125 * EMITTER)


def carried(rig, way):
    """The lines after a period in which the carriage went so far [m]."""
    train = rig.r.plant.train
    train.position += way
    sense(rig.p.plant, rig.r.plant, train, rig.r.lines)
    observe(rig.p.plant, rig.r.plant, train, rig.r.lines)
    return rig.r.lines


@pytest.mark.parametrize("direction", [1, -1])
def test_edges_come_in_their_order_at_the_share_of_the_way(rig, direction):
    lines = carried(rig, direction * 4 * EDGE)
    assert lines.edges == 4
    assert list(lines.when_us[:4]) == pytest.approx([5, 15, 25, 35], abs=1)
    order = SEQUENCE[::direction]
    first = order.index(lines.levels[0])
    assert [lines.levels[k] for k in range(4)] == [order[(first + k) % 4] for k in range(4)]


def test_a_carriage_at_rest_gives_no_edge(rig):
    assert carried(rig, 3 * EDGE).edges == 3
    assert carried(rig, 0.0).edges == 0


@pytest.mark.parametrize("edges", [EDGES, EDGES + 1, EDGES + 6, 3 * EDGES])
def test_more_edges_than_the_lines_carry_lose_whole_cycles(rig, edges):
    lines = carried(rig, edges * EDGE)
    assert lines.edges <= EDGES
    assert (edges - lines.edges) % 4 == 0
    assert edges - lines.edges < 4 or edges > EDGES
    levels = list(lines.levels[: lines.edges])
    turn = SEQUENCE * 2
    assert all(turn[turn.index(a) + 1] == b for a, b in pairwise(levels))
    assert levels[-1] == rig.r.plant.encoder.channel_a | rig.r.plant.encoder.channel_b << 1


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("place", [4, COLUMNS + 8])
def test_a_fired_column_lands_after_its_flight(direction, place):
    p = PaperParams(column_zero=100 * 256, column_pitch=640, flight_time=350e-6, metres_per_unit=EMITTER / 256)
    paper, speed = Paper(), 0.5 * direction
    land(p, paper, place, (100 + 2.5 * (place % COLUMNS)) * EMITTER - speed * 350e-6 + 5e-6, speed)
    assert paper.offset == pytest.approx(5e-6)
    assert paper.landed[place] == pytest.approx(5000, abs=1)
    assert sum(map(bool, paper.landed)) == 1


def test_a_column_is_struck_where_the_carriage_was_when_it_was_fired(rig):
    lines, p = rig.r.lines, rig.p.plant.paper
    lines.fired, lines.fired_us[0], lines.place[0] = 1, PERIOD_US // 4, 7
    carried(rig, 4 * EDGE)
    wanted = (p.column_zero + 7 * p.column_pitch) * p.metres_per_unit
    assert rig.r.plant.paper.offset == pytest.approx(1000.125 * EMITTER + EDGE - wanted, abs=1e-12)
