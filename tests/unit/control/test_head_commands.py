"""Byte protocol, queue and planning of moves."""

import pytest
from tests.print_head_rig import Rig

from detent.control.feed_forward import run_up, stop_distance_up
from detent.control.head_commands import (
    RUN_UP_RESERVE,
    answer,
    enqueue,
    operation_of,
    plan_command,
    plan_waiting,
    print_distance,
    receive_byte,
    send_position,
    set_speed,
    take_next,
)
from detent.control.head_computer import (
    CALCULATE,
    CONTROLLED_RUN,
    ILLEGAL,
    LARGEST_END,
    NO_OPERATION,
    OK,
    OUT_OF_RANGE,
    OVERRUN,
    POSITION_HIGH,
    POSITION_LOW,
    PRINT,
    QUEUE,
    REFUSED,
    RUN,
    SET_SPEED,
    HeadComputer,
    HeadParams,
)
from detent.control.latch import ROOM, pass_on, read_latch, write_latch

WIDTH = 4350


@pytest.fixture
def p():
    return HeadParams(run_speed=240, drive_limit=300)


@pytest.fixture
def c():
    return HeadComputer(maximum=240, width=WIDTH)


def answers(c):
    """Every status byte that waits."""
    found = []
    while c.status.latch.flag:
        found.append(read_latch(c.status.latch))
        pass_on(c.status)
    return found


def give(p, c, *data):
    for byte in data:
        write_latch(c.command_latch, byte)
        receive_byte(p, c)
        assert c.command_latch.flag == 0


def test_first_bytes():
    table = {
        0x8D: PRINT, 0x92: RUN, 0xA2: CONTROLLED_RUN, 0x99: SET_SPEED,
        0x01: CALCULATE, 0x40: POSITION_HIGH, 0x41: POSITION_LOW,
    }  # fmt: skip
    for byte in range(256):
        assert operation_of(byte) == table.get(byte, REFUSED)


@pytest.mark.parametrize("count", range(1, 8))
def test_a_command_is_complete_after_exactly_the_announced_bytes(p, c, count):
    data = [0x80 | count, *range(10, 10 + count)]
    for n, byte in enumerate(data[:-1]):
        give(p, c, byte)
        assert (c.receiver.left, c.queue.waiting) == (count - n, 0)
        assert answers(c) == [0xFF]
    give(p, c, data[-1])
    assert (c.receiver.left, c.queue.waiting) == (0, 1)
    assert list(c.receiver.buffer[: count + 1]) == data
    assert answers(c) == []


def test_the_last_byte_is_acknowledged_only_on_request(c):
    p = HeadParams(ack_last=1)
    give(p, c, 0x92, 1, 2)
    assert answers(c) == [0xFF, 0xFF, 0xFF]
    give(p, c, 0x40)
    assert answers(c) == [], "a single byte is never acknowledged"


def test_arguments(p, c):
    give(p, c, 0x8D, 0x01, 0x02, 0x80, 0x0F, 0xA5)
    assert (c.queue.operation[0], c.queue.start[0], c.queue.end[0]) == (PRINT, 0x010280, 0x0FA5)
    take_next(c)
    give(p, c, 0xA2, 0x0F, 0xA5)
    take_next(c)
    assert (c.operation, c.end) == (CONTROLLED_RUN, 0x0FA5)
    give(p, c, 0x99, 0xF0)
    take_next(c)
    assert (c.operation, c.end) == (SET_SPEED, 0xF0)
    assert (c.queue.waiting, c.queue.motions) == (0, 0)


@pytest.mark.parametrize("data", [(0x00,), (0x02,), (0x7F,), (0x80,), (0x88,), (0xB8,), (0x91, 5), (0x93, 1, 2, 3)])
def test_illegal_commands_are_refused_after_their_last_byte(p, c, data):
    give(p, c, *data)
    assert answers(c) == [0xFF] * (len(data) - 1)
    assert c.queue.waiting == 1
    take_next(c)
    assert (c.operation, c.start) == (REFUSED, ILLEGAL)
    give(p, c, 0x40)
    assert c.queue.operation[c.queue.first] == POSITION_HIGH, "the next byte begins a command again"


