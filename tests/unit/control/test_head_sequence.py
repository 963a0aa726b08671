"""What follows what: commands in every resting state, faults, turn-arounds, prints with a run back, identification."""

import pytest
from tests.print_head_rig import EMITTER, Rig

from detent.control.head_computer import (
    CALCULATE,
    FAR,
    FAULT,
    HIGH_ACCEL,
    HIGH_REVERSE,
    HIGH_STEADY,
    HIGH_TRANSITION,
    HOME_LEFT,
    HOME_RIGHT,
    IDLE,
    LOW_START,
    LOW_STEADY,
    LOW_STOP,
    NOT_CALIBRATED,
    OBSTRUCTION,
    OK,
    OUT_OF_RANGE,
    POWER_ON,
    RUN,
    STALL_US,
    WINDOWS,
)
from detent.control.head_sequence import (
    REVERSAL_US,
    begin_windows,
    fault,
    halt,
    next_wake,
    on_emitter,
    on_reverse_edge,
    switch_off,
    window_timer,
)
from detent.control.self_identification import LONGEST
from detent.plant.drive_train import fill_period

MOVING = (LOW_START, LOW_STEADY, LOW_STOP, HIGH_ACCEL, HIGH_STEADY, HIGH_TRANSITION, HIGH_REVERSE)


def faulty():
    """An axis in FAULT: its head ran against something."""
    rig = Rig().pretend_identified(emitter=1000)
    rig.p.plant.train.right_end = 1500 * EMITTER
    assert rig.run_to(3000) == OBSTRUCTION
    rig.p.plant.train.right_end = rig.spec.limits.travel
    assert rig.head.state == FAULT
    return rig


def powered():
    rig = Rig()
    assert rig.head.state == POWER_ON
    return rig


MOTIONS = ((0x92, 0x08, 0x00), (0xA2, 0x08, 0x00), (0x8D, 0x05, 0x00, 0x00, 0x08, 0x00))


@pytest.mark.parametrize("make", [powered, faulty])
@pytest.mark.parametrize("command", MOTIONS)
def test_no_motion_before_calibration_or_after_a_fault(make, command):
    rig = make()
    state, moves, x = rig.head.state, rig.head.moves, rig.r.plant.train.position
    rig.send(*command)
    assert rig.next_status() == NOT_CALIBRATED
    rig.run(5000)
    assert (rig.head.state, rig.head.moves, rig.head.drive_cmd, rig.head.out.count) == (state, moves, 0, 0)
    assert rig.r.plant.train.position == pytest.approx(x, abs=1e-4)


@pytest.mark.parametrize("make", [powered, faulty])
def test_other_commands_are_answered_at_rest_in_any_state(make):
    rig = make()
    state, here = rig.head.state, rig.head.emitter
    assert rig.set_speed(100) == OK
    assert rig.set_speed(5) == OUT_OF_RANGE
    rig.send(0x40)
    rig.send(0x41)
    assert (rig.next_status() << 8 | rig.next_status()) == here & 0xFFFF
    rig.send(0x02)
    assert rig.next_status() == 0x01
    assert (rig.head.state, rig.head.maximum, rig.head.drive_cmd) == (state, 100, 0)


@pytest.mark.parametrize("make", [pytest.param(powered, marks=pytest.mark.compiled), faulty])
def test_calculate_parameters_makes_the_axis_ready(make):
    rig = make()
    rig.send(0x01)
    assert (rig.head.state, rig.head.homed, rig.head.operation) == (HOME_LEFT, 0, CALCULATE)
    # The next motion command waits for the whole of it.
    rig.run_to(2000, wait=False)
    assert rig.next_status(60) == OK
    assert rig.head.homed == 1
    assert (rig.head.right.valid, rig.head.left.valid) == (1, 1)
    assert rig.head.width == pytest.approx(4350, abs=1)
    assert rig.next_status() == OK
    assert rig.head.emitter == pytest.approx(2000, abs=12)


def test_calculating_again_starts_from_the_defaults():
    rig = Rig().pretend_identified(slope=200, right=70, left=70)
    rig.head.kept_speed_right = rig.head.kept_speed_left = 240
    rig.send(0x01)
    for line in (rig.head.right, rig.head.left):
        assert (line.slope, line.friction, line.valid, line.speed_fast, line.speed_slow) == (152, 32, 0, 0, 0)
    assert (rig.head.kept_speed_right, rig.head.kept_speed_left) == (0, 0)
    assert rig.in_state(HOME_RIGHT)
    assert rig.head.emitter == 0


