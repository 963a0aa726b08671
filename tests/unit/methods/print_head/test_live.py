"""What the host makes of a job; what the loop does with it is among the acceptance tests."""

from itertools import pairwise
from typing import Any

import pytest
from tests.acceptance.test_golden_bits import EXAMPLES
from tests.live_axes import Head
from tests.print_head_rig import make_spec

from detent.control import operation as ops
from detent.control.column_timer import COLUMNS
from detent.control.operation import ABORTED, DONE, REFERENCED, OperationParams
from detent.errors import AxisError
from detent.methods.print_head.live import HEAD, PIECE, PIECES, HeadWork, live
from detent.methods.print_head.print_job import load_job, parse_text
from detent.operate.host import repeat


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


def test_the_line_under_way_is_shown_glyph_by_glyph(axis):
    work = HeadWork(make_spec(), axis, parse_text("de tent\n\nhead"))
    shown = work.shown
    assert (shown["line"], "".join(char for char, *_ in shown["ink"])) == (1, "detent")
    places, widths = [place for _, place, _ in shown["ink"]], {round(width, 6) for *_, width in shown["ink"]}
    assert widths == {round(0.0254 / 10, 6)}  # ten characters to an inch
    gaps = [round((b - a) / 0.00254) for a, b in pairwise(places)]
    assert gaps == [1, 2, 1, 1, 1]
    assert shown["direction"] in (-1, 1)
    work.piece()
    axis.memory.done = 1
    assert work.shown["line"] == 2
    work.piece()
    axis.memory.done = 2
    assert work.shown == {}


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
    with pytest.raises(AxisError, match="not measured itself"):
        HeadWork(make_spec(), axis, parse_text("detent"))


@pytest.mark.compiled
def test_a_print_head_is_switched_on_and_off():
    axis = Head()
    host = axis.host
    assert host.until_ended(host.ask(ops.MOVE_BY, 0.0)).how == DONE  # a null move is done, too
    place = axis.answer.position
    host.ask(ops.MOVE_TO, 0.02)
    host.run(120)
    assert axis.speed > 20
    host.off()
    host.run(1)
    assert (axis.head.drive_cmd, axis.state.lines.count, axis.state.lines.transition) == (0, 0, 0)
    host.ask(ops.ENABLE)
    host.ask(ops.CONFIRM)
    home = host.ask(ops.MOVE_TO, place)
    host.run(1)
    assert axis.speed > 10  # it still rolls, counted on: what is asked waits for that
    assert host.until_ended(home).how == DONE
    assert axis.answer.position == pytest.approx(place, abs=1.1e-3)
    assert host.board.operation.trust == REFERENCED


@pytest.mark.compiled
def test_a_print_head_without_power_stalls_and_is_reset():
    axis = Head()
    host = axis.host
    params: Any = host.axis.params
    move, params.plant.supply = host.ask(ops.MOVE_TO, 0.1), 0.0
    ending = host.until_ended(move)
    assert (ending.how, ending.why) == (ops.FAILED, 250)
    host.run(2)
    assert host.state == "fault"
    assert "obstructed or stalled" in host.axis.fault()
    params.plant.supply = 38.0
    assert host.until_ended(host.ask(ops.RESET)).how == DONE
    host.run(2)
    assert host.state == "switch on disabled"
    host.ask(ops.ENABLE)
    host.ask(ops.CONFIRM)
    axis.until_rest()
    assert host.until_ended(host.ask(ops.MOVE_TO, 0.1)).how == DONE


@pytest.mark.compiled
def test_a_job_that_is_stopped_ends_there_and_another_one_prints_whole():
    job, axis = load_job(EXAMPLES / "letter.txt"), Head()
    first = axis.host.work(job)
    while axis.memory.done < 2:
        axis.host.run(1)
    axis.host.stop()
    assert axis.host.until_ended(first).how == ABORTED
    axis.until_rest()
    half = axis.printed()
    assert len(half.lines) == 2
    assert not half.done
    assert axis.host.until_ended(axis.host.work(job)).how == DONE
    page = axis.printed()
    assert page.done
    assert (page.missed, len(page.lines)) == (0, len(job.lines))
    again = Head(enable=False)  # what came from outside makes the session, bit for bit
    repeat(again.host, axis.host.log, axis.host.board.loop.periods)
    assert bytes(again.state.controller) == bytes(axis.state.controller)


@pytest.mark.compiled
def test_a_job_waits_for_the_frames_and_for_the_first_motion_to_be_confirmed():
    job, axis = load_job(EXAMPLES / "letter.txt"), Head(enable=False)
    with pytest.raises(AxisError, match="not measured itself"):
        axis.host.work(job)
    axis.host.ask(ops.ENABLE)
    axis.until_rest()
    assert axis.host.until_ended(axis.host.work(job)).why == ops.NOT_CONFIRMED
    axis.host.ask(ops.CONFIRM)
    assert axis.host.until_ended(axis.host.ask(ops.FEED, 1)).why == ops.NO_JOB
    assert axis.host.until_ended(axis.host.ask(ops.MOVE_TO, 0.1, 0.2)).how == DONE
    assert axis.head.maximum < 60
    assert axis.host.until_ended(axis.host.work(job)).how == DONE  # at the speed of the file, not of the last move
    page = axis.printed()
    assert page.done
    assert max(page.speeds) > 60
