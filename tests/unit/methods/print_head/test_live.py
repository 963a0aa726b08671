"""What the host makes of a job; what the loop does with it is among the acceptance tests."""

import pytest
from tests.print_head_rig import make_spec

from detent.control import operation as ops
from detent.control.column_timer import COLUMNS
from detent.control.operation import OperationParams
from detent.errors import AxisError
from detent.methods.print_head.live import HEAD, PIECE, PIECES, HeadWork, live
from detent.methods.print_head.print_job import parse_text


def operation(look, window, limits, *motions):
    assert window < look  # in every tick
    return OperationParams(lowest=limits[0], highest=limits[1], takes=sum(1 << kind for kind in motions))


@pytest.fixture
def axis():
    made = live(make_spec(), operation)[""]
    head = made.state.controller.head
    head.homed, head.width, head.emitter = 1, 4350, 2000
    return made


def test_a_head_takes_jobs_and_no_numbers(axis):
    takes = axis.live.operation.takes
    assert [kind for kind in ops.COMMANDS if takes >> kind & 1] == [
        ops.MOVE_TO,
        ops.MOVE_BY,
        ops.JOG,
        ops.HOME,
        ops.JOB,
        ops.FEED,
    ]
    assert axis.tray.shape == (PIECES, PIECE)
    axis.tray[1, 3] = 7
    assert axis.memory.tray[PIECE + 3] == 7


def test_a_piece_is_the_commands_of_a_line_and_its_columns(axis):
    work = HeadWork(make_spec(), axis, parse_text("detent\n\nhead\nprint"))
    assert work.pieces == 3
    first, second = work.piece(), work.piece()
    assert first is not None
    assert second is not None
    assert work.piece() is None  # the line buffer has two banks
    commands = first[1 : 1 + first[0]]
    assert commands[-6] == 0x8D
    assert len(first) == PIECE
    ink = first[HEAD:]
    assert len(ink) == COLUMNS
    assert 30 < sum(ink) < 80
    axis.memory.done = 1
    axis.state.plant.paper.landed[COLUMNS : 2 * COLUMNS] = [5] * COLUMNS  # the first line prints from bank 1
    axis.state.controller.head.buffer.ink[COLUMNS + 1] = 1
    assert work.piece() is not None
    (line,) = work.result().lines
    assert (line.columns, line.missed) == (1, 0)
    assert line.worst_error == pytest.approx(5e-9)
    assert not work.result().done


def test_what_went_wrong_is_told_with_its_line(axis):
    work = HeadWork(make_spec(), axis, parse_text("detent\n\nhead"))
    axis.memory.code = 0x02
    assert "line 1" in work.result().failure
    assert "out of range" in work.result().failure


def test_without_frames_there_is_nothing_to_plan_in(axis):
    axis.state.controller.head.homed = 0
    with pytest.raises(AxisError, match="not calibrated"):
        HeadWork(make_spec(), axis, parse_text("detent"))
