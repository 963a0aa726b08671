"""The controller at its end of the lines: edges and columns in order of time, outputs, and the mailbox."""

import pytest
from tests.print_head_rig import Rig

from detent.control.column_timer import COLUMNS, NEVER
from detent.methods.print_head.controller import (
    PERIOD_US,
    control,
    ink_columns,
    load_line,
    power_on,
    read_status,
    write_command,
)

RIGHTWARD = (1, 3, 2, 0)


@pytest.fixture
def rig():
    """At rest in quarter 0 of emitter 1000, with a line of three columns in its buffer."""
    found = Rig().pretend_identified()
    power_on(found.p.controller, found.r.controller, 0, 1, 0, 0)
    found.head.homed, found.head.width, found.head.state, found.head.emitter = 1, 4350, 3, 1000
    return found


def period(rig, *edges):
    """One period in which these edges came: (microsecond, levels)."""
    lines = rig.r.lines
    lines.edges = len(edges)
    for k, (when, levels) in enumerate(edges):
        lines.when_us[k], lines.levels[k] = when, levels
    control(rig.p.controller, rig.r.controller, lines)
    return lines


def test_a_cycle_of_edges_is_an_emitter_at_the_time_of_its_edge(rig):
    now = rig.head.now_us
    period(rig, (3, 3), (13, 2), (23, 0), (33, 1))
    assert rig.head.now_us == now + PERIOD_US
    assert rig.r.controller.quadrature.count == 4
    assert rig.head.emitter == 1001
    assert rig.head.last_emitter_us == now + 33
    period(rig, (20, 0))
    assert rig.head.emitter == 1000


@pytest.mark.parametrize(("due", "at_the_emitter"), [(32, 1), (33, 1), (34, 0)])
def test_a_column_is_fired_before_the_edge_that_comes_with_it(rig, due, at_the_emitter):
    """A column that is due until the emitter comes is done when it does, so that the emitter can time the next one."""
    load_line(rig.r.controller, 0, [range(5, 8)])
    columns = rig.head.columns
    columns.bank, columns.active, columns.column, columns.end_column = 0, 1, 5, 7
    columns.fire_us = rig.head.now_us + due
    rig.head.direction, rig.head.emitter_seen, rig.head.last_step = 1, 1, 1
    rig.head.last_emitter_us = rig.head.now_us - 200
    # Column 6 lies half an emitter behind the edge that is to come.
    rig.p.controller.columns.column_zero = 1001 * 256 - 6 * 640
    lines = period(rig, (3, 3), (13, 2), (23, 0), (33, 1))
    assert (lines.fired, lines.fired_us[0], lines.place[0]) == (1, due, 5)
    assert columns.column == 6
    assert (columns.fire_us != NEVER) == at_the_emitter


def test_a_column_of_the_other_bank_has_its_place_behind_the_first(rig):
    load_line(rig.r.controller, 1, [range(5, 6)])
    columns = rig.head.columns
    columns.bank, columns.active, columns.column, columns.end_column = 1, 1, 5, 5
    columns.fire_us = rig.head.now_us
    lines = period(rig)
    assert (lines.fired, lines.fired_us[0], lines.place[0]) == (1, 0, COLUMNS + 5)
    assert not columns.active
    assert period(rig).fired == 0


def test_a_loaded_line_replaces_the_one_before(rig):
    c = rig.r.controller
    load_line(c, 1, [range(3), range(2040, COLUMNS)])
    load_line(c, 0, [range(7, 9)])
    load_line(c, 1, [range(4, 6)])
    assert [k for k, ink in enumerate(c.head.buffer.ink) if ink] == [7, 8, COLUMNS + 4, COLUMNS + 5]


def test_columns_beyond_the_bank_are_left_alone(rig):
    ink = rig.r.controller.head.buffer.ink
    load_line(rig.r.controller, 0, [])
    load_line(rig.r.controller, 1, [])
    ink_columns(rig.r.controller, 0, COLUMNS - 2, COLUMNS + 5, 1)
    assert [k for k in range(2 * COLUMNS) if ink[k]] == [COLUMNS - 2, COLUMNS - 1]


def test_a_command_byte_drives_the_lines_in_the_same_period(rig):
    for byte in (0x92, 0x0B, 0xB8):
        write_command(rig.r.controller, byte)
        lines = period(rig)
        if byte != 0xB8:
            assert rig.head.status.latch.flag
            assert read_status(rig.r.controller) == 0xFF
    assert (lines.count, lines.right_left, lines.transition) == (32 + 96, 1, 0)