@pytest.mark.parametrize(
    ("s", "states"), [(30, (LOW_START, LOW_STEADY)), (59, (LOW_STEADY,)), (240, (HIGH_ACCEL, HIGH_STEADY))]
)
@pytest.mark.parametrize("direction", [1, -1])
def test_an_obstacle_ends_every_move_in_fault_with_the_drive_off(s, states, direction):
    for state in states:
        rig = Rig().pretend_identified(emitter=2175)
        rig.set_speed(s)
        rig.controlled_run_to(2175 + 2000 * direction, wait=False)
        assert rig.in_state(state)
        here = rig.r.plant.train.position
        rig.p.plant.train.left_end, rig.p.plant.train.right_end = here - EMITTER, here + EMITTER
        assert rig.next_status(3) == OBSTRUCTION
        assert (rig.head.state, rig.head.drive_cmd, rig.head.out.count, rig.head.out.transition) == (FAULT, 0, 0, 0)
        assert rig.head.homed == 0
        quiet = rig.head.now_us - rig.head.last_emitter_us
        # At once where the drive is well above friction; at low speed the trim must first raise it to there.
        assert STALL_US <= quiet < (400_000 if state == LOW_STEADY else STALL_US + 1000)


@pytest.mark.parametrize("s", [30, 240])
def test_a_head_that_is_pushed_back_to_the_frame_ends_in_fault(s):
    rig = Rig().pretend_identified(emitter=1000)
    rig.set_speed(s)
    rig.controlled_run_to(4000, wait=False)
    rig.run(2500)
    rig.p.plant.push.force, rig.p.plant.push.begin, rig.p.plant.push.end = -80.0, rig.r.tick, rig.r.tick + 100_000
    assert rig.next_status(3) == OBSTRUCTION
    assert (rig.head.state, rig.head.drive_cmd, rig.head.out.count) == (FAULT, 0, 0)
    assert rig.r.tick < rig.p.plant.push.end


@pytest.mark.compiled
@pytest.mark.parametrize("s", [30, 60, 120])
@pytest.mark.parametrize("force", [-25.0, 25.0])
def test_a_short_push_is_no_fault_and_the_move_is_finished(s, force):
    rig = Rig().pretend_identified(emitter=1000)
    rig.set_speed(s)
    rig.controlled_run_to(4000, wait=False)
    rig.run(5000)
    rig.p.plant.push.force, rig.p.plant.push.begin, rig.p.plant.push.end = force, rig.r.tick, rig.r.tick + 500
    assert rig.next_status() == OK
    assert rig.head.emitter == pytest.approx(4000, abs=12)


def test_a_standing_head_is_found_even_when_no_drive_is_to_spare():
    # 3 in/s needs 11 counts above friction; without the trim they never become the 20 of the stall rule.
    rig = Rig(overrides=["method.trim=false"]).pretend_identified(emitter=2000)
    rig.set_speed(18)
    rig.controlled_run_to(3000, wait=False)
    assert rig.in_state(LOW_STEADY)
    rig.p.plant.train.right_end = rig.r.plant.train.position + EMITTER
    assert rig.next_status(2) == OBSTRUCTION
    assert rig.head.now_us - rig.head.last_emitter_us == pytest.approx(1_000_000, abs=40)


def test_a_fault_answers_the_running_and_all_waiting_commands_in_order():
    rig = Rig().pretend_identified(emitter=1000)
    rig.p.plant.train.right_end = 1500 * EMITTER
    rig.run_to(3000, wait=False)
    for command in ((0x99, 100), (0x92, 0x05, 0x00), (0x40,), (0x41,), (0x41,)):
        rig.send(*command)
    found = [rig.next_status(1) for _ in range(6)]
    assert found == [OBSTRUCTION] * 6
    assert rig.next_status(0.2) is None
    assert (rig.head.state, rig.head.queue.waiting, rig.head.queue.motions) == (FAULT, 0, 0)


def test_a_runaway_is_a_fault():
    # A machine with half the slope it was identified with: the steady drive of 40 in/s is far too much.
    rig = Rig(slope=85).pretend_identified(emitter=200)
    assert rig.run_to(4000) == OBSTRUCTION
    assert rig.head.state == FAULT
    assert rig.speed_value > 300
    rig.run(12500)
    assert rig.r.plant.train.velocity == 0
    assert rig.head.out.count == 0


def test_the_fastest_plausible_overshoot_is_no_runaway():
    rig = Rig(slope=150).pretend_identified(emitter=200)
    assert rig.run_to(4000) == OK


