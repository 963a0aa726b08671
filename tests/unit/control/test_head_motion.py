"""Motion rules one by one: outputs, kept drives, ramps, trims, the beginnings of move, steady phase and stop."""

import pytest

from detent.control.head_computer import (
    HIGH_ACCEL,
    HIGH_REVERSE,
    HIGH_STEADY,
    HIGH_TRANSITION,
    LOW_START,
    LOW_STEADY,
    LOW_STOP,
    RUN,
    HeadComputer,
    HeadParams,
)
from detent.control.head_motion import (
    TRIM_US,
    begin_move,
    begin_steady,
    begin_stop,
    forget_drive,
    growing_interval,
    keep_drive,
    move_emitter,
    move_timer,
    must_stop,
    put_drive,
    put_low,
    put_transition,
    ramp_down,
    ramp_interval,
    speed_reached,
    steady_timer,
    steady_value,
    trim_high,
    trim_low,
)

OPTIONS = {
    "ir": 96,
    "drive_limit": 300,
    "transition": 1,
    "friction_jump": 1,
    "trim": 1,
    "overspeed_test": 1,
    "memory": 1,
}


@pytest.fixture
def p():
    return HeadParams(**OPTIONS)


@pytest.fixture
def c():
    """Identified computer of the default plant."""
    found = HeadComputer(width=4350, maximum=240, emitter=1000, now_us=1_000_000, operation=RUN)
    for line, friction in ((found.right, 36), (found.left, 28)):
        line.slope, line.friction = 170, friction
    return found


def plan(c, direction, speed, distance=2000):
    q = c.plan
    q.direction, q.speed, q.distance, q.target = direction, speed, distance, c.emitter + direction * distance
    return c


def out(c):
    return c.drive_cmd, c.out.count, c.out.right_left, c.out.transition


@pytest.mark.parametrize(
    ("signed", "expected"),
    [
        (55, (55, 55, 1, 0)),
        (-55, (-55, 55, 0, 0)),
        (400, (300, 300, 1, 0)),
        (-400, (-300, 300, 0, 0)),
        (0, (0, 0, 1, 0)),
    ],
)
def test_drive_is_sign_and_magnitude_within_the_limit(p, c, signed, expected):
    c.out.right_left = c.out.transition = 1
    put_drive(p, c, signed)
    assert out(c) == expected


def test_the_limit_is_that_of_the_axis(c):
    put_drive(HeadParams(drive_limit=120), c, -200)
    assert out(c) == (-120, 120, 0, 0)


@pytest.mark.parametrize("direction", [1, -1])
def test_transition_complements_the_modulator_and_keeps_the_line(c, direction):
    c.direction, c.drive = direction, 99
    put_transition(c)
    assert out(c) == (99 * direction, 201, int(direction > 0), 1)


def test_kept_drive_counts_for_the_same_direction_and_speed_of_the_high_class(p, c):
    c.direction, c.speed, c.drive = 1, 240, 193
    keep_drive(c)
    c.direction, c.drive = -1, 185
    keep_drive(c)
    assert steady_value(p, c, 1, 240) == 193
    assert steady_value(p, c, -1, 240) == 185
    forget_drive(c, 1)
    assert steady_value(p, c, 1, 240) == 195
    assert steady_value(p, c, -1, 240) == 185
    # Another speed is a change of the commanded speed: what was kept is gone.
    assert steady_value(p, c, -1, 120) == 79 + 28
    assert steady_value(p, c, -1, 240) == 187


@pytest.mark.parametrize("cause", ["low speed", "no memory", "calibration"])
def test_kept_drive_is_not_used(p, c, cause):
    s = 59 if cause == "low speed" else 240
    c.kept_speed_right, c.kept_drive_right = s, 111
    p.memory = cause != "no memory"
    c.calibration_pass = int(cause == "calibration")
    assert steady_value(p, c, 1, s) == (170 * s >> 8) + 36