def test_one_motion_command_waits_and_a_second_is_refused(p, c):
    give(p, c, 0x92, 0, 100)
    give(p, c, 0xA2, 0, 200)
    assert c.queue.motions == 1
    take_next(c)
    assert (c.operation, c.end, c.queue.motions) == (RUN, 100, 0)
    take_next(c)
    assert (c.operation, c.start) == (REFUSED, OVERRUN)
    enqueue(c, RUN, 0, 300)
    assert c.queue.motions == 1, "there is room again"


def test_a_full_queue_refuses_in_order_and_loses_no_answer(c):
    for k in range(QUEUE - 1):
        enqueue(c, SET_SPEED, 0, 100 + k)
    for _ in range(5):
        enqueue(c, SET_SPEED, 0, 200)
    assert c.queue.waiting == QUEUE
    for k in range(QUEUE - 1):
        take_next(c)
        assert (c.operation, c.end) == (SET_SPEED, 100 + k)
        answer(c, OK)
    take_next(c)
    assert (c.operation, c.start) == (REFUSED, OVERRUN)
    answer(c, c.start)
    assert c.queue.waiting == 0
    assert answers(c) == [OK] * (QUEUE - 1) + [OVERRUN] * 5


def test_a_flood_that_was_refused_is_answered_as_far_as_the_port_holds_it(c):
    c.operation, c.end = REFUSED, LARGEST_END
    answer(c, OVERRUN)
    assert (c.status.waiting, c.status.latch.byte) == (ROOM - 1, OVERRUN)
    assert c.status.lost == (1 + c.end - ROOM) & 0xFF


def test_a_flood_is_counted_as_far_as_an_argument_goes(c):
    for _ in range(QUEUE):
        enqueue(c, REFUSED, OVERRUN, 0)
    c.queue.end[QUEUE - 1] = LARGEST_END - 1
    for wanted in (LARGEST_END, LARGEST_END):
        enqueue(c, REFUSED, OVERRUN, 0)
        assert c.queue.end[QUEUE - 1] == wanted


@pytest.mark.parametrize(("s", "code"), [(0, 2), (17, 2), (18, 0), (100, 0), (240, 0), (241, 2), (255, 2)])
def test_set_speed_range(c, s, code):
    c.maximum, c.end = 120, s
    c.kept_speed_right = c.kept_speed_left = 120
    assert set_speed(c) == code
    assert c.maximum == (s if code == OK else 120)
    kept = 0 if code == OK else 120
    assert (c.kept_speed_right, c.kept_speed_left) == (kept, kept)


def test_setting_the_same_speed_keeps_the_trimmed_drives(c):
    c.maximum = c.end = c.kept_speed_right = c.kept_speed_left = 120
    assert set_speed(c) == OK
    assert (c.kept_speed_right, c.kept_speed_left) == (120, 120)


def test_position_is_latched_by_the_high_request(c):
    c.emitter, c.operation = 0x0FA5, POSITION_HIGH
    send_position(c)
    c.emitter, c.operation = 0x1234, POSITION_LOW
    send_position(c)
    assert answers(c) == [0x0F, 0xA5]


def plan(p, c, operation, start, end, origin):
    plan_command(p, c, operation, start, end, origin)
    q = c.plan
    return q.code, q.direction, q.speed, q.target, q.distance, q.reposition


@pytest.mark.parametrize(
    ("origin", "target", "expected"),
    [
        (1000, 2001, (OK, 1, 240, 2001, 1001, 0)),
        (1000, 0, (OK, -1, 120, 0, 1000, 0)),
        (1000, 1000, (OK, 1, 30, 1000, 0, 0)),
        (1000, WIDTH, (OK, 1, 240, WIDTH, 3350, 0)),
        (1000, WIDTH + 1, (OUT_OF_RANGE, 1, 240, WIDTH + 1, 3351, 0)),
        (1000, 0xFFFF, (OUT_OF_RANGE, 1, 240, 0xFFFF, 64535, 0)),
    ],
)
def test_run_plans(p, c, origin, target, expected):
    assert plan(p, c, RUN, 0, target, origin) == expected


def test_controlled_run_is_capped_by_the_preselected_speed_and_run_is_not(p, c):
    c.maximum = 100
    assert plan(p, c, RUN, 0, 3000, 500)[2] == 240
    assert plan(p, c, CONTROLLED_RUN, 0, 3000, 500)[2] == 100
    c.maximum, p.run_speed = 240, 180
    assert plan(p, c, CONTROLLED_RUN, 0, 3000, 500)[2] == 180