def test_fault_at_rest_answers_nothing():
    rig = Rig().pretend_identified()
    fault(rig.p.controller, rig.head, OBSTRUCTION)
    assert rig.next_status(0.1) is None
    assert rig.head.state == FAULT


def test_a_run_of_no_distance_is_done_at_once():
    rig = Rig().pretend_identified(emitter=1234)
    assert rig.run_to(1234) == OK
    assert (rig.head.moves, rig.head.state, rig.head.drive_cmd) == (0, IDLE, 0)


@pytest.mark.parametrize(
    "command", [(0x92, 0x10, 0xFF), (0xA2, 0xFF, 0xFF), (0x8D, 0xFF, 0xFF, 0xFF, 0, 0), (0x8D, 0, 0, 0, 3, 0)]
)
def test_out_of_range_moves_nothing_and_the_next_command_works(command):
    rig = Rig().pretend_identified(emitter=2000)
    rig.send(*command)
    assert rig.next_status() == OUT_OF_RANGE
    assert (rig.head.moves, rig.head.state) == (0, IDLE)
    assert rig.run_to(2500) == OK


@pytest.mark.parametrize("target", [0, 1, 2, 5, 4345, 4348, 4349, 4350])
def test_short_runs_at_the_frames_are_no_fault(target):
    rig = Rig().pretend_identified(emitter=3 if target < 100 else 4346)
    assert rig.run_to(target) == OK
    for back in (20, 4330):
        assert rig.run_to(back) == OK


@pytest.mark.parametrize("direction", [1, -1])
def test_print_runs_back_first_when_the_run_up_is_short(direction):
    rig = Rig().pretend_identified(emitter=2175)
    rig.set_speed(120)
    start = 2175 + 50 * direction
    rig.send_print(start, start + 800 * direction)
    assert (rig.head.direction, rig.head.repositions, rig.head.repositioning) == (-direction, 1, 1)
    assert rig.next_status() == OK
    # One answer; run back, then the print itself at its own speed.
    assert (rig.head.moves, rig.head.direction, rig.head.speed) == (2, direction, 120)
    assert rig.head.emitter == pytest.approx(start + 900 * direction, abs=12)
    assert rig.next_status(0.2) is None


def test_print_does_not_run_back_when_the_head_stands_right():
    rig = Rig().pretend_identified(emitter=1000)
    rig.set_speed(120)
    rig.send_print(1105.5, 2000)
    assert rig.next_status() == OK
    assert (rig.head.moves, rig.head.repositions) == (1, 0)


def test_commands_between_two_opposite_moves_do_not_prevent_the_turn_around():
    rig = Rig().pretend_identified(emitter=500)
    rig.run_to(3500, wait=False)
    rig.send(0x40)
    rig.run_to(800, wait=False)
    answers = [rig.next_status() for _ in range(3)]
    assert (answers[0], answers[2], rig.head.turn_arounds) == (OK, OK, 1)


def test_calibration_after_a_move_begins_with_the_drive_of_homing():
    rig = Rig().pretend_identified(emitter=500)
    rig.run_to(3500, wait=False)
    rig.send(0x01)
    assert rig.next_status() == OK
    assert (rig.head.state, rig.head.out.transition, rig.head.out.right_left) == (HOME_LEFT, 0, 0)
    # 152 x 30 >> 8 and the friction
    assert rig.head.drive_cmd == -(17 + 32)


def test_an_obstacle_while_homing_ends_in_fault():
    rig = Rig(overrides=["disturbance.obstacle.position=7 in"])
    assert rig.calculate() == OBSTRUCTION
    assert (rig.head.state, rig.head.homed, rig.head.drive_cmd) == (FAULT, 0, 0)


@pytest.mark.compiled
def test_homing_never_exceeds_its_drive_limit():
    # The drive rises by a count per millisecond at a frame: with 100 ms to recognise it, it would go beyond the limit.
    rig = Rig(overrides=["homing.contact_timeout=100 ms"])
    rig.send(0x01)
    rows = rig.record(6, ["controller.head.drive_cmd", "controller.head.state", "plant.train.current"])
    homing = (rows["controller.head.state"] == HOME_LEFT) | (rows["controller.head.state"] == HOME_RIGHT)
    assert not homing[-1]
    # 110/300 x 38 V through 12 ohm
    drive = abs(rows["controller.head.drive_cmd"][homing])
    assert (drive[0], drive.max()) == (49, 110)
    assert 1.1 < abs(rows["plant.train.current"][homing]).max() < 1.2