def test_ramp_interval_takes_the_slope_of_each_direction(p, c):
    """VC1 is that of the right, VC2 of the left: 170 s/256 and 120 s/256 together."""
    c.left.slope = 120
    expected = round(133_000 * (240 / 240) / ((170 * 240 >> 8) + (120 * 240 >> 8)))
    assert ramp_interval(p, c, 240) == expected
    c.left.slope, c.right.slope = 170, 120
    assert ramp_interval(p, c, 240) == expected
    assert steady_value(p, c, 1, 240) == (120 * 240 >> 8) + 36
    assert steady_value(p, c, -1, 240) == (170 * 240 >> 8) + 28
    # With friction, of each direction its own as well.
    p.span_steady, c.left.friction = 1, 5
    assert ramp_interval(p, c, 240) == round(133_000 / ((170 * 240 >> 8) + 5 + (120 * 240 >> 8) + 36))


def test_ramp_interval_has_two_readings(p, c):
    assert [ramp_interval(p, c, s) for s in (240, 60)] == [418, 426]
    p.span_steady = 1
    assert [ramp_interval(p, c, s) for s in (240, 60)] == [348, 234]


@pytest.mark.parametrize(("direction", "drive"), [(1, 132), (-1, -124)])
def test_low_speed_begins_with_friction_and_ir(p, c, direction, drive):
    begin_move(p, plan(c, direction, 30), False)
    assert (c.state, c.drive_cmd, c.start_emitters, c.moves) == (LOW_START, drive, 5, 1)
    assert (c.interval_us, c.emitter_seen, c.last_emitter_us, c.phase_start) == (0, 0, 1_000_000, 1000)


def test_a_run_shorter_than_the_open_loop_start_ends_it_at_its_target(p, c):
    begin_move(p, plan(c, 1, 30, 2), False)
    assert c.start_emitters == 2
    c.emitter = 1001
    move_emitter(p, c)
    assert c.state == LOW_START
    c.emitter = 1002
    move_emitter(p, c)
    assert c.state == LOW_STOP


def test_high_speed_begins_with_friction_and_ir_and_ramps_to_the_top(p, c):
    begin_move(p, plan(c, -1, 240), False)
    assert (c.state, c.drive_cmd, c.ramp_top, c.ramp_us) == (HIGH_ACCEL, -124, 283, 418)
    assert c.next_ramp_us == 1_000_000 + 418
    p.drive_limit = 250
    begin_move(p, plan(c, -1, 240), False)
    assert c.ramp_top == 250


@pytest.mark.parametrize(("direction", "old", "command"), [(-1, 60, -124), (1, 68, 132), (-1, 99, -163)])
def test_a_turn_jumps_by_the_friction_of_both_directions(p, c, direction, old, command):
    # Before the turn V counts along the old direction, so braking is negative.
    c.drive, c.next_ramp_us = -old, 1_000_123
    begin_move(p, plan(c, direction, 240), True)
    assert (c.drive_cmd, c.turn_arounds) == (command, 1)
    assert c.next_ramp_us == 1_000_123, "the ramp goes on in its own time"
    p.friction_jump = 0
    c.drive = -old
    begin_move(p, plan(c, direction, 240), True)
    assert c.drive_cmd == direction * old


def test_steady_phase_begins_a_trim_period_ahead(c):
    c.steady, c.emitter = 111, 1234
    begin_steady(c, HIGH_STEADY)
    assert (c.state, c.drive, c.next_trim_us, c.phase_start) == (HIGH_STEADY, 111, 1_000_000 + TRIM_US, 1234)


@pytest.mark.parametrize(
    ("direction", "target", "stop"), [(1, 1400, True), (1, 1401, False), (-1, 600, True), (-1, 599, False)]
)
def test_stop_begins_when_no_more_than_the_stop_distance_remains(c, direction, target, stop):
    c.direction, c.target, c.speed = direction, target, 240
    assert must_stop(c) is stop


@pytest.mark.parametrize("direction", [1, -1])
def test_low_speed_stop_is_the_negative_of_the_running_drive(p, c, direction):
    c.state, c.direction, c.speed, c.drive = LOW_STEADY, direction, 54, 72
    begin_stop(p, c)
    assert (c.state, c.drive_cmd, c.out.transition) == (LOW_STOP, -72 * direction, 0)