@pytest.mark.parametrize("direction", [1, -1])
def test_print_with_enough_run_up_stops_beyond_the_end(p, c, direction):
    middle = WIDTH // 2
    start, end = middle - direction * 600, middle + direction * 600
    origin = start - direction * run_up(240)
    expected = (OK, direction, 240, end + direction * 400, abs(end + direction * 400 - origin), 0)
    assert plan(p, c, PRINT, start << 8, end, origin) == expected
    # One emitter closer to the start and the head runs back first, at the speed of a run.
    code, way, speed, target, _, reposition = plan(p, c, PRINT, start << 8, end, origin + direction)
    assert (code, way, reposition) == (OK, -direction, 1)
    assert target == start - direction * (run_up(240) + RUN_UP_RESERVE)
    assert speed == 30
    # After the run back the same command prints, wherever the run ended.
    c.repositioned = 1
    assert plan(p, c, PRINT, start << 8, end, target + direction * 25)[:3] == (OK, direction, 240)


def test_print_selects_the_speed_whose_stop_distance_fits(p, c):
    for maximum in range(18, 241):
        c.maximum = maximum
        for width in (1, 50, 300, 1200):
            start = 1500
            origin = start - run_up(maximum)
            code, _, s, target, distance, reposition = plan(p, c, PRINT, start << 8, start + width, origin)
            assert (code, reposition) == (OK, 0)
            assert target == start + width + stop_distance_up(s)
            assert distance == print_distance(c, start, start + width, origin, s) == target - origin
            assert s <= maximum
            assert s <= 30 or 5 * s * s < 288 * distance


@pytest.mark.parametrize(
    ("start", "end"),
    [(2000, 3951), (2000, 0xFFFF), (2000, 399), (4340, 3000), (10, 1500), (0xFFFF, 1000), (4349, 4350), (1, 0)],
)
def test_print_without_room_for_stop_or_run_up_is_out_of_range(p, c, start, end):
    assert plan(p, c, PRINT, start << 8, end, 2000)[0] == OUT_OF_RANGE


def test_a_run_back_is_shortened_at_the_frame_while_the_run_up_lasts(p, c):
    start = run_up(240) + 3
    code, direction, _, target, _, reposition = plan(p, c, PRINT, start << 8, 2000, 1000)
    assert (code, direction, target, reposition) == (OK, -1, 0, 1)
    assert plan(p, c, PRINT, (start - 4) << 8, 2000, 1000)[0] == OUT_OF_RANGE


def test_a_waiting_motion_is_planned_from_the_expected_stop(p, c):
    c.operation, c.expected_stop, c.emitter = RUN, 3000, 1200
    enqueue(c, SET_SPEED, 0, 100)
    plan_waiting(p, c)
    assert c.plan.target == 0, "nothing to plan"
    enqueue(c, RUN, 0, 1500)
    c.repositioned = 1
    plan_waiting(p, c)
    assert (c.plan.distance, c.plan.direction, c.plan.target) == (1500, -1, 1500)
    assert c.repositioned == 1
    c.operation, c.plan.target = NO_OPERATION, 0
    plan_waiting(p, c)
    assert c.plan.target == 0, "a head at rest plans when it begins"


def test_responses_of_a_run_on_the_machine():
    rig = Rig().pretend_identified()
    assert rig.send(0x92, 0x05, 0x00) == [0xFF, 0xFF]
    assert rig.next_status() == OK
    assert rig.responses == [0xFF, 0xFF, OK]
    # Three commands may wait behind the running one; further ones are refused in their turn.
    rig.run_to(3000, wait=False)
    for byte in (0x40, 0x41, 0x40):
        rig.send(byte)
    rig.send(0x40)
    rig.send(0x02)
    high = 3000 >> 8
    found = [rig.next_status() for _ in range(6)]
    assert found == [OK, high, found[2], high, OVERRUN, OVERRUN]
    assert rig.next_status(0.2) is None
    # The position is that of zero speed; the head may move back by less than an emitter after it.
    assert abs((high << 8 | found[2]) - rig.head.emitter) <= 1