@pytest.mark.parametrize("state", MOVING)
def test_a_reversed_sequence_ends_a_stop_and_nothing_else(state):
    rig = Rig().pretend_identified()
    c = rig.head
    c.state, c.direction, c.operation, c.interval_us = state, 1, RUN, 2000
    on_reverse_edge(rig.p.controller, c)
    assert c.state == (IDLE if state in (LOW_STOP, HIGH_TRANSITION, HIGH_REVERSE) else state)


@pytest.mark.parametrize(("interval", "ends"), [(0, True), (REVERSAL_US, True), (REVERSAL_US - 1, False), (83, False)])
def test_a_reversal_at_speed_is_a_missing_pulse(interval, ends):
    rig = Rig().pretend_identified()
    c = rig.head
    c.state, c.direction, c.operation, c.interval_us = HIGH_TRANSITION, -1, RUN, interval
    on_reverse_edge(rig.p.controller, c)
    assert (c.state == IDLE) is ends


def test_stops_survive_missing_encoder_pulses():
    rig = Rig(overrides=["encoder.missing_edges=0.01"]).pretend_identified(emitter=400)
    for target in (3900, 500, 3000):
        assert rig.run_to(target) == OK
        # Answered at standstill, not while a pulse is missing at speed.
        assert abs(rig.speed_value) < 6


@pytest.mark.parametrize("command", ["run", "calculate"])
def test_swapped_motor_leads_end_in_a_fault_within_a_finger_of_travel(command):
    rig = Rig(start=0.2).pretend_identified(emitter=2000)
    rig.p.plant.train.force_constant *= -1
    rig.p.plant.train.emf_constant *= -1
    fill_period(rig.p.plant.train)
    begin = rig.r.plant.train.position
    code = rig.run_to(3900) if command == "run" else rig.calculate()
    assert code == OBSTRUCTION
    assert rig.head.state == FAULT
    assert rig.head.out.count == 0
    rig.run(25000)
    assert rig.r.plant.train.velocity == 0
    assert 60 <= abs(rig.r.plant.train.position - begin) / EMITTER < 350


@pytest.mark.parametrize("state", [POWER_ON, IDLE, FAULT])
def test_a_head_that_is_pushed_keeps_its_position(state):
    rig = Rig().pretend_identified(emitter=1000)
    rig.head.state = state
    rig.p.plant.push.force, rig.p.plant.push.begin, rig.p.plant.push.end = 40.0, rig.r.tick, rig.r.tick + 5000
    rig.run(30000)
    assert rig.head.state == state
    assert rig.r.plant.train.velocity == 0
    moved = (rig.r.plant.train.position - rig.p.plant.encoder.origin) / EMITTER
    assert moved > 1100
    assert rig.head.emitter == int(moved)


def test_emitter_interval_is_unknown_after_a_start_and_after_a_reversal():
    rig = Rig().pretend_identified()
    p, c = rig.p.controller, rig.head
    c.state = IDLE
    seen = []
    for when, change in ((100, 1), (200, 1), (350, 1), (500, -1), (600, -1)):
        on_emitter(p, c, when, change)
        seen.append((c.interval_us, c.emitter - 1000))
    assert seen == [(0, 1), (100, 2), (150, 3), (0, 2), (100, 1)]


def test_fast_windows_keep_the_last_and_slow_ones_add_up():
    rig = Rig().pretend_identified()
    c = rig.head
    for number, passed, total, windows in ((1, (9, 200, 204), 204, 3), (3, (9, 240, 244), 484, 2)):
        c.calibration_pass, c.direction, c.now_us, c.emitter = number, -1, 0, 4000
        begin_windows(c)
        for n, emitters in enumerate(passed):
            c.emitter -= emitters
            c.now_us = (n + 1) * (20_000 if number == 1 else 80_000) - 1
            window_timer(c)
            c.now_us += 1
            window_timer(c)
        assert (c.window_total, c.windows) == (total, windows)


@pytest.mark.parametrize("side", [1, -1])
def test_emitters_are_counted_as_far_as_their_register_claims(side):
    rig = Rig().pretend_identified()
    p, c = rig.p.controller, rig.head
    c.state, c.emitter = IDLE, side * (FAR - 1)
    for wanted in (FAR, FAR, FAR):
        on_emitter(p, c, c.last_emitter_us + 100, side)
        assert c.emitter == side * wanted
    on_emitter(p, c, c.last_emitter_us + 100, -side)
    assert c.emitter == side * (FAR - 1)