@pytest.mark.parametrize(
    ("state", "drive", "expected"),
    [
        (HIGH_STEADY, 195, (HIGH_TRANSITION, 99, 201, 1, 1)),
        (HIGH_STEADY, 97, (HIGH_TRANSITION, 1, 299, 1, 1)),
        (HIGH_STEADY, 96, (HIGH_REVERSE, 0, 0, 0, 0)),
        (HIGH_STEADY, 87, (HIGH_REVERSE, -9, 9, 0, 0)),
        (HIGH_ACCEL, 291, (HIGH_TRANSITION, 99, 201, 1, 1)),
        (HIGH_ACCEL, 150, (HIGH_REVERSE, -42, 42, 0, 0)),
    ],
)
def test_high_speed_stop_subtracts_the_ir_part_once_steady_and_twice_from_the_ramp(p, c, state, drive, expected):
    c.state, c.direction, c.speed, c.drive, c.ramp_us = state, 1, 240, drive, 418
    begin_stop(p, c)
    assert (c.state, *out(c)) == (expected[0], expected[1], expected[2], expected[4], expected[3])
    kept = (240, drive) if state == HIGH_STEADY else (0, 0)
    assert (c.kept_speed_right, c.kept_drive_right) == kept


def test_identification_keeps_no_drive(p, c):
    c.state, c.direction, c.speed, c.drive, c.calibration_pass = HIGH_STEADY, 1, 240, 174, 2
    begin_stop(p, c)
    assert c.kept_speed_right == 0


@pytest.mark.parametrize("transition", [0, 1])
def test_braking_passes_through_zero_with_the_lines_changing_there(c, transition):
    p = HeadParams(**(OPTIONS | {"transition": transition}))
    c.state, c.direction, c.speed, c.drive, c.ramp_us = HIGH_STEADY, -1, 240, 98, 400
    begin_stop(p, c)
    seen = [out(c)]
    for _ in range(4):
        c.now_us += 400
        ramp_down(p, c)
        seen.append(out(c))
    first = (-2, 298, 0, 1), (-1, 299, 0, 1)
    if not transition:
        first = (-2, 2, 0, 0), (-1, 1, 0, 0)
    assert seen == [*first, (0, 0, 1, 0), (1, 1, 1, 0), (2, 2, 1, 0)]
    assert c.state == HIGH_REVERSE


def test_the_ramp_waits_for_its_time_and_holds_its_top_for_one_interval(p, c):
    begin_move(p, plan(c, 1, 60), False)
    times = []
    for now in range(1_000_000, 1_030_000, 40):
        c.now_us, before = now, c.drive
        move_timer(p, c)
        times += [now] * (c.drive - before == 1)
        if c.state != HIGH_ACCEL:
            break
    assert len(times) == 39
    assert all(0 <= now - 1_000_000 - (n + 1) * 426 < 40 for n, now in enumerate(times))
    assert (c.state, c.drive_cmd) == (HIGH_STEADY, 75)
    assert 0 <= now - 1_000_000 - 40 * 426 < 40


@pytest.mark.parametrize(("interval", "reached"), [(0, False), (84, False), (83, True), (50, True)])
def test_speed_exit_of_the_ramp(p, c, interval, reached):
    begin_move(p, plan(c, 1, 240), False)
    c.interval_us = interval
    assert speed_reached(c) is reached
    move_emitter(p, c)
    assert c.state == (HIGH_STEADY if reached else HIGH_ACCEL)
    assert c.drive_cmd == (195 if reached else 132)


@pytest.mark.parametrize(
    ("interval", "quiet", "change"), [(501, 0, 1), (500, 0, 0), (499, 0, -1), (499, 501, 1), (0, 0, 0)]
)
def test_low_speed_trim_by_the_interval_that_may_still_grow(c, interval, quiet, change):
    c.speed, c.drive, c.interval_us, c.last_emitter_us = 40, 60, interval, c.now_us - quiet
    trim_low(c)
    assert c.drive - 60 == change
    assert growing_interval(c) == max(interval, quiet)


def test_an_unknown_interval_is_never_too_fast(p, c):
    c.speed, c.drive, c.interval_us, c.direction = 40, 60, 0, 1
    c.last_emitter_us = c.now_us - 100
    trim_low(c)
    put_low(p, c)
    assert (c.drive, c.drive_cmd) == (60, 60)


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize(("passed", "change"), [(190, 1), (191, 0), (192, -1), (-5, 1)])
def test_high_speed_trim_by_the_count(c, direction, passed, change):
    c.speed, c.drive, c.direction, c.phase_start = 240, 187, direction, c.emitter - direction * passed
    trim_high(c)
    assert (c.drive - 187, c.phase_start) == (change, c.emitter)


@pytest.mark.parametrize(
    ("interval", "test", "quiet", "value"),
    [(627, 1, 0, 27), (628, 1, 0, 55), (627, 0, 0, 55), (0, 1, 0, 55), (400, 1, 700, 55)],
)
def test_overspeed_halves_the_output_but_not_the_drive(p, c, interval, test, quiet, value):
    c.speed, c.direction, c.drive, c.interval_us = 30, -1, 55, interval
    c.last_emitter_us = c.now_us - quiet
    p.overspeed_test = test
    put_low(p, c)
    assert (c.drive, c.drive_cmd) == (55, -value)


@pytest.mark.parametrize("state", [LOW_STEADY, HIGH_STEADY])
@pytest.mark.parametrize("cause", ["trim", "no trim", "calibration", "not due"])
def test_trim_runs_at_its_boundaries_only(p, c, state, cause):
    c.state, c.direction, c.drive = state, 1, 100
    c.speed, c.interval_us = (30, 700) if state == LOW_STEADY else (240, 0)
    c.phase_start, c.last_emitter_us = c.emitter, c.now_us
    c.next_trim_us = c.now_us + (1 if cause == "not due" else 0)
    p.trim = cause != "no trim"
    c.calibration_pass = int(cause == "calibration")
    steady_timer(p, c)
    assert c.drive == (101 if cause == "trim" else 100)
    assert c.next_trim_us == 1_000_000 + (1 if cause == "not due" else TRIM_US)


@pytest.mark.parametrize(("drive", "passed", "expected"), [(300, 0, 300), (0, 400, 0)])
def test_trim_ends_at_nothing_and_at_the_limit(p, c, drive, passed, expected):
    c.state, c.direction, c.speed, c.drive = HIGH_STEADY, 1, 240, drive
    c.phase_start, c.next_trim_us = c.emitter - passed, c.now_us
    steady_timer(p, c)
    assert (c.drive, c.drive_cmd) == (expected, expected)


INTERVALS = (-5, 0, 1, 83, 84, 20_000, 20_001, 32_767, 32_768, 32_769, 400_000, 1 << 40)


@pytest.mark.parametrize("s", [0, 1, 2, 30, 240])
@pytest.mark.parametrize("since", [0, 1, 300, 20_000, 32_769, 1 << 41])
def test_intervals_compare_at_every_speed_as_if_none_were_cut(p, c, s, since):
    for interval in (*INTERVALS, *(n // max(s, 1) + d for n in (20_000, 320_000 // 17) for d in (-1, 0, 1))):
        c.direction, c.speed, c.interval_us, c.last_emitter_us = 1, s, interval, c.now_us - since
        longest = max(interval, since)
        assert speed_reached(c) is (0 < interval * s <= 20_000)
        c.drive = 100
        trim_low(c)
        faster = 0 < longest * s < 20_000 and interval > 0
        assert c.drive == 100 + (1 if longest * s > 20_000 else -1 if faster else 0)
        c.drive = 100
        put_low(p, c)
        assert c.drive_cmd == (50 if interval > 0 and 17 * longest * s < 320_000 else 100)