def test_windows_are_counted_as_far_as_their_registers_claim():
    rig = Rig().pretend_identified()
    c = rig.head
    c.calibration_pass, c.direction, c.windows, c.window_total = 3, 1, WINDOWS - 1, LONGEST - 3
    c.phase_start, c.emitter, c.window_us, c.now_us = 0, 2, 0, 1
    for wanted in ((WINDOWS, LONGEST - 1), (WINDOWS, LONGEST)):
        window_timer(c)
        assert (c.windows, c.window_total) == wanted
        c.emitter, c.window_us = c.emitter + 2, 0


def test_the_computer_wakes_for_its_earliest_timer():
    rig = Rig().pretend_identified()
    p, c = rig.p.controller, rig.head
    c.last_emitter_us, c.next_ramp_us, c.next_trim_us, c.window_us = 1000, 5000, 4000, 3000
    table = {
        LOW_STOP: 1000 + 5000, HIGH_TRANSITION: 5000, HIGH_REVERSE: 5000, LOW_START: 51_000, HIGH_ACCEL: 5000,
        LOW_STEADY: 4000, HIGH_STEADY: 4000, HOME_LEFT: 5000, HOME_RIGHT: 5000,
    }  # fmt: skip
    for state, wake in table.items():
        c.state = state
        assert next_wake(p, c) == wake
    c.state, c.calibration_pass = HIGH_STEADY, 1
    assert next_wake(p, c) == 3000
    for state in (POWER_ON, IDLE, FAULT):
        c.state = state
        assert next_wake(p, c) > 1 << 60


def moving(state: int) -> Rig:
    """A head in some state of a move, another command behind it."""
    rig = Rig().pretend_identified(emitter=1000)
    if state in (LOW_START, LOW_STEADY, LOW_STOP):
        rig.send(0x99, 48)
        rig.next_status()
        rig.send(0xA2, 0x08, 0x00)
    else:
        rig.run_to(2048, wait=False)
    while rig.head.state != state:
        assert rig.run(1) == 1
    rig.run(100 if state != LOW_STOP else 1)
    assert rig.head.state == state
    rig.send(0x92, 0x00, 0x40)
    assert rig.head.queue.waiting == 1
    return rig


@pytest.mark.parametrize("state", MOVING)
def test_an_operators_stop_answers_the_running_command_only_and_rests(state):
    rig = moving(state)
    at, speed = rig.head.emitter, abs(rig.r.plant.train.velocity) / 0.0254
    halt(rig.p.controller, rig.head)
    assert rig.head.state in (LOW_STOP, HIGH_TRANSITION, HIGH_REVERSE)
    assert rig.next_status(1.0) == OK
    assert rig.next_status(0.1) is None
    assert (rig.head.state, rig.head.drive_cmd, rig.head.queue.waiting) == (IDLE, 0, 0)
    assert -1 <= rig.head.emitter - at <= 300 * speed * speed / 1200 + 12


@pytest.mark.parametrize("make", [powered, faulty, lambda: Rig().pretend_identified()])
def test_an_operators_stop_leaves_a_head_at_rest_as_it_is(make):
    rig = make()
    rig.run(5000)  # what ran against something swings back
    state, at = rig.head.state, rig.head.emitter
    halt(rig.p.controller, rig.head)
    assert rig.next_status(0.2) is None
    assert (rig.head.state, rig.head.emitter, rig.head.drive_cmd) == (state, at, 0)


@pytest.mark.parametrize("state", [HOME_LEFT, HOME_RIGHT])
def test_an_operators_stop_ends_homing(state):
    rig = Rig()
    rig.send(0x01)
    while rig.head.state != state:
        rig.run(1)
    rig.run(2500)
    at = rig.head.emitter
    halt(rig.p.controller, rig.head)
    assert rig.next_status(1.0) == OK
    assert (rig.head.state, rig.head.homed) == (IDLE, 0)
    assert abs(rig.head.emitter - at) <= 20
    assert rig.run_to(100) == NOT_CALIBRATED


@pytest.mark.parametrize("state", MOVING)
def test_switched_off_a_head_rolls_out_and_is_counted_on(state):
    rig = moving(state)
    switch_off(rig.p.controller, rig.head)
    assert rig.next_status(2.0) is None
    assert (rig.head.state, rig.head.drive_cmd, rig.r.lines.count) == (IDLE, 0, 0)
    assert rig.r.plant.train.velocity == 0.0
    counted = (rig.r.plant.train.position - rig.p.plant.encoder.origin) / EMITTER
    assert abs(counted - rig.head.emitter) <= 1.0
    assert rig.run_to(500) == OK
